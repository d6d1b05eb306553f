"""Elements with the mean volumetric strain of each cell: forms of UFL, differences, a spot as small as an element."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from element_sample import Sample, difference, sample

import asperity as asp
from asperity.arrays import Flags
from asperity.errors import InputError
from asperity.fem.kernels import FLOWED
from asperity.mesh.block import BlockMesh
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField
from asperity.model.material import Material
from asperity.model.settings import MEAN, POINT
from asperity.surface import Flat, Surface

Array = npt.NDArray[np.float64]

E, NU, Y = 1.0, 0.3, 0.005
ELASTIC, STEEL = Material(E, NU), Material(E, NU, Y, 0.05)
STRETCHED = Material(E, NU, Y, 0.05, kinematics="finite")
PARTLY = 2e-4  # scale of a random displacement that makes a part of the cells flow


def noise(it: Sample, scale: float, seed: int = 0) -> Array:
    return scale * np.random.default_rng(seed).normal(size=(it.solid.nodes, 3))


def flowed(it: Sample, u: Array) -> Flags:
    """Bring a solid to a displacement and commit it; whether a cell has flowed (cells,)."""
    it.bring([u], u)
    limit = FLOWED * Y / E
    return np.asarray(np.any(it.kernels.history().accumulated > limit, axis=1))


def test_force_is_that_of_projected_forms(coarse: BlockMesh) -> None:
    """The mean over a cell is the projection on constants, as a form of UFL computes it."""
    import ufl
    from dolfinx import fem

    ours, usual = (sample(coarse, STEEL, mean=mean) for mean in (True, False))
    before = PARTLY * noise(ours, 1.0)
    cells = flowed(ours, before)
    assert 0.2 < np.mean(cells) < 0.8
    flowed(usual, before)
    u = fem.Function(ours.solid.V)
    u.x.array[:] = noise(ours, 1e-3, seed=1).ravel()
    dx = ufl.Measure("dx", domain=ours.solid.mesh, metadata={"quadrature_degree": 2})
    constants = fem.functionspace(ours.solid.mesh, ("DG", 0))
    one, mean, taken = ufl.TestFunction(constants), fem.Function(constants), fem.Function(constants)
    sums, volumes = (fem.assemble_vector(fem.form(f * one * dx)).array for f in (ufl.div(u), 1.0 + 0.0 * ufl.div(u)))
    mean.x.array[:], taken.x.array[:] = sums / volumes, cells
    lam, mu = STEEL.lame
    v = ufl.TestFunction(ours.solid.V)
    form = taken * (lam + 2.0 / 3.0 * mu) * (mean - ufl.div(u)) * ufl.div(v) * dx
    expected = fem.assemble_vector(fem.form(form)).array.reshape(-1, 3)
    nodal = u.x.array.reshape(-1, 3)
    assert difference(ours.force(nodal) - usual.force(nodal), expected) < 1e-11


@pytest.mark.parametrize("material", [STEEL, STRETCHED], ids=["small", "finite"])
def test_tangent_is_the_derivative_of_the_force(coarse: BlockMesh, material: Material) -> None:
    it = sample(coarse, material, mean=True)
    cells = flowed(it, PARTLY * noise(it, 1.0))
    assert 0.2 < np.mean(cells) < 0.8
    for scale in (1e-5, 1e-3):  # some cells that have flowed unload elastically in the first state
        u = PARTLY * noise(it, 1.0) + noise(it, scale, seed=1)
        it.force(u)
        K = it.tangent(u)
        assert difference(K.data, K.T.tocsr().sorted_indices().data) < 1e-12
        du, step = noise(it, scale, seed=2), 1e-4
        slope = (it.force(u + step * du) - it.force(u - step * du)) / (2.0 * step)
        assert difference(K @ du.ravel(), slope.ravel()) < 1e-5


def test_stiffness_of_small_vibration_is_that_of_unloading(coarse: BlockMesh) -> None:
    it = sample(coarse, STEEL, mean=True)
    u = noise(it, 1e-2)
    assert np.all(flowed(it, u))
    back = 0.999 * u
    it.force(back)
    assert it.kernels.plastic_points == 0
    held = np.empty(it.solid.sparsity.size)
    it.kernels.elastic_tangent(back, held)
    assert difference(held, it.tangent(back).data) < 1e-14
    usual = sample(coarse, STEEL, mean=False)
    usual.force(back)
    pointwise = np.empty_like(held)
    usual.kernels.elastic_tangent(back, pointwise)
    assert difference(held, pointwise) > 0.01


@pytest.mark.parametrize("material", [STEEL, STRETCHED], ids=["small", "finite"])
def test_only_the_volumetric_strain_is_that_of_the_cell(coarse: BlockMesh, material: Material) -> None:
    """Logarithmic in finite strain, whose conjugate stress is therefore the one to look at."""
    mean, point = (sample(coarse, material, mean=m) for m in (True, False))
    cells, _ = (flowed(it, PARTLY * noise(it, 1.0)) for it in (mean, point))
    u = noise(point, 1e-3, seed=1)
    ours, usual = (it.kernels.conjugate_stress(u) for it in (mean, point))
    assert difference(ours[~cells], usual[~cells]) < 1e-12
    ours, usual, volumes = ours[cells], usual[cells], point.kernels.volumes[cells]
    pressure, own = (stress[..., :3].mean(axis=-1) for stress in (ours, usual))
    assert np.ptp(pressure, axis=1).max() < 1e-12 * np.abs(pressure).max()
    assert difference(pressure[:, 0], (own * volumes).sum(axis=1) / volumes.sum(axis=1)) < 1e-10
    for stress, p in ((ours, pressure), (usual, own)):
        stress[..., :3] -= p[..., None]
    assert difference(ours, usual) < 1e-10


SPHERE = Surface.from_spec("sphere", L=1.0, radius=1.0)


def even(h: float, growth: float = 0.25) -> BlockMesh:
    """Block with elements of the same size all over the contact at an approach of 0.003."""
    x = np.linspace(-0.5, 0.5, 257)
    away = np.maximum(np.hypot(x, x[:, None]) - np.sqrt(0.006), 0.0)
    return build_block(SPHERE, 1.0, SizeField(np.array([h]), away[:, :, None], (0.0, 0.0, 1.0), growth, 0.25).at)


def test_a_spot_as_small_as_an_element_does_not_lock() -> None:
    """A sphere pressed in far beyond yield: the limit is that of the usual elements on much finer meshes."""
    material = Material(E, NU, 0.002)

    def pressed(h: float, dilatation: str, growth: float = 0.25) -> float:
        block = even(h, growth)
        result = asp.solve_contact(SPHERE, material, delta_max=0.003, steps=3, block=block, dilatation=dilatation)
        return float(result.curve.P_star[-1])

    limit = pressed(0.028, POINT, growth=0.125)
    locked, free = (pressed(0.06, dilatation) / limit - 1.0 for dilatation in (POINT, MEAN))
    assert locked > 0.04
    assert abs(free) < 0.3 * locked


def test_energy_that_becomes_free_is_no_violation() -> None:
    """Many small steps, whose energy bounds are narrow."""
    steps: dict[str, Any] = {"delta_max": 0.003, "steps": 40, "unload_steps": 5, "integrator": "backward-euler"}
    result = asp.solve_contact(SPHERE, Material(E, NU, 0.002), block=even(0.06), dilatation=MEAN, **steps)
    assert result.complete and not result.checks.violated and result.checks.energy_excess < 1e-8


def test_means_need_no_traction_of_points() -> None:
    flat = Flat(L=1.0)
    with pytest.raises(InputError, match=r'solver\.dilatation = "cell" is not one of point, mean'):
        asp.Problem.of(flat, ELASTIC, delta_max=0.01, dilatation="cell")
    with pytest.raises(InputError, match=r'solver\.dilatation = "mean" cannot go with contact\.method = "nitsche"'):
        asp.Problem.of(flat, ELASTIC, delta_max=0.01, formulation=asp.Formulation("nitsche"), dilatation=MEAN)
