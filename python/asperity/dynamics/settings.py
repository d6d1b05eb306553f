"""Settings of a vibration analysis and of a forced result, and the legal frequencies and forcings.

Each default is here, and the section [dynamics] of a case takes it from here.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity.dynamics.equation import Forcing
from asperity.dynamics.joint import Joint
from asperity.errors import InputError
from asperity.force_law.checks import positives, within
from asperity.force_law.damping import Damping
from asperity.runtime.files import parse_toml, read_text

OMEGA = (0.01, 100.0)  # below, motion is quasi-static; above, the mass hardly moves
FORCING = (1e-9, 1e6)  # below, motion is linear in the forcing and lost in the round-off of the force
MIN_ZETA = 1e-4  # smallest damping ratio with which motion settles in 20000 periods
MODELS = ("exact", "taylor")


@dataclass(frozen=True)
class Setting:
    """Model ("exact" or "taylor"), law, damping and forcing F/(n_loc W) of a forced result."""

    model: str
    law: str
    n_loc: float
    zeta: float
    damping: str
    F_hat: float

    @property
    def forcing(self) -> Forcing:
        """F^ over the frequency."""
        return Forcing(self.F_hat)

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
            "phase": phase,
        }  # fmt: skip


def forcings(values: Any) -> tuple[float, ...]:
    """One F^ or several as a tuple; raise `InputError` unless all are legal."""
    return tuple(within("forcing", value, FORCING) for value in positives("forcing", values))


def window(omega: Sequence[float]) -> tuple[float, float]:
    """Lowest and highest Omega; raise `InputError` unless they are a legal window."""
    values = tuple(within("omega", value, OMEGA) for value in positives("omega", omega))
    if len(values) != 2 or values[0] >= values[1]:
        raise InputError(f"omega = {list(values)} is not legal: give two frequencies 0 < low < high")
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
        forcing: F^ = F/(n_loc W), one or several, each 1e-9 to 1e6
        forcing_newton: amplitudes of the force itself (force), instead of or in addition to `forcing`
        zetas: further damping ratios, for the responses
        window: lowest and highest frequency of the excitation (1/time), instead of `omega`
        model: "exact" and/or "taylor"
        omega: lowest and highest Omega = omega/omega_s, 0.01 to 100
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
    forcing: tuple[float, ...] = (0.01,)
    forcing_newton: tuple[float, ...] = ()
    zetas: tuple[float, ...] = ()
    window: tuple[float, float] | None = None
    model: tuple[str, ...] = MODELS
    omega: tuple[float, float] = (0.5, 1.3)
    sweeps: bool = False
    bands: bool = True
    tol: float = 1e-5
    joint: Joint | None = None
    patch_area: float | None = None
    units: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "forcing", forcings(self.forcing))
        newton = positives("forcing_newton", self.forcing_newton) if np.size(self.forcing_newton) else ()
        object.__setattr__(self, "forcing_newton", newton)
        object.__setattr__(self, "zetas", positives("zetas", self.zetas) if np.size(self.zetas) else ())
        if any(value >= 1 for value in self.zetas):
            raise InputError(f"zetas = {list(self.zetas)} is not legal: each must be below 1")
        if self.window is not None:
            ends = positives("window", self.window)
            if len(ends) != 2 or ends[0] >= ends[1]:
                raise InputError(f"window = {list(ends)} is not legal: give two frequencies 0 < low < high")
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
            if name not in MODELS:
                raise InputError(f'model = "{name}" is unknown: choose one of {", ".join(MODELS)}')
        if not self.model:
            raise InputError("model is empty: choose exact, taylor or both")
        if self.units not in (None, "SI", "other"):
            raise InputError(f'units = "{self.units}" is unknown: choose SI or other')

    @property
    def load(self) -> float | None:
        """Static force (force): the preload, else that of the joint; None if nothing gives it."""
        if self.preload is not None or self.joint is None:
            return self.preload
        return self.joint.load(self.patch_area)

    def on(self, scale: float, frequency: float) -> DynamicsSettings:
        """Settings with force and window over `scale` and the frequency of small vibration, for which they were given.

        Raises:
            InputError: the frequency is unknown (NaN) and the window is one, or they are out of range
        """
        forcing, omega = self.forcing, self.omega
        if self.forcing_newton:
            own = () if forcing == type(self).forcing else forcing
            forcing = (*own, *(force / scale for force in self.forcing_newton))
        if self.window is not None:
            if not math.isfinite(frequency):
                raise InputError("a window in Hz needs the mass: give joint.mass, joint.frequency or gravity")
            omega = (self.window[0] / frequency, self.window[1] / frequency)
        return replace(self, forcing=forcing, forcing_newton=(), omega=omega, window=None)

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
