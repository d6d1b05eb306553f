"""Leakage: transmissivity of known gaps, channels that close, and the bars of the curve."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ELASTIC, here, make_block, make_contact_solver

import asperity as asp
from asperity.arrays import Floats
from asperity.model.settings import MeshSize
from asperity.output.fields import gather_top_states
from asperity.output.results import Raster
from asperity.quasistatic.solve_problem import Callbacks, solve_problem
from asperity.quasistatic.thin_film import ThinFilm, transmissivity
from asperity.surface import Flat, HeightMap, Surface

NODES = 129


def flow(surface: Surface, gap: float, h: float, sides: str = "rollers") -> Floats:
    """Transmissivities along x and y of a solid at rest below a flat at the distance `gap` from its summit [L^3]."""
    block = make_block(here(), surface, 1.0, 0.5, MeshSize(h, h_max=h), sides)
    solver = make_contact_solver(here(), surface, block, ELASTIC, sides=sides)
    solver.contact.begin(np.inf)
    solver.contact.residual(solver.solid.internal_force())
    solver.delta = -gap
    found = ThinFilm(solver.contact_surface, surface, solver.summit)(solver)
    assert found["hydraulic_aperture"] ** 3 == pytest.approx(np.mean([*found.values()][:2]))
    return np.array([found["transmissivity_x"], found["transmissivity_y"]])


@pytest.mark.parametrize("sides", ["rollers", "periodic"])
def test_parallel_plates(sides: str) -> None:
    assert flow(Flat(L=1.0), 0.1, 0.2, sides) == pytest.approx(np.full(2, 1e-3), rel=1e-12)


def test_wave_across_and_along_the_flow() -> None:
    """1/mean(g^-3) across and mean(g^3) along, of a wave of two thirds of the gap; coarse facets are divided."""
    x = np.linspace(0.0, 1.0, NODES)
    wave = HeightMap.of(0.02 * np.cos(2.0 * np.pi * np.tile(x, (NODES, 1))), 1.0)
    g = 0.03 + 0.02 * (1.0 - np.cos(2.0 * np.pi * (np.arange(10_000) + 0.5) / 10_000)) - 0.02
    exact = np.array([1.0 / np.mean(g**-3.0), np.mean(g**3)])
    assert flow(wave, 0.01, 0.25) == pytest.approx(exact, rel=2e-3)
    assert flow(wave, 0.01, 0.05) == pytest.approx(exact, rel=1e-3)


def strip(closed: list[tuple[int, int]]) -> float:
    """Flow along x through squares of two triangles each, 2 x 2, with some of the edges closed."""
    numbers: dict[tuple[float, float], int] = {}
    edges, shut = [], []
    for i in range(2):
        for j in range(2):
            a, b, c, d = (i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)
            for corners in ((a, b, c), (a, c, d)):
                middles = [tuple(np.mean([p for p in corners if p != q], axis=0)) for q in corners]
                edges.append([{0.0: -1, 2.0: -2}.get(m[0], numbers.setdefault(m, len(numbers))) for m in middles])
                shut.append([m in [(p / 2, q / 2) for p, q in closed] for m in middles])
    # twice the cotangents of right angles at b and d and of 45 degrees at the others, per corner
    links = np.tile([[2.0, 0.0, 2.0], [2.0, 2.0, 0.0]], (4, 1))
    return transmissivity(np.array(edges), links, np.array(shut))


def test_channels_open_through_edges_and_not_through_points() -> None:
    """Closed edges on a diagonal leave triangles that meet in a point: no fluid goes through it."""
    assert strip([]) == pytest.approx(1.0)
    assert 0.0 < strip([(2, 3)]) < 0.7
    assert strip([(2, 1), (2, 3)]) == 0.0


def test_ridge_closes_the_flow_across_it_alone() -> None:
    """A pressed ridge: nothing passes, and along it the flow is the mean of the cubes of the gap."""
    x = np.linspace(0.0, 1.0, NODES)
    ridge = HeightMap.of(0.01 * np.cos(2.0 * np.pi * (np.tile(x, (NODES, 1)) - 0.5)), 1.0)
    problem = asp.Problem.of(ridge, ELASTIC, delta_max=0.004, steps=2, size=MeshSize(0.05, h_max=0.1))
    result = solve_problem(problem, hooks=Callbacks(flow=True), comm=here())
    curve, solver = result.curve, result.solver
    top = solver.contact_surface
    along = top.mean(np.maximum(solver.gap(), 0.0) ** 3)
    assert np.all(curve.transmissivity_x == 0.0)
    assert curve.transmissivity_y[-1] == pytest.approx(along, rel=0.02)
    assert np.all(np.diff(curve.transmissivity_y) < 0.0)


def test_bars_hold_what_a_finer_mesh_finds() -> None:
    """A crest and its neighbours; the flow loses nine tenths."""
    wave = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.01, dims=2)
    run = asp.solve_contact(wave, ELASTIC, tolerance=0.1, flow=True, delta_max=0.01, steps=3)
    fine = asp.Problem.of(wave, ELASTIC, delta_max=0.0105, steps=7, size=MeshSize(0.03, h_max=0.1))
    exact = solve_problem(fine, hooks=Callbacks(flow=True), checked=False).curve
    for name in ("transmissivity_x", "hydraulic_aperture"):
        value, bar = getattr(run.curve, name), getattr(run.curve, f"error_{name}")
        truth = np.exp(np.interp(*map(np.log, (run.curve.P_star, exact.P_star, getattr(exact, name)))))
        assert np.all(np.abs(value - truth) <= bar) and np.all(bar < 0.5 * value)


def test_grid_keeps_area_and_flow() -> None:
    """Finite volumes on the gap of a regular grid: contact area and transmissivity of the curve."""
    wave = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.01, dims=2)
    problem = asp.Problem.of(wave, ELASTIC, delta_max=0.01, steps=2, size=MeshSize(0.08, h_max=0.1))
    result = solve_problem(problem, hooks=Callbacks(flow=True, snapshots=1), comm=here())
    gap = Raster(gather_top_states(result, 1.0, 1.0), n=300).gap(0)
    last = result.curve.loading()
    assert np.mean(gap == 0.0) == pytest.approx(last.area_fraction[-1], rel=0.01)
    along, across = asp.reference.flow(gap)
    assert along.mean() == pytest.approx(last.transmissivity_x[-1], rel=0.02)
    assert along.mean(axis=0) == pytest.approx(asp.reference.transmissivity(gap), rel=1e-9)  # nothing is lost
    assert not (along[gap == 0.0].any() or across[gap == 0.0].any()) and across.any()
