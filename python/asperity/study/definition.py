"""The study file: a base case, the keys that vary, and the complete cases that follow.

    title = "..."
    base = "base.toml"              # a case file, or a table [base] with the sections of one

    [grid]                          # every combination
    "surface.seed" = {first = 0, count = 10}
    "surface.D" = [2.4, 2.5]
    "loading.delta_max" = {from = 1e-9, to = 1e-8, count = 3, log = true}

    [[points]]                      # listed combinations, each combined with every one of the grid
    "material.yield_strength" = 1e9

    [families.hardening]            # several studies in one: each family combines the top-level grid and points
    title = "..."                   # with its own
    grid = {"material.tangent_modulus" = [1e9, 1e10]}

An empty string removes a key, as with `--set`. Cases that several families share are run once.
"""

from __future__ import annotations

import copy
import itertools
import math
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity.case.case_file import Case, override, read_toml
from asperity.errors import InputError
from asperity.runtime.display import nearest, short_repr, show
from asperity.surface import SurfaceWarning

#: Key that varies within an ensemble; the levels of a family differ in the other keys.
ENSEMBLE = "surface.seed"
#: Keys of the shortest wave of a surface.
CUTOFFS = {"surface.f_max", "surface.L_s"}
#: Greatest number of cases of a study; guards against typing errors.
MOST_CASES = 100_000

Point = dict[str, Any]
_KEYS = ("title", "base", "grid", "points", "families")
_FAMILY_KEYS = ("title", "grid", "points")


@dataclass(frozen=True)
class Family:
    """A part of a study with its own title.

    Attributes:
        name: as in the file; "study" if the file has no families
        title: for figures
        keys: dotted keys that vary in the family, in the order of the file
    """

    name: str
    title: str
    keys: tuple[str, ...]


@dataclass(frozen=True)
class Entry:
    """One case of a study.

    Attributes:
        key: "c" (so that table readers do not take it for a number) and 15 digits of the hash of the completed
            case; also the name of its folder
        case: the completed case
        families: names of the families it belongs to
    """

    key: str
    case: Case
    families: tuple[str, ...]

    __repr__ = short_repr

    def value(self, key: str) -> Any:
        """Value of a dotted key in the completed case, None if it is absent."""
        section, name = key.split(".")
        return getattr(getattr(self.case, section), name, None)


