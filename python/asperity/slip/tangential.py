"""Tangential vibration of the joint of a run: frequency and damping over amplitude, response to harmonic forces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.run import small_vibration
from asperity.dynamics.settings import DynamicsSettings
from asperity.errors import InputError
from asperity.runtime.display import short_repr
from asperity.runtime.files import write_csv
from asperity.slip.joint_slip import JointSlip, slip_of_case
from asperity.slip.vibration import tangential_response

RESPONSE = "slip_response.csv"
_SLIDERS = 100


@dataclass(frozen=True, eq=False)
class TangentialVibration:
    """Tangential vibration of a mass on a joint, by the normal curve; all of the joint.

    Attributes:
        slip: of the patch
        mass: that vibrates (mass)
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
    """Tangential vibration of the joint of a run.

    Args:
        case: nested tables of a completed case with the section [slip]
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
    factor = 1.0 if settings.joint is None else settings.joint.factor(float(case["surface"]["L"]) ** 2)
    mass = small_vibration(curve, settings).mass
    if not math.isfinite(mass):
        raise InputError("no mass vibrates: give --mass, joint.mass, or joint.frequency")
    load = None if settings.preload is None else settings.preload / factor
    slip = slip_of_case(case, curve, case["slip"].get("preload") or load)
    sliders = slip.law.array(_SLIDERS)
    responses = {}
    for share in forces:  # a joint is its patches side by side: forces and mass over the factor, the same lengths
        omega, a = tangential_response(sliders, mass / factor, share * slip.law.limit, zeta=zeta)
        responses[float(share)] = omega / (2.0 * np.pi), a
    return TangentialVibration(slip, mass, factor, responses, str(case.get("units", "SI")))
