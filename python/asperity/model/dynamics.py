"""What is computed of a vibration: law, damping, forcing, frequencies."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, InstanceOf

from asperity.errors import InputError
from asperity.model.joint import Joint
from asperity.model.limits import positives, within
from asperity.model.material import Material
from asperity.runtime.declaration import FORCE, SCRIPT, SEVERAL, Choices, Positive, Real, Text, argument, declared, key
from asperity.runtime.display import show
from asperity.runtime.files import parse_toml, read_text
from asperity.units import amount

OMEGA = (0.01, 100.0)  # below, motion is quasi-static; above, the mass hardly moves
FORCING = (1e-9, 1e6)  # below, motion is linear in the forcing and lost in the round-off of the force
SPAN = (1e-3, 1e4)  # periods of a short motion, the longest of which takes half a minute
ZETA = (1e-4, 0.9999)  # of forced motion: below, it takes more than 20000 periods to settle
MODELS = ("exact", "taylor")
#: Laws of a curve by name, after auto those of a contact that has yielded first.
LAWS = ("auto", "unload-reload", "elastic", "table", "paper")
#: Rows in contact that show the curvature of an unloading, without and with the stiffness of each.
MIN_ROWS = (5, 3)
#: Courses of the forcing of a short motion; the chirp runs through frequencies, the others have one.
SHAPES = ("harmonic", "step", "half-sine", "chirp")
#: When damping acts, see `vibration.equation`.
DAMPING = ("always", "contact", "hunt-crossley")
#: What moves the mass: a force on it, a displacement of the base, or an acceleration of the base.
EXCITATIONS = ("force", "base", "acceleration")
#: Unit of an amplitude -> the excitation; a number without a unit is F^.
_UNITS = {"": "force", "N": "force", "m/s^2": "acceleration", "m/s2": "acceleration", "m": "base"}

Ratio = Annotated[Real, Field(ge=ZETA[0], le=ZETA[1])]
Amplitude = Annotated[Real, Field(ge=FORCING[0], le=FORCING[1])] | Text
Frequency = Annotated[Real, Field(ge=OMEGA[0], le=OMEGA[1])] | Text


def window(omega: Sequence[float], legal: tuple[float, float] = OMEGA) -> tuple[float, float]:
    """Lowest and highest Omega; raise `InputError` unless they are a legal window."""
    values = tuple(within("dynamics.omega", value, legal) for value in positives("dynamics.omega", omega))
    if len(values) != 2 or values[0] >= values[1]:
        raise InputError(f"dynamics.omega = {list(values)} is not legal: give low < high, for example [0.5, 1.3]")
    return values[0], values[1]


def _amounts(name: str, values: Sequence[Any], units: Iterable[str]) -> tuple[str, tuple[float, ...]]:
    """The one unit of numbers, "" without one, and the numbers in it (`InputError`: they have several, or others)."""
    try:
        read = [amount(one, [unit for unit in units if unit]) if isinstance(one, str) else (one, "") for one in values]
    except ValueError as error:
        raise InputError(f"{name}: {error}") from None
    if len(found := {unit for _, unit in read}) > 1:
        raise InputError(f"{name} = {show(values)} is not legal: give all with one unit, or all without")
    return max(found, default=""), positives(name, [number for number, _ in read])


@declared("dynamics")
class DynamicsSettings:
    """Vibration of a mass on the contact.

    Attributes:
        tol: relative truncation error of the response
        joint: with a joint all forces and the mass are those of the joint
        patch_area: nominal area of the curve (length^2)
        block: compliance of the block behind the patch (length/force), which a joint leaves out
        units: "SI" or "other"; with "other" and no `gravity`, mass and omega_s are left out. Default SI, with a note.

    Examples:
        >>> from asperity.vibration import DynamicsSettings
        >>> settings = DynamicsSettings(forcing="3 N").replaced(omega=[0.9, 1.1], zeta=None)
        >>> settings.forcing, settings.omega, settings.zeta, settings.excitation
        (('3 N',), (0.9, 1.1), (0.01,), 'force')
    """

    law: Annotated[str, Choices(*LAWS)] = key(
        "unloading branch, elastic tangent, points of the loading curve, or its power law; auto takes the first "
        "that the run has after yield, and the points of the loading before",
        default="auto",
    )
    preload: Positive | None = key(
        "static force, the weight of the mass", FORCE, default=None, shown="half of the greatest force"
    )
    gravity: Positive | None = key(
        "gravity, for mass and omega_s alone",
        "length/time^2",
        default=None,
        shown="9.80665; none with other units, nor mass and omega_s",
    )
    zeta: Annotated[tuple[Ratio, ...], SEVERAL] = key(
        "damping ratio of small motion, several for the responses", default=(0.01,), min_length=1, max_length=20
    )
    damping: Annotated[str, Choices(*DAMPING)] = key("when damping acts", default="always")
    forcing: Annotated[tuple[Amplitude, ...], SEVERAL] = key(
        'amplitudes F/(m omega_s^2 z_s) of the force, or all in one unit: "5 N", or of the base "2 um" or "3 m/s^2"',
        default=(0.01,),
        min_length=1,
        max_length=100,
    )
    model: Annotated[tuple[Annotated[str, Choices(*MODELS)], ...], SEVERAL] = key(
        "restoring force: exact, its Taylor expansion", default=MODELS, min_length=1, max_length=2
    )
    omega: tuple[Frequency, Frequency] = key(
        'range of excitation frequency over omega_s, or as ["5 kHz", "9 kHz"]', default=(0.5, 1.3)
    )
    simulate: Annotated[tuple[Annotated[str, Choices(*SHAPES)], ...], SEVERAL] = key(
        "short motions from rest under the first forcing, which the figure motion shows", default=()
    )
    pulse: Positive | None = key(
        "length of the half-sine, half a period of the harmonic",
        "time",
        default=None,
        shown="half a period of small vibration",
    )
    span: Real = key("length of the short motions in periods of small vibration", default=20.0, ge=SPAN[0], le=SPAN[1])
    tol: Annotated[Positive, *SCRIPT] = 1e-5
    joint: Annotated[InstanceOf[Joint] | None, *argument("a joint, for example asp.Joint(preload=10.0)")] = None
    patch_area: Annotated[Positive | None, *SCRIPT] = None
    block: Annotated[Real, *SCRIPT] = 0.0
    units: Annotated[Annotated[str, Choices("SI", "other")] | None, *argument('"SI" or "other"')] = None

    def __post_init__(self) -> None:
        (unit, _), (hertz, ends) = self._read
        window(ends, (0.0, math.inf) if hertz else OMEGA)
        if len(set(self.model)) < len(self.model):
            raise InputError(f"dynamics.model = {list(self.model)} names a model twice")
        if (unit or hertz) and self.units == "other":
            name = f"dynamics.forcing in {unit}" if unit else "dynamics.omega in Hz"
            raise InputError(f'{name} cannot go with units = "other": give numbers without units')
        if self.simulate and self.excitation == "base":
            raise InputError(
                "dynamics.simulate is for a force or an acceleration of the base: a displacement that jumps has no "
                "acceleration"
            )

    @cached_property
    def _read(self) -> tuple[tuple[str, tuple[float, ...]], tuple[str, tuple[float, ...]]]:
        """Units and numbers of `forcing` and `omega`."""
        return _amounts("dynamics.forcing", self.forcing, _UNITS), _amounts("dynamics.omega", self.omega, ("Hz",))

    @property
    def excitation(self) -> str:
        """What moves the mass, by the unit of `forcing`: "force", "base" or "acceleration"."""
        return _UNITS[self._read[0][0]]

    @property
    def with_units(self) -> bool:
        """Whether amounts are given with units, which are those of the SI."""
        return any(unit for unit, _ in self._read)

    @property
    def load(self) -> float | None:
        """Static force (force): the preload, else that of the joint; None if nothing gives it."""
        if self.preload is not None or self.joint is None:
            return self.preload
        return self.joint.load(self.patch_area)

    def on(
        self, scale: float, length: float, omega_s: float
    ) -> tuple[tuple[float, ...], tuple[float, float], float | None]:
        """Forcings, window of Omega and pulse (periods), over a force, a length and the frequency omega_s (rad/time).

        Raises:
            InputError: the frequency is unknown (NaN) and needed, or they are out of range
        """
        frequency = omega_s / (2 * math.pi)
        (unit, values), (hertz, ends) = self._read
        if not math.isfinite(frequency) and (hertz or self.pulse or self.excitation == "acceleration"):
            raise InputError("frequencies in Hz, pulses and accelerations need the mass: give joint.mass or gravity")
        over = {"": 1.0, "N": scale, "m": length}.get(unit, length * omega_s**2)
        forcing = tuple(within("dynamics.forcing", value / over, FORCING) for value in values)
        slowest, fastest = (bound * frequency for bound in OMEGA)
        low, high = window(ends, (slowest, fastest) if hertz else OMEGA)
        per = frequency if hertz else 1.0
        pulse = self.pulse and frequency * within("dynamics.pulse", self.pulse, (0.5 / fastest, 0.5 / slowest))
        return forcing, (low / per, high / per), pulse

    @classmethod
    def of_case(cls, case: Mapping[str, Any], joint: Joint | None = None) -> DynamicsSettings:
        """Settings of a completed case (sections as of `Case.to_dict`), with another joint if given.

        The preload of the patch becomes that of the joint.
        """
        given = dict(case.get("dynamics", {}))
        if joint is None and "joint" in case:
            joint = Joint(**case["joint"])
            forces = (joint.preload, joint.pressure, joint.nominal_area)
            if given.get("preload") is not None and any(value is not None for value in forces):
                raise InputError(
                    "dynamics.preload cannot go with the area, preload or pressure of [joint]; give joint.preload"
                )
            if given.get("gravity") is not None and joint.mass is not None:
                raise InputError(
                    "dynamics.gravity takes the mass from the preload, and [joint] has its own; remove one of them"
                )
        length = case.get("surface", {}).get("L")
        patch = None if length is None else float(length) ** 2
        given |= {"units": case.get("units"), "patch_area": patch}
        if joint is not None and patch is not None and "block" in case:
            solid = Material(case["material"]["E"], case["material"]["nu"])
            given["block"] = case["block"]["height"] / (
                patch * solid.block_modulus(case["block"].get("sides", "rollers"))
            )
        if joint is not None:  # the preload of the section [dynamics] is that of the patch
            own = given.get("preload")
            given["preload"] = joint.load(patch) or (own and joint.factor(patch) * own)
        return cls(joint=joint, **given)

    @property
    def factor(self) -> float:
        """Force of the joint over that of the curve; refused if the nominal area of the curve is unknown."""
        return 1.0 if self.joint is None else self.joint.factor(self.patch_area)

    @property
    def patch_load(self) -> float | None:
        """Static force on the patch of the curve (force); None if nothing gives it."""
        return None if self.load is None else self.load / self.factor

    @property
    def columns(self) -> dict[str, float]:
        """How `CurveColumns.of` makes the curve of the patch that of the interface of a joint."""
        return {} if self.joint is None else {"factor": self.factor, "block": self.block}

    @classmethod
    def of_source(cls, source: Any, joint: Joint | None = None) -> DynamicsSettings:
        """Settings of the case in a run directory, or beside its curve.csv; the defaults without one."""
        return cls.of_case(case_beside(source), joint)

    def replaced(self, **changes: Any) -> DynamicsSettings:
        """Settings with other values, None for no change."""
        return replace(self, **{name: value for name, value in changes.items() if value is not None})


def case_beside(source: Any) -> dict[str, Any]:
    """Sections of the case in a run directory, or beside its curve.csv; none of other sources."""
    if isinstance(source, (str, os.PathLike)):
        path = Path(source)
        folder = path.parent if path.name == "curve.csv" else path
        with suppress(OSError, ValueError):
            return parse_toml(read_text(folder / "case.toml"))
    return {}
