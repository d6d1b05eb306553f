"""Motion: the impact of a mass on the full solid in time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from asperity import reference
from asperity.arrays import Floats
from asperity.mesh.generate import build_block
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.make import make_block, make_contact_solver
from asperity.surface import Flat
from asperity.transient import TimeSeries, Transient
from asperity.verification.hertz import HERTZ, MATERIAL, SPHERE
from asperity.verification.table import LEVELS, Row, VerificationLevel, convergence_bar, on_meshes, rows_along, sizes

DENSITY = 1e-4  # of the block: it weighs a ten thousandth of the mass and follows it at once [E T^2/L^2]
MASS = 1.0  # [E L T^2]
STEPS = (25, 50, 100)  # of time in an impact; the scheme is of second order
DEEPEST = 4e-4  # approach of the sphere at rest, a contact radius of 0.2 [L]
GAP = 0.05  # flight before the impact, over the greatest approach
QUANTITIES = ("duration", "greatest approach", "speed left")


def impact(level: VerificationLevel) -> Iterator[Row]:
    """A mass without weight strikes a flat block and a sphere, stays half a period and leaves as fast as it came.

    The flat block is a spring of stiffness M; the duration is pi sqrt(m/M). On the sphere the force is that of small
    slopes for the block below it, by boundary elements; the duration follows by quadrature of the balance of energy.
    Hertz's force alone has 2.94 (greatest approach)/(speed), Johnson, Contact Mechanics (1985), section 11.4.
    """
    omega = float(np.sqrt(reference.block_modulus(MATERIAL.E, MATERIAL.nu) / MASS))
    block_over_mass = DENSITY / MASS
    found = [_flat_impact(omega, steps) for steps in STEPS]
    yield from rows_along(
        "impact", [f"{name}, flat block" for name in QUANTITIES], "closed form", found, [np.pi, 1.0, 1.0],
        block_over_mass, order=2.0,
    )  # fmt: skip
    coarse, fine = (_sphere_law(cells) for cells in (128, 256))
    lasts, speed = impact_time(fine), float(np.sqrt(2.0 * potential(fine, DEEPEST) / MASS))
    expected = np.array([lasts, DEEPEST, speed])
    theory = np.array([abs(impact_time(coarse) / lasts - 1.0), 0.0, 0.0]) + block_over_mass + DEEPEST / 0.2
    meshes = LEVELS["quick"]  # finer ones gain nothing: the steps of time are most of the bar
    values = on_meshes(meshes, lambda refinement: _sphere_impact(refinement, speed, lasts, STEPS[1]))
    longer = _sphere_impact(meshes.refinements[0], speed, lasts, STEPS[0])
    time_error = 1.25 / 3.0 * np.abs(values[0] - longer)  # of second order
    mesh = (convergence_bar(values) + time_error) / expected
    for name, reference_value, value, bar, other in zip(QUANTITIES, expected, values[-1], mesh, theory, strict=True):
        yield Row(
            "impact", f"{name}, sphere, a = 0.2 L", "layer, small slope", float(reference_value), float(value),
            float(bar), float(other),
        )  # fmt: skip


def _flat_impact(omega: float, steps: int) -> Floats:
    """Duration over 1/omega, greatest approach and speed left over those of the spring, (3,)."""
    from mpi4py import MPI

    block = build_block(Flat(L=1.0), 1.0, lambda x, y, depth: 0.6)
    solver = make_contact_solver(MPI.COMM_SELF, Flat(L=1.0), block, MATERIAL)
    deepest = 0.01
    found = _strike(solver, deepest * omega, GAP * deepest, np.pi / omega, steps)
    return found * [omega, 1.0 / deepest, 1.0 / (deepest * omega)]


def _sphere_impact(refinement: float, speed: float, lasts: float, steps: int) -> Floats:
    """Duration, greatest approach and speed left (3,), of a quarter of the sphere."""
    from mpi4py import MPI

    block = make_block(MPI.COMM_SELF, SPHERE, 1.0, DEEPEST, sizes(0.05, refinement))
    solver = make_contact_solver(MPI.COMM_SELF, SPHERE, block, MATERIAL)
    return _strike(solver, speed, GAP * DEEPEST, lasts, steps)


def _strike(solver: ContactSolver, speed: float, gap: float, lasts: float, steps: int) -> Floats:
    """Duration, greatest approach and speed left of a mass thrown at the block, (3,)."""
    solver.step(-gap)
    transient = Transient(solver, density=DENSITY, mass=MASS, load=0.0)
    transient.start(velocity=speed, shape=np.zeros((solver.solid.owned, 3)))
    history = transient.run(1.2 * lasts + gap / speed, lasts / steps)
    down, up = crossings(history)
    return np.array([up - down, _greatest(history), -history.velocity[-1]])


def crossings(history: TimeSeries) -> Floats:
    """Times at which a plate passes first touch, down and up."""
    x, time = history.approach, history.time
    i = np.flatnonzero(x[:-1] * x[1:] < 0.0)
    return time[i] - x[i] * (time[i + 1] - time[i]) / (x[i + 1] - x[i])


def _greatest(history: TimeSeries) -> float:
    """Greatest approach, of the parabola through the greatest of the record and its neighbours."""
    x, k = history.approach, int(np.argmax(history.approach))
    before, top, after = x[k - 1], x[k], x[k + 1]
    return float(top + (after - before) ** 2 / (8.0 * (2.0 * top - before - after)))


def _sphere_law(cells: int) -> Floats:
    """Coefficients of force = approach^(3/2) (c_0 + c_1 r + ...), r = sqrt(approach/DEEPEST), of a quarter sphere."""
    r = np.linspace(0.25, 1.0, 7)
    forces = [
        reference.half_space_contact(SPHERE, cells, delta_star=d, height=1.0).P_star * MATERIAL.reduced_modulus
        for d in DEEPEST * r**2
    ]
    # a small contact is Hertz's, whose constant is known
    hertz = 0.25 * float(HERTZ.force(DEEPEST)) / DEEPEST**1.5
    rest = np.linalg.lstsq(np.stack([r, r**2, r**3], axis=1), forces / (DEEPEST * r**2) ** 1.5 - hertz, rcond=None)[0]
    return np.concatenate([[hertz], rest])


def potential(law: Floats, approach: float | Floats) -> float | Floats:
    """Work of the force of `_sphere_law` up to an approach [E L^3]."""
    r = np.sqrt(np.asarray(approach) / DEEPEST)
    terms = [c * r**k / (2.5 + 0.5 * k) for k, c in enumerate(law)]
    work: Floats = np.asarray(approach) ** 2.5 * sum(terms)
    return work


def impact_time(law: Floats, deepest: float = DEEPEST) -> float:
    """Time from first touch to lift-off of a mass that the force brings to rest at `deepest` [T]."""
    x, weight = np.polynomial.legendre.leggauss(200)
    s = 0.5 * (1.0 + x)  # z = deepest (1 - s^2): the integrand is smooth where the mass turns
    left = potential(law, deepest) - potential(law, deepest * (1.0 - s**2))
    return 2.0 * float(weight @ (deepest * s / np.sqrt(2.0 / MASS * left)))
