"""Rough elastic surfaces against small-slope theory for the whole block: force, area, similarity."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from asperity import reference
from asperity.arrays import Floats
from asperity.model.material import Material
from asperity.surface import WeierstrassMandelbrot
from asperity.verification.table import (
    LOCAL,
    Row,
    VerificationLevel,
    convergence_bar,
    counting_error,
    on_meshes,
    rows_along,
    sizes,
    solve_on_one_rank,
)

NU = 0.3
SCALES = (1.0, 0.5, 0.25)  # factors of the heights; only the last one gives slopes as small as theory assumes
CELLS = 512  # per side, of the boundary elements
MANY_SPOTS = 0.05  # area fraction above which the contact consists of more than a few asperities


@dataclass(frozen=True)
class _Loads:
    """P* over the factor of the heights, area fraction, and relative counting error of the area, each (loads,)."""

    P_star: Floats
    area: Floats
    counted: Floats


@dataclass(frozen=True)
class _Rough:
    """A surface and the approaches of the comparison (loads,) [L]."""

    name: str
    surface: WeierstrassMandelbrot
    approaches: Floats

    def solve(self, refinement: float, scale: float = SCALES[-1]) -> _Loads:
        """Solve with heights and approaches multiplied by a factor, on a separate mesh for each load."""
        surface = self.surface
        L = surface.L
        flatter = replace(surface, G=surface.G * scale ** (1.0 / (surface.D - 2.0)))
        steepness = surface.maximum()[2] - surface.mean()
        rows = []
        for d in self.approaches:
            h = 0.07 * L * min(1.0, d * L / steepness) ** 0.5
            result = solve_on_one_rank(
                flatter, Material(1.0, NU), delta_max=scale * d * L, steps=1, size=sizes(h, refinement, L)
            )
            rows.append((result.curve.P_star[0] / scale, result.curve.area_fraction[0], counting_error(result)))
        return _Loads(*np.array(rows).T)

    def theory(self, cells: int) -> _Loads:
        """Solve by boundary elements, whose P* is exactly proportional to the heights."""
        L = self.surface.L
        rows = [
            reference.half_space_contact(self.surface, cells, delta_star=d, height=L, nu=NU) for d in self.approaches
        ]
        P, area = np.array([(c.P_star, c.area_fraction) for c in rows]).T
        return _Loads(P, area, np.zeros(len(P)))


def rough(level: VerificationLevel) -> Iterator[Row]:
    """Force, area, similarity (theory.md) and area coefficient, for the tabulated surface and others.

    With finite slopes the block is softer or stiffer than in theory, by an amount of first order in the slope. This
    amount is measured on the coarsest mesh by reducing the heights, and is part of the error of theory.
    """
    for case in _surfaces(level):
        slope = case.surface.statistics().rms_slope
        coarse, expected = case.theory(CELLS // 2), case.theory(CELLS)
        grid = np.abs(coarse.P_star / expected.P_star - 1.0)
        spots = np.abs(coarse.area / expected.area - 1.0)
        results = on_meshes(level, case.solve)
        steep, half = (case.solve(level.refinements[0], s).P_star for s in SCALES[:2])
        flat = results[0].P_star
        finite = convergence_bar([steep, half, flat], order=1.0, ratio=2.0) / flat
        at = [f"delta* = {d:.4g}, {case.name}" for d in case.approaches]
        flatter = f"slope {SCALES[-1] * slope:.3f}"
        P = [r.P_star for r in results]
        yield from rows_along(
            "rough", [f"P*/s, {flatter}, {a}" for a in at], "small slope", P, expected.P_star, grid + finite
        )
        area = [r.area for r in results]
        yield from rows_along(
            "rough", [f"area fraction, {flatter}, {a}" for a in at], "small slope", area, expected.area,
            spots + finite, order=LOCAL, counted=results[-1].counted,
        )  # fmt: skip
        bars = convergence_bar(P) / P[-1]
        sloping = case.solve(level.finest, 1.0).P_star
        for i, a in enumerate(at):
            yield Row(
                "rough", f"P*, slope {slope:.3f}, {a}", "small slope", float(expected.P_star[i]), float(sloping[i]),
                float(bars[i]), float(grid[i] + finite[i] + abs(steep[i] / flat[i] - 1.0)),
            )  # fmt: skip
            yield Row(
                "rough", f"similarity, P* of half over a quarter of the heights over 2, {a}", "to the slope",
                1.0, float(half[i] / flat[i]), 0.0, SCALES[1] * slope,
            )  # fmt: skip
        first = int(np.argmax(expected.area >= MANY_SPOTS))
        low, high = reference.area_coefficient("persson"), reference.area_coefficient("bush-gibson-thomas")
        middle, values = 0.5 * (low + high), [r.area[first] * slope / r.P_star[first] for r in results]
        yield from rows_along(
            "rough", [f"kappa, {at[first]}"], "Persson to BGT", values, [middle], (high - middle) / middle, order=LOCAL,
            counted=results[-1].counted[first],
        )  # fmt: skip


def _surfaces(level: VerificationLevel) -> Iterator[_Rough]:
    """The tabulated surface at its loads, then others with the approach at half and all of the summit height."""
    points = reference.ROUGH_ELASTIC if level.full else reference.ROUGH_ELASTIC[1:3]
    block = reference.reduced_modulus(1.0, NU) / reference.block_modulus(1.0, NU)
    yield _Rough(
        "D 2.4", reference.rough_elastic_surface(), np.array([p.delta_star + block * p.P_star for p in points])
    )
    for D, seed in ((2.5, 1), (2.6, 2)) if level.full else ():
        surface = reference.rough_elastic_surface(D, seed=seed)
        summit = (surface.maximum()[2] - surface.mean()) / surface.L
        yield _Rough(f"D {D}, seed {seed}", surface, np.array([0.5, 1.0]) * summit)
