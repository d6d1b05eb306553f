"""Complete vibration analysis of one law, and its files."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from asperity.curve.loops import LoopTable
from asperity.dynamics.free import FreeVibration, Thresholds
from asperity.vibration.joint import Numbers
from asperity.dynamics.motion import ESCAPED, Sweep, Trajectory
from asperity.dynamics.oscillator import GRAVITY, ContactOscillator
from asperity.dynamics.response import FrequencyResponse
from asperity.vibration.settings import DynamicsSettings
from asperity.errors import ConvergenceError, InputError
from asperity.vibration.checks import positive
from asperity.vibration.source import Choice, choose
from asperity.vibration.source import CurveColumns
from asperity.vibration.damping import LOOPS, LoopDamping
from asperity.vibration.joint import Uncertainty
from asperity.vibration.law import Law
from asperity.vibration.joint import LawTable, tabulate
from asperity.vibration.law import CurveLaw
from asperity.runtime import run_folder
from asperity.runtime.display import short_repr
from asperity.runtime.files import replace_file, write_csv

_SWEEP_POINTS = 41  # half a second per forcing
_SAMPLES = 32  # of a period of small vibration


def numbers_of(oscillator: ContactOscillator, bar: float = math.nan) -> Numbers:
    """Numbers of the small vibration of an oscillator; `bar` as in `Numbers`."""
    r, frequency = oscillator.restoring, oscillator.omega_s / (2 * math.pi)
    return Numbers(r.scale / r.z_s, oscillator.mass, frequency, r.z_s, oscillator.zeta, bar)


@dataclass(frozen=True)
class Dynamics:
    """Results of `run_dynamics` for one law; the keys of mappings are models ("exact", "taylor").

    Attributes:
        oscillators, free, thresholds: see there
        responses, sweeps: one per forcing, and direction
        uncertainty: intervals by the error bar and the points of the law; None without these
        motions: short motions from rest, by the course of the force
        notes: limits and assumptions of the results, one sentence each
        gravity: for mass and omega_s (length/time^2), None if unknown or if the joint has a mass
        laws: all laws of the curve at the preload; None for a given `Law`
        settings: what was computed
    """

    oscillators: dict[str, ContactOscillator]
    free: dict[str, FreeVibration]
    responses: dict[str, tuple[FrequencyResponse, ...]]
    sweeps: dict[str, tuple[Sweep, ...]]
    thresholds: dict[str, Thresholds]
    uncertainty: Uncertainty | None
    notes: tuple[str, ...]
    motions: dict[str, Trajectory] = field(default_factory=dict)
    gravity: float | None = None
    laws: LawTable | None = None
    settings: DynamicsSettings = field(default_factory=DynamicsSettings)

    @property
    def first(self) -> ContactOscillator:
        """Oscillator of the first model."""
        return next(iter(self.oscillators.values()))

    @property
    def numbers(self) -> Numbers:
        """Stiffness and frequency with their bar, mass, static approach and damping of small vibration."""
        known = None if self.uncertainty is None else self.uncertainty.k_n
        return numbers_of(self.first, math.nan if known is None else known.half / known.value)

    __repr__ = short_repr

    def write(self, out_dir: str | os.PathLike[str]) -> None:
        """Write free.csv, response.csv and thresholds.json into `out_dir`; motion.csv if there is any."""
        path = Path(out_dir)
        path.mkdir(parents=True, exist_ok=True)
        z_s, scale, unit = self.first.restoring.z_s, self.first.restoring.scale, self.numbers.frequency
        results: list[FrequencyResponse | Sweep] = [*chain(*self.responses.values()), *chain(*self.sweeps.values())]
        tables: dict[str, list[dict[str, Any]]] = {
            run_folder.FREE: [
                row | {"frequency": unit * row["omega_ratio"], "amplitude": z_s * row["u0"]}
                for one in self.free.values()
                for row in one.rows()
            ],
            run_folder.RESPONSE: [
                row
                | {"frequency": unit * row["Omega"], "force": force}
                | {"x_max": z_s * row["u_max"], "x_min": z_s * row["u_min"], "receptance": z_s * row["a1"] / force}
                for one in results
                for row in one.rows()
                for force in [scale * one.setting.forcing(row["Omega"])]
            ],
            run_folder.MOTION: self.moved(),
        }
        for name, rows in tables.items():
            if rows:
                write_csv(path / name, list(rows[0]), map(_cells, rows))
            else:  # of an earlier analysis
                (path / name).unlink(missing_ok=True)
        text = json.dumps(self.to_dict(), indent=2, allow_nan=False)
        replace_file(path / run_folder.THRESHOLDS, f"{text}\n".encode())

    def moved(self) -> list[dict[str, Any]]:
        """Rows of motion.csv."""
        r, second = self.first.restoring, 1.0 / self.first.omega_s
        return [
            {"shape": shape, "tau": tau, "u": u, "v": v, "F_hat": f}
            | {"time": second * tau, "x": r.z_s * u, "force": r.scale * f}
            for shape, path in self.motions.items()
            for tau, u, v, f in zip(path.tau, path.u, path.v, path.force, strict=True)
        ]

    def jumps(self) -> list[dict[str, Any]]:
        """Where slow sweeps leave a stable branch: frequency (1/time), force, amplitudes before and after (length)."""
        found = []
        r, hertz = self.first.restoring, self.numbers.frequency
        for model, responses in self.responses.items():
            for one in responses:
                for omega, upwards, before, after in one.jumps:
                    found.append({
                        "model": model, "zeta": one.setting.zeta, "F_hat": one.setting.F_hat,
                        "force": r.scale * float(one.setting.forcing(omega)),
                        "sweep": "up" if upwards else "down", "Omega": omega,
                        "frequency": hertz * omega if math.isfinite(hertz) else None, "x_max": r.z_s * before,
                        "x_max_after": None if after is None else r.z_s * after,
                    })  # fmt: skip
        return found

    def to_dict(self) -> dict[str, Any]:
        """Content of thresholds.json."""
        first, numbers, joint = self.first, self.numbers.to_dict(), self.settings.joint
        out: dict[str, Any] = {
            "normalisation": "u = (z - z_s)/z_s, Omega = omega/omega_s, F_hat = F/(n_loc W), W = load",
            "law": first.law.describe(),
            "load": first.restoring.load,
            "z_s": first.restoring.z_s,
            "gravity": self.gravity,
            "mass": numbers["m"],
            "omega_s": None if numbers["m"] is None else first.omega_s,
            "n_loc": first.restoring.n_loc,
            "kappa": first.restoring.kappa,
            "zeta": first.zeta,
            "damping": str(first.damping),
            "excitation": self.settings.excitation,
            "uncertainty": self.uncertainty.to_dict() if self.uncertainty else None,
            "notes": list(self.notes),
            "units": self.settings.units,
            "numbers": numbers,
            "joint": None if joint is None else {k: v for k, v in asdict(joint).items() if v is not None},
            "laws": None if self.laws is None else self.laws.to_dict(),
            "jumps": self.jumps(),
        }
        for model, values in self.thresholds.items():
            out[model] = {
                **values.to_dict(),
                "free_tolerance": self.free[model].tolerance,
                "free_valid": all(self.free[model].valid),
                "responses": [r.to_dict() for r in self.responses[model]],
                "sweeps": [s.to_dict() for s in self.sweeps.get(model, ())],
            }
        return out


def _cells(row: dict[str, Any]) -> dict[str, Any]:
    """Cells of a row of a file, without those of NaN; seven digits are more than the rows have."""
    known = {name: value for name, value in row.items() if value == value}
    for name, value in known.items():
        if isinstance(value, bool):
            known[name] = str(value).lower()
        elif isinstance(value, float | np.floating):
            known[name] = float(f"{value:.7g}")
    return known


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
    exact, gravity, laws, notes = _vibration(source, settings)
    kind = settings.excitation
    forcing, omega, pulse = settings.on(exact.restoring.scale, exact.restoring.z_s, exact.omega_s)
    oscillators = {name: exact if name == "exact" else exact.taylor() for name in settings.model}
    swept: dict[str, tuple[Sweep, ...]] = dict.fromkeys(oscillators, ())
    responses: dict[str, tuple[FrequencyResponse, ...]] = {}
    for name, oscillator in list(oscillators.items()):
        try:
            responses[name] = tuple(
                replace(oscillator, zeta=zeta).response(f, omega, excitation=kind, tol=settings.tol)
                for zeta in dict.fromkeys(settings.zeta)
                for f in forcing
            )
        except ConvergenceError as error:
            if name == "exact" or len(oscillators) == 1:
                raise
            notes.append(f"{name}: left out, its series lets the motion escape: {error}")
            del oscillators[name], swept[name]
            continue
        if settings.sweeps:
            swept[name] = oscillator.sweep(forcing, omega, excitation=kind, points=_SWEEP_POINTS)
        notes.extend(_notes(name, responses[name], swept[name]))
    spread = exact.uncertainty() if laws is None else laws.chosen.known
    if spread is not None and not (spread.origin and np.isfinite(spread.k_n.half)):
        spread = None  # nothing bounds the law, or a law that does not reach the preload
    onsets = {name: oscillator.thresholds(forcing, kind) for name, oscillator in oscillators.items()}
    if spread is not None:  # with the other laws and the error bar
        onsets = {name: replace(one, softening=spread.softening) for name, one in onsets.items()}
    result = Dynamics(
        oscillators=oscillators,
        free={name: oscillator.free() for name, oscillator in oscillators.items()},
        responses=responses,
        sweeps=swept,
        thresholds=onsets,
        uncertainty=spread,
        notes=tuple(notes),
        motions=_moved(next(iter(oscillators.values())), settings, forcing[0], omega, pulse or 0.5),
        gravity=gravity,
        laws=laws,
        settings=settings,
    )
    if out_dir is not None:
        result.write(out_dir)
    return result


def _moved(
    oscillator: ContactOscillator, settings: DynamicsSettings, forcing: float, window: tuple[float, float], pulse: float
) -> dict[str, Trajectory]:
    """Motions from rest by their shapes, with a pulse in periods."""
    found = {}
    for shape in settings.simulate:
        omega = window if shape == "chirp" else (0.5 / pulse,)
        periods, samples = settings.span * omega[0], math.ceil(_SAMPLES / omega[0])
        found[shape] = oscillator.simulate(omega, forcing, shape=shape, periods=periods, samples=samples)
    return found


def small_vibration(source: Any, settings: DynamicsSettings) -> Numbers:
    """Numbers of the small vibration on a curve; arguments and errors as in `run_dynamics`."""
    static, load, _ = _law(source, settings)
    settings = replace(settings, damping="always")  # that of loops needs their file, and has the same small motion
    return numbers_of(_oscillator(static, load, settings, _gravity(settings, "curve")[0]))


def _vibration(
    source: Any, settings: DynamicsSettings
) -> tuple[ContactOscillator, float | None, LawTable | None, list[str]]:
    """Oscillator on the law of a source, the gravity assumed, all laws of a curve, and notes on the law."""
    static, load, chosen = _law(source, settings)
    gravity, assumed = _gravity(settings, "law" if isinstance(source, Law) else "curve")
    damping, loop_note = settings.damping, ""
    if damping == LOOPS and isinstance(source, (str, os.PathLike)):
        path = Path(source)
        loops = (path if path.is_dir() else path.parent) / run_folder.LOOPS
        damping = LoopDamping.of(LoopTable.read(loops)) if loops.is_file() else LOOPS
    if isinstance(damping, LoopDamping):
        factor = settings.factor
        damping, loop_note = damping.on(float(static.stiffness(static.deflection(load))) / factor, load / factor)
    exact = _oscillator(static, load, replace(settings, damping=damping), gravity)
    si = ""
    if settings.with_units and settings.units is None:
        si = "amounts with units assume a curve in SI units: for other units give numbers without units"
    notes, laws = [*static.doubts(load), assumed, si, loop_note], None
    if chosen is not None:
        laws = tabulate(*chosen, exact.mass)
        notes += [*chosen[0].notes, laws.choice.note, _first_yield(laws.choice)]
    return exact, gravity, laws, [note for note in notes if note]


def _law(source: Any, settings: DynamicsSettings) -> tuple[Law, float, tuple[CurveColumns, Choice] | None]:
    """Law and preload of a source, with the columns and the choice if it is a curve."""
    joint, load = settings.joint, settings.load
    if isinstance(source, Law):
        if joint is not None and joint.nominal_area is not None:
            raise InputError("joint.nominal_area is for a curve: a law has the force of the joint already")
        return source, source.default_load if load is None else load, None
    columns = CurveColumns.of(source, settings.factor)
    choice = choose(columns, settings.law, load)
    return choice.law, choice.load, (columns, choice)


def _oscillator(law: Law, load: float, settings: DynamicsSettings, gravity: float | None) -> ContactOscillator:
    """Oscillator on a law, with the mass of the joint if it has one."""
    if settings.joint is not None and settings.joint.mass is not None:
        gravity = load / settings.joint.mass
    return ContactOscillator(law, load=load, gravity=gravity, zeta=settings.zeta[0], damping=settings.damping)


def _first_yield(choice: Choice) -> str:
    """Note where the preload is the greatest force that the contact has met, or ""."""
    leg = choice.law.top if choice.name == "unload-reload" and isinstance(choice.law, CurveLaw) else choice.load
    if not choice.yielded or choice.name not in ("unload-reload", "elastic") or choice.load < leg * (1 - 1e-9):
        return ""
    return (
        "the preload is the greatest force that the contact has met: motion yields in its first cycle; the law is that "
        "of the cycles that follow"
    )


def _notes(name: str, responses: Iterable[FrequencyResponse], sweeps: Iterable[Sweep]) -> Iterator[str]:
    """Notes on the results of a model."""
    for r in responses:
        where = f"{name}, {r.setting.amplitude}:"
        yield from (f"{where} {note}" for note in r.notes)
    for s in (s for s in sweeps if ESCAPED in s.status):
        where = f"at Omega = {s.Omega[s.status.index(ESCAPED)]:.4g}, a property of the truncation"
        yield f"{name}, {s.setting.amplitude}: the sweep {s.direction} escapes from the Taylor well {where}"


def _gravity(settings: DynamicsSettings, source: str) -> tuple[float | None, str]:
    """Gravity in the units of a source, None if unknown or of no use, and a note on it or ""."""
    joint, gravity, units = settings.joint, settings.gravity, settings.units
    with_mass = joint is not None and joint.mass is not None
    if gravity is not None:
        if with_mass:
            raise InputError(
                f"gravity = {gravity:g} takes the mass from the preload, and the joint has its own: give one of them"
            )
        return positive("gravity", gravity), ""
    if with_mass:
        return None, ""
    if joint is not None:
        return None, "m and f are left out: the joint has no joint.mass"
    if units == "other":
        return None, 'mass and omega_s are left out: units = "other" needs gravity (length over time squared)'
    if units is None:
        return GRAVITY, (
            f"mass and omega_s assume a {source} in SI units, gravity = {GRAVITY:g}: for other units give the "
            "gravity in those units"
        )
    return GRAVITY, ""
