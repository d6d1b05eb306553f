"""Coulomb friction on a rigid flat: Spence's sphere, both limits, a flat that moves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipk

from asperity.adaptive.solve_contact import solve_contact
from asperity.contact.coulomb import Coulomb
from asperity.mesh.block import BlockMesh
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField
from asperity.model.material import Material
from asperity.model.settings import Formulation, MeshSize
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.make import make_contact_solver
from asperity.quasistatic.slip_paths import slip_paths
from asperity.slip.path import SlipPath
from asperity.surface import Surface


def here() -> Any:
    from mpi4py import MPI

    return MPI.COMM_SELF


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


@pytest.mark.parametrize("friction", [0.15, 0.25])
def test_a_sphere_sticks_inside_the_radius_of_spence(cap: Surface, friction: float) -> None:
    """Goodman's approximation of Spence's solution: (a/2c) ln((a + c)/(a - c)) = mu/beta K(sqrt(1 - c^2/a^2)).

    Johnson, Contact Mechanics (1985), section 5.4; beta is Dundurs' constant. The outermost ring that sticks is between
    that of the last step and an element beyond.
    """
    nu, a = 0.3, 0.04
    beta = (1.0 - 2.0 * nu) / (2.0 * (1.0 - nu))
    c = brentq(lambda x: np.log((1 + x) / (1 - x)) / (2 * x) - friction / beta * ellipk(1 - x * x), 1e-6, 1 - 1e-9)
    size = MeshSize(h_contact=0.006, growth=0.4, h_max=0.3)
    run = {"delta_max": a**2 / 10.0, "steps": 12, "size": size, "comm": here()}
    solver = solve_contact(cap, Material(1.0, nu), formulation=Formulation(friction=friction), **run).solver
    contact = solver.contact
    assert isinstance(contact, Coulomb)
    radius = np.hypot(*solver.solid.points[contact.nodes(), :2].T) / a
    traction = np.linalg.norm(contact.traction[contact.active], axis=1)
    limit = friction * solver.nodal_force[contact.nodes()]
    for ring, low, high in ((radius < c - 0.1, 0.0, 0.95), ((radius > c + 0.1) & (radius < 1.0), 0.95, 1.02)):
        assert low < traction[ring].sum() / limit[ring].sum() < high


def test_between_both_limits(wave: Surface, block: BlockMesh) -> None:
    forces = [pressed(wave, block, friction).force for friction in ("none", 1e-4, 0.4, 2.0, "stick")]
    assert forces[1] == pytest.approx(forces[0], rel=1e-4)
    assert forces[0] < 0.97 * forces[2] and forces[2] < forces[3]
    assert forces[3] == pytest.approx(forces[4], rel=3e-3)


# --- a flat that moves ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def loop(wave: Surface, block: BlockMesh) -> tuple[SlipPath, float]:
    solver = pressed(wave, block, 0.4)
    before, held = solver.force, np.array(solver.contact.held)
    path = slip_paths(solver, solver.force, 0.4, (0.6,), steps=3)[0]
    assert solver.force == pytest.approx(before, rel=1e-9)
    np.testing.assert_array_equal(solver.contact.held, held)
    assert not solver.checks.violated
    return path, before


def test_a_loop_closes_and_loses(loop: tuple[SlipPath, float]) -> None:
    """Friction loses in each step, and the flat comes back; its force never exceeds the limit."""
    path, load = loop
    top, bottom = path.end(0), path.end(1)
    assert path.force == pytest.approx(0.6 * 0.4 * load, rel=3e-3)
    assert np.all(np.diff(path.dissipated) >= 0.0)
    assert path.u[-1] == pytest.approx(path.u[top], rel=0.05)
    u, T = path.u[bottom:], path.T[bottom:]
    assert 0.0 < path.energy and np.all(np.abs(path.T) <= 0.4 * load)
    assert T[-1] == pytest.approx(path.T[top], rel=3e-3) and np.all(np.diff(u) > 0.0)


@pytest.mark.mpi
def test_ranks_find_the_same(wave: Surface) -> None:
    from mpi4py import MPI

    size, formulation = MeshSize(h_contact=0.14, growth=0.6, h_max=0.5), Formulation(friction=0.4)
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        run = solve_contact(
            wave,
            Material(1.0, 0.0),
            delta_max=0.02,
            steps=2,
            size=size,
            sides="free",
            formulation=formulation,
            comm=comm,
        )
        path = slip_paths(run.solver, run.solver.force, 0.4, (0.5,), steps=1)[0]
        found.append([run.solver.force, path.energy, *path.u])
    np.testing.assert_allclose(found[1], found[0], rtol=2e-3, atol=1e-12)


def test_friction_that_does_not_settle_fails_the_step(
    wave: Surface, block: BlockMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver = pressed(wave, block, 0.4, steps=1)
    monkeypatch.setattr(solver.contact, "settle", lambda: True)
    stats = solver.step(0.021)
    assert not stats.converged and stats.reason == "friction does not settle"
