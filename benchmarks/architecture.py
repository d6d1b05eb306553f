# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Draw docs/pictures/architecture.svg: the packages of asperity in their order, with arrows from the imports.

Run: python3 benchmarks/architecture.py [FILE]. Order and imports are those of tests/test_architecture.py. An arrow that
others imply is left out (the transitive reduction of the imports), and so are those to what nearly every package uses.
An import against the order is drawn in red.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from test_architecture import IMPORTS, ORDER, root  # noqa: E402

from asperity.plot import style  # noqa: E402

COMMON = ("errors", "arrays", "units", "runtime")
NOT_SHOWN = (*COMMON, "__version__", "__main__", "_solver")
WIDE, HIGH = 0.86, 0.44  # of a box
INK, WRONG = "#335", "#c22"
COLUMN = {
    "power_law": -2.6, "curve": -2.6, "dynamics": -2.6, "verification": -2.8, "transient": -1.2, "case": -0.6,
    "surface": 0.3, "mesh": 0.4, "linear": 0.4, "fem": 0.9, "model": 1.2, "contact": 1.5, "adaptive": 1.7, "plot": 2.9,
    "output": 2.9, "reference": 2.9,
}  # fmt: skip
Graph = Mapping[str, set[str]]


def arrows() -> tuple[dict[str, set[str]], dict[str, set[str]]]:
    """For each package the lower ones that it imports, and those that it must not import."""
    row = {name: i for i, names in enumerate(ORDER) for name in names}
    down: dict[str, set[str]] = {name: set() for name in row if name not in NOT_SHOWN}
    up: dict[str, set[str]] = {name: set() for name in down}
    for module, others in IMPORTS.items():
        for a, b in ((root(module), root(other)) for other in others):
            if a != b and a in down and b in down:
                (down if row[a] > row[b] else up)[a].add(b)
    return down, up


def below(graph: Graph, start: str) -> set[str]:
    """Packages that one needs, by any number of arrows."""
    return graph[start].union(*(below(graph, name) for name in graph[start]))


def reduced(graph: Graph) -> dict[str, set[str]]:
    """Arrows that no others imply."""
    return {own: {b for b in some if not any(b in below(graph, a) for a in some - {b})} for own, some in graph.items()}


def places(graph: Graph) -> dict[str, tuple[float, float]]:
    """Place of each package: its row of ORDER, and a column where the straight arrows pass the other boxes."""
    rows = [row for names in ORDER if (row := [name for name in names if name in graph])]
    return {name: (COLUMN.get(name, 0.0), float(y)) for y, row in enumerate(rows) for name in row}


def draw() -> Figure:
    """The picture."""
    down, up = arrows()
    shown = reduced(down)
    place = places(shown)
    top, side = max(y for _, y in place.values()), max(abs(x) for x, _ in place.values()) + WIDE
    figure = Figure(figsize=(6.4, 0.55 * (top + 2.6)), layout="constrained")
    axis = figure.subplots()
    for graph, colour in ((shown, INK), (up, WRONG)):
        for own, others in graph.items():
            for other in others:
                _arrow(axis, place[own], place[other], colour)
    for name, (x, y) in place.items():
        _box(axis, name, x, y, WIDE)
    _box(axis, ",  ".join(COMMON) + "   (nearly all use them: no arrows)", 0.0, -1.0, 2 * side)
    axis.set(xlim=(-side - 0.05, side + 0.05), ylim=(-1.3, top + 0.3))
    axis.axis("off")
    return figure


def _arrow(axis: Any, start: tuple[float, float], end: tuple[float, float], colour: str) -> None:
    (xa, ya), (xb, yb) = start, end
    half = HIGH / 2 if ya > yb else -HIGH / 2
    lean = 0.2 * WIDE * max(-1.0, min(1.0, xb - xa))
    bend = 0.0 if colour == INK else 0.15
    axis.add_patch(
        FancyArrowPatch(
            (xa + lean, ya - half), (xb - lean, yb + half), arrowstyle="-|>", mutation_scale=11, lw=1.1, color=colour,
            connectionstyle=f"arc3,rad={bend}", shrinkA=0, shrinkB=1, zorder=1,
        )
    )  # fmt: skip


def _box(axis: Any, text: str, x: float, y: float, wide: float) -> None:
    axis.add_patch(
        FancyBboxPatch(
            (x - wide / 2, y - HIGH / 2), wide, HIGH, boxstyle="round,pad=0,rounding_size=0.07", fc="#e8eff6", ec=INK,
            lw=0.9, zorder=2,
        )
    )  # fmt: skip
    axis.text(x, y, text, ha="center", va="center", fontsize=8, zorder=3)


def main() -> None:
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/pictures/architecture.svg"
    style.save(draw(), path)
    print(f"written {path}")


if __name__ == "__main__":
    main()
