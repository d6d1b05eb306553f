"""Whole analyses: files, units, joints, jumps, motion of the base and short motions in physical units."""

from __future__ import annotations

import csv
import json
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import asperity as asp
from asperity.case import Case
from asperity.cli.dynamics import dynamics as command
from asperity.errors import ConvergenceError, InputError
from asperity.model.joint import Joint
from asperity.output.results import Results
from asperity.plot import plot_dynamics
from asperity.plot.vibration import response as figure_of_response
from asperity.vibration import ContactOscillator, DynamicsSettings, PowerLaw, run_dynamics
from asperity.vibration.run import small_vibration

QUICK: dict[str, Any] = {"model": "exact", "omega": (0.9, 0.91), "tol": 1e-3}
DELTA = np.linspace(0.0, 1e-7, 21)
SQUARE = {"delta": DELTA, "force": 400.0 * (DELTA / 1e-7) ** 2}
SPHERE: dict[str, Any] = {
    "surface": {"kind": "sphere", "L": 1e-6, "radius": 1e-5}, "material": {"E": 200e9, "nu": 0.3}
}  # fmt: skip


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def curve_in(folder: Path, length: float, force: float, case: str = "") -> Path:
    """Write a run directory with the same Hertzian curve in other units, and its completed case."""
    folder.mkdir()
    delta = np.linspace(0, 20e-9, 21)[1:]
    text = "".join(f"{length * d:.17g},{force * 3e8 * d**1.5:.17g}\n" for d in delta)
    (folder / "curve.csv").write_text(f"delta,force\n{text}")
    if case:
        (folder / "case.toml").write_text(case)
    return folder


def test_run_writes_its_files_and_figures(tmp_path: Path) -> None:
    law, out = PowerLaw(1.5, 2.0), tmp_path / "out"
    result = run_dynamics(law, zeta=0.2, forcing=[0.02, 0.04], omega=(0.9, 1.1), preload=3.0, out_dir=out)
    figures = {path.name for path in plot_dynamics(out)}
    assert figures == {f"{name}.svg" for name in ("frequency", "response", "receptance")}
    assert {row["model"] for row in rows(out / "free.csv")} == {"exact", "taylor"}
    assert {row["branch"] for row in rows(out / "response.csv")} == {"1"}  # the one piece of a branch without folds
    assert all("nan" not in row.values() for row in rows(out / "response.csv"))
    summary = json.loads((out / "thresholds.json").read_text())
    assert summary["omega_s"] == pytest.approx(np.sqrt(1.5 * 9.80665 / (3 / 2) ** (2 / 3)))
    assert summary["exact"]["n_loc"] == pytest.approx(1.5) and len(result.responses["exact"]) == 2


# --- units and settings ---------------------------------------------------------------------------------------


def test_gravity_belongs_to_the_units(tmp_path: Path) -> None:
    """In um, mN and s the unit of mass is 1000 kg, and the number of an acceleration is 1e6 times larger."""
    si = curve_in(tmp_path / "si", 1.0, 1.0, 'units = "SI"\n')
    other = curve_in(tmp_path / "other", 1e6, 1e3, 'units = "other"\n')
    first = run_dynamics(si, **QUICK).to_dict()
    assert first["gravity"] == 9.80665 and not any("assume" in note for note in first["notes"])
    assert first["omega_s"] == pytest.approx(np.sqrt(1.5 * 9.80665 / first["z_s"]), rel=1e-12)
    assert first["mass"] == pytest.approx(first["load"] / 9.80665, rel=1e-12)
    run_dynamics(other, out_dir=tmp_path / "out", **QUICK)
    written = json.loads((tmp_path / "out/thresholds.json").read_text())
    assert (written["gravity"], written["mass"], written["omega_s"]) == (None, None, None)
    assert any("needs gravity" in note for note in written["notes"])
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
    folder = curve_in(tmp_path / "run", 1.0, 1.0, text)
    assert DynamicsSettings.of_source(folder) == DynamicsSettings(
        law="table", preload=3e-5, forcing=(0.002, 0.004), model=("exact",), omega=(0.95, 1.05), zeta=(0.2,),
        units="SI", patch_area=1e-12,
    )  # fmt: skip
    other = run_dynamics(folder, law="paper", preload=2e-5, forcing=0.003, omega=(0.9, 0.91))
    assert other.choice is not None and other.choice.name == "paper" and other.first.load == 2e-5
    assert len(other.responses["exact"]) == 1
    joint = DynamicsSettings.of_source(folder, Joint(nominal_area=3e-12, mass=1.0))
    assert joint.preload == pytest.approx(9e-5, rel=1e-12)
    case = Case.from_dict({**SPHERE, "loading": {"delta_max": 1e-8}, "dynamics": {}})
    assert DynamicsSettings.of_case(case.to_dict()) == DynamicsSettings(units="SI", patch_area=1e-12)


