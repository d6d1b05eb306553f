"""Material points: closed forms and rate equations; their forms are in test_forms.py."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from element_sample import sample
from j2_path import j2_path, uniaxial_stress

from asperity.mesh.block import BlockMesh
from asperity.model.material import Material

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


# --- parameters -----------------------------------------------------------------------------------------------


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
