"""Finite strain: closed forms in Hencky strain, objectivity, twin kernels, tangent, Newton's order, whole solver."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import here
from j2_path import confined_stress, uniaxial_stress
from scipy.sparse.linalg import spsolve
from scipy.spatial.transform import Rotation
from ufl_twin import UflTwin

from asperity import reference as ref
from asperity.contact.contact_surface import ContactSurface
from asperity.errors import InputError
from asperity.fem.solid import Solid
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import distribute
from asperity.mesh.generate import build_block
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT, Schedule
from asperity.model.material import Material
from asperity.model.settings import Formulation
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.make import make_contact_solver
from asperity.quasistatic.stepping import Record, follow
from asperity.runtime.parallel import on_root
from asperity.surface import Flat, Sinusoid, Surface

Array = npt.NDArray[np.float64]

E, NU, Y, E_T = 1.0, 0.3, 0.005, 0.05
ELASTIC = Material(E, NU, kinematics="finite")
PLASTIC = Material(E, NU, Y, E_T, kinematics="finite")
MIXED = replace(PLASTIC, hardening=0.4)
EACH = pytest.mark.parametrize("material", [ELASTIC, PLASTIC, MIXED], ids=["elastic", "isotropic", "mixed"])
METHODS = pytest.mark.parametrize("method", ["active-set", "penalty", "nitsche"])
PAIRS = [[0, 3, 4], [3, 1, 5], [4, 5, 2]]  # of the components (xx, yy, zz, xy, xz, yz)
SQUEEZED = np.log([0.9, 0.7, 0.5])


@pytest.fixture(scope="module")
def cube() -> BlockMesh:
    return build_block(Flat(L=1.0), 1.0, lambda x, y, depth: 1.0)


def solid_of(block: BlockMesh | None, material: Material) -> Solid:
    return Solid(*distribute(here(), block, 1.0), material)


def pair_of(block: BlockMesh | None, material: Material) -> tuple[Solid, Solid]:
    """Two solids, the second one with the UFL twin of the element kernels."""
    ours, twin = solid_of(block, material), solid_of(block, material)
    twin.kernels = UflTwin(twin)  # type: ignore[assignment]
    return ours, twin


def force_of(solid: Solid, u: Array) -> Array:
    b = np.zeros((solid.nodes, 3))
    solid.kernels.add_internal_force(u, b)
    return b


def tangent_of(solid: Solid, u: Array) -> Any:
    from scipy import sparse

    graph, n = solid.sparsity, 3 * solid.nodes
    values = np.empty(len(graph.columns))
    solid.kernels.tangent(u, values)
    return sparse.csr_array((values, graph.columns, graph.rows), shape=(n, n))


def affine(solid: Solid, F: npt.ArrayLike) -> Array:
    return solid.points @ (np.asarray(F) - np.eye(3)).T


def follow_gradients(solid: Solid, gradients: list[Array]) -> tuple[Array, Array]:
    """Cauchy's stress (m, 3, 3) and accumulated plastic strain (m,) along uniform deformations, each a step."""
    stress, accumulated = [], []
    for F in gradients:
        u = affine(solid, F)
        force_of(solid, u)
        points = solid.kernels.stress(u).reshape(-1, 6)
        np.testing.assert_allclose(points, np.broadcast_to(points[0], points.shape), rtol=0, atol=1e-12)
        stress.append(points[0][PAIRS])
        solid.kernels.commit()
        accumulated.append(np.max(solid.kernels.history().accumulated, initial=0.0))
    return np.array(stress), np.array(accumulated)


def difference(a: Any, b: Any) -> float:
    """Largest difference relative to the largest magnitude."""
    return float(np.max(np.abs(np.asarray(a) - np.asarray(b))) / np.max(np.abs(np.asarray(b))))


# --- closed forms -----------------------------------------------------------------------------------------------


