# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""What coarse meshes leave out of a rough surface, and tolerance runs of surfaces that no mesh of theirs resolves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import asperity as asp
from asperity.adaptive.extrapolation import Along, correct
from asperity.adaptive.mesh_plan import (
    AREA_ORDER,
    FACET_STEP,
    MARGIN,
    OF_GUIDE,
    SAFETY,
    SCATTER,
    YIELDED,
    facet_share,
    scatter,
    size_for_facets,
)
from asperity.adaptive.roughness import Omission, Roughness
from asperity.adaptive.solve_contact import solve_contact
from asperity.adaptive.solve_to_tolerance import refine
from asperity.curve import Curve
from asperity.errors import Interrupted
from asperity.mesh.generate import build_block
from asperity.mesh.top import Top
from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.model.settings import MEAN, POINT, MeshSize
from asperity.quasistatic.contact_result import PartialResult
from asperity.quasistatic.hooks import Hooks
from asperity.surface import HeightMap, SelfAffine, SurfaceWarning

ELASTIC = Material(1.0, 0.3)


def surface_of(seed: int = 1, **changes: Any) -> SelfAffine:
    keys: dict[str, Any] = {"L": 1.0, "H": 0.8, "slope": 0.2, "lambda_roll": 0.4, "lambda_short": 0.05}
    return SelfAffine(**{**keys, **changes}, seed=seed)


def test_a_finer_mesh_leaves_out_less() -> None:
    surface = surface_of()
    roughness = Roughness(Problem.of(surface, ELASTIC, delta_max=0.02, steps=4), 0.02, 4)

    def left_out(h: float) -> Omission:
        return roughness.left_out(Top.of(build_block(surface, 1.0, lambda x, y, depth: h + 0.3 * depth), surface))

    found = [left_out(h) for h in (0.08, 0.04, 0.02)]
    force, area = (np.array([abs(getattr(o, name)).max() for o in found]) for name in ("force", "area"))
    assert np.all(np.diff(force) < 0.0) and np.all(np.diff(area) < 0.0)
    assert force[-1] < 0.02


