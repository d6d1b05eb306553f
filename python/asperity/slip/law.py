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
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.model.limits import positive
from asperity.runtime.display import short_repr
from asperity.vibration.law import Law


def compliance_ratio(nu: float) -> float:
    """r, the tangential over the normal compliance of a half-space with Poisson's ratio `nu`."""
    return (1.0 - 0.5 * nu) / (1.0 - nu)


@dataclass(frozen=True, eq=False)
class SlipLaw:
    """Tangential force over displacement about a preload; loops follow by Masing's rule.

    Amplitudes are shares t = T/(mu P) of the limit of friction.

    Attributes:
        normal: law of the normal force on the interface, of the branch on which the contact unloads
        preload: normal force P, constant (force)
        friction: Coulomb's coefficient mu
        nu: Poisson's ratio of the bodies
        block: tangential compliance of the block behind the interface, h/(A G) (length/force); of the interface alone 0

    Raises:
        InputError: a value is not legal
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
    block: float = 0.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name in ("preload", "friction"):
            positive(name, getattr(self, name))
        if not -1.0 < self.nu <= 0.5:
            raise InputError(f"nu = {self.nu:g} is not legal: it must lie in (-1, 0.5]")
        self.normal.deflection(self.preload)

    @property
    def limit(self) -> float:
        """Tangential force at which all of the contact slips, mu P (force)."""
        return self.friction * self.preload

    def displacement(self, t: ArrayLike) -> Array:
        """Displacement from rest at shares `t` in [0, 1] of the limit, block included (length)."""
        t = np.asarray(t, float)
        return np.asarray(self._scale * (self._approach(0.0) - self._approach(t)) + self.block * self.limit * t)

    def k_tangent(self, t: ArrayLike) -> Array:
        """DT/du of the first loading at shares `t` in [0, 1) of the limit (force/length)."""
        slope = self.normal.slope(self._approach(t))
        return np.asarray(1.0 / (compliance_ratio(self.nu) / slope + self.block))

    def k_secant(self, t: ArrayLike) -> Array:
        """T/u at shares `t` in (0, 1] of the limit (force/length)."""
        t = np.asarray(t, float)
        return np.asarray(self.limit * t / self.displacement(t))

    def energy(self, t: ArrayLike) -> Array:
        """Energy that a closed loop between -t and t dissipates (force length), by Masing's rule.

        It is 8 mu^2 r times the area between the normal curve and its chord.
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

    def path(self, amplitude: float, steps: int) -> dict[str, Array]:
        """Equal steps of the force from rest to an amplitude and around one loop, by Masing's rule.

        Args:
            amplitude: share of the limit
            steps: of the first loading; the loop has four times as many

        Returns:
            displacement u (length), force T, energy dissipated since rest (force length), and the normal force whose
            contact sticks; each (5 steps + 1,)
        """
        # along a leg of the loop everything is twice as far apart as on the first loading
        first, leg = (np.linspace(0.0, amplitude, n * steps + 1) for n in (1, 2))
        leg = leg[1:]
        u, moved = self.displacement(first), 2.0 * self.displacement(leg)
        lost, more = 0.25 * self.energy(first), 0.5 * self.energy(leg)
        return {
            "u": np.concatenate([u, u[-1] - moved, moved - u[-1]]),
            "T": self.limit * np.concatenate([first, amplitude - 2.0 * leg, 2.0 * leg - amplitude]),
            "dissipated": np.concatenate([lost, lost[-1] + more, lost[-1] + more[-1] + more]),
            "sticks": self.preload * (1.0 - np.concatenate([first, leg, leg])),
        }

    @property
    def _scale(self) -> float:
        return self.friction * compliance_ratio(self.nu)

    def _approach(self, t: ArrayLike) -> Array:
        """Approach at which the normal force is P (1 - t) (length)."""
        loads = self.preload * (1.0 - np.asarray(t, float))
        return np.reshape([self.normal.deflection(x) if x > 0.0 else 0.0 for x in loads.ravel().tolist()], loads.shape)
