"""The deformable block: its matrix, its linear solvers, orders of convergence."""

from __future__ import annotations

import shutil
import subprocess
import sys
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import ELASTIC, MPIRUN, assembled, here, world
from element_sample import cubes
from element_sample import matrix_of as csr_of
from scipy import sparse

from asperity.fem.solid import Solid
from asperity.linear import coarse as coarse_problem
from asperity.linear.matrix_free import TangentOperator
from asperity.linear.multigrid import PMultigrid
from asperity.linear.petsc import set_rigid_modes
from asperity.linear.solver import LinearSolver
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import distribute
from asperity.mesh.element import node_ends
from asperity.mesh.generate import build_block
from asperity.model.material import Material
from asperity.runtime.parallel import on_root
from asperity.surface import Flat, Sinusoid, Surface

Array = npt.NDArray[np.float64]

NU = 0.3


def block_of(comm: Any, surface: Surface, height: float, size: float) -> BlockMesh | None:
    return on_root(comm, lambda: build_block(surface, height, lambda x, y, depth: size))


def solid_of(comm: Any, block: BlockMesh | None, **options: Any) -> Solid:
    return Solid(*distribute(comm, block, 1.0), options.pop("material", ELASTIC), **options)


def matrix_of(solid: Solid) -> Any:
    """Tangent of the last force as a matrix of PETSc."""
    solid.tangent.assemble()
    return assembled(solid)


@pytest.mark.mpi
def test_matrix_is_that_of_dolfinx(coarse: BlockMesh | None) -> None:
    """The elastic stiffness by dolfinx's own assembly into its own matrix."""
    import ufl
    from dolfinx.fem import form
    from dolfinx.fem.petsc import assemble_matrix

    solid = solid_of(world(), coarse)
    u, v = ufl.TrialFunction(solid.V), ufl.TestFunction(solid.V)
    lam, mu = ELASTIC.lame
    stress = lam * ufl.tr(ufl.grad(u)) * ufl.Identity(3) + 2 * mu * ufl.sym(ufl.grad(u))
    dx = ufl.Measure("dx", solid.mesh, metadata={"quadrature_degree": 2})
    expected = assemble_matrix(form(ufl.inner(stress, ufl.sym(ufl.grad(v))) * dx))
    expected.assemble()
    scale = expected.norm()
    expected.axpy(-1.0, matrix_of(solid), structure=expected.Structure.DIFFERENT_NONZERO_PATTERN)
    assert expected.norm() < 1e-12 * scale  # sums over ten nodes and several points: 100 rounding units


