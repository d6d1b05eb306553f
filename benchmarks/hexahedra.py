# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Rough contact on structured hexahedra, for comparison with the program's tetrahedra (elements.py).

Eight nodes with full integration (Q1), with the volumetric part at one point (Q1 SRI, for J2 the same as B-bar on
parallelepipeds: Hughes, The Finite Element Method, 1987, chapter 4), and 27 nodes (Q2) on curved geometry. Exact
contact at the nodes by an active set; systems by Cholesky or by conjugate gradients with algebraic multigrid.
L = E = 1, block of height 1 between rollers, one process.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from newton import step_length, without

from asperity.arrays import Floats
from asperity.linear.petsc_matrix import set_rigid_modes
from asperity.linear.petsc_options import GAMG, set_defaults
from asperity.mesh.size_field import SizeField
from asperity.model.material import Material, return_map_ufl
from asperity.surface import Surface

Lines = tuple[Floats, Floats, Floats]

LU_DOFS = 6000
RTOL, KRYLOV_RTOL, NEWTON_MAX = 1e-8, 1e-3, 40


@dataclass(frozen=True)
class Element:
    """A hexahedron: degree of displacement and geometry, quadrature degrees of shape and volume change."""

    degree: int
    shear: int
    volume: int


HEXAHEDRA = {"Q1": Element(1, 2, 2), "Q1 SRI": Element(1, 2, 1), "Q2": Element(2, 4, 4)}


def divide(length: float, size: Callable[[Any], Any]) -> Floats:
    """Points from 0 to `length` whose distances follow a size."""
    t = np.linspace(0.0, length, 2001)
    density = 1.0 / size(t)
    number = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(t))])
    return np.interp(np.linspace(0.0, number[-1], int(np.ceil(number[-1])) + 1), number, t)


def lines(surface: Surface, delta: float, h: float, growth: float) -> Lines:
    """Corners of the elements along x, y and z, the height of the block being one."""
    field = SizeField.of(surface, delta, h, growth=growth)
    t = np.linspace(0.0, 1.0, 129)
    on_top = np.array([[field.at(x, y, 0.0) for x in t] for y in t])
    x, y = (divide(1.0, partial(np.interp, xp=t, fp=on_top.min(axis=axis))) for axis in (0, 1))
    finest = max(0.5 * h, float(on_top.min()))
    depths = divide(1.0, lambda s: np.minimum(finest + growth * s, 0.25))
    return x, y, 1.0 - depths[::-1]


def hexahedral_mesh(corners: Lines, surface: Surface, degree: int) -> Any:
    """Mesh of hexahedra between lines, moved onto the surface as `mesh.build_block` does, edges and faces curved."""
    import basix.ufl
    import ufl
    from dolfinx import mesh as dmesh
    from mpi4py import MPI

    axes = []
    for line in corners:
        parts = [a + (b - a) * np.arange(degree) / degree for a, b in pairwise(line)]
        axes.append(np.append(np.concatenate(parts), line[-1]))
    x, y, z = (g.ravel() for g in np.meshgrid(*axes, indexing="ij"))
    points = np.stack([x, y, z * (1.0 + surface.height(x, y) - surface.mean())], axis=1)
    element = basix.ufl.element("Lagrange", "hexahedron", degree, shape=(3,))
    offsets = np.rint(element.basix_element.points * degree).astype(int)
    first = degree * np.stack([g.ravel() for g in np.indices([len(c) - 1 for c in corners])], axis=1)
    shape = tuple(len(axis) for axis in axes)
    cells = np.ravel_multi_index(tuple(np.moveaxis(first[:, None] + offsets, -1, 0)), shape)
    return dmesh.create_mesh(MPI.COMM_SELF, cells=cells.astype(np.int64), x=points, e=ufl.Mesh(element))


