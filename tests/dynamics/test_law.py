"""Static laws: closed forms, derivatives against differences, tables with noise, refusals."""

from __future__ import annotations

import warnings
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import quad

from asperity.vibration import (
    ContactOscillator,
    Law,
    PowerLaw,
    Restoring,
    CurveLaw,
    TaylorLaw,
    law_from,
    unload_reload,
)
from asperity.errors import InputError, RangeError

Z = np.linspace(0.0, 1.0, 61)[1:]


@pytest.mark.parametrize("n", [0.6, 1.0, 3.7])
def test_power_law_matches_closed_forms(n: float) -> None:
    law = PowerLaw(n, 3.0)
    load = 2.5
    r = Restoring(law, load)
    assert r.z_s == pytest.approx((load / 3.0) ** (1 / n), rel=1e-14)
    assert r.n_loc == pytest.approx(n, rel=1e-14)
    assert r.a2 == pytest.approx((n - 1) / 2, abs=1e-14)
    assert r.a3 == pytest.approx((n - 1) * (n - 2) / 6, abs=1e-14)
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
    r = Restoring(law, 0.4)
    for u in (-0.8, -0.3, -1e-3, 1e-5, 0.04, 0.06, 0.5):
        z = r.z_s * (1.0 + u)
        value, _ = quad(lambda z: law.both(np.array(z))[0], r.z_s, z, epsabs=1e-13, epsrel=1e-13, limit=400)
        assert float(law.potential(z) - law.potential(r.z_s)) == pytest.approx(value, rel=1e-8, abs=1e-15)
        slope = (r.f(u + 1e-6) - r.f(u - 1e-6)) / 2e-6
        assert float(law.both(np.array(z))[1]) * r.z_s / r.scale == pytest.approx(float(slope), rel=1e-6)


@pytest.mark.parametrize(("n", "rim"), [(1.2, -4.529), (1.5, -2.7446), (2.0, -2.0), (2.4, -1.9202)])
def test_taylor_rim(n: float, rim: float) -> None:
    assert TaylorLaw.about(PowerLaw(n), 1.0).rims()[0] == pytest.approx(rim, abs=5e-4)


def test_table_of_a_power_law_is_the_power_law() -> None:
    law = CurveLaw(Z, 2.0 * Z**1.5)
    z = np.linspace(1e-4, 1.0, 200)
    np.testing.assert_allclose(law.force(z), 2.0 * z**1.5, rtol=1e-12)
    np.testing.assert_allclose(law.stiffness(z), 3.0 * z**0.5, rtol=1e-11)
    np.testing.assert_allclose(law.potential(z), 0.8 * z**2.5, rtol=1e-11)
    r = ContactOscillator(law, load=0.7).restoring
    assert r.kappa == pytest.approx(-1 / 24, rel=1e-9)


@pytest.mark.parametrize("load", [1e-60, 1e-6])
def test_below_its_first_point_a_table_is_a_power_law(load: float) -> None:
    with pytest.warns(UserWarning, match="below the first point"):
        r = ContactOscillator(CurveLaw(Z, Z**1.5), load=load).restoring
    assert r.z_s == pytest.approx(load ** (1 / 1.5), rel=1e-9)
    assert r.n_loc == pytest.approx(1.5, rel=1e-9) and r.kappa == pytest.approx(-1 / 24, rel=1e-6)


def test_a_noisy_table_is_a_smoothing_spline_near_the_true_law() -> None:
    """Half a percent of noise: n, kappa and stiffness are those of the spline, and its bar holds the true kappa."""
    covered, noisy = 0, [law for law in map(_noisy, range(12)) if law.noise]
    for law in noisy:
        with pytest.warns(UserWarning, match="the points scatter so that the stiffness"):
            o = ContactOscillator(law, load=0.5)
        r, kappa = o.restoring, o.uncertainty().kappa
        assert r.n_loc == pytest.approx(1.5, abs=0.03) and r.kappa == pytest.approx(-1 / 24, abs=0.02)
        assert float(law.stiffness(r.z_s)) == pytest.approx(r.scale / r.z_s, rel=1e-12)
        covered += kappa.low <= -1 / 24 <= kappa.high
    assert len(noisy) >= 11 and covered >= 0.9 * len(noisy)
    z = np.linspace(0.05, 1.0, 40)
    falling = CurveLaw(z, z**1.5 + 0.02 * (-1.0) ** np.arange(40))  # the forces do not rise at first
    assert falling.stiffness(falling.deflection(0.5)) == pytest.approx(1.5 * 0.5 ** (1 / 3), rel=0.05)


