"""Tangential force of a joint by its normal curve: Jaeger's law.

Two like elastic bodies are pressed together and then pushed sideways with Coulomb friction. Their tangential tractions
do not change the pressures, and the traction at the force T is mu times the pressure at the preload less that at a
smaller force, mu (p(P) - p(P - T/mu)), shifted displacements included (Cattaneo 1938, Mindlin 1949; for any shape:
Ciavarella, Int. J. Solids Struct. 35 (1998) 2349, Jaeger, Arch. Appl. Mech. 68 (1998) 434). So with r the
tangential over the normal compliance of a half-space and delta_i the approach of the interface,

    T = mu [P(delta_i) - P(delta_i - u_i/(mu r))],    r = (1 - nu/2)/(1 - nu).

It neglects the small tractions across the motion, and is exact for nu = 0. After yield P is the branch on which the
contact unloads and reloads.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.model.limits import positive
from asperity.runtime.display import short_repr
from asperity.vibration.law import Law

AS_STIFF = (
    "the normal curve is as stiff as the block: its contact is complete, or nearly, and no slip follows from it; "
    "take a smaller preload"
)
FIRST, DOWN, UP = 0, 1, 2  # legs of a path: first loading, to the opposite amplitude, and back
LEAST = 1e-3  # share of the compliance that the interface must have: less is lost in the error of the block's


def compliance_ratio(nu: float) -> float:
    """r, the tangential over the normal compliance of a half-space with Poisson's ratio `nu`."""
    return (1.0 - 0.5 * nu) / (1.0 - nu)


@dataclass(frozen=True, eq=False)
class SlipLaw:
    """Tangential force over displacement about a preload; loops follow by Masing's rule.

    Amplitudes are shares t = T/(mu P) of the limit of friction.

    Attributes:
        normal: law of the normal force, of the branch on which the contact unloads
        preload: normal force P, constant (force)
        friction: Coulomb's coefficient mu
        nu: Poisson's ratio of the bodies
        block: normal and tangential compliance of the block behind the interface (length/force), h/(A M) and h/(A G);
            zero for a law of the interface alone

    Raises:
        InputError: a value is not legal, or the interface has no compliance beside the block
        RangeError: the normal law does not reach the preload

    Examples:
        Mindlin's sphere: at half of the limit of friction the displacement is 1 - 0.5^(2/3) of that at the limit.

        >>> from asperity.slip import SlipLaw
        >>> law = SlipLaw(asp.PowerLaw(1.5), preload=1.0, friction=0.3, nu=0.0)
        >>> print(f"{law.displacement(0.5) / law.displacement(1.0):.6f}", f"{law.limit:g}")
        0.370039 0.3
    """

    normal: Law
    preload: float
    friction: float
    nu: float
    block: tuple[float, float] = (0.0, 0.0)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name in ("preload", "friction"):
            positive(name, getattr(self, name))
        if not -1.0 < self.nu <= 0.5:
            raise InputError(f"nu = {self.nu:g} is not legal: it must lie in (-1, 0.5]")
        slope = self.normal.at(float(self._approach(0.0)))[1]
        if 1.0 - self.block[0] * slope < LEAST:
            raise InputError(AS_STIFF)

    @property
    def limit(self) -> float:
        """Tangential force at which all of the contact slips, mu P (force)."""
        return self.friction * self.preload

    def displacement(self, t: ArrayLike) -> Array:
        """Displacement from rest at shares `t` in [0, 1] of the limit, block included (length)."""
        t = np.asarray(t, float)
        interface = self._scale * (self._approach(0.0) - self._approach(t) - self.block[0] * self.preload * t)
        return np.asarray(interface + self.block[1] * self.limit * t)

    def k_tangent(self, t: ArrayLike) -> Array:
        """DT/du of the first loading at shares `t` in [0, 1) of the limit (force/length)."""
        slope = self.normal.slope(self._approach(t))
        return np.asarray(1.0 / (compliance_ratio(self.nu) * (1.0 / slope - self.block[0]) + self.block[1]))

    def k_secant(self, t: ArrayLike) -> Array:
        """T/u at shares `t` in (0, 1] of the limit (force/length)."""
        t = np.asarray(t, float)
        return np.asarray(self.limit * t / self.displacement(t))

    def energy(self, t: ArrayLike) -> Array:
        """Energy that a closed loop between -t and t dissipates (force length), by Masing's rule.

        The compliance of the block cancels: 8 mu^2 r times the area between the normal curve and its chord is left.
        """
        t = np.asarray(t, float)
        z0, z = self._approach(0.0), self._approach(t)
        chord = 0.5 * self.preload * (2.0 - t) * (z0 - z)
        area = chord - (self.normal.potential(z0) - self.normal.potential(z))
        return np.asarray(8.0 * self.friction * self._scale * area)

    def eta(self, t: ArrayLike) -> Array:
        """Loss factor W/(pi T u) of loops of amplitudes `t`; twice the damping ratio at resonance."""
        t = np.asarray(t, float)
        return np.asarray(self.energy(t) / (math.pi * self.limit * t * self.displacement(t)))

    @property
    def _scale(self) -> float:
        return self.friction * compliance_ratio(self.nu)

    def _approach(self, t: ArrayLike) -> Array:
        """Approach at which the normal force is P (1 - t) (length)."""
        loads = self.preload * (1.0 - np.asarray(t, float))
        return np.reshape([self.normal.deflection(x) if x > 0.0 else 0.0 for x in loads.ravel().tolist()], loads.shape)


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
    """

    amplitude: float
    leg: Array
    u: Array
    T: Array
    slip_share: Array
    dissipated: Array

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

    @property
    def share(self) -> float:
        """Share of the area of contact that slips at the end of the first loading; NaN where unknown."""
        return float(self.slip_share[self.end(FIRST)])

    def loop(self) -> dict[str, float]:
        """Columns of slip_loops.csv."""
        return {
            "amplitude": self.amplitude, "T": self.force, "u": self.displacement, "k_secant": self.k_secant,
            "energy": self.energy, "eta": self.eta, "slip_share": self.share,
        }  # fmt: skip


def path_of_law(
    law: SlipLaw, amplitude: float, *, steps: int, area: Callable[[Array], Array] | None = None
) -> SlipPath:
    """Path of a law in equal steps of the force to an amplitude over the limit of friction, the loop by Masing's rule.

    Args:
        steps: of the first loading; the loop has four times as many
        area: gives the area of contact at normal forces (n,), in any unit, for the share that slips
    """
    # along a leg of the loop everything is twice as far apart as on the first loading
    t, fine = (np.linspace(0.0, amplitude, n * steps + 1) for n in (1, 2))
    fine = fine[1:]
    u, fine_u = law.displacement(t), 2.0 * law.displacement(fine)
    loss, fine_loss = 0.25 * law.energy(t), 0.5 * law.energy(fine)
    share: Array = np.full(5 * steps + 1, np.nan)
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
