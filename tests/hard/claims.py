# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Theoretical properties of the curve of a scene.

Each claim takes the case and its curve, and returns whether the property holds and a sentence with the measured value.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from asperity.case import Case
    from asperity.curve import Curve

Claim = Callable[["Case", "Curve"], tuple[bool, str]]

SHAKEN = 1e-6  # relative change of the peak force between elastic cycles that counts as none


def nearly_full(case: Case, curve: Curve) -> tuple[bool, str]:
    """More than 95 % of the area is in contact, but not all of it."""
    area = float(curve.area_fraction.max())
    return 0.95 < area < 1.0 + 1e-9, f"contact area {area:.1%}"


def hertz(tolerance: float) -> Claim:
    """A sphere follows Hertz, P = 4/3 E' sqrt(R) delta^1.5, within `tolerance` times the greatest force.

    After unloading the force and the residual indentation are zero.
    """

    def claim(case: Case, curve: Curve) -> tuple[bool, str]:
        load = curve.branch == "load"
        R = case.surface.parameters()["radius"]
        expected = 4.0 / 3.0 * case.material.E_prime * np.sqrt(R) * curve.delta[load] ** 1.5
        error = float(np.max(np.abs(curve.force[load] - expected)) / np.max(expected))
        text = f"Hertz within {error:.1%}"
        if case.loading.unload:
            text += f", force {curve.force[-1]:g} and dent {curve.delta_star[-1]:.0e} L after release"
        clean = not case.loading.unload or (curve.force[-1] == 0.0 and abs(curve.delta_star[-1]) < 1e-9)
        return error < tolerance and clean, text

    return claim


def uniaxial_strain(case: Case, curve: Curve) -> tuple[bool, str]:
    """A flat block between rollers follows the closed form of elastic-plastic uniaxial strain.

    Beyond yield, where |s| = sigma_y + H a, the stress increases by K + 4/3 mu H/(3 mu + H) per strain, because the
    deviatoric strain is partly elastic and partly plastic.
    """
    solid = case.material
    assert solid.yield_strength is not None
    mu = 0.5 * solid.E / (1.0 + solid.nu)
    bulk = solid.E / (3.0 * (1.0 - 2.0 * solid.nu))
    Et = solid.tangent_modulus or 0.0
    H = solid.E * Et / (solid.E - Et)
    strain = curve.delta / case.block.height
    at_yield = solid.yield_strength / (2.0 * mu)
    elastic_part = np.minimum(strain, at_yield)
    stress = (bulk + 4.0 / 3.0 * mu) * elastic_part
    stress += (bulk + 4.0 / 3.0 * mu * H / (3.0 * mu + H)) * (strain - elastic_part)
    load = curve.branch == "load"
    error = float(np.max(np.abs(curve.force / (stress * case.surface.L**2) - 1.0)[load]))
    return error < 1e-8, f"closed form within {error:.0e}"


def shakes_down(case: Case, curve: Curve) -> tuple[bool, str]:
    """Cycles between zero force and a fixed approach: the change of the peak force decreases from cycle to cycle."""
    peaks, dents = _peaks(curve), _dents(curve)
    change = np.abs(np.diff(peaks)) / peaks[0]
    creep = np.abs(np.diff(dents)) / curve.delta.max()
    text = (
        f"peak force {peaks[1] / peaks[0]:.4f} of the first in cycle 2, {peaks[-1] / peaks[0]:.4f} in the last; "
        f"last change {change[-1]:.0e}, of the dent {creep[-1]:.0e}"
    )
    return bool(max(change[-1], creep[-1]) < 1e-2 and change[-1] <= change[:3].max()), text


def closed_loops(case: Case, curve: Curve) -> tuple[bool, str]:
    """Cycles of an elastic contact are identical and leave no residual indentation."""
    peaks, dents = _peaks(curve), _dents(curve)
    change, dent = float(np.ptp(peaks) / peaks[0]), float(np.abs(dents).max() / case.surface.L)
    return change < SHAKEN and dent < 1e-9, f"peak force changes by {change:.0e}, dent {dent:.0e} L"


def _peaks(curve: Curve) -> np.ndarray:
    ends = np.flatnonzero((curve.branch[:-1] != "unload") & (curve.branch[1:] == "unload"))
    return curve.force[ends]


def _dents(curve: Curve) -> np.ndarray:
    ends = np.flatnonzero(curve.branch == "unload")
    last = ends[np.append(np.diff(ends) > 1, True)]
    return curve.delta[last]
