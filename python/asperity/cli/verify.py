"""`asperity verify`: an installation against references that are independent of the program, as a table.

A row passes if its error is within its bar: what the run promises (the tolerance of a force, the error bar of an area)
and the error of the reference for this problem. Sphere and rough surface have slopes so small that the effect of finite
slopes is negligible.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from asperity.cli import options
from asperity.errors import ConvergenceError

if TYPE_CHECKING:
    from asperity.adaptive.refine import AccurateResult
    from asperity.surface import Surface

HEADER = ("case", "quantity", "reference", "its value", "computed", "error", "bar", "pass")
NU = 0.3  # Poisson's ratio of the cases, whose E and L are 1
TOLERANCE = 0.02  # of the runs with an error bar: seconds each
RADIUS, CONTACT = 100.0, 0.05  # of the sphere, and its greatest contact radius [L]
ROUNDING = 1e-7  # of a uniform state: ten times the tolerance of the solver
CELLS = 512  # per side of the layer; its error, of second order, is a third of the change from half as many


def row(case: str, quantity: str, source: str, reference: float, value: float, bar: float) -> dict[str, Any]:
    """One comparison of a value with a reference from a source, and whether the error is within the bar.

    Error and bar are relative to the reference, absolute where it is zero.
    """
    error = abs(reference - value) / (abs(reference) or 1.0)
    return {
        "case": case, "quantity": quantity, "source": source, "reference": reference, "value": value, "bar": bar,
        "error": error, "passed": error <= bar,
    }  # fmt: skip


def patch() -> Iterator[dict[str, Any]]:
    """A flat block in full contact: stiffness and uniform pressure; Johnson, Contact Mechanics (1985), 1.3."""
    from asperity import reference
    from asperity.model.settings import METHODS, Formulation, MeshSize
    from asperity.surface import Flat

    coarse = MeshSize(0.5, h_max=0.5)
    for method in METHODS:
        form = Formulation(method)
        result = _solve(Flat(L=1.0), 0.01, 1, size=coarse, formulation=form)
        top = result.solver.contact_surface
        # the penalty acts as a spring 4 beta E/h in series with the block
        soft = reference.block_modulus(1.0, NU) * top.diameter.max() / (4.0 * form.penalty)
        bar = ROUNDING + (soft if method == "penalty" else 0.0)
        slope = float(result.curve.P_star[0] / result.curve.delta_star[0])
        yield row("patch", f"slope, rollers, {method}", "M/E'", reference.patch_test_slope(NU, 1.0), slope, bar)
        if method != "penalty":
            pressure = result.solver.pressure[np.unique(top.nodes[:, :3])]
            spread = float(np.ptp(pressure) / pressure.mean())
            yield row("patch", f"spread of the pressure, {method}", "uniform", 0.0, spread, ROUNDING)
    result = _solve(Flat(L=1.0), 0.01, 1, nu=0.0, sides="free", size=coarse)
    yield row("patch", "slope, free sides, nu = 0", "E/E'", 1.0, float(result.curve.P_star[0] / 0.01), ROUNDING)


def hertz() -> Iterator[dict[str, Any]]:
    """A quarter of a sphere with its centre in a corner of the block; Johnson, Contact Mechanics (1985), 4.2.

    The forces are those of the whole block, whose base and sides stiffen it by 0.9 a/L. They hardly affect the contact
    area under a given force: by (a/L)^3.
    """
    from asperity import reference
    from asperity.model.settings import METHODS, Formulation
    from asperity.surface import Sphere

    sphere = Sphere(L=1.0, radius=RADIUS, centre=(0.0, 0.0), shape="paraboloid")
    theory = reference.Hertz(RADIUS, reference.reduced_modulus(1.0, NU))
    for method in METHODS:
        result = _solve(sphere, CONTACT**2 / RADIUS, 2, tolerance=TOLERANCE, formulation=Formulation(method))
        yield from _forces("hertz", method, sphere, result)
        for step in (len(result.curve) // 2 - 1, -1):
            radius = theory.radius(theory.approach(4.0 * result.curve.force[step]))
            area, bar = float(result.curve.area_fraction[step]), result.curve.bar("area_fraction", step)
            name = f"area at a = {radius:.3f} L, {method}"
            yield row("hertz", name, "Hertz", 0.25 * np.pi * float(radius) ** 2, area, bar + float(radius) ** 3)


def rough() -> Iterator[dict[str, Any]]:
    """A fractal surface against boundary elements of the elastic layer."""
    from asperity.surface import Surface

    surface = Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=2.4, G=4.3e-8, seed=3)
    yield from _forces("rough", "active-set", surface, _solve(surface, 0.002, 4, tolerance=TOLERANCE))


CASES: dict[str, Callable[[], Iterator[dict[str, Any]]]] = {case.__name__: case for case in (patch, hertz, rough)}


def _forces(case: str, method: str, surface: Surface, result: AccurateResult) -> Iterator[dict[str, Any]]:
    """Force at half and at the whole approach against small-slope theory for the whole block."""
    from asperity.reference import half_space_contact

    for step in (len(result.curve) // 2 - 1, -1):
        delta = float(result.curve.delta_star[step])
        coarse, fine = (
            half_space_contact(surface, n, delta_star=delta, height=1.0, nu=NU).P_star for n in (CELLS // 2, CELLS)
        )
        bar = TOLERANCE + abs(fine - coarse) / fine / 3.0
        name = f"force at delta/L = {delta:.2e}, {method}"
        yield row(case, name, "boundary elements", fine, float(result.curve.P_star[step]), bar)


def _solve(surface: Surface, delta: float, steps: int, nu: float = NU, **settings: Any) -> Any:
    """Elastic contact on this rank alone."""
    from mpi4py import MPI

    from asperity.adaptive.solve_contact import solve_contact
    from asperity.model.material import Material

    return solve_contact(surface, Material(1.0, nu), delta_max=delta, steps=steps, comm=MPI.COMM_SELF, **settings)


@click.command()
@click.argument("names", metavar="[NAME]...", nargs=-1, type=click.Choice(tuple(CASES)))
def verify(names: tuple[str, ...]) -> None:
    """Compare the solver with reference solutions.

    A flat block, a sphere and a rough surface, against closed forms and boundary elements; all cases if no NAME is
    given. A row passes when its error is within its bar, what the run promises and the uncertainty of the reference.
    Errors and bars are relative. Exit code 0 when all rows pass, 3 when not.
    """
    rows = [one for name in names or tuple(CASES) for one in CASES[name]()]
    texts = (
        (
            one["case"], one["quantity"], one["source"], f"{one['reference']:.5g}", f"{one['value']:.5g}",
            f"{one['error']:.1e}", f"{one['bar']:.1e}", "yes" if one["passed"] else "NO",
        )
        for one in rows
    )  # fmt: skip
    options.table("Verification", texts, HEADER)
    missed = [f"{one['case']}: {one['quantity']}" for one in rows if not one["passed"]]
    if missed:
        raise ConvergenceError(f"{len(missed)} of {len(rows)} rows outside their bar ({'; '.join(missed)})")
