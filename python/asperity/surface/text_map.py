"""Height maps in text files: matrices, points x, y, z, and grids with a header, with any usual separator."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np

from asperity.arrays import Array
from asperity.units import LENGTHS

SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas", None: "white space"}
BLANK = frozenset(
    {"", "nan", "na", "n/a", "null", "none", "bad", "---", "--", "-", "*", "***", "missing", "inf", "-inf"}
)
OFF_GRID = 0.1  # greatest distance of a point from its place on the grid, over the step; coordinates are rounded
SPARSE = 2.0  # places on a grid over those with points, beyond which it is none
LEAST = 8  # rows of a map
_NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)([eEdD][-+]?\d+)?")
_SIZE = {*"cellsize xcellsize ycellsize dx dy width height nodata nodata_value".split()}  # keys of headers

TextMap = tuple[Array, float | None, float | None]


def read_text_map(path: Path, unit: float, clean: Callable[[Array], Array]) -> TextMap:
    """Heights (ny, nx), NaN where they are missing, and the distances between them, None without one [m].

    Args:
        path: the file
        unit: of the lengths whose unit the file does not name [m]
        clean: puts NaN in place of heights that mark missing ones (unit of the file)

    Raises:
        ValueError: it holds no map; the message names separator and row, and says what to give
    """
    lines = _decoded(path.read_bytes()).rstrip().splitlines()
    first, separator, decimal = _start(lines)
    header = lines[:first]
    table = _numbers(lines[first:], first, separator, decimal)
    keys = _keys(header)
    if "nodata" in keys:
        table[table == keys["nodata"][0]] = np.nan
    if table.shape[1] == 3:
        return _of_points(table, header, unit, clean)
    if min(table.shape) < LEAST:
        raise ValueError(
            f"{table.shape[0]} rows of {table.shape[1]} cells separated by {SEPARATORS[separator]}, from row "
            f"{first + 1} on, are no map: give at least {LEAST} x {LEAST} heights, or lines of x, y, z"
        )
    units = [LENGTHS[name] for line in header if (name := _unit_after(line))]
    return clean(table) * (units[0] if units else unit), *_steps(keys, table.shape, unit)


def _numbers(lines: list[str], first: int, separator: str | None, decimal: str) -> Array:
    """Table of the rows, which begin after `first` lines; NaN for blank cells."""
    if decimal == ".":
        with suppress(ValueError):  # another line shows what is wrong, or blank
            return np.loadtxt(lines, delimiter=separator, ndmin=2, dtype=float)
    rows = [
        (i, _cells(line, separator)) for i, line in enumerate(lines, first + 1) if line.strip() and not _comment(line)
    ]
    if separator is not None and not any(row[-1] for _, row in rows):  # one ends each row
        rows = [(i, row[:-1]) for i, row in rows]
    width = int(np.bincount([len(row) for _, row in rows]).argmax())
    for i, row in rows:
        if len(row) != width:
            raise ValueError(
                f"row {i} has {len(row)} cells separated by {SEPARATORS[separator]}, others have {width}: write one "
                "row of the map, or one point x, y, z, in each line"
            )
    return np.array([[_value(cell, decimal, i, separator) for cell in row] for i, row in rows])


def _decoded(raw: bytes) -> str:
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return raw.decode("utf-16", errors="replace")
    if b"\0" in raw[:4096]:
        raise ValueError("it is no text")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _comment(line: str) -> bool:
    return line.lstrip()[:1] in ("#", "%", "!")


def _cells(line: str, separator: str | None) -> list[str]:
    return [cell.strip().strip('"') for cell in line.split(separator)]


def _start(lines: list[str]) -> tuple[int, str | None, str]:
    """Index of the first row of numbers, separator, and decimal point or comma."""
    for i, line in enumerate(lines):
        if not line.strip() or _comment(line):
            continue
        for separator in SEPARATORS:
            if separator is not None and separator not in line:
                continue
            cells = _cells(line, separator)
            if separator == "," and _decimal_commas(line, cells):
                continue
            filled = [cell for cell in cells if cell.lower() not in BLANK]
            numbers = [_NUMBER.fullmatch(cell) is not None for cell in filled]
            if len(cells) >= 3 and len(filled) > 2 * numbers.count(False):
                comma = separator != "," and any("," in row for row in lines[i:] if not _comment(row))
                return i, separator, "," if comma else "."
    text = next((line for line in lines if line.strip()), "")
    if not text:
        raise ValueError("there are no numbers in it")
    raise ValueError(
        f"no row of at least 3 numbers separated by commas, semicolons, tabs or white space; it begins with "
        f"{text[:40]!r}: write the heights as a matrix, or as lines of x, y, z"
    )


def _decimal_commas(line: str, cells: list[str]) -> bool:
    """Whether commas in a line separate digits, not cells: there is white space between numbers with one comma each."""
    words = line.split()
    return len(words) >= 3 and all(_NUMBER.fullmatch(word) for word in words) and len(cells) <= len(words) + 1


def _value(cell: str, decimal: str, number: int, separator: str | None) -> float:
    if cell.lower() in BLANK:
        return np.nan
    if not _NUMBER.fullmatch(cell):
        raise ValueError(
            f"row {number} has {cell[:20]!r} among its cells separated by {SEPARATORS[separator]}: give a number, or "
            "leave the cell blank where the height is missing"
        )
    return float(cell.replace(decimal, ".").replace("d", "e").replace("D", "e"))


def _keys(header: list[str]) -> dict[str, tuple[float, str]]:
    """Numbers of a header with their unit: cellsize 0.5, # Width: 5 µm, NODATA_value -9999."""
    found: dict[str, tuple[float, str]] = {}
    for line in header:
        match = re.fullmatch(
            r"\W*([A-Za-z_ ]+?)\s*[:=;,\t ]\s*([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*[\[(]?(\S*?)[\])]?[,;]*\s*", line
        )
        if match and (name := match[1].strip().lower()) in _SIZE:
            found[name.removesuffix("_value")] = float(match[2].replace(",", ".")), match[3]
    return found


