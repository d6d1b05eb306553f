"""Settings of a vibration analysis and of a forced result, and the legal frequencies and forcings.

Each default is here, and the section [dynamics] of a case takes it from here.
"""

from __future__ import annotations

import cmath
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from asperity.errors import InputError
from asperity.runtime.files import parse_toml, read_text
from asperity.units import amount
from asperity.vibration.checks import one_of, positive, positives, within
from asperity.vibration.joint import Joint, known_keys

OMEGA = (0.01, 100.0)  # below, motion is quasi-static; above, the mass hardly moves
FORCING = (1e-9, 1e6)  # below, motion is linear in the forcing and lost in the round-off of the force
SPAN = (1e-3, 1e4)  # periods of a short motion, the longest of which takes half a minute
ZETA = (1e-4, 0.9999)  # of forced motion: below, it takes more than 20000 periods to settle
MODELS = ("exact", "taylor")
#: Courses of the forcing of a short motion; the chirp runs through frequencies, the others have one.
SHAPES = ("harmonic", "step", "half-sine", "chirp")
#: What moves the mass: a force on it, a displacement of the base, or an acceleration of the base.
EXCITATIONS = ("force", "base", "acceleration")
#: Unit of an amplitude -> the excitation; a number without a unit is F^.
_UNITS = {"": "force", "N": "force", "m/s^2": "acceleration", "m/s2": "acceleration", "m": "base"}


@dataclass(frozen=True)
class Setting:
    """Model ("exact" or "taylor"), law, damping and forcing of a forced result.

    F_hat is F/(n_loc W) of a force, b/z_s of a displacement of the base, and m b''/(n_loc W) of its acceleration.
    """

    model: str
    law: str
    n_loc: float
    zeta: float
    damping: str
    F_hat: float
    excitation: str = "force"

    def forcing(self, omega: Any) -> Any:
        """F^ at frequencies Omega: that of a displacement of the base grows with their square."""
        return self.F_hat * omega ** (2 if self.excitation == "base" else 0)

    def growth(self, omega: Any) -> Any:
        """Its derivative with respect to Omega."""
        return 2.0 * self.F_hat * omega if self.excitation == "base" else 0.0 * omega

    @property
    def amplitude(self) -> str:
        """Amplitude of the excitation, in words."""
        name = {"force": "F^", "base": "base b/z_s", "acceleration": "base b''/(omega_s^2 z_s)"}[self.excitation]
        return f"{name} = {self.F_hat:g}"

    def transmissibility(self, omega: float, a1: float, phase: float) -> float:
        """Motion of the mass over that of the base, both at the forcing frequency; NaN for a force.

        The base moves by -F^/Omega^2 times the second derivative of its motion: as cos(Omega tau), like the force.
        """
        if self.excitation == "force":
            return math.nan
        base = self.forcing(omega) / omega**2
        return abs(a1 * cmath.exp(1j * math.radians(phase)) + base) / base

    @property
    def F_over_mg(self) -> float:
        """Forcing amplitude over the preload (sigma in the Hertz literature)."""
        return self.n_loc * self.F_hat

    def row(
        self, branch: int, omega: float, u_max: float, u_min: float, a1: float, stable: bool, phase: float = math.nan
    ) -> dict[str, Any]:
        """Row of response.csv."""
        return {
            "model": self.model, "F_hat": self.F_hat, "zeta": self.zeta, "Omega": omega, "u_max": u_max,
            "u_min": u_min, "a1": a1, "stable": stable, "branch": branch, "contact_loss": bool(u_min < -1.0),
            "phase": phase, "transmissibility": self.transmissibility(omega, a1, phase),
        }  # fmt: skip


def forcings(values: Any) -> tuple[float, ...]:
    """One F^ or several as a tuple; raise `InputError` unless all are legal."""
    return tuple(within("forcing", value, FORCING) for value in positives("forcing", values))


