# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Bracket of friction: force, area and stiffness without friction and with stick, along the first loading."""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity.arrays import Floats
from asperity.curve import Curve

FRICTION_BOUNDS = "friction_bounds"  # section of summary.json
QUANTITIES = {"force": "force", "area_fraction": "area", "stiffness": "stiffness"}


def friction_bounds(free: Curve, stuck: Curve) -> dict[str, Any]:
    """Section "friction_bounds" of summary.json; empty where the curves have fewer than two approaches in common.

    The approaches are those of the curve with fewer rows in contact; the other one is interpolated. The stiffness is
    the slope of the force there.

    Args:
        free, stuck: curves on the same mesh, without friction and with stick

    Returns:
        the approaches [length], both values of each quantity, the relative differences of stick, and those at the
        greatest load

    Examples:
        >>> free, stuck = (
        ...     asp.Curve.from_rows([{"delta": d, "force": k * d, "area_fraction": 0.1} for d in (1.0, 2.0, 3.0)])
        ...     for k in (1.0, 1.02)
        ... )
        >>> found = friction_bounds(free, stuck)
        >>> print(bounds_line(found))
        from no friction to stick, at the greatest load: force +2.0 %, area +0.0 %, stiffness +2.0 %
    """
    branches = {"none": _in_contact(free), "stick": _in_contact(stuck)}
    least = max(branch.delta.min(initial=np.inf) for branch in branches.values())
    most = min(branch.delta.max(initial=-np.inf) for branch in branches.values())
    rows = min(branches.values(), key=len).delta
    delta = rows[(rows >= least * (1.0 - 1e-9)) & (rows <= most * (1.0 + 1e-9))]
    if len(delta) < 2:
        return {}
    values = {name: _values(branch, delta) for name, branch in branches.items()}
    both = {quantity: {name: of[quantity] for name, of in values.items()} for quantity in QUANTITIES}
    difference = {
        quantity: np.divide(of["stick"], of["none"], out=np.full(len(delta), np.nan), where=of["none"] != 0.0) - 1.0
        for quantity, of in both.items()
    }
    return {
        "delta": delta.tolist(),
        **{quantity: {name: values.tolist() for name, values in of.items()} for quantity, of in both.items()},
        "difference": {quantity: _finite(of) for quantity, of in difference.items()},
        "at_greatest_load": {quantity: _finite(of)[-1] for quantity, of in difference.items()},
    }


def bounds_line(section: dict[str, Any]) -> str:
    """The bracket of friction in a line.

    Args:
        section: returned by `friction_bounds`

    Examples:
        >>> bounds_line({"at_greatest_load": {"force": 0.01, "area_fraction": None, "stiffness": -0.002}})
        'from no friction to stick, at the greatest load: force +1.0 %, stiffness -0.2 %'
    """
    known = {QUANTITIES[name]: value for name, value in section["at_greatest_load"].items() if value is not None}
    parts = ", ".join(f"{name} {100.0 * value:+.1f} %" for name, value in known.items())
    return f"from no friction to stick, at the greatest load: {parts}"


def _in_contact(curve: Curve) -> Curve:
    branch = curve.loading()
    return branch.where(branch.force > 0.0)


def _values(branch: Curve, delta: Floats) -> dict[str, Floats]:
    """Force [force], area over the nominal one and slope of the force [force/length] at approaches [length]."""
    from scipy.interpolate import PchipInterpolator

    law = PchipInterpolator(branch.delta, branch.force) if len(branch) > 1 else None
    force = np.interp(delta, branch.delta, branch.force) if law is None else law(delta)
    area = np.interp(delta, branch.delta, branch.area_fraction)
    return {"force": force, "area_fraction": area, "stiffness": np.gradient(force, delta)}


def _finite(values: Floats) -> list[float | None]:
    """Values for JSON, None for those that are not finite."""
    return [float(value) if np.isfinite(value) else None for value in values]
