"""J2 plasticity at a point, in closed form and by rate equations: what the compiled kernels are compared with."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array


def j2_path(
    strain: ArrayLike, E: float, nu: float, Y: float, E_t: float, rtol: float = 1e-11, share: float = 0.0
) -> tuple[Array, Array]:
    """Stress (m, 3, 3) and accumulated plastic strain (m,) at the corners of a path of strains (m, 3, 3) from zero.

    The J2 rate equations are integrated along straight segments of strain, without a return map:
    s' = 2 mu (e' - lambda' n), x' = 2/3 beta H lambda' n, n = (s - x)/|s - x|, lambda' = n:e' 2 mu/(2 mu + 2H/3) once
    |s - x| = sqrt(2/3)(Y + (1 - beta) H p), with beta = `share`. On a straight segment n turns towards e', so flow
    continues once it has begun. The point where it begins solves a quadratic equation; the rest is an ODE
    (Dormand-Prince 8(5,3)) to `rtol`.
    """
    from scipy.integrate import solve_ivp

    mu, bulk, H = E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu)), E * E_t / (E - E_t)
    flowing, back = 1 / (1 + H / (3 * mu)), 2 / 3 * share * H

    def rate(_: float, state: Array, step: Array) -> Array:
        n = (state[:9] - state[9:18]).reshape(3, 3)
        n = n / np.linalg.norm(n)
        flow = flowing * float(np.sum(n * step))
        return np.concatenate([2 * mu * (step - flow * n).ravel(), back * flow * n.ravel(), [math.sqrt(2 / 3) * flow]])

    s, x, p, before = np.zeros((3, 3)), np.zeros((3, 3)), 0.0, np.zeros((3, 3))
    stress, accumulated = [], []
    for now in np.asarray(strain, float):
        trace = np.trace(now)
        step = now - before
        step = step - np.trace(step) / 3 * np.eye(3)
        elastic = _elastic_share(s - x, 2 * mu * step, math.sqrt(2 / 3) * (Y + (1 - share) * H * p))
        s = s + elastic * 2 * mu * step
        if elastic < 1:
            rest = (1 - elastic) * step
            tolerance = {"rtol": rtol, "atol": rtol * np.append(np.full(18, Y), Y / E)}
            begin = np.concatenate([s.ravel(), x.ravel(), [p]])
            end = solve_ivp(rate, (0, 1), begin, args=(rest,), method="DOP853", **tolerance).y[:, -1]
            s, x, p = end[:9].reshape(3, 3), end[9:18].reshape(3, 3), float(end[18])
        stress.append(s + bulk * trace * np.eye(3))
        accumulated.append(p)
        before = now
    return np.array(stress), np.array(accumulated)


def _elastic_share(s: Array, ds: Array, radius: float) -> float:
    """Largest t in [0, 1] with |s + t ds| <= radius."""
    a, b = float(np.sum(ds * ds)), float(np.sum(s * ds))
    c = min(float(np.sum(s * s)) - radius**2, 0.0)
    if a == 0:
        return 1.0
    return min(1.0, max(0.0, (-b + math.sqrt(b * b - a * c)) / a))


def _piecewise(
    strain: ArrayLike, elastic: float, plastic: float, Y: float, H: float, share: float
) -> tuple[Array, Array]:
    """(stress, accumulated plastic strain) of sigma = elastic e - plastic e_p.

    Exact for strain that varies monotonically between the given values, because then stress and
    plastic flow have a constant direction: |sigma - beta H e_p| <= Y + (1 - beta) H p.
    """
    stress, accumulated = [], []
    e_p = p = 0.0
    for e in np.asarray(strain, float):
        trial = elastic * e - plastic * e_p
        driving = trial - share * H * e_p
        flow = max(0.0, abs(driving) - Y - (1 - share) * H * p) / (plastic + H)
        e_p += math.copysign(flow, driving)
        p += flow
        stress.append(elastic * e - plastic * e_p)
        accumulated.append(p)
    return np.array(stress), np.array(accumulated)


def uniaxial_stress(strain: ArrayLike, E: float, Y: float, E_t: float, share: float = 0.0) -> tuple[Array, Array]:
    """(stress, accumulated plastic strain) of a bar along axial strains (m,) that start from zero.

    The strain is monotonic between entries; `share` of the hardening is kinematic.
    """
    return _piecewise(strain, E, E, Y, E * E_t / (E - E_t), share)


def confined_stress(
    strain: ArrayLike, E: float, nu: float, Y: float, E_t: float, share: float = 0.0
) -> tuple[Array, Array, Array]:
    """(axial stress, lateral stress, accumulated plastic strain) without lateral strain, see `uniaxial_stress`.

    The stress difference is q = 2 mu e - 3 mu e_p, the mean stress K e: yield at |e| = Y/(2 mu),
    and p = (2 mu |e| - Y)/(3 mu + H) on the first loading.
    """
    mu, bulk = E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu))
    q, p = _piecewise(strain, 2 * mu, 3 * mu, Y, E * E_t / (E - E_t), share)
    mean = bulk * np.asarray(strain, float)
    return mean + 2 / 3 * q, mean - q / 3, p
