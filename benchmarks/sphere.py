# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Axisymmetric solution of the flattened sphere with hardening: the table in `asperity.reference`.

    ./run python3 benchmarks/sphere.py

A hemisphere on a sliding base under a rigid flat, as in the case "flattened-sphere" of `asperity verify`, but in the
plane: second-order triangles on a quarter of a disk, the return map in UFL, exact contact at the nodes, systems by LU.
It shares the material law with the program, which closed forms verify, and neither mesh, elements, contact nor solver.
Prints the force over that at the onset of yield on two meshes and in two numbers of steps, and the limit of both.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from newton import step_length, without

from asperity.arrays import Floats
from asperity.model.material import Material, return_map_ufl
from asperity.verification.flattening import HERTZ, NU, ONSET, E, Y

DEPTHS = np.array([6.0, 10.0, 50.0, 100.0])  # approach over that at the onset of yield
TANGENTS = (0.0, 0.1, 0.3, 0.5)  # E_t/E
STEPS = 40  # uniform in the square root of the approach


def quarter_disk(refinement: float) -> Any:
    """Mesh of 0 <= r, z with r^2 + z^2 <= 1, fine at the pole (0, 1)."""
    import gmsh
    from mpi4py import MPI

    try:
        from dolfinx.io import gmsh as gmshio
    except ImportError:
        from dolfinx.io import gmshio

    def size(x: float, y: float) -> float:
        return min(max(0.003, 0.1 * float(np.hypot(x, y - 1.0))), 0.2) / refinement

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    for option in ("General.Terminal", "Mesh.MeshSizeExtendFromBoundary", "Mesh.MeshSizeFromPoints"):
        gmsh.option.setNumber(option, 0)
    occ = gmsh.model.occ
    occ.intersect([(2, occ.addDisk(0, 0, 0, 1, 1))], [(2, occ.addRectangle(0, 0, 0, 2, 2))])
    occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [gmsh.model.getEntities(2)[0][1]])
    gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: size(x, y))
    gmsh.model.mesh.generate(2)
    gmsh.model.mesh.setOrder(2)
    mesh = gmshio.model_to_mesh(gmsh.model, MPI.COMM_SELF, 0, gdim=2)[0]
    gmsh.finalize()
    return mesh