def window(omega: Sequence[float], legal: tuple[float, float] = OMEGA) -> tuple[float, float]:
    """Lowest and highest Omega; raise `InputError` unless they are a legal window."""
    values = tuple(within("omega", value, legal) for value in positives("omega", omega))
    if len(values) != 2 or values[0] >= values[1]:
        raise InputError(f"omega = {list(values)} is not legal: give low < high, for example [0.5, 1.3]")
    return values[0], values[1]


def _amounts(name: str, values: Sequence[Any], units: Iterable[str]) -> tuple[str, tuple[float, ...]]:
    """The one unit of numbers, "" without one, and the numbers in it (`InputError`: they have several, or others)."""
    try:
        read = [amount(one, [unit for unit in units if unit]) if isinstance(one, str) else (one, "") for one in values]
    except ValueError as error:
        raise InputError(f"{name}: {error}") from None
    if len(found := {unit for _, unit in read}) > 1:
        raise InputError(f"{name} = {list(values)} is not legal: give all with one unit, or all without")
    return max(found, default=""), positives(name, [number for number, _ in read])


@dataclass(frozen=True)
class DynamicsSettings:
    """What is computed of a vibration, in the units of its source.

    Attributes:
        law: of a curve, see `law_from`
        preload: static force W (force); default that of the joint, or half of the largest force of the curve
        gravity: for mass and omega_s where no joint has a mass (length/time^2); default 9.80665 with SI units
        zeta: damping ratio of small motion, 1e-4 to 1, or several, of which all but the first one are for responses
        damping: "always", "contact" or "hunt-crossley", see `asperity.vibration.equation`
        forcing: one amplitude or several, all of one kind: F^ = F/(n_loc W), 1e-9 to 1e6, or in SI units as texts, of
            the force ("5 N"), or of the displacement ("2 um") or acceleration ("3 m/s^2") of the base
        model: "exact" and/or "taylor"
        omega: lowest and highest Omega = omega/omega_s, 0.01 to 100, or frequency as a text ("5 kHz")
        simulate: shapes of short motions from rest under the first forcing: "step", "half-sine", "chirp" over the
            window, "harmonic"
        pulse: length of the half-sine, half a period of the harmonic (time); default half a period of small vibration
        span: length of these motions in periods of small vibration
        tol: relative truncation error of the response
        joint: with a joint all forces and the mass are those of the joint
        patch_area: nominal area of the curve (length^2)
        block: compliance of the block behind the patch (length/force), which a joint leaves out
        units: "SI" or "other"; with "other" and no `gravity`, mass and omega_s are left out. Default SI, with a note.

    Raises:
        InputError: a value is not legal

    Examples:
        >>> from asperity.vibration import DynamicsSettings
        >>> settings = DynamicsSettings(forcing="3 N").replaced(omega=[0.9, 1.1], zeta=None)
        >>> settings.forcing, settings.omega, settings.zeta, settings.excitation
        (('3 N',), (0.9, 1.1), (0.01,), 'force')
    """

    law: str = "auto"
    preload: float | None = None
    gravity: float | None = None
    zeta: tuple[float, ...] = (0.01,)
    damping: str = "always"
    forcing: tuple[float | str, ...] = (0.01,)
    model: tuple[str, ...] = MODELS
    omega: tuple[float | str, float | str] = (0.5, 1.3)
    simulate: tuple[str, ...] = ()
    pulse: float | None = None
    span: float = 20.0
    tol: float = 1e-5
    joint: Joint | None = None
    patch_area: float | None = None
    block: float = 0.0
    units: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "zeta", tuple(within("zeta", value, ZETA) for value in positives("zeta", self.zeta)))
        for name in ("forcing", "omega", "model", "simulate"):
            values = getattr(self, name)
            several = (values,) if isinstance(values, str) or np.ndim(values) == 0 else tuple(values)
            object.__setattr__(self, name, several)
        self._check_excitation()
        for name, legal in (("model", MODELS), ("simulate", SHAPES)):
            for value in getattr(self, name):
                one_of(name, value, legal)
        if not self.model:
            raise InputError("model is empty: choose exact, taylor or both")
        if self.simulate and self.excitation == "base":
            raise InputError(
                "simulate is for a force or an acceleration of the base: a displacement that jumps has no acceleration"
            )
        within("span", self.span, SPAN)
        if self.pulse is not None:
            positive("pulse", self.pulse)
        if self.units is not None:
            one_of("units", self.units, ("SI", "other"))

    def _check_excitation(self) -> None:
        """Refuse amplitudes and frequencies that are not legal whatever the law."""
        (unit, values), (hertz, ends) = self._read
        if not unit:
            object.__setattr__(self, "forcing", forcings(values))
        ends = window(ends, (0.0, math.inf) if hertz else OMEGA)
        object.__setattr__(self, "omega", self.omega if hertz else ends)
        if (unit or hertz) and self.units == "other":
            name = f"forcing in {unit}" if unit else "omega in Hz"
            raise InputError(f'{name} cannot go with units = "other": give numbers without units')

    @cached_property
    def _read(self) -> tuple[tuple[str, tuple[float, ...]], tuple[str, tuple[float, ...]]]:
        """Units and numbers of `forcing` and `omega`."""
        return _amounts("forcing", self.forcing, _UNITS), _amounts("omega", self.omega, ("Hz",))

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
        forcing = forcings([value / over for value in values])
        slowest, fastest = (bound * frequency for bound in OMEGA)
        low, high = window(ends, (slowest, fastest) if hertz else OMEGA)
        per = frequency if hertz else 1.0
        pulse = self.pulse and frequency * within("pulse", self.pulse, (0.5 / fastest, 0.5 / slowest))
        return forcing, (low / per, high / per), pulse

    @classmethod
    def of_case(cls, case: Mapping[str, Any], joint: Joint | None = None) -> DynamicsSettings:
        """Settings of a completed case (sections as of `Case.to_dict`), with another joint if given.

        The preload of the patch becomes that of the joint.
        """
        given = dict(case.get("dynamics", {}))
        if joint is None and "joint" in case:
            joint = Joint().replaced(case["joint"])
        length = case.get("surface", {}).get("L")
        patch = None if length is None else float(length) ** 2
        given |= {"units": case.get("units"), "patch_area": patch}
        if joint is not None and patch is not None and "block" in case:
            given["block"] = case["block"]["height"] / (patch * _block_modulus(case))
        if joint is not None:  # the preload of the section [dynamics] is that of the patch
            own = given.get("preload")
            given["preload"] = joint.load(patch) or (own and joint.factor(patch) * own)
        return cls().replaced(**given).replaced(joint=joint)

    @property
    def factor(self) -> float:
        """Force of the joint over that of the curve; refused if the nominal area of the curve is unknown."""
        return 1.0 if self.joint is None else self.joint.factor(self.patch_area)

    @property
    def columns(self) -> dict[str, float]:
        """How `CurveColumns.of` makes the curve of the patch that of the interface of a joint."""
        return {} if self.joint is None else {"factor": self.factor, "block": self.block}

    @classmethod
    def of_source(cls, source: Any, joint: Joint | None = None) -> DynamicsSettings:
        """Settings of the case in a run directory, or beside its curve.csv; the defaults without one."""
        case: dict[str, Any] = {}
        if isinstance(source, (str, os.PathLike)):
            path = Path(source)
            folder = path.parent if path.name == "curve.csv" else path
            with suppress(OSError, ValueError):
                case = parse_toml(read_text(folder / "case.toml"))
        return cls.of_case(case, joint)

    def replaced(self, **changes: Any) -> DynamicsSettings:
        """Settings with other values, None for no change."""
        new = {name: value for name, value in changes.items() if value is not None}
        known_keys(new, self)
        return replace(self, **new)


def _block_modulus(case: Mapping[str, Any]) -> float:
    """Mean pressure over strain of the block of a case, as `Material.block_modulus` (force/length^2)."""
    E, nu = float(case["material"]["E"]), float(case["material"]["nu"])
    return E if case["block"].get("sides") == "free" else E * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
