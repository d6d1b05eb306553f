# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Checks of a case that need more than one key, or the surface built from it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from asperity.case.schema import DRIVERS, DynamicsSection, Input, JointSection, LoopsSection, SelfAffineSection, show
from asperity.dynamics.settings import MIN_ROWS
from asperity.errors import InputError
from asperity.model.settings import H_CONTACT, H_MAX, gamma_too_small, no_rotations, penalty_too_soft, wrong_friction

if TYPE_CHECKING:
    from asperity.model.material import Material
    from asperity.surface import Surface


class Mistake(Exception):
    """A mistake found outside pydantic: dotted key and the rest of the sentence."""

    def __init__(self, key: str, message: str):
        super().__init__(key, message)
        self.key, self.message = key, message


def _refuse(key: str, message: str) -> NoReturn:
    raise Mistake(key, message)


def check_together(case: Input) -> None:
    """Checks that need more than one key."""
    _check_material(case)
    _check_lengths(case)
    if isinstance(case.surface, SelfAffineSection):
        _check_self_affine(case.surface)
    loading, dynamics = case.loading, case.dynamics
    if case.accuracy.tolerance is not None and (soft := penalty_too_soft(case.contact.method, case.contact.penalty)):
        key, _, rest = soft.partition(" ")
        _refuse(key, rest)
    contact = case.contact
    if wrong := wrong_friction(contact.method, contact.friction or "none"):
        key, _, rest = wrong.partition(" ")
        _refuse(key, rest)
    if contact.method == "nitsche" and contact.gamma and (small := gamma_too_small(contact.gamma, contact.theta)):
        key, _, rest = small.partition(" ")
        _refuse(key, rest)
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
    if case.output.stiffness_matrix and loading.unload:
        _refuse(
            "output.stiffness_matrix",
            "= true is for the end of the load path, where loading.unload has lifted the flat off; set it to false",
        )
    if case.output.stiffness_matrix and (wrong := no_rotations(case.block.sides)):
        key, _, rest = wrong.partition(" ")
        _refuse(key, rest)
    if dynamics and dynamics.preload is not None:
        _check_preload(case, "dynamics.preload", dynamics.preload, 1.0)
    load = dynamics.preload if dynamics else None
    if dynamics and dynamics.overload is not None and load is not None and dynamics.overload < load:
        _refuse("dynamics.overload", f"= {dynamics.overload:g} lies below dynamics.preload = {load:g}; raise it")


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


