"""The first loading of a curve, which meshes are compared along: values between its steps, its rows, its open area.

Later branches are moved as the end of the first loading.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np
from scipy.interpolate import PchipInterpolator

from asperity.arrays import Array, Flags, Floats
from asperity.curve import Curve
from asperity.curve.curve import EDGE
from asperity.curve.slope import SINGLE_CONTACT, legs

TINY = 1e-300  # what has no logarithm is less


def over_force(curve: Curve, name: str, P_star: Floats) -> Floats:
    """A measure of the contact along the first loading at given forces P*; see `in_logarithms`."""
    loading = curve.branch == "load"
    return in_logarithms(curve.P_star[loading], getattr(curve, name)[loading], P_star)


def loading_force(curve: Curve, delta_star: Floats) -> Floats:
    """P* of the first loading at given approaches, before the first step with a force that of a single contact."""
    branch = curve.loading()
    return in_logarithms(branch.delta_star, branch.P_star, delta_star, SINGLE_CONTACT)


def in_logarithms(x: Floats, y: Floats, at: Floats, before: float | None = None) -> Floats:
    """Values at `at` of a shape-preserving cubic through the logarithms of the rising x and the positive y (n,).

    Below the first point the power `before` goes on: a cubic through steps that follow closely on a late first touch
    would leave all bounds. Without it that of the first two points does. Beyond the last point the tangent goes on.
    All are NaN where too few points are known.
    """
    known = rising(x) & (y > 0.0)
    if np.count_nonzero(known) < (2 if before is None else 1):
        return np.full(len(at), np.nan)
    x, y, at = np.log(x[known]), np.log(y[known]), np.log(np.maximum(at, TINY))
    if before is None:
        before = (y[1] - y[0]) / (x[1] - x[0])
    if len(x) == 1:
        return np.asarray(np.exp(y[0] + before * (at - x[0])))
    law, inside = PchipInterpolator(x, y), np.clip(at, x[0], x[-1])
    slope = np.where(at < x[0], before, law(x[-1], 1))
    return np.asarray(np.exp(law(inside) + slope * (at - inside)))


def rising(values: Floats, by: float = 0.0) -> Flags:
    """Steps of a loading whose value exceeds zero and all before, by more than a part of it (n,)."""
    return values > (1.0 + by) * np.maximum.accumulate(np.append(0.0, values[:-1]))


def shifted(curve: Curve, bar: Floats, values: Floats, vanishes: bool = True) -> Floats:
    """What an error of P* changes in a measure of the contact (n,), on the branches after the first loading.

    There the force keeps its bar while it vanishes, and the measure follows the force. A measure that vanishes with the
    contact is therefore unknown as a whole near the end, where the flat lifts off.

    Args:
        bar: of P* (n,)
        values: of the measure (n,)
        vanishes: with the contact, as all measures but the mean gap do
    """
    found = np.zeros(len(curve))
    for begin, end in legs(curve.branch)[1:]:
        leg = slice(begin - 1, end)
        order = np.argsort(curve.P_star[leg])
        P, value = curve.P_star[leg][order], values[leg][order]
        if vanishes:
            P, value = np.append(0.0, P), np.append(0.0, value)
        ends = (np.interp(curve.P_star + sign * bar, P, value) for sign in (1.0, -1.0))
        found[begin:end] = np.max([np.abs(at - values) for at in ends], axis=0)[begin:end]
    return found


def judged_rows(curve: Curve, steps: int) -> Flags:
    """Rows whose bar is judged: the first loading from the end of the first of the planned steps on.

    The midpoint rule puts smaller ones before, where the contact is too small for a mesh made for the planned ones.
    """
    loading = curve.branch == "load"
    return loading & (curve.delta_star >= 0.999 * curve.delta_star[loading].max() / steps)


def relative(bar: Floats, P_star: Floats, without: float = inf) -> Floats:
    """Error bars over the force; `without` where there is none."""
    return np.divide(bar, P_star, out=np.full(len(bar), without), where=P_star > 0.0)


def scaled(curve: Curve, factor: Floats) -> Curve:
    """A curve with the forces of its first loading times a factor (n,), those of later branches times its last one."""
    of_row = factor[rows_of_loading(curve.branch == "load")]
    return replace(curve, P_star=curve.P_star * of_row).with_force(curve.force * of_row)


def rows_of_loading(loading: Flags) -> Array:
    """Place of each row among those of the first loading (rows,); of later branches that of its last one."""
    return np.where(loading, np.cumsum(loading), np.count_nonzero(loading)) - 1


def open_area(curve: Curve, delta_star: Floats) -> Floats:
    """Error of the area of contact over the area along the first loading, no more than 1, at given approaches.

    A spot of a few facets is larger or smaller by chance from mesh to mesh, and its force with it. Two such meshes may
    agree by chance, and their difference shows nothing; the area that cut facets leave open shows it. It is twice what
    the area deviates by.
    """
    branch = curve.loading()
    area, edge = branch.area_fraction, np.nan_to_num(branch.edge_fraction)
    error = np.sqrt(np.maximum(branch.error_area_fraction**2 - (EDGE * edge) ** 2, 0.0))
    return np.interp(delta_star, branch.delta_star, np.where(area > error, relative(error, area, 1.0), 1.0))
