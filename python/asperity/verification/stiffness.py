"""Stiffness and conductance of a spot far smaller than the block, with a tolerance and without: closed forms."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from mpi4py import MPI

from asperity.adaptive.solve_to_tolerance import solve_to_tolerance
from asperity.curve import Curve
from asperity.model.material import Material
from asperity.model.settings import METHODS, AccuracyTarget, Formulation
from asperity.quasistatic.contact_result import ContactResult
from asperity.surface import Sphere
from asperity.verification.table import LOCAL, Row, on_meshes, rows_along, sizes, solve_on_one_rank

RADIUS = 10.0  # of the sphere [L]
SPOT = 0.004  # radius of the contact [L]
MATERIAL = Material(1.0, 0.3)
PARABOLOID = Sphere(L=1.0, radius=RADIUS, centre=(0.0, 0.0), shape="paraboloid")
TOLERANCE, LARGER = 0.01, 0.01  # the usual tolerance of a run, and the radius of its contact [L]
WALLS = 2.0 * SPOT  # what base and sides add, relative: measured as 1 to 1.5 a/L


def press_spot(refinement: float, formulation: Formulation | None = None) -> ContactResult:
    """A quarter of a paraboloid with a small spot in a corner of the block, with all columns; L = E = 1."""
    return solve_on_one_rank(
        PARABOLOID, MATERIAL, delta_max=SPOT**2 / RADIUS, steps=1, size=sizes(0.2 * SPOT, refinement),
        formulation=formulation, stiffness=True, conductance=True,
    )  # fmt: skip


def stiffness() -> Iterator[Row]:
    """Normal and tangential stiffness, conductance; Johnson, Contact Mechanics (1985), 4.23 and 7.43; Barber (2003).

    The radius of the spot is that of the force, a = (3 F R/(4 E'))^(1/3).
    """
    for method in METHODS:
        results = on_meshes(partial(press_spot, formulation=Formulation(method)))
        values = np.array([_ratios(result.curve) for result in results])
        for k, (name, source, expected, _) in enumerate(_forms()):
            yield from rows_along(
                "stiffness", [f"{name}, {method}"], source, list(values[:, k]), [expected], WALLS, order=LOCAL
            )
    yield from _with_tolerance()


def _with_tolerance() -> Iterator[Row]:
    """Rows of a run with the usual tolerance, whose bars are those of the run."""
    curve = solve_to_tolerance(
        PARABOLOID, MATERIAL, AccuracyTarget(TOLERANCE), delta_max=LARGER**2 / RADIUS, steps=4, stiffness=True,
        conductance=True, comm=MPI.COMM_SELF,
    ).curve  # fmt: skip
    for (name, source, expected, column), value in zip(_forms(), _ratios(curve), strict=True):
        bar = float(getattr(curve, f"error_{column}")[-1] / getattr(curve, column)[-1])
        walls = WALLS * LARGER / SPOT
        yield Row("stiffness", f"{name}, tolerance {TOLERANCE:.0%}", source, expected, value, bar, walls)


def _forms() -> tuple[tuple[str, str, float, str], ...]:
    """Of each ratio: its name, source, value, and the column with its bar."""
    nu = MATERIAL.nu
    mindlin = 2.0 * (1.0 - nu) / (2.0 - nu)
    return (
        ("k_n over 2 E' a", "Johnson 4.23", 1.0, "k_n_elastic"),
        ("k_t over k_n", "Johnson 7.43", mindlin, "k_t_interface"),
        ("conductance over 4 a", "Holm", 1.0, "conductance"),
        ("k_n over E' C/2", "Barber", 1.0, "conductance"),
    )


def _ratios(curve: Curve) -> list[float]:
    """Values of the forms at the last load of a quarter of a spot."""
    prime, force = MATERIAL.reduced_modulus, 4.0 * float(curve.force[-1])
    a = (0.75 * force * RADIUS / prime) ** (1.0 / 3.0)
    names = ("k_n_elastic", "k_n_interface", "k_t_interface", "conductance")
    k_n, interface, tangential, C = (4.0 * float(getattr(curve, name)[-1]) for name in names)
    return [k_n / (2.0 * prime * a), tangential / interface, C / (4.0 * a), interface / (0.5 * prime * C)]
