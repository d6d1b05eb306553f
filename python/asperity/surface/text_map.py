"""Height maps in text files: a matrix of heights, or points x, y, z of a regular grid.

No header is read, and no coordinates beside a matrix: a file that has them is refused, or read with the lengths that
the user gives.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asperity.arrays import Array
from asperity.runtime.text_table import SEPARATORS, TextTable
from asperity.units import LENGTHS

OFF_GRID = 0.1  # greatest distance of a point from its place on the grid, over the step; coordinates are rounded
STRAIGHT = 0.02  # the same for coordinates in the first row or column of a matrix
LEAST = 8  # rows of a map
MARKS = (-32768.0, -2147483648.0, -9999.0, -99999.0)  # usual ones of missing heights
PROFILE = (
    "a contact needs heights over an area; measure a map, or write the profile as ridges: a map of so many equal rows "
    "that it is square"
)
_UNIT = r'"?\s*(?:[\[(]\s*([^\s\[\]()]+)\s*[\])])?"?'
_NAMES = re.compile(rf'"?x{_UNIT}[\s,;]+"?y{_UNIT}[\s,;]+"?z{_UNIT}[\s,;]*', re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Heights:
    """Heights of a file.

    Attributes:
        z: heights (ny, nx), index [iy, ix], NaN where they are missing [m]
        dx, dy: distances along x and y, None without one [m]
        channel: of the file, or name of the array; empty where there is one only
        notes: what was read and what was left, a sentence each
    """

    z: Array
    dx: float | None
    dy: float | None
    channel: str = ""
    notes: tuple[str, ...] = ()


def without_marks(z: Array, missing: float | None) -> Array:
    """Heights with NaN in place of the mark of missing ones (unit of the file); ValueError where that is not given."""
    denied = missing is not None and np.isnan(missing)
    found = [] if denied else [mark for mark in MARKS if mark != missing and (z == mark).any()]
    if found and (missing is not None or len(found) > 1):
        marks = " and ".join(f"{mark:g}" for mark in ([] if missing is None else [missing]) + found)
        raise ValueError(f"heights of {marks} may all stand for missing ones: write NaN in their place into the file")
    if found:
        raise ValueError(
            f"heights of {found[0]:g} usually stand for missing ones: say so (import-map --missing {found[0]:g}), or "
            "that they are heights (--missing nan)"
        )
    return z if missing is None else np.where(z == missing, np.nan, z)


def read_text_map(path: Path, unit: float | None, missing: float | None) -> Heights:
    """Read a map.

    Args:
        path: the file
        unit: of the lengths [m], which may have a header then; default metres
        missing: value that stands for a missing height (unit of the file)

    Raises:
        ValueError: it holds no map, or what stands beside the heights may change them; the message says what to give
    """
    text = TextTable.read(path, 2)
    table, header = text.numbers(), text.header
    table[np.isinf(table)] = np.nan
    if table.shape[1] == 2:
        raise ValueError(f"{len(table)} lines of two numbers are a profile, not a map: {PROFILE}")
    if table.shape[1] == 3:
        return _of_points(table, header, unit, missing)
    if min(table.shape) < LEAST:
        raise ValueError(
            f"{table.shape[0]} rows of {table.shape[1]} cells separated by {SEPARATORS[text.separator]}, from row "
            f"{text.first + 1} on, are no map: give at least {LEAST} x {LEAST} heights, or lines of x, y, z"
        )
    if not all(line.strip() for line in text.lines[text.first :]):
        raise ValueError("blank lines separate its rows: write one map into a file, without them")
    _refuse_header(header, unit)
    _refuse_coordinates(table)
    return Heights((1.0 if unit is None else unit) * without_marks(table, missing), None, None)


def _refuse_header(header: list[tuple[int, str]], unit: float | None) -> None:
    """Refuse lines that may name a unit or a factor, unless the user has given one."""
    if header and unit is None:
        raise ValueError(
            f"line {header[-1][0]}, {header[-1][1][:40]!r}, is a header, and none is read: give unit and distance of "
            "heights (--unit 6e-8 --pixel 1e-6), let SurfaceTopography read it (--channel 1), or remove it"
        )


def _refuse_coordinates(table: Array) -> None:
    """Refuse a matrix whose first row or column is, or may be, no row or column of heights."""
    both = all(map(_rises, (table[1:, 0], table[0, 1:]))) and not any(map(_rises, table[1::7, 1:]))
    for name, lines in (("column", table.T), ("row", table)):
        edge, following = lines[0, 1:], lines[1, 1:]
        straight, plane = _in_equal_steps(edge), _in_equal_steps(following)
        if both or (straight and not plane):
            found = "looks like coordinates or an index"
        elif (np.isnan(table[0, 0]) and _rises(edge)) or (straight and not _continues(lines)):
            found = "may be coordinates or heights"
        else:
            continue
        raise ValueError(
            f"the first {name}, {edge[0]:g}, {edge[1]:g}, {edge[2]:g} ..., {found}: leave coordinates "
            "out and give the distance between heights (--pixel), or write an .npz file or lines of x, y, z"
        )


def _continues(lines: Array) -> bool:
    """Whether the first line is in equal steps from its first value on, which are those of the next one."""
    steps = np.diff(lines[:2, [0, -1]]).ravel()
    return _in_equal_steps(lines[0]) and bool(abs(steps[1] - steps[0]) <= STRAIGHT * abs(steps[0]))


def _in_equal_steps(values: Array) -> bool:
    step = (values[-1] - values[0]) / (len(values) - 1)
    off = np.abs(values - values[0] - step * np.arange(len(values))).max()
    return bool(step != 0.0 and off <= STRAIGHT * abs(step))


def _rises(values: Array) -> bool:
    steps = np.diff(values)
    return bool(np.all(steps > 0) or np.all(steps < 0))


def _of_points(table: Array, header: list[tuple[int, str]], unit: float | None, missing: float | None) -> Heights:
    """Map of points x, y, z in any order; places without a point are NaN."""
    names = _NAMES.fullmatch(header[-1][1]) if header else None
    if names is None and header and sorted(re.findall(r"\b[xyz]\b", header[-1][1].lower())) == ["x", "y", "z"]:
        raise ValueError(f"{header[-1][1][:60]!r} is not understood: name the columns x, y, z in this order, as x [um]")
    units = [] if names is None else [one for one in names.groups() if one is not None]
    if units and not (len(units) == 3 and set(units) <= LENGTHS.keys()):
        raise ValueError(f"{header[-1][1][:60]!r} names no units of x, y and z: use {', '.join(LENGTHS)} for each")
    if not units:
        _refuse_header(header if names is None else header[:-1], unit)
    ux, uy, uz = (LENGTHS[one] for one in units) if units else [1.0 if unit is None else unit] * 3
    known = table[np.isfinite(table[:, :2]).all(axis=1)]
    (nx, dx, ix), (ny, dy, iy) = (_places(known[:, i], "xy"[i]) for i in (0, 1))
    if nx * ny > 2 * len(ix):
        raise ValueError(f"{len(ix)} points x, y, z fill less than half of a grid of {nx} x {ny}: give a map")
    if np.unique(iy * nx + ix).size != ix.size:
        raise ValueError("several points x, y, z have the same place: give one height for each")
    z = np.full((ny, nx), np.nan)
    z[iy, ix] = without_marks(known[:, 2], missing)
    return Heights(z * uz, dx * ux, dy * uy)


def _places(values: Array, name: str) -> tuple[int, float, Array]:
    """Number of places, their distance, and the place of each of the values of a coordinate, which must be regular."""
    ordered, place = np.unique(values, return_inverse=True)
    if ordered.size < 2:
        raise ValueError(f"all {values.size} points x, y, z have the same {name}: give a map, not a profile")
    steps, regular = np.diff(ordered), np.linspace(ordered[0], ordered[-1], ordered.size)
    if np.abs(ordered - regular).max() > OFF_GRID * (regular[1] - regular[0]):
        raise ValueError(
            f"the {name} of points x, y, z is no regular grid: steps from {steps.min():.4g} to {steps.max():.4g}; "
            "resample the map on equal steps"
        )
    return ordered.size, float(regular[1] - regular[0]), place
