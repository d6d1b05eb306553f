"""Coulomb friction on a rigid flat: spheres of Spence, limits, cycles, history, load steps, a flat that moves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import PLASTIC, here, make_block, make_contact_solver, world
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipk

from asperity.adaptive.solve_contact import solve_contact
from asperity.contact import Coulomb
from asperity.errors import InputError
from asperity.mesh.block import BlockMesh
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField
from asperity.model.material import Material
from asperity.model.settings import AccuracyTarget, Formulation, MeshSize, SolverOptions
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.surface import Flat, Sphere, Surface

ELASTIC = Material(1.0, 0.0)
GREAT = 2.0  # coefficient at which nearly all sticks


def press(
    surface: Surface, material: Material, block: BlockMesh | None = None, friction: float = GREAT, **settings: Any
) -> ContactResult:
    """A run with friction."""
    formulation = Formulation(friction=friction)
    return solve_contact(surface, material, block=block, comm=world(), formulation=formulation, **settings)


@pytest.fixture(scope="module")
def block(wave: Surface) -> BlockMesh:
    built = build_block(wave, 1.0, SizeField.of(wave, 0.02, 0.14, growth=0.6, h_max=0.5).at)
    assert built is not None
    return built


def pressed(surface: Surface, block: BlockMesh, friction: Any, steps: int = 4) -> ContactSolver:
    solver = make_contact_solver(
        here(), surface, block, Material(1.0, 0.0), sides="free", formulation=Formulation(friction=friction)
    )
    for k in range(1, steps + 1):
        assert solver.step(0.02 * k / steps).converged
    assert not solver.checks.violated
    return solver


# --- pressing -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.25, pytest.param(0.15, marks=pytest.mark.slow)])
def test_a_sphere_sticks_inside_the_radius_of_spence(cap: Surface, friction: float) -> None:
    """Goodman's approximation of Spence's solution: (a/2c) ln((a + c)/(a - c)) = mu/beta K(sqrt(1 - c^2/a^2)).

    Johnson, Contact Mechanics (1985), section 5.4; beta is Dundurs' constant. The outermost ring that sticks is between
    that of the last step and an element beyond.
    """
    nu, a = 0.3, 0.04
    beta = (1.0 - 2.0 * nu) / (2.0 * (1.0 - nu))
    c = brentq(lambda x: np.log((1 + x) / (1 - x)) / (2 * x) - friction / beta * ellipk(1 - x * x), 1e-6, 1 - 1e-9)
    size = MeshSize(h_contact=0.006, growth=0.4, h_max=0.3)
    solver = press(cap, Material(1.0, nu), friction=friction, delta_max=a**2 / 10.0, steps=12, size=size).solver
    contact = solver.contact
    assert isinstance(contact, Coulomb)
    radius = np.hypot(*solver.solid.points[contact.nodes(), :2].T) / a
    traction = np.linalg.norm(contact.sliding.traction[contact.active], axis=1)
    limit = friction * solver.nodal_force[contact.nodes()]
    for ring, low, high in ((radius < c - 0.1, 0.0, 0.95), ((radius > c + 0.1) & (radius < 1.0), 0.95, 1.02)):
        assert low < traction[ring].sum() / limit[ring].sum() < high


def bonded_punch(nu: float) -> float:
    """Normal stiffness of a bonded circular punch over that without friction: Spence, Proc. R. Soc. A 305 (1968) 55."""
    return (1.0 - nu) * np.log(3.0 - 4.0 * nu) / (1.0 - 2.0 * nu)


def approach_of_sphere(nu: float) -> float:
    """Approach of a sphere under stick over a^2/R, by superposition of bonded punches.

    The surface outside a punch of radius a is at w(r) = A int_0^1 cos(b ln((1 + s)/(1 - s)))/sqrt((r/a)^2 - s^2) ds,
    b = ln(3 - 4 nu)/(2 pi), with A from w(a) = 1; its force gives `bonded_punch`. Points touched at the radius r
    have sunk by r^2/(2 R) relative to the flat until then.
    """
    b = np.log(3.0 - 4.0 * nu) / (2.0 * np.pi)
    A = 2.0 / np.pi * np.cosh(np.pi * b)

    def sunk(s: float) -> float:
        of_punches = (np.arcsin(s) - s * np.sqrt(1.0 - s * s)) / (2.0 * s**3)
        return float(np.cos(b * np.log((1.0 + s) / (1.0 - s))) * of_punches)

    return 1.0 / (2.0 - 4.0 * A * quad(sunk, 0.0, 1.0, limit=400)[0])


@pytest.fixture(scope="module")
def corner() -> tuple[Sphere, BlockMesh | None, dict[str, Any]]:
    """A quarter of a sphere in a corner, small against the block, with its mesh and load."""

    sphere, a = Sphere(L=1.0, radius=10.0, centre=(0.0, 0.0), shape="paraboloid"), 0.02
    delta = a * a / 10.0
    block = make_block(world(), sphere, 1.0, delta, MeshSize(a / 8, growth=0.6, h_max=0.3))
    return sphere, block, {"delta_max": delta, "stiffness": True}


@pytest.mark.parametrize("nu", [0.0, pytest.param(0.3, marks=pytest.mark.slow)])
def test_a_sphere_under_great_friction_is_a_bonded_punch(
    corner: tuple[Sphere, BlockMesh | None, dict[str, Any]], nu: float
) -> None:
    """At the same approach the force is higher by C/sqrt(c), the area lower by 1/c, and dF/d delta by C/sqrt(c)."""
    assert (bonded_punch(0.49999), approach_of_sphere(0.49999)) == pytest.approx((1.0, 1.0), abs=1e-4)
    sphere, block, load = corner
    solid = Material(1.0, nu)
    free = solve_contact(sphere, solid, block=block, comm=world(), steps=1, **load).curve
    stuck = press(sphere, solid, block, steps=6, **load).curve
    C, c = bonded_punch(nu), approach_of_sphere(nu)
    assert stuck.force[-1] / free.force[-1] == pytest.approx(C / np.sqrt(c), abs=0.006)
    assert stuck.k_n_elastic[-1] / free.k_n_elastic[-1] == pytest.approx(C / np.sqrt(c), abs=0.012)
    assert stuck.area_fraction[-1] / free.area_fraction[-1] == pytest.approx(1.0 / c, abs=0.03)
    # while points stick, the force is the integral of the tangent
    step = np.diff(stuck.delta) * 0.5 * (stuck.k_n_elastic[1:] + stuck.k_n_elastic[:-1])
    np.testing.assert_allclose(np.diff(stuck.force)[3:], step[3:], rtol=0.02)


def test_a_plane_top_between_rollers_has_no_tangential_motion() -> None:
    surface, size = Flat(L=1.0), MeshSize(h_contact=0.5, h_max=0.5)
    result = press(surface, Material(1.0, 0.3), delta_max=0.01, steps=2, size=size)
    assert result.curve.force[-1] == pytest.approx(0.01 * Material(1.0, 0.3).confined_modulus, rel=1e-10)
    contact = result.solver.contact
    assert isinstance(contact, Coulomb)
    np.testing.assert_allclose(np.nan_to_num(contact.held[:, :2]), 0.0, atol=1e-9)


def test_between_both_limits(wave: Surface, block: BlockMesh) -> None:
    forces = [pressed(wave, block, friction).force for friction in ("none", 1e-4, 0.4, 2.0)]
    assert forces[1] == pytest.approx(forces[0], rel=1e-4)
    assert forces[0] < 0.97 * forces[2] and forces[2] < forces[3]


@pytest.mark.parametrize(
    "material", [ELASTIC, pytest.param(PLASTIC, marks=pytest.mark.mpi), Material(1.0, 0.0, kinematics="finite")]
)
def test_cycles(rough: Surface, coarse: BlockMesh | None, material: Material) -> None:
    """A released surface forgets, friction loses, and nothing creates energy."""
    result = press(rough, material, coarse, 0.3, delta_max=0.03, steps=4, unload_steps=3, cycles=2)
    assert result.checks.violated == {}
    assert result.checks.energy_excess == 0.0
    curve = result.curve
    assert curve.force[curve.branch == "unload"][2] == 0.0
    if not material.plastic:
        first, second = (curve.where(curve.branch == branch) for branch in ("load", "reload"))
        np.testing.assert_allclose(second.force, first.force, rtol=1e-3)
        down = curve.where(np.isin(np.arange(len(curve)), (len(first), len(first) + 1)))
        assert np.all(down.force < np.interp(down.delta, first.delta, first.force))


def test_order_in_the_load_steps(rough: Surface, coarse: BlockMesh | None) -> None:
    curves = {n: press(rough, ELASTIC, coarse, delta_max=0.03, steps=4, substeps=n).curve for n in (1, 4, 12)}
    at = np.arange(2, 5) / 4 * 0.03
    found = {n: np.interp(at, curve.loading().delta_star, curve.loading().P_star) for n, curve in curves.items()}
    errors = {n: float(np.sqrt(np.mean((found[n] / found[12] - 1.0) ** 2))) for n in (1, 4)}
    assert errors[1] < 0.01
    assert errors[4] < 0.3 * errors[1]


def test_a_failed_step_touches_no_history(rough: Surface, coarse: BlockMesh | None) -> None:
    """Neither does a trial solve: the step that follows is the same to the last bit."""
    solvers = [
        make_contact_solver(world(), rough, coarse, PLASTIC, formulation=Formulation(friction=0.3)) for _ in range(2)
    ]
    for solver in solvers:
        assert solver.step(0.01).converged
    tried, straight = solvers
    assert isinstance(tried.contact, Coulomb)
    held = tried.contact.held.copy()
    object.__setattr__(tried.newton, "options", SolverOptions(newton_max=1))
    assert not tried.solve(0.03).converged
    object.__setattr__(tried.newton, "options", SolverOptions())
    assert tried.solve(0.012).converged
    np.testing.assert_array_equal(tried.contact.held, held)
    for solver in solvers:
        assert solver.step(0.015).converged
    assert tried.force == straight.force
    np.testing.assert_array_equal(tried.contact.held, straight.contact.held)
    assert tried.release().converged
    assert np.isnan(tried.contact.held).all()


def test_a_tolerance_counts_the_error_of_the_load_steps(wave: Surface) -> None:
    result = solve_contact(
        wave,
        ELASTIC,
        tolerance=AccuracyTarget(0.1),
        comm=world(),
        delta_max=0.02,
        steps=3,
        formulation=Formulation(friction=0.3),
    )
    assert max(level.substeps for level in result.levels) >= 2
    assert result.met and np.all(result.budget.load_step > 0.0)


def test_what_friction_does_not_go_with(coarse: BlockMesh | None, rough: Surface) -> None:
    for method in ("penalty", "nitsche"):
        with pytest.raises(InputError, match=r"contact\.friction = 0\.3 holds nodes, which contact\.method"):
            Formulation(method, friction=0.3)
    for friction in ("glue", 3.0):
        with pytest.raises(InputError, match=r"contact\.friction = \S+ is .*, legal: .none. or \(0, 2\]"):
            Formulation(friction=friction)


# --- pressures and ranks --------------------------------------------------------------------------------------


def test_a_slipping_node_carries_coulombs_part_of_its_normal_force(wave: Surface, block: BlockMesh) -> None:
    """The bounds of the tangential forces are those of the pressures that the forces themselves change."""
    solver = pressed(wave, block, 0.4)
    assert isinstance(solver.contact, Coulomb)
    sliding = solver.contact.sliding
    slips = ~sliding.stuck & (sliding.bounds > 0.0)
    tangential = np.linalg.norm(sliding.traction[slips], axis=1)
    normal = solver.nodal_force[solver.contact_surface.owned_nodes][slips]
    assert slips.sum() > 3 and np.abs(tangential - 0.4 * normal).sum() < 1e-3 * tangential.sum()


@pytest.mark.mpi
@pytest.mark.usefixtures("several_ranks")
def test_ranks_find_the_same(wave: Surface) -> None:
    how: dict[str, Any] = {"delta_max": 0.02, "steps": 2, "sides": "free", "formulation": Formulation(friction=0.4)}
    size, found = MeshSize(h_contact=0.14, growth=0.6, h_max=0.5), []
    for comm in (here(), world()):
        run = solve_contact(wave, ELASTIC, size=size, comm=comm, **how)
        sliding = run.solver.contact.sliding
        tangential = np.linalg.norm(sliding.traction, axis=1).sum()
        found.append([run.solver.force, run.solver.solid.comm.allreduce(float(tangential))])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-6)


def test_friction_that_does_not_settle_fails_the_step(
    wave: Surface, block: BlockMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver = pressed(wave, block, 0.4, steps=1)
    monkeypatch.setattr(solver.contact, "settle", lambda: True)
    stats = solver.step(0.021)
    assert not stats.converged and stats.reason == "friction does not settle"
