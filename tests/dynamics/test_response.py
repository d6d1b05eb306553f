"""Forced response: orbits against independent time integration, known onsets, hard cases, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from twin import computed, motion, shoot

from asperity.vibration import ContactOscillator, PowerLaw, CurveLaw
from asperity.vibration.equation import Equation, Restoring, motions
from asperity.vibration.free import free_orbits
from asperity.vibration.orbits import Orbits
from asperity.vibration.response import frequency_response
from asperity.vibration.search import Search


@pytest.mark.parametrize(
    ("n", "zeta", "forcing", "window"),
    [
        (1.5, 0.01, 0.05, (0.5, 1.3)),
        (0.7, 0.02, 0.05, (0.6, 1.3)),
        (1.0, 0.01, 0.05, (0.6, 1.3)),
        (3.0, 0.005, 0.02, (0.3, 1.3)),
        (1.5, 0.05, 0.3, (1.3, 2.2)),
    ],
)
def test_orbits_close_under_independent_integration(n, zeta, forcing, window) -> None:
    r = computed(n, zeta, forcing, window)
    assert r.tolerance <= 1e-5 and r.det_error <= 1e-6
    checked = 0
    for omega in (float(w) for w in np.linspace(window[0], window[1], 5)):
        for s in r.at(omega):
            path = motion(r.equation, omega, forcing, s.states[0], s.order)
            bound = (10.0 if s.stable else 1e3) * 1e-5 * (s.u_max - s.u_min)
            np.testing.assert_allclose([*path.end, path.u_max, path.u_min], [*s.start, s.u_max, s.u_min], atol=bound)
            checked += 1
    assert checked >= 5


def test_reference_curve() -> None:
    """Peak by the energy balance, with an error of order zeta^2; folds and grazing at two tolerances."""
    o = ContactOscillator(PowerLaw(1.5), zeta=0.01)
    loose, fine = computed(), o.response(0.05, tol=1e-7)
    assert len(fine.branches) == 1 and fine.branches[0].end == "window"
    assert [e.kind for e in fine.events] == ["grazing", "fold", "grazing", "fold"]
    for a, b in zip(loose.events, fine.events, strict=True):
        assert (a.Omega, a.u_max) == (pytest.approx(b.Omega, rel=1e-5), pytest.approx(b.u_max, rel=1e-4))
    assert max(fine.branches[0].a1) == pytest.approx(o.thresholds(0.05).peaks[0]["a1"], rel=5e-4)
    assert fine["grazing"][0].u_min == pytest.approx(-1.0, abs=1e-9)


def test_orbits_agree_with_shooting_to_1e_9() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.01)
    r = o.response(0.05, (0.8, 1.1), tol=1e-9)
    b = max(r.branches, key=lambda b: float(b.u_max.max()))
    for i in np.flatnonzero(b.u_min < -1.0)[3::24]:
        shot = shoot(r.equation, b.Omega[i], 0.05, *b.points[i].y[:2])
        found = b.u_max[i], b.u_min[i], b.a1[i]
        np.testing.assert_allclose(found, (shot.u_max, shot.u_min, shot.a1), rtol=2e-9)
        assert b.radius[i] == pytest.approx(max(abs(m) for m in shot.multipliers), rel=2e-4)
        expected = np.exp(-0.04 * np.pi / b.Omega[i])
        assert np.prod(shot.multipliers).real == pytest.approx(expected, rel=1e-7)  # of differences, exact to 1e-8


def test_a_damper_proportional_to_the_contact_force_agrees_with_shooting() -> None:
    r = ContactOscillator(PowerLaw(1.5), zeta=0.03, damping="hunt-crossley").response(0.08, (0.7, 1.2), tol=1e-7)
    b = r.branches[0]
    steep = np.abs([p.rate for p in b.points]) > 1e-6  # shooting is singular at a fold
    flying = np.flatnonzero((b.u_min < -1.0) & steep)[::28]
    assert flying.size
    for i in flying:
        shot = shoot(r.equation, b.Omega[i], 0.08, *b.points[i].y[:2])
        assert b.u_max[i] == pytest.approx(shot.u_max, rel=1e-6)
        assert b.radius[i] == pytest.approx(max(abs(m) for m in shot.multipliers), rel=1e-3)


@pytest.mark.parametrize("damping", ["always", "contact", "hunt-crossley"])
@pytest.mark.parametrize("law", [PowerLaw(1.2), PowerLaw(2.5), "table"])
def test_the_period_map_and_its_derivatives_agree_with_scipy(damping: str, law: Any) -> None:
    """Motions in contact, with flights and several separations in a period."""
    if law == "table":
        z = np.linspace(0.05, 1.0, 20)
        law = CurveLaw(z, 2.0 * z**1.5 + 3.0 * np.maximum(z - 0.5, 0.0))
    e = Equation(Restoring(law, law.default_load), 0.03, damping)
    for u, v, omega, forcing in ((0.3, 0.1, 0.8, 0.05), (1.1, -0.5, 0.7, 0.3), (-1.5, 0.2, 0.11, 0.8)):
        start, found = np.array([u, v]), motions(e, [u, v], omega, forcing, rtol=1e-11)
        expected = motion(e, omega, forcing, start)
        own = (*found.end[0], found.high[0, 0], found.low[0, 0], *found.wave[0, :, 0] / np.pi)
        twin = (*expected.end, expected.u_max, expected.u_min, *expected.wave / np.pi)
        np.testing.assert_allclose(own, twin, atol=1e-8)
        np.testing.assert_allclose(found.by_end[0], expected.by, atol=1e-6 * np.abs(expected.by).max())
        liouville = np.exp(-2.0 * e.zeta * found.damping[0])
        assert np.linalg.det(found.by_end[0, :, :2]) == pytest.approx(liouville, rel=1e-6)


def test_linear_resonance() -> None:
    """Closed form at every point; the largest displacement is one of them."""
    r = ContactOscillator(PowerLaw(1.0), zeta=0.05).response(0.02, (0.5, 1.5), tol=1e-9)
    (b,), (omega, top) = r.branches, r.peak
    np.testing.assert_allclose(b.u_max, 0.02 / np.abs(1 - b.Omega**2 + 0.1j * b.Omega), rtol=1e-9)
    assert b.stable.all() and not r.events
    assert top == pytest.approx(0.02 / (0.1 * np.sqrt(1 - 0.05**2)), rel=1e-9)
    assert omega == pytest.approx(np.sqrt(1 - 2 * 0.05**2), abs=1e-5)


@pytest.mark.parametrize(
    ("zeta", "threshold", "event", "window", "margin"),
    [(0.002, "hysteresis", "fold", (0.97, 1.02), 0.03), (0.005, "contact_loss", "grazing", (0.9, 1.05), 0.005)],
)
def test_onsets(zeta: float, threshold: str, event: str, window: tuple[float, float], margin: float) -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=zeta)
    onset = getattr(o.thresholds(), threshold)
    assert not o.response((1.0 - margin) * onset, window)[event]
    assert len(o.response((1.0 + margin) * onset, window)[event]) == 2


def test_period_doubling_onset_and_branches() -> None:
    """Between the doublings, on a branch without folds, no orbit of period 1 is stable."""
    o = ContactOscillator(PowerLaw(1.5), zeta=0.01)
    onset = o.thresholds().period_doubling
    assert onset is not None and onset == pytest.approx(0.24)
    assert not o.response(0.993 * onset, (1.7, 2.3), subharmonics=False)["period doubling"]
    r = o.response(1.007 * onset, (1.7, 2.3))
    low, high = sorted(e.Omega for e in r["period doubling"])
    main = [s.stable for w in (low - 1e-3, 0.5 * (low + high), high + 1e-3) for s in r.at(w) if s.order == 1]
    assert main == [True, False, True]
    sub = [b for b in r.branches if b.kind == "sub2"]
    assert len(sub) == 2 and all(b.order == 2 for b in sub)
    assert sub[0].stable.all() != sub[1].stable.all()


def test_detached_loops_below_the_onset() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.01)
    loops = [b for b in o.response(0.15, (1.4, 2.2)).branches if b.kind == "detached"]
    assert [b.order for b in loops] == [2]
    assert loops[0].stable.any() and (~loops[0].stable).any()
    assert all(b.kind == "main" for b in o.response(0.15, (1.4, 2.2), subharmonics=False).branches)


def test_taylor_equals_exact_in_contact_for_integer_powers() -> None:
    for n in (2.0, 3.0):
        o = ContactOscillator(PowerLaw(n), zeta=0.02)
        exact, series = o.response(0.02, (0.7, 1.2), tol=1e-9), o.taylor().response(0.02, (0.7, 1.2), tol=1e-9)
        assert exact.valid and series.valid
        for omega in (0.75, 0.9, 1.0, 1.1):
            for a, b in zip(exact.at(omega), series.at(omega), strict=True):
                assert a.u_max == pytest.approx(b.u_max, rel=1e-8)


def test_taylor_beyond_contact_is_marked() -> None:
    r = ContactOscillator(PowerLaw(1.5), zeta=0.01).taylor().response(0.05)
    assert not r.valid and any("unphysical" in note for note in r.notes)
    b = r.branches[0]
    np.testing.assert_array_equal(b.valid, b.u_min >= -1)


@pytest.mark.parametrize("n", [1.5, 2.5])
def test_grazing_within_1e_10_from_both_sides(n: float) -> None:
    r = ContactOscillator(PowerLaw(n), zeta=0.05).response(0.12, (0.8, 1.2), tol=1e-9)
    graze = r["grazing"][0]
    lower, upper = (next(s for s in r.at(graze.Omega + d) if abs(s.u_min + 1) < 1e-6) for d in (-1e-10, 1e-10))
    assert (lower.u_min + 1) * (upper.u_min + 1) < 0
    for s in (lower, upper):
        path = motion(r.equation, s.Omega, 0.12, s.states[0])
        np.testing.assert_allclose([*path.end, path.u_max, path.u_min], [*s.start, s.u_max, s.u_min], atol=1e-8)


def test_light_damping_traces_the_narrow_peak() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=1e-4)
    r = o.response(1e-4, (0.8, 1.2))
    peak = o.thresholds(1e-4).peaks[0]
    assert r.branches[0].a1.max() == pytest.approx(peak["a1"], rel=1e-4)
    assert r.branches[0].Omega[r.branches[0].a1.argmax()] == pytest.approx(peak["Omega"], rel=1e-5)


def test_several_separations_per_period() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.05)
    found = o.response(0.8, (0.11, 0.13), tol=1e-4, subharmonics=False).at(0.12)
    paths = [(s, o.simulate(0.12, 0.8, u=s.start[0], v=s.start[1], periods=1.0)) for s in found]
    assert max(len(path.flight) for _, path in paths) >= 2
    for s, path in paths:
        assert not s.stable or path.u.max() == pytest.approx(s.u_max, rel=1e-3)


def test_table_response_follows_its_power_law_and_a_note_says_where_it_ends() -> None:
    z = np.linspace(0, 1, 61)[1:]
    table = ContactOscillator(CurveLaw(z, z**1.5), zeta=0.02)
    power = ContactOscillator(PowerLaw(1.5), zeta=0.02)
    a, b = table.response(0.01, (0.8, 1.2)), power.response(0.01, (0.8, 1.2))
    for omega in (0.9, 0.98, 1.1):
        assert a.at(omega)[0].u_max == pytest.approx(b.at(omega)[0].u_max, rel=1e-6)
    a, b = table.response(0.1, (0.8, 1.2)), power.response(0.1, (0.8, 1.2))
    assert a.peak == pytest.approx(b.peak, rel=1e-5) and not b.notes
    (note,) = a.notes
    assert f"reaches u = {a.peak[1]:.4g}, the curve that the law was fitted to ends at u = 0.5874" in note


def test_stiff_law_and_faint_forcing() -> None:
    r = ContactOscillator(PowerLaw(12.0), zeta=0.02).response(1e-3, (0.9, 1.1))
    assert r.branches[0].end == "window"
    for forcing in (1e-8, 1e-9):
        faint = ContactOscillator(PowerLaw(1.5), zeta=0.01).response(forcing, (0.9, 1.1))
        assert faint.peak[1] == pytest.approx(forcing / 0.02, rel=1e-4)


def linear(forcing: float, zeta: float, omega: Any) -> Any:
    return forcing / np.abs(1 - omega**2 + 2j * zeta * omega)


@pytest.mark.parametrize(
    ("zeta", "window"), [(1e-3, (0.01, 1.3)), (0.99, (0.01, 1.3)), (1e-3, (0.5, 100.0)), (0.05, (0.01, 0.012))]
)
def test_slowest_and_fastest_forcing(zeta: float, window: tuple[float, float]) -> None:
    """Small motion has the closed form and multipliers at both ends of the legal frequencies, for any damping."""
    forcing = 1e-6
    r = ContactOscillator(PowerLaw(1.5), zeta=zeta).response(forcing, window, subharmonics=False)
    assert r.det_error <= 2e-6 and not r.notes
    for b in r.branches:
        np.testing.assert_allclose(b.a1, linear(forcing, zeta, b.Omega), rtol=1e-4)
        np.testing.assert_allclose(b.radius, np.exp(-2 * np.pi * zeta / b.Omega), atol=1e-4)


def test_the_tolerance_includes_round_off() -> None:
    r = ContactOscillator(PowerLaw(1.5)).response(1e-9, (50.0, 100.0))
    b = r.branches[0]
    miss = np.abs(b.u_max / linear(1e-9, 0.01, b.Omega) - 1)
    assert 1e-4 < miss.max() < r.tolerance < 0.1 and (miss < b.error).all()


def test_work_is_bounded() -> None:
    o = ContactOscillator(PowerLaw(1.5))
    r = frequency_response(Orbits(o.equation, o.setting(0.05), (0.5, 1.3), max_work=20))
    assert any("ends early: too much work" in note for note in r.notes)


@pytest.mark.parametrize("forcing", [1e3, 1e6])
def test_a_strong_forcing_starts_where_it_hardly_moves_the_mass(forcing: float) -> None:
    """Far above a narrow window, and in few steps from there: the mass then flies freely, by more than F^/Omega^2."""
    o = ContactOscillator(PowerLaw(1.5), zeta=0.01)
    search = Search(Orbits(o.equation, o.setting(forcing), (0.8, 1.0)))
    search.run()
    start, *points = search._paths[0].points
    assert len(points) < 500 and start.amplitude < 0.1
    assert all(p.amplitude > 0.5 * forcing for p in points if 0.8 <= p.Omega <= 1.0)


def test_mostly_flight() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.01)
    r = o.response(0.2, (0.2, 1.3))
    top = max(r.at(0.25), key=lambda s: s.u_max)
    assert free_orbits(o.restoring, top.u_max)[0].flight > 0.8
    u, v = top.start
    shot = shoot(r.equation, 0.25, 0.2, u, v)
    size = top.u_max - top.u_min
    assert shot.u_max == pytest.approx(top.u_max, abs=1e-5 * size)
    assert shot.u_min == pytest.approx(top.u_min, abs=1e-5 * size)
