"""Material points: closed forms, rate equations, UFL forms as a twin, and tangents by differences."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from element_sample import Sample, difference, sample
from j2_path import confined_stress, j2_path, uniaxial_stress

from asperity.errors import InputError
from asperity.fem.solid import Solid
from asperity.mesh.block import BlockMesh
from asperity.mesh.generate import build_block
from asperity.model.material import Material
from asperity.surface import Flat

Array = npt.NDArray[np.float64]

E, NU, Y, E_T = 1.0, 0.3, 0.005, 0.05
STEEL = Material(E, NU, Y, E_T)
PERFECT = Material(E, NU, Y)
MOVING = Material(E, NU, Y, E_T, "kinematic")
MIXED = Material(E, NU, Y, E_T, 0.4)
LAWS = pytest.mark.parametrize(
    "material", [STEEL, PERFECT, MOVING, MIXED], ids=["isotropic", "perfect", "kinematic", "mixed"]
)
SHARES = pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
# A strain is a sum over ten nodes of u times gradients of some 4/h, a stress one of strains: 500 rounding units.
ROUNDING = 500 * float(np.finfo(float).eps)
TWINS = 40 * ROUNDING  # on curved cells of other sizes, some of them flat: the condition of their Jacobian on top


@pytest.fixture(scope="module")
def cube() -> BlockMesh:
    return build_block(Flat(L=1.0), 1.0, lambda x, y, depth: 1.0)


# --- parameters -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "key"),
    [
        ((0.0, 0.3), "E"),
        ((-1.0, 0.3), "E"),
        ((float("nan"), 0.3), "E"),
        ((1.0, 0.5), "nu"),
        ((1.0, -1.0), "nu"),
        ((1.0, 0.3, 0.0), "yield_strength"),
        ((1.0, 0.3, 0.1, 1.0), "tangent_modulus"),
        ((1.0, 0.3, 0.1, -0.1), "tangent_modulus"),
        ((1.0, 0.3, 0.1, 0.1, "kinetic"), "hardening"),
        ((1.0, 0.3, 0.1, 0.1, 1.5), "hardening"),
        ((1.0, 0.3, None, 0.0, "kinematic"), "hardening"),
    ],
)
def test_parameters_outside_their_range_are_refused(parameters: tuple[Any, ...], key: str) -> None:
    with pytest.raises(InputError, match=rf"material\.{key} = "):
        Material(*parameters)


def test_derived_moduli() -> None:
    lam, mu = STEEL.lame
    assert lam + 2 * mu == pytest.approx(E * (1 - NU) / ((1 + NU) * (1 - 2 * NU)), rel=1e-14)
    assert mu * (3 * lam + 2 * mu) / (lam + mu) == pytest.approx(E, rel=1e-14)
    assert STEEL.reduced_modulus == pytest.approx(E / (1 - NU**2), rel=1e-14)
    assert E * STEEL.plastic_modulus / (E + STEEL.plastic_modulus) == pytest.approx(E_T, rel=1e-14)
    assert STEEL.plastic and not Material(E, NU).plastic
    assert Material(200e9, NU, 1e9, 10e9).scaled(200e9) == STEEL
    assert Material(200e9, NU, 1e9, 10e9, "kinematic").scaled(200e9) == MOVING
    assert [m.kinematic_share for m in (STEEL, MIXED, MOVING)] == [0.0, 0.4, 1.0]


# --- closed forms ---------------------------------------------------------------------------------------------

PULL = np.linspace(0, 0.03, 8)[1:]
CYCLE = np.concatenate([PULL, [0.02, 0.0, -0.01, -0.03, -0.04, 0.0, 0.03, 0.05, 0.048, 0.05]])


@pytest.mark.parametrize("strain", [PULL, -PULL, CYCLE], ids=["tension", "compression", "cyclic"])
@pytest.mark.parametrize("E_t", [E_T, 0.0, 0.5])
@SHARES
def test_uniaxial_stress(cube: BlockMesh, strain: Array, E_t: float, share: float) -> None:
    expected, accumulated = uniaxial_stress(strain, E, Y, E_t, share)
    lateral = -NU * expected / E - 0.5 * (strain - expected / E)  # elastic, and plastic of constant volume
    stress, alpha = sample(cube, Material(E, NU, Y, E_t, share)).follow(
        np.diag([a, a, b]) for a, b in zip(lateral, strain, strict=True)
    )
    only_axial = np.zeros_like(stress)
    only_axial[:, 2, 2] = expected
    np.testing.assert_allclose(stress, only_axial, rtol=0, atol=1e-12 * Y)
    np.testing.assert_allclose(alpha, accumulated, rtol=0, atol=1e-12 * Y / E)


@pytest.mark.parametrize("strain", [-PULL, CYCLE], ids=["compression", "cyclic"])
@pytest.mark.parametrize("E_t", [E_T, 0.0])
@SHARES
def test_confined_compression(cube: BlockMesh, strain: Array, E_t: float, share: float) -> None:
    axial, lateral, accumulated = confined_stress(strain, E, NU, Y, E_t, share)
    stress, alpha = sample(cube, Material(E, NU, Y, E_t, share)).follow(np.diag([0, 0, e]) for e in strain)
    expected = np.array([np.diag([b, b, a]) for a, b in zip(axial, lateral, strict=True)])
    np.testing.assert_allclose(stress, expected, rtol=0, atol=1e-12 * Y)
    np.testing.assert_allclose(alpha, accumulated, rtol=0, atol=1e-12 * Y / E)


def test_pure_shear_yields_at_the_stress_of_mises(cube: BlockMesh) -> None:
    shear = np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0]])
    stress, alpha = sample(cube, PERFECT).follow(k * Y / E * shear for k in (0.5, 2.0, 5.0))
    mu = E / (2 * (1 + NU))
    np.testing.assert_allclose(stress[:, 0, 1], [2 * mu * 0.5 * Y, Y / 3**0.5, Y / 3**0.5], rtol=1e-13)
    assert alpha[0] == 0.0


def test_kinematic_hardening_keeps_the_elastic_range(cube: BlockMesh) -> None:
    """Beyond any flow the stress falls elastically by 2 sigma_y, the strain by twice that of yield (Bauschinger)."""
    turn, moved = 0.03, []
    for unloaded in (1.999, 2.001):
        strains = np.array([turn, turn - unloaded * Y / E])
        stress = uniaxial_stress(strains, E, Y, E_T, share=1.0)[0]
        lateral = -NU * stress / E - 0.5 * (strains - stress / E)
        _, alpha = sample(cube, MOVING).follow(np.diag([a, a, b]) for a, b in zip(lateral, strains, strict=True))
        moved.append(alpha[1] - alpha[0])
    assert moved[0] == 0.0 and moved[1] > 0.0


def test_elastic_stress_is_hookes(cube: BlockMesh) -> None:
    strain = np.random.default_rng(0).normal(size=(3, 3))
    strain += strain.T
    s = sample(cube, Material(E, NU))
    u = s.affine(strain)
    s.force(u)
    found = s.kernels.stress(u).reshape(-1, 6)
    expected = E / (1 + NU) * (strain + NU / (1 - 2 * NU) * np.trace(strain) * np.eye(3))
    assert difference(found, np.tile(expected[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]], (len(found), 1))) < ROUNDING
    assert s.kernels.history().rows == 0


@pytest.mark.parametrize(("E_t", "share"), [(E_T, 0.0), (E_T, 0.4), (E_T, 1.0), (0.0, 0.0)])
def test_a_turning_path_converges_to_the_rate_equations(cube: BlockMesh, E_t: float, share: float) -> None:
    """Backward Euler is of first order: half the error with half the steps, a quarter of it after extrapolation."""
    stretch, shear = np.diag([-0.3, -0.3, 1.0]), np.array([[0, 1, 0], [1, 0, 0.5], [0, 0.5, 0]])
    corners = np.array([0.012 * stretch, 0.012 * stretch + 0.01 * shear, -0.005 * stretch + 0.01 * shear])
    expected, accumulated = j2_path(corners, E, NU, Y, E_t, share=share)
    path = np.concatenate([[np.zeros((3, 3))], corners])

    def end(steps: int) -> Array:
        t = np.linspace(0, 3, 3 * steps + 1)[1:]
        which = np.minimum(t.astype(int), 2)
        strains = [path[i] + (s - i) * (path[i + 1] - path[i]) for i, s in zip(which, t, strict=True)]
        stress, alpha = sample(cube, Material(E, NU, Y, E_t, share)).follow(strains)
        return np.append(stress[-1].ravel() / Y, alpha[-1] * E / Y)

    exact = np.append(expected[-1].ravel() / Y, accumulated[-1] * E / Y)
    coarse, fine = end(20), end(40)
    error = np.linalg.norm(fine - exact)
    assert np.linalg.norm(coarse - exact) / error == pytest.approx(2.0, abs=0.1)
    assert np.linalg.norm(2 * fine - coarse - exact) < 0.1 * error


def test_unstrained_material_is_at_rest_and_stiff(cube: BlockMesh) -> None:
    """The flow direction s/|s| is 0/0 there."""
    plastic, elastic = sample(cube, STEEL), sample(cube, Material(E, NU))
    u = np.zeros((plastic.solid.nodes, 3))
    assert not plastic.force(u).any()
    elastic.force(u)
    assert difference(plastic.tangent(u).toarray(), elastic.tangent(u).toarray()) < ROUNDING


@LAWS
def test_stress_stays_on_or_inside_the_yield_surface(coarse: BlockMesh, material: Material) -> None:
    block = sample(coarse, material)
    rng = np.random.default_rng(1)
    u = np.zeros((block.solid.nodes, 3))
    for scale in (1e-3, 1e-2, 3e-3):
        u = u + scale * rng.normal(size=u.shape)
        block.force(u)
        stress = block.kernels.stress(u)
        block.kernels.commit()
        history = block.kernels.history()
        stress = stress - 2 / 3 * material.kinematic_share * material.plastic_modulus * history.plastic_strain
        mean = stress[..., :3].mean(axis=-1, keepdims=True)
        deviator = np.concatenate([stress[..., :3] - mean, stress[..., 3:]], axis=-1)
        mises = np.sqrt(1.5 * (deviator**2 @ [1, 1, 1, 2, 2, 2]))
        grown = (1 - material.kinematic_share) * material.plastic_modulus
        excess = mises - (Y + grown * history.accumulated)
        assert excess.max() < 1e-12 * mises.max()
        trace = history.plastic_strain[..., :3].sum(axis=-1)
        assert np.abs(trace).max() < 1e-14 * np.abs(history.plastic_strain).max()


# --- UFL twin, tangent against differences --------------------------------------------------------


@dataclass(frozen=True)
class State:
    """Displacement over a history of committed ones, and which part of the points flows there if one knows."""

    history: tuple[Array, ...]
    u: Array
    flowing: float | None = None


def states(solid: Solid) -> dict[str, State]:
    """Kinds of states on a curved mesh; strains of 0.005 yield."""
    rng = np.random.default_rng(2)
    x = solid.points

    def noise(scale: float) -> Array:
        return scale * rng.normal(size=x.shape)

    squeeze = x @ np.diag([0.001, -0.0005, -0.01]) + 1e-3 * x[:, [1]] * x  # every point yields, not uniformly
    deep = 20 * squeeze
    mixed = noise(1e-4)
    turned = noise(3e-3)
    return {
        "elastic": State((), 0.1 * squeeze, 0.0),
        "random": State((), mixed),
        "random over a history": State((mixed, turned), mixed + noise(3e-3), 1.0),
        "on the yield surface": State((squeeze,), squeeze),
        "just beyond yield": State((squeeze,), squeeze * (1 + 1e-6), 1.0),
        "just unloading": State((squeeze,), squeeze * (1 - 1e-6), 0.0),
        "plastic": State((), squeeze, 1.0),
        "deep plastic": State((squeeze,), deep, 1.0),
        "unloading": State((deep,), 0.99 * deep, 0.0),
        "reversed": State((deep,), -deep, 1.0),
    }


NAMES = (
    "elastic",
    "random",
    "random over a history",
    "on the yield surface",
    "just beyond yield",
    "just unloading",
    "plastic",
    "deep plastic",
    "unloading",
    "reversed",
)


def bring(s: Sample, state: State) -> Array:
    """Put a fresh sample into a state; its internal force."""
    for u in state.history:
        s.force(u)
        s.kernels.commit()
    return s.force(state.u)


@pytest.mark.parametrize("name", NAMES)
@LAWS
def test_compiled_and_ufl_kernels_agree(coarse: BlockMesh, material: Material, name: str) -> None:
    a, b = (sample(coarse, material, twin) for twin in (False, True))
    state = states(a.solid)[name]
    np.testing.assert_array_equal(a.solid.points, b.solid.points)
    assert difference(bring(a, state), bring(b, state)) < TWINS
    if name != "on the yield surface":  # where it has a jump, round-off picks the side
        assert a.kernels.plastic_points == b.kernels.plastic_points
        if state.flowing is not None:
            assert a.kernels.plastic_points == state.flowing * a.kernels.volumes.size
        assert difference(a.tangent(state.u).data, b.tangent(state.u).data) < TWINS
    assert difference(a.kernels.stress(state.u), b.kernels.stress(state.u)) < TWINS
    assert difference(a.kernels.volumes, b.kernels.volumes) < TWINS
    a.kernels.commit()
    b.kernels.commit()
    ours, theirs = a.kernels.history().arrays(), b.kernels.history().arrays()
    for x, y in zip(ours.values(), theirs.values(), strict=True):
        if name == "elastic":
            assert not x.any() and not y.any()
        else:
            assert difference(x, y) < TWINS


def test_compiled_and_ufl_kernels_agree_on_an_elastic_material(coarse: BlockMesh) -> None:
    a, b = (sample(coarse, Material(E, NU), twin) for twin in (False, True))
    u = np.random.default_rng(3).normal(size=(a.solid.nodes, 3))
    assert difference(a.force(u), b.force(u)) < TWINS
    assert difference(a.tangent(u).data, b.tangent(u).data) < TWINS
    assert difference(a.kernels.stress(u), b.kernels.stress(u)) < TWINS


@pytest.mark.parametrize("name", [n for n in NAMES if n != "on the yield surface"])
@LAWS
def test_tangent_is_the_derivative_of_the_force(coarse: BlockMesh, material: Material, name: str) -> None:
    """Central differences, by steps so small that no point changes between loading and unloading."""
    s = sample(coarse, material)
    state = states(s.solid)[name]
    bring(s, state)
    K = s.tangent(state.u)
    assert difference(K.data, K.T.tocsr().sorted_indices().data) < 1e-12
    rng = np.random.default_rng(4)
    for _ in range(3):
        du = rng.normal(size=state.u.shape) * np.abs(state.u).max()
        step = 1e-9 if "just" in name else 1e-7
        slope = (s.force(state.u + step * du) - s.force(state.u - step * du)) / (2 * step)
        assert difference(K @ du.ravel(), slope.ravel()) < (1e-6 if "just" in name else 1e-8)


def test_force_has_both_one_sided_slopes_on_the_yield_surface(coarse: BlockMesh) -> None:
    s = sample(coarse, STEEL)
    u = states(s.solid)["on the yield surface"].u
    bring(s, State((u,), u))
    step, here = 1e-6, s.force(u)
    for sign, flowing in ((1.0, s.kernels.volumes.size), (-1.0, 0)):
        there = s.force(u * (1 + sign * step))
        assert s.kernels.plastic_points == flowing
        K = s.tangent(u * (1 + sign * step))
        assert difference(K @ u.ravel(), (there - here).ravel() / (sign * step)) < 1e-5