class Hexahedra:
    """A block of hexahedra between rollers under a flat: exact contact at the nodes of the top."""

    def __init__(self, surface: Surface, material: Material, element: Element, corners: Lines) -> None:
        import ufl
        from dolfinx import fem
        from dolfinx.fem import petsc

        self.surface = surface
        mesh = hexahedral_mesh(corners, surface, element.degree)
        V = fem.functionspace(mesh, ("Lagrange", element.degree, (3,)))
        self.u, v = fem.Function(V), ufl.TestFunction(V)
        points = V.tabulate_dof_coordinates()
        self.dofs = points.size
        held = np.abs(points) < 1e-9
        held[:, :2] |= np.abs(points[:, :2] - 1.0) < 1e-9
        held[held[:, 2]] = True
        self.fixed = np.flatnonzero(held).astype(np.int32)
        top = 1.0 + self.surface.height(*points[:, :2].T) - self.surface.mean()
        self.top = np.flatnonzero(np.abs(points[:, 2] - top) < 1e-9)
        self.height = points[self.top, 2]

        self.plastic = material.plastic
        lam, mu = material.lame
        dx = partial(ufl.Measure, "dx", mesh)
        strain = ufl.sym(ufl.grad(self.u))
        stress = 2.0 * mu * ufl.dev(strain)
        if self.plastic:
            stress = ufl.dev(self._yielding(mesh, element.shear, strain, material))
        shape = ufl.inner(stress, ufl.sym(ufl.grad(v))) * dx(metadata={"quadrature_degree": element.shear})
        volume = (lam + 2.0 / 3.0 * mu) * ufl.div(self.u) * ufl.div(v)
        # in one form FFCx 0.9 would take the Jacobian of the one quadrature for the other
        parts = (shape, volume * dx(metadata={"quadrature_degree": element.volume}))
        self._forces = [fem.form(part) for part in parts]
        self._tangents = [fem.form(ufl.derivative(part, self.u)) for part in parts]
        self.A = petsc.create_matrix(self._tangents[0])
        self.A.setOption(self.A.Option.SPD, True)
        self._assemble()
        self._elastic = self.A.copy()
        self._solver(points)

    def _yielding(self, mesh: Any, degree: int, strain: Any, material: Material) -> Any:
        """Stress by the return map, and what its history needs."""
        import basix.ufl
        import ufl
        from dolfinx import fem

        element = basix.ufl.quadrature_element("hexahedron", value_shape=(7,), degree=degree)
        self.history = h = fem.Function(fem.functionspace(mesh, element))
        plastic_strain = ufl.as_matrix([[h[0], h[3], h[4]], [h[3], h[1], h[5]], [h[4], h[5], h[2]]])
        stress, flow, alpha = return_map_ufl(strain, plastic_strain, h[6], **material.law[1])
        flowed = ufl.as_vector([*(flow[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))), alpha])
        self._flowed = fem.Expression(flowed, element.custom_quadrature()[0], mesh.comm)
        self._cells = np.arange(mesh.topology.index_map(3).size_local, dtype=np.int32)
        return stress

    def _assemble(self) -> None:
        from dolfinx.fem import petsc

        self.A.zeroEntries()
        for part in self._tangents:
            petsc.assemble_matrix(self.A, part)
        self.A.assemble()

    def _solver(self, points: Floats) -> None:
        from petsc4py import PETSc

        self.ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        self.ksp.setOptionsPrefix("elements_")
        pc = self.ksp.getPC()
        if self.dofs < LU_DOFS:
            self.ksp.setType("preonly")
            pc.setType("cholesky")
            pc.setFactorSolverType("mumps")
        else:
            set_defaults("elements_", GAMG)
            self.ksp.setType("cg")
            self.ksp.setNormType(PETSc.KSP.NormType.NATURAL)
            pc.setType("gamg")
            set_rigid_modes(self.A, points)
        self.ksp.setTolerances(rtol=KRYLOV_RTOL, max_it=500)
        self.ksp.setOperators(self.A)
        self.ksp.setFromOptions()

    def internal_force(self) -> Floats:
        """At the nodes (nodes, 3)."""
        from dolfinx import fem

        force = sum(fem.assemble_vector(part).array for part in self._forces)
        return np.asarray(force).reshape(-1, 3)

    def press(self, approaches: Floats) -> Floats:
        """Force of the flat at each approach."""
        summit = 1.0 + self.surface.maximum()[2] - self.surface.mean()
        before, forces = 0.0, []
        for delta in approaches:
            forces.append(self._solve(summit - delta, delta - before))
            before = delta
            if self.plastic:
                self.history.x.array[:] = self._flowed.eval(self.u.function_space.mesh, self._cells).ravel()
        return np.array(forces)

    def _solve(self, z: float, move: float) -> float:
        """Newton's method on the active set, as in `contact.ActiveSet` and `solve.NewtonSolver`."""
        u = self.u.x.array.reshape(-1, 3)
        y, b = self.A.createVecRight(), self.A.createVecRight()
        for _ in range(NEWTON_MAX):
            force, lacking, rows = self._contact(z)
            residual, held = self._free(force, rows), force[rows]
            balanced = np.linalg.norm(residual) <= RTOL * np.linalg.norm(held)
            if balanced and np.all(np.abs(lacking) <= RTOL * move):
                return -float(held.sum())
            if self.plastic:
                self._assemble()
            else:
                self._elastic.copy(self.A)
            b.array = residual
            y.set(0.0)
            y.array[rows] = lacking
            prescribed = np.concatenate([self.fixed, rows]).astype(np.int32)
            self.A.zeroRowsColumns(prescribed, diag=self.A.getDiagonal().sum() / self.dofs, x=y, b=b)
            exact = y.array[prescribed]
            self.ksp.solve(b, y)
            if self.ksp.getConvergedReason() < 0:
                raise RuntimeError(f"the linear solver failed: {self.ksp.getConvergedReason()}")
            y.array[prescribed] = exact
            u -= (self._length(y.array_r, residual, rows, z) if self.plastic else 1.0) * y.array.reshape(-1, 3)
        raise RuntimeError(f"no convergence in {NEWTON_MAX} Newton steps")

    def _contact(self, z: float) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
        """Internal force, penetration of the nodes in contact with a flat at height z, and their vertical dofs."""
        force = self.internal_force().ravel()
        rows = 3 * self.top + 2
        lacking = self.height + self.u.x.array[rows] - z
        active = 0.1 * lacking - force[rows] > 0.0
        return force, lacking[active], rows[active]

    def _free(self, force: Floats, rows: npt.NDArray[np.int64]) -> Floats:
        return without(force, rows, self.fixed)

    def _length(self, y: Floats, residual: Floats, rows: npt.NDArray[np.int64], z: float) -> float:
        step, start = self._free(y, rows), self.u.x.array.copy()

        def slope(length: float) -> float:
            self.u.x.array[:] = start - length * y
            force, _, now = self._contact(z)
            return -float(step @ self._free(force, now))

        length = step_length(-float(step @ residual), slope)
        self.u.x.array[:] = start
        return length
