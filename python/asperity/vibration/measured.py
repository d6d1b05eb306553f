"""Measured curves: two named columns in a text file, made to a law with what the scatter of the rows leaves open."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.runtime.files import read_whole
from asperity.runtime.text_table import decoded
from asperity.units import LENGTHS
from asperity.vibration.curve_law import MIN_POINTS, Bars, CurveLaw
from asperity.vibration.local_fit import LocalFit

FORCES = {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "uN": 1e-6, "µN": 1e-6, "μN": 1e-6, "nN": 1e-9, "pN": 1e-12}
UNITS = {"delta": LENGTHS, "force": FORCES}
FALL = 0.05  # share of the greatest force by which the law of a contact may fall
SCATTER = 0.12  # of the stiffness between neighbours, above which the law is the fit and not the points
_ORDERED = 0.9  # rank correlation of approach and time from which rows are in the order of time
_STEPS = 1.4826  # standard deviation over the median distance of steps, times 1 / sqrt(2) and sqrt(2) points
_NODES = 60  # of a law that is a fit
_LATE = 0.5  # first force over the greatest, above which a curve does not begin at first contact


def read_table(path: Path) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Columns by name (n,), approach and force in m and N where their units are named, and how they were read.

    The first line that is no comment names the columns: delta [um], force [N]. Commas, semicolons or tabs separate
    them.

    Raises:
        ValueError: a column is missing, its unit unknown, or a cell of approach or force no number
    """
    lines = [line for line in decoded(read_whole(path)).splitlines() if line.strip() and not line.startswith("#")]
    if not lines:
        raise ValueError("it is empty: give a line with the names delta and force, and a row per approach")
    mark = next((mark for mark in ";\t" if mark in lines[0]), ",")
    heading, *rows = csv.reader(lines, delimiter=mark)
    names, units = [], {}
    for cell in heading:
        found = re.fullmatch(r"\s*(.*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*", cell)
        names.append(name := found[1] if found else cell)
        if found and found[2] and name in UNITS:
            if found[2] not in UNITS[name]:
                raise ValueError(f"the unit {found[2]!r} of {name} is unknown: use {', '.join(UNITS[name])}")
            units[name] = UNITS[name][found[2]]
    for name in UNITS:
        if names.count(name) != 1:
            raise ValueError(f"it needs one column {name!r} in its first line, which has {', '.join(heading)[:60]!r}")
    if len(units) == 1:
        raise ValueError("approach or force has no unit: name both, as delta [um], force [N], or none for SI units")
    columns: dict[str, Array] = {}
    for j, name in enumerate(names):
        cells = [row[j].strip() if j < len(row) else "" for row in rows]
        try:
            columns[name] = units.get(name, 1.0) * np.array([float(cell or "nan") for cell in cells])
        except ValueError as error:
            if name in UNITS:
                raise ValueError(f"column {name}: {error}; numbers have decimal points") from None
            columns[name] = np.array(cells)
    return columns, ("approach and force have the units of the file, here metres and newtons",) if units else ()


def branches(delta: Array, force: Array, noise: float = 0.0) -> tuple[Array, Array, str]:
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
    if delta.size < 3 or np.ptp(delta) == 0.0:
        return 1.0 if delta.size < 3 else 0.0
    return float(spearmanr(np.arange(delta.size), delta).statistic)


