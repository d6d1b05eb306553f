"""Tools for solids other than the block: mesh of a sphere, planes of symmetry, quadrature over cells, dead loads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from asperity.arrays import Floats
from asperity.contact import Contact
from asperity.errors import ConvergenceError
from asperity.fem.solid import Solid
from asperity.mesh import element
from asperity.mesh.block import BlockMesh
from asperity.mesh.generate import nodes_and_elements
from asperity.model.settings import SolverOptions
from asperity.quasistatic.newton import NewtonSolver
from asperity.runtime import compat


def eighth_sphere(outer: float, inner: float, size: Callable[[float, float, float], float]) -> BlockMesh:
    """Second-order mesh of the part of a sphere or shell with x, y, z >= 0.

    `mesh.distribute` tags its curved faces as the top and its plane faces as sides and base. The inner radius is 0 for
    a solid sphere; `size` gives the element size at (x, y, z) [length].
    """
    compat.require("gmsh", "python3-gmsh")
    import gmsh

    quarter = 0.5 * np.pi
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for option in ("General.Terminal", "Mesh.MeshSizeExtendFromBoundary", "Mesh.MeshSizeFromPoints"):
            gmsh.option.setNumber(option, 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        occ = gmsh.model.occ
        ball = occ.addSphere(0, 0, 0, outer, angle1=0, angle2=quarter, angle3=quarter)
        if inner > 0.0:
            occ.cut([(3, ball)], [(3, occ.addSphere(0, 0, 0, inner, angle1=0, angle2=quarter, angle3=quarter))])
        occ.synchronize()
        gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: size(x, y, z))
        gmsh.model.mesh.generate(3)
        points, tets = nodes_and_elements()
    finally:
        gmsh.finalize()
    return BlockMesh(points, tets, outer, outer)


def planes_of_symmetry(solid: Solid) -> npt.NDArray[np.int32]:
    """Local numbers of the dofs fixed by the planes of symmetry x = 0, y = 0 and z = 0, (m,)."""
    x = solid.points[: solid.owned]
    return np.flatnonzero(np.abs(x.ravel()) < 1e-12).astype(np.int32)


class CellRule:
    """Quadrature over the curved cells of a solid.

    Attributes:
        points: (cells, q, 3) [length]
        weights: (cells, q) [length^3]
        shape: values of the shape functions (q, 10)
        gradients: of the shape functions (cells, q, 10, 3) [1/length]
    """

    def __init__(self, solid: Solid, degree: int) -> None:
        points, weights = element.quadrature(degree)
        self.shape, gradients = element.shape_functions(points), element.shape_gradients(points)
        x = solid.points[solid.cell_nodes]
        jacobian = np.einsum("qaj,cai->cqij", gradients, x)
        self.points = np.einsum("qa,cai->cqi", self.shape, x)
        self.weights = weights * np.abs(np.linalg.det(jacobian))
        self.gradients = np.einsum("qaj,cqji->cqai", gradients, np.linalg.inv(jacobian))


class Loaded:
    """A contact formulation with additional dead loads on the owned nodes (owned, 3) [force]."""

    def __init__(self, contact: Contact, load: Floats) -> None:
        self._contact, self._load = contact, load

    def __getattr__(self, name: str) -> Any:
        return getattr(self._contact, name)

    def residual(self, force: Floats) -> tuple[Floats, npt.NDArray[np.int32], Floats]:
        """See `contact.Contact`."""
        return self._contact.residual(force - self._load)

    def nodal_force(self, force: Floats) -> Floats:
        """See `contact.Contact`."""
        return self._contact.nodal_force(force - self._load)


def equilibrium(solid: Solid, contact: Contact, load: Floats, z: float, start: Floats, rtol: float = 1e-8) -> Floats:
    """Solve for the displacement (nodes, 3) under dead loads and a flat at height z, inf for none, and commit it.

    The load is on the owned nodes (owned, 3) [force], as the displacement to start from; rtol: see `SolverOptions`.

    Raises:
        ConvergenceError: Newton's method fails
    """
    contact.begin(z)
    stats = NewtonSolver(solid, cast(Contact, Loaded(contact, load)), SolverOptions(rtol=rtol)).solve(start, 1.0)
    if not stats.converged:
        raise ConvergenceError(f"no equilibrium under dead loads: {stats.reason}")
    solid.kernels.commit()
    return solid.u.x.array.reshape(-1, 3).copy()
