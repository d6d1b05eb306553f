"""Motion of the base, and short motions in time, against closed forms of a linear contact and SciPy's integration."""

from __future__ import annotations

import csv
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asperity.vibration.orbits import Orbits
from asperity.vibration.search import Search, _scale
from click.testing import CliRunner
from scipy.integrate import solve_ivp

from asperity.cli.dynamics import dynamics as command
from asperity.errors import ConvergenceError
from asperity.plot import plot_dynamics
from asperity.vibration import ContactOscillator, Joint, PowerLaw, run_dynamics

LINEAR = ContactOscillator(PowerLaw(1.0), zeta=0.05)


@pytest.mark.parametrize("excitation", ["base", "acceleration"])
def test_transmissibility_of_a_linear_contact(excitation: str) -> None:
    rows = list(LINEAR.response(1e-3, (0.4, 2.0), excitation=excitation, tol=1e-8).rows())
    w, found = (np.array([row[name] for row in rows]) for name in ("Omega", "transmissibility"))
    np.testing.assert_allclose(found, np.hypot(1.0, 0.1 * w) / np.hypot(1.0 - w**2, 0.1 * w), rtol=1e-9)
    assert np.isnan(next(iter(LINEAR.response(1e-3, (0.4, 0.5)).rows()))["transmissibility"])


@pytest.mark.parametrize("damping", ["always", "contact", "hunt-crossley"])
def test_base_motion_in_absolute_coordinates(damping: str) -> None:
    """The mass and the base in their own coordinates; what the base does is what the damper takes."""
    n, zeta, b, omega = 1.5, 0.015, 0.05, 0.9
    r = ContactOscillator(PowerLaw(n), zeta=zeta, damping=damping).response(b, (0.6, 1.2), excitation="base")
    assert len(r["fold"]) == 2 and len(r.at(omega)) == 3, r.at(omega)
    for s in r.at(omega):

        def field(t: float, y: np.ndarray) -> list[float]:
            x, v, base, speed = y[0], y[1], b * np.cos(omega * t), -b * omega * np.sin(omega * t)
            z = 1.0 + x - base
            push = max(z, 0.0) ** n / n
            g = {"always": 1.0, "contact": float(z > 0), "hunt-crossley": n * push}[damping]
            drag = 2.0 * zeta * g * (v - speed)
            work = (push + drag) * -speed
            return [v, 1.0 / n - push - drag, work, drag * (v - speed), x * np.cos(omega * t), x * np.sin(omega * t)]

        u, v = s.start
        start, period = [u + b, v, 0, 0, 0, 0], 2 * np.pi / omega
        run = solve_ivp(field, (0, period), start, method="DOP853", rtol=1e-11, atol=1e-13, max_step=0.01)
        end = run.y[:, -1]
        np.testing.assert_allclose(end[:2], [u + b, v], atol=1e-4)
        assert end[2] == pytest.approx(end[3], rel=1e-4)
        ratio = np.hypot(*end[4:]) * omega / np.pi / b
        assert r.setting.transmissibility(omega, s.a1, s.phase) == pytest.approx(ratio, rel=1e-4)


def test_sweeps_and_peak_under_a_moving_base() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.03)
    r, (up,) = (
        o.response(0.02, (0.7, 1.3), excitation="base"),
        o.sweep(0.02, (0.7, 1.3), excitation="base", points=7, directions=("up",)),
    )
    for omega, u in zip(up.Omega, up.u_max, strict=True):
        assert min(abs(s.u_max - u) for s in r.at(float(omega))) < 1e-4
    (peak,) = o.thresholds(0.02, "base").peaks
    assert peak["u_max"] == pytest.approx(r.peak[1], rel=1e-2) and peak["Omega"] == pytest.approx(r.peak[0], rel=1e-2)


def test_a_step_overshoots_as_a_linear_oscillator_does() -> None:
    path = LINEAR.simulate(1.0, 1e-3, shape="step", periods=4)
    decay = np.exp(-np.pi * 0.05 / np.sqrt(1 - 0.05**2))
    assert path.u.max() == pytest.approx(1e-3 * (1.0 + decay), rel=1e-9)
    assert path.tau[path.u.argmax()] == pytest.approx(np.pi / np.sqrt(1 - 0.05**2), rel=1e-6)
    assert np.all(path.force == 1e-3) and np.all(np.diff(path.tau) > 0)


