"""A corrected curve at the forces that a load path gives: its approaches are what is corrected."""

from __future__ import annotations

from dataclasses import replace
from math import nan
from typing import Any

import numpy as np

from asperity.adaptive.extrapolation import Budget, rows_of_loading
from asperity.arrays import Floats
from asperity.curve import WITH_ERRORS, Curve
from asperity.curve.slope import SINGLE_CONTACT, slopes

FOUND = 1e-5  # relative, within which a loading ends at its greatest force


def at_given_forces(
    curve: Curve, budget: Budget, raw: Curve, compliance: float, greatest: float
) -> tuple[Curve, Budget]:
    """A corrected curve at the forces that were computed, which a load path gives, with other approaches.

    A correction of the force by f at an approach is one of the approach by f^(-1/n) at a force, n being the exponent of
    the loading; what a change of n from step to step makes of it is in the bar. Later branches get the approach of the
    end of the first loading. Other bars stay the same part of their columns.

    Args:
        curve, budget: with corrected forces
        raw: the same rows as computed
        compliance: see `without_omission`
        greatest: force at which the loadings end [force]
    """
    loading = curve.branch == "load"
    rows, first = rows_of_loading(loading), curve.where(loading)
    # the end of a loading is found within a small tolerance
    ends = np.isclose(raw.force, greatest, rtol=FOUND, atol=0.0)
    force = np.where(ends, greatest, raw.force)
    P = np.where(ends, raw.P_star * greatest / np.where(ends, raw.force, 1.0), raw.P_star)
    touched = (first.P_star > 0.0) & (P[loading] > 0.0)
    factor = np.divide(P[loading], first.P_star, out=np.ones(len(first)), where=touched)
    slope, change = slopes(first.delta, first.force, first.branch)
    n = np.divide(slope * first.delta, first.force, out=np.full(len(first), nan), where=touched)
    n = np.where(np.isfinite(n) & (n > 0.0), n, SINGLE_CONTACT)
    longer = factor ** (1.0 / n)

    def scale(of: Floats) -> Floats:
        """What the other approach makes of a column (n,), in all rows."""
        if len(of) < 2 or not np.all(of > 0.0):
            return np.ones(len(curve))
        return np.asarray(longer ** np.gradient(np.log(of), np.log(first.delta)))[rows]

    parts = {name: getattr(budget, name) * factor[rows] for name in ("mesh", "roughness", "load_step", "algebraic")}
    parts["mesh"] = np.hypot(parts["mesh"], (np.nan_to_num(change) * np.abs(np.log(factor)) * P[loading])[rows])
    budget = Budget(**parts)
    columns: dict[str, Any] = {"delta": curve.delta * longer[rows], "delta_star": curve.delta_star * longer[rows]}
    columns |= {"P_star": P, "error_P_star": budget.total}
    columns["mean_gap"] = curve.mean_gap - (columns["delta"] - curve.delta) + compliance * (P - curve.P_star)
    for name in ("area_fraction", *(name for name in WITH_ERRORS if name not in ("mean_gap", "k_n"))):
        by = scale(getattr(first, name))
        columns |= {key: by * getattr(curve, key) for key in (name, f"error_{name}")}
    columns["mean_pressure"] = curve.mean_pressure * factor[rows] / scale(first.area_fraction)
    moved = replace(curve, **columns).with_force(force)
    steeper = np.divide(moved.k_n, curve.k_n, out=np.ones(len(P)), where=curve.k_n > 0.0)
    return replace(moved, error_k_n=curve.error_k_n * steeper), budget
