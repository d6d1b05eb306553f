"""Whole analyses: files, units, refusals, jumps, motion of the base and short motions in physical units."""

from __future__ import annotations

import csv
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

import asperity as asp
from asperity.cli.dynamics import dynamics as command
from asperity.errors import AsperityError, ConvergenceError, InputError
from asperity.model.joint import Joint
from asperity.plot import plot_dynamics
from asperity.vibration import DynamicsSettings, PowerLaw, run_dynamics
from asperity.vibration.run import small_vibration

MINIMAL: dict[str, Any] = {
    "surface": {"kind": "flat", "L": 1e-6},
    "material": {"E": 200e9, "nu": 0.3},
    "loading": {"delta_max": 1e-8},
}


def test_run_writes_its_files_and_figures(tmp_path) -> None:
    law, out = PowerLaw(1.5, 2.0), tmp_path / "out"
    result = run_dynamics(law, zeta=0.2, forcing=[0.02, 0.04], omega=(0.9, 1.1), preload=3.0, out_dir=out)
    figures = {path.name for path in plot_dynamics(out)}
    assert figures == {f"{name}.svg" for name in ("frequency", "response", "receptance")}
    with (out / "free.csv").open() as file:
        assert {row["model"] for row in csv.DictReader(file)} == {"exact", "taylor"}
    with (out / "response.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["branch"] for row in rows} == {"1"}  # the one piece of a branch without folds
    assert all("nan" not in row.values() for row in rows)
    summary = json.loads((out / "thresholds.json").read_text())
    assert summary["omega_s"] == pytest.approx(np.sqrt(1.5 * 9.80665 / (3 / 2) ** (2 / 3)))
    assert summary["exact"]["n_loc"] == pytest.approx(1.5)
    assert len(result.responses["exact"]) == 2


def _curve_in(folder: Path, length: float, force: float, case: str = "") -> Path:
    """Write a run directory with the same Hertzian curve in other units, and its completed case."""
    folder.mkdir()
    delta = np.linspace(0, 20e-9, 21)[1:]
    rows = "".join(f"{length * d:.17g},{force * 3e8 * d**1.5:.17g}\n" for d in delta)
    (folder / "curve.csv").write_text(f"delta,force\n{rows}")
    if case:
        (folder / "case.toml").write_text(case)
    return folder


QUICK: dict[str, Any] = {"model": ["exact"], "omega": (0.9, 0.91)}


def test_gravity_belongs_to_the_units(tmp_path: Path) -> None:
    """In um, mN and s the unit of mass is 1000 kg, and the number of an acceleration is 1e6 times larger."""
    si = _curve_in(tmp_path / "si", 1.0, 1.0, 'units = "SI"\n')
    other = _curve_in(tmp_path / "other", 1e6, 1e3, 'units = "other"\n')
    first = run_dynamics(si, **QUICK).to_dict()
    assert first["gravity"] == 9.80665 and not any("assume" in note for note in first["notes"])
    assert first["omega_s"] == pytest.approx(np.sqrt(1.5 * 9.80665 / first["z_s"]), rel=1e-12)
    assert first["mass"] == pytest.approx(first["load"] / 9.80665, rel=1e-12)
    unknown = run_dynamics(other, out_dir=tmp_path / "out", **QUICK)
    written = json.loads((tmp_path / "out/thresholds.json").read_text())
    assert (written["gravity"], written["mass"], written["omega_s"]) == (None, None, None)
    assert written["notes"][0].startswith('mass and omega_s are left out: units = "other" needs gravity')
    assert np.isnan(unknown.oscillators["exact"].omega_s)

    given, _ = small_vibration(other, DynamicsSettings(gravity=9.80665e6))
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
    text = f'units = "SI"\n[surface]\nkind = "flat"\nL = 1e-6\n[dynamics]\n{given}\n'
    folder = _curve_in(tmp_path / "run", 1.0, 1.0, text)
    found = DynamicsSettings.of_source(folder)
    assert found == DynamicsSettings(
        law="table", preload=3e-5, forcing=(0.002, 0.004), model=("exact",), omega=(0.95, 1.05), zeta=(0.2,),
        units="SI", patch_area=1e-12,
    )  # fmt: skip
    other = run_dynamics(folder, law="paper", preload=2e-5, forcing=0.003, omega=(0.9, 0.91))
    assert other.choice is not None and other.choice.name == "paper" and other.first.load == 2e-5
    assert len(other.responses["exact"]) == 1
    joint = DynamicsSettings.of_source(folder, asp.Joint(nominal_area=3e-12, mass=1.0))
    assert joint.preload == pytest.approx(9e-5, rel=1e-12)


def test_the_case_of_a_former_version_is_refused_by_its_key(tmp_path: Path) -> None:
    for number, (section, key) in enumerate((("joint", "frequency"), ("joint", "damping"), ("dynamics", "overload"))):
        folder = _curve_in(tmp_path / str(number), 1.0, 1.0, f'units = "SI"\n[{section}]\n{key} = 0.1\n')
        with pytest.raises(InputError, match=rf"{section}.{key} is not a key of \[{section}\]"):
            DynamicsSettings.of_source(folder)


def test_units_assumed_for_a_curve_are_reported(tmp_path: Path) -> None:
    bare = _curve_in(tmp_path / "bare", 1.0, 1.0) / "curve.csv"
    result = run_dynamics(bare, **QUICK)
    assert result.gravity == 9.80665 and result.notes[0].startswith("mass and omega_s assume a curve in SI units")
    assert not any("assume" in note for note in run_dynamics(bare, units="SI", **QUICK).notes)
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
    with pytest.raises(InputError, match="units = 'cgs' is not legal"):
        run_dynamics(bare, units="cgs", **QUICK)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"damping": "no"}, "damping"),
        ({"preload": -1.0}, "load"),
        ({"forcing": ["2 N", 0.1]}, "give all with one unit"),
        ({"forcing": "2 K"}, "'2 K' is no number with the unit N"),
        ({"forcing": "2 N", "units": "other"}, 'forcing in N cannot go with units = "other"'),
        ({"omega": ["2 kHz", "1 kHz"]}, "give low < high"),
        ({"forcing": ("1 N", "1 m")}, "give all with one unit"),
        ({"forcing": "1 m", "simulate": "step"}, "simulate is for a force or an acceleration"),
        ({"omega": ("1e-6 Hz", "1 Hz")}, "omega = 1e-06 is not legal: it must lie between 0.006"),
        ({"simulate": "half-sine", "pulse": 1e-9}, "pulse = 1e-09 is not legal: it must lie between 0.008"),
    ],
)
def test_bad_arguments_write_nothing(tmp_path, options, words) -> None:
    with pytest.raises(InputError, match=words):
        run_dynamics(PowerLaw(1.5), out_dir=tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


TEN_TO = st.floats(-320, 308).map(lambda e: 10.0**e)


@settings(max_examples=12, deadline=None)
@given(
    st.one_of(st.floats(0.51, 100), TEN_TO),
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
        assert all(np.isfinite([*b.u_max, *b.u_min]).all() for r in result.responses["exact"] for b in r.pieces)


def test_force_in_newtons_window_in_hertz_several_dampings_and_jumps(tmp_path: Path) -> None:
    """The same response as with F^ and Omega, and the jumps of slow sweeps."""
    delta = np.linspace(0.0, 1e-7, 21)
    curve = {"delta": delta, "force": 400.0 * (delta / 1e-7) ** 2}
    joint = {"joint": Joint(preload=100.0, mass=2.0), "model": "exact", "units": "SI"}
    plain = run_dynamics(curve, forcing=0.02, omega=(0.8, 1.1), **joint)
    scale, hertz = plain.first.scale, plain.numbers.frequency
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
    assert same.peak == pytest.approx(light.peak, rel=1e-6) and other.equation.zeta == 0.05
    down, up = sorted(found.jumps(), key=lambda jump: float(jump["Omega"]))
    assert (down["sweep"], up["sweep"]) == ("down", "up")
    assert [j["frequency"] / hertz for j in (down, up)] == pytest.approx(sorted(e.Omega for e in light["fold"]))
    assert down["x_max"] > up["x_max_after"] > up["x_max"] > down["x_max_after"]
    assert len(json.loads((tmp_path / "thresholds.json").read_text())["jumps"]) == 2
    with pytest.raises(InputError, match="frequencies in Hz, pulses and accelerations need the mass"):
        run_dynamics(curve, omega=("1 Hz", "2 Hz"), joint=Joint(preload=100.0), model="exact")


def test_base_and_shock_in_physical_units(tmp_path: Path) -> None:
    """An acceleration of the base acts as the force m a; amplitudes in m, m/s^2 and s on the command line."""
    delta = np.linspace(0.0, 1e-7, 21)
    curve = {"delta": delta, "force": 400.0 * (delta / 1e-7) ** 2}
    more: dict[str, Any] = {"model": "exact", "units": "SI", "omega": (0.9, 1.1), "preload": 100.0}
    force = run_dynamics(curve, forcing="3 N", joint=Joint(mass=2.0), **more)
    moved = run_dynamics(curve, forcing="1.5 m/s^2", joint=Joint(mass=2.0), simulate="half-sine", pulse=1e-4, **more)
    assert moved.responses["exact"][0].peak == pytest.approx(force.responses["exact"][0].peak, rel=1e-9)
    path = moved.motions["half-sine"]
    assert path.tau[path.force > 0][-1] == pytest.approx(1e-4 * moved.first.omega_s, rel=0.05)

    file, out = tmp_path / "curve.csv", tmp_path / "out"
    file.write_text("delta,force\n" + "".join(f"{d},{f}\n" for d, f in zip(delta, curve["force"], strict=True)))
    arguments = [
        str(file),
        "--set",
        "joint.mass=2",
        "--set",
        "joint.preload=100",
        "--set",
        "dynamics.model=exact",
        "--set",
        "dynamics.omega=[0.9, 1.1]",
    ]
    done = CliRunner().invoke(
        command, [*arguments, "--set", "dynamics.forcing=1.5m/s2", "--set", "dynamics.simulate=step", "-o", str(out)]
    )
    assert done.exit_code == 0 and "transmissibility" in done.output and "step from rest" in done.output
    assert json.loads((out / "thresholds.json").read_text())["excitation"] == "acceleration"
    with (out / "response.csv").open() as rows:
        read = list(csv.DictReader(rows))
    assert max(float(row["transmissibility"]) for row in read) == pytest.approx(50.0, rel=0.1)
    assert {float(row["force"]) for row in read} == {3.0}
    with (out / "motion.csv").open() as rows:
        assert max(float(row["x"]) for row in csv.DictReader(rows)) > 0
    assert (out / "motion.svg").is_file()
    by_length = run_dynamics(curve, forcing="1 nm", joint=Joint(mass=2.0), **more)
    assert by_length.responses["exact"][0].equation.F_hat == pytest.approx(1e-9 / by_length.first.z_s)


def test_a_series_that_no_orbit_stays_in_is_left_out_with_a_note() -> None:
    """A strong shock: the law has its orbits and its motion, the series has none."""
    more: dict[str, Any] = {"forcing": 50.0, "omega": (0.9, 1.1), "tol": 1e-3, "simulate": "half-sine"}
    result = run_dynamics(PowerLaw(1.5), **more)
    assert [*result.oscillators] == [*result.free] == ["exact"] and result.motions["half-sine"].u.max() > 1.0
    (note,) = (note for note in result.notes if "left out" in note and note.startswith("taylor"))
    assert "no periodic orbit found" in note
    with pytest.raises(ConvergenceError, match="no periodic orbit"):
        run_dynamics(PowerLaw(1.5), model="taylor", **more)


def test_figures_without_a_stable_or_a_physical_orbit(tmp_path: Path) -> None:
    """One of two forcings has no stable orbit of period 1; a series with unphysical orbits alone."""
    z = np.linspace(0.05, 1.0, 20)
    curve, quick = {"delta": z, "force": z**1.5}, {"omega": (0.8, 1.1), "units": "other", "tol": 1e-3}
    both = run_dynamics(curve, forcing=(0.01, 2.04), model="exact", **quick)
    series = run_dynamics(PowerLaw(1.5), forcing=0.9, model="taylor", **quick)
    assert not any((b.u_min >= -1.0).any() for b in series.responses["taylor"][0].pieces)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        for result in (both, series):
            result.write(tmp_path)
            assert plot_dynamics(tmp_path)
