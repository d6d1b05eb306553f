"""Complete vibration analysis of one law, its results and their files."""

from __future__ import annotations

import json
import math
import os
from dataclasses import asdict, dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any

from asperity.errors import ConvergenceError, InputError
from asperity.model.dynamics import DynamicsSettings
from asperity.runtime import run_folder
from asperity.runtime.display import short_repr
from asperity.runtime.files import replace_file, write_csv
from asperity.vibration.free import FreeVibration, Thresholds
from asperity.vibration.law import Law
from asperity.vibration.motion import Trajectory
from asperity.vibration.oscillator import GRAVITY, ContactOscillator, Numbers
from asperity.vibration.response import FrequencyResponse, finite
from asperity.vibration.source import Choice, CurveColumns, choose

_SAMPLES = 32  # of a period of small vibration
_DIGITS = 7  # of a number in a file, more than it has


@dataclass(frozen=True)
class Dynamics:
    """Results of `run_dynamics` for one law; the keys of mappings are models ("exact", "taylor").

    Attributes:
        settings: what was computed
        oscillators: see there
        responses: one per damping ratio and forcing
        motions: short motions from rest, by the course of the force
        numbers: stiffness and frequency, mass, static approach and damping of small vibration, with bars
        notes: limits and assumptions of the results, one sentence each
        choice: which law of the curve it is; None for a given `Law`
        free, thresholds: see there
    """

    settings: DynamicsSettings
    oscillators: dict[str, ContactOscillator]
    responses: dict[str, tuple[FrequencyResponse, ...]]
    motions: dict[str, Trajectory]
    numbers: Numbers
    notes: tuple[str, ...]
    choice: Choice | None
    free: dict[str, FreeVibration] = field(init=False)
    thresholds: dict[str, Thresholds] = field(init=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "free", {name: one.free() for name, one in self.oscillators.items()})
        object.__setattr__(self, "thresholds", {name: one.thresholds() for name, one in self.oscillators.items()})

    @property
    def gravity(self) -> float | None:
        """For mass and omega_s (length/time^2), None if unknown or if the joint has a mass."""
        joint = self.settings.joint
        return self.first.gravity if joint is None or joint.mass is None else None

    @property
    def first(self) -> ContactOscillator:
        """Oscillator of the first model."""
        return next(iter(self.oscillators.values()))

    def write(self, out_dir: str | os.PathLike[str]) -> None:
        """Write free.csv, response.csv and thresholds.json into `out_dir`; motion.csv if there is any."""
        path, r, unit = Path(out_dir), self.first, self.numbers.frequency
        path.mkdir(parents=True, exist_ok=True)
        free = [
            row | {"frequency": unit * row["omega_ratio"], "amplitude": r.z_s * row["u0"]}
            for one in self.free.values() for row in one.rows()
        ]  # fmt: skip
        response = [
            row | {"frequency": unit * row["Omega"], "force": force}
            | {"x_max": r.z_s * row["u_max"], "x_min": r.z_s * row["u_min"], "receptance": r.z_s * row["a1"] / force}
            for one in chain(*self.responses.values()) for row in one.rows()
            for force in [r.scale * one.equation.forcing(row["Omega"])]
        ]  # fmt: skip
        tables = {run_folder.FREE: free, run_folder.RESPONSE: response, run_folder.MOTION: self.moved()}
        for name, rows in tables.items():
            if rows:
                write_csv(path / name, list(rows[0]), rows, digits=_DIGITS)
            else:  # of an earlier analysis
                (path / name).unlink(missing_ok=True)
        text = json.dumps(self.to_dict(), indent=2, allow_nan=False)
        replace_file(path / run_folder.THRESHOLDS, f"{text}\n".encode())

    def moved(self) -> list[dict[str, Any]]:
        """Rows of motion.csv."""
        r, second = self.first, 1.0 / self.first.omega_s
        return [
            {"shape": shape, "tau": tau, "u": u, "v": v, "F_hat": f}
            | {"time": second * tau, "x": r.z_s * u, "force": r.scale * f}
            for shape, path in self.motions.items()
            for tau, u, v, f in zip(path.tau, path.u, path.v, path.force, strict=True)
        ]

    def jumps(self) -> list[dict[str, Any]]:
        """Where slow sweeps leave a stable branch: frequency (1/time), force, amplitudes before and after (length)."""
        r, hertz = self.first, self.numbers.frequency
        return [
            {
                "model": model, "zeta": one.equation.zeta, "F_hat": one.equation.F_hat,
                "force": r.scale * float(one.equation.forcing(jump["Omega"])), "sweep": jump["sweep"],
                "Omega": jump["Omega"], "frequency": finite(hertz * jump["Omega"]), "x_max": r.z_s * jump["u_max"],
                "x_max_after": after and r.z_s * after, "note": jump["note"],
            }
            for model, responses in self.responses.items() for one in responses for jump in one.jumps
            for after in [jump["u_max_after"]]
        ]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Content of thresholds.json."""
        first, r, numbers, joint = self.first, self.first, self.numbers.to_dict(), self.settings.joint
        laws, choice = None, self.choice
        if choice is not None:
            laws = {
                "chosen": choice.name, "reason": choice.reason, "doubt": choice.note, "yielded": choice.yielded,
                "rows": choice.done,
            }  # fmt: skip
        return {
            "normalisation": "u = (z - z_s)/z_s, Omega = omega/omega_s, F_hat = F/(n_loc W), W = load",
            "law": first.law.describe(), "load": r.load, "z_s": r.z_s, "gravity": self.gravity, "mass": numbers["m"],
            "omega_s": None if numbers["m"] is None else first.omega_s, "n_loc": r.n_loc, "kappa": r.kappa,
            "zeta": first.zeta, "damping": str(first.damping), "excitation": self.settings.excitation,
            "notes": list(self.notes), "units": self.settings.units, "numbers": numbers,
            "joint": None if joint is None else {k: v for k, v in asdict(joint).items() if v is not None},
            "laws": laws, "jumps": self.jumps(),
        } | {
            model: asdict(values) | {
                "free_tolerance": float(self.free[model].error.max()), "free_valid": bool(self.free[model].valid.all()),
                "responses": [one.to_dict() for one in self.responses[model]],
            }
            for model, values in self.thresholds.items()
        }  # fmt: skip


def run_dynamics(
    source: Any,
    settings: DynamicsSettings | None = None,
    *,
    out_dir: str | os.PathLike[str] | None = None,
    **changes: Any,
) -> Dynamics:
    """Compute free vibration, frequency response, thresholds and on request more, of a mass on a contact.

    Args:
        source: a `Law`, a `Curve`, a mapping or CSV file with columns delta and force, or a run directory
        settings: default those of the case of a run directory, else the defaults of `DynamicsSettings`
        out_dir: directory for the files, written after all input has been checked; for figures see
            `asperity.plot.plot_dynamics`
        **changes: attributes of `DynamicsSettings` with other values

    Raises:
        InputError: a setting or the curve is wrong
        RangeError: the law does not reach the preload, or an orbit leaves a table at once
        ConvergenceError: no orbit can be found

    Examples:
        >>> delta = np.linspace(0.0, 1e-8, 11)
        >>> curve = {"delta": delta, "force": 2e9 * delta**1.5}
        >>> result = asp.run_dynamics(curve, units="SI", forcing=0.005, model="exact", omega=(0.9, 1.1), tol=1e-3)
        >>> omega, u_max = result.responses["exact"][0].peak
        >>> print(f"peak u = {u_max:.3f} at Omega = {omega:.3f}")
        peak u = 0.245 at Omega = 0.997
    """
    if settings is None:
        settings = DynamicsSettings.of_source(source, changes.get("joint"))
    settings = settings.replaced(**changes)
    exact, numbers, choice, notes = _small(source, settings)
    forcing, omega, pulse = settings.on(exact.scale, exact.z_s, exact.omega_s)
    oscillators = {name: exact if name == "exact" else exact.taylor() for name in settings.model}
    responses: dict[str, tuple[FrequencyResponse, ...]] = {}
    for name, oscillator in list(oscillators.items()):
        try:
            responses[name] = tuple(
                replace(oscillator, zeta=zeta).response(f, omega, excitation=settings.excitation, tol=settings.tol)
                for zeta in dict.fromkeys(settings.zeta)
                for f in forcing
            )
        except ConvergenceError as error:
            if name == "exact" or len(oscillators) == 1:
                raise
            notes.append(f"{name}: left out, its series lets the motion escape: {error}")
            del oscillators[name]
            continue
        notes += [f"{name}, {r.equation.amplitude}: {note}" for r in responses[name] for note in r.notes]
    first, motions = next(iter(oscillators.values())), {}
    for shape in settings.simulate:
        window = omega if shape == "chirp" else (0.5 / (pulse or 0.5),)
        periods, samples = settings.span * window[0], math.ceil(_SAMPLES / window[0])
        motions[shape] = first.simulate(window, forcing[0], shape=shape, periods=periods, samples=samples)
    result = Dynamics(settings, oscillators, responses, motions, numbers, tuple(dict.fromkeys(notes)), choice)
    if out_dir is not None:
        result.write(out_dir)
    return result


def small_vibration(source: Any, settings: DynamicsSettings) -> tuple[Numbers, float]:
    """Numbers of the small vibration on a curve, and the preload (force); arguments and errors as in `run_dynamics`."""
    oscillator, numbers, *_ = _small(source, settings)
    return numbers, oscillator.load


def _small(source: Any, settings: DynamicsSettings) -> tuple[ContactOscillator, Numbers, Choice | None, list[str]]:
    """Oscillator of a source, its numbers, the choice if it is a curve, and notes."""
    joint, load, choice, notes, more = settings.joint, settings.load, None, [], {}
    if not isinstance(source, Law):
        choice = choose(CurveColumns.of(source, **settings.columns), settings.law, load)
        law, load, notes = choice.law, choice.load, [choice.done, choice.note]
        greatest = float(law.force(law.known_to)) if choice.name == "unload-reload" else load
        if joint is not None:
            more = {"block": settings.block / settings.factor}
            more |= {"greatest": greatest} if choice.name == "unload-reload" else {}
        if choice.yielded and choice.name in ("unload-reload", "elastic") and load >= greatest * (1 - 1e-9):
            notes.append(
                "the preload is the greatest force that the contact has met: motion yields in its first cycle; the law "
                "is that of the cycles that follow"
            )
    elif joint is not None and joint.nominal_area is not None:
        raise InputError("joint.nominal_area is for a curve: a law has the force of the joint already")
    else:
        law, load = source, source.default_load if load is None else load
    gravity, assumed = _gravity(settings, load, "law" if choice is None else "curve")
    if settings.with_units and settings.units is None:
        notes.insert(0, "amounts with units assume a curve in SI units: for other units give numbers without units")
    oscillator = ContactOscillator(law, load=load, gravity=gravity, zeta=settings.zeta[0], damping=settings.damping)
    numbers = Numbers.of(law, load, oscillator.mass, oscillator.zeta, **more)
    return oscillator, numbers, choice, [note for note in (assumed, *notes) if note]


def _gravity(settings: DynamicsSettings, load: float, source: str) -> tuple[float | None, str]:
    """Gravity in the units of a source, by the mass of the joint if it has one, None if unknown; a note on it or ""."""
    joint, gravity = settings.joint, settings.gravity
    if joint is not None and joint.mass is not None:
        if gravity is not None:
            raise InputError(
                f"gravity = {gravity:g} takes the mass from the preload, and the joint has its own: give one of them"
            )
        return load / joint.mass, ""
    if gravity is not None:
        return gravity, ""
    if joint is not None:
        return None, "m and f are left out: the joint has no joint.mass"
    if settings.units == "other":
        return None, 'mass and omega_s are left out: units = "other" needs gravity (length over time squared)'
    assumed = (
        f"mass and omega_s assume a {source} in SI units, gravity = {GRAVITY:g}: for other units give the gravity in "
        "those units"
    )
    return GRAVITY, "" if settings.units == "SI" else assumed
