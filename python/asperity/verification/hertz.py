"""A quarter of a sphere with its centre in a corner of the block, pressed by the flat, against Hertz theory."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import numpy.typing as npt

from asperity import reference
from asperity.arrays import Floats
from asperity.model.material import Material
from asperity.model.settings import METHODS, Formulation
from asperity.quasistatic.contact_result import ContactResult
from asperity.surface import Sphere
from asperity.verification.table import (
    LOCAL,
    Row,
    counting_error,
    on_meshes,
    rows_along,
    sizes,
    solve_on_one_rank,
)

RADIUS = 100.0  # of the sphere [L]: slopes of 5e-4, so that the effect of finite slopes is negligible
CONTACT = 0.05  # contact radius at the last load [L]
STEPS = 2
MATERIAL = Material(1.0, 0.3)
SPHERE = Sphere(L=1.0, radius=RADIUS, centre=(0.0, 0.0), shape="paraboloid")
HERTZ = reference.Hertz(RADIUS, MATERIAL.reduced_modulus)
SOURCE = "Hertz"


def press_sphere(refinement: float, formulation: Formulation | None = None) -> ContactResult:
    """Solve the quarter sphere in `STEPS` equal steps of the approach; L = E = 1."""
    return solve_on_one_rank(
        SPHERE, MATERIAL, delta_max=CONTACT**2 / RADIUS, steps=STEPS, snapshots=1,
        size=sizes(0.25 * CONTACT, refinement), formulation=formulation,
    )  # fmt: skip


def layer_force(delta: npt.ArrayLike, n: int) -> tuple[Floats, Floats]:
    """P* of small-slope theory for the whole block, whose base and sides stiffen it, and its relative error, each (m,).

    Hertz theory neglects base and sides; the force is greater by about 0.9 a/L. The error is of second order in the
    cell size, `n` cells per side; delta is (m,) [L].
    """
    coarse, fine = (
        np.array([
            reference.half_space_contact(SPHERE, cells, delta_star=d, height=1.0).P_star for d in np.atleast_1d(delta)
        ])
        for cells in (n // 2, n)
    )  # fmt: skip
    return fine, np.abs(fine - coarse) / fine


def hertz() -> Iterator[Row]:
    """Force, contact radius and pressure; Johnson, Contact Mechanics (1985), 4.2; first yield, 4.1.

    Force and approach are those of the whole block. The block hardly affects radius and pressure under a given force:
    its sides change the curvature of the surface by a relative (a/L)^3, and its stress by (a/L)^2 of the pressure.
    """
    expected, grid = layer_force([CONTACT**2 / RADIUS * (k + 1) / STEPS for k in range(STEPS)], 1024)
    for method in METHODS:
        results = on_meshes(partial(press_sphere, formulation=Formulation(method)))
        depths = results[-1].curve.delta
        names = [f"a = {HERTZ.radius(d):.3f} L, {method}" for d in depths]
        yield from rows_along(
            "hertz", [f"force, {name}" for name in names], "layer, small slope",
            [r.curve.P_star for r in results], expected, grid,
        )  # fmt: skip
        image = HERTZ.radius(depths) ** 3
        radius = [
            np.sqrt(4.0 * r.curve.area_fraction / np.pi) / HERTZ.radius(HERTZ.approach(4.0 * r.curve.force))
            for r in results
        ]
        yield from rows_along(
            "hertz", [f"radius over that of the force, {name}" for name in names], SOURCE,
            radius, np.ones(STEPS), image, order=LOCAL, counted=0.5 * counting_error(results[-1]),
        )  # fmt: skip
        pressure = [_pressure_error(r) for r in results]
        yield from rows_along(
            "hertz", [f"rms error of the pressure over p0, {names[-1]}"], SOURCE, pressure, [0.0], image[-1],
            order=LOCAL,
        )  # fmt: skip
        yield from rows_along(
            "hertz", [f"p0 over Y at first yield, {names[-1]}"], "Johnson 3.45", [_first_yield(r) for r in results],
            [reference.first_yield(MATERIAL.nu)[0]], CONTACT**2, order=LOCAL,
        )  # fmt: skip


def _pressure_error(result: ContactResult) -> float:
    """Rms difference from the Hertz pressure under the same force over the contact area, relative to its peak."""
    from scipy.interpolate import LinearNDInterpolator

    it = result.solver
    ideal = float(HERTZ.approach(4.0 * result.curve.force[-1]))
    corners = np.unique(it.contact_surface.nodes[:, :3])
    field = LinearNDInterpolator(it.solid.points[corners, :2], result.snapshots[-1].pressure[corners])
    shares = (np.arange(20) + 0.5) / 20
    r, angle = np.meshgrid(HERTZ.radius(ideal) * np.sqrt(shares), 0.5 * np.pi * shares)
    difference = field(r * np.cos(angle), r * np.sin(angle)) - HERTZ.pressure(r, ideal)
    return float(np.sqrt(np.mean(difference**2)) / HERTZ.peak_pressure(ideal))


def _first_yield(result: ContactResult) -> float:
    """Peak Hertz pressure under the same force over the greatest von Mises stress."""
    solid = result.solver.solid
    s = solid.kernels.stress(solid.u.x.array.reshape(-1, 3))
    xx, yy, zz, xy, xz, yz = np.moveaxis(s, -1, 0)
    shear = 3.0 * (xy**2 + xz**2 + yz**2)
    mises = np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + shear)
    ideal = HERTZ.approach(4.0 * result.curve.force[-1])
    return float(HERTZ.peak_pressure(ideal) / mises.max())
