"""Lengths and loads that a problem may have, and values that are probable in SI."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np

from asperity.model.argument_checks import Judgement
from asperity.model.material import Material
from asperity.model.settings import H_CONTACT, H_MAX

# key -> legal range as a fraction of the side: wide enough for any sensible model, narrow enough to catch metres mixed
# with micrometres
FRACTIONS = {
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
#: key -> values that are probable in SI, and the unit
PROBABLE = {"material.E": (1e3, 2e12, "Pa"), "surface.L": (0.0, 0.1, "m"), "material.density": (1.0, 3e4, "kg/m^3")}
LEAST_FORCE = 1e-12  # over the nominal area and E'
ROUND = 1.0 + 1e-9  # the area of a joint over that of the patch, both rounded
_MARGIN = 1.2  # on the compression of the block, whose surface answers a little stiffer than a half-space does


def wrong_length(key: str, value: float | None, side: float) -> Judgement:
    """A length, None where it is not given, far from the side of the patch; key is one of `FRACTIONS`."""
    low, high = FRACTIONS[key]
    if value is None or low * side <= value <= high * side:
        return None
    return key, (
        f"= {value:g} is {value / side:.2g} of surface.L = {side:g}, legal are {low:g} to {high:g}; give all lengths "
        "in the same unit (m)"
    )


def improbable(key: str, value: float | None) -> str:
    """Sentence about a value that SI makes improbable but another system of units natural; empty for none."""
    low, high, unit = PROBABLE[key]
    if value is None or low <= value <= high:
        return ""
    return f'{key} = {value:g} is taken as {unit}; set units = "other" at the top of the case file if this is not SI'


def wrong_preload(key: str, value: float, greatest: float | None, full: float) -> Judgement:
    """A preload that no run reaches.

    Args:
        key: of the preload
        value: [its unit]
        greatest: that the run reaches; None where the approach is given [the same unit]
        full: the nominal area times E', or E' [the same unit]
    """
    least, most = LEAST_FORCE * full, greatest or full
    if least <= value <= most * ROUND:
        return None
    word = "pressure" if key == "joint.pressure" else "force"
    return key, (
        f"= {value:g} must lie between {least:.3g} and {most:.6g}, the greatest {word} the run may reach; leave it out "
        "for half of what it does reach"
    )


def wrong_lengths(
    side: float, height: float, delta_max: float | None, h_contact: float | None, h_max: float | None
) -> Judgement:
    """Height of a block, approach and element sizes, None where they are not given, that no contact of a side has.

    A case file and a problem are judged by it alike.
    """
    given = {"block.height": height, "loading.delta_max": delta_max, "mesh.h_contact": h_contact, "mesh.h_max": h_max}
    size, most = h_contact or H_CONTACT * side, h_max or H_MAX * side
    if found := next(filter(None, (wrong_length(key, value, side) for key, value in given.items())), None):
        return found
    if size > most:
        more = "" if h_max else ", its default: give that as well"
        return "mesh.h_contact", f"= {size:g} exceeds mesh.h_max = {most:g}{more}"
    if delta_max is None or delta_max < height:
        return None
    return "loading.delta_max", f"= {delta_max:g} exceeds the block: block.height = {height:g}; about 0.03 L is usual"


def wrong_force(key: str, value: float | None, full: float) -> Judgement:
    """A force or pressure that no contact of this material has.

    Args:
        full: the nominal area times E', or E' [the same unit]
    """
    if value is None or LEAST_FORCE * full <= value <= full:
        return None
    of = "E/(1 - nu^2)" if key == "pressure_max" else "L^2 E/(1 - nu^2)"
    sentence = f"= {value:g} is {value / full:.2g} of {of}, legal are {LEAST_FORCE:g} to 1; check the units"
    return f"loading.{key}", sentence


def no_gap_left(
    delta: float, z: np.ndarray[Any, Any], summit: float, side: float, material: Material, height: float, sides: str
) -> Judgement:
    """An approach beyond full contact.

    There the top is flat: the flat has come down to the mean plane, and the block is compressed by the mean pressure.

    Args:
        z: heights at the nodes of a regular grid over the patch (n, n) [length]
    """
    pressure = full_contact_pressure(z, side, material, height, sides)
    limit = summit - float(z.mean()) + _MARGIN * height * _strain(material, pressure, sides)
    if delta < limit:
        return None
    return "loading.delta_max", (
        f"= {delta:g} leaves no gap at all: the surface is {float(np.ptp(z)):.3g} deep from peak to "
        f"valley and in full contact before {limit:.3g}; choose a smaller delta_max"
    )


def _strain(material: Material, pressure: float, sides: str) -> float:
    """Strain of a block under a mean pressure; with free sides it flows beyond yield, else its volume resists."""
    limit = material.yield_pressure(sides)
    if sides != "free" or pressure <= limit or material.law is not None:
        return pressure / material.block_modulus(sides)
    beyond = (pressure - limit) / material.tangent_modulus if material.tangent_modulus > 0.0 else inf
    return limit / material.E + beyond


def full_contact_pressure(z: np.ndarray[Any, Any], side: float, material: Material, height: float, sides: str) -> float:
    """Estimate of the mean pressure above which no gap is left [force/length^2].

    To flatten a wave z(q) of an elastic half-space takes the pressure E' q z(q)/2 (Johnson, Contact Mechanics, 1985,
    eq. 13.5), and of a thin block M z(q)/h at least; contact is full when the mean makes up for the lowest. Rollers
    mirror the surface, hence the cosine transform. Plastic flow bounds it by twice the hardness: 6 times the flow
    stress at a strain of the rms slope.
    """
    from scipy.fft import dctn, fft2, fftfreq, idctn, ifft2

    n, periodic = len(z), sides == "periodic"
    wave = 2 * np.pi / side * (n - 1) * fftfreq(n - 1) if periodic else np.pi / side * np.arange(n)
    q = np.hypot(wave[:, None], wave)
    stiffness = np.maximum(material.reduced_modulus * q / 2, material.block_modulus(sides) / height)
    if periodic:
        pressure = -float(ifft2(stiffness * fft2(z[:-1, :-1] - z[:-1, :-1].mean())).real.min())
    else:
        pressure = -float(idctn(stiffness * dctn(z - z.mean(), type=1), type=1).min())
    if material.yield_strength is None or material.law is not None:  # whose hardening is not known here
        return pressure
    slope = float(np.sqrt(np.mean(np.square(np.gradient(z, side / (n - 1))).sum(axis=0))))
    return min(pressure, 6 * (material.yield_strength + material.tangent_modulus * slope))
