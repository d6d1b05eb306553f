"""Completeness of the orbits of a response, checked independently, and dense rows between its points."""

from __future__ import annotations

import runpy
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from twin import computed, motion

from asperity.curve import Curve
from asperity.vibration import ContactOscillator, PowerLaw, CurveLaw, TaylorLaw, orbits
from asperity.errors import ConvergenceError
from asperity.output.results import Results
from asperity.plot import vibration

BENCHMARK = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "dynamics.py"))
missing, states = BENCHMARK["missing"], BENCHMARK["states"]


def case(n: float, zeta: float, forcing: float) -> Any:
    return BENCHMARK["Window"](n, zeta, forcing, (), ())


@pytest.mark.parametrize(
    ("n", "zeta", "forcing", "window", "omega", "order", "radius"),
    [
        (3.0, 0.005, 0.02, (0.3, 1.3), (0.45, 0.5), 1, 1.3),  # near the fold at the end of a long resonance
        (1.5, 0.01, 0.05, (0.5, 1.3), (0.589, 0.9415), 1, 2.3),
        (0.7, 0.02, 0.05, (0.6, 1.3), (1.02,), 1, 1.5),
        (1.5, 0.0005, 0.1, (0.3, 0.55), (0.4955, 0.33), 1, 2.5),  # superharmonic folds
        (2.4, 0.005, 0.2, (0.28, 1.5), (0.35,), 1, 2.5),  # pieces that connect outside the window
        (3.267, 0.00273, 0.122, (0.265, 0.751), (0.326,), 1, 2.0),  # a loop that few states lead to
        (1.76, 0.019, 0.2514, (1.5, 2.5), (1.8431,), 2, 1.5),  # a loop of period 2 below the onset
        (1.5, 0.01, 0.3, (1.5, 2.5), (1.7, 2.0), 2, 2.0),
    ],
)
def test_no_orbit_is_missing(n, zeta, forcing, window, omega, order, radius) -> None:
    """Against Newton's method on an independent period map, from 80 states."""
    r = computed(n, zeta, forcing, window)
    i = np.arange(80)
    grid = radius * (i / 79) * np.array([np.cos(2.4 * i), np.sin(2.4 * i)])
    for w in omega:
        others = [o for p in range(1, order + 1) for o, _ in BENCHMARK["polished"](case(n, zeta, forcing), w, grid, p)]
        assert others and not missing(others, states(r.at(w)), 2e-3), w


@pytest.mark.parametrize(
    ("n", "zeta", "forcing", "window", "wide", "omega"),
    [
        (1.5, 0.005, 0.04, (0.6, 0.8), (0.5, 1.3), 0.75),  # both ends in a softening resonance
        (3.397, 0.0027, 0.0143, (0.505, 0.758), (0.3, 1.3), 0.6),
        (0.63, 0.01295, 0.04828, (1.047, 1.4), (0.8, 1.4), 1.051),  # the low end in a hardening one
        (0.704, 0.00383, 0.01338, (1.0234, 1.4), (0.7, 1.4), 1.0244),
    ],
)
def test_a_window_that_cuts_a_resonance(n, zeta, forcing, window, wide, omega) -> None:
    o = ContactOscillator(PowerLaw(n), zeta=zeta)
    own, whole = o.response(forcing, window, subharmonics=False), o.response(forcing, wide, subharmonics=False)
    found, expected = (np.array([(s.u_max, s.stable) for s in r.at(omega)]) for r in (own, whole))
    np.testing.assert_allclose(found, expected, rtol=1e-4)
    assert not own.notes


def test_a_period_doubling_outside_the_window() -> None:
    """Orbits of period 2 that it bears are in the window, once each, and the orbits at both ends add up."""
    own, wide = (computed(3.5324, 0.005515, 0.36441, window) for window in ((0.48, 0.5), (0.45, 0.54)))
    assert wide["period doubling"][0].Omega > 0.52 and not own["period doubling"]
    found, expected = (states(r.at(0.4924)) for r in (own, wide))
    assert len(found) == len(expected) == 7 and not missing(expected, found, 1e-4)
    assert not any("is missing" in note for note in own.notes)


