# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Nodal sums over the ranks, and the coarse problem of the p-multigrid that each rank solves for itself."""

from __future__ import annotations

import numpy as np
import pytest

from asperity.fem.ghosts import Ghosts
from asperity.fem.shared_nodes import SharedNodes
from asperity.linear.coarse import Distributed, Replicated
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import distribute


@pytest.mark.mpi
def test_all_ranks_that_hold_a_node_get_the_sum(coarse: BlockMesh | None) -> None:
    """Like the two ghost updates in succession, and the same to the last bit everywhere."""
    from dolfinx import fem
    from mpi4py import MPI

    mesh, _ = distribute(MPI.COMM_WORLD, coarse, 1.0)
    index_map = fem.functionspace(mesh, ("Lagrange", 2, (3,))).dofmap.index_map
    nodes = index_map.size_local + index_map.num_ghosts
    values = np.random.default_rng(mesh.comm.rank).normal(size=(nodes, 3)).astype(np.float32)
    ghosts = Ghosts(index_map)
    expected = ghosts.scatter_forward(ghosts.scatter_reverse(values.copy()).copy()).copy()
    summed = SharedNodes(index_map).sum(values)
    np.testing.assert_allclose(summed, expected, rtol=0, atol=4e-6)
    of_owner = ghosts.scatter_forward(summed[: index_map.size_local].copy())
    np.testing.assert_array_equal(summed, of_owner)


@pytest.mark.mpi
@pytest.mark.parametrize("kind", ["replicated", "distributed"])
def test_coarse_solution_solves_the_sum_of_the_parts(coarse: BlockMesh | None, kind: str) -> None:
    """Against products with the parts, which know nothing of the whole matrix; algebraic multigrid is approximate."""
    from dolfinx import fem
    from mpi4py import MPI

    mesh, _ = distribute(MPI.COMM_WORLD, coarse, 1.0)
    dofmap = fem.functionspace(mesh, ("Lagrange", 1, (3,))).dofmap
    index_map = dofmap.index_map
    ghosts = Ghosts(index_map)
    corners = index_map.size_local + index_map.num_ghosts
    numbers = index_map.local_to_global(np.arange(corners, dtype=np.int32))
    points = np.random.default_rng(0).random((index_map.size_global, 3))[numbers]
    problem: Replicated | Distributed = Replicated(dofmap, mesh.comm, symmetric=True)
    if kind == "distributed":
        problem = Distributed(dofmap, points, mesh.comm, symmetric=True, factorised=False)
    sparsity = problem.sparsity
    rows = np.repeat(np.arange(3 * corners), np.diff(sparsity.rows))
    problem.values[:] = np.where(rows == sparsity.columns, 2.0, -0.01)
    problem.update()
    right = np.random.default_rng(mesh.comm.rank).normal(size=(corners, 3)).astype(np.float32)
    x = problem.solve(right.ravel())
    np.testing.assert_array_equal(x, ghosts.scatter_forward(x[: 3 * index_map.size_local].reshape(-1, 3)).ravel())
    image = np.zeros(3 * corners)
    np.add.at(image, rows, problem.values * x[sparsity.columns])
    owned = ghosts.scatter_reverse(image.reshape(-1, 3)).copy(), ghosts.scatter_reverse(right).copy()
    tolerance = {"replicated": 1e-5, "distributed": 0.3}[kind]
    error = mesh.comm.allreduce(float(np.sum((owned[0] - owned[1]) ** 2)))
    assert error < tolerance**2 * mesh.comm.allreduce(float(np.sum(owned[1] ** 2)))