class Hemisphere:
    """Second-order triangles in the plane of r and z; R = E = 1."""

    def __init__(self, material: Material, refinement: float) -> None:
        import basix.ufl
        import ufl
        from dolfinx import fem
        from dolfinx.fem import petsc
        from petsc4py import PETSc

        mesh = quarter_disk(refinement)
        V = fem.functionspace(mesh, ("Lagrange", 2, (2,)))
        self.u, v = fem.Function(V), ufl.TestFunction(V)
        r = ufl.SpatialCoordinate(mesh)[0]

        def strain(w: Any) -> Any:
            shear = 0.5 * (w[0].dx(1) + w[1].dx(0))
            return ufl.as_tensor([[w[0].dx(0), shear, 0], [shear, w[1].dx(1), 0], [0, 0, w[0] / r]])

        element = basix.ufl.quadrature_element("triangle", value_shape=(5,), degree=2)
        self.history = h = fem.Function(fem.functionspace(mesh, element))
        plastic_strain = ufl.as_tensor([[h[0], h[3], 0], [h[3], h[1], 0], [0, 0, h[2]]])
        stress, flow, alpha = return_map_ufl(strain(self.u), plastic_strain, h[4], **material.law[1])
        work = 2 * np.pi * ufl.inner(stress, strain(v)) * r * ufl.dx(metadata={"quadrature_degree": 2})
        self._force, self._tangent = fem.form(work), fem.form(ufl.derivative(work, self.u))
        flowed = ufl.as_vector([flow[0, 0], flow[1, 1], flow[2, 2], flow[0, 1], alpha])
        self._flowed = fem.Expression(flowed, element.custom_quadrature()[0])
        self._cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
        points = V.tabulate_dof_coordinates()[:, :2]
        self.dofs = points.size
        self._fixed = np.flatnonzero(np.abs(points.ravel()) < 1e-12).astype(np.int32)
        self._top = np.flatnonzero((np.abs(np.hypot(*points.T) - 1.0) < 1e-9) & (points[:, 0] < 0.5))
        self._height = points[self._top, 1]
        self._A = petsc.create_matrix(self._tangent)
        self._ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        self._ksp.setType("preonly")
        self._ksp.getPC().setType("lu")
        self._ksp.getPC().setFactorSolverType("mumps")

    def press(self, approach: float) -> float:
        """Force of the flat at a approach; the history is committed."""
        from dolfinx.fem import petsc

        u, A = self.u.x.array.reshape(-1, 2), self._A
        y, b = A.createVecRight(), A.createVecRight()
        for iteration in range(100):
            force, lacking, rows = self._contact(approach)
            residual = self._free(force, rows)
            held = force[rows]
            if np.linalg.norm(residual) < 1e-8 * np.linalg.norm(held) and np.all(np.abs(lacking) < 1e-12):
                self.history.x.array[:] = np.ravel(self._flowed.eval(self.u.function_space.mesh, self._cells))
                return -float(held.sum())
            A.zeroEntries()
            petsc.assemble_matrix(A, self._tangent)
            A.assemble()
            b.array = residual
            y.set(0.0)
            y.array[rows] = lacking
            prescribed = np.concatenate([self._fixed, rows]).astype(np.int32)
            A.zeroRowsColumns(prescribed, diag=1.0, x=y, b=b)
            exact = y.array[prescribed]
            self._ksp.setOperators(A)
            self._ksp.solve(b, y)
            y.array[prescribed] = exact
            length = self._length(y.array_r, residual, rows, approach)
            if iteration > 20 and iteration % 3 == 0:
                length *= 0.5  # leaves a cycle of contact sets
            u -= length * y.array.reshape(-1, 2)
        raise RuntimeError(f"no convergence at {approach / ONSET:g} times the onset of yield")

    def _contact(self, approach: float) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
        """Internal force, penetration of the nodes in contact, and their vertical dofs."""
        from dolfinx import fem

        force = fem.assemble_vector(self._force).array.copy()
        lacking = self._height + self.u.x.array[2 * self._top + 1] - 1.0 + approach
        active = 0.1 * lacking - force[2 * self._top + 1] > 0.0
        return force, lacking[active], 2 * self._top[active] + 1

    def _free(self, force: Floats, rows: npt.NDArray[np.int64]) -> Floats:
        return without(force, rows, self._fixed)

    def _length(self, y: Floats, residual: Floats, rows: npt.NDArray[np.int64], approach: float) -> float:
        step, start = self._free(y, rows), self.u.x.array.copy()

        def slope(length: float) -> float:
            self.u.x.array[:] = start - length * y
            force, _, now = self._contact(approach)
            return -float(step @ self._free(force, now))

        length = step_length(-float(step @ residual), slope)
        self.u.x.array[:] = start
        return length


def forces(tangent: float, steps: int, refinement: float) -> Floats:
    """Force over that at the onset of yield, at DEPTHS."""
    sphere = Hemisphere(Material(1.0, NU, Y / E, tangent), refinement)
    way = np.unique(np.concatenate([DEPTHS, DEPTHS[-1] * np.linspace(0.0, 1.0, steps + 1)[1:] ** 2]))
    found = {float(w): sphere.press(w * ONSET) for w in way}
    return np.array([found[float(w)] for w in DEPTHS]) / float(HERTZ.force(ONSET))


def main() -> None:
    """Print the table."""
    print("| E_t/E | mesh | steps | " + " | ".join(f"w = {w:g}" for w in DEPTHS) + " |\n|" + "---|" * (3 + len(DEPTHS)))
    for tangent in TANGENTS:
        found = {}
        for steps, refinement in ((STEPS, 1.0), (2 * STEPS, 1.0), (2 * STEPS, 1.5)):
            found[steps, refinement] = values = forces(tangent, steps, refinement)
            cells = " | ".join(f"{value:.2f}" for value in values)
            print(f"| {tangent:g} | {refinement:g} | {steps} | {cells} |", flush=True)
        limit = found[2 * STEPS, 1.5] + found[2 * STEPS, 1.0] - found[STEPS, 1.0]
        print(f"| {tangent:g} | finer | limit | " + " | ".join(f"{value:.2f}" for value in limit) + " |", flush=True)


if __name__ == "__main__":
    main()
