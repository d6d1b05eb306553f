"""Curves of force over approach in text files of instruments and spreadsheets.

Any usual dialect, units in the heading or below it, and what is trivially repaired: a hold, rows in falling order, rows
before contact, an unloading without a column that names it. What was done is said.
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
NOISE = 0.01  # force before contact over the greatest force, above which it is no noise


@dataclass(frozen=True, eq=False)
class MeasuredCurve:
    """Columns of a file by name, shape (n,), and what was repaired, a sentence each."""

    columns: Mapping[str, Array]
    notes: tuple[str, ...]


def read_measured_curve(path: Path) -> MeasuredCurve:
    """Read a curve; lengths and forces whose unit the file names become metres and newtons.

    Raises:
        ValueError: no columns of approach and force, none positive, a cell that is no number, or a unit of one of
            them only
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
    if "step" not in found:  # of a run, which needs no repair
        for name in NAMES:
            if found[name].max() <= 0.0:
                raise ValueError(f"no {name} is positive: compression counts positive, so reverse its sign")
        found, repairs = repaired(found)
        notes += repairs
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


def repaired(columns: Mapping[str, Array]) -> tuple[dict[str, Array], list[str]]:
    """Columns, delta, force and perhaps branch, with approaches in the order of the loading, and what was done."""
    found, notes = dict(columns), []
    delta, force = found["delta"], found["force"]

    def keep(rows: Array) -> None:
        found.update({name: values[rows] for name, values in found.items()})

    if "branch" not in found and len(delta) > 2 and np.all(np.diff(delta) <= 0) and delta[0] > delta[-1]:
        keep(np.arange(len(delta))[::-1])
        notes.append("the rows were in falling order, and are reversed")
        delta, force = found["delta"], found["force"]
    before = (delta < 0.0) & (np.abs(force) <= NOISE * np.abs(force).max())
    if before.any() and len(delta) - before.sum() > 2:
        keep(np.flatnonzero(~before))
        notes.append(f"{before.sum()} row(s) before contact, with delta < 0, are left out")
    if holds := _merge_holds(found):
        notes.append(
            f"{holds} row(s) that repeat the approach before them (a hold) are merged into one, with their mean"
        )
    delta = found["delta"]
    top = int(np.argmax(delta))
    falling, steps = len(delta) - 1 - top, np.diff(delta)
    if "branch" not in found and falling > 1 and np.all(steps[:top] > 0) and np.all(steps[top:] < 0):
        found["branch"] = np.array(["load"] * (top + 1) + ["unload"] * falling)
        notes.append(f"the last {falling} rows, of falling approach, are the unloading")
    return found, notes


def _merge_holds(found: dict[str, Array]) -> int:
    """Merge neighbouring rows of one approach and branch in place; how many were merged."""
    delta = found["delta"]
    same = np.diff(delta) == 0.0
    if "branch" in found:
        same &= found["branch"][1:] == found["branch"][:-1]
    if not same.any():
        return 0
    starts = np.flatnonzero(np.concatenate([[True], ~same]))
    counts = np.diff([*starts, len(delta)])
    for name, values in found.items():
        first = values[starts]
        found[name] = first if values.dtype.kind not in "f" else np.add.reduceat(values, starts) / counts
    return int(same.sum())
