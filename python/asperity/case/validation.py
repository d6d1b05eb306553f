"""Checks of a case that need more than one key; those that scripts need as well are in the classes of the model."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from asperity.case.schema import DRIVERS, DynamicsSection, Input, JointSection
from asperity.case.surfaces import SelfAffineSection
from asperity.errors import InputError
from asperity.model.limits import FRACTIONS, LEAST_FORCE, check_force, check_length
from asperity.model.material import Material
from asperity.model.problem import check_lengths
from asperity.model.settings import H_CONTACT
from asperity.runtime.display import show
from asperity.vibration.checks import MIN_ROWS
from asperity.vibration.settings import DynamicsSettings

_ROUND = 1.0 + 1e-9  # the area of a joint over that of the patch, both rounded
#: key -> values that are probable in SI, and the unit
_PROBABLE = {"material.E": (1e3, 2e12, "Pa"), "surface.L": (0.0, 0.1, "m"), "material.density": (1.0, 3e4, "kg/m^3")}


def check_together(case: Input) -> None:
    """Refuse (InputError) what needs more than one key to be judged: key and the rest of the sentence."""
    _check_material(case)
    side, loading, formulation = case.surface.L, case.loading, case.contact.formulation
    for key in FRACTIONS:
        if key.startswith("surface."):
            check_length(key, getattr(case.surface, key.removeprefix("surface."), None), side)
    check_lengths(side, case.block.height, loading.delta_max, case.mesh.size)
    check_force("force_max", loading.force_max, case.material.E_prime * side**2)
    check_force("pressure_max", loading.pressure_max, case.material.E_prime)
    if case.units == "SI" and side < 1e-4 and case.material.E < 1e3:
        raise InputError(
            f"material.E = {case.material.E:g} with surface.L = {side:g} reads as {case.material.E:g} Pa, softer than "
            'any solid; 200 GPa is 200e9 (or set units = "other" at the top of the file)'
        )
    if isinstance(case.surface, SelfAffineSection):
        _ = case.surface.built  # of other kinds no key depends on another, or they warn, or read a file
    if case.accuracy.tolerance is not None:
        formulation.check_bar()
    given = [f"loading.{key}" for key in DRIVERS if getattr(loading, key) is not None]
    if not given:
        raise InputError(
            "loading.delta_max, loading.force_max and loading.pressure_max are all missing; give exactly one, or the "
            "preload of a joint, whose overload then is the greatest load"
        )
    if len(given) > 1:
        raise InputError(f"{' and '.join(given)} are {'both' if len(given) == 2 else 'all'} given; give exactly one")
    for name, idle in (("cycles", 1), ("unload_to", 0.0)):
        if (value := getattr(loading, name)) > idle and not loading.unload:
            raise InputError(f"loading.{name} = {show(value)} needs an unloading; set loading.unload = true")
    if case.slip:
        amplitudes = case.slip.amplitudes
        if any(b <= a for a, b in pairwise(amplitudes)):
            raise InputError(f"slip.amplitudes = {show(amplitudes)} must rise, for example [0.1, 0.3, 0.6]")
        _check_reached(case, "slip.preload", case.slip.preload)
    if case.dynamics or case.joint:
        _check_vibration(case)
    if case.slip and case.contact.formulation.sticks:
        raise InputError(
            f"contact.friction = {case.contact.friction} holds one body on a rigid flat, and [slip] is the slip of two "
            'like bodies: set contact.friction = "none", or remove [slip]'
        )


def _check_material(case: Input) -> None:
    table = case.material
    if table.law is not None:
        if table.law_sha256 is not None and ":" not in table.law:
            raise InputError('material.law_sha256 needs material.law = "file.py:name", a law in a file')
        return
    if table.parameters is not None or table.law_sha256 is not None:
        raise InputError("material.parameters and material.law_sha256 need material.law, a law in UFL")
    if table.yield_strength is None and table.tangent_modulus is not None:
        raise InputError("material.tangent_modulus needs material.yield_strength; an elastic material has neither")


def check_law(case: Input, solid: Material) -> None:
    """Refuse (InputError) a law without an elastic part, where the case needs that part."""
    law = solid.law
    assert law is not None
    needs = {"output.stiffness": case.output.stiffness, "slip": case.slip is not None}
    for key in [key for key, wanted in needs.items() if wanted and law.state and law.declared.elastic is None]:
        raise InputError(
            f"{key} needs the elastic part of material.law = {show(law.source)}, which does not say it: declare "
            "@asp.law(state=..., elastic=...)"
        )


def _check_vibration(case: Input) -> None:
    """Checks of [dynamics] and [joint]."""
    dynamics, joint = case.dynamics or DynamicsSection(), case.joint or JointSection()
    if len(set(dynamics.model)) < len(dynamics.model):
        raise InputError(f"dynamics.model = {show(dynamics.model)} names a model twice")
    if dynamics.law == "unload-reload" and not case.loading.unload:
        raise InputError('dynamics.law = "unload-reload" needs an unloading; set loading.unload = true')
    forces = (joint.preload, joint.pressure, joint.nominal_area)
    if dynamics.preload is not None and any(value is not None for value in forces):
        raise InputError("dynamics.preload cannot go with the area, preload or pressure of [joint]; give joint.preload")
    if dynamics.gravity is not None and joint.mass is not None:
        raise InputError(
            "dynamics.gravity takes the mass from the preload, and [joint] has its own; remove one of them"
        )
    try:
        settings = DynamicsSettings.of_case(case.model_dump(mode="json", exclude_none=True))
    except InputError as error:
        raise InputError(str(error) if str(error).startswith("joint.") else f"dynamics.{error}") from None
    given = [f"joint.{name}" for name in ("pressure", "preload") if getattr(joint, name) is not None]
    _check_reached(case, (*given, "dynamics.preload")[0], settings.load and settings.load / settings.factor)


def _check_reached(case: Input, key: str, force: float | None) -> None:
    """Refuse a preload whose force on the patch, None where it is not given, is that of no run."""
    full = case.material.E_prime * case.surface.L**2
    least, most = LEAST_FORCE * full, case.greatest_force or full
    if force is not None and not least <= force <= most * _ROUND:
        section, name = key.split(".")
        value = getattr(getattr(case, section), name)
        means = "" if value == force else f" makes a force of {force:.6g} on the patch, which"
        raise InputError(
            f"{key} = {value:g}{means} must lie between {least:.3g} and {most:.6g}, the greatest force the run may "
            "reach; leave it out for half of what it does reach"
        )


def doubts(case: Input) -> Iterator[str]:
    """Sentences about values that are legal but improbable in SI, or not used."""
    for key, (low, high, unit) in _PROBABLE.items() if case.units == "SI" else ():
        section, name = key.split(".")
        value = getattr(getattr(case, section), name)
        if value is not None and not low <= value <= high:
            other = 'set units = "other" at the top of the case file if this is not SI'
            yield f"{key} = {value:g} is taken as {unit}; {other}"
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
    for key, why in ((key, why) for applies, keys, why in idle if applies for key in keys):
        section, name = key.split(".")
        table = getattr(case, section)
        value = getattr(table, name)
        if value != defaults.get(key, type(table).model_fields[name].default):
            yield f"{key} = {show(value)} is not used: {why}"
    vibrates = case.dynamics is not None or case.joint is not None
    if vibrates and case.loading.unload_to > 0.0:
        yield (
            f"loading.unload_to = {case.loading.unload_to:g} ends the unloading in contact: the law of the vibration "
            "is extrapolated below; leave it out, or keep the amplitudes small"
        )
    rows, least = case.loading.unload_steps, MIN_ROWS[case.has_stiffness]
    if case.dynamics is not None and case.material.plastic and case.loading.unload and rows < least:
        yield (
            f"loading.unload_steps = {rows} gives the law of the vibration {rows} rows in contact, and at least "
            f"{least} show its curvature: raise it{'' if case.has_stiffness else ', or set output.stiffness = true'}"
        )
