"""Settings of a vibration analysis and of a forced result, and the legal frequencies and forcings.

Each default is here, and the section [dynamics] of a case takes it from here.
"""

from __future__ import annotations

import cmath
import math
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.dynamics.joint import Joint
from asperity.errors import InputError
from asperity.force_law.checks import one_of, positive, positives, within
from asperity.force_law.damping import Damping
from asperity.runtime.files import parse_toml, read_text

if TYPE_CHECKING:
    from asperity.dynamics.equation import Forcing

OMEGA = (0.01, 100.0)  # below, motion is quasi-static; above, the mass hardly moves
FORCING = (1e-9, 1e6)  # below, motion is linear in the forcing and lost in the round-off of the force
SPAN = (1e-3, 1e4)  # periods of a short motion, the longest of which takes half a minute
MIN_ZETA = 1e-4  # smallest damping ratio with which motion settles in 20000 periods
MODELS = ("exact", "taylor")
#: Courses of the forcing of a short motion; the chirp runs through frequencies, the others have one.
SHAPES = ("harmonic", "step", "half-sine", "chirp")
#: What moves the mass: a force on it, a displacement of the base, or an acceleration of the base.
EXCITATIONS = ("force", "base", "acceleration")
#: Attribute of `DynamicsSettings` with an amplitude in its own unit -> the excitation.
_PHYSICAL = dict(zip(("forcing_newton", "base", "base_acceleration"), EXCITATIONS, strict=True))


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

    @property
    def forcing(self) -> Forcing:
        """F^ over the frequency."""
        from asperity.dynamics.equation import Forcing

        return Forcing(self.F_hat, 2 if self.excitation == "base" else 0)

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
        base = self.forcing.at(omega) / omega**2
        return abs(a1 * cmath.exp(1j * math.radians(phase)) + base) / base

    @property
    def F_over_mg(self) -> float:
        """Forcing amplitude over the preload (sigma in the Hertz literature)."""
        return self.n_loc * self.F_hat

    def row(
        self, branch: str, omega: float, u_max: float, u_min: float, a1: float, stable: bool, phase: float = math.nan
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


def window(omega: Sequence[float]) -> tuple[float, float]:
    """Lowest and highest Omega; raise `InputError` unless they are a legal window."""
    values = tuple(within("omega", value, OMEGA) for value in positives("omega", omega))
    if len(values) != 2 or values[0] >= values[1]:
        raise InputError(f"omega = {list(values)} is not legal: give low < high, for example [0.5, 1.3]")
    return values[0], values[1]


@dataclass(frozen=True)
class DynamicsSettings:
    """What is computed of a vibration, in the units of its source.

    Attributes:
        law, overload: see `law_from`; of no use for a `Law`
        preload: static force W (force); default that of the joint, or half of the largest force of the curve
        gravity: for mass and omega_s where no joint has a mass (length/time^2); default 9.80665 with SI units
        zeta: damping ratio of small motion, 0 <= zeta < 1
        damping: "always", "contact", "hunt-crossley", or "loops": in addition to zeta that of the loops.csv of a run
            directory (or a `LoopDamping`)
        excitation: "force" on the mass, or a displacement ("base") or an "acceleration" of the base
        forcing: F^ = F/(n_loc W), or b/z_s, or m b''/(n_loc W), one or several, each 1e-9 to 1e6
        forcing_newton, base, base_acceleration: amplitudes of the force itself (force), or of the displacement (length)
            or acceleration (length/time^2) of the base, of one kind, instead of `forcing`
        zetas: further damping ratios, for the responses
        window: lowest and highest frequency of the excitation (1/time), instead of `omega`
        model: "exact" and/or "taylor"
        omega: lowest and highest Omega = omega/omega_s, 0.01 to 100
        simulate: shapes of short motions from rest under the first forcing: "step", "half-sine", "chirp" over the
            window, "harmonic"
        pulse: length of the half-sine, half a period of the harmonic (time); default half a period of small vibration
        span: length of these motions in periods of small vibration
        sweeps: also integrate sweeps up and down (half a second per forcing; not for zeta = 0)
        bands: also carry the uncertainty of the law to the response (about 1 s per forcing)
        tol: relative truncation error of the response
        joint: with a joint all forces and the mass are those of the joint, and its damping is zeta
        patch_area: nominal area of the curve (length^2)
        units: "SI" or "other"; with "other" and no `gravity`, mass and omega_s are left out. Default SI, with a note.

    Raises:
        InputError: a value is not legal

    Examples:
        >>> from asperity.dynamics import DynamicsSettings
        >>> settings = DynamicsSettings(forcing=0.02).replaced(omega=[0.9, 1.1], zeta=None)
        >>> settings.forcing, settings.omega, settings.zeta
        ((0.02,), (0.9, 1.1), 0.01)
    """

    law: str = "auto"
    preload: float | None = None
    overload: float | None = None
    gravity: float | None = None
    zeta: float = 0.01
    damping: Damping = "always"
    excitation: str = "force"
    forcing: tuple[float, ...] = (0.01,)
    forcing_newton: tuple[float, ...] = ()
    base: tuple[float, ...] = ()
    base_acceleration: tuple[float, ...] = ()
    zetas: tuple[float, ...] = ()
    window: tuple[float, float] | None = None
    model: tuple[str, ...] = MODELS
    omega: tuple[float, float] = (0.5, 1.3)
    simulate: tuple[str, ...] = ()
    pulse: float | None = None
    span: float = 20.0
    sweeps: bool = False
    bands: bool = True
    tol: float = 1e-5
    joint: Joint | None = None
    patch_area: float | None = None
    units: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "forcing", forcings(self.forcing))
        for name in ("zetas", *_PHYSICAL):
            values = getattr(self, name)
            object.__setattr__(self, name, positives(name, values) if np.size(values) else ())
        given = [name for name in _PHYSICAL if getattr(self, name)]
        if len(given) > 1:
            raise InputError(f"{' and '.join(given)} are given; give one of them")
        if given:
            if self.excitation not in (_PHYSICAL[given[0]], type(self).excitation):
                raise InputError(f'{given[0]} is given, and excitation = "{self.excitation}"; give one of them')
            object.__setattr__(self, "excitation", _PHYSICAL[given[0]])
        one_of("excitation", self.excitation, EXCITATIONS)
        shapes = (self.simulate,) if isinstance(self.simulate, str) else tuple(self.simulate)
        object.__setattr__(self, "simulate", shapes)
        for name in shapes:
            one_of("simulate", name, SHAPES)
        if shapes and self.excitation == "base":
            raise InputError(
                "simulate is for a force or an acceleration of the base: a displacement that jumps has no acceleration"
            )
        within("span", self.span, SPAN)
        if self.pulse is not None:
            positive("pulse", self.pulse)
        if any(value >= 1 for value in self.zetas):
            raise InputError(f"zetas = {list(self.zetas)} is not legal: each must be below 1")
        if self.window is not None:
            ends = positives("window", self.window)
            if len(ends) != 2 or ends[0] >= ends[1]:
                raise InputError(f"window = {list(ends)} is not legal: give two frequencies, low < high")
            object.__setattr__(self, "window", ends)
        object.__setattr__(self, "omega", window(self.omega))
        object.__setattr__(self, "model", (self.model,) if isinstance(self.model, str) else tuple(self.model))
        if self.joint is not None and self.joint.damping is not None:
            if self.zeta not in (self.joint.damping, type(self).zeta):
                raise InputError(
                    f"zeta = {self.zeta:g} and joint.damping = {self.joint.damping:g} differ: give one of them"
                )
            object.__setattr__(self, "zeta", self.joint.damping)
        for name in self.model:
            one_of("model", name, MODELS)
        if not self.model:
            raise InputError("model is empty: choose exact, taylor or both")
        if self.units is not None:
            one_of("units", self.units, ("SI", "other"))

    @property
    def load(self) -> float | None:
        """Static force (force): the preload, else that of the joint; None if nothing gives it."""
        if self.preload is not None or self.joint is None:
            return self.preload
        return self.joint.load(self.patch_area)

    def on(self, scale: float, length: float, omega_s: float) -> DynamicsSettings:
        """Settings with excitation and window over a force, a length and a frequency of small vibration (rad/time).

        Raises:
            InputError: the frequency is unknown (NaN) and needed, or they are out of range
        """
        frequency = omega_s / (2 * math.pi)
        for name, of in (("window", "window in Hz"), ("base_acceleration", "acceleration"), ("pulse", "pulse")):
            if getattr(self, name) and not math.isfinite(frequency):
                raise InputError(f"{name}: a {of} needs the mass: give joint.mass, joint.frequency or gravity")
        forcing, omega = self.forcing, self.omega
        none: dict[str, Any] = dict.fromkeys(_PHYSICAL, ())
        for name, unit in zip(_PHYSICAL, (scale, length, length * omega_s**2), strict=True):
            if values := getattr(self, name):
                own = () if forcing == type(self).forcing else forcing
                forcing = (*own, *(value / unit for value in values))
        times = OMEGA[0] * frequency, OMEGA[1] * frequency
        if self.window is not None:
            for end in self.window:
                within("window", end, times)
            omega = (self.window[0] / frequency, self.window[1] / frequency)
        pulse = self.pulse
        if pulse is not None:
            pulse = frequency * within("pulse", pulse, (0.5 / times[1], 0.5 / times[0]))
        return replace(self, forcing=forcing, omega=omega, window=None, pulse=pulse, **none)

    @classmethod
    def of_case(cls, case: Mapping[str, Any], joint: Joint | None = None) -> DynamicsSettings:
        """Settings of a completed case (sections as of `Case.to_dict`), with another joint if given.

        The preload of the patch becomes that of the joint.
        """
        given = dict(case.get("dynamics", {}))
        if joint is None and "joint" in case:
            joint = Joint(**case["joint"])
        length = case.get("surface", {}).get("L")
        patch = None if length is None else float(length) ** 2
        given |= {"units": case.get("units"), "patch_area": patch}
        if joint is not None:  # the forces of the section [dynamics] are those of the patch
            own = {name: given[name] for name in ("preload", "overload") if given.get(name) is not None}
            given |= {name: joint.factor(patch) * force for name, force in own.items()}
            load = joint.load(patch)
            given |= {} if load is None else {"preload": load}
        return cls().replaced(**given).replaced(joint=joint)

    @property
    def factor(self) -> float:
        """Force of the joint over that of the curve; refused if the nominal area of the curve is unknown."""
        return 1.0 if self.joint is None else self.joint.factor(self.patch_area)

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
        """Settings with other values, None for no change.

        The overload does not outlive a change of law or preload; a damping ratio replaces that of the joint.
        """
        new = {name: value for name, value in changes.items() if value is not None}
        names = [field.name for field in fields(self)]
        if unknown := new.keys() - set(names):
            raise InputError(f"{min(unknown)} is no setting of the vibration: choose from {', '.join(names)}")
        if new.keys() & {"law", "preload"}:
            new.setdefault("overload", None)
        joint = new.get("joint", self.joint)
        if joint is not None and joint.damping is not None:
            new["joint"] = replace(joint, damping=new.setdefault("zeta", joint.damping))
        return replace(self, **new)