@pytest.mark.filterwarnings("ignore:the points scatter")
def test_laws_fitted_to_points_go_on_to_their_force() -> None:
    """Smoothed or fitted, a law passes the last point below or above, which is a preload all the same."""
    below = 0
    for seed in range(12):
        force = np.sort(Z**1.5 * (1 + 0.005 * np.random.default_rng(seed).standard_normal(Z.size)))
        below += _noisy(seed).top < force[-1]
        for name in ("table", "paper"):
            law, load = law_from({"delta": Z, "force": force}, name, float(force[-1]))
            assert ContactOscillator(law, load=load).restoring.load == pytest.approx(force[-1], rel=1e-12)
            with pytest.raises(RangeError):
                ContactOscillator(law, load=1.05 * load)
    assert 3 <= below <= 9


@pytest.mark.parametrize(
    "z", [np.linspace(0, 1, 33)[1:], np.sort(np.r_[np.linspace(0, 1, 21)[1:], 0.0125, 0.025, 0.075]), Z]
)
def test_a_smooth_curve_is_not_noisy(z: np.ndarray) -> None:
    """Although no polynomial fits it in logarithms, like that of a rough surface."""
    second = np.maximum(z - 0.26, 0.0)  # the next summit is touched, then the block alone gives way
    assert CurveLaw(z, z**1.3 + 40 * second**1.5 / (1 + 6 * second)).noise == 0.0


def _noisy(seed: int) -> CurveLaw:
    """Half a percent of noise."""
    return CurveLaw(Z, np.sort(Z**1.5 * (1 + 0.005 * np.random.default_rng(seed).standard_normal(Z.size))))


