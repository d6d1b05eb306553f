"""Rate equations of J2 plasticity, integrated without a return map: what the compiled kernels are compared with."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.reference import hardening_modulus


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

    mu, bulk, H = E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu)), hardening_modulus(E, E_t)
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