def test_units_assumed_for_a_curve_are_reported(tmp_path: Path) -> None:
    bare = curve_in(tmp_path / "bare", 1.0, 1.0) / "curve.csv"
    for source, units, told in ((bare, None, True), (bare, "SI", False), (PowerLaw(1.5), None, True)):
        result = run_dynamics(source, units=units, **QUICK)
        assert result.gravity == 9.80665 and bool(result.notes and "in SI units" in result.notes[0]) == told
    for changes in (
        {"forcing": "0.1 nm", "gravity": 9810.0}, {"omega": ("9 Hz", "10 Hz"), "joint": Joint(mass=0.05)},
    ):  # fmt: skip
        for units, count in ((None, 1), ("SI", 0)):
            found = run_dynamics(bare, **QUICK | changes, units=units).notes
            assert sum("amounts with units assume" in note for note in found) == count, (changes, found)


def test_force_in_newtons_window_in_hertz_several_dampings_and_jumps(tmp_path: Path) -> None:
    """The same response as with F^ and Omega, and the jumps of slow sweeps."""
    joint: dict[str, Any] = {"joint": Joint(preload=100.0, mass=2.0), "model": "exact", "units": "SI"}
    plain = run_dynamics(SQUARE, forcing=0.02, omega=(0.8, 1.1), **joint)
    scale, hertz = plain.first.scale, plain.numbers.frequency
    window = f"{8e-4 * hertz} kHz", f"{1.1 * hertz}Hz"
    found = run_dynamics(
        SQUARE, forcing=f"{0.02 * scale} N", omega=window, zeta=(0.01, 0.05), out_dir=tmp_path, **joint
    )
    same, other = found.responses["exact"]
    light = plain.responses["exact"][0]
    assert same.peak == pytest.approx(light.peak, rel=1e-6) and other.equation.zeta == 0.05
    down, up = sorted(found.jumps(), key=lambda jump: float(jump["Omega"]))
    assert (down["sweep"], up["sweep"]) == ("down", "up")
    assert [j["frequency"] / hertz for j in (down, up)] == pytest.approx(sorted(e.Omega for e in light["fold"]))
    assert down["x_max"] > up["x_max_after"] > up["x_max"] > down["x_max_after"]
    assert len(json.loads((tmp_path / "thresholds.json").read_text())["jumps"]) == 2