@pytest.mark.parametrize("window", [(0.8, 1.2), (1.5, 2.5)])
def test_strong_forcing(window: tuple[float, float]) -> None:
    """Orbits mostly in flight: they add up at both ends of the window."""
    r = ContactOscillator(PowerLaw(1.5), zeta=0.01).response(5.0, window)
    assert {b.order for b in r.branches} >= {1, 2} and not r.notes


def test_branches_mostly_in_flight_are_not_lost() -> None:
    """They come from period doublings at Omega = 2, far above the window, and go on to frequencies far below."""
    r = computed(2.5, 0.01, 0.3, (0.7, 1.1))
    assert not r.notes and [b.kind for b in r.branches] == ["main", "sub2", "sub2"]
    assert min(b.u_min.min() for b in r.branches) < -10.0


def test_a_random_window() -> None:
    """The benchmark on one case: nothing is missing that a wide window has, or that random starts come to."""
    (one,) = BENCHMARK["random_windows"](1, 7)
    own, random = BENCHMARK["response"](one, one.omega), np.random.default_rng(5)
    counts, words = BENCHMARK["compare"](one, own, 6, random)
    assert counts and not words, words


def test_what_is_not_searched_is_in_the_result() -> None:
    assert "period 1 and 2, from rest and up to 800 starts of each; not searched: longer" in computed().searched


@pytest.mark.parametrize(("n", "zeta", "low"), [(3.0, 0.005, 0.3), (0.7, 0.02, 0.6)])
def test_two_orbits_on_one_side_of_a_fold(n: float, zeta: float, low: float) -> None:
    r = computed(n, zeta, 0.02 if n > 1 else 0.05, (low, 1.3))
    assert len(r["fold"]) >= 2
    for e in r["fold"]:
        for d in (1e-3, 1e-7):
            few, many = sorted((r.at(e.Omega - d), r.at(e.Omega + d)), key=len)
            assert len(many) == len(few) + 2
            pair = sorted(many, key=lambda s: abs(s.u_max - e.u_max))[:2]
            assert {s.stable for s in pair} == {True, False}
            assert pair[0].u_max != pair[1].u_max
        assert len(r.at(e.Omega)) in (len(few), len(few) + 1, len(few) + 2)


def test_a_crossing_that_cannot_be_corrected_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    r = computed()
    monkeypatch.setattr(orbits, "_NEWTON", 0)
    with pytest.raises(ConvergenceError, match=r"an orbit at Omega = 0\.9 on branch 0 \(main\) could not be corrected"):
        r.at(0.9)


def test_period_2_branch_ends_at_a_period_doubling() -> None:
    r = computed(2.0, 0.05, 0.9, (0.3, 2.4))
    births = [e for e in r["period doubling"] if r.branches[e.branch].order == 1]
    assert len(births) == 4 and sum(b.kind == "sub2" for b in r.branches) == 3
    (b,) = (b for b in r.branches if b.order == 2 and b.end == "period doubling")
    flips = [e for e in r["period doubling"] if e.branch == 0]
    for end in (0, -1):
        flip = min(flips, key=lambda e: abs(e.Omega - b.Omega[end]))
        assert b.Omega[end] == pytest.approx(flip.Omega, abs=1e-6)
        assert b.u_max[end] == pytest.approx(flip.u_max, rel=1e-4)
    inside = float(b.Omega[-1]) + 1e-5 * (1 if b.Omega[-2] > b.Omega[-1] else -1)
    assert sum(s.order == 2 and abs(s.u_max - b.u_max[-1]) < 0.02 for s in r.at(inside)) == 1


def test_stability_changes_at_points_of_a_branch() -> None:
    """Also on period-2 branches."""
    for b in computed(2.0, 0.05, 0.9, (0.3, 2.4)).branches:
        for i in np.flatnonzero(b.stable[:-1] != b.stable[1:]):
            assert np.abs(b.radius[i : i + 2] - 1).min() < 1e-3


