"""The half-space that guides meshes and shows what they leave out, and tolerance runs on rough surfaces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ELASTIC, here, top_of
from scipy.special import ellipk

import asperity as asp
from asperity.adaptive.extrapolation import SCATTER
from asperity.adaptive.guide import Guide, spots_of
from asperity.adaptive.meshes import LevelSolver
from asperity.mesh.generate import build_block
from asperity.model.problem import Problem
from asperity.quasistatic.solve_problem import Callbacks
from asperity.reference import Hertz
from asperity.surface import HeightMap, SelfAffine


def surface_of(seed: int = 1, **changes: Any) -> SelfAffine:
    keys: dict[str, Any] = {"L": 1.0, "H": 0.8, "slope": 0.2, "lambda_roll": 0.4, "lambda_short": 0.05}
    return SelfAffine(**{**keys, **changes}, seed=seed)


def test_the_cells_are_enough_and_pixels_do_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A map of 257 x 257 heights without waves shorter than 12 pixels."""
    np.savez(tmp_path / "map.npz", z=surface_of(lambda_short=0.05).grid(257), L=1.0)
    problem = Problem.of(HeightMap(path=tmp_path / "map.npz"), ELASTIC, delta_max=0.02, steps=4)
    block = build_block(problem.surface, 1.0, lambda x, y, depth: 0.04 + 0.3 * depth)
    few = Guide(problem, 0.02, 4)
    monkeypatch.setattr("asperity.adaptive.guide.CELLS", (500, 500))
    many = Guide(problem, 0.02, 4)
    cells = [len(guide.sizes) for guide in (few, many)]
    assert cells[0] < 300 < cells[1]
    force, exact = (guide.left_out(top_of(block, problem.surface)).force for guide in (few, many))
    assert np.abs(exact).max() > 0.05
    assert np.abs(force - exact).max() < 0.01


def test_each_step_has_the_cells_that_its_spot_takes() -> None:
    """A spot of Hertz of half-widths from 0.006 to 0.015 L, of which 128 cells per side see four at first."""
    sphere = asp.Surface.from_spec("sphere", L=1.0, radius=2.0, centre=(0.5, 0.5), shape="paraboloid")
    guide = Guide(Problem.of(sphere, ELASTIC, delta_max=1.125e-4, steps=6), 1.125e-4, 6)
    assert guide.force == pytest.approx(Hertz(2.0, 1.0).force(guide.delta_star), rel=0.03)


def test_no_other_sizes_of_one_error_have_fewer_elements() -> None:
    rng = np.random.default_rng(2)
    pressure = np.zeros((64, 64))
    spots = [(slice(2, 12), slice(2, 12), 1.0), (slice(30, 36), slice(4, 60), 0.5), (slice(50, 54), slice(50, 54), 2.0)]
    for rows, columns, p in spots:
        pressure[rows, columns] = p
    half = np.array([0.5 * min(r.stop - r.start, c.stop - c.start) - 0.5 for r, c, _ in spots]) / 64
    area = np.array([(r.stop - r.start) * (c.stop - c.start) for r, c, _ in spots]) / 64**2
    share = np.array([pressure[r, c].sum() for r, c, _ in spots]) / pressure.sum()
    share[1] *= 0.5 * np.pi / ellipk(1.0 - (6.0 / 56.0) ** 2)  # what of the approach of an ellipse follows its width
    h = np.array([spots_of(pressure)[0][r.start, c.start] for r, c, _ in spots])
    assert np.sum(share * (h / half) ** 2) == pytest.approx(1.0)
    for _ in range(20):
        other = h * rng.uniform(0.5, 2.0, 3)
        other /= np.sqrt(np.sum(share * (other / half) ** 2))
        assert np.sum(area / other**2) >= np.sum(area / h**2) * (1.0 - 1e-9)


def test_flat_tops_with_sharp_edges_have_a_singular_pressure_and_smooth_ones_have_none() -> None:
    """A spot of Hertz that carries a third of the force, and the punch of a plateau."""
    x, y = np.meshgrid(*2 * [np.linspace(-1.0, 1.0, 201)])
    smooth, punch = (np.clip(1.0 - ((x - c) ** 2 + y**2) / 0.16, 0.0, None) for c in (-0.5, 0.5))
    smooth = np.sqrt(smooth)
    punch = np.where(punch > 0.0, 1.0 / np.sqrt(np.maximum(punch, 0.01)), 0.0)
    assert spots_of(smooth)[2] == spots_of(np.zeros((5, 5)))[2] == spots_of(np.ones((5, 5)))[2] == 0.0
    assert spots_of(punch)[2] == 1.0
    # of a solid that flows, everywhere and in a part of a spot
    assert spots_of(np.minimum(punch, 1.0), 1.0)[2] == spots_of(np.minimum(2.0 * smooth, 1.0), 1.0)[2] == 0.0
    assert spots_of(np.minimum(2.0 * smooth, 0.7).astype(np.single), 0.7)[2] == 0.0  # single precision rounds 0.7 down
    both = smooth / smooth.sum() + 2.0 * punch / punch.sum()
    assert spots_of(both)[2] == pytest.approx(2.0 / 3.0)
    assert spots_of(both)[3] == pytest.approx(0.5)  # by the lengths of the edges


def test_the_force_of_a_spot_scatters_with_its_place_by_a_part_of_what_its_area_does() -> None:
    """The ratio of the forces on two meshes has their scatter alone; the bar of the area is twice its deviation."""
    change, left_open = [], []
    for x, y in np.random.default_rng(5).uniform(0.4, 0.6, (6, 2)):
        sphere = asp.Surface.from_spec("sphere", L=1.0, radius=20.0, centre=(float(x), float(y)), shape="paraboloid")
        problem = Problem.of(sphere, ELASTIC, delta_max=2.8e-3, steps=5)
        run = LevelSolver(problem, Guide(problem, 2.8e-3, 5), asp.AccuracyTarget(0.1), here(), Callbacks())
        curves = []
        for _ in range(2):
            run.refine()
            curves.append(run.press().curve.loading())
        coarse, fine = curves
        change.append(np.log(coarse.P_star / fine.P_star))
        left_open.append(np.hypot(*(0.5 * c.error_area_fraction / c.area_fraction for c in (coarse, fine))))
    part = np.std(change, axis=0, ddof=1) / np.mean(left_open, axis=0)
    assert 0.5 * SCATTER < np.sqrt(np.mean(part**2)) < 1.7 * SCATTER
