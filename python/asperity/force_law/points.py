"""Measured points of a law: how much they scatter, a smoothing spline through them, and where contact begins."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_smoothing_spline
from scipy.optimize import minimize_scalar

from asperity.arrays import Array
from asperity.errors import InputError

MIN_POINTS = 5  # of a table without slopes, and of a fitted origin
TOUCH = 1e-9  # share of the largest force above which a row is in contact
MAX_ROUGHNESS = 0.12  # relative uncertainty of the stiffness through points above which they are noisy
FALL = 0.05  # share of the largest force by which the force of a measured curve may fall
_HEAVY = 0.25  # share of the largest force above which points are judged: at light loads few facets touch
_DEVIATION = 0.683  # share of a normal distribution within its standard deviation


def smoothed(z: Array, F: Array) -> tuple[Array, Array]:
    """Forces and stiffnesses of the smoothing spline of ln F over ln z, whose penalty is zero for a power law.

    The weights are those of noise of one size in F; for noise of one share of F equal ones would be nearer.
    """
    spline = make_smoothing_spline(np.log(z), np.log(F), w=(F / F.max()) ** 2)
    force = np.exp(spline(np.log(z)))
    return force, force / z * spline.derivative()(np.log(z))


def roughness(z: Array, F: Array) -> float:
    """Relative uncertainty of the stiffness through at least 5 rising points by their scatter.

    Scatter is the distance of a point from the cubic through its four neighbours in (ln z, ln F), after Gasser, Sroka
    & Jennen-Steinmetz, Biometrika 73 (1986) 625, who take the line through two neighbours; a quantile counts. A smooth
    curve has no such scatter, and a few corners, as where the next summit touches, hardly change the quantile. A
    polynomial fitted to many points would misread both as noise.
    """
    x, y, at = np.log(z), np.log(F), np.arange(z.size)
    five = np.clip(at - 2, 0, z.size - 5)[:, None] + np.arange(5)
    four = five[five != at[:, None]].reshape(-1, 4)
    powers = (x[four] - x[:, None])[:, None, :] / (x[-1] - x[0])
    weights = np.linalg.solve(powers ** np.arange(4)[:, None], np.eye(4)[:, :1])[..., 0]
    scatter = np.abs(y - np.sum(weights * y[four], axis=1)) / np.sqrt(1.0 + np.sum(weights**2, axis=1))
    rise = np.abs(y[five[:, -1]] - y[five[:, 0]]) / 4.0  # from one point to the next
    return float(np.quantile((np.sqrt(2.0) * scatter / rise)[F >= _HEAVY * F.max()], _DEVIATION))


def fit_origin(delta: Array, force: Array) -> float:
    """Approach of first contact of measured points: the best offset of a power law in (ln z, ln F)."""
    order = np.argsort(delta, kind="stable")
    z, f = delta[order], force[order]
    touching = f > TOUCH * f.max()
    if touching.sum() < MIN_POINTS:
        raise InputError(f"the branch has {int(touching.sum())} rows in contact, at least {MIN_POINTS} are needed")
    first, span = z[touching][0], z[-1] - z[touching][0]
    lowest = float(z[~touching].max(initial=first - span))
    z, f = z[touching], np.log(f[touching])

    def misfit(offset: float) -> float:
        basis = np.vander(np.log(z - offset), 2)
        return float(np.sum((f - basis @ np.linalg.lstsq(basis, f)[0]) ** 2))

    if lowest >= first - 1e-6 * span:
        return lowest
    ends = (lowest, first - 1e-6 * span)
    return float(minimize_scalar(misfit, bounds=ends, method="bounded", options={"xatol": 1e-12 * span}).x)
