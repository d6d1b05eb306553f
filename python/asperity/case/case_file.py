"""The case file read, completed and validated: one clear sentence for each mistake.

A `Case` is immutable and complete: defaults that follow from other keys (block height, mesh sizes) are filled in before
validation, so `case.to_toml()` reproduces the run. Lengths, forces and moduli must be in one consistent system of
units; `units = "SI"`, the default, adds labels to the figures and checks of plausibility.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from asperity.case.keys import sentence
from asperity.case.schema import DRIVERS, SHARED, Input, JointSection, LoadingSection, law_of_section
from asperity.case.validation import check_law, check_together, doubts
from asperity.errors import CaseWarning, CheckpointError, InputError, warn
from asperity.model.problem import Problem
from asperity.model.settings import H_CONTACT, SolverOptions
from asperity.runtime.display import show
from asperity.runtime.files import MOST_DATA, MOST_TEXT, parse_toml, read_whole
from asperity.runtime.run_folder import CASE, is_empty
from asperity.surface import Surface

MOST_CASE = 2**24  # size of a case file [bytes]
LARGEST = 1e300  # number that others follow from; a larger one is refused
NAMED_FILES = (("surface", "path"), ("mesh", "file"))
#: Sections and keys that a continuation may change, because they change the curve only within the tolerance of the
#: equations; loading.cycles may also grow.
CHANGEABLE = frozenset(
    {
        *("units", "dynamics", "joint", "slip", "output"),
        *("material.density", "material.conductivity", "material.conductivity_other"),
        *("solver.linear", "accuracy.max_dofs"),
    }
)


class Case(Input):
    """A complete, validated and immutable input, by `Case.load` or `Case.from_dict`.

    The plain constructor expects a complete input and raises pydantic's errors.

    Examples:
        >>> case = asp.Case.from_dict({
        ...     "surface": {"kind": "sphere", "L": 1e-6, "radius": 1e-5}, "material": {"E": 200e9, "nu": 0.3},
        ...     "loading": {"delta_max": 1e-9},
        ... })

        >>> case.mesh.h_contact, case.loading.steps
        (4e-08, 10)
        >>> case.problem().schedule.delta_max
        0.001
    """

    def __repr__(self) -> str:
        load = f"{self.loading.driver} = {getattr(self.loading, self.loading.driver):g}"
        solid = "plastic" if self.material.plastic else "elastic"
        return f"Case({self.surface.kind} of side {self.surface.L:g}, {solid}, {load})"

    @classmethod
    def load(cls, path: str | Path, overrides: Iterable[str] = ()) -> Case:
        """Read a case file; relative paths inside it are taken from its folder.

        Args:
            path: TOML file
            overrides: texts "section.key=value" that replace keys of the file; an empty value removes the key

        Raises:
            InputError: anything wrong, in one sentence
        """
        path = Path(path)
        data = read_toml(path)
        changed = [override(data, text) for text in overrides]
        return cls.from_dict(data, folder=path.parent, source=str(path), changed=changed)

    @classmethod
    def from_dict(
        cls, data: Mapping[str, Any], *, folder: str | Path = ".", source: str = "case", changed: Iterable[str] = ()
    ) -> Case:
        """Complete and validate nested tables.

        Args:
            data: sections and keys as in the case file, None for absent; not modified
            folder: where relative file paths start
            source: name of the input in messages
            changed: dotted keys that were set on the command line, for messages

        Raises:
            InputError: anything wrong, in one sentence
        """
        try:
            case = cls.model_validate(_complete(data, Path(folder)))
            check_together(case)
            return case
        except ValidationError as error:
            # a misspelt key also shows as a missing one: name the misspelling
            message = sentence(min(error.errors(), key=lambda e: e["type"] != "extra_forbidden"))
        except InputError as error:
            message = str(error)
        key = message.partition(" ")[0].rstrip(",")
        raise InputError(f"{'--set' if key in set(changed) else source}: {message}")

    def to_dict(self) -> dict[str, Any]:
        """Nested tables of plain values; keys without a value are left out."""
        return self.model_dump(mode="json", exclude_none=True)

    def to_toml(self) -> str:
        """The completed input as TOML text; reading it again gives an equal case."""
        import tomli_w

        return tomli_w.dumps(self.to_dict())

    def hash(self) -> str:
        """SHA-256 of the input without [output], files counted by their content."""
        data = {name: table for name, table in self.content().items() if name != "output"}
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()

    def content(self) -> dict[str, Any]:
        """The input with the SHA-256 of each file it names instead of the path."""
        data = self.to_dict()
        for section, name in NAMED_FILES:
            if data.get(section, {}).get(name):
                content = read_bytes(Path(data[section][name]), f"{section}.{name}")
                data[section][name] = hashlib.sha256(content).hexdigest()
        if "law_sha256" in data["material"]:
            data["material"]["law"] = data["material"]["law"].rpartition(":")[2]
        return data

    def build_surface(self) -> Surface:
        """The surface that [surface] describes, made once."""
        return self.surface.built

    def problem(self, surface: Surface | None = None, *, allow_code: bool | None = None) -> Problem:
        """The contact problem of the case: here a case is judged, for commands, scripts and tests alike.

        Warns (CaseWarning) of values that are legal but improbable, or not used.

        Args:
            surface: in place of that of the case
            allow_code: whether the file that material.law may name is run, with all rights of the user; False refuses
                it, None leaves it unseen, for an estimate, and warns

        Raises:
            InputError: anything that can be found without meshing or solving
        """
        if self.mesh.file is not None and self.accuracy.tolerance is not None:
            raise InputError(
                "mesh.file cannot go with accuracy.tolerance, which chooses the mesh: leave one of them out"
            )
        solid = self.material.solid
        if solid.law is not None:
            if allow_code is False:
                solid.check_run()
            solid = law_of_section(self.material.given(), bool(allow_code))
            check_law(self, solid)
            if not solid.has_run:
                warn(f"material.law = {show(self.material.law)} is code and was not looked at: a run needs "
                     "--allow-code", CaseWarning)  # fmt: skip
        for text in self.warnings():
            warn(text, CaseWarning)
        loading = self.loading.model_dump(exclude={"unload"}) | ({} if self.loading.unload else {"unload_steps": 0})
        return Problem.of(
            self.build_surface() if surface is None else surface, solid, size=self.mesh.size,
            formulation=self.contact.formulation, options=SolverOptions(**self.solver.model_dump()),
            **self.block.model_dump(), **loading,
        )  # fmt: skip

    def warnings(self) -> list[str]:
        """Sentences about values that are legal but improbable, or not used."""
        return list(doubts(self))


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


def _complete(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Copy of `data` with the keys that follow from others, and absolute file paths; validation judges the rest."""
    full = {
        name: {key: _plain(value) for key, value in table.items() if value is not None}
        if isinstance(table, Mapping)
        else table
        for name, table in data.items()
        if table is not None
    }
    tables = {name: table for name, table in full.items() if isinstance(table, dict)}
    surface, material, loading = (tables.get(name, {}) for name in ("surface", "material", "loading"))
    for section, name in NAMED_FILES:
        if isinstance(path := tables.get(section, {}).get(name), str):
            tables[section][name] = _existing_file(folder, path, f"{section}.{name}")
    if isinstance(material.get("law"), str):
        _complete_law(material, folder)
    if surface.get("kind") == "file" and "L" not in surface and isinstance(surface.get("path"), str):
        surface["L"] = Surface.from_spec(kind="file", path=surface["path"]).L
    side = surface.get("L")
    if isinstance(side, float | int) and abs(side) < LARGEST:
        for section, name, value in (("block", "height", side), ("mesh", "h_contact", H_CONTACT * side)):
            if isinstance(table := full.setdefault(section, {}), dict):
                table.setdefault(name, value)
    if surface.get("kind") == "weierstrass-mandelbrot" and "L_s" not in surface:
        surface.setdefault("f_max", 5)
    steps = loading.get("steps", LoadingSection.model_fields["steps"].default)
    if "loading" in tables:
        loading.setdefault("unload_steps", max(steps // 2, 1) if isinstance(steps, int) else 1)
        if not any(key in loading for key in DRIVERS) and (pressure := _overload(tables.get("joint", {}), side)):
            loading["pressure_max"] = pressure
    return full


def _overload(joint: Mapping[str, Any], side: Any) -> float | None:
    """Greatest nominal pressure of a case that names none: that of the joint times its overload."""
    known = {key: joint.get(key) for key in ("nominal_area", "preload", "pressure")}
    overload = joint.get("overload", JointSection.model_fields["overload"].default)
    if not all(isinstance(v, float | int) and v > 0 for v in (overload, side, *filter(None, known.values()))):
        return None
    if known["pressure"]:
        return float(overload * known["pressure"])
    return float(overload * known["preload"] / (known["nominal_area"] or side**2)) if known["preload"] else None


def _plain(value: Any) -> Any:
    """A value of a script as of a file: a number of NumPy as Python's, a path as its text."""
    if isinstance(value, np.generic):
        return value.item()
    return str(value) if isinstance(value, Path) else value


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
    else:
        solid = law_of_section(table) if given else None
        found = {key: getattr(solid, key, None) for key in ("E", "nu", "kinematics", "yield_strength")}
    table |= {key: value for key, value in found.items() if key not in table and value is not None}


def _existing_file(folder: Path, name: str, key: str) -> str:
    with suppress(OSError, ValueError):
        if (folder / name).is_file():
            return str((folder / name).resolve())
    raise InputError(f"{key} = {show(name)}: there is no such file in {show(str(folder))}")


def identity(case: Case) -> dict[str, Any]:
    """Keys of a case that its checkpoint depends on, with their values; SHA-256 of the content for a file."""
    tables = {name: table for name, table in case.content().items() if name not in CHANGEABLE}
    keys = {f"{section}.{key}": value for section, table in tables.items() for key, value in table.items()}
    return {name: value for name, value in keys.items() if name not in CHANGEABLE}


def refuse_another(path: Path, saved: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Refuse (CheckpointError) to continue the run of a file under another case, by the identities of both."""
    different = []
    for name in sorted({*saved, *now}):
        old, new = saved.get(name), now.get(name)
        more_cycles = name == "loading.cycles" and isinstance(old, int) and isinstance(new, int) and new > old
        if old != new and not more_cycles:
            there, here = ("absent" if value is None else show(value) for value in (old, new))
            is_file = tuple(name.split(".")) in NAMED_FILES
            different.append(f"{name} has another content" if is_file else f"{name} = {there} there, {here} here")
    if different:
        more = f"; and {len(different) - 3} more keys" if len(different) > 3 else ""
        raise CheckpointError(
            f"{path} belongs to another case: {'; '.join(different[:3])}{more}; resume with the case it was made for, "
            "or start again with --force"
        )


def refuse_run_of_another(case: Case, folder: Path) -> None:
    """Refuse (CheckpointError) a folder whose run, without a saved state, is not of this case or has none."""
    if is_empty(folder):
        return
    try:
        there = Case.load(folder / CASE)
    except InputError as error:
        raise CheckpointError(
            f"{folder} holds no state to resume from, and no case to start again: {error}; start again with --force"
        ) from None
    refuse_another(folder / CASE, identity(there), identity(case))
