"""Nodal sums over the ranks."""

from __future__ import annotations

import numpy as np
import pytest

from asperity.fem.ghosts import Ghosts
from asperity.fem.shared_nodes import SharedNodes
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
    values = np.random.default_rng(mesh.comm.rank).normal(size=(nodes, 4)).astype(np.float32)
    ghosts = Ghosts(index_map)
    expected = ghosts.scatter_forward(ghosts.scatter_reverse(values.copy()).copy()).copy()
    summed = SharedNodes(index_map).sum(values)
    np.testing.assert_allclose(summed, expected, rtol=0, atol=4e-6)
    of_owner = ghosts.scatter_forward(summed[: index_map.size_local].copy())
    np.testing.assert_array_equal(summed, of_owner)
