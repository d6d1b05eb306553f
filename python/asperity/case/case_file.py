"""The case file read, completed and validated: one clear sentence for each mistake.

A `Case` is immutable and complete: defaults that follow from other keys (block height, mesh sizes) are filled in before
validation, so `case.to_toml()` reproduces the run. Lengths, forces and moduli must be in one consistent system of
units; `units = "SI"`, the default, adds labels to the figures and checks of plausibility.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import InstanceOf

from asperity.case.tables import NAMED_FILES, OF_KINDS, SECTIONS, objects, override, read_bytes, read_toml
from asperity.errors import CaseWarning, CheckpointError, InputError, warn
from asperity.model.dynamics import MIN_ROWS, DynamicsSettings
from asperity.model.joint import Joint, SlipSettings
from asperity.model.limits import LEAST_FORCE, check_force
from asperity.model.load_path import Schedule
from asperity.model.material import Material
from asperity.model.problem import Problem, check_lengths
from asperity.model.settings import H_CONTACT, AccuracyTarget, Block, Formulation, Mesh, Output, SolverOptions
from asperity.runtime.declaration import Choices, argument, check_shares, declared, key, legal, properties, to_table
from asperity.runtime.display import show
from asperity.runtime.run_folder import CASE, is_empty
from asperity.surface import Surface, SurfaceWarning
from asperity.surface.base import surface_kinds

#: Kinds of surfaces of a case, in the order of the pages.
KINDS = ("weierstrass-mandelbrot", "self-affine", "sphere", "cone", "pyramid", "sinusoid", "flat", "file")
_ROUND = 1.0 + 1e-9  # the area of a joint over that of the patch, both rounded
#: key -> values that are probable in SI, and the unit
_PROBABLE = {"material.E": (1e3, 2e12, "Pa"), "surface.L": (0.0, 0.1, "m"), "material.density": (1.0, 3e4, "kg/m^3")}
#: Sections and keys that a continuation may change, because they change the curve only within the tolerance of the
#: equations; loading.cycles may also grow.
CHANGEABLE = frozenset(
    {
        *("units", "dynamics", "joint", "slip", "output"),
        *("material.density", "material.conductivity", "material.conductivity_other"),
        *("solver.linear", "accuracy.max_dofs"),
    }
)
_SECTION = argument("a section of keys")


@declared("", eq=False, kw_only=True)
class Case:
    """A complete, validated and immutable input, of objects, or by `Case.load` or `Case.from_dict`.

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

    units: Annotated[str, Choices("SI", "other")] = key("'other' drops SI labels and checks", default="SI")
    surface: Annotated[InstanceOf[Surface], *_SECTION]
    tool: Annotated[InstanceOf[Surface] | None, *_SECTION] = None
    material: Annotated[InstanceOf[Material], *_SECTION]
    block: Annotated[InstanceOf[Block], *_SECTION] = field(default_factory=Block)
    contact: Annotated[InstanceOf[Formulation], *_SECTION] = field(default_factory=Formulation)
    mesh: Annotated[InstanceOf[Mesh], *_SECTION] = field(default_factory=Mesh)
    loading: Annotated[InstanceOf[Schedule], *_SECTION]
    accuracy: Annotated[InstanceOf[AccuracyTarget], *_SECTION] = field(default_factory=AccuracyTarget)
    dynamics: Annotated[InstanceOf[DynamicsSettings] | None, *_SECTION] = None
    joint: Annotated[InstanceOf[Joint] | None, *_SECTION] = None
    slip: Annotated[InstanceOf[SlipSettings] | None, *_SECTION] = None
    solver: Annotated[InstanceOf[SolverOptions], *_SECTION] = field(default_factory=SolverOptions)
    output: Annotated[InstanceOf[Output], *_SECTION] = field(default_factory=Output)

    def __post_init__(self) -> None:
        side = self.surface.L
        if self.block.height is None:
            object.__setattr__(self, "block", replace(self.block, height=side))
        if self.mesh.h_contact is None:
            object.__setattr__(self, "mesh", replace(self.mesh, h_contact=H_CONTACT * side))
        _check_together(self)

    def __repr__(self) -> str:
        load = f"{self.loading.driver} = {getattr(self.loading, self.loading.driver):g}"
        solid = "plastic" if self.material.plastic else "elastic"
        return f"Case({self.surface.kind} of side {self.surface.L:g}, {solid}, {load})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Case) and self.to_dict() == other.to_dict()

    @classmethod
    def load(cls, path: str | Path, overrides: str | Iterable[str] = ()) -> Case:
        """Read a case file; relative paths inside it are taken from its folder.

        Args:
            path: TOML file
            overrides: a text "section.key=value" or several, which replace keys of the file; an empty value removes
                the key

        Raises:
            InputError: anything wrong, in one sentence
        """
        path = Path(path)
        data = read_toml(path)
        changed = [override(data, text) for text in ([overrides] if isinstance(overrides, str) else overrides)]
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
            return cls(**objects(data, Path(folder)))
        except InputError as error:
            message = str(error)
        key = message.partition(" ")[0].rstrip(",:")
        raise InputError(f"{'--set' if key in set(changed) else source}: {message}")

    def to_dict(self) -> dict[str, Any]:
        """Nested tables of plain values; keys without a value are left out."""
        tables = {name: getattr(self, name) for name in SECTIONS}
        data = {name: to_table(one) for name, one in tables.items() if one is not None}
        kinds = {name: {"kind": tables[name].kind, **data[name]} for name in OF_KINDS if name in data}
        return {"units": self.units} | data | kinds

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

    @property
    def greatest_force(self) -> float | None:
        """Force at the end of the loading [force]; None when it is driven by the approach."""
        pressure = self.loading.pressure_max
        return self.loading.force_max if pressure is None else pressure * self.surface.L**2

    @property
    def has_stiffness(self) -> bool:
        """Whether load steps compute the elastic stiffnesses: requested, or the slip needs them."""
        return self.output.stiffness or self.slip is not None

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
        solid = self.material
        if solid.law is not None:
            if allow_code is False:
                solid.check_run()
            if allow_code:
                solid = solid.run_law()
            _check_law(self, solid)
            if not solid.has_run:
                warn(f"material.law = {show(self.material.source)} is code and was not looked at: a run needs "
                     "--allow-code", CaseWarning)  # fmt: skip
        surface = self.surface if surface is None else surface
        for note in (*surface.notes, *(() if self.tool is None else self.tool.notes)):
            warn(note, SurfaceWarning)
        for text in self.warnings():
            warn(text, CaseWarning)
        block = self.block
        problem = Problem(
            surface, solid, self.loading, block.height, block.sides, self.contact, self.mesh.size, self.solver,
            self.tool,
        )  # fmt: skip
        problem.warn_of_doubts()
        return problem

    def warnings(self) -> list[str]:
        """Sentences about values that are legal but improbable, or not used."""
        return list(_doubts(self))


