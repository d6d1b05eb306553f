"""Material points under uniform strain, by kernels and by forms: closed forms, rate equations, objectivity, limits."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np
import numpy.typing as npt
import pytest
from element_sample import PAIRS, difference, sample
from j2_path import j2_path, uniaxial_stress
from scipy.spatial.transform import Rotation

from asperity.mesh.block import BlockMesh
from asperity.model.material import Material

Array = npt.NDArray[np.float64]

E, NU, Y, E_T = 1.0, 0.3, 0.005, 0.05
STEEL = Material(E, NU, Y, E_T)
PULL = np.linspace(0, 0.03, 8)[1:]
CYCLE = np.concatenate([PULL, [0.02, 0.0, -0.01, -0.03, -0.04, 0.0, 0.03, 0.05, 0.048, 0.05]])
FAR = np.append(np.log([0.9, 0.7, 0.5]), [-0.5, 0.0, 0.3])  # logarithmic strains
STRETCHED = [
    Material(E, NU, kinematics="finite"), Material(E, NU, Y, E_T, kinematics="finite"),
    Material(E, NU, Y, E_T, 0.4, kinematics="finite"),
]  # fmt: skip
EACH = pytest.mark.parametrize("material", STRETCHED, ids=["elastic", "isotropic", "mixed"])
BOTH = pytest.mark.parametrize("forms", [False, True], ids=["kernels", "forms"])


def test_derived_moduli() -> None:
    lam, mu = STEEL.lame
    assert lam + 2 * mu == pytest.approx(E * (1 - NU) / ((1 + NU) * (1 - 2 * NU)), rel=1e-14)
    assert mu * (3 * lam + 2 * mu) / (lam + mu) == pytest.approx(E, rel=1e-14)
    assert STEEL.reduced_modulus == pytest.approx(E / (1 - NU**2), rel=1e-14)
    assert E * STEEL.plastic_modulus / (E + STEEL.plastic_modulus) == pytest.approx(E_T, rel=1e-14)
    assert Material(200e9, NU, 1e9, 10e9, "kinematic").scaled(200e9) == replace(STEEL, hardening="kinematic")
    assert [replace(STEEL, hardening=h).kinematic_share for h in ("isotropic", 0.4, "kinematic")] == [0.0, 0.4, 1.0]


# --- closed forms ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kinematics", ["small", "finite"])
@pytest.mark.parametrize(
    ("strength", "E_t", "share", "forms"),
    [
        *((Y, E_t, share, False) for E_t, share in ((E_T, 0.0), (E_T, 0.4), (E_T, 1.0), (0.0, 0.0), (0.5, 0.4))),
        *((None, 0.0, 0.0, forms) for forms in (False, True)),
        (Y, E_T, 0.4, True),
    ],
)
def test_bar_under_cycles(
    cube: BlockMesh, strength: float | None, E_t: float, share: float, kinematics: str, forms: bool
) -> None:
    """Stress and plastic strain of a bar in tension and in compression; Hencky strain takes the place of strain.

    The logarithm of a form is a quadrature.
    """
    material, finite = Material(E, NU, strength, E_t, share, kinematics), kinematics == "finite"
    for path in (FAR,) if finite else (CYCLE, -CYCLE):
        axial, accumulated = uniaxial_stress(path, E, strength or inf, E_t, share)
        lateral = -NU * axial / E - 0.5 * (path - axial / E)  # elastic, and plastic of constant volume
        strains = [np.diag([a, a, b]) for a, b in zip(lateral, path, strict=True)]
        if finite:
            strains, axial = [np.expm1(strain) for strain in strains], axial / np.exp(path + 2.0 * lateral)
        stress, alpha = sample(cube, material, forms).follow(strains)
        expected = axial[:, None, None] * np.diag([0.0, 0.0, 1.0])
        near = (1e-5 if forms else 1e-10) if finite else 0.0
        np.testing.assert_allclose(stress, expected, rtol=near, atol=max(1e-2 * near, 1e-12 * Y))
        np.testing.assert_allclose(alpha, accumulated, rtol=near, atol=1e-12 * Y / E)


@BOTH
def test_simple_shear(cube: BlockMesh, forms: bool) -> None:
    """Principal logarithmic stretches are +-asinh(gamma/2), along axes at the angle t with cot 2t = gamma/2."""
    gammas = np.array([1e-8, 0.1, 1.0, 3.0])
    gradients = gammas[:, None, None] * np.outer([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    stress, _ = sample(cube, STRETCHED[0], forms).follow(gradients)
    scale = E / (1.0 + NU) * np.arcsinh(0.5 * gammas) / np.sqrt(1.0 + 0.25 * gammas**2)
    plane = [[[g / 2, 1.0, 0.0], [1.0, -g / 2, 0.0], [0.0, 0.0, 0.0]] for g in gammas]
    np.testing.assert_allclose(stress / scale[:, None, None], plane, rtol=0, atol=2e-3 if forms else 1e-12)


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


# --- properties of finite strain --------------------------------------------------------------------------------


def squeezed(x: Array) -> Array:
    """Displacement far beyond yield of the nodes `x` of a curved mesh."""
    return x @ np.diag([0.1, -0.05, -0.2]) + 0.1 * x[:, [1]] * x + 1e-4 * np.random.default_rng(5).normal(size=x.shape)


@EACH
def test_objectivity(coarse: BlockMesh, material: Material) -> None:
    """A specimen that is turned on the way has the turned forces and stresses, and the same history."""
    plain, turned = sample(coarse, material), sample(coarse, material)
    x, turn = plain.solid.points, Rotation.from_rotvec([0.6, -1.1, 0.4])
    for u, rotation in ((0.1 * squeezed(x), turn.inv() * turn.inv()), (squeezed(x), turn)):
        R = rotation.as_matrix()
        v = (x + u) @ R.T - x
        assert difference(turned.force(v), plain.force(u) @ R.T) < 1e-10
        stress, of_turned = (s.kernels.stress(w)[..., PAIRS] for s, w in ((plain, u), (turned, v)))
        assert difference(of_turned, np.einsum("ik,cqkl,jl->cqij", R, stress, R)) < 1e-10
        histories = []
        for it in (plain, turned):
            it.kernels.commit()
            histories.append(it.kernels.history().arrays())
        for name, values in histories[0].items():
            np.testing.assert_allclose(histories[1][name], values, rtol=0, atol=1e-12)


@EACH
def test_small_displacements_are_those_of_small_strain(coarse: BlockMesh, material: Material) -> None:
    """The difference is of the order of the displacement gradient, down to rounding."""
    finite, small = (sample(coarse, m) for m in (material, replace(material, kinematics="small")))
    u = squeezed(finite.solid.points)
    gaps = [difference(finite.force(s * u), small.force(s * u)) for s in (1e-3, 1e-5, 1e-8)]
    assert gaps[0] < 5e-3 and gaps[1] < 1.5e-2 * gaps[0] and gaps[2] < 1e-7


@BOTH
def test_a_solid_turned_inside_out_is_counted(cube: BlockMesh, forms: bool) -> None:
    it = sample(cube, STRETCHED[1], forms)
    assert np.isfinite(it.force(it.affine(np.diag([0.0, 0.0, -1.1])))).all()
    assert it.kernels.inverted_points == it.kernels.volumes.size
