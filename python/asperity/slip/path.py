"""A way of the flat from rest to an amplitude of the tangential force and around one loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from asperity.arrays import Array
from asperity.runtime.display import short_repr
from asperity.slip.law import SlipLaw

FIRST, DOWN, UP = 0, 1, 2  # legs: first loading, to the opposite amplitude, and back


@dataclass(frozen=True, eq=False)
class SlipPath:
    """Displacement and force step by step, from rest to an amplitude and around one loop; arrays of shape (n,).

    Attributes:
        amplitude: of the force over the limit of friction
        leg: 0 first loading, 1 down to the opposite amplitude, 2 up again; the end of each belongs to it
        u: displacement of the flat (length)
        T: tangential force (force)
        slip_share: share of the area of contact that slips in the step; NaN where unknown
        dissipated: by friction, since rest (force length)
        nodes: in contact, at the end of the first loading: x, y, area, slip since rest (length, length^2), shape
            (m, 4); none by a curve

    Examples:
        >>> from asperity.slip import SlipLaw
        >>> from asperity.slip.path import path_of_law
        >>> law = SlipLaw(asp.PowerLaw(1.5), preload=1.0, friction=0.3, nu=0.0)
        >>> path = path_of_law(law, 0.5, steps=4)
        >>> path.u.size, f"{path.energy / law.energy(0.5):.6f}", f"{path.k_secant / law.k_secant(0.5):.6f}"
        (21, '1.000000', '1.000000')
    """

    amplitude: float
    leg: Array
    u: Array
    T: Array
    slip_share: Array
    dissipated: Array
    nodes: Array = field(default_factory=lambda: np.zeros((0, 4)))

    __repr__ = short_repr

    def end(self, leg: int) -> int:
        """Row at the end of a leg."""
        return int(np.flatnonzero(self.leg == leg)[-1])

    @property
    def displacement(self) -> float:
        """Amplitude of the displacement, half of its range on the last leg (length)."""
        return float(self.u[-1] - self.u[self.end(DOWN)]) / 2.0

    @property
    def force(self) -> float:
        """Amplitude of the force, half of its range on the last leg (force)."""
        return float(self.T[-1] - self.T[self.end(DOWN)]) / 2.0

    @property
    def k_secant(self) -> float:
        """Amplitude of the force over that of the displacement (force/length)."""
        return self.force / self.displacement

    @property
    def energy(self) -> float:
        """Energy dissipated by friction in the loop (force length)."""
        return float(self.dissipated[-1] - self.dissipated[self.end(FIRST)])

    @property
    def eta(self) -> float:
        """Loss factor, the energy of the loop over pi T u."""
        return self.energy / (math.pi * self.force * self.displacement)

    def loop(self) -> dict[str, float]:
        """Columns of slip_loops.csv; the share that slips is that at the end of the first loading."""
        return {
            "amplitude": self.amplitude, "T": self.force, "u": self.displacement, "k_secant": self.k_secant,
            "energy": self.energy, "eta": self.eta, "slip_share": float(self.slip_share[self.end(FIRST)]),
        }  # fmt: skip

    def scaled(self, force: float, length: float) -> SlipPath:
        """Path in other units: forces times `force`, lengths times `length`."""
        loss, nodes = self.dissipated * force * length, self.nodes * [length, length, length**2, length]
        return replace(self, u=self.u * length, T=self.T * force, dissipated=loss, nodes=nodes)


def path_of_law(
    law: SlipLaw, amplitude: float, *, steps: int, area: Callable[[Array], Array] | None = None
) -> SlipPath:
    """Path of a law in equal steps of the force, the loop by Masing's rule.

    Args:
        law: of the joint
        amplitude: of the force over the limit of friction
        steps: of the first loading; the loop has four times as many
        area: gives the area of contact at normal forces (n,), in any unit, for the share that slips
    """
    # along a leg of the loop everything is twice as far apart as on the first loading
    t, fine = (np.linspace(0.0, amplitude, n * steps + 1) for n in (1, 2))
    fine = fine[1:]
    u, fine_u = law.displacement(t), 2.0 * law.displacement(fine)
    loss, fine_loss = 0.25 * law.energy(t), 0.5 * law.energy(fine)
    share = np.full(5 * steps + 1, np.nan)
    if area is not None:
        forces = law.preload * (1.0 - np.concatenate([t, fine, fine]))
        share = 1.0 - area(forces) / area(np.array([law.preload]))
    return SlipPath(
        amplitude,
        np.repeat([FIRST, DOWN, UP], [steps + 1, 2 * steps, 2 * steps]),
        np.concatenate([u, u[-1] - fine_u, fine_u - u[-1]]),
        law.limit * np.concatenate([t, amplitude - 2.0 * fine, 2.0 * fine - amplitude]),
        share,
        np.concatenate([loss, loss[-1] + fine_loss, loss[-1] + fine_loss[-1] + fine_loss]),
    )