def test_the_warning_of_noise_appears_once() -> None:
    """The laws without some of the points do not warn again."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        oscillator = ContactOscillator(_noisy(0))
        oscillator.taylor()
        oscillator.uncertainty()
    assert len(caught) == 1 and caught[0].filename == __file__


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
        law = unload_reload(curve, load)
        assert law.origin == pytest.approx(left, abs=1e-6)
        assert law.n_loc(law.deflection(load)) == pytest.approx(n, rel=1e-4)
    with pytest.raises(RangeError, match=r"preload = 1\.2 exceeds the unload-reload branch, which ends at force 1"):
        unload_reload(curve, 1.2)


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
        (lambda: PowerLaw(1e-3), "n = 0.001 is not legal: it must lie between 0.25 and 100"),
        (lambda: law_from({"delta": 1e-6 * Z, "force": Z**60}, "paper"), "K = inf"),
        (lambda: ContactOscillator(PowerLaw(0.25), load=1e300), "under load = 1e+300"),
        (lambda: ContactOscillator(PowerLaw(1.5), zeta=-0.01), "zeta = -0.01"),
        (lambda: ContactOscillator(PowerLaw(1.5), zeta=1.5), "zeta = 1.5"),
        (lambda: ContactOscillator(PowerLaw(1.5), load=0.0), "load = 0.0"),
        (lambda: ContactOscillator(PowerLaw(1.5), damping="coulomb"), "hunt-crossley"),
        (lambda: ContactOscillator(cast(Any, 1.5)), "law must be"),
        (lambda: CurveLaw(np.array([]), np.array([])), "empty"),
        (lambda: CurveLaw(Z[:2], Z[:2]), "at least 5"),
        (lambda: CurveLaw(Z, Z[::-1]), "force does not rise"),
        (lambda: CurveLaw(Z[::-1], Z[::-1]), "approach does not rise"),
        (lambda: CurveLaw(Z, np.where(Z > 0.5, np.nan, Z)), "not finite"),
        (lambda: CurveLaw(Z - 0.3, Z**1.5), "offset"),
        (lambda: CurveLaw(Z, Z[:5]), "shapes"),
        (lambda: unload_reload({"delta": Z, "force": Z}), "unload"),
        (lambda: law_from({"delta": Z}), "no column \"force\", only 'delta'"),
        (lambda: law_from({"delta": Z, "force": np.where(Z > 0.5, np.nan, Z)}), "row 30 of the curve is not finite"),
        (lambda: law_from({"delta": Z, "force": Z[:9]}), "60 values of delta and 9 of force"),
        (lambda: law_from({"delta": Z, "force": Z, "branch": ["loading"] * Z.size}), "branch 'loading'"),
        (lambda: law_from({"delta": [*(1.0 + Z), 2.2], "force": [*(Z - Z[0]), 1.2]}), "its origin is offset"),
        (lambda: law_from("nowhere.csv"), "nowhere.csv"),
        (lambda: law_from({"delta": Z, "force": Z}, law="hertz"), "hertz"),
        (lambda: law_from({"delta": Z, "force": np.where(Z > 0.5, Z - 0.3, Z)}, "paper"), "by more than 5 %"),
    ],
)
def test_bad_input_is_reported_in_one_sentence(build: Any, words: str) -> None:
    with pytest.raises(InputError) as error:
        build()
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_beyond_its_last_point_a_law_is_a_power_for_motion_only() -> None:
    law = CurveLaw(Z, Z**1.5)
    with pytest.raises(RangeError, match=r"approach 1.2 lies outside the law, known up to 1; compute the curve"):
        law.force(1.2)
    with pytest.raises(RangeError, match="load = 2 lies outside the law, which ends at force 1"):
        ContactOscillator(law, load=2.0)
    power = ContactOscillator(PowerLaw(1.5), load=0.5)
    np.testing.assert_allclose(ContactOscillator(law).free([0.9]).omega_ratio, power.free([0.9]).omega_ratio, rtol=1e-9)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e5])
def test_the_static_deflection_of_an_own_law_has_any_size(size: float) -> None:
    class Cubic(Law):
        def both(self, z: Any) -> Any:
            x = np.maximum(z, 0.0) / size
            return x + x**3, (1.0 + 3.0 * x**2) / size

        def potential(self, z: Any) -> Any:
            x = np.maximum(z, 0.0) / size
            return size * (x**2 / 2 + x**4 / 4)

        def derivatives(self, z: float) -> tuple[float, float, float]:
            return (1.0 + 3.0 * (z / size) ** 2) / size, 6.0 * z / size**3, 6.0 / size**3

        def describe(self) -> str:
            return "cubic"

    for x in (1e-3, 0.7, 20.0):
        assert Cubic().deflection(x + x**3) == pytest.approx(x * size, rel=1e-13)


def test_a_file_that_is_not_a_table_is_refused(tmp_path) -> None:
    path = tmp_path / "curve.csv"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match="cannot be read: it is no text"):
        CurveLaw.from_curve(path)
    with pytest.raises(InputError, match="not a number"):
        CurveLaw("approach", "force")


def test_an_own_law_may_have_a_kink_that_it_does_not_name() -> None:
    """Six times as stiff above 1.2: the free period of two linear springs in closed form."""

    class Bilinear(Law):
        def both(self, z: Any) -> Any:
            return np.maximum(z, 0.0) + 5.0 * np.maximum(np.asarray(z) - 1.2, 0.0), 1.0 + 5.0 * (np.asarray(z) > 1.2)

        def potential(self, z: Any) -> Any:
            return 0.5 * np.maximum(z, 0.0) ** 2 + 2.5 * np.maximum(np.asarray(z) - 1.2, 0.0) ** 2

        def derivatives(self, z: float) -> tuple[float, float, float]:
            return 1.0, 0.0, 0.0

        def describe(self) -> str:
            return "bilinear"

    low, centre = 0.7, 0.2 - 1.0 / 30.0  # amplitude on the soft side, equilibrium of the stiff spring
    high = np.sqrt((low**2 - 0.2**2) / 6.0 + 1.0 / 900.0)
    half = np.pi - np.arccos(0.2 / low) + np.arccos(1.0 / 30.0 / high) / np.sqrt(6.0)
    (orbit,) = ContactOscillator(Bilinear(), load=1.0).free([centre + high]).orbits
    assert orbit.u_min == pytest.approx(-low, rel=1e-7) and orbit.omega == pytest.approx(np.pi / half, rel=1e-7)
