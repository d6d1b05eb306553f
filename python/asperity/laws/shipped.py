"""Laws that come along, each a function in UFL to read, to use, and to start from.

Moduli and strengths are in one unit of stress [force/length^2].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from asperity.laws.definition import law

NEWTON = 8  # iterations of Voce's return, which converge from one side without a bound
HALLEY = 3  # iterations of Perzyna's return, to 1e-13 of the excess for exponents up to 20
SHORT = 1e-3  # step over the relaxation time below which a series is more accurate than its closed form


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
    hardening = (yield_strength, tangent_modulus, kinematic_share)
    return _radial_return(strain, state, E, nu, hardening, lambda excess, stiffness: excess / stiffness)


def _radial_return(
    strain: Any, state: Any, E: float, nu: float, hardening: tuple[Any, Any, Any], flow_of: Callable[[Any, Any], Any]
) -> Any:
    """Stress and state after the flow that follows from the excess over the yield stress and what it loses by flow.

    Args:
        hardening: strength, tangent modulus and kinematic share as `j2` takes them
    """
    import ufl

    yield_strength, tangent_modulus, kinematic_share = hardening
    mu, H = E / (2.0 * (1.0 + nu)), E * tangent_modulus / (E - tangent_modulus)
    back = 2.0 / 3.0 * kinematic_share * H * state.plastic_strain
    trial = hooke(strain - state.plastic_strain, E, nu)
    s = ufl.dev(trial) - back
    size = yield_strength + (1.0 - kinematic_share) * H * state.accumulated
    yields = ufl.gt(1.5 * ufl.inner(s, s), ufl.max_value(size, 0.0) ** 2)
    # the root is differentiated only where it is far from zero
    q = ufl.sqrt(ufl.conditional(yields, 1.5 * ufl.inner(s, s), size**2))
    flow = ufl.conditional(yields, flow_of(q - size, 3.0 * mu + H), 0.0)
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

    before = saturation * ufl.exp(-rate * state.accumulated)

    def flow_of(excess: Any, stiffness: Any) -> Any:
        flow = 0.0
        for _ in range(NEWTON):
            left = before * ufl.exp(-rate * flow)
            flow = flow + (excess - stiffness * flow - before + left) / (stiffness + rate * left)
        return flow

    return _radial_return(strain, state, E, nu, (yield_strength + saturation - before, 0.0, 0.0), flow_of)


@law(**PLASTIC, time=True, strength=linear_strength)
def perzyna(
    strain: Any,
    state: Any,
    dt: Any,
    E: float,
    nu: float,
    yield_strength: float,
    viscosity: float,
    exponent: float = 1.0,
    tangent_modulus: float = 0.0,
    kinematic_share: float = 0.0,
) -> Any:
    """J2 plasticity that flows at the rate (overstress/viscosity)^exponent [1/s], by backward Euler.

    The unit of the viscosity is stress s^(1/exponent), the exponent at least 1. The part y of the excess that is left
    follows from y + r y^n = 1 by Halley's method from (1 + r)^(-1/n); Perzyna, Quart. Appl. Math. 20 (1963) 321.
    """
    import ufl

    def flow(excess: Any, stiffness: Any) -> Any:
        over = ufl.conditional(ufl.gt(excess, 0.0), excess, viscosity)  # has a power without yield, too
        r = stiffness * dt / viscosity * (over / viscosity) ** (exponent - 1.0)
        y = (1.0 + r) ** (-1.0 / exponent)
        for _ in range(HALLEY):
            rest = r * y**exponent
            slope = 1.0 + exponent * rest / y
            wrong = y + rest - 1.0
            y = y - 2.0 * wrong / (2.0 * slope - wrong * (exponent - 1.0) / y * (1.0 - 1.0 / slope))
        return over * (1.0 - y) / stiffness

    return _radial_return(strain, state, E, nu, (yield_strength, tangent_modulus, kinematic_share), flow)


def _at_once(strain: Any, state: Any, E: float, nu: float, share: float) -> Any:
    """Stress of `maxwell` for a motion that leaves its branch no time."""
    import ufl

    branch = state.branch + ufl.dev(strain - state.strain)
    return hooke(strain, E, nu) - E / (1.0 + nu) * share * (ufl.dev(strain) - branch)


@law(state={"branch": (3, 3), "strain": (3, 3)}, elastic=_at_once, symmetric=True, time=True)
def maxwell(strain: Any, state: Any, dt: Any, E: float, nu: float, relaxation_time: float, share: float = 1.0) -> Any:
    """Standard linear solid: a share of the shear modulus relaxes, the bulk modulus does not; exact at a constant rate.

    E and nu are those of a fast strain. The branch is the elastic part of its deviator: Simo & Hughes, Computational
    Inelasticity (1998), section 10.3.
    """
    import ufl

    x = dt / relaxation_time
    series = 1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0))
    left = ufl.conditional(ufl.lt(x, SHORT), series, (1.0 - ufl.exp(-x)) / ufl.max_value(x, SHORT))
    branch = ufl.exp(-x) * state.branch + left * ufl.dev(strain - state.strain)
    stress = hooke(strain, E, nu) - E / (1.0 + nu) * share * (ufl.dev(strain) - branch)
    return stress, {"branch": branch, "strain": strain}


def neo_hookean(F: Any, E: float, nu: float) -> Any:
    """Compressible neo-Hookean energy mu/2 (I1 - 3 - 2 ln J) + lambda/2 (ln J)^2; E and nu are those at rest."""
    import ufl

    lam, mu = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))
    lnJ = ufl.ln(ufl.det(F))
    return 0.5 * mu * (ufl.inner(F, F) - 3.0 - 2.0 * lnJ) + 0.5 * lam * lnJ**2


LAWS = {function.__name__: function for function in (hooke, j2, voce, perzyna, maxwell, neo_hookean)}
