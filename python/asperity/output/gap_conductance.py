"""Conductance of the joint per nominal area, of heat or current, from the column conductance of a curve.

A body of the conductivity k1 has k1 C between its base and the spots, without the block. The other body is its mirror:
the spots are at one potential, and both are in series, h = k1 k2/(k1 + k2) C/A0 = k_s C/(2 A0).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.curve import Curve


def harmonic_mean(material: Mapping[str, Any]) -> float:
    """k_s = 2 k1 k2/(k1 + k2) of both bodies [power/(length temperature)]; NaN without a conductivity."""
    first = material.get("conductivity")
    if first is None:
        return np.nan
    second = material.get("conductivity_other") or first
    return float(2.0 * first * second / (first + second))


def gap_conductance(case: Mapping[str, Any], curve: Curve) -> tuple[Array, Array, Array]:
    """Nominal pressure [force/length^2], conductance per nominal area and its error bar at each step, each (n,).

    The conductances [power/(length^2 temperature)] are NaN where the curve has none, the bodies have no conductivity,
    or the case has no surface.

    Examples:
        One round spot of the radius a = 0.1 between two bodies of conductivity 50 on an area of 4: 2 k a/A0.

        >>> curve = asp.Curve.from_rows([{"delta": 1.0, "force": 1.0, "conductance": 4 * 0.1}])
        >>> gap_conductance({"surface": {"L": 2.0}, "material": {"conductivity": 50.0}}, curve)[1].tolist()
        [2.5]
    """
    patch = float(case.get("surface", {}).get("L", np.nan)) ** 2
    factor = harmonic_mean(case.get("material", {})) / (2.0 * patch)
    return curve.force / patch, factor * curve.conductance, factor * curve.error_conductance
