"""Messages of an iteration of CG on several ranks: sums over all ranks, and exchanges with neighbours."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest
from conftest import world

from asperity.fem.ghosts import SharedSums
from asperity.fem.solid import Solid
from asperity.linear.solver import LinearSolver
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import TOP, distribute
from asperity.model.material import Material

SUMS = 3  # of an iteration: two of PETSc, one of them of two products, and that of the coarse problem
EXCHANGES = 9  # of an iteration: one for each of the six products of the V-cycle, and three around it


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
    solid = Solid(*distribute(comm, coarse, 1.0), Material(1.0, 0.3))
    solid.tangent.assemble()
    r, y = solid.vector(), solid.vector()
    force = np.zeros((solid.owned, 3))
    force[solid.nodes_on(TOP), 2] = -1.0
    r.array = force.ravel()
    r.array[solid.fixed] = 0.0
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
    solid = Solid(*distribute(world(), coarse, 1.0), Material(1.0, 0.3))
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
