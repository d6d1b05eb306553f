"""Tangential vibration of a joint: damping over amplitude, response to harmonic forces by the describing function."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.errors import InputError, RangeError
from asperity.model.dynamics import DynamicsSettings
from asperity.model.limits import positive
from asperity.slip.joint_slip import JointSlip, slip_of_case
from asperity.slip.law import SlipLaw
from asperity.vibration.run import small_vibration

_SLIDERS = 100  # whose energy is that of the law to 0.3 %
_LIGHTEST = 1e-3  # force over the limit below which nothing slips
_POINTS = 200  # of each side of the resonance
_FAR = 0.01  # amplitude at which the response begins, over that of the peak


def tangential_vibration(
    case: Any, curve: Any, settings: DynamicsSettings, forces: Sequence[float], zeta: float = 0.0
) -> JointSlip:
    """Slip of the joint of a run with the mass that vibrates on it, and its responses to harmonic forces.

    Args:
        case: as nested tables
        curve: of the run
        settings: with the joint and its preload
        forces: amplitudes of the harmonic force over the limit of friction
        zeta: damping ratio in addition to that of slip, see `tangential_response`

    Raises:
        InputError: the case has no [slip], or nothing gives the mass
        RangeError: the curve does not reach the preload, or a force makes all of the contact slip
    """
    if "slip" not in case:
        raise InputError("the case has no section [slip]: add it with slip.friction, and run it with --resume")
    factor, mass = settings.factor, small_vibration(curve, settings)[0].mass
    if not math.isfinite(mass):
        raise InputError("no mass vibrates: give joint.mass")
    slip = slip_of_case(case, curve, settings.patch_load)
    responses = {}
    for share in forces:  # a joint is its patches side by side: forces and mass over the factor, the same lengths
        omega, a = tangential_response(slip.law, mass / factor, share * slip.law.limit, zeta=zeta)
        responses[float(share)] = omega / (2.0 * np.pi), a
    return replace(slip, mass=mass, factor=factor, units=str(case.get("units", "SI")), responses=responses)


def sliders(law: SlipLaw, count: int = _SLIDERS) -> tuple[Array, Array]:
    """Springs in series with Coulomb sliders, in parallel, whose first loading is straight between points of a law.

    They are an Iwan law of Jenkins elements (W. D. Iwan, J. Appl. Mech. 33 (1966) 893): a joint with memory, for other
    programs too.

    Returns:
        stiffness of each (force/length), and the displacement at which it slips (length), both (count,)
    """
    # even in ln t at light forces and in ln(1 - t) next to the limit, where the stiffness falls to zero
    x = np.linspace(-1.0, 1.0, count - 1) * math.log(1.0 / _LIGHTEST - 1.0)
    t = np.concatenate([[0.0], 1.0 / (1.0 + np.exp(-x)), [1.0]])
    u = law.displacement(t)
    slopes = np.minimum.accumulate(np.diff(law.limit * t) / np.diff(u))  # no slider has a negative stiffness
    return -np.diff(slopes, append=0.0), u[1:]


def complex_stiffness(k: Array, reach: Array, a: ArrayLike) -> Array:
    """First harmonic of the force of sliders over a harmonic displacement of amplitudes a > 0 (force/length).

    The real part is in phase; the imaginary one is W/(pi a^2), W the energy of the loop. A slider of stiffness k that
    slips at the displacement x has the part k (theta - sin(2 theta)/2)/pi in phase, with cos(theta) = 1 - 2 x/a.
    """
    a = np.asarray(a, float)
    theta = np.arccos(1.0 - 2.0 * np.minimum(reach / a[..., None], 1.0))
    real = (theta - 0.5 * np.sin(2.0 * theta)) @ k / np.pi
    energy = 4.0 * np.maximum(a[..., None] - reach, 0.0) @ (k * reach)
    return np.asarray(real + 1j * energy / (np.pi * a**2))


def tangential_response(law: SlipLaw, mass: float, force: float, *, zeta: float = 0.0) -> tuple[Array, Array]:
    """Angular frequencies and amplitudes of the displacement under a harmonic force, by the first harmonic.

    At each amplitude a below the peak |k(a) + i 2 zeta k_rest - m omega^2| = F/a, k the complex stiffness of the
    sliders, has a solution on either side of the resonance. The force of the damping rises with the amplitude, so there
    is one peak. The mass is that which vibrates, `zeta` the damping ratio in addition to that of slip, as a constant
    loss factor 2 zeta of the stiffness at rest.

    Returns:
        omega (1/time) and amplitude (length), along the curve from low to high frequency, each of shape (n,)

    Raises:
        RangeError: the force makes all of the contact slip, and its resonance has no bound
    """
    positive("mass", mass), positive("force", force)
    springs = sliders(law)
    extra = 2.0 * positive("zeta", zeta, zero=True) * float(springs[0].sum())

    def excess(a: float) -> float:
        return a * (float(complex_stiffness(*springs, a).imag) + extra) - force

    far = 1e3 * float(springs[1][-1])
    if excess(far) < 0.0:
        raise RangeError(
            f"a force of {force / law.limit:g} of the friction limit makes all of the contact slip at resonance: "
            f"without other damping it must be below {4.0 / np.pi:.4g}"
        )
    peak = float(brentq(excess, 1e-12 * far, far, rtol=1e-13))
    a = peak * np.geomspace(_FAR, 1.0, _POINTS)
    k = complex_stiffness(*springs, a) + 1j * extra
    width = np.sqrt(np.maximum((force / a) ** 2 - k.imag**2, 0.0))
    squares = np.append(k.real - width, (k.real + width)[-2::-1]) / mass
    known = squares > 0.0
    return np.sqrt(squares[known]), np.append(a, a[-2::-1])[known]