def law_of_rows(
    delta: Array, force: Array, load: float, *, bar: float = 0.0, k: Array | None = None, name: str = "measured curve"
) -> tuple[CurveLaw, str]:
    """Law through the rows of one branch about a load (force), and a sentence on what was done.

    Rows of one approach count as their mean. The law goes through rows that scatter little, and is the local fit of
    others. Its bars are those of contact point, stiffness and curvature by the scatter.

    Args:
        bar: error of the force over it
        k: stiffness at the rows (force/length), NaN where unknown

    Raises:
        InputError: the rows do not begin at first contact, fall, or are too few
    """
    known, first = np.unique(delta, return_inverse=True)
    f = np.bincount(first, force) / np.bincount(first)
    if known.size < MIN_POINTS:
        raise InputError(f"the curve has {known.size} approaches, at least {MIN_POINTS} are needed")
    lead = float(np.median(f[: max(3, f.size // 20)]))
    if lead > _LATE * f.max():
        raise InputError(
            f"the curve does not begin at first contact: its first force {f[0]:.4g} is {100 * f[0] / f.max():.0f} % of "
            "the greatest; give the rows from first contact on, with the zero of the force subtracted"
        )
    fit = LocalFit(known, f, origin=None, relative=False)
    (origin, of_origin), local = fit.origin, fit.at(load)
    on = (known > origin) & (f > 0.0)
    z, F = known[on] - origin, f[on]
    start = float(z[0]) if z.size else 0.0
    if lead > 4.0 * fit.noise + 0.02 * f.max() and origin < known[0] - 0.5 * np.ptp(known):
        raise InputError(
            f"the curve does not begin at first contact: its first rows have the force {lead:.4g}, and no fit of the "
            "contact reaches zero near them; subtract the zero of the force"
        )
    grid = z[-1] * np.geomspace(max(start / z[-1], np.exp(-4.0)), 1.0, _NODES)
    smooth, n = fit.curve(grid)
    rise = np.diff(F)[F[1:] > 0.25 * F.max()]
    scatter = _STEPS * float(np.median(np.abs(np.diff(F - fit.curve(z)[0]))))  # a kink leaves smooth residuals
    top = np.maximum.accumulate(f)
    if np.any(falls := top - f > FALL * top + 8.0 * scatter):
        at = int(np.argmax(falls))
        raise InputError(
            f"the force of the curve falls by {top[at] - f[at]:.4g}, by more than {100 * FALL:g} % and the scatter, "
            f"at the approach {known[at]:.5g}: no law of a contact; name its unloading in a column branch, or smooth it"
        )
    if np.all(np.diff(F) > 0.0) and scatter < SCATTER * np.median(rise):
        of_rows = np.full(known.size, np.nan) if k is None else _means(k, first)
        law, kind = CurveLaw(z, F, name=name, k=of_rows[on]).about(load, bar), "through the points"
    else:
        rising = np.append(True, smooth[1:] > np.maximum.accumulate(smooth)[:-1])
        grid, smooth, n = grid[rising], smooth[rising], np.maximum(n[rising], 1e-3)
        law, kind = CurveLaw(grid, smooth, name=name, k=n * smooth / grid), "a fit through them"
        z_s = law.deflection(load)
        off_k, off_kappa = abs(float(np.log(law.at(z_s)[1]) - local.log_k)), abs(law.kappa(z_s) - local.kappa)
        law = replace(law, bars=Bars(load, bar, 0.0, local.bars[2] + off_k, local.bars[3] + off_kappa))
    law = replace(
        law, bars=law.bars._replace(approach=float(np.hypot(law.bars.approach, of_origin))) if law.bars else None
    )
    dropped = int(known.size - on.sum())
    where = "" if origin >= known[0] else ", by extrapolation"
    return law, (
        f"{name}: {dropped} rows before contact dropped, {delta.size - known.size} of equal approach averaged, "
        f"contact at {origin:.5g} +- {of_origin:.2g}{where}, noise {fit.noise:.2g} "
        f"({100 * fit.noise / load:.2g} % of the preload), law {kind}"
    )


def _means(values: Array, groups: Array) -> Array:
    """Mean of the known values of each group, NaN where none is known."""
    known = np.isfinite(values)
    counts = np.bincount(groups, known)
    with np.errstate(invalid="ignore"):
        return np.bincount(groups, np.where(known, values, 0.0)) / np.where(counts > 0, counts, np.nan)
