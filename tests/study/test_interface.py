"""The block below the interfaces of docs/paper.md: its stiffness with free sides."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import legendre

from asperity.arrays import Floats

BENCHMARK = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks/interface.py"))


def polynomial_block(nu: float, height: float, degree: int) -> float:
    """Stiffness over E of a flat block with free sides on a clamped base by Ritz's method, an upper bound.

    Displacements of polynomials in x, y, z, the one along x odd in x, the one along y odd in y. At the top the vertical
    one is given and nothing holds the others. The block is a cube of side 2 stretched.
    """
    s, w = legendre.leggauss(degree + 4)
    P, slope = legendre.legvander(s, degree), legendre.legval(s, legendre.legder(np.eye(degree + 1))).T

    def times(factor: Floats, rise: Floats) -> tuple[Floats, Floats]:
        return factor[:, None] * P, rise[:, None] * P + factor[:, None] * slope

    odd, even = ((P[:, k::2], slope[:, k::2]) for k in (1, 0))
    clamped, held = times(1 + s, np.ones_like(s)), times(1 - s**2, -2 * s)
    families = ((odd, even, clamped), (even, odd, clamped), (even, even, held))
    stretch = (2.0, 2.0, 2.0 / height)
    lame, shear = nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))

    def factor(field: int, axis: int, derived: bool) -> Floats:
        return families[field][axis][derived] * (stretch[axis] if derived else 1.0)

    def product(i: int, j: int, of_i: int, of_j: int) -> Floats:
        """Mean over the block of d/dx_of_i of each function of field i times d/dx_of_j of each of field j."""
        parts = [
            (factor(i, axis, axis == of_i) * w[:, None] / 2).T @ factor(j, axis, axis == of_j) for axis in range(3)
        ]
        return np.asarray(np.kron(np.kron(parts[0], parts[1]), parts[2]))

    def mean_strain(i: int) -> Floats:
        parts = [w @ factor(i, axis, axis == i) / 2 for axis in range(3)]
        return np.asarray(np.kron(np.kron(parts[0], parts[1]), parts[2]))

    blocks = [[lame * product(i, j, i, j) + shear * product(i, j, j, i) for j in range(3)] for i in range(3)]
    for i in range(3):
        blocks[i][i] = blocks[i][i] + shear * sum(product(i, i, k, k) for k in range(3))
    # the prescribed part, u_z = z, has the strain 1 along z everywhere
    load = np.concatenate([(lame + 2 * shear * (i == 2)) * mean_strain(i) for i in range(3)])
    return float(lame + 2 * shear - load @ np.linalg.lstsq(np.block(blocks), load, rcond=1e-12)[0])


@pytest.mark.parametrize(("nu", "height"), [(0.3, 1.0), (0.45, 1.0), (0.3, 0.5)])
def test_the_flat_block_with_free_sides_is_stiffer_than_E(nu: float, height: float) -> None:
    """Against polynomials over the whole block."""
    upper = [polynomial_block(nu, height, degree) for degree in (6, 9)]
    assert 1.02 < upper[1] < upper[0]
    assert BENCHMARK["free_block_modulus"](nu, height) == pytest.approx(upper[1], rel=2e-3)


def test_without_lateral_strain_the_flat_block_has_Youngs_modulus() -> None:
    assert BENCHMARK["free_block_modulus"](0.0, 1.0) == pytest.approx(1.0, rel=1e-7)  # equations are solved to 1e-8
