"""Height maps in text files: matrices, with or without coordinates, points x, y, z, and grids with a header."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asperity.arrays import Array
from asperity.runtime.text_table import SEPARATORS, TextTable
from asperity.surface.text_header import Header, length_unit

OFF_GRID = 0.1  # greatest distance of a point from its place on the grid, over the step; coordinates are rounded
STRAIGHT = 0.02  # the same for coordinates in the first row or column of a matrix
SPARSE, FILLED = 2.0, 100  # places along an axis over those with points, and on a grid, beyond which it is none
LEAST = 8  # rows of a map
PROFILE = (
    "a contact needs heights over an area; measure a map, or write the profile as ridges: a map of so many equal rows "
    "that it is square"
)
_SCALE = re.compile(r"unit|einheit|fa[ck]tor|scal|skal|[ck]alib|conver|[\[(][nuµm]?m[\])]", re.IGNORECASE)
_FEW = 5  # rows that are compared with the first one


@dataclass(frozen=True, eq=False)
class Heights:
    """Heights of a file.

    Attributes:
        z: heights (ny, nx), index [iy, ix], NaN where they are missing [m]
        dx, dy: distances along x and y, None without one [m]
        tip_radius, resolution: of the instrument, 0 where unknown [m]
        channel: of the file, or name of the array; empty where there is one only
        notes: what was read and what was left, a sentence each
    """

    z: Array
    dx: float | None
    dy: float | None
    tip_radius: float = 0.0
    resolution: float = 0.0
    channel: str = ""
    notes: tuple[str, ...] = ()


def read_text_map(
    path: Path,
    unit: float | None,
    clean: Callable[[Array], Array],
    pixel: tuple[float, float] | None = None,
    decimal: str | None = None,
) -> Heights:
    """Read a map.

    Args:
        path: the file
        unit: of the lengths whose unit the file does not name [m]; default metres
        clean: puts NaN in place of heights that mark missing ones (unit of the file)
        pixel: distances between heights that are known [m]; with the unit, lines of the header that are not understood
            do not matter
        decimal: "." or ","; default as found

    Raises:
        ValueError: it holds no map, or its header or its numbers can be read in several ways; the message says what to
            give
    """
    text = TextTable.read(path, 2, decimal)
    try:
        table = text.numbers()
    except ValueError:  # the first row and column may be coordinates, with a word in their corner
        table = text.numbers(corner=True)
        if np.isfinite(table[0, 0]) or _progression(table[0, 1:]) is None:
            raise
    lines, names = text.header, []
    above = max((i for i, line in enumerate(text.lines[: text.first], 1) if line.strip()), default=0)
    if lines and lines[-1][0] == above and len(last := text.cells(lines[-1][1])) == table.shape[1]:
        lines, names = lines[:-1], last
    named = text.cells(lines[-1][1]) if lines else []
    if names and len(named) == len(names) and all(length_unit(name.strip("[]()")) for name in names):  # units below
        lines, names = lines[:-1], [f"{name} [{unit.strip('[]()')}]" for name, unit in zip(named, names, strict=True)]
    if table.shape[1] == 4 and names and names[0] == "" and _progression(table[:, 0]) is not None:
        table, names = table[:, 1:], names[1:]  # the index of a data frame
    if table.shape[1] == 3 and "".join(names[1:]).lower()[:1] == "x" and "y" not in "".join(names).lower():
        table = table[:, 1:]
    if table.shape[1] == 2:
        raise ValueError(f"{len(table)} lines of two numbers are a profile, not a map: {PROFILE}")
    if table.shape[1] == 3:
        return _of_points(table, lines, names, unit, clean)
    table, dy, dx, notes = _coordinates(table)
    if min(table.shape) < LEAST:
        raise ValueError(
            f"{table.shape[0]} rows of {table.shape[1]} cells separated by {SEPARATORS[text.separator]}, from row "
            f"{text.first + 1} on, are no map: give at least {LEAST} x {LEAST} heights, or lines of x, y, z"
        )
    usual = 1.0 if unit is None else unit
    header = Header.read(lines, (table.shape[0], table.shape[1]), usual)
    _ask(header, unit, pixel)
    table[np.isin(table, header.nodata)] = np.nan
    lateral = header.lateral
    if lateral is None and pixel is not None and (dx is not None or dy is not None):  # they follow the pixel
        lateral = pixel[0] / dx if dx is not None else pixel[1] / dy  # type: ignore[operator]
    factor = usual if lateral is None else lateral
    dx, dy = (own if own is not None else step and factor * step for own, step in ((header.dx, dx), (header.dy, dy)))
    height = usual if header.height is None else header.height
    return Heights(height * clean(table), dx, dy, notes=(*notes, *_said(header)))


def _ask(header: Header, unit: float | None, pixel: tuple[float, float] | None) -> None:
    """Refuse a header that leaves a length open, unless the user has given pixel and unit."""
    if header.other and unit is None:
        raise ValueError(
            f"the header gives heights in {header.other!r}, which is no length: give --unit, a name or the metres of "
            "one unit, as --unit 6e-8"
        )
    if header.questions and (unit is None or pixel is None):
        number, line = header.questions[0]
        more = f" and {len(header.questions) - 1} more" if len(header.questions) > 1 else ""
        raise ValueError(
            f"line {number} of the header, {line[:60]!r}{more}, is not understood: give the lengths yourself, the "
            "distance between heights in metres and the unit of heights (--pixel 1e-6 --unit um), or the metres of one "
            "unit (--unit 6e-8), or remove the line"
        )


def _said(header: Header) -> list[str]:
    return [f"the header gives {' and '.join(header.said)} of the heights"] if header.said else []


def _coordinates(table: Array) -> tuple[Array, float | None, float | None, list[str]]:
    """Heights of a matrix, the steps along y and x of coordinates in its first column and row, and what was taken."""
    notes: list[str] = []
    steps: list[float | None] = [None, None]
    taken, signs = [0, 0], [1, 1]
    edges = table[1:, 0], table[0, 1:]
    found = [_progression(edge) for edge in edges]
    bare = not np.isfinite(table[0, 0])
    both = found == [None, None] and all(map(_monotonic, edges)) and not any(map(_monotonic, table[1::7, 1:]))
    for axis, name in enumerate(("column", "row")):
        rows = table[:, 1:].T if axis == 0 else table[1:]
        straight = any(_progression(row) is not None for row in rows[:: max(1, len(rows) // _FEW)])
        plane = straight and _progression(table[:, 0] if axis == 0 else table[0]) is not None
        if both or (found[axis] is None and bare and _monotonic(edges[axis]) and not straight):
            raise ValueError(
                f"the first {name} looks like coordinates in steps that differ: give them in equal steps, or heights "
                "only"
            )
        if found[axis] is None or plane:
            continue
        if straight:
            raise ValueError(
                f"the first {name} may be coordinates or heights, for others rise in equal steps as it does: give "
                "heights only, with --pixel, or lines of x, y, z"
            )
        first, step = found[axis]  # type: ignore[misc]
        index = step == 1.0 and first in (0.0, 1.0, 2.0)
        notes.append(f"the first {name} is {'an index' if index else 'coordinates'}, not heights")
        steps[axis], taken[axis], signs[axis] = None if index else abs(step), 1, -1 if step < 0 else 1
    return table[taken[1] :, taken[0] :][:: signs[0], :: signs[1]], steps[0], steps[1], notes


def _progression(values: Array) -> tuple[float, float] | None:
    """First value and step of values in equal steps, None if they are not."""
    if len(values) < LEAST or not np.isfinite(values).all():
        return None
    step = float(values[-1] - values[0]) / (len(values) - 1)
    if step == 0.0 or not np.isfinite(step):
        return None
    off = np.abs(values - values[0] - step * np.arange(len(values))).max()
    return (float(values[0]), step) if off <= STRAIGHT * abs(step) else None


def _monotonic(values: Array) -> bool:
    steps = np.diff(values)
    return bool(len(values) >= LEAST and (np.all(steps > 0) or np.all(steps < 0)))


def _of_points(
    table: Array, lines: list[tuple[int, str]], names: list[str], unit: float | None, clean: Callable[[Array], Array]
) -> Heights:
    """Map of points x, y, z in any order; places without a point are NaN."""
    usual = 1.0 if unit is None else unit
    if names:
        order = ["".join(re.findall(r"[xyzh]", name.lower()[:3])[:1]).replace("h", "z") for name in names]
        if sorted(order) != ["x", "y", "z"]:
            raise ValueError(f"the columns {', '.join(names)[:60]} are not x, y and z: name them x, y, z")
        places = [order.index(axis) for axis in "xyz"]
        table, names = table[:, places], [names[i] for i in places]
    header = Header.read(lines, (len(table), 1), usual)
    header.questions = [(i, line) for i, line in header.questions if _SCALE.search(line)]
    _ask(header, unit, None if unit is None else (unit, unit))
    own = [
        length_unit(match[1]) if (match := re.search(r"[\[(/_]\s*([^\W\d_]+)", name)) else None for name in names
    ] or [None] * 3
    common = [header.lateral, header.lateral, header.height]
    units = [a if a is not None else b for a, b in zip(own, common, strict=True)]
    if unit is None and 0 < units.count(None) < 3:
        raise ValueError("the file names the unit of some of x, y and z only: give that of the others (--unit)")
    ux, uy, uz = (usual if one is None else one for one in units)
    for value in header.nodata:
        table[table[:, 2] == value, 2] = np.nan
    known = np.isfinite(table[:, :2]).all(axis=1)
    (nx, dx, ix), (ny, dy, iy) = (_places(table[known, i], "xy"[i]) for i in (0, 1))
    if np.unique(iy * nx + ix).size != ix.size:
        raise ValueError("several points x, y, z have the same place: give one height for each")
    if nx * ny > FILLED * len(ix):
        raise ValueError(f"{len(ix)} points x, y, z fill a small part of a grid of {nx} x {ny}: give a map")
    z = np.full((ny, nx), np.nan)
    z[iy, ix] = clean(table[known, 2])
    return Heights(z * uz, dx * ux, dy * uy, notes=tuple(_said(header)))


def _places(values: Array, name: str) -> tuple[int, float, Array]:
    """Number of places, their distance, and the place of each of the values of a coordinate, which must be regular."""
    ordered = np.unique(values)
    gaps = np.diff(ordered)
    real = gaps[gaps > 1e-3 * gaps.max()] if gaps.size else gaps  # round-off writes one place in two ways
    if not real.size:
        raise ValueError(f"all {values.size} points x, y, z have the same {name}: give a map, not a profile")
    step = float(np.median(real))
    count = round(float(np.ptp(ordered)) / step) + 1
    step = float(np.ptp(ordered)) / (count - 1)
    place = np.rint((values - ordered[0]) / step).astype(int)
    off = float(np.abs(values - ordered[0] - place * step).max()) / step
    if off > OFF_GRID or count > SPARSE * ordered.size:
        raise ValueError(
            f"the {name} of points x, y, z is no regular grid: steps from {real.min():.4g} to {real.max():.4g}; "
            "resample the map on equal steps"
        )
    return count, step, place
