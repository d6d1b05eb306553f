"""The four-parameter Iwan law of a joint (D. J. Segalman, J. Appl. Mech. 72 (2005) 752), by fit.

The density of sliders over the displacement phi at which they slip is R phi^chi up to phi_max, and a single slider of
the stiffness S at phi_max gives the stiffness that is left when all slips.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from asperity.arrays import Array
from asperity.slip.law import SlipLaw

_SHARES = np.array([0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9])  # of the limit, at which it is fitted


@dataclass(frozen=True)
class IwanLaw:
    """Four-parameter Iwan law.

    Attributes:
        F_S: force at which all slips (force)
        K_T: stiffness before any slip (force/length)
        chi: exponent, above -1; light loops lose the power 3 + chi of the force
        beta: stiffness of the last slider over that of the others, at least 0

    Examples:
        >>> from asperity.slip.iwan import IwanLaw
        >>> law = IwanLaw(F_S=2.0, K_T=4.0, chi=0.0, beta=0.0)
        >>> law.force(law.phi_max).item(), law.energy(law.phi_max).item()
        (2.0, 2.6666666666666665)
    """

    F_S: float
    K_T: float
    chi: float
    beta: float

    @property
    def phi_max(self) -> float:
        """Displacement at which all slips (length)."""
        return self.F_S * (1.0 + self.beta) / (self.K_T * (self.beta + (self.chi + 1.0) / (self.chi + 2.0)))

    @property
    def _R(self) -> float:
        return self.K_T * (self.chi + 1.0) / ((1.0 + self.beta) * self.phi_max ** (self.chi + 1.0))

    def force(self, u: ArrayLike) -> Array:
        """Force of the first loading at displacements u >= 0 (force), shape of `u`."""
        x, chi = np.minimum(np.asarray(u, float), self.phi_max), self.chi
        return np.asarray(self.K_T * x - self._R * x ** (chi + 2.0) / ((chi + 1.0) * (chi + 2.0)))

    def energy(self, a: ArrayLike) -> Array:
        """Energy of a closed loop between -a and a, a up to `phi_max` (force length), shape of `a`."""
        chi = self.chi
        return np.asarray(4.0 * self._R * np.asarray(a, float) ** (chi + 3.0) / ((chi + 2.0) * (chi + 3.0)))


def fit_iwan(law: SlipLaw) -> tuple[IwanLaw, float, float]:
    """Iwan law with limit and stiffness at rest of a law, exponent and beta by least squares of force and energy.

    Returns:
        the fit; greatest error of the force over the limit; greatest relative error of the energy

    Examples:
        >>> from asperity.slip import SlipLaw
        >>> from asperity.slip.iwan import fit_iwan
        >>> sphere = SlipLaw(asp.PowerLaw(1.5), preload=1.0, friction=0.3, nu=0.0)
        >>> iwan, of_force, of_energy = fit_iwan(sphere)
        >>> print(f"chi = {iwan.chi:.2f}, beta = {iwan.beta:.2f}, {of_force:.1%}, {of_energy:.0%}")
        chi = 0.08, beta = 0.80, 0.9%, 8%
    """
    u, energy = law.displacement(_SHARES), law.energy(_SHARES)
    stiffness = float(law.k_tangent(0.0))

    def misfits(x: Array) -> tuple[Array, Array]:
        iwan = IwanLaw(law.limit, stiffness, *x.tolist())
        slips = np.minimum(u, iwan.phi_max)
        beyond = 4.0 * iwan.F_S * (u - slips)
        return iwan.force(u) / law.limit - _SHARES, (iwan.energy(slips) + beyond) / energy - 1.0

    found = least_squares(
        lambda x: np.concatenate(misfits(x)), [0.0, 0.5], bounds=([-0.99, 0.0], [5.0, 1e3]), x_scale=[0.1, 0.5]
    )
    of_force, of_energy = (float(np.abs(part).max()) for part in misfits(found.x))
    return IwanLaw(law.limit, stiffness, *found.x.tolist()), of_force, of_energy
