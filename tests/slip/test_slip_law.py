"""Slip by the normal curve: Cattaneo and Mindlin, Masing's rules, sliders, vibration; laws of curves and their bars."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad, trapezoid

import asperity as asp
from asperity.errors import InputError, RangeError
from asperity.model.material import Material
from asperity.slip import JointSlip, SlipLaw, SlipSettings, slip_of_curve, tangential_response
from asperity.slip.joint_slip import without_slip
from asperity.slip.law import compliance_ratio
from asperity.slip.tangential import complex_stiffness, sliders
from asperity.vibration.curve_law import CurveLaw
from asperity.vibration.source import CurveColumns, choose

E, NU, RADIUS, LOAD, MU = 2.0, 0.3, 5.0, 1e-3, 0.4
G, REDUCED = E / 2 / (1 + NU), E / (1 - NU**2)
SPOT = (0.75 * LOAD * RADIUS / REDUCED) ** (1 / 3)
SHARES = np.array([0.01, 0.1, 0.3, 0.6, 0.9, 0.99])


@pytest.fixture(scope="module")
def sphere() -> SlipLaw:
    return SlipLaw(asp.PowerLaw(1.5, 4 / 3 * REDUCED * RADIUS**0.5), LOAD, MU, NU)


def test_displacement_and_energy_of_cattaneo_and_mindlin(sphere: SlipLaw) -> None:
    """Johnson, Contact Mechanics (1985), eq. 7.42 and 7.51 with one body against a rigid flat."""
    t, c = SHARES, 3 * MU * LOAD * (2 - NU) / (16 * G * SPOT)
    np.testing.assert_allclose(sphere.displacement(t), c * (1 - (1 - t) ** (2 / 3)), rtol=1e-12)
    energy = 4.8 * MU * LOAD * c * (1 - (1 - t) ** (5 / 3) - 5 * t / 6 * (1 + (1 - t) ** (2 / 3)))
    np.testing.assert_allclose(sphere.energy(t), energy, rtol=1e-8)
    assert sphere.displacement(1.0) == pytest.approx(c, rel=1e-14)
    assert sphere.k_tangent(0.0) == pytest.approx(8 * G * SPOT / (2 - NU), rel=1e-12)  # Mindlin 1949


def test_energy_is_that_of_masings_loop_for_any_law() -> None:
    z = np.geomspace(0.02, 1.0, 15)
    law = SlipLaw(asp.CurveLaw(z, z**1.3 + 0.5 * z**3), preload=0.9, friction=MU, nu=0.2)
    for t in (0.2, 0.7):
        work = quad(lambda s: s * law.limit**2 / law.k_tangent(s), 0.0, t, epsabs=0, epsrel=1e-10, limit=200)[0]
        masing = 8 * work - 4 * t * law.limit * law.displacement(t)
        assert law.energy(t) == pytest.approx(masing, rel=1e-6)


@pytest.mark.parametrize("block", [0.0, 0.3])
def test_the_tangent_is_the_slope_of_the_displacement(block: float) -> None:
    """With the block too, whose compliance is in series."""
    z = np.geomspace(0.02, 1.0, 15)
    law, d = SlipLaw(asp.CurveLaw(z, z**1.3 + 0.5 * z**3), 0.9, MU, 0.2, block), 1e-6
    for t in (0.2, 0.7, 0.95):
        slope = (law.displacement(t + d) - law.displacement(t - d)) / (2 * d * law.limit)
        assert law.k_tangent(t) == pytest.approx(1.0 / slope, rel=1e-5)
    alone = SlipLaw(law.normal, 0.9, MU, 0.2)
    assert 1.0 / law.k_tangent(0.3) - 1.0 / alone.k_tangent(0.3) == pytest.approx(block, rel=1e-12)


@pytest.mark.parametrize("amplitude", [0.2, 0.8])
def test_the_path_closes_and_its_work_is_what_it_dissipates(sphere: SlipLaw, amplitude: float) -> None:
    path, start = sphere.path(amplitude, steps=400), 400
    u, T, lost = path["u"], path["T"], path["dissipated"]
    assert (u[-1], T[-1]) == pytest.approx((u[start], T[start]), rel=1e-12)
    assert (u[start + 800], T[start + 800]) == pytest.approx((-u[start], -T[start]), rel=1e-12)
    assert trapezoid(T[start:], u[start:]) == pytest.approx(lost[-1] - lost[start], rel=1e-3)
    assert lost[-1] - lost[start] == pytest.approx(float(sphere.energy(amplitude)), rel=1e-12)
    assert np.all(np.diff(lost) >= 0.0)


def test_the_first_loading_loses_what_its_sliders_lose(sphere: SlipLaw) -> None:
    """Each that slips has lost its force times the way since, a quarter of its loss in a loop."""
    path, (k, reach) = sphere.path(0.8, steps=10), sliders(sphere, 400)
    for i in (4, 7, 10):
        slid = np.maximum(path["u"][i] - reach, 0.0)
        assert path["dissipated"][i] == pytest.approx(float((k * reach) @ slid), rel=5e-3)


def moved(k: np.ndarray, reach: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Force of sliders along displacements that begin at rest."""
    at, forces = np.zeros(k.shape), []
    for u in path:
        at = np.clip(at, u - reach, u + reach)
        forces.append(float(k @ (u - at)))
    return np.array(forces)


