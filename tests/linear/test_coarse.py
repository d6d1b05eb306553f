"""Coarse problem of the p-multigrid: its factors, against dense algebra, and the ways in which ranks share it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import ELASTIC, make_contact_solver, world
from scipy import sparse

from asperity import _solver
from asperity.arrays import Floats
from asperity.fem.ghosts import Ghosts
from asperity.fem.sparsity import SparsityPattern
from asperity.linear import coarse as coarse_problem
from asperity.linear.coarse import Distributed, Factors, Substructures, interface_of, make_coarse
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import distribute
from asperity.model.settings import SolverOptions
from asperity.surface import Surface

pytestmark = pytest.mark.skipif(not hasattr(_solver, "Cholesky"), reason="built without CHOLMOD")

PIECES = {  # pairs of neighbouring nodes, nodes of the interface
    "no interface": ([[k, k + 1] for k in range(11)], []),
    "one piece": ([[k, (k + 1) % 12] for k in range(12)] + [[k, (k + 5) % 12] for k in range(12)], [7, 2, 11]),
    "pieces": ([[0, 1], [1, 2], [4, 5], [5, 6], [2, 9], [6, 3], [8, 10], [7, 11]], [9, 3, 10, 7]),
    "interface next to itself only": ([[0, 1], [1, 2], [8, 9], [9, 10], [10, 11]], [11, 8, 2, 10, 9]),
    "no interior": ([[k, k + 1] for k in range(11)], list(range(11, -1, -1))),
}


def matrix(pairs: list[list[int]], nodes: int = 12) -> tuple[SparsityPattern, Floats]:
    """Positive definite matrix with three dofs a node on the graph of these pairs: pattern and values."""
    pattern = SparsityPattern(np.array(pairs, dtype=np.int32), nodes)
    dense = np.random.default_rng(3).normal(size=(3 * nodes, 3 * nodes))
    rows = np.repeat(np.arange(3 * nodes), np.diff(pattern.rows))
    values = (dense + dense.T)[rows, pattern.columns]
    values[pattern.diagonal] = 1.0 + np.bincount(rows, abs(values))
    return pattern, values


def whole(pattern: SparsityPattern, values: Floats) -> Floats:
    """Dense matrix."""
    return np.asarray(sparse.csr_array((values, pattern.columns, pattern.rows)).todense())


@pytest.mark.parametrize("name", PIECES)
def test_elimination_leaves_the_schur_complement(name: str) -> None:
    """Whatever the pieces of the interior, and whether they touch the interface."""
    pairs, nodes = PIECES[name]
    pattern, values = matrix(pairs)
    A, interface = whole(pattern, values), np.array(nodes, dtype=np.int64)
    outer = (3 * interface[:, None] + np.arange(3)).ravel()
    inner = np.setdiff1d(np.arange(len(A)), outer)
    factors = Factors(pattern, interface)
    shift = np.linspace(1.0, 2.0, len(outer), dtype=np.float32)
    assert factors.factorise(values, shift)

    lower = factors.last_block()
    eliminated = A[np.ix_(outer, inner)] @ np.linalg.solve(A[np.ix_(inner, inner)], A[np.ix_(inner, outer)])
    schur = A[np.ix_(outer, outer)] - eliminated
    np.testing.assert_allclose(lower @ lower.T - np.diag(shift), schur, atol=1e-5 * abs(A).max())

    right = np.random.default_rng(4).normal(size=len(A)).astype(np.float32)
    work = factors.forward(right)
    left = right[outer] - A[np.ix_(outer, inner)] @ np.linalg.solve(A[np.ix_(inner, inner)], right[inner])
    tail = work[len(inner) :]
    np.testing.assert_allclose(lower @ tail, left, atol=1e-5)
    tail[:] = lower.T @ np.linalg.solve(schur, left)
    np.testing.assert_allclose(factors.backward(work), np.linalg.solve(A, right), rtol=1e-4, atol=1e-6)


def test_a_matrix_that_is_not_positive_definite_is_refused(capfd: pytest.CaptureFixture[str]) -> None:
    """Without a word of the library; the next matrix is factorised again."""
    pattern, values = matrix(PIECES["no interface"][0])
    factors = Factors(pattern, np.empty(0, dtype=np.int64))
    none = np.empty(0, dtype=np.float32)
    worse = values.copy()
    worse[pattern.diagonal[5]] = -1.0
    assert not factors.factorise(worse, none)
    assert factors.factorise(values, none)
    worse[pattern.diagonal[5]] = np.nan
    assert not factors.factorise(worse, none)
    assert capfd.readouterr() == ("", "")


def test_arrays_that_do_not_fit_are_refused() -> None:
    pattern, _ = matrix(PIECES["pieces"][0])
    order = np.arange(36, dtype=np.int32)
    factors, wrong = _solver.Cholesky(pattern.rows, pattern.columns, order), np.zeros(5, dtype=np.float32)
    beyond, twice = order + 1, np.where(order == 1, 0, order).astype(np.int32)
    calls: tuple[Callable[[], object], ...] = (
        lambda: factors.factorise(wrong), lambda: factors.solve(wrong, True),
        *(lambda n=n: factors.last_block(np.zeros((n, n - n % 2), dtype=np.float32)) for n in (7, 38)),
        *(lambda of=of: _solver.Cholesky(pattern.rows, pattern.columns, of) for of in (beyond, twice, order[:35])),
        lambda: _solver.Cholesky.best_order(pattern.rows, pattern.columns, order[:35]),
    )  # fmt: skip
    for call in calls:
        with pytest.raises(
            (ValueError, RuntimeError), match=r"has shape|more rows than|entries from|CHOLMOD|twice|order"
        ):
            call()


def corners_of(block: BlockMesh | None) -> tuple[Any, Floats]:
    """Degrees of freedom at the corners of the cells, and a point for each, the same on all ranks."""
    from dolfinx import fem

    mesh, _ = distribute(world(), block, 1.0)
    dofmap = fem.functionspace(mesh, ("Lagrange", 1, (3,))).dofmap
    held = np.arange(dofmap.index_map.size_local + dofmap.index_map.num_ghosts, dtype=np.int32)
    numbers = dofmap.index_map.local_to_global(held)
    return dofmap, np.random.default_rng(0).random((dofmap.index_map.size_global, 3))[numbers]


@pytest.mark.mpi
@pytest.mark.parametrize("kind", ["substructures", "distributed"])
def test_coarse_solution_solves_the_sum_of_the_parts(coarse: BlockMesh | None, kind: str) -> None:
    """Against products with the parts, which know nothing of the whole matrix; algebraic multigrid is approximate."""
    comm = world()
    dofmap, points = corners_of(coarse)
    index_map, corners = dofmap.index_map, len(points)
    ghosts = Ghosts(index_map)
    problem: Distributed | Substructures = Substructures(dofmap, comm, interface_of(index_map, comm))
    if kind == "distributed":
        problem = Distributed(dofmap, points, comm, symmetric=True, factorised=False)
        assert problem._matrix.A.getBlockSize() == 3  # it aggregates nodes, not dofs, on one rank too
    sparsity = problem.sparsity
    rows = np.repeat(np.arange(3 * corners), np.diff(sparsity.rows))
    values = np.where(rows == sparsity.columns, 2.0, -0.01)
    assert problem.update(values)
    right = np.random.default_rng(comm.rank).normal(size=(corners, 3)).astype(np.float32)
    x = problem.solve(right.ravel())
    np.testing.assert_array_equal(x, ghosts.scatter_forward(x[: 3 * index_map.size_local].reshape(-1, 3)).ravel())
    image = np.zeros(3 * corners)
    np.add.at(image, rows, values * x[sparsity.columns])
    owned = ghosts.scatter_reverse(image.reshape(-1, 3)).copy(), ghosts.scatter_reverse(right).copy()
    tolerance = 0.3 if kind == "distributed" else 1e-5
    error = comm.allreduce(float(np.sum((owned[0] - owned[1]) ** 2)))
    assert error < tolerance**2 * comm.allreduce(float(np.sum(owned[1] ** 2)))


@pytest.mark.mpi
def test_way_to_solve_the_coarse_problem(coarse: BlockMesh | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """By its size, by that of the interface, by its symmetry, and by the options of the user."""
    from petsc4py import PETSc

    (dofmap, points), comm = corners_of(coarse), world()

    def kind(symmetric: bool = True) -> type:
        return type(make_coarse(dofmap, points, comm, symmetric))

    assert kind() is Substructures and kind(symmetric=False) is Distributed
    options = PETSc.Options(coarse_problem.PREFIX)
    options["pc_type"] = "gamg"
    assert kind() is Distributed
    options.delValue("pc_type")
    if comm.size > 1:
        shared = interface_of(dofmap.index_map, comm).dofs ** 2 * comm.size / (3 * dofmap.index_map.size_global)
        for dense, expected in ((1.01 * shared, Substructures), (0.99 * shared, Distributed)):
            monkeypatch.setattr(coarse_problem, "DENSE", dense)
            assert kind() is expected
    with monkeypatch.context() as patch:
        patch.setattr(coarse_problem, "DIRECT_LIMIT", 3)
        assert kind() is Distributed
    monkeypatch.delattr(_solver, "Cholesky")
    assert kind() is Distributed


@pytest.mark.mpi
def test_a_path_without_cholmod_is_the_usual_one(
    rough: Surface, coarse: BlockMesh | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Force as with it, and no rescue."""
    options = SolverOptions(linear="cg")
    usual = make_contact_solver(world(), rough, coarse, ELASTIC, options=options)
    monkeypatch.delattr(_solver, "Cholesky")
    without = make_contact_solver(world(), rough, coarse, ELASTIC, options=options)
    for solver in (usual, without):
        for delta in (0.01, 0.02, 0.015):
            assert solver.step(delta).converged
        assert solver.counts.direct == 0
    assert without.force == pytest.approx(usual.force, rel=1e-6)
