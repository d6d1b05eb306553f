"""The end of the Krylov method, and the messages of its iterations: sums over all ranks, exchanges with neighbours."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import CLEAN, ELASTIC, here, world

from asperity.adaptive.solve_contact import solve_contact
from asperity.curve import Curve
from asperity.errors import AsperityWarning, ConvergenceError
from asperity.fem.ghosts import SharedSums
from asperity.fem.solid import Solid
from asperity.linear import coarse as coarse_problem
from asperity.linear.solver import Assembled, LinearSolver
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import TOP, distribute
from asperity.model.settings import SolverOptions
from asperity.runtime import usage
from asperity.surface import Surface

SUMS = 3  # of an iteration: two of PETSc, one of them of two products, and that of the coarse problem
EXCHANGES = 9  # of an iteration: one for each of the six products of the V-cycle, and three around it


def elastic(comm: Any, block: BlockMesh | None, load: str = "on the top") -> tuple[Solid, Any, Any]:
    """Solid with its matrix, a load and a vector for the solution; collective."""
    solid = Solid(*distribute(comm, block, 1.0), ELASTIC)
    solid.tangent.assemble()
    r, y = solid.vector(), solid.vector()
    if load == "everywhere":
        r.array = np.random.default_rng(comm.rank).normal(size=3 * solid.owned)
    else:
        r.array[3 * solid.nodes_on(TOP) + 2] = -1.0
    r.array[solid.fixed] = 0.0
    return solid, r, y


@pytest.mark.mpi
@pytest.mark.parametrize("rtol", [3e-2, 1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("load", ["on the top", "everywhere"])
def test_predicted_energy_of_the_error_is_that_of_the_exact_solution(
    coarse: BlockMesh | None, load: str, rtol: float
) -> None:
    """CG ends where the energy norm of the error is below the tolerance times that of the solution, about."""
    comm = world()
    solid, r, y = elastic(comm, coarse, load)
    exact = solid.vector()
    assert LinearSolver(solid, "lu").solve(r, solid.fixed, np.empty(0), exact, 0.0)[1]
    solver = LinearSolver(solid, "cg")
    assert solver.solve(r, solid.fixed, np.empty(0), y, rtol)[1]

    def energy(x: np.ndarray) -> float:
        return float(comm.allreduce(x @ solver.product(x)))

    error = energy(y.array_r - exact.array_r)
    assert 0.3 < solver.left / error < 3.0
    assert error < (1.5 * rtol) ** 2 * energy(exact.array_r)


def test_a_load_of_zero_is_solved_at_once(coarse: BlockMesh) -> None:
    solid, r, y = elastic(here(), coarse)
    solver = LinearSolver(solid, "cg")
    assert solver.solve(0.0 * r, solid.fixed, np.empty(0), y, 1e-2) == (0, True)
    assert solver.left == 0.0 and not y.array_r.any()


@pytest.mark.mpi
def test_a_coarse_problem_that_multigrid_does_not_solve_is_factorised(
    coarse: BlockMesh | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By MUMPS on all ranks, whatever the size, before the whole system is."""
    monkeypatch.setattr(coarse_problem, "DIRECT_LIMIT", 3)
    solid, r, y = elastic(world(), coarse)
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
def test_a_factorisation_that_lacks_memory_says_what_to_set(
    coarse: BlockMesh | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No rank takes it: as a rescue it fails, as the solver that was chosen it ends the path, which keeps its curve."""
    solid, r, y = elastic(world(), coarse)
    held = solid.fixed, np.empty(0)
    solver, again = (LinearSolver(solid, "cg") for _ in range(2))
    with monkeypatch.context() as patch:
        patch.setattr("asperity.linear.petsc.free_share", lambda comm: 2e6)
        chosen = LinearSolver(solid, "lu")
        with pytest.raises(ConvergenceError, match=r"MUMPS .* GiB on all ranks.* solver.linear"):
            chosen.solve(r, *held, y, 1e-3)
        patch.setattr(solver, "_outcome", lambda: (7, False))
        with pytest.warns(AsperityWarning, match="take more memory") if world().rank == 0 else nullcontext():
            assert solver.solve(r, *held, y, 1e-3) == (7, False)
    assert not y.array_r.any() and "take more memory" in solver.lacks
    solver.rescue = False  # the next step
    assert solver.solve(r, *held, y, 1e-3)[1]
    monkeypatch.setattr(again, "_outcome", lambda: (7, False))
    assert again.solve(r, *held, y, 1e-3)[1] and again.rescued == 1 and not again.lacks


def test_memory_that_a_container_leaves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a group of processes the least of its limits counts, without what the system can drop."""
    whole = usage.free_share(here())
    assert 0.0 < whole < np.inf and usage.peak() > 1e7
    group = tmp_path / Path("/proc/self/cgroup").read_text().rpartition("0::")[2].strip().lstrip("/")
    group.mkdir(parents=True, exist_ok=True)
    (group / "memory.max").write_text("max\n")
    (group / "memory.stat").write_text("anon 3000\nfile 900\n")
    (tmp_path / "memory.max").write_text("5000\n")
    (tmp_path / "memory.stat").write_text("anon 4000\nfile 900\n")
    monkeypatch.setattr(usage, "GROUPS", tmp_path)
    assert usage.free_share(here()) == 1000.0


# --- messages --------------------------------------------------------------------------------------------------


class Counted:
    """A communicator that counts its sums by name."""

    def __init__(self, comm: Any, calls: Counter[str]) -> None:
        self._comm, self._calls = comm, calls

    def __getattr__(self, name: str) -> Any:
        if name in ("allreduce", "Allreduce", "Iallreduce"):
            self._calls[name] += 1
        return getattr(self._comm, name)


@pytest.mark.mpi
@pytest.mark.usefixtures("several_ranks")
def test_messages_of_an_iteration(coarse: BlockMesh | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """None is pickled; the energy of the error is summed while the next product is made."""
    from dolfinx import la
    from petsc4py import PETSc

    comm = world()
    solid, r, y = elastic(comm, coarse)
    solver = LinearSolver(solid, "cg")
    calls: Counter[str] = Counter()
    solid.comm = Counted(comm, calls)
    multigrid: Any = solver.multigrid
    multigrid._coarse._comm = Counted(comm, calls)
    for kind, name in ((la.Vector, "scatter_forward"), (la.Vector, "scatter_reverse"), (SharedSums, "add")):
        exchange = getattr(kind, name)

        def counted(self: Any, *given: Any, exchange: Any = exchange) -> None:
            calls["exchanges"] += 1
            exchange(self, *given)

        monkeypatch.setattr(kind, name, counted)
    PETSc.Log.begin()
    event = PETSc.Log.Event("KSPSolve")

    def solve(rtol: float) -> tuple[int, Counter[str]]:
        """Iterations and calls of a solve whose preconditioner is there."""
        solver.prescribe(solid.fixed, np.empty(0), rtol)
        calls.clear()
        before = event.getPerfInfo()["numReductions"]
        solver.ksp.solve(r, y)
        assert solver.solved
        calls["PETSc"] = int(event.getPerfInfo()["numReductions"] - before)
        return solver.iterations, calls.copy()

    solve(1e-2)
    few, some = solve(1e-1), solve(1e-4)
    iterations = some[0] - few[0]
    assert iterations >= 3
    each = {name: (some[1][name] - few[1][name]) / iterations for name in (*some[1], *few[1])}
    assert each.get("allreduce", 0.0) == 0.0
    assert each["Iallreduce"] == 1.0
    assert each["PETSc"] + each["Allreduce"] <= SUMS
    assert each["exchanges"] <= EXCHANGES


@pytest.mark.mpi
def test_sums_of_all_holders(coarse: BlockMesh | None) -> None:
    """One exchange gives what two give, and the same bits on each rank."""
    solid = Solid(*distribute(world(), coarse, 1.0), ELASTIC)
    parts = np.random.default_rng(solid.comm.rank).normal(size=(solid.nodes, 4)).astype(np.float32)
    expected = solid.ghosts.scatter_forward(solid.ghosts.scatter_reverse(parts).copy())
    found = parts.copy()
    SharedSums(solid.V.dofmap.index_map, solid.comm, 4).add(found)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(solid.ghosts.scatter_forward(found[: solid.owned].copy()), found)


@pytest.mark.mpi
def test_ranks_that_share_no_node_keep_their_parts() -> None:
    from dolfinx.common import IndexMap

    parts = np.ones((3, 4), dtype=np.float32)
    SharedSums(IndexMap(world(), 3), world(), 4).add(parts)
    np.testing.assert_array_equal(parts, np.ones((3, 4)))


def test_petsc_warns_of_options_of_the_user_alone() -> None:
    """Where a run ends before its solvers are set up, their defaults are no spelling mistakes."""
    program = "from mpi4py import MPI; from asperity.linear.petsc import GAMG, set_defaults; "
    program += "set_defaults('asperity_', GAMG | {'mat_mumps_icntl_14': 100})"
    environment = CLEAN | {"PETSC_OPTIONS": "-asperity_missspelt 1"}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert [line.split()[2] for line in (done.stdout + done.stderr).splitlines() if line.startswith("Option left")] == [
        "name:-asperity_missspelt"
    ]


def press(surface: Surface, block: BlockMesh) -> Curve:
    options = SolverOptions(linear="lu")
    return solve_contact(surface, ELASTIC, delta_max=0.012, steps=3, options=options, block=block).curve


def test_a_system_that_petsc_gives_up_cuts_the_step_and_keeps_the_curve(
    coarse: BlockMesh, rough: Surface, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once: the force is that of a run without the failure. For good: the curve before, with step and approach."""
    from petsc4py import PETSc

    expected, prepare, calls, lasts = press(rough, coarse), Assembled.prepare, Counter[str](), 1

    def fail(self: Assembled, rows: Any) -> None:
        calls["prepare"] += 1
        prepare(self, rows)
        if 6 < calls["prepare"] <= 6 + lasts:
            raise PETSc.Error(76) from PETSc.Error(76)  # as from a solve within a call-back

    monkeypatch.setattr(Assembled, "prepare", fail)
    found = press(rough, coarse)
    assert len(found) == len(expected) + 1 and found.force[-1] == pytest.approx(expected.force[-1], rel=1e-7)
    calls.clear()
    lasts = 10**6
    with pytest.raises(ConvergenceError, match=r"no convergence at delta/L = .*PETSc.*76") as caught:
        press(rough, coarse)
    kept = caught.value.result.curve
    assert 1 <= len(kept) < 3
    np.testing.assert_array_equal(kept.force, expected.force[: len(kept)])


def test_an_option_that_petsc_does_not_know_is_no_crash(coarse: BlockMesh, rough: Surface) -> None:
    from petsc4py import PETSc

    options = PETSc.Options("asperity_")
    options["pc_type"] = "nonsense"
    try:
        with pytest.raises(ConvergenceError, match="the linear solver gave up, PETSc's error code 86"):
            press(rough, coarse)
    finally:
        options.delValue("pc_type")