def test_sliders_follow_the_loop_of_the_law(sphere: SlipLaw) -> None:
    path, (k, reach) = sphere.path(0.7, steps=20), sliders(sphere, 200)
    np.testing.assert_allclose(moved(k, reach, path["u"]), path["T"], atol=3e-4 * sphere.limit)


def test_the_complex_stiffness_is_the_first_harmonic(sphere: SlipLaw) -> None:
    springs, a = sliders(sphere, 40), float(sphere.displacement(0.8))
    phase = np.linspace(0.0, 2 * np.pi, 4001)
    forces = moved(*springs, np.append(a, a * np.cos(phase)))[1:]
    harmonic = trapezoid(forces * np.exp(1j * phase), phase) / (np.pi * a)
    assert complex_stiffness(*springs, a) == pytest.approx(complex(harmonic.real, abs(harmonic.imag)), rel=1e-4)
    assert complex_stiffness(*springs, a).imag == pytest.approx(float(sphere.energy(0.8)) / (np.pi * a**2), rel=0.02)


def test_the_response_is_that_of_time_integration_with_memory(sphere: SlipLaw) -> None:
    """A mass on sliders under a harmonic force, central differences over many periods, at both sides and the peak."""
    (k, reach), mass, force = sliders(sphere), 1.0, 0.05 * sphere.limit
    omega, amplitude = tangential_response(sphere, mass, force)
    peak = int(amplitude.argmax())
    for i in (peak - 60, peak, peak + 60):
        w = float(omega[i])
        step = 2 * np.pi / w / 400
        at, x, v = np.zeros(k.shape), 0.0, 0.0
        found = []
        for n in range(400 * 250):
            at = np.clip(at, x - reach, x + reach)
            v += step * (force * np.cos(w * n * step) - float(k @ (x - at))) / mass
            x += step * v
            if n >= 400 * 240:
                found.append(x)
        steady = 0.5 * (max(found) - min(found))
        assert steady == pytest.approx(float(amplitude[i]), rel=0.02)


def test_a_force_beyond_the_limit_has_no_steady_response(sphere: SlipLaw) -> None:
    with pytest.raises(RangeError, match="makes all of the contact slip"):
        tangential_response(sphere, 1.0, 1.4 * sphere.limit)


