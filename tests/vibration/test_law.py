"""Static laws: closed forms, derivatives against differences, tables with noise, refusals."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import quad

from asperity.errors import AsperityWarning, InputError, RangeError
from asperity.vibration import ContactOscillator, CurveLaw, Equation, Law, PowerLaw, TaylorLaw, law_from
from asperity.vibration.curve_law import Bars
from asperity.vibration.law import bar_of

Z = np.linspace(0.0, 1.0, 61)[1:]


@pytest.mark.parametrize("n", [0.6, 1.0, 3.7])
def test_power_law_matches_closed_forms(n: float) -> None:
    law = PowerLaw(n, 3.0)
    load = 2.5
    r = Equation(law, load)
    assert r.z_s == pytest.approx((load / 3.0) ** (1 / n), rel=1e-14)
    assert r.n_loc == pytest.approx(n, rel=1e-14)
    assert r.a2 == pytest.approx((n - 1) / 2, abs=1e-14)
    assert r.kappa == pytest.approx(-(n - 1) * (2 * n + 1) / 48, abs=1e-14)
    assert r.f(-3.0) == pytest.approx(-1 / n, rel=1e-14)
    assert law.force(-0.1) == 0.0


@pytest.mark.parametrize(
    "law",
    [
        PowerLaw(1.5),
        PowerLaw(0.8, 2.0),
        TaylorLaw.about(PowerLaw(1.5), 0.4),
        CurveLaw(Z, Z**1.5 + 0.3 * Z**2),
    ],
)
def test_force_is_the_derivative_of_the_potential(law: CurveLaw) -> None:
    r = Equation(law, 0.4)
    for u in (-0.8, -0.3, -1e-3, 1e-5, 0.04, 0.06, 0.5):
        z = r.z_s * (1.0 + u)
        value, _ = quad(lambda z: law.force(z), r.z_s, z, epsabs=1e-13, epsrel=1e-13, limit=400)
        assert float(law.potential(z) - law.potential(r.z_s)) == pytest.approx(value, rel=1e-8, abs=1e-15)
        slope = (r.f(u + 1e-6) - r.f(u - 1e-6)) / 2e-6
        assert float(law.slope(z)) * r.z_s / r.scale == pytest.approx(float(slope), rel=1e-6)


@pytest.mark.parametrize(("n", "rim"), [(1.2, -4.529), (1.5, -2.7446), (2.0, -2.0), (2.4, -1.9202)])
def test_taylor_rim(n: float, rim: float) -> None:
    assert TaylorLaw.about(PowerLaw(n), 1.0).rims()[0] == pytest.approx(rim, abs=5e-4)


def test_table_of_a_power_law_is_the_power_law() -> None:
    law = CurveLaw(Z, 2.0 * Z**1.5)
    z = np.linspace(1e-4, 1.0, 200)
    np.testing.assert_allclose(law.force(z), 2.0 * z**1.5, rtol=1e-12)
    np.testing.assert_allclose(law.slope(z), 3.0 * z**0.5, rtol=1e-11)
    np.testing.assert_allclose(law.potential(z), 0.8 * z**2.5, rtol=1e-11)
    r = ContactOscillator(law, load=0.7)
    assert r.kappa == pytest.approx(-1 / 24, rel=1e-9)


def test_below_its_first_point_a_law_is_a_power_law() -> None:
    law = CurveLaw(Z, Z**1.5)
    for load in (1e-60, 1e-6):
        z = law.deflection(load)
        assert z == pytest.approx(load ** (1 / 1.5), rel=1e-9)
        assert law.n_loc(z) == pytest.approx(1.5, rel=1e-9) and law.kappa(z) == pytest.approx(-1 / 24, rel=1e-6)
    with pytest.warns(AsperityWarning, match="below the first point"):
        law_from({"step": Z, "delta": Z, "force": Z**1.5}, load=1e-6)


def _hysteretic() -> dict[str, np.ndarray]:
    up = np.linspace(0, 1, 21)[1:]
    down = np.linspace(1, 0.4, 13)[1:]
    return {
        "delta": np.concatenate([up, down]),
        "force": np.concatenate([up**1.2, ((down - 0.4) / 0.6) ** 1.5]),
        "branch": np.array(["load"] * 20 + ["unload"] * 12),
    }


def test_the_last_unloading_that_reaches_the_preload_is_the_law() -> None:
    """After cycles to 1 with exponents 1.5, 1.6, 1.7, the last one to 0.4 only; reloadings do not count."""
    rows = [(d, d**1.2, "load") for d in np.linspace(0, 1, 11)[1:]]
    for n, left, top in ((1.5, 0.40, 1.0), (1.6, 0.42, 1.0), (1.7, 0.44, 0.4)):
        start = left + (1 - left) * top ** (1 / n)
        for branch, path in (("reload", np.linspace(0.4, start, 9)[1:]), ("unload", np.linspace(start, left, 9)[1:])):
            rows += [(d, (max(d - left, 0.0) / (1 - left)) ** n, branch) for d in path]
    curve = dict(zip(("delta", "force", "branch"), map(np.array, zip(*rows, strict=True)), strict=True))
    for load, n, left in ((0.5, 1.6, 0.42), (0.3, 1.7, 0.44)):
        law = law_from(curve, "unload-reload", load)[0]
        assert law.deflection(load) == pytest.approx((1 - left) * load ** (1 / n), rel=1e-4)
        assert law.n_loc(law.deflection(load)) == pytest.approx(n, rel=1e-4)
    with pytest.raises(RangeError, match=r"load = 1\.2 lies outside the curve, which ends at force 1"):
        law_from(curve, "unload-reload", 1.2)[0]


def test_paper_law_is_the_fit_of_the_loading_branch(tmp_path) -> None:
    curve = _hysteretic()
    law, load = law_from(curve, "paper")
    assert isinstance(law, PowerLaw) and law.n == pytest.approx(1.2, rel=1e-8)
    assert law.K == pytest.approx(1.0, rel=1e-8)
    assert load == 0.5
    path = tmp_path / "curve.csv"
    np.savetxt(path, np.transpose(list(curve.values())), fmt="%s", delimiter=",", header=",".join(curve), comments="")
    assert law_from(path, "paper")[0] == law_from(tmp_path, "paper")[0]
    scaled, _ = law_from({**curve, "delta": curve["delta"] * 1e-8, "force": curve["force"] * 1e-3}, "paper")
    assert float(scaled.force(0.5e-8)) == pytest.approx(1e-3 * 0.5**1.2, rel=1e-8)


def test_substeps_and_rows_before_contact_do_not_change_the_paper_law() -> None:
    planned = np.linspace(0.0, 1.0, 9)[1:]
    pieces = np.array([0.01, 0.02, 0.04, 0.06, 0.6, 0.7])

    def law(rows: np.ndarray, length: float = 1.0, force: float = 1.0) -> PowerLaw:
        z = np.maximum(rows, 0.0)
        found = law_from({"delta": length * rows, "force": force * (z**1.5 + 0.3 * z**4)}, "paper")[0]
        assert isinstance(found, PowerLaw)
        return found

    whole = law(planned)
    assert law(np.sort(np.concatenate([planned, pieces]))) == whole
    assert law(planned, length=1.3e-8, force=7e-4).n == pytest.approx(whole.n, rel=1e-13)
    assert law(np.concatenate([[-0.1, 0.0], planned])).n == whole.n


@pytest.mark.parametrize("digits", [16, 4])
def test_every_row_of_a_measured_curve_counts_for_the_paper_law(digits: int) -> None:
    z = np.round(np.linspace(0.25, 1.0, 32), digits)  # not only the rows at the multiples of the first approach
    rng = np.random.default_rng(0)
    found = [law_from({"delta": z, "force": z**1.8 * (1 + 0.01 * rng.standard_normal(32))}, "paper") for _ in range(20)]
    assert np.std([law.n for law, _ in found if isinstance(law, PowerLaw)]) < 0.014  # 0.026 with four rows


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: PowerLaw(-1.5), "n = -1.5"),
        (lambda: PowerLaw(1.5, float("nan")), "K = nan"),
        (lambda: PowerLaw(0.5), "n = 0.5 is not legal: it must lie between 0.51 and 100"),
        (lambda: law_from({"delta": 1e-6 * Z, "force": Z**60}, "paper"), "K = inf"),
        (lambda: ContactOscillator(PowerLaw(0.51), load=1e300), "under load = 1e+300"),
        (lambda: ContactOscillator(PowerLaw(1.5), zeta=-0.01), "zeta = -0.01"),
        (lambda: ContactOscillator(PowerLaw(1.5), zeta=1.5), "zeta = 1.5"),
        (lambda: ContactOscillator(PowerLaw(1.5), load=0.0), "load = 0.0"),
        (lambda: ContactOscillator(PowerLaw(1.5), damping="coulomb"), "hunt-crossley"),
        (lambda: ContactOscillator(cast(Any, 1.5)), "law must be"),
        (lambda: CurveLaw(np.array([]), np.array([])), "0 points in contact"),
        (lambda: CurveLaw(Z[:2], Z[:2]), "at least 5"),
        (lambda: CurveLaw(Z, Z[::-1]), "force does not rise"),
        (lambda: CurveLaw(Z[::-1], Z[::-1]), "approach does not rise"),
        (lambda: CurveLaw(Z, np.where(Z > 0.5, np.nan, Z)), "not finite"),
        (lambda: CurveLaw(Z - 0.3, Z**1.5), "subtract the approach of first contact"),
        (lambda: CurveLaw(Z, Z[:5]), "shapes"),
        (lambda: law_from({"delta": Z, "force": Z}, "unload-reload"), "unload"),
        (lambda: law_from({"delta": Z}), "column 'force' is missing"),
        (lambda: law_from({"delta": Z, "force": np.where(Z > 0.5, np.nan, Z)}), "'force' is not finite in step 31"),
        (lambda: law_from({"delta": Z, "force": Z[:9]}), "60 of delta, 9 of force"),
        (lambda: law_from({"delta": Z, "force": Z, "branch": ["loading"] * Z.size}), "branch 'loading'"),
        (lambda: law_from("nowhere.csv"), "nowhere.csv"),
        (lambda: law_from({"delta": Z, "force": Z}, law="hertz"), "hertz"),
    ],
)
def test_bad_input_is_reported_in_one_sentence(build: Any, words: str) -> None:
    with pytest.raises(InputError) as error:
        build()
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_beyond_its_last_point_a_law_is_a_power_for_motion_only() -> None:
    law = CurveLaw(Z, Z**1.5)
    assert law.force(1.2) == pytest.approx(1.2**1.5, rel=1e-9)
    with pytest.raises(RangeError, match="load = 2 lies outside the law, which ends at force 1"):
        ContactOscillator(law, load=2.0)
    power = ContactOscillator(PowerLaw(1.5), load=0.5)
    np.testing.assert_allclose(ContactOscillator(law).free([0.9]).omega_ratio, power.free([0.9]).omega_ratio, rtol=1e-9)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e5])
def test_an_own_law_needs_force_and_slope_only(size: float) -> None:
    """Deflection, derivatives and energy in closed form, for any size of the approach."""

    class Cubic(Law):
        def force(self, z: Any) -> Any:
            x = np.maximum(z, 0.0) / size
            return x + x**3

        def slope(self, z: Any) -> Any:
            return (1.0 + 3.0 * (np.maximum(z, 0.0) / size) ** 2) / size

    law = Cubic()
    for x in (1e-3, 0.7, 20.0):
        z = x * size
        assert law.deflection(x + x**3) == pytest.approx(z, rel=1e-13)
        exact = (1.0 + 3.0 * x**2) / size, 6.0 * x / size**2, 6.0 / size**3
        assert law.derivatives(z) == pytest.approx(exact, rel=1e-7 + 1e-11 / x**2)
        assert float(law.potential(z)) == pytest.approx(size * (x**2 / 2 + x**4 / 4), rel=1e-13)


def test_the_sides_have_the_bars_of_their_law() -> None:
    """A pair for each error: the load keeps its stiffness, or its kappa, but for the bar; each side is a law itself."""
    law = replace(CurveLaw(Z, Z**1.5), bars=Bars(0.4, 0.02, 0.01, 0.05, 0.03))
    pairs = law.sides()
    level, contact, tilt, bent = (np.array([side.at_load(0.4) for side in pair]) for pair in pairs)
    z, k, n, kappa = law.at_load(0.4)
    np.testing.assert_allclose(tilt[:, 1] / k - 1.0, [-0.05, 0.05], rtol=1e-9)
    np.testing.assert_allclose(tilt[:, 3], [-(n - 1) * (2 * n + 1) / 48 for n in (1.5 * 0.95, 1.5 * 1.05)], rtol=1e-6)
    np.testing.assert_allclose(bent[:, 3] - kappa, [-0.03, 0.03], rtol=1e-4)
    np.testing.assert_allclose(contact[:, 0] - z, [-0.01, 0.01], rtol=1e-9)
    np.testing.assert_allclose(level[:, 0] / z, [0.98 ** (-1 / 1.5), 1.02 ** (-1 / 1.5)], rtol=1e-6)
    total = bar_of(law, lambda side: side.at_load(0.4))
    changes = [np.abs(pair - [z, k, n, kappa]).max(axis=0) for pair in (level, contact, tilt, bent)]
    np.testing.assert_allclose(total, np.sqrt(np.sum(np.square(changes), axis=0)))
    assert np.isnan(bar_of(PowerLaw(1.5), lambda side: side.at_load(0.4))).all()
    tilt, bent = replace(law, bars=Bars(0.4, stiffness=50.0, kappa=5.0)).sides()  # of what is hardly known
    assert tilt[1].at_load(0.4)[1] > 9.0 * k
    assert [side.at_load(0.4)[3] - kappa for side in bent] == pytest.approx([-5.0, 5.0])
    fine = np.linspace(0.05, 0.99, 400)
    for side in (side for pair in pairs for side in pair):
        assert np.all(np.diff(side.force(fine)) > 0.0)
        at, h = side.deflection(0.4), 2e-3
        third = np.array([-1, 2, 0, -2, 1]) @ side.force(at + h * np.arange(-2, 3)) / (2 * h**3)
        assert side.derivatives(at)[2] == pytest.approx(third, abs=0.5)
