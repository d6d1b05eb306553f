# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The interface without its block: stiffness of the flat block, and conditions that make the interface void."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import legendre

from asperity.arrays import Floats
from asperity.case import Case
from asperity.curve import Curve
from asperity.study import summarise_case
from asperity.study.interface import Block, free_block_modulus


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
    assert free_block_modulus(nu, height) == pytest.approx(upper[1], rel=2e-3)


def test_without_lateral_strain_the_flat_block_has_Youngs_modulus() -> None:
    assert free_block_modulus(0.0, 1.0) == pytest.approx(1.0, rel=1e-7)  # equations are solved to 1e-8


def loading(side: float, height: float, modulus: float, **columns: float) -> Curve:
    """An interface of exponent 2.5 in series with a block, up to a mean pressure of 0.01; other columns at its end."""
    g = np.linspace(0.002, 0.02, 12)
    pressure = 0.01 * (g / g[-1]) ** 2.5
    deltas = g * side + pressure * height / modulus
    rows: list[dict[str, Any]] = [
        {"delta": d, "delta_star": d / side, "force": p * side**2, "P_star": p, "area_fraction": 0.0,
         "plastic_fraction": 0.0, "max_plastic_strain": 0.0} for d, p in zip(deltas, pressure, strict=True)
    ]  # fmt: skip
    rows[-1] |= columns
    return Curve.from_rows(rows)


def case_of(sides: str, yield_strength: float | None = None) -> Case:
    """A block twice as wide as high."""
    material = {"E": 1.0, "nu": 0.45} | ({} if yield_strength is None else {"yield_strength": yield_strength})
    tables = {"surface": {"kind": "flat", "L": 2.0}, "block": {"height": 1.0, "sides": sides}, "material": material}
    return Case.from_dict({"units": "other", "loading": {"delta_max": 0.04, "steps": 12}} | tables)


@pytest.mark.parametrize("sides", ["rollers", "free"])
def test_the_approach_of_the_interface_excludes_the_block(sides: str) -> None:
    """With free sides the modulus is not E; with E the exponent would be different."""
    block = Block.of(case_of(sides))
    polynomials = polynomial_block(0.45, 0.5, 9)
    confined = 0.55 / (1.45 * 0.1)
    assert block.modulus == pytest.approx(confined if sides == "rollers" else polynomials, rel=3e-3)
    row = summarise_case(case_of(sides), loading(2.0, 1.0, block.modulus), {})
    assert row["n_interface"] == pytest.approx(2.5, rel=1e-6) and row["interface_void"] == ""
    assert row["n"] < 2.4


@pytest.mark.parametrize(
    ("sides", "strength", "columns", "reason"),
    [
        ("free", 0.0099, {}, "the block has yielded: the mean pressure is 1 times its yield pressure"),
        ("free", 0.0101, {}, ""),
        ("rollers", 0.0017, {}, "mean pressure is 1.1 times"),  # yields at (1 - nu)/(1 - 2 nu) = 5.5 times the strength
        ("rollers", 0.0019, {}, ""),
        ("rollers", 0.1, {"plastic_fraction": 0.7}, "the block has yielded: 70% of it is plastic"),
        ("rollers", None, {"area_fraction": 0.97}, r"contact is nearly full: A/A0 = 0\.97"),
        ("rollers", None, {"area_fraction": 0.85}, ""),
        ("rollers", None, {"area_fraction": math.nan, "plastic_fraction": math.nan}, ""),
    ],
)
def test_the_interface_is_void_if_the_block_yields_or_contact_is_full(
    sides: str, strength: float | None, columns: dict[str, float], reason: str
) -> None:
    case = case_of(sides, strength)
    block = Block.of(case)
    curve = loading(2.0, 1.0, block.modulus, **columns)
    row = summarise_case(case, curve, {})
    assert (row["n_interface"] is None) == bool(reason)
    assert re.search(reason, row["interface_void"]) if reason else row["interface_void"] == ""
    assert reason or row["n_interface"] == pytest.approx(2.5, rel=1e-6)