def test_a_curve_as_stiff_as_the_block_is_refused() -> None:
    steel, z = asp.Material(200e9, 0.3), np.linspace(0.0, 1e-9, 11)
    curve = {"delta": z, "force": steel.confined_modulus * 1e-12 / 1e-6 * z}  # no interface, for 1 um under 1 um^2
    with pytest.raises(InputError, match="as stiff as the block"):
        slip_of_curve(curve, SlipSettings(MU), steel, patch=1e-12, height=1e-6)


def test_the_share_that_slips_is_that_of_cattaneo_whatever_the_unit_of_area(sphere: SlipLaw) -> None:
    """A ring outside the stick radius a (1 - t)^(1/3); on a leg of the loop of half the move."""
    force, t = np.linspace(0.1, 1.0, 91) * LOAD, np.linspace(0.0, 0.8, 11)
    for unit in (1.0, 7.0, 1e-12):
        area = (force, unit * force ** (2 / 3))
        slip = JointSlip(sphere, SlipSettings(MU, (0.8,), steps=10), np.full((4, 1), np.nan), area=area)
        share = np.array([row["slip_share"] for row in slip.steps()])
        np.testing.assert_allclose(share[:11], 1.0 - (1.0 - t) ** (2 / 3), atol=1e-12)
        np.testing.assert_allclose(share[[30, 50]], share[10], rtol=1e-12)
        assert slip.loops()[0]["slip_share"] == share[10]


def test_the_numbers_of_a_loop_follow_from_its_path(sphere: SlipLaw) -> None:
    path = sphere.path(0.6, steps=8)
    u, T, energy = path["u"][8], path["T"][8], path["dissipated"][-1] - path["dissipated"][8]
    assert sphere.k_secant(0.6) == pytest.approx(T / u, rel=1e-12)
    assert sphere.eta(0.6) == pytest.approx(energy / (np.pi * T * u))


def test_a_flat_punch_does_not_slip_before_the_limit() -> None:
    punch = SlipLaw(asp.PowerLaw(1.0, 3.0), preload=2.0, friction=MU, nu=NU)
    t = SHARES
    np.testing.assert_allclose(punch.displacement(t), MU * 2.0 * t * compliance_ratio(NU) / 3.0, rtol=1e-12)
    assert np.all(np.abs(punch.energy(t)) < 1e-14)


# --- the law of a curve with its stiffnesses -------------------------------------------------------------------

STEEL, SIDE, HEIGHT = Material(200e9, 0.3), 1e-6, 1e-6
AMPLITUDES = (0.1, 0.3, 0.6, 0.9)


def mindlin(rows: int, softer: float = 1.0) -> dict[str, np.ndarray]:
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
    law, P, a = slip(mindlin(rows)).law, 2e9 * 1e-12, 1e-8
    t = np.array(AMPLITUDES)
    ratio, c_t = (1.0 - 0.5 * STEEL.nu) / (1.0 - STEEL.nu), HEIGHT / (SIDE**2 * STEEL.lame[1])
    c = MU * ratio * a
    np.testing.assert_allclose(law.displacement(t), c * (1 - (1 - t) ** (2 / 3)) + c_t * MU * P * t, rtol=1e-5)
    energy = 4.8 * MU * P * c * (1 - (1 - t) ** (5 / 3) - 5 * t / 6 * (1 + (1 - t) ** (2 / 3)))
    np.testing.assert_allclose(law.energy(t), energy, rtol=1e-3)
    assert law.k_tangent(0.0) == pytest.approx(mindlin(rows)["k_t"][-1], rel=1e-12)


def test_each_direction_has_its_stiffness() -> None:
    curve = mindlin(10, softer=1.2)
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
    curve = {name: column for name, column in mindlin(20).items() if not name.startswith("k_")}
    found = slip(curve)
    assert "error_u" not in found.loops()[0]
    assert any("output.stiffness = true" in note for note in found.notes)
    known = slip(mindlin(20)).law  # here the block's part of the curve is known by its height alone
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
