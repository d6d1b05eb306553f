"""The end of the Krylov method."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import here, world

from asperity.fem.solid import Solid
from asperity.linear import coarse as coarse_problem
from asperity.linear import solver as solver_module
from asperity.linear.solver import LinearSolver
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import TOP, distribute
from asperity.model.material import Material


@pytest.mark.mpi
@pytest.mark.parametrize("rtol", [3e-2, 1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("load", ["on the top", "everywhere"])
def test_predicted_energy_of_the_error_is_that_of_the_exact_solution(
    coarse: BlockMesh | None, load: str, rtol: float
) -> None:
    """CG ends where the energy norm of the error is below the tolerance times that of the solution, about."""
    comm = world()
    solid = Solid(*distribute(comm, coarse, 1.0), Material(1.0, 0.3))
    solid.assemble_tangent()
    r, y, exact = (solid.vector() for _ in range(3))
    force = np.zeros((solid.owned, 3))
    if load == "on the top":
        force[solid.nodes_on(TOP), 2] = -1.0
    else:
        force[:] = np.random.default_rng(comm.rank).normal(size=force.shape)
    r.array = force.ravel()
    r.array[solid.fixed] = 0.0
    assert LinearSolver(solid, "lu").solve(r, solid.fixed, np.empty(0), exact, 0.0)[1]
    solver = LinearSolver(solid, "cg")
    assert solver.solve(r, solid.fixed, np.empty(0), y, rtol)[1]

    def energy(x: np.ndarray) -> float:
        return float(comm.allreduce(x @ solver.product(x)))

    error = energy(y.array_r - exact.array_r)
    assert 0.3 < solver.left / error < 3.0
    assert error < (1.5 * rtol) ** 2 * energy(exact.array_r)


def test_a_load_of_zero_is_solved_at_once(coarse: BlockMesh) -> None:
    solid = Solid(*distribute(here(), coarse, 1.0), Material(1.0, 0.3))
    solid.assemble_tangent()
    r, y = solid.vector(), solid.vector()
    solver = LinearSolver(solid, "cg")
    assert solver.solve(r, solid.fixed, np.empty(0), y, 1e-2) == (0, True)
    assert solver.left == 0.0
    assert not y.array_r.any()


@pytest.mark.mpi
def test_a_coarse_problem_that_multigrid_does_not_solve_is_factorised(
    coarse: BlockMesh | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By MUMPS on all ranks, whatever the size, before the whole system is."""
    monkeypatch.setattr(coarse_problem, "DIRECT_LIMIT", 3)
    monkeypatch.setattr(solver_module, "DIRECT_LIMIT", 3)
    solid = Solid(*distribute(world(), coarse, 1.0), Material(1.0, 0.3))
    solid.assemble_tangent()
    r, y = solid.vector(), solid.vector()
    r.array = np.where(np.isin(np.arange(3 * solid.owned), solid.fixed), 0.0, 1.0)
    solver = LinearSolver(solid, "cg")
    method: Any = solver._method
    multigrid = method._multigrid
    algebraic = multigrid._coarse
    assert isinstance(algebraic, coarse_problem.Distributed)
    with monkeypatch.context() as patch:
        patch.setattr(algebraic, "solve", np.zeros_like)
        patch.setattr(algebraic, "update", lambda: multigrid._coarse is not algebraic)
        assert solver.solve(r, solid.fixed, np.empty(0), y, 1e-3)[1]
    assert multigrid._coarse is not algebraic and multigrid._coarse.factorisation is None
    assert solver.rescued == 0


def test_a_system_too_large_for_a_rescue_says_what_to_set(
    coarse: BlockMesh, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(solver_module, "DIRECT_LIMIT", 3)
    solid = Solid(*distribute(here(), coarse, 1.0), Material(1.0, 0.3))
    solid.assemble_tangent()
    r, y = solid.vector(), solid.vector()
    r.array = 1.0
    for kind in ("cg", "gamg"):
        solver = LinearSolver(solid, kind)
        monkeypatch.setattr(solver, "_outcome", lambda: (7, False))
        with caplog.at_level("INFO"):
            assert solver.solve(r, solid.fixed, np.empty(0), y, 1e-3) == (7, False)
        assert "lu solves by MUMPS on all ranks" in caplog.text
        caplog.clear()
