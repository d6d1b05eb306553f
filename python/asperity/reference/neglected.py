"""What the solver leaves out: adhesion by Tabor's parameter, pull-off and stickiness, and radiation by the inertia.

In the formulas of adhesion R is the radius of a sphere [m], w the work of adhesion [J/m^2], E_prime the contact modulus
[Pa], z0 the range of the attraction [m]. A rough surface has the rms slope h' and the rms curvature h'', half of its
rms Laplacian [1/m].
"""

from __future__ import annotations

from math import pi, sqrt

RANGE = 0.3e-9  # of the attraction between two surfaces, about the distance of atoms [m]
KAPPA = 2.0  # of the contact area of a rough surface, A p^-1 E' h'
LONG_WAVES = 0.3  # greatest side of a patch over the length of shear waves for which it counts as a point


def tabor_parameter(R: float, w: float, E_prime: float, z0: float = RANGE) -> float:
    """(R w^2/(E'^2 z0^3))^(1/3): large for JKR, small for DMT. Tabor, J. Colloid Interface Sci. 58 (1977) 2."""
    return float((R * w**2 / (E_prime**2 * z0**3)) ** (1.0 / 3.0))


def pull_off(R: float, w: float, tabor: float) -> float:
    """Force that pulls an elastic sphere off a flat [N], between 3/2 pi w R (JKR) and 2 pi w R (DMT).

    Carpick, Ogletree & Salmeron, J. Colloid Interface Sci. 211 (1999) 395, with lambda = 1.157 mu (Johnson & Greenwood,
    ibid. 192 (1997) 326); within 2 % of the equations of Maugis.

    Examples:
        >>> from math import pi, sqrt
        >>> [round(asp.reference.pull_off(1.0, 1.0, mu) / pi, 3) for mu in (1e-6, 1e6)]
        [2.0, 1.5]
    """
    scale = 4.04 * (1.157 * tabor) ** 1.4
    return pi * w * R * (1.75 - 0.25 * (scale - 1.0) / (scale + 1.0))


def stickiness(slope: float, curvature: float, w: float, E_prime: float, z0: float = RANGE) -> float:
    """h' E' z0/(kappa w) (h'^2/(h'' z0))^(2/3): a rough elastic surface is sticky below 1.

    Pastewka & Robbins, PNAS 111 (2014) 3298, eq. 10 with kappa = 2, diameter of contacts 4 h'/h'' and
    pi (3/16)^(2/3) = 1.03 as 1: so the program of that group has it (ContactEngineering/Adhesion,
    examples/adhesive_simulation_rough.py). It needs a range z0 below a tenth of the gaps next to contacts,
    16 h'^2/(3 h''). A plastic surface is less sticky.
    """
    return float(slope * E_prime * z0 / (KAPPA * w) * (slope**2 / (curvature * z0)) ** (2.0 / 3.0))


def radiation_loss(k: float, omega: float, *, E: float, nu: float, density: float) -> float:
    """Loss factor of a contact of stiffness k by radiation into a half-space, twice the damping ratio at resonance.

    Valid while the waves at the angular frequency omega are far longer than the patch. Lysmer's analogue of a disc, a
    dashpot of 0.85 K a/c_s (Lysmer & Richart, J. Soil Mech. Found. Div. ASCE 92 (1966) 65), is within 10 % of Lamb's
    half-space, whatever the pressure (Miller & Pursey, Proc. R. Soc. Lond. A 223 (1954) 521).
    """
    shear_modulus = 0.5 * E / (1.0 + nu)
    return 0.2125 * (1.0 - nu) * k * omega / (shear_modulus * sqrt(shear_modulus / density))