def test_base_and_shock_in_physical_units(tmp_path: Path) -> None:
    """An acceleration of the base acts as the force m a; amplitudes in m, m/s^2 and s on the command line."""
    more: dict[str, Any] = {"model": "exact", "units": "SI", "omega": (0.9, 1.1), "preload": 100.0}
    force = run_dynamics(SQUARE, forcing="3 N", joint=Joint(mass=2.0), **more)
    moved = run_dynamics(SQUARE, forcing="1.5 m/s^2", joint=Joint(mass=2.0), simulate="half-sine", pulse=1e-4, **more)
    assert moved.responses["exact"][0].peak == pytest.approx(force.responses["exact"][0].peak, rel=1e-9)
    path = moved.motions["half-sine"]
    assert path.tau[path.force > 0][-1] == pytest.approx(1e-4 * moved.first.omega_s, rel=0.05)
    by_length = run_dynamics(SQUARE, forcing="1 nm", joint=Joint(mass=2.0), **more)
    assert by_length.responses["exact"][0].equation.F_hat == pytest.approx(1e-9 / by_length.first.z_s)

    file, out = tmp_path / "curve.csv", tmp_path / "out"
    np.savetxt(file, np.transpose([*SQUARE.values()]), delimiter=",", header="delta,force", comments="")
    keys = ["joint.mass=2", "joint.preload=100", "dynamics.model=exact", "dynamics.omega=[0.9, 1.1]"]
    keys += ["dynamics.forcing=1.5m/s2", "dynamics.simulate=step"]
    done = CliRunner().invoke(command, [str(file), *(word for key in keys for word in ("--set", key)), "-o", str(out)])
    assert done.exit_code == 0 and "transmissibility" in done.output and "step from rest" in done.output
    assert json.loads((out / "thresholds.json").read_text())["excitation"] == "acceleration"
    read = rows(out / "response.csv")
    assert max(float(row["transmissibility"]) for row in read) == pytest.approx(50.0, rel=0.1)
    assert {float(row["force"]) for row in read} == {3.0}
    assert max(float(row["x"]) for row in rows(out / "motion.csv")) > 0 and (out / "motion.svg").is_file()


# --- the joint ------------------------------------------------------------------------------------------------


def test_a_joint_is_that_of_its_interface(tmp_path: Path) -> None:
    """Twenty patches with a spring in series: the joint has the stiffness, law and frequency of the contact alone."""
    up = np.linspace(0.0, 1.0, 41)[1:]
    force, c, area = up**1.5, 0.4, 20.0
    plain = {"delta": up, "force": force, "k_n_elastic": 1.5 * force ** (1 / 3), "max_plastic_strain": 0.0 * up}
    both = plain | {"delta": up + c * force, "k_n_elastic": 1 / (1 / plain["k_n_elastic"] + c)}
    joint, patch = Joint(preload=5.0, nominal_area=area, mass=2.0), {"patch_area": 1.0, "zeta": 0.03}
    results = [
        run_dynamics(curve, joint=joint, block=block, out_dir=tmp_path, units="SI", **patch, **QUICK)
        for curve, block in ((plain, 0.0), (both, c))
    ]
    alone, found = (result.numbers for result in results)
    k, z = area * 1.5 * 0.25 ** (1 / 3), 0.25 ** (2 / 3)
    assert found.stiffness == pytest.approx(k, rel=1e-6) == alone.stiffness
    assert found.frequency == pytest.approx(math.sqrt(k / 2.0) / (2 * math.pi), rel=1e-6)
    assert (found.n, found.kappa, found.approach) == pytest.approx((1.5, -1 / 24, z), rel=1e-3)
    assert (found.mass, found.damping) == (2.0, 0.03)
    assert found.with_block == pytest.approx(1 / (1 / k + c / area), rel=1e-6) and alone.with_block == alone.stiffness
    there = {"delta": [*up, *up[-2::-1]], "force": [*force, *force[-2::-1]], "branch": ["load"] * 40 + ["unload"] * 39}
    assert run_dynamics(there, joint=joint, **patch, **QUICK).numbers.greatest == pytest.approx(area)
    # a patch without a joint keeps its block; what has no dimension does not depend on area and mass
    one = run_dynamics(both, preload=0.25, **QUICK).numbers
    assert one.stiffness == pytest.approx(found.with_block / area, rel=1e-3)
    peak = run_dynamics(plain, preload=0.25, zeta=0.03, **QUICK).responses["exact"][0].peak
    assert results[0].responses["exact"][0].peak[1] == pytest.approx(peak[1], rel=1e-6)
    # files hold hertz, newtons and metres
    f, z_s, scale = found.frequency, found.approach, results[1].first.scale
    for row in rows(tmp_path / "response.csv"):
        expected = f * float(row["Omega"]), z_s * float(row["u_max"]), 0.01 * scale
        assert [float(row[name]) for name in ("frequency", "x_max", "force")] == pytest.approx(expected, rel=1e-6)
    row = rows(tmp_path / "free.csv")[0]
    assert float(row["frequency"]) == pytest.approx(f * float(row["omega_ratio"]), rel=1e-6)
    unknown = run_dynamics(plain, joint=Joint(preload=0.25), out_dir=tmp_path, **QUICK)
    assert math.isnan(unknown.numbers.mass) and any("joint.mass" in note for note in unknown.notes)
    assert rows(tmp_path / "response.csv")[0]["frequency"] == ""


