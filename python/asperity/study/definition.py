"""The study file: a base case, the keys that vary, and the complete cases that follow.

    base = "base.toml"              # a case file, or a table [base] with the sections of one

    [grid]                          # every combination
    "surface.seed" = {first = 0, count = 10}
    "surface.D" = [2.4, 2.5]
    "material.yield_strength, material.tangent_modulus" = [[1e9, 20e9], ["", ""]]   # keys that vary together

An empty string removes a key, as with `--set`.
"""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from asperity.case.case_file import Case, override, read_toml
from asperity.errors import InputError, warn
from asperity.runtime.display import nearest, short_repr, show
from asperity.surface import SurfaceWarning

#: Keys of the shortest wave of a surface.
CUTOFFS = {"surface.f_max", "surface.L_s"}
#: Greatest number of cases of a study; guards against typing errors.
MOST_CASES = 100_000

Point = dict[str, Any]


@dataclass(frozen=True)
class Entry:
    """One case of a study.

    Attributes:
        key: "c" (so that table readers do not take it for a number) and 15 digits of the hash of the completed
            case; also the name of its folder
        case: the completed case
    """

    key: str
    case: Case

    __repr__ = short_repr

    def value(self, key: str) -> Any:
        """Value of a dotted key in the completed case, None if it is absent."""
        section, name = key.split(".")
        return getattr(getattr(self.case, section), name, None)


@dataclass(frozen=True)
class Study:
    """All cases of a study file, validated.

    Attributes:
        entries: different cases in the order of the file
        keys: dotted keys that vary

    Examples:
        >>> base = {"surface": {"kind": "sphere", "L": 1e-6, "radius": 1e-5}, "loading": {"delta_max": 1e-9}}
        >>> base["material"] = {"E": 200e9, "nu": 0.3}
        >>> grid = {"loading.delta_max": [1e-9, 2e-9], "material.nu": [0.2, 0.3]}
        >>> study = Study.from_dict({"base": base, "grid": grid})
        >>> len(study.entries), study.keys
        (4, ('loading.delta_max', 'material.nu'))
    """

    entries: tuple[Entry, ...]
    keys: tuple[str, ...]

    __repr__ = short_repr

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
        for name in data:
            if name not in ("base", "grid"):
                near = nearest(name, ("base", "grid"))
                raise InputError(f"{source}: {show(name)} is not a key of the study file{near}; legal: base, grid")
        base, folder = data.get("base"), Path(folder)
        if isinstance(base, str):
            path = folder / base
            if not path.is_file():
                raise InputError(f"{source}: base = {show(base)}: there is no such file in {show(str(folder))}")
            base, folder = read_toml(path), path.parent
        if not isinstance(base, Mapping):
            raise InputError(
                f'{source}: base is missing: give base = "case.toml", or a table [base] with the sections of a case'
            )
        base = copy.deepcopy(dict(base))
        for text in overrides:
            override(base, text)
        axes = _axes(data.get("grid"), source)
        cases: dict[str, Case] = {}
        for parts in itertools.product(*axes):
            point = {key: value for part in parts for key, value in part.items()}
            case = _case(base, point, folder, source)
            cases.setdefault("c" + case.hash()[:15], case)
        keys = tuple(key for axis in axes for key in axis[0])
        if CUTOFFS & set(keys) and any(getattr(case.surface, "drawing", None) == "array" for case in cases.values()):
            warn(
                f"{source}: surfaces of one seed with different cut-offs are unrelated, because all phases are drawn "
                'at once; surface.drawing = "nested" adds waves to the same surface',
                SurfaceWarning,
            )
        return Study(tuple(Entry(key, case) for key, case in cases.items()), keys)


def _axes(grid: Any, source: str) -> list[list[Point]]:
    """Axes of the grid, each as its points: the value of a key, or of several that vary together."""
    if not isinstance(grid, Mapping) or not grid:
        raise InputError(f'{source}: nothing varies: give a table [grid] of keys such as "surface.D"')
    flat: Point = {}
    for name, value in grid.items():  # surface.D = .. without quotes makes nested tables with the same meaning
        nested = "." not in name and isinstance(value, Mapping)
        flat |= {f"{name}.{key}": v for key, v in value.items()} if nested else {name: value}
    axes: list[list[Point]] = []
    for name, value in flat.items():
        where, keys = f"{source} grid: {name}", [key.strip() for key in name.split(",")]
        for key in keys:
            if key.count(".") != 1:
                raise InputError(f'{where}: {show(key)} is not a key of a case; write section.key, such as "surface.D"')
            if any(key in axis[0] for axis in axes) or keys.count(key) > 1:
                raise InputError(f"{where}: {key} varies twice; give it once")
        values = _values(value, where)
        if len(keys) > 1 and not all(isinstance(v, list) and len(v) == len(keys) for v in values):
            raise InputError(f"{where} = {show(value)} must be a list of lists with {len(keys)} values each")
        axes.append([dict(zip(keys, v if len(keys) > 1 else [v], strict=True)) for v in values])
    count = math.prod(map(len, axes))
    if count > MOST_CASES:
        raise InputError(f"{source} grid has {count} combinations, at most {MOST_CASES} are legal")
    return axes


def _values(value: Any, where: str) -> list[Any]:
    """Values of an axis: a list, or {first, count}."""
    match value:
        case []:
            raise InputError(f"{where} is an empty list; give at least one value")
        case [*values]:
            if any(values.count(v) > 1 for v in values):
                raise InputError(f"{where} = {show(value)} contains a value twice; give each once")
            return values
        case {"first": int(first), "count": int(count), **rest} if not rest and 1 <= count <= MOST_CASES:
            return list(range(first, first + count))
    raise InputError(
        f"{where} = {show(value)} is not an axis; give a list [..], or for whole numbers {{first = 0, count = 10}}"
    )


def _case(base: Mapping[str, Any], point: Point, folder: Path, where: str) -> Case:
    data = {name: dict(table) if isinstance(table, Mapping) else table for name, table in base.items()}
    for key, value in point.items():
        section, name = key.split(".")
        table = data.setdefault(section, {})
        if not isinstance(table, dict):
            raise InputError(f"{where}: {section} is not a section in the base case")
        table[name] = None if value == "" else value
    varied = ", ".join(f"{key} = {show(value)}" for key, value in point.items())
    return Case.from_dict(data, folder=folder, source=f"{where} ({varied})")