def _check_preload(case: Input, key: str, value: float, factor: float) -> None:
    """Refuse a preload that no run reaches; `factor` turns the force of the patch into the unit of the key."""
    full = case.material.E_prime * case.surface.L**2
    least, most = 1e-12 * full * factor, (case.greatest_force or full) * factor
    word = "pressure" if key == "joint.pressure" else "force"
    if not least <= value <= most:
        _refuse(
            key,
            f"= {value:g} must lie between {least:.3g} and {most:.3g}, the greatest {word} the run may "
            "reach; leave it out for half of what it does reach",
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
    if case.contact.method == "nitsche" and case.contact.theta != 0 and solid.kinematics in ("finite", "auto"):
        _refuse("contact.theta", f"= {case.contact.theta} is for small strain; use 0, or remove material.kinematics")
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
    ratio = solid.yield_strength / solid.E
    if not 1e-7 <= ratio < 1:
        _refuse(
            "material.yield_strength",
            f"= {solid.yield_strength:g} with E = {solid.E:g} means yield at a strain of "
            f"{ratio:.2g}, legal are 1e-7 to 1; give both in the same unit (Pa), or leave it "
            "out for an elastic material",
        )
    if solid.tangent_modulus is not None and solid.tangent_modulus >= solid.E:
        _refuse(
            "material.tangent_modulus",
            f"= {solid.tangent_modulus:g} must be below material.E = {solid.E:g}; 0 is perfectly plastic",
        )
    if case.contact.method == "nitsche" and case.contact.theta != 0:
        _refuse(
            "contact.theta",
            f"= {case.contact.theta} is for elastic materials; use 0, or remove yield_strength",
        )


# key -> legal range as a fraction of L: wide enough for any sensible model, narrow enough to catch
# metres mixed with micrometres
_FRACTIONS_OF_L = {
    "block.height": (1e-3, 1e2),
    "loading.delta_max": (1e-7, 1e3),
    "mesh.h_contact": (1e-5, 1.0),
    "mesh.h_max": (1e-5, 1e3),
    "surface.G": (0.0, 1.0),
    "surface.L_s": (1e-9, 1.0),
    "surface.rms_height": (1e-9, 1.0),
    "surface.lambda_short": (1 / 2048, 2.0),
    "surface.lambda_roll": (1 / 2048, 2.0),
    "surface.amplitude": (1e-9, 1.0),
    "surface.wavelength": (1e-3, 1e3),
    "surface.radius": (1e-2, 1e9),
}


def _check_lengths(case: Input) -> None:
    side = case.surface.L
    for key, (low, high) in _FRACTIONS_OF_L.items():
        section, name = key.split(".")
        value = getattr(getattr(case, section), name, None)
        if value is not None and not low * side <= value <= high * side:
            _refuse(
                key,
                f"= {value:g} is {value / side:.2g} of surface.L = {side:g}, legal are {low:g} to "
                f"{high:g}; give all lengths in the same unit (m)",
            )
    size, h_max = case.mesh.h_contact, case.mesh.h_max or H_MAX * side
    if size > h_max:
        given = "" if case.mesh.h_max else ", its default: give that as well"
        _refuse("mesh.h_contact", f"= {size:g} exceeds mesh.h_max = {h_max:g}{given}")
    delta, force, key = case.loading.delta_max, case.greatest_force, case.loading.driver
    if delta is not None and delta >= case.block.height:
        _refuse(
            "loading.delta_max",
            f"= {delta:g} exceeds the block: block.height = {case.block.height:g}; about 0.03 L is usual",
        )
    full = case.material.E_prime * side**2
    if force is not None and not 1e-12 * full <= force <= full:
        of = "E/(1 - nu^2)" if key == "pressure_max" else "L^2 E/(1 - nu^2)"
        _refuse(
            f"loading.{key}",
            f"= {getattr(case.loading, key):g} is {force / full:.2g} of {of}, legal are 1e-12 to 1; check the units",
        )
    if case.units == "SI" and side < 1e-4 and case.material.E < 1e3:
        _refuse(
            "material.E",
            f"= {case.material.E:g} with surface.L = {side:g} reads as {case.material.E:g} Pa, "
            'softer than any solid; 200 GPa is 200e9 (or set units = "other" at the top of the '
            "file)",
        )


def doubts(case: Input) -> Iterator[str]:
    """Values that SI makes improbable but that another system of units makes natural."""
    advice = 'set units = "other" at the top of the case file if this is not SI'
    if not 1e3 <= case.material.E <= 2e12:
        yield f"material.E = {case.material.E:g} is taken as Pa; {advice}"
    elif case.surface.L > 0.1:
        yield f"surface.L = {case.surface.L:g} is taken as m; {advice}"
    if case.material.density is not None and not 1.0 <= case.material.density <= 3e4:
        yield f"material.density = {case.material.density:g} is taken as kg/m^3; {advice}"


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
        (method != "nitsche", ("contact.gamma", "contact.theta"), by_method),
        (case.material.yield_strength is None, ("loading.integrator",), "the material is elastic"),
        (case.dynamics is None and case.joint is None, ("material.density",), "no [dynamics], no [joint]"),
    ]
    defaults = {"mesh.h_contact": H_CONTACT * case.surface.L}  # which follow from other keys
    for applies, keys, why in idle:
        for key in keys if applies else ():
            name, _, entry = key.partition(".")
            section = getattr(case, name)
            value = getattr(section, entry)
            if value != defaults.get(key, type(section).model_fields[entry].default):
                yield f"{key} = {show(value)} is not used: {why}"
    loading, least = case.loading, MIN_ROWS[case.output.stiffness]
    if case.dynamics is not None and case.material.yield_strength is not None and loading.unload:
        if loading.unload_steps < least:
            yield (
                f"loading.unload_steps = {loading.unload_steps} gives the law of the vibration {loading.unload_steps} "
                f"rows in contact, and at least {least} show its curvature: raise it"
                f"{'' if case.output.stiffness else ', or set output.stiffness = true'}"
            )
    if case.loops is not None and case.material.yield_strength is None:
        yield "[loops] finds loss factors of zero only: the material is elastic; leave it out, or give a yield_strength"


def check_loading(case: Input, surface: Surface) -> list[str]:
    """Refuse a load at which no gap is left; warn when the flat passes the lowest valley, or begins on an edge.

    At full contact the top is flat: the flat has come down to the mean plane, and the block is
    compressed by the mean pressure, see `full_contact_pressure`.

    Args:
        case: the input.
        surface: built from it.

    Returns:
        Warnings.

    Raises:
        InputError: loading.delta_max leaves no gap.
    """
    delta = case.loading.delta_max
    z = surface.grid(_SAMPLES)
    summit, depth = surface.maximum()[2], float(np.ptp(z))
    if depth <= 1e-12 * surface.L:
        return []
    doubts = [text] if (text := doubt_of_edge(case.block.sides, surface)) else []
    if delta is None:
        return doubts
    squeeze = case.block.height * _strain(case.material.solid, full_contact_pressure(case, z), case.block.sides)
    limit = summit - float(z.mean()) + _MARGIN * squeeze
    if delta >= limit:
        raise InputError(
            f"loading.delta_max = {delta:g} leaves no gap at all: the surface is {depth:.3g} deep "
            f"from peak to valley and in full contact before {limit:.3g}; "
            "choose a smaller delta_max"
        )
    if delta > depth:
        doubts.append(
            f"loading.delta_max = {delta:g} is more than the surface's depth from peak to valley, "
            f"{depth:.3g}: the compression of the whole block is a large part of the curve"
        )
    return doubts