@EACH
def test_confined_compression(cube: BlockMesh, material: Material) -> None:
    """The Kirchhoff stress over the logarithmic strain is the curve of small strain."""
    strength = material.yield_strength or np.inf
    tangent, share = material.tangent_modulus, material.kinematic_share
    axial, lateral, accumulated = confined_stress(SQUEEZED, E, NU, strength, tangent, share)
    stress, alpha = follow_gradients(solid_of(cube, material), [np.diag([1, 1, np.exp(e)]) for e in SQUEEZED])
    expected = [np.diag([b, b, a]) / np.exp(e) for a, b, e in zip(axial, lateral, SQUEEZED, strict=True)]
    np.testing.assert_allclose(stress, expected, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(alpha, accumulated, rtol=1e-10, atol=1e-14)


@EACH
def test_uniaxial_compression_and_back(cube: BlockMesh, material: Material) -> None:
    strains = np.concatenate([SQUEEZED, [-0.5, 0.0, 0.3]])
    strength = material.yield_strength or np.inf
    tangent, share = material.tangent_modulus, material.kinematic_share
    expected, accumulated = uniaxial_stress(strains, E, strength, tangent, share)
    lateral = -NU * expected / E - 0.5 * (strains - expected / E)
    stress, alpha = follow_gradients(
        solid_of(cube, material), [np.diag(np.exp([b, b, a])) for a, b in zip(strains, lateral, strict=True)]
    )
    only_axial = np.zeros_like(stress)
    only_axial[:, 2, 2] = expected / np.exp(strains + 2.0 * lateral)
    np.testing.assert_allclose(stress, only_axial, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(alpha, accumulated, rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("gamma", [1e-8, 0.1, 1.0, 3.0])
def test_simple_shear(cube: BlockMesh, gamma: float) -> None:
    """Principal logarithmic stretches are +-asinh(gamma/2), along axes at the angle t with cot 2t = gamma/2."""
    F = np.eye(3)
    F[0, 1] = gamma
    stress, _ = follow_gradients(solid_of(cube, ELASTIC), [F])
    mu = E / (2.0 * (1.0 + NU))
    root = np.sqrt(1.0 + 0.25 * gamma**2)
    shear, normal = 2.0 * mu * np.arcsinh(0.5 * gamma) / root * np.array([1.0, 0.5 * gamma])
    expected = np.array([[normal, shear, 0.0], [shear, -normal, 0.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(stress[0], expected, rtol=0, atol=1e-12 * shear)


# --- general states ---------------------------------------------------------------------------------------------

TURN = Rotation.from_rotvec([0.6, -1.1, 0.4]).as_matrix()


def states(solid: Solid) -> dict[str, tuple[list[Array], Array]]:
    """Displacements committed before, and one over them, on a curved mesh."""
    rng = np.random.default_rng(5)
    x = solid.points

    def noise(scale: float) -> Array:
        return scale * rng.normal(size=x.shape)

    squeeze = x @ np.diag([0.1, -0.05, -0.2]) + 0.1 * x[:, [1]] * x + noise(1e-4)
    turned = (x + squeeze) @ TURN.T - x
    return {
        "small": ([], 1e-6 * squeeze),
        "squeezed": ([0.1 * squeeze], squeeze),
        "unloading": ([squeeze], 0.97 * squeeze),
        "turned": ([0.5 * squeeze], turned),
    }


NAMES = ("small", "squeezed", "unloading", "turned")


def bring(solid: Solid, name: str) -> Array:
    before, u = states(solid)[name]
    for earlier in before:
        force_of(solid, earlier)
        solid.kernels.commit()
    force_of(solid, u)
    return u


@pytest.mark.parametrize("name", NAMES)
@EACH
def test_tangent_is_the_derivative_of_the_force(coarse: BlockMesh, material: Material, name: str) -> None:
    solid = solid_of(coarse, material)
    u = bring(solid, name)
    assert solid.kernels.inverted_points == 0
    K = tangent_of(solid, u)
    assert difference(K.data, K.T.tocsr().sorted_indices().data) < 1e-12
    du = np.random.default_rng(6).normal(size=u.shape) * min(1e-2, np.abs(u).max())
    step = 1e-6
    slope = (force_of(solid, u + step * du) - force_of(solid, u - step * du)) / (2 * step)
    assert difference(K @ du.ravel(), slope.ravel()) < 1e-6


@pytest.mark.parametrize("name", NAMES)
@EACH
def test_compiled_and_ufl_kernels_agree(coarse: BlockMesh, material: Material, name: str) -> None:
    a, b = pair_of(coarse, material)
    u = bring(a, name)
    np.testing.assert_array_equal(bring(b, name), u)
    one, two = a.kernels, b.kernels
    assert one.plastic_points == two.plastic_points and one.inverted_points == two.inverted_points == 0
    assert difference(force_of(a, u), force_of(b, u)) < 1e-10
    assert difference(tangent_of(a, u).data, tangent_of(b, u).data) < 1e-10
    assert difference(one.stress(u), two.stress(u)) < 1e-10
    assert difference(one.conjugate_stress(u), two.conjugate_stress(u)) < 1e-10


@pytest.mark.parametrize("apart", [0.0, 1e-15, 1e-8, 1e-5, 1e-3, 0.009, 0.011, 0.03, 0.1])
def test_equal_and_nearly_equal_eigenvalues(cube: BlockMesh, apart: float) -> None:
    """The compiled kernel takes limits, the integral of the UFL one knows no eigenvalues."""
    F = TURN @ np.diag([0.9, 0.9 * (1.0 + apart), 0.9 * (1.0 - 0.3 * apart)])
    a, b = pair_of(cube, ELASTIC)
    u = affine(a, F)
    assert difference(force_of(a, u), force_of(b, u)) < 1e-12
    assert difference(tangent_of(a, u).data, tangent_of(b, u).data) < 1e-11


@pytest.mark.parametrize("size", [1e-4, 0.0299, 0.0301, 0.359, 0.361])
@pytest.mark.parametrize("shape", [(-1.0, 0.6, 0.2), (-1.0, 0.0, 0.0)], ids=["sheared", "compressed"])
def test_all_forms_of_the_compiled_kernel_agree_with_the_twin(
    cube: BlockMesh, size: float, shape: tuple[float, float, float]
) -> None:
    """The kernel has a form up to 0.03, one up to 0.36 and one for any norm of C - 1; the twin has one."""
    direction = TURN @ np.diag(shape) @ TURN.T
    direction *= size / np.linalg.norm(direction)
    values, vectors = np.linalg.eigh(np.eye(3) + direction)
    F = vectors @ np.diag(np.sqrt(values)) @ vectors.T  # a rotation would leave rounding errors in C - 1
    a, b = pair_of(cube, MIXED)
    u = affine(a, F)
    assert np.linalg.norm(F.T @ F - np.eye(3)) == pytest.approx(size)
    assert difference(force_of(a, u), force_of(b, u)) < 1e-13
    assert difference(tangent_of(a, u).data, tangent_of(b, u).data) < 1e-12


@EACH
def test_objectivity(coarse: BlockMesh, material: Material) -> None:
    """A specimen that is turned on the way has the turned forces and stresses, and the same history and energy."""
    plain, turned = (solid_of(coarse, material) for _ in range(2))
    before, u = states(plain)["squeezed"]
    x = plain.points
    for step in (*before, u):
        forces = force_of(plain, step)
        # turned between the steps too, by other angles
        R = TURN if step is u else TURN.T @ TURN.T
        v = (x + step) @ R.T - x
        found = force_of(turned, v)
        assert difference(found, forces @ R.T) < 1e-10
        stress, of_turned = (s.kernels.stress(w)[..., PAIRS] for s, w in ((plain, step), (turned, v)))
        assert difference(of_turned, np.einsum("ik,cqkl,jl->cqij", R, stress, R)) < 1e-10
        for solid in (plain, turned):
            solid.kernels.commit()
        one, two = plain.kernels.history().arrays(), turned.kernels.history().arrays()
        for name, values in one.items():
            np.testing.assert_allclose(two[name], values, rtol=0, atol=1e-12)


@EACH
def test_small_displacements_are_those_of_small_strain(coarse: BlockMesh, material: Material) -> None:
    """The difference is of the order of the displacement gradient, down to rounding."""
    finite, small = (solid_of(coarse, m) for m in (material, replace(material, kinematics="small")))
    _, u = states(finite)["squeezed"]
    gaps = [difference(force_of(finite, s * u), force_of(small, s * u)) for s in (1e-3, 1e-5, 1e-8)]
    assert gaps[0] < 5e-3
    assert gaps[1] < 1.5e-2 * gaps[0]
    assert gaps[2] < 1e-7


def test_a_solid_turned_inside_out_is_counted(cube: BlockMesh) -> None:
    for solid in pair_of(cube, PLASTIC):
        force = force_of(solid, affine(solid, np.diag([1.0, 1.0, -0.1])))
        assert solid.kernels.inverted_points == solid.kernels.volumes.size
        assert np.isfinite(force).all()


@EACH
def test_newtons_method_is_of_second_order(cube: BlockMesh, material: Material) -> None:
    """A cube upset by a tenth in one step from the affine displacement, its sides free."""
    solid = solid_of(cube, material)
    x, u = solid.points, affine(solid, np.diag([1.0, 1.0, 0.9]))
    ends = (x[:, 2] < 1e-9) | (x[:, 2] > 1.0 - 1e-9)
    free = np.flatnonzero(~np.repeat(ends, 3))
    norms = []
    for _ in range(12):
        residual = force_of(solid, u).ravel()[free]
        norms.append(float(np.linalg.norm(residual)))
        if norms[-1] < 1e-14:
            break
        step = np.zeros(u.size)
        step[free] = spsolve(tangent_of(solid, u)[free][:, free].tocsc(), -residual)
        u = u + step.reshape(u.shape)
    ratios = [after / before**2 for before, after in pairwise(norms) if 1e-13 < after and before < 1e-3]
    assert norms[-1] < 1e-13 and len(ratios) >= 1
    assert max(ratios) < 1e3


# --- the contact solver -----------------------------------------------------------------------------------------


def press_of(
    surface: Surface, block: BlockMesh | None, material: Material, method: str, **options: Any
) -> ContactSolver:
    from mpi4py import MPI

    return make_contact_solver(MPI.COMM_WORLD, surface, block, material, formulation=Formulation(method), **options)


@pytest.mark.mpi
@pytest.mark.parametrize("method", ["active-set", "nitsche"])
@EACH
def test_flat_block_pressed_to_half_its_height(material: Material, method: str) -> None:
    """Force on the nominal area -T/stretch, T of small strain at the logarithmic strain; balances kept, and back."""
    from mpi4py import MPI

    surface = Flat(L=1.0)
    block = on_root(MPI.COMM_WORLD, lambda: build_block(surface, 1.0, lambda x, y, depth: 0.6))
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


@pytest.mark.parametrize(
    ("material", "method"),
    [(ELASTIC, "penalty"), (PLASTIC, "active-set"), (MIXED, "nitsche")],
    ids=["elastic", "isotropic", "mixed"],
)
def test_rough_contact(rough: Surface, coarse: BlockMesh | None, material: Material, method: str) -> None:
    """Loading and unloading; all balances hold, and the force is that of small strain within some per cent."""
    forces = []
    for kinematics in ("finite", "small"):
        solver = press_of(rough, coarse, replace(material, kinematics=kinematics), method)
        record = Record(1.0, 1.0, 1.0)
        integrator = MIDPOINT if material.plastic else BACKWARD_EULER
        follow(solver, Schedule(0.03, steps=4, unload_steps=3, integrator=integrator), record)
        assert solver.checks.violated == {}
        if not material.plastic:
            assert solver.checks.energy_excess == 0.0
        forces.append(record.curve().force[:4])
    assert 1e-3 < abs(forces[0][-1] / forces[1][-1] - 1.0) < 0.08
    assert solver.force == 0.0


def test_gentle_slopes_are_those_of_small_strain() -> None:
    """Slopes of 0.001 make no difference."""
    flatter = Sinusoid(L=1.0, amplitude=0.00015, dims=2)
    block = build_block(flatter, 1.0, lambda x, y, depth: 0.25)
    forces = []
    for kinematics in ("finite", "small"):
        solver = press_of(flatter, block, Material(E, NU, Y, E_T, kinematics=kinematics), "active-set")
        for delta in (5e-5, 1e-4, 1.5e-4):
            assert solver.step(delta).converged
        forces.append(solver.force)
    assert forces[0] == pytest.approx(forces[1], rel=5e-4)


@METHODS
def test_a_step_too_large_is_rolled_back_and_cut(rough: Surface, coarse: BlockMesh | None, method: str) -> None:
    """A solve that begins inside out fails before it touches anything, and half the step goes on from there."""
    solver = press_of(rough, coarse, PLASTIC, method)
    assert solver.step(0.002).converged
    u, force = solver.solid.u.x.array.copy(), solver.force
    history = solver.solid.kernels.history().copy()
    bad = 5.0 * np.random.default_rng(7).normal(size=(solver.solid.owned, 3))
    stats = solver.newton.solve(bad, 1.0)
    assert not stats.converged and stats.reason == "diverged_function_domain"
    solver.roll_back()
    np.testing.assert_array_equal(solver.solid.u.x.array, u)
    assert solver.force == force
    for name, values in solver.solid.kernels.history().arrays().items():
        np.testing.assert_array_equal(values, history.arrays()[name])
    assert solver.step(0.004).converged


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
        solid = solid_of(coarse, material)
        solid.u.x.array[:] = affine(solid, F).ravel()
        np.testing.assert_allclose(ContactSurface(solid).area_ratio(), expected, rtol=1e-12)


def test_refusals() -> None:
    with pytest.raises(InputError, match=r"material\.kinematics = 'large'"):
        Material(E, NU, kinematics="large")