def _steps(
    keys: dict[str, tuple[float, str]], shape: tuple[int, ...], unit: float
) -> tuple[float | None, float | None]:
    """Distances between heights that a header gives [m]; None where it gives none."""
    lengths = {name: value * LENGTHS.get(named, unit) for name, (value, named) in keys.items()}
    for x, y in (("cellsize", "cellsize"), ("xcellsize", "ycellsize"), ("dx", "dy")):
        if x in lengths:
            return lengths[x], lengths.get(y, lengths[x])
    if "width" in keys and keys["width"][1] in LENGTHS:  # extent of all pixels
        dx = lengths["width"] / shape[1]
        return dx, lengths["height"] / shape[0] if "height" in keys else dx
    return None, None


def _unit_after(line: str) -> str:
    """Unit that a line of a header gives for its heights, as # Value units: nm; empty if none."""
    match = re.search(r"units?\W+(\w+)\s*$", line, re.IGNORECASE)
    return match[1] if match and match[1] in LENGTHS else ""


def _of_points(table: Array, header: list[str], unit: float, clean: Callable[[Array], Array]) -> TextMap:
    """Map of points x, y, z in any order; places without a point are NaN."""
    names = dict(re.findall(r"\b([xyz])[\s_]*[\[(/_]\s*(\w+)", " ".join(header[-1:]).lower()))
    common = next((LENGTHS[name] for line in header if (name := _unit_after(line))), unit)
    ux, uy, uz = (LENGTHS.get(names.get(axis, ""), common) for axis in "xyz")
    known = np.isfinite(table[:, :2]).all(axis=1)
    (nx, dx, ix), (ny, dy, iy) = (_places(table[known, i], "xy"[i]) for i in (0, 1))
    if np.unique(iy * nx + ix).size != ix.size:
        raise ValueError("several points x, y, z have the same place: give one height for each")
    z = np.full((ny, nx), np.nan)
    z[iy, ix] = clean(table[known, 2])
    return z * uz, dx * ux, dy * uy


def _places(values: Array, name: str) -> tuple[int, float, Array]:
    """Number of places, their distance, and the place of each of the values of a coordinate.

    Raises:
        ValueError: they are not regular
    """
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
