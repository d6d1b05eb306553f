"""Map of the regimes of cases/paper/map.toml, and the resonance of the paper's cubic law, for benchmarks/paper.py."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from interface import FULL
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from asperity.case import Case
from asperity.dynamics import ContactOscillator, PowerLaw
from asperity.plot import style
from asperity.study import Study, StudyResults

SIDES = {"rollers": "rollers", "free": "free sides"}
COLUMNS = ("n", "n_log", "area_fraction", "block_load")
LIMITS = 0.4, 3.0  # of the exponents that colours show
CUBIC = (2.0, 2.6, 3.0, 3.3, 3.4, 3.6)  # exponents
Points = dict[tuple[float, float], dict[str, float]]


def place(case: Case) -> tuple[float, float]:
    """Depth of the mean plane below the summit over the range, and pressure of the elastic block over its yield."""
    surface, solid, sides = case.build_surface(), case.material.solid, case.block.sides
    delta = case.loading.delta_max
    assert delta is not None
    depth = (surface.maximum()[2] - surface.mean()) / delta
    return depth, solid.block_modulus(sides) * delta / case.block.height / solid.yield_pressure(sides)


def points(study: Study, results: StudyResults, family: str) -> Points:
    """Means over the seeds by place, places of one level averaged; NaN where the load is refused as full contact."""
    found: Points = {}
    rows = [row for row in results.rows if family in str(row["families"]).split()]
    cases = {entry.key: entry.case for entry in study.entries}
    levels: dict[tuple[float, float], list[tuple[float, float]]] = {}
    values: dict[tuple[float, float], list[list[float]]] = {}
    for row in rows:
        level = row["surface.G"], row["material.yield_strength"]
        levels.setdefault(level, []).append(place(cases[row["case"]]))
        values.setdefault(level, []).append([float(row[c]) if row[c] is not None else np.nan for c in COLUMNS])
    for level, places in levels.items():
        depth, load = (float(v) for v in np.mean(places, axis=0))
        known = np.asarray(values[level])
        mean = np.nanmean(known, axis=0) if np.isfinite(known).all(axis=1).any() else np.full(len(COLUMNS), np.nan)
        found[depth, load] = dict(zip(COLUMNS, (float(v) for v in mean), strict=True))
    return found


def table(study: Study, results: StudyResults) -> list[tuple[str, ...]]:
    """Every point of the map."""
    rows: list[tuple[str, ...]] = [("sides", "depth/range", "elastic pressure/p_Y", "n", "n, log fit", "A/A₀", "p/p_Y")]
    for family, sides in SIDES.items():
        for (depth, load), v in sorted(points(study, results, family).items()):
            shown = [f"{v[c]:.3f}" if np.isfinite(v[c]) else "full contact" for c in COLUMNS]
            rows.append((sides, f"{depth:.2f}", f"{load:.2f}", *shown))
    return rows


@style.styled
def regime_map(study: Study, results: StudyResults) -> Figure:
    """Exponent over depth of the mean plane and block yield ratio, for both kinds of sides."""
    figure, axes = style.figure(style.DOUBLE, 4.0, columns=2)
    norm = TwoSlopeNorm(1.0, *LIMITS)
    for axis, family in zip(axes, SIDES, strict=True):
        image = draw_map(axis, points(study, results, family), norm)
        axis.set_xlabel("depth of the mean plane / range of approach")
        axis.set_ylabel("elastic pressure of the block / its yield pressure")
    figure.colorbar(image, ax=axes, label="exponent $n$", extend="max")
    style.titles(axes, list(SIDES.values()))
    return figure


def draw_map(axis: Axes, found: Points, norm: TwoSlopeNorm) -> QuadMesh:
    """Draw the cells of one map with their exponents, and what is beyond a limit."""
    depths, loads = (np.array(sorted({round(np.log10(p[i]), 3) for p in found})) for i in (0, 1))
    grid = np.full((len(loads), len(depths)), np.nan)
    for (depth, load), value in found.items():
        j, i = np.abs(depths - np.log10(depth)).argmin(), np.abs(loads - np.log10(load)).argmin()
        grid[i, j] = value["n"]
        if not np.isfinite(value["n"]):
            text, colour = "full", style.GREY
        else:
            closed, yields = value["area_fraction"] >= FULL, value["block_load"] >= 1.0
            text = f"{value['n']:.2f}" + "\n" * (closed or yields) + "c" * closed + "y" * yields
            colour = "white" if norm(value["n"]) > 0.85 or norm(value["n"]) < 0.15 else "black"
        axis.text(depths[j], loads[i], text, ha="center", va="center", fontsize=7, color=colour)
    image = axis.pcolormesh(depths, loads, grid, norm=norm, cmap="RdBu_r", shading="nearest")
    axis.set_facecolor("0.9")
    for setter, values in ((axis.set_xticks, depths), (axis.set_yticks, loads)):
        setter(values, [f"{10**v:.2g}" for v in values])
    return image


def cubic() -> Iterator[tuple[str, ...]]:
    """Rows n, peak of the exact law, of the cubic one, and the least u on its branch at the peak."""
    for n in CUBIC:
        exact = ContactOscillator(PowerLaw(n), zeta=0.01)
        shown = []
        for oscillator in (exact, exact.taylor()):
            branch = oscillator.response(0.03, (0.3, 1.4), subharmonics=False).lines()[0]
            top = int(np.argmax(branch.u_max))
            shown += [f"{branch.Omega[top]:.3f}", f"{branch.u_min[top]:.2f}"]
        yield (f"{n:g}", shown[0], shown[2], shown[3])
