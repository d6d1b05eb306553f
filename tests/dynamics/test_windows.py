# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The response over a window is that over a wider one, restricted; nothing stable is off it."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asperity.dynamics import ContactOscillator, PowerLaw

BENCHMARK = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "orbits.py"))


@pytest.mark.parametrize(
    ("n", "zeta", "forcing", "window", "wide", "omega"),
    [
        (1.5, 0.005, 0.04, (0.6, 0.8), (0.5, 1.3), (0.75,)),  # both ends in a softening resonance
        (0.63, 0.01295, 0.04828, (1.047, 1.4), (0.8, 1.4), (1.051,)),  # the low end in a hardening one
        (0.507, 0.00836, 0.02026, (1.0445, 1.4), (0.7, 1.4), (1.0485,)),
    ],
)
def test_a_window_that_cuts_a_resonance(n: Any, zeta: Any, forcing: Any, window: Any, wide: Any, omega: Any) -> None:
    o = ContactOscillator(PowerLaw(n), zeta=zeta)
    own, whole = o.response(forcing, window, subharmonics=False), o.response(forcing, wide, subharmonics=False)
    for w in omega:
        found, expected = ([(s.u_max, s.stable) for s in r.at(w)] for r in (own, whole))
        assert [stable for _, stable in found] == [stable for _, stable in expected]
        np.testing.assert_allclose([u for u, _ in found], [u for u, _ in expected], rtol=1e-4)
    assert not any("missing" in note for note in own.notes)


def test_the_stable_orbit_of_the_resonance_is_in_the_window() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.005)
    found = o.response(0.04, (0.6, 0.8)).at(0.75)
    assert [(round(s.u_max, 3), s.stable) for s in found] == [(0.091, True), (1.513, False), (1.571, True)]


@pytest.mark.parametrize("window", [(0.3, 0.5), (0.8, 1.2), (1.5, 2.5)])
def test_strong_forcing(window: tuple[float, float]) -> None:
    """Orbits mostly in flight: each settled motion is one of the response, whose orbits add up at both ends."""
    r = ContactOscillator(PowerLaw(1.5), zeta=0.01).response(5.0, window)
    assert {b.order for b in r.branches} >= {1, 2} and not r.notes


def test_random_windows() -> None:
    """Two of the benchmark's checks: no orbit of a wide window is missing, no settled motion is off the response."""
    random = np.random.default_rng(5)
    for case in BENCHMARK["random_windows"](8, 7):
        own = BENCHMARK["response"](case, case.omega)
        wide = BENCHMARK["response"](case, (0.5 * case.omega[0], 2.0 * case.omega[1]))
        omega = case.at[0]
        here = BENCHMARK["states"](own.at(omega))
        there = BENCHMARK["states"](tuple(s for s in wide.at(omega) if s.order < 4))
        assert not BENCHMARK["missing"](there, here), case
        if case.zeta > 0.02:
            assert not BENCHMARK["missing"](BENCHMARK["settled"](case, omega, 12, random), here), case


def test_what_is_not_searched_is_in_the_result() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.01)
    assert "240 starts; not searched: other periods" in o.response(0.05, (0.9, 1.1)).searched
    assert "from rest and the backbone; not" in o.response(0.001, (0.9, 1.1)).searched
