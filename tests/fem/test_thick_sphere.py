"""An elastic-plastic hollow sphere under internal pressure against Hill, Plasticity (1950), V.2."""

from __future__ import annotations

import gmsh
import numpy as np
import pytest
from conftest import here

from asperity.fem.solid import Solid
from asperity.linear.solver import LinearSolver
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import distribute
from asperity.mesh.generate import nodes_and_elements
from asperity.model.material import Material

A, B, C = 0.5, 1.0, 0.75  # radii of the faces and of the plastic zone
E, NU, Y = 1.0, 0.3, 0.002


def eighth(size: float) -> BlockMesh:
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        balls = [gmsh.model.occ.addSphere(0, 0, 0, r, angle1=0, angle2=np.pi / 2, angle3=np.pi / 2) for r in (B, A)]
        gmsh.model.occ.cut([(3, balls[0])], [(3, balls[1])])
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(3)
        return BlockMesh(*nodes_and_elements(), B, B)
    finally:
        gmsh.finalize()


def inflated(size: float) -> np.ndarray:
    """Mean radial displacements of both faces (2,) and rms error of the radial stress over Y, under Hill's pressure."""
    import ufl
    from dolfinx import fem

    solid = Solid(*distribute(here(), eighth(size), 1.0), Material(E, NU, Y))
    x = solid.points[: solid.owned]
    solid.fixed = np.flatnonzero(np.abs(x.ravel()) < 1e-12).astype(np.int32)  # planes of symmetry
    at = ufl.SpatialCoordinate(solid.mesh)
    inner = ufl.conditional(ufl.lt(ufl.dot(at, at), (0.5 * (A + B)) ** 2), 1.0, 0.0)
    power = -inner * ufl.inner(ufl.FacetNormal(solid.mesh), ufl.TestFunction(solid.V)) * ufl.ds
    pressure = 2.0 * Y * (np.log(C / A) + (1.0 - (C / B) ** 3) / 3.0)
    load = pressure * fem.assemble_vector(fem.form(power)).array
    r, step = solid.vector(), solid.vector()
    for part in (0.25, 0.5, 0.75, 1.0):  # each point keeps the direction of its stress, so steps cause no error
        for _ in range(20):
            r.array = part * load - solid.internal_force().ravel()
            r.array[solid.fixed] = 0.0
            if np.linalg.norm(r.array) < 1e-9 * np.linalg.norm(load):
                break
            solid.tangent.assemble()
            assert LinearSolver(solid, "lu").solve(r, solid.fixed, np.empty(0), step, 1e-10)[1]
            solid.u.x.array[:] += step.array
        else:
            pytest.fail("no equilibrium")
        solid.kernels.commit()
    u, radius = solid.u.x.array.reshape(-1, 3), np.linalg.norm(solid.points, axis=1)
    outwards = np.einsum("ni,ni->n", u, solid.points) / radius
    return np.array([outwards[np.abs(radius - face) < 1e-9].mean() for face in (A, B)])


def test_displacements_are_those_of_hill() -> None:
    """In the plastic zone the dilatation is elastic; outside of it Lamé's solution with yield at its edge."""
    ideal = np.array([
        Y / E * ((1 - NU) * C**3 / A**2 - 2 / 3 * (1 - 2 * NU) * (1 - (C / B) ** 3 + 3 * np.log(C / A)) * A),
        2 / 3 * Y / E * C**3 / B**2 * (1 - 2 * NU + 0.5 * (1 + NU)),
    ])  # fmt: skip
    coarse, fine = (np.abs(inflated(size) / ideal - 1.0) for size in (0.2, 0.12))
    assert np.all(fine < 0.01) and np.all(fine < coarse), (coarse, fine)
