"""Slope of a curve of force over approach at its steps, branch by branch."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array

SINGLE_CONTACT = 1.5  # exponent of the force in the approach where a smooth summit is touched first, of Hertz


def legs(branch: Array) -> list[tuple[int, int]]:
    """First row of each loading and unloading of a curve, and the row after its last, by the names of the branches."""
    starts = np.flatnonzero(branch[1:] != branch[:-1]) + 1
    return list(pairwise([0, *map(int, starts), len(branch)]))


def slopes(delta: ArrayLike, force: ArrayLike, branch: ArrayLike) -> tuple[Array, Array]:
    """Slope dF/d(delta) at the steps of a curve, and its relative change from one step to the next.

    The force grows about as a power of the approach from where it is zero, so differences are taken of the logarithms:
    a power law has its exact slope at every step. The approach counts from the last step of the branch without force,
    on the first branch from first touch. A branch begins with the last step of the one before; one that never is
    without force is differentiated on linear axes.

    The change is that of the exponent, which begins as that of a single contact. It shows what the steps miss, such as
    spots that are touched within one, and how far errors of the force differ from step to step.

    Args:
        delta, force, branch: approach [length], force and name of the branch of each step, (n,)

    Returns:
        slopes (n,) [force/length], 0 without force, NaN where a branch has one step with a force only or approaches
        that are not monotone; their relative changes (n,), unknown likewise

    Examples:
        >>> slope, change = slopes([1.0, 2.0, 4.0], [1.0, 4.0, 16.0], ["load"] * 3)
        >>> slope.round(9).tolist(), change.round(9).tolist()
        ([2.0, 4.0, 8.0], [0.25, 0.0, 0.0])
    """
    x, F, name = np.asarray(delta, float), np.asarray(force, float), np.asarray(branch, str)
    slope, change = np.full(x.size, np.nan), np.full(x.size, np.nan)
    for begin, end in legs(name):
        first = max(begin - 1, 0)
        found = _of_branch(x[first:end], F[first:end], None if begin else 0.0)
        slope[begin:end], change[begin:end] = (values[begin - first :] for values in found)
    return slope, change


def _of_branch(x: Array, F: Array, touch: float | None) -> tuple[Array, Array]:
    """Slopes and relative changes of one branch, see `slopes`.

    Where the force is zero at no step it begins at the approach `touch`; None if that is unknown.
    """
    if x.size > 1 and x[0] > x[-1]:
        slope, change = _of_branch(x[::-1], F[::-1], touch)
        return slope[::-1], change[::-1]
    slope, change = np.zeros(x.size), np.zeros(x.size)
    if np.any(np.diff(x) <= 0.0):
        return slope + np.nan, change + np.nan
    without = np.flatnonzero(F <= 0.0)
    n = without[-1] + 1 if without.size else 0
    origin = x[n - 1] if n else touch
    X: Array = x[n:]
    Y: Array = F[n:]
    scale: Array = np.ones(X.size)
    before: Array = np.empty(0)
    if origin is not None and np.all(X > origin):
        scale = Y / (X - origin)
        X, Y = np.log(X - origin), np.log(Y)
        before = np.array([SINGLE_CONTACT])
    if X.size < 2:
        slope[n:] = change[n:] = np.nan
        return slope, change
    exponent, steps = np.asarray(np.gradient(Y, X)), np.abs(np.diff([*before, *np.diff(Y) / np.diff(X)]))
    slope[n:] = exponent * scale
    size = np.maximum(np.abs(exponent), np.finfo(float).tiny)
    change[n:] = np.pad(steps, (X.size - 1 - steps.size, 1), mode="edge") / size if steps.size else np.nan
    return slope, change


def planned_rows(delta: Array) -> Array:
    """Indices (m,) of the steps that end at the planned, equal increments of the approach delta (n,) of a loading.

    A fit over all points would give light loads a weight that grows with the number of steps that were cut. The
    increment is the smallest one whose multiples are all present. A path without such an increment (driven by force, or
    measured) keeps all its points.
    """
    every = np.arange(len(delta))
    if not len(delta) or np.any(np.diff(delta, prepend=0.0) <= 0):
        return every
    whole = delta / delta[-1]
    for part in whole[:-2]:
        if part * len(whole) < 0.5:
            continue  # more increments than rows
        ends = part * np.arange(1, round(1 / part) + 1)
        rows = np.minimum(np.searchsorted(whole, ends - 1e-6 * part), len(whole) - 1)
        if np.all(np.abs(whole[rows] - ends) < 1e-6 * part) and rows[-1] == len(whole) - 1:
            return rows
    return every


def fitted_rows(delta: Array, force: Array) -> Array:
    """Indices (m,) of the steps to which the power law of a loading is fitted: the planned or measured ones in contact.

    Every power law of a curve uses these steps; approach and force (n,) in any unit.
    """
    steps = np.diff(delta)
    # evenly sampled from some approach on: measured, for a run cuts steps in halves
    sampled = len(steps) > 1 and delta[0] > 2.5 * steps[0] > 0.0 and np.ptp(steps) < 0.1 * steps[0]
    rows = np.arange(len(delta)) if sampled else planned_rows(delta)
    return rows[(delta[rows] > 0) & (force[rows] > 0)]
