"""The end of the Krylov method."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import here, world

from asperity.errors import AsperityWarning, ConvergenceError
from asperity.fem.solid import Solid
from asperity.linear import coarse as coarse_problem
from asperity.linear.solver import LinearSolver
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import TOP, distribute
from asperity.model.material import Material
from asperity.runtime import memory


@pytest.mark.mpi
@pytest.mark.parametrize("rtol", [3e-2, 1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("load", ["on the top", "everywhere"])
def test_predicted_energy_of_the_error_is_that_of_the_exact_solution(
    coarse: BlockMesh | None, load: str, rtol: float
) -> None:
    """CG ends where the energy norm of the error is below the tolerance times that of the solution, about."""
    comm = world()
    solid = Solid(*distribute(comm, coarse, 1.0), Material(1.0, 0.3))
    solid.tangent.assemble()
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
    solid.tangent.assemble()
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
    solid = Solid(*distribute(world(), coarse, 1.0), Material(1.0, 0.3))
    solid.tangent.assemble()
    r, y = solid.vector(), solid.vector()
    r.array = np.where(np.isin(np.arange(3 * solid.owned), solid.fixed), 0.0, 1.0)
    solver = LinearSolver(solid, "cg")
    multigrid: Any = solver.multigrid
    algebraic = multigrid._coarse
    assert isinstance(algebraic, coarse_problem.Distributed)
    with monkeypatch.context() as patch:
        patch.setattr(algebraic, "solve", np.zeros_like)
        patch.setattr(algebraic, "update", lambda values: multigrid._coarse is not algebraic)
        assert solver.solve(r, solid.fixed, np.empty(0), y, 1e-3)[1]
    assert multigrid._coarse is not algebraic and multigrid._coarse.factorisation is None
    assert solver.rescued == 0


@pytest.mark.mpi
@pytest.mark.parametrize("kind", ["cg", "lu"])
def test_a_factorisation_that_lacks_memory_says_what_to_set(
    coarse: BlockMesh | None, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """No rank takes it: as a rescue it fails, as the solver that was chosen it ends the path, which keeps its curve."""
    comm = world()
    solid = Solid(*distribute(comm, coarse, 1.0), Material(1.0, 0.3))
    solid.tangent.assemble()
    r, y = solid.vector(), solid.vector()
    r.array = 1.0
    solver = LinearSolver(solid, kind)
    monkeypatch.setattr("asperity.linear.petsc.free_share", lambda comm: 2e6)
    if kind == "lu":
        solver = LinearSolver(solid, kind)
        with pytest.raises(ConvergenceError, match=r"MUMPS .* GiB on all ranks.* solver.linear"):
            solver.solve(r, solid.fixed, np.empty(0), y, 1e-3)
        return
    with monkeypatch.context() as patch:
        patch.setattr(solver, "_outcome", lambda: (7, False))
        with pytest.warns(AsperityWarning, match="take more memory") if comm.rank == 0 else nullcontext():
            assert solver.solve(r, solid.fixed, np.empty(0), y, 1e-3) == (7, False)
    assert not y.array_r.any() and "take more memory" in solver.lacks
    solver.rescue = False  # the next step
    assert solver.solve(r, solid.fixed, np.empty(0), y, 1e-3)[1]
    monkeypatch.undo()
    again = LinearSolver(solid, kind)
    monkeypatch.setattr(again, "_outcome", lambda: (7, False))
    assert again.solve(r, solid.fixed, np.empty(0), y, 1e-3)[1] and again.rescued == 1 and not again.lacks


def test_memory_that_a_container_leaves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a group of processes the least of its limits counts, without what the system can drop."""
    whole = memory.free_share(here())
    assert 0.0 < whole < np.inf and memory.peak() > 1e7
    group = tmp_path / Path("/proc/self/cgroup").read_text().rpartition("0::")[2].strip().lstrip("/")
    group.mkdir(parents=True, exist_ok=True)
    (group / "memory.max").write_text("max\n")
    (group / "memory.stat").write_text("anon 3000\nfile 900\n")
    (tmp_path / "memory.max").write_text("5000\n")
    (tmp_path / "memory.stat").write_text("anon 4000\nfile 900\n")
    monkeypatch.setattr(memory, "GROUPS", tmp_path)
    assert memory.free_share(here()) == 1000.0