@pytest.mark.parametrize(
    ("n", "zeta", "forcing", "window"),
    [(0.7, 0.02, 0.05, (0.6, 1.3)), (3.0, 0.005, 0.02, (0.3, 1.3)), (1.5, 0.01, 0.3, (1.5, 2.5))],
)
def test_straight_lines_between_rows(n, zeta, forcing, window) -> None:
    """Against corrected orbits, at random frequencies and near folds: u_max at Omega and Omega at u_max."""
    r = computed(n, zeta, forcing, window)
    rows = [row for row in r.rows() if row["branch"] == "main"]
    assert 30 < len(rows) < 1000
    omega, u = (np.array([row[name] for row in rows]) for name in ("Omega", "u_max"))
    stable = np.array([row["stable"] for row in rows])
    rng = np.random.default_rng(4)
    wanted = [float(w) for w in rng.uniform(window[0], window[1], 6)]
    for e in r["fold"]:
        wanted += [e.Omega + side * float(d) for side in (-1, 1) for d in 10.0 ** rng.uniform(-5, -2, 2)]
    for w in wanted:
        for s in (s for s in r.at(w) if s.kind == "main"):
            i = np.flatnonzero((omega[:-1] <= w) != (omega[1:] <= w))
            height = u[i] + (w - omega[i]) / (omega[i + 1] - omega[i]) * (u[i + 1] - u[i])
            j = i[np.abs(height - s.u_max).argmin()]
            assert np.abs(height - s.u_max).min() < 1e-3 * s.u_max
            assert s.stable in (stable[j], stable[j + 1])
            i = np.flatnonzero((u[:-1] <= s.u_max) != (u[1:] <= s.u_max))
            if i.size and not np.isclose(s.u_max, r.peak[1], rtol=1e-3):
                place = omega[i] + (s.u_max - u[i]) / (u[i + 1] - u[i]) * (omega[i + 1] - omega[i])
                assert np.abs(place - w).min() < 1e-3 * w


def test_a_branch_is_drawn_without_gaps() -> None:
    """Stable, unstable, stable: three lines that share their ends, for any distance of the rows."""
    r = computed(3.0, 0.005, 0.02, (0.3, 1.3))
    drawn = Results(Path(), Curve.from_rows([]), response=vibration.columns_of(r.rows()))
    figure = vibration.response(drawn)
    lines = [line for line in figure.axes[0].lines if line.get_marker() == "None"]
    ends = [(np.asarray(line.get_xdata())[[0, -1]], np.asarray(line.get_ydata())[[0, -1]]) for line in lines]
    assert len(lines) == 1 + len(r["fold"])
    for (x, y), (x_next, y_next) in pairwise(ends):
        assert (x[1], y[1]) == (x_next[0], y_next[0])


@pytest.mark.parametrize("n", [0.6, 3.0])
def test_straight_lines_between_free_orbits(n: float) -> None:
    o = ContactOscillator(PowerLaw(n))
    rows = o.free()
    middle = o.free(0.5 * (rows.u0[1:] + rows.u0[:-1]))
    for name in ("omega_ratio", "u_min"):
        line = np.interp(middle.u0, rows.u0, getattr(rows, name))
        np.testing.assert_allclose(line, getattr(middle, name), rtol=1e-3)


def test_an_orbit_near_rest_that_another_start_leads_to_is_not_missing() -> None:
    """The linear response is far from it, with damping in contact only."""
    oscillator = ContactOscillator(PowerLaw(3.3), zeta=0.0018998719793791121, damping="contact")
    response = oscillator.response(0.028580478370612505)
    assert response.at(0.5) and response.notes == ()


def test_two_folds_between_two_points_are_found() -> None:
    """Omega turns as often along the rows of the branches as there are folds."""
    oscillator = ContactOscillator(PowerLaw(3.976767426169466), zeta=0.08519362424378724, damping="contact")
    response = oscillator.response(0.11089888030597267)
    turns = 0
    for branch in response.branches:
        steps = np.diff(branch.Omega)
        turns += np.count_nonzero(np.diff(np.sign(steps[steps != 0])))
    assert len(response["fold"]) == turns == 4