@dataclass(frozen=True)
class Edge:
    """Where the summit lies with respect to the edges of the patch, and how doubtful that is."""

    name: str  # of the value
    value: float
    limit: float  # greatest value between rollers, smallest one with free sides
    edges: str  # that the summit lies on
    slope: float  # of the surface across them, away from the edge


def edge_of_summit(sides: str, surface: Surface) -> Edge | None:
    """Return how an edge of the patch affects the first contact; None of a surface in contact along a whole edge.

    Between rollers the value is the slope across the edge that the summit lies on, over the rms slope, 0 inside; with
    free sides the distance of the summit from the nearest one, over the shortest wavelength. A periodic surface has no
    edge.

    Args:
        sides: "rollers", "free" or "periodic".
        surface: the top.
    """
    if sides == "periodic":
        return None
    if sides == "free":
        x, y, _ = surface.maximum()
        distance = min(x, y, surface.L - x, surface.L - y) / surface.feature_size
        falls = surface.edges_of_summit(_NEAR_FREE * surface.feature_size)
        return Edge("distance from a free side over the shortest wave", distance, _NEAR_FREE,
                    " and ".join(falls), max(falls.values(), default=0.0))  # fmt: skip
    rms = surface.rms_slope()
    if not rms > 0.0:
        return None
    falls = {edge: slope for edge, slope in surface.edges_of_summit().items() if slope > _FALLS * rms}
    slope = max(falls.values(), default=0.0)
    return Edge("slope across an edge over the rms slope", slope / rms, _FALLS, " and ".join(falls), slope)


def doubt_of_edge(sides: str, surface: Surface) -> str:
    """Return why an edge of the patch spoils the first contact, in a sentence; empty when none does.

    Rollers mirror the surface: where it falls away from the edge that the summit lies on, a ridge arises, sharper than
    any summit. A surface that is symmetric about the edge has none. A free side has no solid beyond it to carry a
    summit near by. A periodic surface has no edge.

    Args:
        sides: "rollers", "free" or "periodic".
        surface: the top.
    """
    edge = edge_of_summit(sides, surface)
    if edge is None or not edge.edges:
        return ""
    other = "take another surface.seed, or another window of a map"
    if sides == "free":
        return (
            f"the flat first touches the surface at the free side {edge.edges} of the patch, beyond which no solid "
            f"carries the summit: light loads meet a softer contact than inside; {other}"
        )
    return (
        f"the flat first touches the surface on the edge {edge.edges} of the patch, where it slopes by "
        f"{edge.slope:.2g}: mirrored by the rollers it has a sharp ridge there, and the exponent at light "
        f"loads is that of the ridge; {other}"
    )


_FALLS = 0.01  # slope across an edge next to the summit that makes a ridge, over the rms slope
_NEAR_FREE = 0.1  # distance of a summit from a free side that is near, over the shortest wavelength
_SAMPLES = 257  # heights along each side
_MARGIN = 1.2  # on the compression of the block, whose surface answers a little stiffer than a
# half-space does


def _strain(solid: Material, pressure: float, sides: str) -> float:
    """Strain of a block under a mean pressure; with free sides it flows beyond yield, else its volume resists."""
    limit = solid.yield_pressure(sides)
    if sides != "free" or pressure <= limit:
        return pressure / solid.block_modulus(sides)
    beyond = (pressure - limit) / solid.tangent_modulus if solid.tangent_modulus > 0.0 else inf
    return limit / solid.E + beyond


def full_contact_pressure(case: Input, z: np.ndarray[Any, Any]) -> float:
    """Estimate the mean pressure (force/length^2) above which no gap is left.

    To flatten a wave z(q) of an elastic half-space takes the pressure E' q z(q)/2 (Johnson, Contact
    Mechanics, 1985, eq. 13.5), and of a thin block M z(q)/h at least; contact is full when the mean
    makes up for the lowest. Rollers mirror the surface, hence the cosine transform. Plastic flow
    bounds it by twice the hardness: 6 times the flow stress at a strain of the rms slope.

    Args:
        case: the input.
        z: (n, n) heights at the nodes of a regular grid over the patch (length).
    """
    from scipy.fft import dctn, fft2, fftfreq, idctn, ifft2

    solid, side, n = case.material, case.surface.L, len(z)
    periodic = case.block.sides == "periodic"
    wave = 2 * np.pi / side * (n - 1) * fftfreq(n - 1) if periodic else np.pi / side * np.arange(n)
    q = np.hypot(wave[:, None], wave)
    stiffness = np.maximum(
        solid.E_prime * q / 2, case.material.solid.block_modulus(case.block.sides) / case.block.height
    )
    if periodic:
        pressure = -float(ifft2(stiffness * fft2(z[:-1, :-1] - z[:-1, :-1].mean())).real.min())
    else:
        pressure = -float(idctn(stiffness * dctn(z - z.mean(), type=1), type=1).min())
    if solid.yield_strength is None:
        return pressure
    slope = float(np.sqrt(np.mean(np.square(np.gradient(z, side / (n - 1))).sum(axis=0))))
    flow = solid.yield_strength + (solid.tangent_modulus or 0.0) * slope
    return min(pressure, 6 * flow)
