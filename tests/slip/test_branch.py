"""Slip of a curve with its stiffnesses: Mindlin's sphere through few rows, direction, what is left out."""

from __future__ import annotations

import numpy as np
import pytest

from asperity.model.material import Material
from asperity.slip import SlipSettings, slip_of_curve
from asperity.slip.joint_slip import without_slip
from asperity.vibration.curve_law import CurveLaw
from asperity.vibration.source import CurveColumns, choose

STEEL, SIDE, HEIGHT = Material(200e9, 0.3), 1e-6, 1e-6
MU, AMPLITUDES = 0.3, (0.1, 0.3, 0.6, 0.9)


def sphere(rows: int, softer: float = 1.0) -> dict[str, np.ndarray]:
    """Curve of a sphere on a block, its tangential stiffness along x and y, that along y of a `softer` interface."""
    z = np.linspace(0.0, 1e-8, rows + 1)[1:]
    force, k = 2e9 * z**1.5, 3e9 * z**0.5
    c_n, c_t = (HEIGHT / (SIDE**2 * modulus) for modulus in (STEEL.confined_modulus, STEEL.lame[1]))
    ratio = (1.0 - 0.5 * STEEL.nu) / (1.0 - STEEL.nu)
    k_x, k_y = (1.0 / (part * ratio / k + c_t) for part in (1.0, softer))
    columns = {"delta": z + c_n * force, "force": force, "k_n_elastic": 1.0 / (1.0 / k + c_n)}
    return columns | {"k_t": 0.5 * (k_x + k_y), "k_t_x": k_x, "P_star": force, "error_P_star": 1e-6 * force}


def slip(curve: dict[str, np.ndarray], direction: str = "x"):
    settings = SlipSettings(MU, AMPLITUDES, float(curve["force"][-1]), direction=direction)
    return slip_of_curve(curve, settings, STEEL, patch=SIDE**2, height=HEIGHT)


@pytest.mark.parametrize("rows", [3, 5, 20])
def test_few_rows_with_their_stiffness_give_mindlins_sphere(rows: int) -> None:
    law, P, a = slip(sphere(rows)).law, 2e9 * 1e-12, 1e-8
    t = np.array(AMPLITUDES)
    ratio, c_t = (1.0 - 0.5 * STEEL.nu) / (1.0 - STEEL.nu), HEIGHT / (SIDE**2 * STEEL.lame[1])
    c = MU * ratio * a
    np.testing.assert_allclose(law.displacement(t), c * (1 - (1 - t) ** (2 / 3)) + c_t * MU * P * t, rtol=1e-5)
    energy = 4.8 * MU * P * c * (1 - (1 - t) ** (5 / 3) - 5 * t / 6 * (1 + (1 - t) ** (2 / 3)))
    np.testing.assert_allclose(law.energy(t), energy, rtol=1e-3)
    assert law.k_tangent(0.0) == pytest.approx(sphere(rows)["k_t"][-1], rel=1e-12)


def test_each_direction_has_its_stiffness() -> None:
    curve = sphere(10, softer=1.2)
    along_x, along_y = (slip(curve, direction).law for direction in ("x", "y"))
    assert along_x.k_tangent(0.0) == pytest.approx(curve["k_t_x"][-1], rel=1e-12)
    assert along_y.energy(0.5) == pytest.approx(1.2 * along_x.energy(0.5), rel=1e-6)


def test_the_bars_are_those_of_the_curve() -> None:
    """A sphere whose force is 5 % off has displacements and energies off by the power -2/3 of that factor."""
    z = np.linspace(0.0, 1e-8, 21)[1:]
    curve = {"delta": z, "force": 2e9 * z**1.5, "P_star": z**1.5, "error_P_star": 0.05 * z**1.5}
    curve |= {"k_n_elastic": 3e9 * z**0.5, "k_t": 2.2e9 * z**0.5, "k_t_x": 2.2e9 * z**0.5}
    settings = SlipSettings(MU, AMPLITUDES, 1e-3)
    found = slip_of_curve(curve, settings, STEEL, patch=SIDE**2, height=1e-12)
    for row in found.loops():
        assert row["error_u"] / row["u"] == pytest.approx(0.95 ** (-2 / 3) - 1.0, rel=0.01)
        assert row["error_energy"] / row["energy"] == pytest.approx(0.95 ** (-2 / 3) - 1.0, rel=0.02)
        assert row["error_eta"] < 0.002 * row["eta"]  # displacement and energy change alike
    unknown = {name: column for name, column in curve.items() if name != "error_P_star"}
    assert "error_u" not in slip_of_curve(unknown, settings, STEEL, patch=SIDE**2, height=1e-12).loops()[0]


def test_a_curve_without_tangential_stiffness_has_no_bars_and_says_so() -> None:
    curve = {name: column for name, column in sphere(20).items() if not name.startswith("k_")}
    found = slip(curve)
    assert "error_u" not in found.loops()[0]
    assert any("output.stiffness = true" in note for note in found.notes)
    known = slip(sphere(20)).law  # here the block's part of the curve is known by its height alone
    assert found.law.energy(0.6) == pytest.approx(known.energy(0.6), rel=0.03)
    assert found.law.displacement(0.6) == pytest.approx(known.displacement(0.6), rel=0.01)


def test_a_ratio_of_stiffnesses_that_changes_along_the_curve_is_followed() -> None:
    """dw = r dz with r = 1 + 2 F and F = z: w = z + z^2, by trapezoids without error between rows."""
    z = np.linspace(0.0, 1.0, 9)[1:]
    law = without_slip(CurveLaw(z, z, k=np.ones(8)), z, 1.0 + 2.0 * z)
    np.testing.assert_allclose(np.diff(law.z), np.diff(z + z**2), rtol=1e-12)
    np.testing.assert_allclose(law.slopes, 1.0 / (1.0 + 2.0 * z), rtol=1e-12)  # dF/dw = k_t


def test_the_rows_of_a_branch_are_those_of_its_law() -> None:
    """The law about a preload below the last, partial unloading is that of the first one, and so are its rows."""
    up, down, again = np.linspace(0.05, 1.0, 20), np.linspace(0.95, 0.3, 14), np.linspace(0.9, 0.8, 11)
    depth = (down - 0.3) / 0.7
    delta = np.concatenate([up, down, [0.6, 1.0], again])
    force = np.concatenate([up**1.5, depth**1.5, [0.3, 1.0], 1.0 - 2.0 * (1.0 - again)])
    branch = np.array(["load"] * 20 + ["unload"] * 14 + ["reload"] * 2 + ["unload"] * 11)
    columns = CurveColumns.of({"step": np.arange(47), "delta": delta, "force": force, "branch": branch})
    for load, rows in ((0.3, [19, *range(20, 34)]), (0.9, [35, *range(36, 47)])):
        choice = choose(columns, "unload-reload", load)
        assert isinstance(choice.law, CurveLaw)
        assert set(choice.rows) == set(rows) and np.all(np.diff(force[choice.rows]) > 0.0)
        np.testing.assert_allclose(choice.law.F, force[choice.rows][force[choice.rows] > 0.0], rtol=1e-9)
    assert choose(columns, "table", 0.3).rows.tolist() == list(range(20))