@dataclass(frozen=True)
class Study:
    """All cases of a study file, validated.

    Attributes:
        title: for figures
        families: parts of the study
        entries: different cases in the order of the file
        keys: all dotted keys that vary in some family

    Examples:
        >>> base = {"surface": {"kind": "sphere", "L": 1e-6, "radius": 1e-5}, "loading": {"delta_max": 1e-9}}
        >>> base["material"] = {"E": 200e9, "nu": 0.3}
        >>> grid = {"loading.delta_max": [1e-9, 2e-9], "material.nu": [0.2, 0.3]}
        >>> study = Study.from_dict({"base": base, "grid": grid})
        >>> len(study.entries), study.keys
        (4, ('loading.delta_max', 'material.nu'))
    """

    title: str
    families: tuple[Family, ...]
    entries: tuple[Entry, ...]
    keys: tuple[str, ...]

    __repr__ = short_repr

    def part(self, which: str) -> Study:
        """Part "I/N" of the cases, for one job of an array: every N-th one from the I-th on, counted from 1.

        Raises:
            InputError: there is no such part, or it has no case
        """
        match = re.fullmatch(r"(\d+)/(\d+)", which)
        number, parts = map(int, match.groups()) if match else (0, 0)
        if not 1 <= number <= parts <= len(self.entries):
            raise InputError(
                f"part {which!r} is none of 1/N to N/N, with N from 1 to the number of cases, {len(self.entries)}"
            )
        return replace(self, entries=self.entries[number - 1 :: parts])

    @staticmethod
    def load(path: str | Path, overrides: Iterable[str] = ()) -> Study:
        """Read a study file; relative paths in it start from its folder, see `from_dict`."""
        path = Path(path)
        return Study.from_dict(read_toml(path), folder=path.parent, source=str(path), overrides=overrides)

    @staticmethod
    def from_dict(
        data: Mapping[str, Any], *, folder: str | Path = ".", source: str = "study", overrides: Iterable[str] = ()
    ) -> Study:
        """Build a study from nested tables as in the file.

        Args:
            data: the tables; not modified
            folder: start of relative paths
            source: name of the input in messages
            overrides: strings "section.key=value" that replace keys of the base case

        Raises:
            InputError: the study is illegal; the message is one sentence
        """
        _check_keys(data, _KEYS, source, "the study file")
        title = _text(data, "title", Path(source).stem, source)
        base, base_folder = _base(data, Path(folder), source)
        for text in overrides:
            override(base, text)
        shared = _points(data, f"{source}:")
        parts = _families(data, source, title)
        made: list[tuple[Case, str]] = []
        families, keys = [], dict.fromkeys(k for point in shared for k in point)
        for name, family_title, own in parts:
            where = f"{source}, family {name}" if data.get("families") else source
            points = [a | b for a in shared for b in own]
            if len(points) + len(made) > MOST_CASES:
                raise InputError(f"{where}: more than {MOST_CASES} cases; shorten a list of the grid")
            made += [(_case(base, point, base_folder, where), name) for point in points]
            varied = dict.fromkeys(k for point in points for k in point)
            families.append(Family(name, family_title, tuple(varied)))
            keys |= varied
        cases: dict[str, tuple[Case, list[str]]] = {}
        for case, name in made:
            cases.setdefault("c" + case.hash()[:15], (case, []))[1].append(name)
        if CUTOFFS & keys.keys() and any(getattr(case.surface, "drawing", None) == "array" for case, _ in made):
            warnings.warn(
                f"{source}: surfaces of one seed with different cut-offs are unrelated, because all phases are drawn "
                'at once; surface.drawing = "nested" adds waves to the same surface',
                SurfaceWarning,
                stacklevel=2,
            )
        entries = tuple(Entry(key, case, tuple(dict.fromkeys(names))) for key, (case, names) in cases.items())
        return Study(title, tuple(families), entries, tuple(keys))


def _base(data: Mapping[str, Any], folder: Path, source: str) -> tuple[dict[str, Any], Path]:
    """Tables of the base case and the folder where its relative paths start."""
    base = data.get("base")
    if isinstance(base, str):
        path = folder / base
        if not path.is_file():
            raise InputError(f"{source}: base = {show(base)}: there is no such file in {show(str(folder))}")
        return read_toml(path), path.parent
    if isinstance(base, Mapping):
        return copy.deepcopy(dict(base)), folder
    raise InputError(
        f'{source}: base is missing: give base = "case.toml", or a table [base] with the sections of a case'
    )


def _families(data: Mapping[str, Any], source: str, title: str) -> Iterator[tuple[str, str, list[Point]]]:
    """Name, title and own points of each family."""
    tables = data.get("families", {})
    if not isinstance(tables, Mapping):
        raise InputError(f"{source}: families must be tables [families.NAME]")
    if not tables:
        if "grid" not in data and "points" not in data:
            raise InputError(f"{source}: nothing varies: give [grid], [[points]] or [families.NAME]")
        yield "study", title, [{}]
    for name, table in tables.items():
        where = f"{source}: families.{name}"
        if not re.fullmatch(r"[A-Za-z0-9_-]{1,80}", name):  # the name becomes a file name
            raise InputError(f"{source}: families.{show(name)} must consist of letters, digits, - and _")
        if not isinstance(table, Mapping):
            raise InputError(f"{where} must be a table")
        _check_keys(table, _FAMILY_KEYS, where, f"[families.{name}]")
        yield name, _text(table, "title", name, where), _points(table, where)


