"""Time integration, sweeps, thresholds and result files."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import asperity as asp
from asperity.case import Case
from asperity.errors import AsperityError, InputError, RangeError
from asperity.plot import plot_dynamics
from asperity.vibration import ContactOscillator, DynamicsSettings, Joint, PowerLaw, run_dynamics
from asperity.vibration.run import small_vibration
from asperity.vibration.settings import forcings, window

MINIMAL: dict[str, Any] = {
    "surface": {"kind": "flat", "L": 1e-6},
    "material": {"E": 200e9, "nu": 0.3},
    "loading": {"delta_max": 1e-8},
}


def test_simulate_flight_is_a_parabola() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.0)
    path = o.simulate(1.0, 0.0, u=2.0, periods=3.0)
    r = o.restoring
    energy = 0.5 * path.v**2 + o.law.potential(r.z_s * (1.0 + path.u)) / (r.scale * r.z_s) - path.u / r.n_loc
    assert np.ptp(energy) < 1e-9
    orbit = o.free(2.0).orbits[0]
    assert path.u.min() == pytest.approx(orbit.u_min, rel=1e-9)
    length = np.diff(path.flight[0])[0]
    assert length == pytest.approx(2 * 1.5 * orbit.v_s, rel=1e-9)
    assert np.all(path.u[(path.tau > path.flight[0, 0] + 1e-9) & (path.tau < path.flight[0, 1] - 1e-9)] < -1)


def test_free_decay_has_the_damping_ratio() -> None:
    zeta = 0.02
    path = ContactOscillator(PowerLaw(1.5), zeta=zeta).simulate(1.0, 0.0, u=0.01, periods=10.0, samples=256)
    peaks = path.u[1:-1][(path.u[1:-1] > path.u[:-2]) & (path.u[1:-1] > path.u[2:])]
    ratio = np.log(peaks[0] / peaks[5]) / 5
    assert ratio == pytest.approx(2 * np.pi * zeta / np.sqrt(1 - zeta**2), rel=1e-3)


@pytest.mark.parametrize("zeta", [0.3, 0.03])
def test_sweeps_lie_on_the_stable_branches(zeta: float) -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=zeta)
    up, down = o.sweep(0.1, (0.7, 1.2), points=26)
    r = o.response(0.1, (0.7, 1.2))
    for s in (up, down):
        assert set(s.status) == {"settled"}
        for omega, *found in zip(s.Omega, s.u_max, s.u_min, strict=True):
            nearest = min((x for x in r.at(omega) if x.stable), key=lambda x: abs(x.u_max - found[0]))
            assert found == pytest.approx([nearest.u_max, nearest.u_min], rel=2e-4)
    if zeta > 0.1:
        return
    folds = sorted(e.Omega for e in r["fold"])
    inside = (up.Omega > folds[0]) & (up.Omega < folds[-1])
    jumps = np.abs(up.u_max[inside] - down.u_max[::-1][inside])
    assert inside.any() and bool(np.all(jumps > 0.1))


def test_sweep_reports_period_two_and_what_has_not_settled() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.03)
    (down,) = o.sweep(0.9, (1.9, 2.1), points=5, directions=("down",))
    assert "period 2" in down.status
    (up,) = replace(o, zeta=1e-3).sweep(0.02, (0.95, 1.0), points=3, directions=("up",), max_periods=5)
    assert "not settled" in up.status and not all(row["stable"] for row in up.rows())
    for most in (5, 7, 30):
        (up,) = replace(o, zeta=1e-2).sweep(0.02, (0.95, 1.0), points=3, directions=("up",), max_periods=most)
        assert "not settled" in up.status and up.periods.max() == most


def test_taylor_sweep_reports_its_escape() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.02).taylor()
    (down,) = o.sweep(0.2, (0.5, 1.2), points=15, directions=("down",))
    assert "escaped" in down.status and not down.valid.all()
    rows = list(down.rows())
    assert len(rows) == sum(s != "escaped" for s in down.status)
    assert all(np.isfinite(row["u_max"]) for row in rows)
    with pytest.raises(RangeError, match="escapes"):
        o.simulate(1.0, 0.0, u=2.0, periods=20)
    assert o.simulate(1.0, 0.03).valid and not o.simulate(0.9, 0.3, periods=1.0, u=1.2).valid
    damped = replace(o, zeta=0.05)
    assert damped.thresholds(0.03).valid and not damped.thresholds(0.1).valid


@pytest.mark.parametrize(("n", "drive"), [(1.2, 0.94898), (1.5, 0.88652), (3.0, 0.70205)])
def test_onset_of_contact_loss(n: float, drive: float) -> None:
    t = ContactOscillator(PowerLaw(n), zeta=0.01).thresholds()
    assert t.drive_loss == pytest.approx(drive, abs=6e-6)
    assert t.contact_loss == pytest.approx(0.02 * drive, rel=1e-4)
    assert t.u_max == pytest.approx((n + 1) ** (1 / n) - 1, rel=1e-12)
    assert t.hysteresis == pytest.approx(np.sqrt(32e-6 / (3 * np.sqrt(3) * abs(t.kappa))), rel=1e-12)


def test_the_damping_model_determines_whether_resonance_is_limited() -> None:
    always, contact, force = (
        ContactOscillator(PowerLaw(1.5), damping=d).thresholds(0.05) for d in ("always", "contact", "hunt-crossley")
    )
    assert contact.peaks[0]["u_max"] is None and always.peaks[0]["u_max"] is not None
    # proportional to the contact force: the same loss, since INT f u'^2 dtau vanishes on a free orbit
    assert force.peaks[0]["u_max"] == pytest.approx(always.peaks[0]["u_max"], rel=1e-6)


def test_hardening_needs_n_below_one() -> None:
    words = [ContactOscillator(PowerLaw(n)).thresholds().softening for n in (0.9, 1.0, 1.1)]
    assert words == ["hardening", "linear", "softening"]
    omega = ContactOscillator(PowerLaw(0.8)).free(np.linspace(0.015, 3.0, 200)).omega_ratio
    assert np.sum(np.diff(np.sign(np.diff(omega))) != 0) == 1 and omega.max() > 1  # contact loss softens in the end


def test_run_writes_its_files_and_figures(tmp_path) -> None:
    law, out = PowerLaw(1.5, 2.0), tmp_path / "out"
    result = run_dynamics(law, zeta=0.2, forcing=[0.02, 0.04], omega=(0.9, 1.1), preload=3.0, sweeps=True, out_dir=out)
    figures = {path.name for path in plot_dynamics(result, tmp_path)}
    assert figures == {f"{name}.svg" for name in ("frequency", "response", "receptance")}
    with (out / "free.csv").open() as file:
        assert {row["model"] for row in csv.DictReader(file)} == {"exact", "taylor"}
    with (out / "response.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["branch"] for row in rows} == {"main", "sweep-up", "sweep-down"}
    assert all("nan" not in row.values() for row in rows)
    summary = json.loads((out / "thresholds.json").read_text())
    assert summary["omega_s"] == pytest.approx(np.sqrt(1.5 * 9.80665 / (3 / 2) ** (2 / 3)))
    assert summary["exact"]["F_over_mg"] == pytest.approx(1.5)
    assert summary["uncertainty"] is None and len(result.responses["exact"]) == 2


def _curve_in(folder: Path, length: float, force: float, case: str = "") -> Path:
    """Write a run directory with the same Hertzian curve in other units, and its completed case."""
    folder.mkdir()
    delta = np.linspace(0, 20e-9, 21)[1:]
    rows = "".join(f"{length * d:.17g},{force * 3e8 * d**1.5:.17g}\n" for d in delta)
    (folder / "curve.csv").write_text(f"delta,force\n{rows}")
    if case:
        (folder / "case.toml").write_text(case)
    return folder


QUICK: dict[str, Any] = {"model": ["exact"], "omega": (0.9, 0.91), "sweeps": False}


def test_gravity_belongs_to_the_units(tmp_path: Path) -> None:
    """In um, mN and s the unit of mass is 1000 kg, and the number of an acceleration is 1e6 times larger."""
    si = _curve_in(tmp_path / "si", 1.0, 1.0, 'units = "SI"\n')
    other = _curve_in(tmp_path / "other", 1e6, 1e3, 'units = "other"\n')
    first = run_dynamics(si, **QUICK).to_dict()
    assert first["gravity"] == 9.80665 and first["notes"] == []
    assert first["omega_s"] == pytest.approx(np.sqrt(1.5 * 9.80665 / first["z_s"]), rel=1e-12)
    assert first["mass"] == pytest.approx(first["load"] / 9.80665, rel=1e-12)
    unknown = run_dynamics(other, out_dir=tmp_path / "out", **QUICK)
    written = json.loads((tmp_path / "out/thresholds.json").read_text())
    assert (written["gravity"], written["mass"], written["omega_s"]) == (None, None, None)
    assert written["uncertainty"]["omega_s"] is None
    assert written["notes"][0].startswith('mass and omega_s are left out: units = "other" needs gravity')
    assert np.isnan(unknown.oscillators["exact"].omega_s) and np.isnan(unknown.free["exact"].omega_s)

    given = small_vibration(other, DynamicsSettings(gravity=9.80665e6))
    assert 2 * np.pi * given.frequency == pytest.approx(first["omega_s"], rel=1e-9)
    assert given.mass * 1e-3 == pytest.approx(first["mass"] * 1e-6, rel=1e-9)
    # all that has no dimension is the same, known or not
    assert written["n_loc"] == pytest.approx(first["n_loc"], rel=1e-9)
    assert written["exact"]["responses"][0]["peak"] == pytest.approx(first["exact"]["responses"][0]["peak"], rel=1e-6)


def test_the_case_of_a_run_gives_what_is_not_given(tmp_path: Path) -> None:
    """Arguments have priority; the preload of a patch becomes that of the joint."""
    given = (
        'law = "table"\npreload = 3e-5\nforcing = [0.002, 0.004]\nmodel = ["exact"]\nomega = [0.95, 1.05]\nzeta = 0.2'
    )
    text = f'units = "SI"\n[surface]\nkind = "flat"\nL = 1e-6\n[dynamics]\n{given}\nsweeps = true\n'
    folder = _curve_in(tmp_path / "run", 1.0, 1.0, text)
    found = DynamicsSettings.of_source(folder)
    assert found == DynamicsSettings(
        law="table", preload=3e-5, forcing=(0.002, 0.004), model=("exact",), omega=(0.95, 1.05), zeta=(0.2,),
        sweeps=True, units="SI", patch_area=1e-12,
    )  # fmt: skip
    other = run_dynamics(folder, law="paper", preload=2e-5, forcing=0.003, omega=(0.9, 0.91), sweeps=False)
    assert other.laws is not None and other.laws.choice.name == "paper" and other.first.restoring.load == 2e-5
    assert len(other.responses["exact"]) == 1 and other.sweeps["exact"] == ()
    joint = DynamicsSettings.of_source(folder, asp.Joint(nominal_area=3e-12, mass=1.0))
    assert joint.preload == pytest.approx(9e-5, rel=1e-12)


def test_the_case_of_a_former_version_is_refused_by_its_key(tmp_path: Path) -> None:
    for number, (section, key) in enumerate((("joint", "frequency"), ("joint", "damping"), ("dynamics", "overload"))):
        folder = _curve_in(tmp_path / str(number), 1.0, 1.0, f'units = "SI"\n[{section}]\n{key} = 0.1\n')
        with pytest.raises(InputError, match=f"{key} is no setting of the vibration: choose from .* former version"):
            DynamicsSettings.of_source(folder)


def test_small_vibration_needs_no_loops(tmp_path: Path) -> None:
    folder = _curve_in(tmp_path / "run", 1.0, 1.0, 'units = "SI"\n[dynamics]\ndamping = "loops"\n')
    given = DynamicsSettings.of_source(folder)
    found, expected = (small_vibration(folder, one) for one in (given, replace(given, damping="always")))
    assert found.to_dict() == expected.to_dict()


def test_units_assumed_for_a_curve_are_reported(tmp_path: Path) -> None:
    bare = _curve_in(tmp_path / "bare", 1.0, 1.0) / "curve.csv"
    result = run_dynamics(bare, **QUICK)
    assert result.gravity == 9.80665 and result.notes[0].startswith("mass and omega_s assume a curve in SI units")
    assert run_dynamics(bare, units="SI", **QUICK).notes == ()
    (note,) = run_dynamics(PowerLaw(1.5), **QUICK).notes
    assert note.startswith("mass and omega_s assume a law in SI units, gravity = 9.80665")
    assumed = "amounts with units assume a curve in SI units"
    for changes in (
        {"forcing": "0.1 nm", "gravity": 9810.0}, {"forcing": "0.1 mN", "joint": Joint(mass=1.0)},
        {"forcing": "0.1 mm/s^2", "joint": Joint(mass=1.0)}, {"omega": ("9 Hz", "10 Hz"), "joint": Joint(mass=0.05)},
    ):  # fmt: skip
        for units, count in ((None, 1), ("SI", 0)):
            found = run_dynamics(bare, **QUICK | changes, units=units).notes
            assert sum(note.startswith(assumed) for note in found) == count, (changes, found)
    with pytest.raises(InputError, match='units = "cgs" is unknown'):
        run_dynamics(bare, units="cgs", **QUICK)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"forcing": []}, "forcing"),
        ({"model": ["cubic"]}, "cubic"),
        ({"model": []}, "model"),
        ({"damping": "no"}, "damping"),
        ({"preload": -1.0}, "load"),
        ({"gravity": 0.0}, "gravity = 0.* is not legal"),
        ({"omega": (1e-5, 1.3)}, "omega = 1e-05 is not legal: it must lie between 0.01 and 100"),
        ({"forcing": [0.1, 1e-300]}, "forcing = 1e-300"),
        ({"forcing": ["2 N", 0.1]}, "give all with one unit"),
        ({"forcing": "2 K"}, "'2 K' is no number with the unit N"),
        ({"forcing": "2 N", "units": "other"}, 'forcing in N cannot go with units = "other"'),
        ({"omega": ["2 kHz", "1 kHz"]}, "give low < high"),
        ({"forcing": ("1 N", "1 m")}, "give all with one unit"),
        ({"forcing": "1 m", "simulate": "step"}, "simulate is for a force or an acceleration"),
        ({"simulate": "saw"}, 'simulate = "saw" is unknown'),
        ({"omega": ("1e-6 Hz", "1 Hz")}, "omega = 1e-06 is not legal: it must lie between 0.006"),
        ({"simulate": "half-sine", "pulse": 1e-9}, "pulse = 1e-09 is not legal: it must lie between 0.008"),
        ({"simulate": "chirp", "span": 1e6}, "span = 1e[+]06 is not legal: it must lie between 0.001 and 10000"),
        ({"zeta": 1e-6}, "zeta = 1e-06 is not legal: it must lie between 0.0001 and 0.9999"),
    ],
)
def test_bad_arguments_write_nothing(tmp_path, options, words) -> None:
    with pytest.raises(InputError, match=words):
        run_dynamics(PowerLaw(1.5), out_dir=tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda o: o.response("much"), "forcing = 'much'"),
        (lambda o: o.response(0.1, tol=0.0), "tol = 0"),
        (lambda o: o.simulate(1.0, 0.1, u=np.nan), "state u = nan"),
        (lambda o: o.free(np.nan), "u0 = nan"),
        (lambda o: o.free([]), "u0 is empty"),
        (lambda o: o.response(-0.1), "forcing = -0.1"),
        (lambda o: o.response(0.1, (1.3, 0.5)), "omega"),
        (lambda o: o.response(0.1, (0.5,)), "omega"),
        (lambda o: o.response(0.05, (0.9, 0.91)).at(2.0), "outside the computed window"),
        (lambda o: o.sweep([]), "forcing"),
        (lambda o: o.sweep(0.1, directions=("left",)), "left"),
        (lambda o: o.sweep(0.1, points=1), "points"),
        (lambda o: o.sweep(0.1, max_periods=4), "max_periods = 4 is not legal: it must lie between 5"),
        (lambda o: replace(o, zeta=0.0).response(0.1), "zeta of forced motion = 0.* is not legal"),
        (lambda o: o.simulate(1e-9, 0.1), "omega = 1e-09"),
        (lambda o: o.simulate(1.0, 1e300), r"forcing = 1e\+300"),
    ],
)
def test_bad_calls_are_refused_in_one_sentence(call, words) -> None:
    with pytest.raises(InputError, match=words):
        call(ContactOscillator(PowerLaw(1.5)))


TEN_TO = st.floats(-320, 308).map(lambda e: 10.0**e)


@settings(max_examples=12, deadline=None)
@given(
    st.one_of(st.floats(0.25, 100), TEN_TO),
    st.one_of(st.just(1.0), TEN_TO),
    st.fixed_dictionaries(
        {"zeta": st.one_of(st.floats(0.001, 0.999), TEN_TO), "forcing": st.one_of(st.floats(1e-9, 1.0), TEN_TO)},
        optional={"load": TEN_TO, "damping": st.sampled_from(["always", "contact", "hunt-crossley"])},
    ),
)
def test_any_input_gives_finite_results_or_an_error_message(n: float, K: float, options: dict[str, Any]) -> None:
    try:
        result = run_dynamics(PowerLaw(n, K), omega=(0.95, 1.05), **options)
    except AsperityError as error:
        assert "\n" not in str(error)
    else:
        json.dumps(result.to_dict(), allow_nan=False)
        assert all(np.isfinite([*b.u_max, *b.u_min]).all() for r in result.responses["exact"] for b in r.branches)


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.one_of(st.floats(), TEN_TO), min_size=2, max_size=2),
    st.lists(st.one_of(st.floats(), TEN_TO), min_size=1, max_size=3),
)
def test_a_case_accepts_the_legal_frequencies_and_forcings(omega: list[float], forcing: list[float]) -> None:
    for key, value, allow in (("omega", omega, window), ("forcing", forcing, forcings)):
        try:
            allow(value)
            legal = True
        except InputError:
            legal = False
        try:
            Case.from_dict({**MINIMAL, "dynamics": {key: value}})
            assert legal
        except InputError as error:
            assert not legal and f"dynamics.{key}" in str(error)


def test_force_in_newtons_window_in_hertz_several_dampings_and_jumps(tmp_path: Path) -> None:
    """The same response as with F^ and Omega, and jumps where sweeps in time jump."""
    delta = np.linspace(0.0, 1e-7, 21)
    curve = {"delta": delta, "force": 400.0 * (delta / 1e-7) ** 2}
    joint = {"joint": Joint(preload=100.0, mass=2.0), "model": "exact", "units": "SI"}
    plain = run_dynamics(curve, forcing=0.02, omega=(0.8, 1.1), **joint)
    scale, hertz = plain.first.restoring.scale, plain.numbers.frequency
    found = run_dynamics(
        curve,
        forcing=f"{0.02 * scale} N",
        omega=(f"{8e-4 * hertz} kHz", f"{1.1 * hertz}Hz"),
        zeta=(0.01, 0.05),
        out_dir=tmp_path,
        **joint,
    )
    same, other = found.responses["exact"]
    light = plain.responses["exact"][0]
    assert same.peak == pytest.approx(light.peak, rel=1e-6) and other.setting.zeta == 0.05
    down, up = sorted(found.jumps(), key=lambda jump: float(jump["Omega"]))
    assert (down["sweep"], up["sweep"]) == ("down", "up")
    assert [j["frequency"] / hertz for j in (down, up)] == pytest.approx(sorted(e.Omega for e in light["fold"]))
    assert down["x_max"] > up["x_max_after"] > up["x_max"] > down["x_max_after"]
    sweep = {s.direction: s for s in found.first.sweep(0.02, (0.83, 0.98), points=61)}
    for jump in (down, up):
        s = sweep[jump["sweep"]]
        at = int(np.abs(np.diff(s.u_max)).argmax())
        assert min(s.Omega[at : at + 2]) - 1e-3 <= jump["Omega"] <= max(s.Omega[at : at + 2]) + 1e-3
    assert len(json.loads((tmp_path / "thresholds.json").read_text())["jumps"]) == 2
    with pytest.raises(InputError, match="frequencies in Hz, pulses and accelerations need the mass"):
        run_dynamics(curve, omega=("1 Hz", "2 Hz"), joint=Joint(preload=100.0), model="exact")


def test_the_end_of_a_window_is_no_peak() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.02)
    assert o.response(0.01, (0.8, 1.2)).has_peak and not o.response(0.01, (1.1, 1.2)).has_peak