@pytest.mark.parametrize("omega", [0.4, 1.0, 2.5])
def test_the_shock_response_spectrum_of_a_half_sine(omega: float) -> None:
    """Of a linear oscillator without damping: largest displacement during and after the pulse."""
    path = ContactOscillator(PowerLaw(1.0), zeta=0.0).simulate(omega, 1e-3, shape="half-sine", periods=4)
    t = np.linspace(0, np.pi / omega, 100001)
    if omega == 1.0:
        during, after = 0.5 * (np.sin(t) - t * np.cos(t)), 0.5 * np.pi
    else:
        during = (np.sin(omega * t) - omega * np.sin(t)) / (1.0 - omega**2)
        after = abs(2.0 * omega * np.cos(0.5 * np.pi / omega) / (1.0 - omega**2))
    assert path.u[path.tau <= np.pi / omega].max() == pytest.approx(1e-3 * during.max(), rel=1e-7)
    assert path.u[path.tau >= np.pi / omega].max() == pytest.approx(1e-3 * after, rel=1e-8)


def test_a_chirp_with_loss_of_contact() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.02)
    path = o.simulate((0.6, 1.3), 0.08, shape="chirp", periods=12)
    end = path.tau[-1]
    assert end == pytest.approx(24.0 * np.pi / 0.6) and len(path.flight) == 2

    def field(t: float, y: np.ndarray) -> list[float]:
        force = 0.08 * np.cos(0.6 * t + 0.5 * (1.3 - 0.6) / end * t**2)
        return [y[1], force - (max(1.0 + y[0], 0.0) ** 1.5 - 1.0) / 1.5 - 0.04 * y[1]]

    run = solve_ivp(field, (0, end), [0.0, 0.0], method="DOP853", rtol=1e-11, atol=1e-13, max_step=0.01)
    np.testing.assert_allclose([path.u[-1], path.v[-1]], run.y[:, -1], atol=1e-6)
    assert path.u.min() == pytest.approx(run.y[0].min(), rel=1e-4)


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
    arguments = [str(file), "--mass", "2", "--preload", "100", "--model", "exact", "--omega", "0.9", "1.1"]
    done = CliRunner().invoke(command, [*arguments, "--forcing", "1.5m/s2", "--simulate", "step", "-o", str(out)])
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
    assert by_length.responses["exact"][0].setting.F_hat == pytest.approx(1e-9 / by_length.first.restoring.z_s)


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
    assert not any((b.u_min >= -1.0).any() for b in series.responses["taylor"][0].branches)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        for result in (both, series):
            assert plot_dynamics(result, tmp_path)


@pytest.mark.parametrize("excitation", ["force", "base"])
def test_an_orbit_from_a_start_has_the_direction_of_its_branch(excitation: str) -> None:
    """In closed form for a linear contact; the force of a moving base grows with the frequency."""
    setting, zeta = LINEAR.setting(1e-3, excitation), LINEAR.zeta

    def state(omega: Any) -> Any:
        motion = setting.forcing(omega) / (1.0 - omega**2 + 2j * zeta * omega)
        return np.array([motion.real, (1j * omega * motion).real])

    search = Search(Orbits(LINEAR.equation, setting, (0.5, 2.0), tol=1e-8), False)
    (found,) = search._found(1, np.array([1.3]), 1.05 * state(np.array([1.3])).T)
    states, omega, _, normal = found
    direction = normal * _scale(states, np.array([omega]))[0] ** 2  # the plane is normal to the branch in these units
    np.testing.assert_allclose(states[0], state(omega), rtol=1e-3)
    slope = np.append((state(omega + 1e-6) - state(omega - 1e-6)) / 2e-6, 1.0)
    assert np.linalg.norm(np.cross(direction, slope)) < 1e-3 * np.linalg.norm(direction) * np.linalg.norm(slope)