def _points(table: Mapping[str, Any], where: str) -> list[Point]:
    """All combinations of the points and the grid of a table; one without keys if it has neither."""
    grid = _flat(table.get("grid", {}), f"{where} grid")
    axes = {key: _values(value, f"{where} grid: {key}") for key, value in grid.items()}
    count = math.prod(len(values) for values in axes.values())
    if count > MOST_CASES:
        raise InputError(f"{where} grid has {count} combinations, at most {MOST_CASES} are legal")
    combinations: list[Point] = [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]
    listed = table.get("points", [{}])
    if not isinstance(listed, Sequence) or isinstance(listed, str) or not listed:
        raise InputError(f'{where} points must be a list of tables, for example [{{"surface.D" = 2.4}}]')
    points = [_flat(point, f"{where} points[{i}]") for i, point in enumerate(listed)]
    for point in points:
        for key in point:
            if key in axes:
                raise InputError(f"{where} {key} is in grid and in points; give it once")
            if isinstance(point[key], Mapping):
                raise InputError(f"{where} points: {key} must be one value")
    return [point | combination for point in points for combination in combinations]


def _flat(table: Any, where: str) -> Point:
    """Table with dotted keys; `surface.D = ..` without quotes makes nested tables with the same meaning."""
    if not isinstance(table, Mapping):
        raise InputError(f'{where} must be a table of keys such as "surface.D"')
    flat: Point = {}
    for name, value in table.items():
        nested = "." not in name and isinstance(value, Mapping)
        flat |= {f"{name}.{key}": v for key, v in value.items()} if nested else {name: value}
    for key in flat:
        if key.count(".") != 1:
            raise InputError(f'{where}: {show(key)} is not a key of a case; write section.key, for example "surface.D"')
    return flat


def _values(value: Any, where: str) -> list[Any]:
    """Values of an axis: a list, {first, count}, or {from, to, count, log}."""
    if isinstance(value, list):
        if not value:
            raise InputError(f"{where} is an empty list; give at least one value")
        if any(value.count(v) > 1 for v in value):
            raise InputError(f"{where} = {show(value)} contains a value twice; give each once")
        return value
    if isinstance(value, Mapping):
        count = value.get("count")
        whole = isinstance(count, int) and not isinstance(count, bool) and 1 <= count <= MOST_CASES
        if whole and set(value) == {"first", "count"} and isinstance(value["first"], int):
            return list(range(value["first"], value["first"] + value["count"]))
        if whole and {"from", "to", "count"} <= set(value) <= {"from", "to", "count", "log"}:
            low, high = value["from"], value["to"]
            if all(isinstance(v, int | float) and abs(v) < 1e300 for v in (low, high)):
                if not value.get("log"):
                    return [float(v) for v in np.linspace(low, high, value["count"])]
                if low > 0 and high > 0:
                    return [float(v) for v in np.geomspace(low, high, value["count"])]
    raise InputError(
        f"{where} = {show(dict(value)) if isinstance(value, Mapping) else show(value)} is not an axis; give a list "
        "[..], {first = 0, count = 10}, or {from = 1.0, to = 2.0, count = 5} with log = true for equal ratios"
    )


def _case(base: Mapping[str, Any], point: Point, folder: Path, where: str) -> Case:
    data = {name: dict(table) if isinstance(table, Mapping) else table for name, table in base.items()}
    for key, value in point.items():
        section, name = key.split(".")
        table = data.setdefault(section, {})
        if not isinstance(table, dict):
            raise InputError(f"{where}: {section} is not a section in the base case")
        if value == "":
            table.pop(name, None)
        else:
            table[name] = value
    varied = ", ".join(f"{key} = {show(value)}" for key, value in point.items())
    return Case.from_dict(data, folder=folder, source=f"{where} ({varied})" if varied else where)


def _check_keys(table: Mapping[str, Any], legal: Sequence[str], where: str, place: str) -> None:
    for name in table:
        if name not in legal:
            raise InputError(
                f"{where}: {show(name)} is not a key of {place}{nearest(name, legal)}; legal: {', '.join(legal)}"
            )


def _text(table: Mapping[str, Any], key: str, default: str, where: str) -> str:
    value = table.get(key, default)
    if not isinstance(value, str):
        raise InputError(f"{where}: {key} = {show(value)} must be a text in quotes")
    return value
