"""Curves of force over approach in text files of instruments and spreadsheets.

Any usual dialect, units in the heading or below it, an unloading without a column that names it. What was done is said;
holds, rows out of contact and rows in falling order are refused.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asperity.arrays import Array
from asperity.runtime.display import nearest
from asperity.runtime.text_table import BLANK, TextTable, is_number
from asperity.units import LENGTHS

FORCES = {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "uN": 1e-6, "µN": 1e-6, "μN": 1e-6, "nN": 1e-9, "pN": 1e-12}
NAMES = {
    "delta": "approach displacement indentation depth weg eindringtiefe verschiebung annaeherung naeherung z d",
    "force": "load kraft last f fn normalforce normalkraft",
}


@dataclass(frozen=True, eq=False)
class MeasuredCurve:
    """Columns of a file by name, shape (n,), and how they were read, a sentence each."""

    columns: Mapping[str, Array]
    notes: tuple[str, ...]


def read_measured_curve(path: Path) -> MeasuredCurve:
    """Read a curve; lengths and forces whose unit the file names become metres and newtons.

    Raises:
        ValueError: no columns of approach and force, none positive, rows out of place, a cell that is no number, or a
            unit of one of them only
        OSError: it cannot be read
    """
    text = TextTable.read(path, 2)
    rows = text.rows()
    names, units, notes = _heading(text, len(rows[0][1]))
    found: dict[str, Array] = {}
    for j, name in enumerate(names):
        cells = [row[j] for _, row in rows]
        if name in NAMES or all(is_number(cell) or cell.lower() in BLANK for cell in cells):
            found[name] = units.get(name, 1.0) * np.array([text.value(row[j], i) for i, row in rows])
        else:
            found[name] = np.array(cells)
    for name in NAMES:
        if bad := [i for (i, _), value in zip(rows, found[name], strict=True) if not np.isfinite(value)]:
            raise ValueError(f"row {bad[0]} has no {name}")
    if units:
        notes.append("the file names the units of approach and force: they are metres and newtons here")
    if "step" not in found:  # else of a run
        for name in NAMES:
            if found[name].max() <= 0.0:
                raise ValueError(f"no {name} is positive: compression counts positive, so reverse its sign")
        notes += _order(found, [i for i, _ in rows])
    return MeasuredCurve(found, tuple(notes))


def _heading(text: TextTable, width: int) -> tuple[list[str], dict[str, float], list[str]]:
    """Names of the columns, units of approach and force [m, N], and what was understood of the heading."""
    above = [line for _, line in text.header if not line.startswith("{")]
    cells = [row for line in above if len(row := text.cells(line)) == width and any(row)]
    if not cells:
        raise ValueError(
            "no column names; name the columns delta and force in the first line, as delta [um], force [N]"
        )
    below = [_unit_of(cell) for cell in cells[-1]] if len(cells) > 1 else []
    row = cells[-2] if below and any(below) and all(map(_is_unit, cells[-1])) else cells[-1]
    if row is cells[-1]:
        below = []
    names, units, notes = [], {}, []
    for j, cell in enumerate(row):
        name, unit = _split_unit(cell)
        known = _canonical(name)
        if known != name:
            notes.append(f"column {cell!r} is read as {known}")
        names.append(known)
        unit = unit or (below[j] if below else "")
        table = LENGTHS if known == "delta" else FORCES if known == "force" else {}
        if unit and known in NAMES:
            if unit not in table:
                raise ValueError(f"the unit {unit!r} of {known} is unknown; use {', '.join(table)}")
            units[known] = table[unit]
    for name in NAMES:
        if name not in names and any(map(is_number, row)):
            raise ValueError(f"{', '.join(row)[:40]!r} is no heading and no row of numbers: give a number in each cell")
        if name not in names:
            raise ValueError(f"column {name!r} is missing; it has {', '.join(map(repr, row))}{nearest(name, row)}")
    if len(units) == 1:
        other = "force" if "delta" in units else "delta"
        raise ValueError(f"the unit of {other} is missing: name those of both, as delta [um], force [N]")
    if len(set(names)) < len(names):
        raise ValueError(f"a column occurs twice in {', '.join(names)}")
    return names, units, notes


def _split_unit(cell: str) -> tuple[str, str]:
    """Name and unit of a heading: delta [um], F (N), Weg / mm, force_N."""
    match = re.fullmatch(r"(.*?)\s*(?:[\[(]\s*(?:in\s+)?([^\])]*?)\s*[\])]|(?:/|\bin\b)\s*(\S+))", cell)
    if match:
        return match[1].strip(), (match[2] or match[3] or "").strip()
    name, _, unit = cell.rpartition("_")
    return (name, unit) if name and _is_unit(unit) and unit else (cell, "")


def _is_unit(cell: str) -> bool:
    return not cell.strip(" []()-") or _unit_of(cell) != ""


def _unit_of(cell: str) -> str:
    """Unit in a cell of a row of units."""
    bare = cell.strip(" []()")
    return bare if bare in LENGTHS or bare in FORCES else ""


def _canonical(name: str) -> str:
    """Name of a column as of `Curve`, for the usual words."""
    plain = re.sub(r"[^a-z]", "", name.lower().replace("ä", "ae").replace("ö", "oe").replace("δ", "delta"))
    for known, words in NAMES.items():
        if plain == known or plain in words.split():
            return known
    return name.strip()


def _order(found: dict[str, Array], numbers: list[int]) -> list[str]:
    """Add the branch of an unloading that no column names, and say so; ValueError where rows are out of place.

    Args:
        found: columns by name, shape (n,), completed in place
        numbers: of the rows in the file
    """
    delta = found["delta"]
    steps = np.diff(delta)
    if (delta < 0.0).any():
        raise ValueError(f"row {numbers[int(np.argmax(delta < 0.0))]} has delta < 0: leave out the rows out of contact")
    held = (steps == 0.0) & (found["branch"][1:] == found["branch"][:-1] if "branch" in found else True)
    if held.any():
        raise ValueError(
            f"row {numbers[int(np.argmax(held)) + 1]} repeats the approach before it: keep one row of a hold"
        )
    if "branch" in found:
        return []
    top = int(np.argmax(delta))
    falling = len(delta) - 1 - top
    if top == 0 and falling and np.all(steps < 0):
        raise ValueError("the rows are in falling order: reverse them")
    if falling > 1 and np.all(steps[:top] > 0) and np.all(steps[top:] < 0):
        found["branch"] = np.array(["load"] * (top + 1) + ["unload"] * falling)
        return [f"the last {falling} rows, of falling approach, are the unloading"]
    return []