def _check_together(case: Case) -> None:
    """Refuse (InputError) what needs more than one key to be judged: key and the rest of the sentence."""
    side, loading, modulus = case.surface.L, case.loading, case.material.reduced_modulus
    check_shares(case.block, side)
    check_lengths(side, case.block.height or side, loading, case.mesh)
    check_force("force_max", loading.force_max, modulus * side**2)
    check_force("pressure_max", loading.pressure_max, modulus)
    if case.units == "SI" and side < 1e-4 and case.material.E < 1e3:
        raise InputError(
            f"material.E = {case.material.E:g} with surface.L = {side:g} reads as {case.material.E:g} Pa, softer than "
            'any solid; 200 GPa is 200e9 (or set units = "other" at the top of the file)'
        )
    if case.accuracy.tolerance is not None:
        case.contact.check_bar()
    if case.slip:
        _check_reached(case, "slip.preload", case.slip.preload)
    if case.tool is not None and (case.slip or case.joint):
        name = "slip" if case.slip else "joint"
        raise InputError(f"[{name}] is of two like rough faces, and [tool] makes them another pair: remove one of them")
    if case.dynamics or case.joint:
        _check_vibration(case)
    if case.slip and case.contact.sticks:
        raise InputError(
            f"contact.friction = {case.contact.friction} holds one body on a rigid flat, and [slip] is the slip of two "
            'like bodies: set contact.friction = "none", or remove [slip]'
        )


def _check_law(case: Case, solid: Material) -> None:
    """Refuse (InputError) a law without an elastic part, where the case needs that part."""
    law = solid.law
    assert law is not None
    needs = {"output.stiffness": case.output.stiffness, "slip": case.slip is not None}
    for name in [name for name, wanted in needs.items() if wanted and law.state and law.declared.elastic is None]:
        raise InputError(
            f"{name} needs the elastic part of material.law = {show(law.source)}, which does not say it: declare "
            "@asp.law(state=..., elastic=...)"
        )