# --- linear solvers -------------------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize("kind", ["lu", "cg", "cg, shared"])
def test_linear_solver_with_prescribed_dofs(
    coarse: BlockMesh | None, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Prescribed dofs are exact, the free rows are in equilibrium; also with a coarse problem that the ranks share."""
    if kind == "cg, shared":
        kind = "cg"
        monkeypatch.setattr(coarse_problem, "DIRECT_LIMIT", 0)
    solid = solid_of(world(), coarse)
    held = 3 * solid.nodes_on(4) + 2
    rng = np.random.default_rng(world().rank)
    values = -0.01 * rng.uniform(size=len(held))
    rows = np.concatenate([solid.fixed, held]).astype(np.int32)
    solver = LinearSolver(solid, kind, rtol=1e-11)
    A = matrix_of(solid)
    for _ in range(2):  # the second time with everything set up
        r, y, out = (solid.vector() for _ in range(3))
        r.array = 1e-4 * rng.normal(size=3 * solid.owned)
        right = r.array_r.copy()
        iterations, solved = solver.solve(r, rows, values, y, 1e-11)
        assert solved
        np.testing.assert_array_equal(r.array_r, right)
        np.testing.assert_allclose(y.array_r[held], values, rtol=0, atol=1e-12)
        np.testing.assert_allclose(y.array_r[solid.fixed], 0.0, rtol=0, atol=1e-12)
        A.mult(y, out)
        lacking = out.array_r - right
        lacking[rows] = 0.0
        assert np.sqrt(world().allreduce(lacking @ lacking)) < 1e-7 * out.norm()
    assert iterations <= {"lu": 1, "cg": 40}[kind]


@pytest.mark.mpi
@pytest.mark.parametrize(("symmetric", "single"), [(True, False), (True, True), (False, True)])
def test_tangent_that_is_never_assembled_is_the_matrix(coarse: BlockMesh | None, symmetric: bool, single: bool) -> None:
    """On the free dofs, the unit matrix on the others; in single precision if that is enough and it is symmetric."""
    solid = solid_of(world(), coarse)
    A = matrix_of(solid)
    rng = np.random.default_rng(world().rank)
    if not symmetric:
        solid.tangent.values()[:] *= rng.uniform(size=len(solid.tangent.values()))
        A = assembled(solid)
    tangent = TangentOperator(solid, symmetric, single)
    tangent.update()
    held = rng.choice(3 * solid.owned, size=solid.owned // 3, replace=False).astype(np.int32)
    tangent.hold(held)
    x, y, expected = (solid.vector() for _ in range(3))
    x.array = rng.normal(size=3 * solid.owned)
    tangent.matrix().mult(x, y)
    kept = x.array_r[held].copy()
    x.array[held] = 0.0
    A.mult(x, expected)
    expected.array[held] = kept
    error = 8 * float(np.finfo(np.float32 if symmetric and single else float).eps)
    np.testing.assert_allclose(y.array_r, expected.array_r, rtol=0, atol=error * A.norm())


@pytest.mark.mpi
@pytest.mark.parametrize("kinematics", ["small", "finite"])
@pytest.mark.parametrize("strength", [None, 0.005])
def test_half_of_a_matrix_alone_is_that_of_the_whole(
    coarse: BlockMesh | None, strength: float | None, kinematics: str
) -> None:
    """Tangent, shifted and elastic stiffness where some cells flow; the values are made when they are asked for."""
    material = Material(1.0, NU, strength, kinematics=kinematics)
    solid = solid_of(world(), coarse, material=material)
    rng = np.random.default_rng(world().rank)
    for scale in (2e-4, 3e-4):
        solid.u.x.array[:] = scale * rng.normal(size=solid.u.x.array.shape)
        solid.u.x.scatter_forward()
        solid.internal_force()
        solid.kernels.commit()
    solid.internal_force()
    found: list[Any] = []
    for solid.tangent.halved in (False, True):
        solid.tangent.drop()
        tangent = solid.tangent.assemble
        for write in (tangent, partial(tangent, shift=0.25), solid.tangent.assemble_elastic):
            write()
            found += [solid.tangent.half().copy(), solid.tangent.values().copy()]
    for theirs, ours in zip(found[:6], found[6:], strict=True):
        error = 1e-5 if ours.dtype == np.float32 else 1e-12
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=error * np.abs(theirs).max())


def test_the_stiffness_of_a_contact_needs_the_whole_matrix(coarse: BlockMesh) -> None:
    """Written after a half, and before one: each time the current matrix counts."""
    solid = solid_of(here(), coarse, material=Material(1.0, NU, 0.005))
    solid.tangent.halved = True
    solid.internal_force()
    solid.tangent.assemble()
    half, whole = solid.tangent.half().copy(), solid.tangent.values().copy()

    def add() -> None:
        solid.tangent.values()[solid.sparsity.diagonal] += 1.0

    solid.tangent.assemble(add)
    stiffer = whole.copy()
    stiffer[solid.sparsity.diagonal] += 1.0
    np.testing.assert_array_equal(solid.tangent.values(), stiffer)
    assert np.sum(np.abs(solid.tangent.half() - half) > 0.5) == solid.dofs  # the half by itself is rounded cell by cell
    solid.tangent.assemble()
    np.testing.assert_array_equal(solid.tangent.half(), half)
    np.testing.assert_array_equal(solid.tangent.values(), whole)


def test_galerkin_matrix_is_that_of_the_interpolation(coarse: BlockMesh) -> None:
    """With masks on both levels: a held corner has free edges next to it, and stays out of the coarse problem."""
    from asperity import _solver
    from asperity.fem.sparsity import SparsityPattern

    solid = solid_of(here(), coarse)
    solid.tangent.assemble()
    cells = solid.cell_nodes
    corners = np.unique(cells[:, :4])
    number = np.full(solid.nodes, -1, dtype=np.int32)
    number[corners] = np.arange(len(corners))
    parents = np.repeat(number[:, None], 2, axis=1)
    for k, edge in enumerate(node_ends()[4:], start=4):
        parents[cells[:, k]] = number[cells[:, edge]]
    P = np.zeros((3 * solid.nodes, 3 * len(corners)))
    for node, ends in enumerate(parents):
        for end in ends:
            P[3 * node : 3 * node + 3, 3 * end : 3 * end + 3] += 0.5 * np.eye(3)
    kept = (np.random.default_rng(0).random((solid.nodes, 3)) > 0.2).astype(float)
    above = np.ascontiguousarray(kept[corners])
    graph = SparsityPattern(number[cells[:, :4]], len(corners))
    full, half = np.empty((2, len(graph.columns)))
    onto = kept, parents, graph.indptr, graph.indices, above
    _solver.galerkin(solid.sparsity.indptr, solid.sparsity.indices, solid.tangent.values(), *onto, full)
    _solver.galerkin(*solid.sparsity.upper, solid.tangent.half(), *onto, half)
    Pm = kept.reshape(-1, 1) * P * above.reshape(-1)
    fine = csr_of(solid, solid.tangent.values())
    for values, error in ((full, 1e-12), (half, 1e-6)):
        ours = sparse.csr_array((values, graph.columns, graph.rows)).toarray()
        np.testing.assert_allclose(ours, Pm.T @ (fine @ Pm), rtol=0, atol=error * np.abs(fine.data).max())


def test_multigrid_is_symmetric_and_bounded() -> None:
    """A V-cycle M of a symmetric A has x.My = Mx.y, and the spectrum of M A lies in (0, 1 + a little)."""
    solid = solid_of(here(), block_of(here(), Flat(L=1.0), 1.0, 0.35))
    solid.tangent.assemble()
    tangent = TangentOperator(solid, symmetric=True, single=False)
    tangent.hold(solid.fixed)
    tangent.update()
    A = tangent.matrix()
    cycle = PMultigrid(tangent)
    cycle.update()
    rng = np.random.default_rng(0)
    x, y, Mx, My, AMx = (solid.vector() for _ in range(5))
    for _ in range(5):
        x.array, y.array = tangent.free * rng.normal(size=(2, 3 * solid.owned))
        cycle.apply(None, x, Mx)
        cycle.apply(None, y, My)
        assert x.dot(My) == pytest.approx(y.dot(Mx), rel=1e-4, abs=1e-5 * np.sqrt(x.dot(Mx) * y.dot(My)))
        A.mult(Mx, AMx)
        assert 0.0 < Mx.dot(AMx) <= 1.05 * x.dot(Mx)


def test_multigrid_iterations_do_not_grow_with_the_mesh() -> None:
    counts = []
    for size in (0.35, 0.175):
        solid = solid_of(here(), block_of(here(), Flat(L=1.0), 1.0, size))
        solid.tangent.assemble()
        r, y = solid.vector(), solid.vector()
        r.array = np.random.default_rng(0).normal(size=3 * solid.owned)
        counts.append(LinearSolver(solid, "cg", rtol=1e-8).solve(r, solid.fixed, np.empty(0), y, 1e-8)[0])
    assert counts[1] <= 1.25 * counts[0] + 1
    assert counts[1] < 40


# --- orders of convergence ------------------------------------------------------------------------------------


def projection_errors(block: BlockMesh, material: Material) -> tuple[float, float]:
    """Errors of displacement and of its gradient, in L2, for a smooth solution with rollers and a clamped base.

    The load is that of the exact stress, in weak form, so the solution is known on a curved block too. It is below
    yield.
    """
    import ufl
    from dolfinx import fem

    solid = solid_of(here(), block, material=material)
    x = ufl.SpatialCoordinate(solid.mesh)
    sx, sy, cx, cy = ufl.sin(ufl.pi * x[0]), ufl.sin(ufl.pi * x[1]), ufl.cos(ufl.pi * x[0]), ufl.cos(ufl.pi * x[1])
    f = ufl.sin(1.5 * x[2])
    exact = 0.02 * ufl.as_vector([sx * cy * f, -0.7 * cx * sy * f, (0.5 + cx * cy) * f * ufl.exp(0.3 * x[2])])
    lam, mu = ELASTIC.lame
    strain = ufl.sym(ufl.grad(exact))
    stress = lam * ufl.tr(strain) * ufl.Identity(3) + 2 * mu * strain
    dx = ufl.Measure("dx", solid.mesh, metadata={"quadrature_degree": 6})
    load = fem.assemble_vector(fem.form(ufl.inner(stress, ufl.sym(ufl.grad(ufl.TestFunction(solid.V)))) * dx))
    solid.internal_force()
    solid.tangent.assemble()
    r, y = solid.vector(), solid.vector()
    r.array = load.array
    r.array[solid.fixed] = 0.0
    assert LinearSolver(solid, "cg", rtol=1e-12).solve(r, solid.fixed, np.empty(0), y, 1e-12)[1]
    solid.set_displacement(y.array_r)
    unbalanced = solid.internal_force().ravel() - load.array[: 3 * solid.owned]
    unbalanced[solid.fixed] = 0.0
    assert solid.kernels.plastic_points == 0 and np.abs(unbalanced).max() < 1e-9
    e = solid.u - exact

    def norm(form: Any) -> float:
        return float(np.sqrt(fem.assemble_scalar(fem.form(form * dx))))

    return norm(ufl.inner(e, e)), norm(ufl.inner(ufl.grad(e), ufl.grad(e)))


@pytest.mark.parametrize(
    ("surface", "material"),
    [(Flat(L=1.0), Material(1.0, NU, 0.8)), (Sinusoid(L=1.0, amplitude=0.1, dims=2), ELASTIC)],
    ids=["plane, below yield", "curved, elastic"],
)
def test_displacement_converges_with_order_three_and_strain_with_two(surface: Surface, material: Material) -> None:
    coarse, fine = (np.array(projection_errors(cubes(n, surface), material)) for n in (4, 8))
    assert np.all(np.log2(coarse / fine) > np.array([3.0, 2.0]) - 0.1)


# --- pressures from nodal forces ------------------------------------------------------------------------------


@pytest.mark.mpi
def test_near_null_space_is_orthonormal_and_rigid(coarse: BlockMesh | None) -> None:
    solid = solid_of(world(), coarse)
    A = matrix_of(solid)
    set_rigid_modes(A, solid.points)
    basis = A.getNearNullSpace().getVecs()
    assert len(basis) == 6
    gram = np.array([[a.dot(b) for b in basis] for a in basis])
    np.testing.assert_allclose(gram, np.eye(6), atol=1e-12)
    scale, y = A.norm(), A.createVecLeft()
    for v in basis:
        A.mult(v, y)
        assert y.norm() < 1e-13 * scale


#: Ghosts on more ranks than the tests run on, where a rank may hold nodes that it shares with some of the others only.
GHOSTS = """
import numpy as np
from asperity.runtime import compat
compat.start()
from asperity.fem.ghosts import Ghosts
from dolfinx.fem import functionspace
from dolfinx.mesh import create_unit_cube
from mpi4py import MPI

for n in (2, 3, 4):
    V = functionspace(create_unit_cube(MPI.COMM_WORLD, n, n, n), ("Lagrange", 2, (3,)))
    points, owned = V.tabulate_dof_coordinates(), V.dofmap.index_map.size_local
    found = Ghosts(V.dofmap.index_map).scatter_forward(points[:owned].copy())
    assert np.allclose(found, points, rtol=0, atol=1e-14)
"""


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="there is no mpirun")
def test_ghosts_have_the_numbers_of_their_owners_on_four_ranks() -> None:
    command = [*MPIRUN, "4", sys.executable, "-c", GHOSTS]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