def test_a_loop_that_the_window_cuts_ends_at_the_window() -> None:
    """The same loop is whole in a wide window."""
    ends = []
    for window in ((0.9, 2.2), (1.4, 2.2)):
        (loop,) = (b for b in computed(1.5, 0.01, 0.15, window).branches if b.kind == "detached")
        assert (loop.end == "window") == (loop.Omega[0] in window) == (loop.Omega[-1] in window)
        ends.append(loop.end)
    assert ends == ["closed", "window"]


@pytest.mark.parametrize("low", [0.4, 0.5, 0.53])
def test_a_resonance_that_ends_in_the_window_is_found(low: float) -> None:
    """Three cycles in two forcing periods: stable up to the fold at 0.5443, on no other branch."""
    oscillator = ContactOscillator(PowerLaw(1.9574510939971683), zeta=0.006375104033240781, damping="contact")
    response = oscillator.response(0.24089059043568575, (low, 1.3))
    (orbit,) = (s for s in response.at(0.54) if s.stable and s.order == 2 and s.kind == "detached")
    expected = [[0.0891109, -0.9223050], [0.9262858, 0.8941701]]
    assert min(np.abs(orbit.states - np.roll(expected, k, axis=0)).max() for k in range(2)) < 1e-5


def test_an_orbit_near_rest_that_a_branch_reaches_is_not_missing() -> None:
    """Newton's method does not reach it from the linear response, the branch from high frequencies does."""
    for oscillator, forcing in (
        (ContactOscillator(PowerLaw(1.5), zeta=0.3, damping="contact"), 2.0),
        (ContactOscillator(PowerLaw(1.5), zeta=0.03, damping="contact"), 0.9),
    ):
        response = oscillator.response(forcing)
        assert [s.order for s in response.at(0.5)].count(1) % 2 == 1 and response.notes == ()


def test_both_orbits_of_a_loop_near_the_rim_of_a_series() -> None:
    """There the frequency falls within a few per cent of the amplitude."""
    series = TaylorLaw(1.0, 1.0, (1.8855659215430647, 1.669792922941482, -0.19108121435072092))
    response = ContactOscillator(series, zeta=0.003858935237335842).response(0.053319960004413754, (1.575, 1.783))
    assert sorted(s.stable for s in response.at(1.6861) if s.order == 2) == [False, True]


def test_a_loop_of_a_contact_that_is_linear_until_it_is_lost() -> None:
    """Two cycles in a forcing period, in flight: nothing about rest shows that such orbits exist."""
    oscillator = ContactOscillator(PowerLaw(0.9908), zeta=0.0109, damping="contact")
    response = oscillator.response(0.4, (0.3676, 0.71))
    (orbit,) = (s for s in response.at(0.4127) if 2.5 < s.u_max < 2.65)
    path = motion(response.equation, 0.4127, 0.4, orbit.states[0])
    assert orbit.stable and np.abs(path.end - orbit.states[0]).max() < 1e-4


def test_a_branch_does_not_turn_back_in_a_narrow_resonance() -> None:
    """At Omega = 1/7 a step across the loop of the seventh harmonic could lead back to where the branch came from."""
    z = [0.021155122523242257, 0.05087654042860941, 0.10306425827740617, 0.15900811014261837, 0.9427204339968897]
    F = [7.901131001306722e-09, 5.515864739683701e-07, 1.678886636911409e-05, 0.00013681899615136577, 0.751716882103207]
    k = [np.nan, np.nan, 0.000126224142003899, 0.0008950897664357512, 0.15992550343971648]
    oscillator = ContactOscillator(CurveLaw(z, F, k=k), load=F[2], zeta=1e-3)
    response = oscillator.response(0.0005101985670971285, (0.25127372782935037, 0.35325693027927896))
    (branch,) = response.branches
    assert response.notes == () and np.all(np.diff(branch.Omega) < 0)
