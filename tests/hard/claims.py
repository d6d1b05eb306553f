"""Theoretical properties of the curve of a scene; each returns a sentence of what does not hold."""

from __future__ import annotations

import numpy as np
from scene_definition import BASE, L

from asperity.curve import Curve


def nearly_full(curve: Curve) -> str:
    """More than 95 % of the area is in contact, but not all of it."""
    area = float(curve.area_fraction.max())
    return "" if 0.95 < area < 1.0 + 1e-9 else f"contact area {area:.1%}"


def hertz(curve: Curve) -> str:
    """An elastic sphere of R = L follows Hertz, P = 4/3 E' sqrt(R) delta^1.5, and has no dent after its release."""
    load, E_prime = curve.branch == "load", BASE["material.E"] / (1.0 - BASE["material.nu"] ** 2)
    expected = 4.0 / 3.0 * E_prime * np.sqrt(L) * curve.delta[load] ** 1.5
    error = float(np.max(np.abs(curve.force[load] - expected)) / np.max(expected))
    clean = curve.force[-1] == 0.0 and abs(curve.delta_star[-1]) < 1e-9
    return "" if error < 0.05 and clean else f"Hertz within {error:.1%}, dent {curve.delta_star[-1]:.0e} L"


def keeps_a_loop(curve: Curve) -> str:
    """Plastic flow goes on: the accumulated plastic strain grows in the last cycle, by as much as in the one before."""
    ends = np.flatnonzero((curve.branch[:-1] != "unload") & (curve.branch[1:] == "unload"))
    before, last = np.diff(curve.max_plastic_strain[ends])[-2:]
    return (
        "" if last > 1e-3 and abs(last / before - 1.0) < 0.05 else f"plastic strain grows by {before:g}, then {last:g}"
    )
