"""Theoretical properties of the curve of a scene.

Each claim takes the case and its curve, and returns whether the property holds and a sentence with the measured value.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from j2_path import confined_stress

if TYPE_CHECKING:
    from asperity.case import Case
    from asperity.curve import Curve

Claim = Callable[["Case", "Curve"], tuple[bool, str]]


def nearly_full(case: Case, curve: Curve) -> tuple[bool, str]:
    """More than 95 % of the area is in contact, but not all of it."""
    area = float(curve.area_fraction.max())
    return 0.95 < area < 1.0 + 1e-9, f"contact area {area:.1%}"


def closed(case: Case, curve: Curve) -> tuple[bool, str]:
    """All of the area is in contact, and the block answers as a flat one between rollers, M over its height."""
    solid, height = case.material.solid, case.block.height
    expected = solid.confined_modulus * case.surface.given()["L"] ** 2 / height
    error = abs(float(np.diff(curve.force)[-1] / np.diff(curve.delta)[-1]) / expected - 1.0)
    area = float(curve.area_fraction.max())
    return area > 1.0 - 1e-9 and error < 1e-3, f"contact area {area:.1%}, stiffness of the block within {error:.0e}"


def hertz(tolerance: float) -> Claim:
    """A sphere follows Hertz, P = 4/3 E' sqrt(R) delta^1.5, within `tolerance` times the greatest force.

    After unloading the force and the residual indentation are zero.
    """

    def claim(case: Case, curve: Curve) -> tuple[bool, str]:
        load = curve.branch == "load"
        R = case.surface.given()["radius"]
        expected = 4.0 / 3.0 * case.material.E_prime * np.sqrt(R) * curve.delta[load] ** 1.5
        error = float(np.max(np.abs(curve.force[load] - expected)) / np.max(expected))
        text = f"Hertz within {error:.1%}"
        if case.loading.unload:
            text += f", force {curve.force[-1]:g} and dent {curve.delta_star[-1]:.0e} L after release"
        clean = not case.loading.unload or (curve.force[-1] == 0.0 and abs(curve.delta_star[-1]) < 1e-9)
        return error < tolerance and clean, text

    return claim


def uniaxial_strain(case: Case, curve: Curve) -> tuple[bool, str]:
    """A flat block between rollers follows the closed form of elastic-plastic uniaxial strain, loaded and unloaded.

    In finite strain the closed form holds for the logarithm of the stretch, and the force is the stress over it.
    """
    solid = case.material.solid
    assert solid.yield_strength is not None
    stretch = 1.0 - curve.delta / case.block.height
    finite = solid.kinematics == "finite"
    axial, _, _ = confined_stress(
        np.log(stretch) if finite else stretch - 1.0, solid.E, solid.nu, solid.yield_strength,
        solid.tangent_modulus, solid.kinematic_share,
    )  # fmt: skip
    force = -axial / (stretch if finite else 1.0) * case.surface.L**2
    error = float(np.max(np.abs(curve.force - np.maximum(force, 0.0))) / force.max())
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


def keeps_a_loop(case: Case, curve: Curve) -> tuple[bool, str]:
    """Plastic flow goes on: the accumulated plastic strain grows in the last cycle, by as much as in the one before."""
    ends = np.flatnonzero((curve.branch[:-1] != "unload") & (curve.branch[1:] == "unload"))
    growth = np.diff(curve.max_plastic_strain[ends])
    last, change = float(growth[-1]), abs(float(growth[-1] / growth[-2]) - 1.0)
    text = f"plastic strain grows by {last:.1e} in the last cycle, {change:.0e} of it more or less than in that before"
    return last > 1e-3 and change < 0.05, text


def _peaks(curve: Curve) -> np.ndarray:
    ends = np.flatnonzero((curve.branch[:-1] != "unload") & (curve.branch[1:] == "unload"))
    return curve.force[ends]


def _dents(curve: Curve) -> np.ndarray:
    ends = np.flatnonzero(curve.branch == "unload")
    last = ends[np.append(np.diff(ends) > 1, True)]
    return curve.delta[last]
