"""Stiffness against six motions of the flat: discs in closed form, a shifted spot, ranks, kernels, formulations."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ELASTIC, here, world

from asperity.adaptive.solve_contact import solve_contact
from asperity.errors import InputError
from asperity.mesh.block import BlockMesh
from asperity.model.material import Material
from asperity.model.settings import Formulation, MeshSize, SolverOptions
from asperity.quasistatic.make import make_contact_solver
from asperity.quasistatic.stiffness_matrix import StiffnessMatrix, stiffness_matrix
from asperity.surface import Flat, Sphere, Surface

NU = 0.3
G = 0.5 / (1.0 + NU)


def of_spot(centre: tuple[float, float]) -> tuple[StiffnessMatrix, float]:
    """Matrix of a paraboloid on a small spot, and the radius of the spot after Hertz."""
    cap = Sphere(L=1.0, radius=10.0, shape="paraboloid", centre=centre)
    size = MeshSize(0.005, growth=0.5, h_max=0.4)
    result = solve_contact(cap, ELASTIC, delta_max=4e-5, steps=1, size=size, comm=here())
    found = stiffness_matrix(result.solver)
    assert found is not None
    return found, float((7.5 * result.curve.force[-1] * (1.0 - NU**2)) ** (1.0 / 3.0))


def test_a_paraboloid() -> None:
    """Bonded discs; the block is felt by 2.5 a/L = 5 % except in torsion. Tilt: without friction, which is softer."""
    found, a = of_spot((0.5, 0.5))
    assert found.interface is not None
    k = found.interface
    disc = [8 * G * a / (2 - NU)] * 2 + [4 * G * a * np.log(3 - 4 * NU) / (1 - 2 * NU)]
    disc += [8 * G * a**3 / (3 * (1 - NU))] * 2 + [16 * G * a**3 / 3]
    ratio = k.diagonal() / disc
    assert np.all((ratio > 1.0) & (ratio < 1.09))
    assert ratio[5] < 1.03
    np.testing.assert_allclose(ratio[[1, 4]], ratio[[0, 3]], rtol=0.03)
    scale = np.sqrt(np.outer(found.whole.diagonal(), found.whole.diagonal()))
    np.testing.assert_allclose(found.whole / scale, found.whole.T / scale, atol=1e-7)
    assert np.linalg.eigvalsh(found.whole)[0] > 0.0


def test_a_spot_beside_the_middle() -> None:
    """The same spot elsewhere is a change of the point, K' = T^T K T, to the mesh and what the sides add."""
    (middle, _), (beside, _) = of_spot((0.5, 0.5)), of_spot((0.6, 0.45))
    assert middle.interface is not None and beside.interface is not None
    shift = np.array([0.1, -0.05, 0.0])  # a motion about the point moves the spot by rotation x shift
    T = np.eye(6)
    for j, axis in enumerate(np.eye(3)):
        T[:3, 3 + j] = np.cross(axis, shift)
    expected = T.T @ middle.interface @ T
    scale = np.sqrt(expected.diagonal())
    np.testing.assert_allclose(beside.interface / np.outer(scale, scale), expected / np.outer(scale, scale), atol=0.04)


def test_a_bar_of_full_contact_has_no_interface() -> None:
    """Uniform strain for nu = 0; between clamped ends shear and bending follow Timoshenko only roughly."""
    flat = solve_contact(
        Flat(L=1.0), Material(1.0, 0.0), height=4.0, delta_max=1e-6, steps=1, size=MeshSize(0.5, h_max=0.5), comm=here()
    )
    found = stiffness_matrix(flat.solver)
    assert found is not None and found.interface is None
    k = found.whole.diagonal()
    assert k[2] == pytest.approx(0.25, rel=1e-6)
    bending, shear = 12.0 / 12.0 / 4.0**3, 5.0 / 6.0 * 0.5 / 4.0
    assert k[0] == pytest.approx(1.0 / (1.0 / bending + 1.0 / shear), rel=0.03)
    assert found.whole[0, 4] == pytest.approx(-2.0 * k[0], rel=0.01)  # guided ends: the moment is k h/2
    assert k[5] == pytest.approx(0.1406 * 0.5 / 4.0, rel=0.06)  # Saint-Venant's torsion, warping held at both ends


@pytest.mark.parametrize("method", ["active-set", "penalty", "nitsche"])
def test_ranks_agree(rough: Surface, coarse: BlockMesh | None, method: str) -> None:
    """On an elastic-plastic surface, all formulations; the normal stiffness exceeds that of a contact that slides."""
    found = []
    for comm, linear in ((here(), "lu"), (world(), "cg")):
        block = world().bcast(coarse) if comm.size == 1 else coarse
        material = Material(1.0, NU, 0.005, 0.05)
        solver = make_contact_solver(
            comm, rough, block, material, formulation=Formulation(method), options=SolverOptions(linear=linear),
        )  # fmt: skip
        for delta in (0.01, 0.02):
            assert solver.step(delta).converged
        matrix = stiffness_matrix(solver)
        assert matrix is not None
        found.append(matrix.whole)
        before = solver.force
        assert solver.step(0.021).converged and solver.force > before
    scale = np.sqrt(np.outer(found[0].diagonal(), found[0].diagonal()))
    np.testing.assert_allclose(found[1] / scale, found[0] / scale, atol=2e-4)


def test_periodic_sides_are_refused() -> None:
    """A rotation jumps across the seam; translations alone are in the columns of the curve."""
    size = MeshSize(0.3, h_max=0.3)
    flat = solve_contact(Flat(L=1.0), ELASTIC, sides="periodic", delta_max=1e-4, steps=1, size=size, comm=world())
    with pytest.raises(InputError, match=r'rotation of the flat is not periodic; use block\.sides = "free" or'):
        stiffness_matrix(flat.solver)


def test_units_and_no_contact(rough: Surface, coarse: BlockMesh | None) -> None:
    solver = make_contact_solver(world(), rough, coarse, ELASTIC)
    assert stiffness_matrix(solver) is None
    assert solver.step(0.02).converged
    one = stiffness_matrix(solver)
    assert one is not None
    scaled = one.scaled(E=2e11, side=1e-6)
    assert scaled.whole[2, 2] == pytest.approx(2e5 * one.whole[2, 2])
    assert scaled.whole[0, 4] == pytest.approx(0.2 * one.whole[0, 4])
    assert scaled.whole[5, 5] == pytest.approx(2e-7 * one.whole[5, 5])
    assert scaled.point[2] == pytest.approx(1e-6 * one.point[2])
