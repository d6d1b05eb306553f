"""Tangential vibration of a joint: damping over amplitude, response to harmonic forces by the describing function."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.errors import InputError, RangeError
from asperity.runtime.display import short_repr
from asperity.runtime.files import write_csv
from asperity.slip.jenkins import JenkinsArray
from asperity.slip.joint_slip import JointSlip, slip_of_case
from asperity.vibration.checks import positive
from asperity.vibration.run import small_vibration
from asperity.vibration.settings import DynamicsSettings

RESPONSE = "slip_response.csv"
_SLIDERS = 100  # whose energy is that of the law to 0.3 %, see `SlipLaw.array`
_POINTS = 200  # of each side of the resonance
_FAR = 0.01  # amplitude at which the response begins, over that of the peak


@dataclass(frozen=True, eq=False)
class TangentialVibration:
    """Tangential vibration of a mass on a joint, by the normal curve.

    Attributes:
        slip, mass: slip of the patch, mass that vibrates (mass)
        factor: nominal area of the joint over that of the patch
        responses: by force over the limit of friction: frequency (1/time) and amplitude (length), along the curve
        units: "SI" or "other"
    """

    slip: JointSlip
    mass: float
    factor: float
    responses: dict[float, tuple[Array, Array]]
    units: str

    __repr__ = short_repr

    def to_dict(self) -> dict[str, Any]:
        """Section slip of a run, and the peak of each force."""
        peaks = [
            {"force": share, "f": float(f[a.argmax()]), "amplitude": float(a.max())}
            for share, (f, a) in self.responses.items()
        ]
        return self.slip.to_dict(self.mass, self.factor, units=self.units) | {"mass": self.mass, "peaks": peaks}

    def write(self, folder: str | Path) -> None:
        """Write slip.csv and slip_loops.csv of the patch, and slip_response.csv of the joint."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self.slip.write(folder)
        limit = self.factor * self.slip.law.limit
        rows = (
            {"force": share * limit, "frequency": x, "amplitude": y}
            for share, (f, a) in self.responses.items()
            for x, y in zip(f.tolist(), a.tolist(), strict=True)
        )
        write_csv(folder / RESPONSE, ("force", "frequency", "amplitude"), rows)


def tangential_vibration(
    case: Any, curve: Any, settings: DynamicsSettings, forces: Sequence[float], zeta: float = 0.0
) -> TangentialVibration:
    """Tangential vibration of the joint of a run, its case as nested tables.

    Args:
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
        raise InputError("no mass vibrates: give --mass or joint.mass")
    load = None if settings.load is None else settings.load / factor
    slip = slip_of_case(case, curve, case["slip"].get("preload") or load)
    sliders = slip.law.array(_SLIDERS)
    responses = {}
    for share in forces:  # a joint is its patches side by side: forces and mass over the factor, the same lengths
        omega, a = tangential_response(sliders, mass / factor, share * slip.law.limit, zeta=zeta)
        responses[float(share)] = omega / (2.0 * np.pi), a
    return TangentialVibration(slip, mass, factor, responses, str(case.get("units", "SI")))


def tangential_response(array: JenkinsArray, mass: float, force: float, *, zeta: float = 0.0) -> tuple[Array, Array]:
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
    extra = 2.0 * positive("zeta", zeta, zero=True) * array.k_rest

    def excess(a: float) -> float:
        return a * (float(array.complex_stiffness(a).imag) + extra) - force

    far = 1e3 * float(np.max(array.f / array.k))
    if excess(far) < 0.0:
        raise RangeError(
            f"a force of {force / array.limit:g} of the friction limit makes all of the contact slip at resonance: "
            f"without other damping it must be below {4.0 / np.pi:.4g}"
        )
    peak = float(brentq(excess, 1e-12 * far, far, rtol=1e-13))
    a = peak * np.geomspace(_FAR, 1.0, _POINTS)
    k = array.complex_stiffness(a) + 1j * extra
    width = np.sqrt(np.maximum((force / a) ** 2 - k.imag**2, 0.0))
    squares = np.append(k.real - width, (k.real + width)[-2::-1]) / mass
    known = squares > 0.0
    return np.sqrt(squares[known]), np.append(a, a[-2::-1])[known]
