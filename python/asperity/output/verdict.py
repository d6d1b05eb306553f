# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The result of a run in a few sentences."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from asperity.curve import Curve
from asperity.output.results import Results
from asperity.units import quantity


def verdict(results: Results) -> list[str]:
    """Return the result with its error bar, the vibration, and what is doubtful: a sentence each, only what is known.

    Args:
        results: files of a finished or partial run.

    Examples:
        >>> rows = [{"delta": 1e-9, "force": 2e-6, "P_star": 4e-5, "error_P_star": 8e-7, "area_fraction": 0.01}]
        >>> verdict(Results("out", asp.Curve.from_rows(rows), case={"units": "SI"}))
        ['The force is 2 µN ± 2 % at an approach of 1 nm; 1 % of the nominal area is in contact.']
    """
    return [*_contact(results), *_stiffness(results), *_vibration(results), *_doubts(results)]


def _contact(results: Results) -> Iterator[str]:
    """Yield force and error bar at the largest force."""
    curve = results.curve
    if not len(curve):
        yield "No load step was accepted."
        return
    row = _at_largest_force(curve)
    force, delta = (
        quantity(float(column[0]), results.unit(dimension))
        for column, dimension in ((row.force, "force"), (row.delta, "length"))
    )
    known = _bar(float(row.error_P_star[0]), float(row.P_star[0]))
    share = float(row.area_fraction[0])
    area = f"; {100 * share:.3g} % of the nominal area is in contact" if np.isfinite(share) else ""
    yield f"The force is {force}{known} at an approach of {delta}{area}."
    if not known:
        yield "It has no error bar: the case requests no tolerance."


def _stiffness(results: Results) -> Iterator[str]:
    """Yield normal and tangential stiffness at the largest force."""
    curve = results.curve
    if not len(curve):
        return
    row = _at_largest_force(curve)
    known = []
    for name, axis in (("k_n_elastic", "normal"), ("k_t", "tangential, without slip,")):
        value, error = (float(getattr(row, column)[0]) for column in (name, f"error_{name}"))
        if np.isfinite(value) and value > 0.0:
            known.append(f"{axis} {quantity(value, results.unit('stiffness'))}{_bar(error, value)}")
    if known:
        yield f"Its elastic stiffness there: {' and '.join(known)}."


def _at_largest_force(curve: Curve) -> Curve:
    """The row of the largest force."""
    return curve.where(np.array([np.argmax(curve.force)]))


def _bar(error: float, value: float) -> str:
    """Error bar in per cent of a value, empty where it is not known."""
    return f" ± {100 * error / value:.2g} %" if value > 0.0 and np.isfinite(error) else ""


def _vibration(results: Results) -> Iterator[str]:
    """Yield stiffness and frequency of small vibration."""
    numbers, si = results.thresholds.get("numbers") or {}, results.thresholds.get("units") != "other"
    if numbers.get("k_n") is None:
        return
    text = f"Small vibration has a stiffness of {quantity(numbers['k_n'], (si and 'N/m') or '')}"
    if numbers.get("f") is not None:
        text += f" and a frequency of {quantity(numbers['f'], (si and 'Hz') or '')}"
    yield f"{text}."


def _doubts(results: Results) -> Iterator[str]:
    """Yield how many assumptions of the model are doubtful, and which."""
    records = results.summary.get("assumptions") or []
    doubtful = [record["name"] for record in records if record["verdict"] == "doubtful"]
    if doubtful:
        yield f"Doubtful: {', '.join(doubtful)} ({len(doubtful)} of {len(records)} assumptions)."
    elif records:
        yield f"All {len(records)} assumptions that were checked are fine."
