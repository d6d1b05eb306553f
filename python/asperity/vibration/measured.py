"""Measured curves: rows of approach and force, made to a law with what the scatter of the rows leaves open."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.vibration.curve_law import MIN_POINTS, CurveLaw
from asperity.vibration.local_fit import LocalFit

FALL = 0.05  # share of the greatest force by which the law of a contact may fall
SCATTER = 0.12  # of the force between neighbours, above which the law is the fit and not the points
_ORDERED = 0.9  # rank correlation of approach and time from which rows are in the order of time
_STEPS = 0.856  # 1.4826/sqrt(3): deviation of a step between neighbours over the median of second differences
_NODES = 60  # of a law that is a fit
_LATE = 0.5  # first force over the greatest, above which a curve does not begin at first contact


def branches(delta: Array, force: Array) -> tuple[Array, Array, str]:
    """Rows in the order of the law (m,), their branch, and what was done; for rows without a column of branches.

    The greatest force ends the loading, where the rows are in the order of time; others are sorted by their approach.
    """
    top = int(np.argmax(force))
    up, down = _trend(delta[: top + 1]), _trend(delta[top:])
    if up > _ORDERED and down < -_ORDERED and min(top, delta.size - top) > MIN_POINTS:
        names = np.where(np.arange(delta.size) <= top, "load", "unload")
        return np.arange(delta.size), names, f"unloading in the {delta.size - top - 1} rows after the greatest force"
    held = up > _ORDERED and top > MIN_POINTS >= delta.size - top  # a hold, or the first rows of a return
    rows = np.arange(top + 1) if held else np.arange(delta.size)
    ordered = rows[np.argsort(delta[rows], kind="stable")]
    done = [f"{delta.size - rows.size} rows after the greatest force dropped"] * (rows.size < delta.size)
    done += ["rows sorted by approach"] * bool(np.any(ordered != rows) and _trend(delta[rows]) < _ORDERED)
    return ordered, np.full(rows.size, "load"), ", ".join(done)


def _trend(delta: Array) -> float:
    """Rank correlation of the approach with the order of the rows."""
    from scipy.stats import spearmanr  # here, for it takes half a second, and only measured curves need it

    if delta.size < 3 or np.ptp(delta) == 0.0:
        return 1.0 if delta.size < 3 else 0.0
    return float(spearmanr(np.arange(delta.size), delta).statistic)


def law_of_rows(delta: Array, force: Array, load: float, name: str = "measured curve") -> tuple[CurveLaw, str]:
    """Law through the rows of one branch about a load (force), and a sentence on what was done.

    Rows of one approach count as their mean. The law goes through rows that scatter little, and is the local fit of
    others. Its bars are those of contact point, stiffness and curvature by the scatter.

    Raises:
        InputError: the rows do not begin at first contact, fall, or are too few
    """
    known, groups = np.unique(delta, return_inverse=True)
    f = np.bincount(groups, force) / np.bincount(groups)
    if known.size < MIN_POINTS:
        raise InputError(f"the curve has {known.size} approaches, at least {MIN_POINTS} are needed")
    fit, lead = LocalFit(known, f, measured=True), float(np.median(f[: max(3, f.size // 20)]))
    origin, of_origin = fit.origin
    origin *= abs(origin) > of_origin  # an approach from first contact, as far as the rows tell
    far = lead > 4.0 * fit.noise + 0.02 * f.max() and origin < known[0] - 0.5 * np.ptp(known)
    if lead > _LATE * f.max() or far:
        raise InputError(
            f"the curve does not begin at first contact: its first force {f[0]:.4g} is {100 * f[0] / f.max():.0f} % of "
            "the greatest, and no fit reaches zero near it; give the rows from first contact on, with the zero of the "
            "force subtracted"
        )
    on = (known > origin) & (f > 0.0)
    z, F = known[on] - origin, f[on]
    scatter = _STEPS * float(np.median(np.abs(np.diff(F - fit.curve(z)[0], 2))))  # a kink leaves smooth residuals
    top = np.maximum.accumulate(f)
    if np.any(falls := top - f > FALL * top + 8.0 * scatter):
        at = int(np.argmax(falls))
        raise InputError(
            f"the force of the curve falls by {top[at] - f[at]:.4g}, by more than {100 * FALL:g} % and the scatter, "
            f"at the approach {known[at]:.5g}: no law of a contact; name its unloading in a column branch, or smooth it"
        )
    if np.all(np.diff(F) > 0.0) and scatter < SCATTER * np.median(np.diff(F)[F[1:] > 0.25 * F.max()]):
        law, kind = CurveLaw(z, F, name=name).about(load, origin=of_origin), "through the points"
    else:
        nodes = z[-1] * np.geomspace(max(z[0] / z[-1], np.exp(-4.0)), 1.0, _NODES)
        smooth, n = fit.curve(nodes)
        rising = np.append(True, smooth[1:] > np.maximum.accumulate(smooth)[:-1])
        nodes, smooth, n = nodes[rising], smooth[rising], np.maximum(n[rising], 1e-3)
        law, kind = CurveLaw(nodes, smooth, name=name, k=n * smooth / nodes).about(load, fit), "a fit through them"
    return law, (
        f"{name}: {known.size - on.sum()} rows before contact dropped, {delta.size - known.size} of equal approach "
        f"averaged, contact at {origin:.5g} +- {of_origin:.2g}{', by extrapolation' * bool(origin < known[0])}, noise "
        f"{fit.noise:.2g} ({100 * fit.noise / load:.2g} % of the preload), law {kind}"
    )
