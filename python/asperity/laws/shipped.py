"""Laws that come along, each a function in UFL to read, to use, and to start from.

Moduli and strengths are in one unit of stress [force/length^2].
"""

from __future__ import annotations

import math
from typing import Any

from asperity.laws.definition import law

NEWTON = 8  # iterations of Voce's return, which converge from one side without a bound


@law(symmetric=True)
def hooke(strain: Any, E: float, nu: float) -> Any:
    """Isotropic linear elasticity."""
    import ufl

    lam, mu = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))
    return lam * ufl.tr(strain) * ufl.Identity(3) + 2.0 * mu * strain


def without_flow(strain: Any, state: Any, E: float, nu: float) -> Any:
    """Elastic part of a law whose stress is Hooke's of the strain less the plastic strain."""
    return hooke(strain - state.plastic_strain, E, nu)


def linear_strength(a: float, E: float, yield_strength: float, tangent_modulus: float) -> float:
    """Yield stress of `j2` in monotone loading."""
    return yield_strength + E * tangent_modulus / (E - tangent_modulus) * a


def voce_strength(a: float, yield_strength: float, saturation: float, rate: float) -> float:
    """Yield stress of `voce`."""
    return yield_strength - saturation * math.expm1(-rate * a)


PLASTIC: dict[str, Any] = {
    "state": {"plastic_strain": (3, 3), "accumulated": ()},
    "elastic": without_flow,
    "symmetric": True,
}


@law(**PLASTIC, state_is_strain=True, strength=linear_strength)
def j2(
    strain: Any,
    state: Any,
    E: float,
    nu: float,
    yield_strength: float,
    tangent_modulus: float = 0.0,
    kinematic_share: float = 0.0,
) -> Any:
    """Radial return of J2 plasticity with linear hardening in closed form; the compiled law (solver/j2.hpp).

    Simo & Hughes, Computational Inelasticity (1998), box 3.2.
    """
    import ufl

    mu, H = E / (2.0 * (1.0 + nu)), E * tangent_modulus / (E - tangent_modulus)
    back = 2.0 / 3.0 * kinematic_share * H * state.plastic_strain
    trial = hooke(strain - state.plastic_strain, E, nu)
    s = ufl.dev(trial) - back
    size = yield_strength + (1.0 - kinematic_share) * H * state.accumulated
    yields = ufl.gt(1.5 * ufl.inner(s, s), ufl.max_value(size, 0.0) ** 2)
    # the root is differentiated only where it is far from zero
    q = ufl.sqrt(ufl.conditional(yields, 1.5 * ufl.inner(s, s), size**2))
    flow = ufl.conditional(yields, (q - size) / (3.0 * mu + H), 0.0)
    n = 1.5 * s / q
    return trial - 2.0 * mu * flow * n, {
        "plastic_strain": state.plastic_strain + flow * n,
        "accumulated": state.accumulated + flow,
    }


@law(**PLASTIC, state_is_strain=True, strength=voce_strength)
def voce(strain: Any, state: Any, E: float, nu: float, yield_strength: float, saturation: float, rate: float) -> Any:
    """J2 plasticity whose strength rises by `saturation` as 1 - exp(-rate a), a the accumulated plastic strain.

    Voce, J. Inst. Metals 74 (1948) 537. The equation of the return is convex: Newton's method rises to its root.
    """
    import ufl

    mu = E / (2.0 * (1.0 + nu))
    trial = hooke(strain - state.plastic_strain, E, nu)
    s = ufl.dev(trial)
    now = yield_strength + saturation * (1.0 - ufl.exp(-rate * state.accumulated))
    yields = ufl.gt(1.5 * ufl.inner(s, s), ufl.max_value(now, 0.0) ** 2)
    q = ufl.sqrt(ufl.conditional(yields, 1.5 * ufl.inner(s, s), now**2))
    flow = 0.0
    for _ in range(NEWTON):
        rest = saturation * ufl.exp(-rate * (state.accumulated + flow))
        flow = flow + (q - 3.0 * mu * flow - yield_strength - saturation + rest) / (3.0 * mu + rate * rest)
    flow = ufl.conditional(yields, flow, 0.0)
    n = 1.5 * s / q
    return trial - 2.0 * mu * flow * n, {
        "plastic_strain": state.plastic_strain + flow * n,
        "accumulated": state.accumulated + flow,
    }


def neo_hookean(F: Any, E: float, nu: float) -> Any:
    """Compressible neo-Hookean energy mu/2 (I1 - 3 - 2 ln J) + lambda/2 (ln J)^2; E and nu are those at rest."""
    import ufl

    lam, mu = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))
    lnJ = ufl.ln(ufl.det(F))
    return 0.5 * mu * (ufl.inner(F, F) - 3.0 - 2.0 * lnJ) + 0.5 * lam * lnJ**2


LAWS = {function.__name__: function for function in (hooke, j2, voce, neo_hookean)}
