"""From the tables of a case file to the objects of its sections."""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from asperity.errors import InputError
from asperity.laws import shipped_law
from asperity.model.dynamics import DynamicsSettings
from asperity.model.joint import Joint, SlipSettings
from asperity.model.load_path import DRIVERS, Schedule
from asperity.model.material import SHARED, Material
from asperity.model.settings import AccuracyTarget, Block, Formulation, Mesh, Output, SolverOptions
from asperity.runtime.declaration import keys, plain, unknown
from asperity.runtime.display import show
from asperity.runtime.files import MOST_DATA, MOST_TEXT, parse_toml, read_whole
from asperity.surface import Surface, SurfaceWarning
from asperity.surface.base import surface_kind, surface_kinds

T = TypeVar("T")
MOST_CASE = 2**24  # size of a case file [bytes]
NAMED_FILES = (("surface", "path"), ("tool", "path"), ("mesh", "file"))
OF_KINDS = ("surface", "tool")  # sections of surfaces
#: Class of each section, whose keys are its fields; the class of a surface is that of its kind.
SECTIONS: dict[str, Any] = {
    "surface": Surface, "tool": Surface, "material": Material, "block": Block, "contact": Formulation, "mesh": Mesh,
    "loading": Schedule, "accuracy": AccuracyTarget, "dynamics": DynamicsSettings, "joint": Joint,
    "slip": SlipSettings, "solver": SolverOptions, "output": Output,
}  # fmt: skip
#: Keys of version 1, and what takes their place (docs/migration.md).
GONE = {
    "loops": "loading.unload_to ends an unloading in contact, and the area of such a cycle is its loss",
    "slip.method": "the slip follows from the curve, so leave it out",
    "dynamics.sweeps": "each response has a table of jumps, so leave it out",
}


def read_bytes(path: Path, what: str, most: int = MOST_DATA) -> bytes:
    try:
        return read_whole(path, most)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{what}: cannot read {json.dumps(str(path))}: {reason}") from None


