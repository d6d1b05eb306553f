"""Complete vibration analysis of one law."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from typing import Any

import numpy as np

from asperity.errors import ConvergenceError, InputError
from asperity.vibration.checks import positive
from asperity.vibration.law import Law, bar_of
from asperity.vibration.motion import Trajectory
from asperity.vibration.numbers import Numbers
from asperity.vibration.oscillator import GRAVITY, ContactOscillator
from asperity.vibration.response import FrequencyResponse
from asperity.vibration.results import Dynamics
from asperity.vibration.settings import DynamicsSettings
from asperity.vibration.source import Choice, CurveColumns, choose

_SAMPLES = 32  # of a period of small vibration


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
    law, load, columns, choice = _law(source, settings)
    gravity, assumed = _gravity(settings, "law" if choice is None else "curve")
    exact = _oscillator(law, load, settings, gravity)
    kind = settings.excitation
    forcing, omega, pulse = settings.on(exact.restoring.scale, exact.restoring.z_s, exact.omega_s)
    oscillators = {name: exact if name == "exact" else exact.taylor() for name in settings.model}
    responses: dict[str, tuple[FrequencyResponse, ...]] = {}
    notes = [assumed]
    if settings.with_units and settings.units is None:
        notes.append("amounts with units assume a curve in SI units: for other units give numbers without units")
    if choice is not None:
        notes += [choice.done, *columns.notes, choice.note, _first_yield(choice)]
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
            del oscillators[name]
            continue
        notes += [f"{name}, {r.setting.amplitude}: {note}" for r in responses[name] for note in r.notes]
    result = Dynamics(
        oscillators=oscillators,
        free={name: oscillator.free() for name, oscillator in oscillators.items()},
        responses=responses,
        thresholds={name: oscillator.thresholds(forcing, kind) for name, oscillator in oscillators.items()},
        numbers=_numbers(exact, settings, choice),
        notes=tuple(dict.fromkeys(note for note in notes if note)),
        bars=tuple(_bars(exact, response) for response in responses.get("exact", ())) if law.sides() else (),
        motions=_moved(next(iter(oscillators.values())), settings, forcing[0], omega, pulse or 0.5),
        gravity=gravity,
        choice=choice,
        settings=settings,
    )
    if out_dir is not None:
        result.write(out_dir)
    return result


def small_vibration(source: Any, settings: DynamicsSettings) -> tuple[Numbers, float]:
    """Numbers of the small vibration on a curve, and the preload (force); arguments and errors as in `run_dynamics`."""
    law, load, _, choice = _law(source, settings)
    oscillator = _oscillator(law, load, settings, _gravity(settings, "curve")[0])
    return _numbers(oscillator, settings, choice), load


def _bars(oscillator: ContactOscillator, response: FrequencyResponse) -> Any:
    """Bars of peak and folds: the same numbers by the sides of the law."""
    oscillator = replace(oscillator, zeta=response.setting.zeta)

    def numbers(law: Law) -> Any:
        if law is oscillator.law:
            places = [response.peak, *((e.Omega, e.u_max) for e in response["fold"])]
            return np.array(places)
        return response.numbers(replace(oscillator, law=law).equation)

    return bar_of(oscillator.law, numbers)


def _numbers(oscillator: ContactOscillator, settings: DynamicsSettings, choice: Choice | None) -> Numbers:
    """Numbers of the small vibration of an oscillator."""
    joint, more = settings.joint, {}
    if joint is not None and choice is not None:
        more = {"block": settings.block / settings.factor}
        if choice.name == "unload-reload":
            more["greatest"] = float(choice.law.force(choice.law.known_to))
    return Numbers.of(oscillator.law, oscillator.restoring.load, oscillator.mass, oscillator.zeta, **more)


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


def _law(source: Any, settings: DynamicsSettings) -> tuple[Law, float, Any, Choice | None]:
    """Law and preload of a source, with the columns and the choice if it is a curve."""
    joint, load = settings.joint, settings.load
    if isinstance(source, Law):
        if joint is not None and joint.nominal_area is not None:
            raise InputError("joint.nominal_area is for a curve: a law has the force of the joint already")
        return source, source.default_load if load is None else load, None, None
    columns = CurveColumns.of(source, **settings.columns)
    choice = choose(columns, settings.law, load)
    return choice.law, choice.load, columns, choice


def _oscillator(law: Law, load: float, settings: DynamicsSettings, gravity: float | None) -> ContactOscillator:
    """Oscillator on a law, with the mass of the joint if it has one."""
    if settings.joint is not None and settings.joint.mass is not None:
        gravity = load / settings.joint.mass
    return ContactOscillator(law, load=load, gravity=gravity, zeta=settings.zeta[0], damping=settings.damping)


def _first_yield(choice: Choice) -> str:
    """Note where the preload is the greatest force that the contact has met, or ""."""
    leg = float(choice.law.force(choice.law.known_to)) if choice.name == "unload-reload" else choice.load
    if not choice.yielded or choice.name not in ("unload-reload", "elastic") or choice.load < leg * (1 - 1e-9):
        return ""
    return (
        "the preload is the greatest force that the contact has met: motion yields in its first cycle; the law is that "
        "of the cycles that follow"
    )


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
