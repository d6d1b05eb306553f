"""Checks of a case that need more than one key; the ranges are those of the classes of the model."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NoReturn

from asperity.case.schema import (
    DRIVERS,
    DynamicsSection,
    Input,
    JointSection,
    LoopsSection,
    SlipSection,
)
from asperity.case.surfaces import SelfAffineSection
from asperity.force_law import MIN_ROWS
from asperity.model.argument_checks import Judgement
from asperity.model.limits import (
    FRACTIONS,
    ROUND,
    improbable,
    wrong_force,
    wrong_length,
    wrong_lengths,
    wrong_preload,
)
from asperity.model.material import wrong_slope, wrong_yield
from asperity.model.settings import H_CONTACT, gamma_too_small, penalty_too_soft, wrong_friction
from asperity.runtime.display import show
from asperity.slip.settings import wrong_motion


class Mistake(Exception):
    """A mistake found outside pydantic: dotted key and the rest of the sentence."""

    def __init__(self, key: str, message: str):
        super().__init__(key, message)
        self.key, self.message = key, message


def _refuse(key: str, message: str) -> NoReturn:
    raise Mistake(key, message)


def _refuse_if(judgement: Judgement) -> None:
    """Refuse what the model refuses."""
    if judgement is not None:
        _refuse(*judgement)


def check_together(case: Input) -> None:
    """Checks that need more than one key."""
    _check_material(case)
    _check_lengths(case)
    if isinstance(case.surface, SelfAffineSection):
        _check_self_affine(case.surface)
    loading, dynamics = case.loading, case.dynamics
    if case.accuracy.tolerance is not None:
        _refuse_if(penalty_too_soft(case.contact.method, case.contact.penalty))
    contact = case.contact
    _refuse_if(wrong_friction(contact.method, contact.friction or "none"))
    if contact.method == "nitsche":
        _refuse_if(gamma_too_small(contact.gamma))
    given = [key for key in DRIVERS if getattr(loading, key) is not None]
    if not given:
        _refuse("loading.delta_max", "loading.force_max and loading.pressure_max are all missing; give exactly one")
    if len(given) > 1:
        first, *others = (f"loading.{key}" for key in given)
        _refuse(first, f"and {' and '.join(others)} are {'both' if len(given) == 2 else 'all'} given; give exactly one")
    if loading.cycles > 1 and not loading.unload:
        _refuse("loading.cycles", f"= {loading.cycles} needs an unloading between; set loading.unload = true")
    if dynamics and len(set(dynamics.model)) < len(dynamics.model):
        _refuse("dynamics.model", f"= {show(dynamics.model)} names a model twice")
    if dynamics and dynamics.omega[0] >= dynamics.omega[1]:
        _refuse("dynamics.omega", f"= {show(dynamics.omega)} must rise, for example [0.5, 1.3]")
    if dynamics and dynamics.law == "unload-reload" and not loading.unload:
        _refuse("dynamics.law", '= "unload-reload" needs an unloading; set loading.unload = true')
    if dynamics and dynamics.overload is not None and dynamics.law != "auto":
        _refuse("dynamics.overload", f"= {dynamics.overload:g} cannot go with dynamics.law = {show(dynamics.law)}")
    if case.joint:
        _check_joint(case, case.joint)
    if dynamics and dynamics.damping == "loops" and case.loops is None:
        _refuse("dynamics.damping", '= "loops" needs the section [loops], which computes them')
    if dynamics and dynamics.damping == "loops":
        _check_rest_of_damping(dynamics, case.joint)
    if case.loops:
        _check_loops(case, case.loops)
    if case.slip:
        _check_slip(case, case.slip)
    if dynamics and dynamics.preload is not None:
        _check_preload(case, "dynamics.preload", dynamics.preload, 1.0)
    load = dynamics.preload if dynamics else None
    if dynamics and dynamics.overload is not None and load is not None and dynamics.overload < load:
        _refuse("dynamics.overload", f"= {dynamics.overload:g} lies below dynamics.preload = {load:g}; raise it")
    if dynamics and dynamics.overload is not None:
        _check_reached(case, "dynamics.overload", f"= {dynamics.overload:g}", dynamics.overload, 1.0)


def _check_joint(case: Input, joint: JointSection) -> None:
    from asperity.dynamics.joint import EXCLUSIVE

    for one, other in EXCLUSIVE:
        if getattr(joint, one) is not None and getattr(joint, other) is not None:
            _refuse(f"joint.{one}", f"and joint.{other} are both given; give one of them")
    if joint.gravity is not None and joint.mass is None:
        _refuse("joint.gravity", f"= {joint.gravity:g} needs joint.mass, whose weight it adds to the preload")
    dynamics = case.dynamics or DynamicsSection()
    of_force = joint.preload is not None or joint.pressure is not None or joint.nominal_area is not None
    if dynamics.preload is not None and (of_force or joint.gravity is not None):
        _refuse(
            "dynamics.preload", "cannot go with the area, preload, pressure or gravity of [joint]; give joint.preload"
        )
    if dynamics.gravity is not None and (joint.mass is not None or joint.frequency is not None):
        _refuse("dynamics.gravity", "takes the mass from the preload, and [joint] has its own; remove one of them")
    if joint.damping is not None and dynamics.zeta not in (joint.damping, DynamicsSection().zeta):
        _refuse(
            "joint.damping", f"= {joint.damping:g} and dynamics.zeta = {dynamics.zeta:g} differ; remove one of them"
        )
    patch = case.surface.L**2
    area = joint.nominal_area if joint.nominal_area is not None else patch
    if joint.preload is not None:
        _check_preload(case, "joint.preload", joint.preload, area / patch)
    if joint.pressure is not None:
        _check_preload(case, "joint.pressure", joint.pressure, 1.0 / patch)
    if joint.gravity is not None and joint.mass is not None:
        load = (joint.preload or (joint.pressure or 0.0) * area) + joint.mass * joint.gravity
        weight = f"= {joint.gravity:g} with joint.mass = {joint.mass:g} makes a preload of {load:.6g}, which"
        _check_reached(case, "joint.gravity", weight, load, area / patch)


def _check_rest_of_damping(dynamics: DynamicsSection, joint: JointSection | None) -> None:
    """Refuse a vibration without damping in addition to that of the loops."""
    of_joint = joint is not None and joint.damping is not None
    if (joint.damping if joint is not None and of_joint else dynamics.zeta) == 0.0:
        _refuse(
            "joint.damping" if of_joint else "dynamics.zeta",
            '= 0 with dynamics.damping = "loops" must lie in (0, 1): loops contain plastic flow only; give the damping '
            "ratio of the rest, 0.01 for example",
        )


def _check_loops(case: Input, loops: LoopsSection) -> None:
    if any(b <= a for a, b in pairwise(loops.amplitudes)):
        _refuse("loops.amplitudes", f"= {show(loops.amplitudes)} must rise, for example [0.1, 0.3, 0.6]")
    if loops.preload is not None:
        _check_preload(case, "loops.preload", loops.preload, 1.0)


def _check_slip(case: Input, slip: SlipSection) -> None:
    if any(b <= a for a, b in pairwise(slip.amplitudes)):
        _refuse("slip.amplitudes", f"= {show(slip.amplitudes)} must rise, for example [0.1, 0.3, 0.6, 0.9]")
    if slip.preload is not None:
        _check_preload(case, "slip.preload", slip.preload, 1.0)
    contact = case.contact.formulation
    rigid = not isinstance(contact.friction, str)
    if slip.method == "solid" and contact.method != "active-set":
        _refuse("slip.method", '= "solid" needs contact.method = "active-set"')
    if rigid and (slip.method, slip.friction) != ("solid", contact.friction):
        _refuse(
            "slip.friction",
            f"= {slip.friction:g}, by the {slip.method}, does not go with contact.friction = {contact.friction}, that "
            'of one body on a rigid flat: give both the same value, with slip.method = "solid"',
        )
    _refuse_if(wrong_motion(case.block.sides, slip.direction, rigid))


def _check_preload(case: Input, key: str, value: float, factor: float) -> None:
    """Refuse a preload that no run reaches; `factor` turns the force of the patch into the unit of the key."""
    full, greatest = case.material.E_prime * case.surface.L**2 * factor, case.greatest_force
    _refuse_if(wrong_preload(key, value, None if greatest is None else greatest * factor, full))


def _check_reached(case: Input, key: str, what: str, force: float, factor: float) -> None:
    """Refuse a force above that at the end of the loading, where it is given; `factor` as in `_check_preload`."""
    greatest = case.greatest_force
    if greatest is not None and force > greatest * factor * ROUND:
        _refuse(
            key,
            f"{what} exceeds {greatest * factor:.6g}, the greatest force of the run; lower it, or raise "
            f"loading.{case.loading.driver}",
        )


def _check_self_affine(surface: SelfAffineSection) -> None:
    if (surface.rms_height is None) == (surface.rms_slope is None):
        state = "are both missing" if surface.rms_height is None else "are both given"
        _refuse("surface.rms_height", f"and surface.rms_slope {state}; give exactly one of them")
    roll = surface.L if surface.lambda_roll is None else surface.lambda_roll
    if surface.lambda_short > roll:
        _refuse(
            "surface.lambda_short",
            f"= {surface.lambda_short:g} exceeds surface.lambda_roll = {roll:g}; shorten it, 0.05 L for a first run",
        )


def _check_material(case: Input) -> None:
    solid = case.material
    if solid.law is not None:
        law = solid.solid.law
        assert law is not None
        needs = {"output.stiffness": case.output.stiffness, "slip.method": case.slip is not None}
        for key in [key for key, wanted in needs.items() if wanted and law.state and law.elastic is None]:
            _refuse(
                key,
                f"needs the elastic part of material.law = {show(law.source)}, which does not say it: declare "
                "@asp.law(state=..., elastic=...)",
            )
        return
    if solid.parameters is not None or solid.law_sha256 is not None:
        _refuse("material.parameters", "and material.law_sha256 need material.law, a law in UFL")
    if solid.yield_strength is None:
        if solid.tangent_modulus is not None:
            _refuse(
                "material.tangent_modulus",
                "needs material.yield_strength; an elastic material has neither",
            )
        if solid.hardening not in (None, "isotropic", 0):
            _refuse(
                "material.hardening",
                f"= {show(solid.hardening)} needs material.yield_strength; an elastic material has neither",
            )
        return
    _refuse_if(wrong_yield(solid.E, solid.yield_strength))
    _refuse_if(wrong_slope(solid.E, solid.tangent_modulus))


def _check_lengths(case: Input) -> None:
    side, E_prime = case.surface.L, case.material.E_prime
    for section, name in (key.split(".") for key in FRACTIONS):
        if section == "surface":
            _refuse_if(wrong_length(f"surface.{name}", getattr(case.surface, name, None), side))
    _refuse_if(wrong_lengths(side, case.block.height, case.loading.delta_max, case.mesh.h_contact, case.mesh.h_max))
    _refuse_if(wrong_force("force_max", case.loading.force_max, E_prime * side**2))
    _refuse_if(wrong_force("pressure_max", case.loading.pressure_max, E_prime))
    if case.units == "SI" and side < 1e-4 and case.material.E < 1e3:
        _refuse(
            "material.E",
            f"= {case.material.E:g} with surface.L = {side:g} reads as {case.material.E:g} Pa, "
            'softer than any solid; 200 GPa is 200e9 (or set units = "other" at the top of the '
            "file)",
        )


def doubts(case: Input) -> Iterator[str]:
    """Values that SI makes improbable but that another system of units makes natural."""
    first = improbable("material.E", case.material.E) or improbable("surface.L", case.surface.L)
    yield from filter(None, (first, improbable("material.density", case.material.density)))


def unused(case: Input) -> Iterator[str]:
    """Keys with another value than their default that this case makes no use of."""
    method, tolerance = case.contact.method, case.accuracy.tolerance
    size, by_method = ("mesh.h_contact", "mesh.growth", "mesh.h_max"), f"contact.method is {method}"
    idle = [
        (tolerance is not None, size, "accuracy.tolerance chooses the mesh"),
        (case.mesh.file is not None, (*size, "mesh.refinements"), "mesh.file is the mesh"),
        (
            tolerance is None,
            ("accuracy.area_tolerance", "accuracy.max_dofs", "accuracy.max_seconds"),
            "there is no accuracy.tolerance",
        ),
        (method != "penalty", ("contact.penalty",), by_method),
        (method != "nitsche", ("contact.gamma",), by_method),
        (not case.material.plastic, ("loading.integrator",), "the material is elastic"),
        (case.dynamics is None and case.joint is None, ("material.density",), "no [dynamics], no [joint]"),
        (not case.output.conductance, ("material.conductivity",), "output.conductance is false"),
        (case.material.conductivity is None, ("material.conductivity_other",), "there is no material.conductivity"),
    ]
    defaults = {"mesh.h_contact": H_CONTACT * case.surface.L}  # which follow from other keys
    for applies, keys, why in idle:
        for key in keys if applies else ():
            name, _, entry = key.partition(".")
            section = getattr(case, name)
            value = getattr(section, entry)
            if value != defaults.get(key, type(section).model_fields[entry].default):
                yield f"{key} = {show(value)} is not used: {why}"
    loading, least = case.loading, MIN_ROWS[case.has_stiffness]
    if case.dynamics is not None and case.material.plastic and loading.unload:
        if loading.unload_steps < least:
            yield (
                f"loading.unload_steps = {loading.unload_steps} gives the law of the vibration {loading.unload_steps} "
                f"rows in contact, and at least {least} show its curvature: raise it"
                f"{'' if case.has_stiffness else ', or set output.stiffness = true'}"
            )
    if case.loops is not None and not case.material.plastic:
        yield "[loops] finds loss factors of zero only: the material is elastic; leave it out, or give a yield_strength"