def read_toml(path: Path) -> dict[str, Any]:
    raw = read_bytes(path, "case file", MOST_CASE)
    try:
        return parse_toml(raw.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise InputError(f"{path}: not UTF-8 text at line {line}; save it as UTF-8") from None
    except RecursionError:
        raise InputError(f"{path}: not valid TOML: nested too deeply") from None
    except ValueError as error:
        raise InputError(f"{path}: not valid TOML: {error}") from None


def override(data: dict[str, Any], text: str) -> str:
    """Apply "section.key=value" to nested tables in place; return the dotted key."""
    name, equals, value = text.partition("=")
    name = name.strip()
    *sections, key = name.split(".")
    if not equals or not all((*sections, key)) or (len(sections) > 1 and sections != ["material", "parameters"]):
        raise InputError(f"--set {show(text)}: write section.key=value, for example block.height=2e-6")
    table: Any = data
    for section in sections:
        table = table.setdefault(section, {})
        if not isinstance(table, dict):
            raise InputError(f"--set {show(text)}: {section} is not a section in the case file")
    if not value.strip():
        table.pop(key, None)
        return name
    try:
        parsed = parse_toml(f"value = {value}")
    except (ValueError, RecursionError):
        parsed = {}
    table[key] = parsed["value"] if set(parsed) == {"value"} else value.strip()
    return name


def objects(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Units, and an object of each section that is given, with absolute file paths."""
    if not isinstance(data, Mapping):
        raise InputError(f"{show(data)} must be a table of sections")
    given = {name: value for name, value in data.items() if value is not None}
    if strange := [name for name in given if name not in SECTIONS and name != "units"]:
        _refuse_gone(str(strange[0]))
        raise InputError(unknown(str(strange[0]), "", ["units", *SECTIONS], keys_of_all()))
    tables = {name: _table(name, value) for name, value in given.items() if name != "units"}
    for section, name in NAMED_FILES:
        if isinstance(path := tables.get(section, {}).get(name), str):
            tables[section][name] = _existing_file(folder, path, f"{section}.{name}")
    if isinstance(tables.get("material", {}).get("law"), str):
        _complete_law(tables["material"], folder)
    made = {name: make(name, table) for name, table in tables.items() if name not in ("loading", "tool")}
    surface, joint = made.get("surface"), made.get("joint")
    if "tool" in tables:
        of_file = tables["tool"].get("kind") == "file"  # whose patch may be in it
        made["tool"] = make("tool", ({} if of_file or surface is None else {"L": surface.L}) | tables["tool"])
    if "loading" in tables:
        loading = tables["loading"]
        if joint and surface and not any(name in loading for name in DRIVERS):
            area = surface.L**2
            if load := joint.load(area):
                loading["pressure_max"] = joint.overload * load / (joint.nominal_area or area)
        made["loading"] = make("loading", loading)
    return made | ({"units": given["units"]} if "units" in given else {})


def _table(name: str, table: Any) -> dict[str, Any]:
    """Keys of a section that have a value (InputError: it is no section)."""
    if not isinstance(table, Mapping):
        raise InputError(f"{name} = {show(table)} must be a section of keys, [{name}]")
    return {key: plain(value) for key, value in table.items() if value is not None}


def make(name: str, table: Any) -> Any:
    """Object of the keys of a section (InputError: a key is unknown or its value is not legal)."""
    table, cls, kind = _table(name, table), SECTIONS[name], ""
    if name in OF_KINDS:
        kind = table.pop("kind", None)
        cls = _of(name, lambda: surface_kind(kind))
    legal = keys(cls)
    if strange := [key for key in table if key not in legal]:
        _refuse_gone(f"{name}.{strange[0]}")
        others = {other: names for other, names in keys_of_all().items() if other != name}
        raise InputError(unknown(str(strange[0]), name, legal, others, kind))
    if name not in OF_KINDS:
        return cls(**table)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SurfaceWarning)  # its notes, of which `Case.problem` warns
        return _of(name, lambda: Surface.from_spec(kind, **table))


def _of(section: str, make: Callable[[], T]) -> T:
    """What is made of a surface, whose errors name its section."""
    try:
        return make()
    except InputError as error:
        raise InputError(str(error).replace("surface.", f"{section}.")) from None


def _refuse_gone(full: str) -> None:
    """Refuse (InputError) a key of version 1 with what takes its place."""
    if full in GONE:
        raise InputError(f"{full} is a key of version 1: {GONE[full]}")


def keys_of_all() -> dict[str, set[str]]:
    """Keys of each section, of surfaces those of all kinds."""
    every = {name: set(keys(cls)) for name, cls in SECTIONS.items()}
    return every | dict.fromkeys(OF_KINDS, {"kind"}.union(*map(keys, surface_kinds().values())))


def _complete_law(table: dict[str, Any], folder: Path) -> None:
    """Put the moduli of a law into [material], and path and digest of its file; what is no number is refused later.

    A case with a digest is complete without its file, which a run alone needs.
    """
    numbers = table.get("parameters", {}), {key: table[key] for key in SHARED if key in table}
    given = all(isinstance(n, dict) and all(isinstance(v, float | int) for v in n.values()) for n in numbers)
    path, colon, name = table["law"].rpartition(":")
    if colon:
        if "law_sha256" not in table or (folder / path).is_file():
            table["law"] = f"{_existing_file(folder, path, 'material.law')}:{name}"
        if "law_sha256" not in table:
            content = read_bytes(Path(table["law"].rpartition(":")[0]), "material.law", MOST_TEXT)
            table["law_sha256"] = hashlib.sha256(content).hexdigest()
        found = {key: numbers[0].get(key) for key in ("E", "nu", "yield_strength")} if given else {}
    elif given:
        made = Material.of_law(shipped_law(table["law"], numbers[0], numbers[1]))
        found = {"E": made.E, "nu": made.nu}
    else:
        found = {}
    table |= {key: value for key, value in found.items() if key not in table and value is not None}


def _existing_file(folder: Path, name: str, key: str) -> str:
    with suppress(OSError, ValueError):
        if (folder / name).is_file():
            return str((folder / name).resolve())
    raise InputError(f"{key} = {show(name)}: there is no such file in {show(str(folder))}")