def _check_vibration(case: Case) -> None:
    """Checks of [dynamics] and [joint]."""
    dynamics, joint = case.dynamics or DynamicsSettings(), case.joint or Joint()
    if dynamics.law == "unload-reload" and not case.loading.unload_steps:
        raise InputError('dynamics.law = "unload-reload" needs an unloading; set loading.unload = true')
    settings = DynamicsSettings.of_case(case.to_dict())
    given = [f"joint.{name}" for name in ("pressure", "preload") if getattr(joint, name) is not None]
    _check_reached(case, (*given, "dynamics.preload")[0], settings.patch_load)


def _check_reached(case: Case, key: str, force: float | None) -> None:
    """Refuse a preload whose force on the patch, None where it is not given, is that of no run."""
    full = case.material.reduced_modulus * case.surface.L**2
    least, most = LEAST_FORCE * full, case.greatest_force or full
    if force is not None and not least <= force <= most * _ROUND:
        section, name = key.split(".")
        area = "give joint.nominal_area, or " if section == "joint" else ""
        ends = [f" by loading.{end}" for end in ("force_max", "pressure_max") if getattr(case.loading, end) is not None]
        raise InputError(
            f"{key} = {getattr(getattr(case, section), name):g} is a force of {force:.6g} on the patch, legal are "
            f"{least:.3g} to {most:.6g}, the greatest force that the run may reach{''.join(ends)}: {area}leave the key "
            "out for half of the force that the run reaches"
        )


def _doubts(case: Case) -> Iterator[str]:
    """Sentences about values that are legal but improbable in SI, or not used."""
    for full, (low, high, unit) in _PROBABLE.items() if case.units == "SI" else ():
        section, name = full.split(".")
        value = getattr(getattr(case, section), name)
        if value is not None and not low <= value <= high:
            other = 'set units = "other" at the top of the case file if this is not SI'
            yield f"{full} = {value:g} is taken as {unit}; {other}"
    method, tolerance = case.contact.method, case.accuracy.tolerance
    size, by_method = ("mesh.h_contact", "mesh.growth", "mesh.h_max"), f"contact.method is {method}"
    limits = ("accuracy.area_tolerance", "accuracy.max_dofs")
    idle = [
        (tolerance is not None, size, "accuracy.tolerance chooses the mesh"),
        (case.mesh.file is not None, size, "mesh.file is the mesh"),
        (tolerance is None, limits, "there is no accuracy.tolerance"),
        (method != "penalty", ("contact.penalty",), by_method),
        (method != "nitsche", ("contact.gamma",), by_method),
        (not case.material.plastic, ("loading.integrator",), "the material is elastic"),
        (case.dynamics is None and case.joint is None, ("material.density",), "no [dynamics], no [joint]"),
        (not case.has_stiffness, ("material.conductivity",), "output.stiffness is false"),
        (case.material.conductivity is None, ("material.conductivity_other",), "there is no material.conductivity"),
    ]
    defaults = {"mesh.h_contact": H_CONTACT * case.surface.L}  # which follow from other keys
    for full, why in ((one, why) for applies, unused, why in idle if applies for one in unused):
        section, name = full.split(".")
        table = getattr(case, section)
        value = getattr(table, name)
        if value != defaults.get(full, type(table).__dataclass_fields__[name].default):
            yield f"{full} = {show(value)} is not used: {why}"
    vibrates = case.dynamics is not None or case.joint is not None
    if vibrates and case.loading.unload_to > 0.0:
        yield (
            f"loading.unload_to = {case.loading.unload_to:g} ends the unloading in contact: the law of the vibration "
            "is extrapolated below; leave it out, or keep the amplitudes small"
        )
    rows, least = case.loading.unload_steps, MIN_ROWS[case.has_stiffness]
    if case.dynamics is not None and case.material.plastic and 0 < rows < least:
        yield (
            f"loading.unload_steps = {rows} gives the law of the vibration {rows} rows in contact, and at least "
            f"{least} show its curvature: raise it{'' if case.has_stiffness else ', or set output.stiffness = true'}"
        )


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


def input_reference() -> Iterator[tuple[str, str, str, str, str, str]]:
    """Rows (section, key, default, legal values, unit, meaning) of every key, for documentation."""
    of_kinds = {f"surface ({kind})": surface_kinds()[kind] for kind in KINDS}
    sections = {name: cls for name, cls in SECTIONS.items() if name not in OF_KINDS}
    for section, cls in {"": Case, **of_kinds, **sections}.items():
        for name, about in properties(cls).items():
            default = show(about["default"]) if "default" in about else "required"
            default = about["shown"] or ("none" if default == "None" else default)
            yield section, name, default, legal(about), about["unit"] or "-", about["description"]
