"""Finite strain: closed forms in Hencky strain, objectivity, twin kernels, whole solver."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import world
from element_sample import PAIRS, Sample, difference, sample
from j2_path import confined_stress, uniaxial_stress
from scipy.spatial.transform import Rotation

from asperity import reference as ref
from asperity.contact.contact_surface import ContactSurface
from asperity.fem.solid import Solid
from asperity.mesh.block import BlockMesh
from asperity.mesh.generate import build_block
from asperity.model.load_path import BACKWARD_EULER, Schedule
from asperity.model.material import Material
from asperity.model.settings import Formulation
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.make import make_contact_solver
from asperity.quasistatic.stepping import Record, follow
from asperity.runtime.parallel import on_root
from asperity.surface import Flat, Surface

Array = npt.NDArray[np.float64]

E, NU, Y, E_T = 1.0, 0.3, 0.005, 0.05
ELASTIC = Material(E, NU, kinematics="finite")
PLASTIC = Material(E, NU, Y, E_T, kinematics="finite")
MIXED = replace(PLASTIC, hardening=0.4)
EACH = pytest.mark.parametrize("material", [ELASTIC, PLASTIC, MIXED], ids=["elastic", "isotropic", "mixed"])
SQUEEZED = np.log([0.9, 0.7, 0.5])


def twins(block: BlockMesh | None, material: Material) -> tuple[Sample, Sample]:
    """The compiled kernels, and their UFL twin."""
    return sample(block, material), sample(block, material, forms=True)


# --- closed forms -----------------------------------------------------------------------------------------------


@EACH
def test_uniaxial_compression_and_back(cube: BlockMesh, material: Material) -> None:
    strains = np.concatenate([SQUEEZED, [-0.5, 0.0, 0.3]])
    strength = material.yield_strength or np.inf
    tangent, share = material.tangent_modulus, material.kinematic_share
    expected, accumulated = uniaxial_stress(strains, E, strength, tangent, share)
    lateral = -NU * expected / E - 0.5 * (strains - expected / E)
    stress, alpha = sample(cube, material).follow(
        np.diag(np.expm1([b, b, a])) for a, b in zip(strains, lateral, strict=True)
    )
    only_axial = np.zeros_like(stress)
    only_axial[:, 2, 2] = expected / np.exp(strains + 2.0 * lateral)
    np.testing.assert_allclose(stress, only_axial, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(alpha, accumulated, rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("gamma", [1e-8, 0.1, 1.0, 3.0])
def test_simple_shear(cube: BlockMesh, gamma: float) -> None:
    """Principal logarithmic stretches are +-asinh(gamma/2), along axes at the angle t with cot 2t = gamma/2."""
    gradient = np.zeros((3, 3))
    gradient[0, 1] = gamma
    stress, _ = sample(cube, ELASTIC).follow([gradient])
    mu = E / (2.0 * (1.0 + NU))
    root = np.sqrt(1.0 + 0.25 * gamma**2)
    shear, normal = 2.0 * mu * np.arcsinh(0.5 * gamma) / root * np.array([1.0, 0.5 * gamma])
    expected = np.array([[normal, shear, 0.0], [shear, -normal, 0.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(stress[0], expected, rtol=0, atol=1e-12 * shear)


# --- general states ---------------------------------------------------------------------------------------------

TURN = Rotation.from_rotvec([0.6, -1.1, 0.4]).as_matrix()
SHEARED = np.array([[0.0, 1.0, 0.5], [1.0, 0.0, -0.7], [0.5, -0.7, 0.0]])


def squeezed(solid: Solid) -> Array:
    """A displacement far beyond yield on a curved mesh."""
    x = solid.points
    return x @ np.diag([0.1, -0.05, -0.2]) + 0.1 * x[:, [1]] * x + 1e-4 * np.random.default_rng(5).normal(size=x.shape)


@pytest.mark.parametrize("apart", [0.0, 1e-8, 0.3])
def test_equal_and_nearly_equal_stretches(cube: BlockMesh, apart: float) -> None:
    F = TURN @ np.diag([0.84, 0.84 * (1.0 + apart), 0.84 * (1.0 - 0.3 * apart)])
    assert np.linalg.norm(F.T @ F - np.eye(3)) > 0.37
    a, b = twins(cube, MIXED)
    u, before = a.affine(F - np.eye(3)), a.affine(0.05 * SHEARED)  # whose plastic strain has other axes
    assert difference(a.bring([before], u), b.bring([before], u)) < 1e-12
    assert difference(a.tangent(u).data, b.tangent(u).data) < 1e-11


@pytest.mark.parametrize("size", [1e-4, 0.0299, 0.0301, 0.359, 0.361])
@pytest.mark.parametrize("shape", [(-1.0, 0.6, 0.2), (-1.0, 0.0, 0.0)], ids=["sheared", "compressed"])
def test_all_forms_of_the_compiled_kernel_agree_with_the_twin(
    cube: BlockMesh, size: float, shape: tuple[float, float, float]
) -> None:
    """The kernel has a form up to 0.03, one up to 0.36 and one beyond; the twin has one."""
    direction = TURN @ np.diag(shape) @ TURN.T
    direction *= size / np.linalg.norm(direction)
    values, vectors = np.linalg.eigh(np.eye(3) + direction)
    F = vectors @ np.diag(np.sqrt(values)) @ vectors.T  # a rotation would leave rounding errors in C - 1
    a, b = twins(cube, MIXED)
    u = a.affine(F - np.eye(3))
    assert np.linalg.norm(F.T @ F - np.eye(3)) == pytest.approx(size)
    assert difference(a.force(u), b.force(u)) < 1e-13
    assert difference(a.tangent(u).data, b.tangent(u).data) < 1e-12


@EACH
def test_objectivity(coarse: BlockMesh, material: Material) -> None:
    """A specimen that is turned on the way has the turned forces and stresses, and the same history."""
    plain, turned = sample(coarse, material), sample(coarse, material)
    x, u = plain.solid.points, squeezed(plain.solid)
    for step in (0.1 * u, u):
        R = TURN if step is u else TURN.T @ TURN.T  # between the steps too, by other angles
        v = (x + step) @ R.T - x
        assert difference(turned.force(v), plain.force(step) @ R.T) < 1e-10
        stress, of_turned = (s.kernels.stress(w)[..., PAIRS] for s, w in ((plain, step), (turned, v)))
        assert difference(of_turned, np.einsum("ik,cqkl,jl->cqij", R, stress, R)) < 1e-10
        for it in (plain, turned):
            it.kernels.commit()
        for name, values in plain.kernels.history().arrays().items():
            np.testing.assert_allclose(turned.kernels.history().arrays()[name], values, rtol=0, atol=1e-12)


@EACH
def test_small_displacements_are_those_of_small_strain(coarse: BlockMesh, material: Material) -> None:
    """The difference is of the order of the displacement gradient, down to rounding."""
    finite, small = (sample(coarse, m) for m in (material, replace(material, kinematics="small")))
    u = squeezed(finite.solid)
    gaps = [difference(finite.force(s * u), small.force(s * u)) for s in (1e-3, 1e-5, 1e-8)]
    assert gaps[0] < 5e-3 and gaps[1] < 1.5e-2 * gaps[0] and gaps[2] < 1e-7


def test_a_solid_turned_inside_out_is_counted(cube: BlockMesh) -> None:
    for it in twins(cube, PLASTIC):
        assert np.isfinite(it.force(it.affine(np.diag([0.0, 0.0, -1.1])))).all()
        assert it.kernels.inverted_points == it.kernels.volumes.size


# --- the contact solver -----------------------------------------------------------------------------------------


def press_of(
    surface: Surface, block: BlockMesh | None, material: Material, method: str, **options: Any
) -> ContactSolver:
    return make_contact_solver(world(), surface, block, material, formulation=Formulation(method), **options)


@pytest.mark.mpi
@pytest.mark.parametrize("method", ["active-set", "nitsche"])
@EACH
def test_flat_block_pressed_to_half_its_height(material: Material, method: str) -> None:
    """Force on the nominal area -T/stretch, T of small strain at the logarithmic strain; balances kept, and back."""
    surface = Flat(L=1.0)
    block = on_root(world(), lambda: build_block(surface, 1.0, lambda x, y, depth: 0.6))
    solver = press_of(surface, block, material, method)
    path = np.array([0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.49])
    strength = material.yield_strength or np.inf
    stress = confined_stress(np.log(1.0 - path), E, NU, strength, material.tangent_modulus, material.kinematic_share)[0]
    for delta, sigma in zip(path, stress, strict=True):
        assert solver.step(float(delta)).converged
        assert solver.force == pytest.approx(-sigma / (1.0 - delta), rel=1e-8)
    assert solver.checks.violated == {} and solver.checks.energy_excess == 0.0
    area = solver.contact_surface.area_of(*solver.contact.touched())
    assert area.value == pytest.approx(1.0, rel=1e-12)


def test_a_flat_driven_through_a_block_in_one_step_is_cut(cube: BlockMesh) -> None:
    """The first guesses turn the block inside out: steps are halved until the path is followed."""
    solver = press_of(Flat(L=1.0), cube, ELASTIC, "active-set")
    record = Record(1.0, 1.0, 1.0)
    follow(solver, Schedule(0.8, steps=1, integrator=BACKWARD_EULER), record)
    curve = record.curve()
    assert curve.delta[-1] == 0.8 and np.isfinite(curve.force).all()
    assert solver.force == pytest.approx(-ref.block_modulus(E, NU) * np.log(0.2) / 0.2, rel=1e-8)
    assert solver.checks.violated == {}


def test_areas_are_those_of_the_deformed_top(rough: Surface, coarse: BlockMesh) -> None:
    F = np.array([[1.1, 0.2, 0.0], [-0.1, 0.9, 0.0], [0.3, -0.2, 0.8]])
    for material, expected in ((ELASTIC, 1.1 * 0.9 + 0.1 * 0.2), (Material(E, NU), 1.0)):
        it = sample(coarse, material)
        it.solid.u.x.array[:] = it.affine(F - np.eye(3)).ravel()
        surface = ContactSurface(it.solid)
        np.testing.assert_allclose(surface.area_ratio(), expected, rtol=1e-12)
        thirds = np.repeat(surface.area[:, None] / 3.0, 3, axis=1)
        whole = surface.area_of(np.ones(thirds.shape, dtype=bool), thirds)
        assert (whole.value, whole.error) == (pytest.approx(expected * surface.area.sum()), 0.0)
        pressure = surface.pressure(surface.bearing_area())[np.unique(surface.nodes[:, :3])]
        np.testing.assert_allclose(pressure, 1.0 / expected, rtol=1e-12)


@pytest.mark.parametrize("method", ["active-set", "nitsche"])
def test_a_step_too_large_is_rolled_back_and_cut(rough: Surface, coarse: BlockMesh | None, method: str) -> None:
    """A solve that begins inside out fails before it touches anything, and the path goes on from there."""
    solver = press_of(rough, coarse, PLASTIC, method)
    assert solver.step(0.002).converged
    u, force = solver.solid.u.x.array.copy(), solver.force
    history = solver.solid.kernels.history().copy()
    bad = 5.0 * np.random.default_rng(7).normal(size=(solver.solid.owned, 3))
    stats = solver.newton.solve(bad, 1.0)
    assert not stats.converged and stats.newton == 0 and stats.reason.startswith("diverged_f")
    solver.roll_back()
    np.testing.assert_array_equal(solver.solid.u.x.array, u)
    assert solver.force == force
    for name, values in solver.solid.kernels.history().arrays().items():
        np.testing.assert_array_equal(values, history.arrays()[name])
    assert solver.step(0.004).converged
