"""Order of the displacement nodes."""

from __future__ import annotations

import shutil
import subprocess
import sys

import numpy as np
import pytest
from conftest import MPIRUN, here, world

from asperity.arrays import Integers
from asperity.fem.ghosts import Ghosts
from asperity.fem.node_order import cuthill_mckee, displacement_space
from asperity.fem.sparsity import SparsityPattern
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import distribute
from asperity.mesh.element import node_ends

#: Ghosts on more ranks than the tests run on, where a rank may hold nodes that it shares with some of the others only.
GHOSTS = """
import numpy as np
from asperity.runtime import compat
compat.start()
from asperity.fem.ghosts import Ghosts
from dolfinx.mesh import create_unit_cube
from mpi4py import MPI
from asperity.fem.node_order import displacement_space

for n in (2, 3, 4):
    V = displacement_space(create_unit_cube(MPI.COMM_WORLD, n, n, n))
    points, owned = V.tabulate_dof_coordinates(), V.dofmap.index_map.size_local
    found = Ghosts(V.dofmap.index_map).scatter_forward(points[:owned].copy())
    assert np.allclose(found, points, rtol=0, atol=1e-14)
"""


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="there is no mpirun")
def test_ghosts_have_the_numbers_of_their_owners_on_four_ranks() -> None:
    command = [*MPIRUN, "4", sys.executable, "-c", GHOSTS]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


@pytest.mark.mpi
def test_space_has_the_functions_of_dolfinx_in_another_order(coarse: BlockMesh | None) -> None:
    """Interpolation, integrals and ghosts are those of the space that dolfinx makes."""
    import ufl
    from dolfinx import fem

    mesh, _ = distribute(world(), coarse, 1.0)
    V, theirs = displacement_space(mesh), fem.functionspace(mesh, ("Lagrange", 2, (3,)))
    ours = V.dofmap.index_map
    assert ours.size_local == theirs.dofmap.index_map.size_local
    assert ours.size_global == theirs.dofmap.index_map.size_global
    # a node has the place it has in space, on the rank that owns it and on those where it is a ghost
    points = V.tabulate_dof_coordinates()
    np.testing.assert_array_equal(points[V.dofmap.list], theirs.tabulate_dof_coordinates()[theirs.dofmap.list])
    of_owners = Ghosts(ours).scatter_forward(points[: ours.size_local].copy())
    np.testing.assert_allclose(of_owners, points, rtol=0, atol=1e-14)
    sums = []
    for space in (V, theirs):
        u = fem.Function(space)
        u.interpolate(lambda x: np.stack([x[0] ** 2, x[1] * x[2], x[2] - 3.0 * x[0]]))
        energy = fem.form(ufl.inner(ufl.grad(u), ufl.grad(u)) * ufl.dx)
        sums.append(mesh.comm.allreduce(fem.assemble_scalar(energy)))
    assert sums[0] == pytest.approx(sums[1], rel=1e-13)


def test_nodes_around_a_corner_follow_one_another() -> None:
    """Each corner and the edges to corners before it do, so a product finds more of its nodes in the nearest cache."""
    from dolfinx import fem
    from dolfinx.mesh import create_unit_cube

    mesh = create_unit_cube(here(), 5, 5, 5)
    cell_nodes = fem.functionspace(mesh, ("Lagrange", 2)).dofmap.list
    nodes = int(cell_nodes.max()) + 1
    order = cuthill_mckee(cell_nodes, nodes)
    assert np.array_equal(np.sort(order), np.arange(nodes))
    new = np.argsort(order)
    ends = np.empty((nodes, 2), dtype=np.int64)
    for k, pair in enumerate(node_ends()):
        ends[new[cell_nodes[:, k]]] = new[cell_nodes[:, pair]]
    later = ends.max(axis=1)
    assert np.count_nonzero(np.diff(later)) + 1 == len(np.unique(later))
    assert reads(new[cell_nodes], nodes) < 0.6 * reads(cell_nodes, nodes)


def test_a_rank_without_cells_has_an_order_too() -> None:
    assert cuthill_mckee(np.empty((0, 10), dtype=np.int32), 3).tolist() == [0, 1, 2]


def reads(cell_nodes: Integers, nodes: int) -> int:
    """Lines of four nodes that a product with the upper half reads, but those among its last 100 reads."""
    lines = SparsityPattern(cell_nodes, nodes).upper[1] // 4
    return sum(line not in lines[max(k - 100, 0) : k] for k, line in enumerate(lines))
