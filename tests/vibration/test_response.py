"""Main branch of the forced response: against independent time integration, closed forms, known onsets, hard cases."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from twin import computed, motion

from asperity.errors import ConvergenceError
from asperity.vibration import branch
from asperity.vibration.curve_law import CurveLaw
from asperity.vibration.equation import Equation
from asperity.vibration.law import PowerLaw
from asperity.vibration.oscillator import ContactOscillator

TABLES: dict[str, dict[str, Any]] = json.loads((Path(__file__).parent / "tables.json").read_text(encoding="utf-8"))
LINEAR = ContactOscillator(PowerLaw(1.0), zeta=0.05)


def oscillator(table: dict[str, Any]) -> ContactOscillator:
    law = CurveLaw(table["z"], table["F"], k=table.get("k"))
    return ContactOscillator(law, load=table["load"], zeta=table.get("zeta", 0.01))


def closes(r: Any, omega: float, tol: float = 1e-5) -> int:
    """Assert that each orbit at a frequency closes and is as stable as by SciPy; their number."""
    found = r.at(omega)
    for s in found:
        path = motion(r.col.equation, omega, float(r.equation.forcing(omega)), np.array(s.start))
        size = tol * (s.u_max - s.u_min) * (10.0 if s.stable else 1e3)
        np.testing.assert_allclose([*path.end, path.u_max, path.u_min], [*s.start, s.u_max, s.u_min], atol=size)
        radius = np.abs(np.linalg.eigvals(path.by[:, :2])).max()
        assert (s.a1, s.radius) == pytest.approx((path.a1, radius), rel=100 * tol, abs=1e-3 if tol > 1e-6 else 0.0)
        assert s.stable == (radius < 1.0) or abs(radius - 1.0) < 1e-3
    return len(found)


@pytest.mark.parametrize(
    ("n", "zeta", "forcing", "window"),
    [
        (1.5, 0.01, 0.05, (0.5, 1.3)),
        (0.7, 0.02, 0.05, (0.6, 1.3)),
        (1.0, 0.01, 0.05, (0.6, 1.3)),  # a bilinear oscillator, which flies
        (1.02, 0.005, 0.02, (0.6, 1.2)),
        (3.0, 0.005, 0.02, (0.3, 1.3)),
        (1.5, 0.05, 0.3, (1.3, 2.2)),
        (1.5, 0.01, 1.0, (0.2, 1.3)),
    ],
)
def test_orbits_close_under_independent_integration(n, zeta, forcing, window) -> None:
    r = computed(n, zeta, forcing, window)
    assert not r.notes
    assert sum(closes(r, float(w)) for w in np.linspace(window[0], window[1], 5)) >= 5


@pytest.mark.parametrize("name", ["demo", "21 uneven points", "preload near the end", "60 points"])
def test_orbits_of_curves(name: str) -> None:
    """Also the folds and the orbits of a shooting method, to 1e-4."""
    table = TABLES[name]
    window = table.get("omega", (0.5, 1.3))
    r = oscillator(table).response(table.get("forcing", 0.018), window)
    assert all("extrapolated" in note for note in r.notes)
    for omega, u_max in table["orbits"]:
        np.testing.assert_allclose([s.u_max for s in r.at(omega)], u_max, rtol=1e-4)
    folds = sorted(e.Omega for e in r["fold"])
    np.testing.assert_allclose(folds, table["folds"], atol=1e-4)
    closes(r, window[0] + 0.4 * (window[1] - window[0]))


def test_orbits_to_1e_7() -> None:
    """With their multipliers, whose product is that of the damping."""
    r = ContactOscillator(PowerLaw(1.5), zeta=0.01).response(0.05, (0.8, 1.1), tol=1e-7)
    for omega in (0.85, 0.93):
        assert closes(r, omega, tol=1e-7)
        for s in r.at(omega):
            assert s.determinant == pytest.approx(np.exp(-0.04 * np.pi / omega), rel=1e-12)


@pytest.mark.parametrize(("damping", "tol"), [("hunt-crossley", 1e-5), ("contact", 1e-4)])
def test_dampers_that_act_in_contact(damping: str, tol: float) -> None:
    """The damper in contact begins to act over the first 1e-3 of the static deflection."""
    r = ContactOscillator(PowerLaw(1.5), zeta=0.03, damping=damping).response(0.05, (0.7, 1.2))
    assert sum(closes(r, omega, tol) for omega in (0.8, 0.91, 0.95, 1.1)) >= 4


def test_linear_resonance() -> None:
    """Closed form at every orbit; the largest displacement is one of them."""
    r = LINEAR.response(0.02, (0.5, 1.5), tol=1e-8)
    (piece,), (omega, top) = r.pieces, r.peak
    np.testing.assert_allclose(piece.u_max, 0.02 / np.abs(1 - piece.Omega**2 + 0.1j * piece.Omega), rtol=1e-8)
    assert piece.stable and not r.events and r.has_peak
    assert top == pytest.approx(0.02 / (0.1 * np.sqrt(1 - 0.05**2)), rel=1e-8)
    assert omega == pytest.approx(np.sqrt(1 - 2 * 0.05**2), abs=1e-4)
    assert not LINEAR.response(0.02, (1.1, 1.2)).has_peak


@pytest.mark.parametrize(
    ("zeta", "window"), [(1e-3, (0.02, 1.3)), (0.99, (0.05, 1.3)), (1e-3, (0.5, 100.0)), (0.05, (0.01, 0.012))]
)
def test_slowest_and_fastest_forcing(zeta: float, window: tuple[float, float]) -> None:
    """Small motion has the closed form and multipliers at both ends of the legal frequencies, for any damping."""
    r = ContactOscillator(PowerLaw(1.5), zeta=zeta).response(1e-6, window)
    assert not r.notes
    for p in (p for piece in r.pieces for p in piece.orbits):
        linear = 1e-6 / abs(1 - p.Omega**2 + 2j * zeta * p.Omega)
        assert p.a1 == pytest.approx(linear, rel=1e-4)
        assert p.radius == pytest.approx(np.exp(-2 * np.pi * zeta / p.Omega), abs=1e-4)


@pytest.mark.parametrize(
    ("zeta", "threshold", "event", "window", "margin"),
    [(0.002, "hysteresis", "fold", (0.97, 1.02), 0.03), (0.005, "contact_loss", "grazing", (0.9, 1.05), 0.005)],
)
def test_onsets(zeta: float, threshold: str, event: str, window: tuple[float, float], margin: float) -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=zeta)
    onset = getattr(o.thresholds(), threshold)
    assert not o.response((1.0 - margin) * onset, window)[event]
    assert len(o.response((1.0 + margin) * onset, window)[event]) == 2


def test_onset_of_period_doubling() -> None:
    """Between the doublings, on a branch without folds, no orbit is stable."""
    o = ContactOscillator(PowerLaw(1.5), zeta=0.01)
    onset = o.thresholds().period_doubling
    assert onset is not None and onset == pytest.approx(0.24)
    assert not o.response(0.993 * onset, (1.7, 2.3))["period doubling"]
    r = o.response(1.007 * onset, (1.7, 2.3))
    low, high = sorted(e.Omega for e in r["period doubling"])
    assert [r.at(w)[0].stable for w in (low - 1e-3, 0.5 * (low + high), high + 1e-3)] == [True, False, True]
    assert [piece.stable for piece in r.pieces] == [True, False, True]
    assert "of twice the forcing period" in r.to_dict()["searched"]


def test_the_taylor_law_is_exact_for_a_square_in_contact_and_unphysical_beyond() -> None:
    o = ContactOscillator(PowerLaw(2.0), zeta=0.02)
    exact, series = o.response(0.02, (0.7, 1.2)), o.taylor().response(0.02, (0.7, 1.2))
    assert exact.valid and series.valid
    np.testing.assert_allclose([e.Omega for e in series["fold"]], [e.Omega for e in exact["fold"]], rtol=1e-6)
    assert series.peak == pytest.approx(exact.peak, rel=1e-6)
    r = o.taylor().response(0.1, (0.7, 1.2))
    assert not r.valid and any("unphysical" in note for note in r.notes)


@pytest.mark.parametrize("n", [1.5, 2.5])
def test_grazing_from_both_sides(n: float) -> None:
    r = ContactOscillator(PowerLaw(n), zeta=0.05).response(0.12, (0.8, 1.2), tol=1e-8)
    graze = r["grazing"][0]
    assert graze.u_min == pytest.approx(-1.0, abs=1e-6)
    for d in (-1e-6, 1e-6):
        (s,) = (s for s in r.at(graze.Omega + d) if abs(s.u_min + 1) < 1e-4)
        path = motion(r.col.equation, graze.Omega + d, 0.12, np.array(s.start))
        np.testing.assert_allclose([*path.end, path.u_max, path.u_min], [*s.start, s.u_max, s.u_min], atol=1e-7)


def test_light_damping_traces_the_narrow_peak() -> None:
    """The peak by the energy balance, whose error is of order zeta^2."""
    o = ContactOscillator(PowerLaw(1.5), zeta=1e-4)
    r = o.response(1e-4, (0.8, 1.2))
    top = max((p for piece in r.pieces for p in piece.orbits), key=lambda p: p.a1)
    free = o.free(brentq(lambda u: o.free(u).drive[0] - 0.5, 0.1, 0.8))
    assert top.a1 == pytest.approx(free.a1[0], rel=1e-4) and top.Omega == pytest.approx(free.omega_ratio[0], rel=1e-5)


def test_several_separations_and_motion_mostly_in_flight() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.05)
    for s in o.response(0.8, (0.11, 0.13)).at(0.12):
        path = o.simulate(0.12, 0.8, u=s.start[0], v=s.start[1], periods=1.0)
        assert len(path.flight) >= 2 and (not s.stable or path.u.max() == pytest.approx(s.u_max, rel=1e-4))
        assert np.diff(path.flight).sum() < path.tau[-1]
    closes(computed(1.5, 0.01, 0.2, (0.2, 1.3)), 0.25)


def test_faint_strong_and_stiff() -> None:
    for forcing in (1e-8, 1e-9):
        faint = ContactOscillator(PowerLaw(1.5), zeta=0.01).response(forcing, (0.9, 1.1))
        assert faint.peak[1] == pytest.approx(forcing / 0.02, rel=1e-4)
    assert not ContactOscillator(PowerLaw(12.0), zeta=0.02).response(1e-3, (0.9, 1.1)).notes
    strong = ContactOscillator(PowerLaw(1.5), zeta=0.01).response(1e3, (0.8, 1.0))
    assert all(p.size > 500.0 for piece in strong.pieces for p in piece.orbits)  # it flies, by more than F^/Omega^2


def test_a_window_that_cuts_a_resonance_has_the_orbits_of_a_wide_one() -> None:
    for n, zeta, forcing, window, wide, omega in (
        (1.5, 0.005, 0.04, (0.6, 0.8), (0.5, 1.3), 0.75),  # both ends in a softening resonance
        (0.704, 0.00383, 0.01338, (1.0234, 1.4), (0.7, 1.4), 1.0244),  # the low end in a hardening one
    ):
        own, whole = computed(n, zeta, forcing, window), computed(n, zeta, forcing, wide)
        found, expected = (np.array([(s.u_max, s.stable) for s in r.at(omega)]) for r in (own, whole))
        np.testing.assert_allclose(found, expected, rtol=1e-4)
        assert not own.notes
    r = computed(1.884084, 0.00538425, 0.0648509, (0.958611, 1.8))
    assert not r.notes and len(r.at(0.96)) == 1  # the small motion at the low end has ended in a fold of the forcing


def test_a_curve_follows_its_power_law_and_a_note_says_where_it_ends() -> None:
    z = np.linspace(0, 1, 61)[1:]
    curve, power = (ContactOscillator(law, zeta=0.02) for law in (CurveLaw(z, z**1.5), PowerLaw(1.5)))
    a, b = curve.response(0.1, (0.8, 1.2)), power.response(0.1, (0.8, 1.2))
    assert a.peak == pytest.approx(b.peak, rel=1e-5) and not b.notes
    (note,) = a.notes
    assert f"reaches u = {a.peak[1]:.4g}, the curve that the law was fitted to ends at u = 0.5874" in note


@pytest.mark.parametrize(
    ("n", "zeta", "forcing", "window"), [(0.7, 0.02, 0.05, (0.6, 1.3)), (3.0, 0.005, 0.02, (0.3, 1.3))]
)
def test_rows_of_a_piece_are_one_curve(n, zeta, forcing, window) -> None:
    """Omega rises or falls along each piece; straight lines between its rows are accurate to 2e-3."""
    r = computed(n, zeta, forcing, window)
    rows = list(r.rows())
    assert 30 < len(rows) < 1000
    number, omega, u = (np.array([row[name] for row in rows]) for name in ("branch", "Omega", "u_max"))
    assert list(np.unique(number)) == [piece.number for piece in r.pieces]
    for a, b in pairwise(r.pieces):
        assert a.orbits[-1] is b.orbits[0] or a.Omega[-1] in window
    for piece in r.pieces:
        x, y = omega[number == piece.number], u[number == piece.number]
        assert abs(np.sign(np.diff(x)).sum()) == x.size - 1
        order = np.argsort(x)
        for w in np.random.default_rng(4).uniform(x.min(), x.max(), 4):
            line = float(np.interp(w, x[order], y[order]))
            assert min(abs(s.u_max - line) / s.u_max for s in r.at(float(w)) if s.stable == piece.stable) < 2e-3


def test_jumps_land_where_a_motion_in_time_settles() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.03)
    r = o.response(0.09, (0.7, 1.2))
    assert sorted(j["sweep"] for j in r.jumps) == ["down", "up"] and not any(j["note"] for j in r.jumps)
    folds = {id(e): e for e in r["fold"]}
    for j in r.jumps:
        (e,) = (e for e in folds.values() if e.Omega == j["Omega"])
        assert j["u_max"] == e.u_max
        omega = j["Omega"] * (1.0 + (2e-3 if j["sweep"] == "up" else -2e-3))
        u, v = e.orbit.start
        path = o.simulate(omega, 0.09, u=u, v=v, periods=60, rtol=1e-7)
        last = path.u[path.tau > 0.95 * path.tau[-1]]
        assert last.max() == pytest.approx(j["u_max_after"], rel=1e-2)


def test_a_jump_off_the_branch_or_out_of_the_window_is_said() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.01)
    lower = o.response(0.05, (0.5, 0.9418)).jumps
    assert [(j["sweep"], j["note"]) for j in lower] == [("down", "")]
    fold = o.response(0.05)["fold"][0].Omega
    (cut, *_) = o.response(0.05, (fold * (1.0 - 1e-5), 1.3)).jumps
    assert cut["u_max_after"] is None and cut["note"] == "outside the window"


def test_numbers_of_another_law_are_those_of_its_own_response() -> None:
    """Peak and folds in the units of the first law, for the same force in newton."""
    first, other = ContactOscillator(PowerLaw(1.5)), ContactOscillator(PowerLaw(1.55, 1.1), load=1.0)
    r = first.response(0.05)
    a, b = first, other
    own = other.response(0.05 * a.scale / b.scale)
    expected = np.array([own.peak, *((e.Omega, e.u_max) for e in own["fold"])])
    units = np.sqrt(b.scale / b.z_s * a.z_s / a.scale), b.z_s / a.z_s
    np.testing.assert_allclose(r.numbers(other.law), expected * units, rtol=1e-4)
    np.testing.assert_allclose(r.numbers(first.law)[0], r.peak, rtol=1e-5)
    assert np.isnan(r.numbers(PowerLaw(1.01))[1:]).all()  # almost linear: without folds


def test_a_branch_that_cannot_be_followed_says_where(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(branch, "_MOST", 60)
    (note, *_) = ContactOscillator(PowerLaw(1.5)).response(0.05).notes
    assert note.startswith("the branch ends early: 60 orbits, at Omega = ")
    with pytest.raises(ConvergenceError, match=r"no periodic orbit found for Omega = 0\.9 to 1\.1"):
        ContactOscillator(PowerLaw(1.5)).taylor().response(50.0, (0.9, 1.1))


@pytest.mark.parametrize("excitation", ["base", "acceleration"])
def test_transmissibility_of_a_linear_contact(excitation: str) -> None:
    rows = list(LINEAR.response(1e-3, (0.4, 2.0), excitation=excitation, tol=1e-8).rows())
    w, found = (np.array([row[name] for row in rows]) for name in ("Omega", "transmissibility"))
    np.testing.assert_allclose(found, np.hypot(1.0, 0.1 * w) / np.hypot(1.0 - w**2, 0.1 * w), rtol=1e-5)
    assert np.isnan(next(iter(LINEAR.response(1e-3, (0.4, 0.5)).rows()))["transmissibility"])


@pytest.mark.parametrize("damping", ["always", "contact", "hunt-crossley"])
def test_base_motion_in_absolute_coordinates(damping: str) -> None:
    """The mass and the base in their own coordinates; what the base does is what the damper takes."""
    n, zeta, b, omega = 1.5, 0.015, 0.05, 0.9
    r = ContactOscillator(PowerLaw(n), zeta=zeta, damping=damping).response(b, (0.6, 1.2), excitation="base")
    assert len(r.at(omega)) == 3
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
        assert end[2] == pytest.approx(end[3], rel=1e-3)
        ratio = np.hypot(*end[4:]) * omega / np.pi / b
        assert r.equation.transmissibility(omega, s.first) == pytest.approx(ratio, rel=1e-4)


def test_the_equation_agrees_with_its_derivatives() -> None:
    law = CurveLaw(np.linspace(0.05, 1.0, 20), np.linspace(0.05, 1.0, 20) ** 2)
    for damping in ("always", "contact", "hunt-crossley"):
        e = Equation(law, 0.3, 0.1, damping)
        u = np.array([-1.3, -0.7, -0.2, 0.1, 0.4])
        _, slope, _, rate = e.terms(u)
        up, down = e.terms(u + 1e-6), e.terms(u - 1e-6)
        np.testing.assert_allclose((up[0] - down[0]) / 2e-6, slope, atol=1e-6)
        np.testing.assert_allclose((up[2] - down[2]) / 2e-6, rate, atol=1e-6)