def test_four_cells_per_wave_are_enough_and_pixels_do_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A map of 257 x 257 heights without waves shorter than 12 pixels."""
    np.savez(tmp_path / "map.npz", z=surface_of(lambda_short=0.05).grid(257), L=1.0)
    problem = Problem.of(HeightMap(path=tmp_path / "map.npz"), ELASTIC, delta_max=0.02, steps=4)
    block = build_block(problem.surface, 1.0, lambda x, y, depth: 0.04 + 0.3 * depth)
    few = Roughness(problem, 0.02, 4)
    monkeypatch.setattr("asperity.adaptive.roughness.PER_WAVE", 16)
    many = Roughness(problem, 0.02, 4)
    cells = [len(roughness.contact_map().touched_at) for roughness in (few, many)]
    assert cells[0] < 257 < cells[1]
    force, exact = (roughness.left_out(Top.of(block, problem.surface)).force for roughness in (few, many))
    assert np.abs(exact).max() > 0.05
    assert np.abs(force - exact).max() < 0.01


def test_the_contact_map_holds_the_approaches() -> None:
    surface, parts = surface_of(), list[float]()
    roughness = Roughness(Problem.of(surface, ELASTIC, delta_max=0.02, steps=4), 0.02, 4, parts.append)
    x, y, _ = surface.maximum()
    found = roughness.contact_map()
    assert parts == [0.25, 0.5, 0.75, 1.0]
    assert found.depth(np.array([x]), np.array([y]))[0] == pytest.approx(0.005)
    assert np.isinf(found.touched_at).any()


def test_few_elements_in_the_spots_of_a_rough_surface_have_a_wider_bar() -> None:
    """Two meshes that agree by chance: what the edges of their contact leave open is the bar, as of no fine partner."""

    def rows(error: float) -> Curve:
        at = np.array([0.002, 0.004, 0.006])
        return Curve.from_rows([
            {"delta": d, "delta_star": d, "force": d, "P_star": d, "area_fraction": 0.01, "error_area_fraction": error}
            for d in at
        ])  # fmt: skip

    coarse, fine = rows(0.004), rows(0.002)
    steps, nothing = Along(np.array([0.0]), np.zeros(1)), Omission(fine.delta_star, np.zeros(3), np.zeros(3))
    shares = [
        facet_share(rough, plastic, dilatation)
        for rough in (False, True)
        for plastic, dilatation in ((False, POINT), (True, MEAN), (True, POINT))
    ]
    smooth, smooth_plastic, _, rough, free, locking = (
        correct(fine, coarse, 2.0, SAFETY, np.ones(3, dtype=bool), steps, 0.0, nothing, share)[1].mesh / fine.P_star
        for share in shares
    )
    assert smooth == pytest.approx(scatter(np.full(3, 0.4), np.full(3, 0.2), 2.0))
    assert smooth_plastic == pytest.approx(smooth)
    assert rough == pytest.approx(OF_GUIDE * smooth)
    assert free == pytest.approx(OF_GUIDE * YIELDED[MEAN] / SCATTER * smooth)
    assert locking == pytest.approx(OF_GUIDE * YIELDED[POINT] / SCATTER * smooth)
    assert np.all(locking > free)


def test_the_next_mesh_follows_what_cut_facets_leave() -> None:
    """The row that is farthest from its tolerance decides; no mesh is coarser, or finer by more than the limit."""
    wanted = np.array([0.05, 0.04])
    size = size_for_facets(0.03, np.array([0.05, 0.08]), wanted)
    assert 0.08 * (size / 0.03) ** AREA_ORDER == pytest.approx(MARGIN * 0.04)
    assert size_for_facets(0.03, np.array([0.01, 0.02]), wanted) == 0.03
    assert size_for_facets(0.03, np.array([0.5, 1.0]), wanted) == pytest.approx(0.03 / FACET_STEP)


def test_a_stop_while_a_mesh_is_judged_keeps_its_curve() -> None:
    """It takes effect before the next mesh."""

    def stage(name: str) -> None:
        if name.startswith("half-space with the waves"):
            stopped.append(name)
        if stopped:
            raise Interrupted(f"stopped by the test before the load path (next: {name})")

    stopped: list[str] = []
    problem = Problem.of(surface_of(4), ELASTIC, delta_max=0.015, steps=4)
    with pytest.raises(PartialResult, match="stopped by the test") as e:
        refine(problem, asp.AccuracyTarget(0.01), hooks=Hooks(on_stage=stage))
    assert len(stopped) == 1 and np.isfinite(e.value.result.curve.error_P_star).all()


@pytest.mark.parametrize("material", [ELASTIC, Material(1.0, 0.3, 0.02, 0.05)], ids=["elastic", "plastic"])
def test_coarse_meshes_that_are_not_touched_lead_to_finer_ones(material: Material) -> None:
    """Their smoothed summits of a steep surface are below the flat: no reason to refuse the case."""
    steep = surface_of(5, H=0.7, slope=10.0, lambda_roll=0.25, lambda_short=0.03)
    goal = asp.AccuracyTarget(0.05, max_dofs=20_000)
    with pytest.warns(SurfaceWarning):
        found = asp.solve_to_tolerance(steep, material, goal, delta_max=0.005, steps=5)
    assert not found.met and found.levels[-1].dofs > 1.5 * found.levels[0].dofs
    assert "the force has no error bar, no node is touched: the next mesh has about" in found.reason


@pytest.mark.parametrize(
    "material",
    [ELASTIC, pytest.param(Material(1.0, 0.3, 0.02, 0.05), marks=pytest.mark.slow)],
    ids=["elastic", "plastic"],
)
def test_the_bar_of_an_unresolved_surface_holds(material: Material) -> None:
    """Shortest waves of 0.05 L; the reference resolves them with elements of 0.012 L everywhere in the contact."""
    surface, depth = surface_of(4), 0.015
    found = asp.solve_to_tolerance(surface, material, asp.AccuracyTarget(0.08), delta_max=depth, steps=5)
    assert found.met
    sizes = [level.h for level in found.levels]
    assert min(sizes) > 0.02
    assert found.levels[0].dilatation == POINT
    assert {level.dilatation for level in found.levels[1:]} == {MEAN if material.plastic else POINT}
    fine = solve_contact(surface, material, delta_max=depth, steps=10, size=MeshSize(0.012, growth=0.2))
    loading = found.curve.loading()
    judged = loading.delta_star >= 0.999 * depth / 5
    P = np.interp(loading.delta_star, fine.curve.delta_star, fine.curve.P_star)
    assert np.all(np.abs(loading.P_star - P)[judged] <= loading.error_P_star[judged] + 0.01 * P[judged])
    A = np.interp(loading.delta_star, fine.curve.delta_star, fine.curve.area_fraction)
    e = np.interp(loading.delta_star, fine.curve.delta_star, fine.curve.error_area_fraction)
    assert np.mean(np.abs(loading.area_fraction - A)[judged] <= (loading.error_area_fraction + e)[judged]) >= 0.8
    assert np.all(found.budget.roughness[found.curve.branch == "load"][judged] > 0.0)


def test_a_tolerance_out_of_reach_names_the_cut_off() -> None:
    target = asp.AccuracyTarget(0.01, max_dofs=40_000)
    found = asp.solve_to_tolerance(surface_of(4), ELASTIC, target, delta_max=0.015, steps=5)
    assert not found.met and found.worst > 0.01
    assert "accuracy.max_dofs = 40000" in found.reason and "cut them off" in found.reason


@pytest.mark.mpi
def test_all_ranks_have_the_same_bar() -> None:
    surface, comm = surface_of(3), MPI.COMM_WORLD
    found = asp.solve_to_tolerance(surface, ELASTIC, asp.AccuracyTarget(0.2), delta_max=0.015, steps=5, comm=comm)
    bars = comm.allgather(found.budget.roughness.tolist())
    assert all(bar == bars[0] for bar in bars) and max(bars[0]) > 0.0
