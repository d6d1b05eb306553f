"""Responses and free vibration of tables, whose laws have knots, against time integration by SciPy."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from twin import attractors, motion

from asperity.vibration import ContactOscillator, FrequencyResponse, PowerLaw, CurveLaw
from asperity.vibration.equation import motions
from asperity.vibration.orbits import Orbits
from asperity.errors import ConvergenceError

TABLES: dict[str, dict[str, Any]] = json.loads((Path(__file__).parent / "tables.json").read_text(encoding="utf-8"))


def oscillator(table: dict[str, Any]) -> ContactOscillator:
    more = {name: table[name] for name in ("k",) if name in table}
    return ContactOscillator(CurveLaw(table["z"], table["F"], **more), load=table["load"], zeta=table.get("zeta", 0.01))


def is_complete(r: FrequencyResponse, omega: float, starts: int, rng: np.random.Generator) -> int:
    """Assert that every attractor reached from random starts is an orbit of the response, once; their number."""
    own = [s.states for s in r.at(omega)]
    for i, a in enumerate(own):
        assert not any(b.shape == a.shape and np.abs(a - b).max() < 1e-6 for b in own[:i]), f"twice at {omega}"
    e, forcing = r.equation, r.setting.F_hat
    radius = min(1.5 * forcing / (2.0 * e.zeta) + 2.0 * forcing, 4.0)
    found = attractors(e, omega, forcing, radius * rng.uniform(-1.0, 1.0, (starts, 2)))
    for orbit in found:
        near = 1e-2 * (0.1 + np.abs(orbit[0]).sum())
        assert any(np.hypot(*(states - orbit[0]).T).min() < near for states in own), (omega, orbit)
    return len(found)


def test_the_response_of_the_demo_is_one_branch_with_its_folds() -> None:
    r = oscillator(TABLES["demo"]).response(0.018, (0.5, 1.3))
    (b,) = r.branches
    assert b.end == "window" and not r.notes and len(b) < 200
    assert len(list(r.rows())) < 600
    assert [round(e.Omega, 4) for e in r["fold"]] == [0.8347, 0.9576]
    assert [s.stable for s in r.at(0.9)] == [True, False, True]
    for s in r.at(0.9):
        path = motion(r.equation, 0.9, 0.018, s.states[0])
        np.testing.assert_allclose([*path.end, path.u_max, path.u_min], [*s.states[0], s.u_max, s.u_min], atol=1e-6)


@pytest.mark.parametrize(
    "name", ["21 uneven points", "preload near the end", pytest.param("60 points", marks=pytest.mark.slow)]
)
def test_no_attractor_of_a_table_is_missing(name: str) -> None:
    table, rng = TABLES[name], np.random.default_rng(1)
    r = oscillator(table).response(table["forcing"], table["omega"])
    assert all("the law is extrapolated" in note for note in r.notes)
    assert len(list(r.rows())) < 1000
    assert is_complete(r, float(rng.uniform(*table["omega"])), 4, rng)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_random_tables(seed: int) -> None:
    """Few points, kinks, a plateau, a stiff end, slopes given, preloads at a point and near the ends."""
    rng = np.random.default_rng(seed)
    z = np.append(np.sort(rng.uniform(0.02, 0.98, rng.integers(5, 60))), 1.0)
    n, at = rng.uniform(1.0, 3.0), rng.uniform(0.3, 0.8)
    added = [
        0.0 * z,
        3.0 * np.maximum(z - at, 0.0),
        -0.8 * np.maximum(z - at, 0.0),
        20.0 * np.maximum(z - 0.9, 0.0) ** 2,
    ]
    F = np.maximum.accumulate(z**n + added[seed % 4]) * (1.0 + 1e-6 * np.arange(z.size))
    k = n * F / z * np.exp(0.2 * rng.normal(size=z.size)) if seed % 5 == 0 else None
    law = CurveLaw(z, F, k=k)
    load = (law.top, 0.98 * law.top, float(law.F[z.size // 2]), law.top * rng.uniform(0.1, 0.9))[seed % 4]
    zeta, forcing = np.exp(rng.uniform(np.log([0.005, 0.01]), np.log([0.05, 0.4])))
    low = rng.uniform(0.35, 1.2)
    r = ContactOscillator(law, load=load, zeta=float(zeta)).response(float(forcing), (low, low + rng.uniform(0.2, 1.0)))
    assert all("the law is extrapolated" in note for note in r.notes)
    for omega in rng.uniform(r.omega[0], r.omega[1], 2):
        is_complete(r, float(omega), 8, rng)


def test_the_period_of_a_table_with_a_knot_beside_the_preload() -> None:
    """Against the time integration of half a period, and to 1e-11 against the period map."""
    table = TABLES["knot beside the preload"]
    o = oscillator(table)
    omega = float(o.free([table["u0"]]).omega_ratio[0])
    assert omega == pytest.approx(table["own_omega"], rel=1e-11)

    def field(t: float, y: np.ndarray) -> list[float]:
        return [y[1], -float(o.restoring.f(y[:1])[0])]

    run = solve_ivp(
        field, (0, np.pi / omega), [table["u0"], 0.0], method="DOP853", rtol=1e-12, atol=1e-15, max_step=0.01
    )
    assert abs(run.y[1, -1]) < 1e-9 * table["u0"]  # at rest again
    free = ContactOscillator(o.law, load=o.load, zeta=0.0).equation
    end = motions(free, [table["u0"], 0.0], omega, 0.0, rtol=1e-13).end[0]
    np.testing.assert_allclose(end, [table["u0"], 0.0], atol=1e-11)


def test_a_contact_whose_stiffness_is_infinite_where_it_is_lost() -> None:
    """F ~ z^0.25 below the first points: no step meets the tolerance up to z = 0, and the response must end."""
    table = TABLES["stiff at contact loss"]
    o = oscillator(table)
    m = motions(o.equation, [-9.8, 3.2], 0.80264, table["forcing"], length=4.0 * np.pi, rtol=1e-10)
    assert m.steps < 600
    decay = np.exp(-2.0 * o.zeta * 4.0 * np.pi / 0.80264)
    assert np.linalg.det(m.by_end[0, :, :2]) == pytest.approx(decay, rel=1e-7)
    r = o.response(table["forcing"], table["omega"])
    assert len(list(r.rows())) < 1000
    (orbit,) = (s for s in r.at(0.80264) if s.order == 2 and s.stable)

    def field(t: float, y: np.ndarray) -> list[float]:
        pull = float(o.restoring.f(y[:1])[0])
        return [y[1], table["forcing"] * np.cos(0.80264 * t) - pull - 2.0 * o.zeta * y[1]]

    more = {"method": "RK45", "rtol": 1e-10, "atol": 1e-12, "max_step": 0.01}
    run = solve_ivp(field, (0, 2.0 * np.pi / 0.80264), orbit.start, **more)
    np.testing.assert_allclose(run.y[:, -1], orbit.states[1], atol=2e-6)


def test_motions_that_fail_count_as_work() -> None:
    taylor = ContactOscillator(PowerLaw(1.5), zeta=0.01).taylor()
    m = motions(taylor.equation, [[0.1, 0.0], [50.0, -50.0]], 1.0, 0.0)
    assert np.isfinite(m.end[0]).all() and np.isnan(m.end[1]).all()
    assert m.steps > motions(taylor.equation, [0.1, 0.0], 1.0, 0.0).steps
    orbits = Orbits(taylor.equation, taylor.setting(0.1), (0.5, 1.3))
    with pytest.raises(ConvergenceError):
        orbits.at(np.append(np.full(8, 50.0), 1.0), 50.0)
    assert orbits.work > 0