def test_a_joint_counts_in_whatever_way_it_is_given() -> None:
    joint, law = Joint(preload=250.0, mass=5.0), PowerLaw(1.5, 3e11)
    z = (250.0 / 3e11) ** (1 / 1.5)
    ways: tuple[tuple[DynamicsSettings | None, dict[str, Any]], ...] = (
        (None, {"joint": joint}), (DynamicsSettings(joint=joint), {}), (DynamicsSettings(), {"joint": joint})
    )  # fmt: skip
    for given, changes in ways:
        found = run_dynamics(law, given, **QUICK, **changes).numbers
        assert found.approach == pytest.approx(z, rel=1e-12)
        assert found.frequency == pytest.approx(math.sqrt(1.5 * 250.0 / z / 5.0) / (2 * math.pi), rel=1e-12)
    assert Joint(pressure=2.0, mass=3.0).load(1e-12) == pytest.approx(2e-12)
    assert Joint(mass=3.0).load(None) is None


def test_the_overload_of_a_joint_is_the_greatest_load() -> None:
    joint = {"nominal_area": 1e-4, "preload": 300.0}
    for more, loading, pressure in (({}, {}, 3.6e6), ({"overload": 2.0}, {}, 6e6), ({}, {"pressure_max": 5e6}, 5e6)):
        case = Case.from_dict(SPHERE | {"joint": joint | more, "loading": loading})
        assert case.loading.pressure_max == pytest.approx(pressure)
    with pytest.raises(InputError, match="are all missing"):
        Case.from_dict(SPHERE | {"joint": {"mass": 1.0}, "loading": {}})


# --- figures --------------------------------------------------------------------------------------------------


def test_the_figure_shades_what_the_bar_of_the_stiffness_makes_of_the_stable_response() -> None:
    """Laws of any stiffness in the bar, each solved on its own, lie in it; no unstable orbit between branches does."""
    o = ContactOscillator(PowerLaw(1.5), load=1.0, zeta=0.01)
    orbits = list(o.response(0.02, (0.7, 1.35)).rows())
    columns = {name: np.array([row[name] for row in orbits]) for name in orbits[0]}
    results = Results(
        Path(), asp.Curve.from_rows([]), response=columns, thresholds={"numbers": {"k_n_bar": 0.03}}
    )  # fmt: skip
    shaded = [patch.get_path() for patch in figure_of_response(results).axes[0].patches]
    for stiffer in (0.975, 1.0, 1.025):
        one = ContactOscillator(PowerLaw(1.5, stiffer**1.5), load=1.0, zeta=0.01)
        ratio, size = one.omega_s / o.omega_s, one.z_s / o.z_s
        assert ratio**2 == pytest.approx(stiffer) == pytest.approx(1.0 / size)
        found = one.response(0.02, (0.7, 1.35))
        for omega in np.linspace(0.8, 1.2, 31):
            for s in found.at(float(omega / ratio)):
                inside = any(path.contains_point((omega, size * s.u_max)) for path in shaded)
                if s.stable or (stiffer == 1.0 and 0.55 < s.u_max < 0.8):
                    assert inside == s.stable


def test_a_series_that_no_orbit_stays_in_is_left_out_with_a_note() -> None:
    """A strong shock: the law has its orbits and its motion, the series has none."""
    more: dict[str, Any] = {"forcing": 50.0, "omega": (0.9, 1.1), "tol": 1e-3, "simulate": "half-sine"}
    result = run_dynamics(PowerLaw(1.5), **more)
    assert [*result.oscillators] == [*result.free] == ["exact"] and result.motions["half-sine"].u.max() > 1.0
    assert any(note.startswith("taylor: left out") for note in result.notes)
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
