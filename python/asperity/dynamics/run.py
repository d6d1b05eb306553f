"""Complete vibration analysis of one law."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity.dynamics.columns import CurveColumns
from asperity.dynamics.intervals import intervals, response_band
from asperity.dynamics.joint import Numbers
from asperity.dynamics.law.checks import positive
from asperity.dynamics.law.damping import LOOPS, LoopDamping
from asperity.dynamics.law.law import Law
from asperity.dynamics.law_of_curve import Choice, choose
from asperity.dynamics.laws import LawTable, tabulate
from asperity.dynamics.oscillator import GRAVITY, ContactOscillator
from asperity.dynamics.response import FrequencyResponse
from asperity.dynamics.results import Dynamics, numbers_of
from asperity.dynamics.settings import DynamicsSettings
from asperity.dynamics.sweep import ESCAPED, Sweep
from asperity.errors import AsperityError, InputError
from asperity.loops import LoopTable
from asperity.runtime import run_folder

_SWEEP_POINTS = 41


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
        out_dir: directory for free.csv, response.csv, thresholds.json and band.csv; None writes nothing. For figures
            see `asperity.plot.plot_dynamics`.
        **changes: attributes of `DynamicsSettings` with other values

    Returns:
        The results. Files are written only after all input has been checked.

    Raises:
        InputError: a setting or the curve is wrong
        RangeError: the law does not reach the preload, or an orbit leaves a table at once
        ConvergenceError: no orbit can be found

    Examples:
        >>> delta = np.linspace(0.0, 1e-8, 11)
        >>> curve = {"delta": delta, "force": 2e9 * delta**1.5}
        >>> result = asp.run_dynamics(curve, units="SI", forcing=0.005, model="exact", omega=(0.9, 1.1), tol=1e-3,
        ...                           bands=False)
        >>> omega, u_max = result.responses["exact"][0].peak
        >>> print(f"peak u = {u_max:.3f} at Omega = {omega:.3f}")
        peak u = 0.245 at Omega = 0.997
    """
    if settings is None:
        settings = DynamicsSettings.of_source(source, changes.get("joint"))
    settings = settings.replaced(**changes)
    exact, gravity, laws, notes = _vibration(source, settings)
    oscillators = {name: exact if name == "exact" else exact.taylor() for name in settings.model}
    swept: dict[str, tuple[Sweep, ...]] = dict.fromkeys(oscillators, ())
    responses: dict[str, tuple[FrequencyResponse, ...]] = {}
    for name, oscillator in oscillators.items():
        responses[name] = tuple(oscillator.response(f, settings.omega, tol=settings.tol) for f in settings.forcing)
        if settings.sweeps and settings.zeta > 0:
            try:
                swept[name] = oscillator.sweep(settings.forcing, settings.omega, points=_SWEEP_POINTS)
            except AsperityError as error:
                notes.append(f"{name}: no sweep: {error}")
        notes.extend(_notes(name, oscillator, responses[name], swept[name]))
    spread = intervals(exact.law, exact.restoring.load, mass=exact.mass) if laws is None else laws.chosen.known
    if spread is not None and not (spread.origin and np.isfinite(spread.k_n.half)):
        spread = None  # nothing bounds the law, or a law that does not reach the preload
    bands = []
    for f in settings.forcing:
        try:
            if settings.bands and spread is not None and "exact" in oscillators:
                bands.append(response_band(exact, f, spread, settings.omega))
        except AsperityError as error:
            notes.append(f"exact, F^ = {f:g}: no band: {error}")
    onsets = {name: oscillator.thresholds(settings.forcing) for name, oscillator in oscillators.items()}
    if spread is not None:  # with the other laws and the error bar
        onsets = {name: replace(one, softening=spread.softening) for name, one in onsets.items()}
    result = Dynamics(
        oscillators=oscillators,
        free={name: oscillator.free() for name, oscillator in oscillators.items()},
        responses=responses,
        sweeps=swept,
        thresholds=onsets,
        uncertainty=spread,
        bands=tuple(bands),
        notes=tuple(notes),
        gravity=gravity,
        laws=laws,
        settings=settings,
    )
    if out_dir is not None:
        result.write(out_dir)
    return result


def small_vibration(source: Any, settings: DynamicsSettings) -> Numbers:
    """Numbers of the small vibration on a curve; arguments and errors as in `run_dynamics`."""
    static, load, _ = _law(source, settings)
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
        factor = 1.0 if settings.joint is None else settings.joint.factor(settings.patch_area)
        damping, loop_note = damping.on(float(static.stiffness(static.deflection(load))) / factor, load / factor)
    exact = _oscillator(static, load, replace(settings, damping=damping), gravity)
    notes, laws = [*static.doubts(load), assumed, loop_note], None
    if chosen is not None:
        laws = tabulate(*chosen, exact.mass)
        notes += [laws.choice.note, _first_yield(laws.choice)]
    return exact, gravity, laws, [note for note in notes if note]


def _law(source: Any, settings: DynamicsSettings) -> tuple[Law, float, tuple[CurveColumns, Choice] | None]:
    """Law and preload of a source, with the columns and the choice if it is a curve."""
    joint, load = settings.joint, settings.preload
    if isinstance(source, Law):
        if joint is not None and joint.nominal_area is not None:
            raise InputError("joint.nominal_area is for a curve: a law has the force of the joint already")
        return source, source.default_load if load is None else load, None
    if load is None and joint is not None:
        load = joint.load(settings.patch_area)
    columns = CurveColumns.of(source, 1.0 if joint is None else joint.factor(settings.patch_area))
    choice = choose(columns, settings.law, load, overload=settings.overload)
    return choice.law, choice.load, (columns, choice)


def _oscillator(law: Law, load: float, settings: DynamicsSettings, gravity: float | None) -> ContactOscillator:
    """Oscillator on a law, with the mass of the joint if it has one."""
    exact = ContactOscillator(law, load=load, gravity=gravity, zeta=settings.zeta, damping=settings.damping)
    joint = settings.joint
    mass = None if joint is None else joint.mass_at(exact.restoring.scale / exact.restoring.z_s)
    return exact if mass is None else replace(exact, gravity=load / mass)


def _first_yield(choice: Choice) -> str:
    """Note where the preload is the greatest force that the contact has met, or ""."""
    if choice.reached is None or choice.reached > choice.load * (1 + 1e-9):
        return ""
    settled = "the law is that of the cycles that follow"
    if np.isfinite(choice.law.yields_at):
        settled = (
            "above the preload the law is that of this cycle, the loading curve; those that follow move on the "
            "unloading branch of their own greatest force"
        )
    return f"the preload is the greatest force that the contact has met: motion yields in its first cycle; {settled}"


def _notes(
    name: str, oscillator: ContactOscillator, responses: Iterable[FrequencyResponse], sweeps: Iterable[Sweep]
) -> Iterator[str]:
    """Notes on the results of a model."""
    again = oscillator.restoring.kink
    for r in responses:
        where, top = f"{name}, F^ = {r.setting.F_hat:g}:", max(float(b.u_max.max()) for b in r.branches)
        if 1e-9 < again < top:
            yield (
                f"{where} the response reaches u = {top:.4g}, and above u = {again:.4g} the contact yields again: "
                "there the law is the loading curve, which holds for the first cycle of that amplitude; those that "
                "follow find a stiffer contact"
            )
        yield from (f"{where} {note}" for note in r.notes)
    for s in sweeps:
        if ESCAPED in s.status:
            escape = float(s.Omega[s.status.index(ESCAPED)])
            yield (
                f"{name}, F^ = {s.setting.F_hat:g}: the sweep {s.direction} escapes from the Taylor "
                f"well at Omega = {escape:.4g}, a property of the truncation"
            )


def _gravity(settings: DynamicsSettings, source: str) -> tuple[float | None, str]:
    """Gravity in the units of a source, None if unknown or of no use, and a note on it or ""."""
    joint, gravity, units = settings.joint, settings.gravity, settings.units
    with_mass = joint is not None and (joint.mass is not None or joint.frequency is not None)
    if gravity is not None:
        if with_mass:
            raise InputError(
                f"gravity = {gravity:g} takes the mass from the preload, and the joint has its own: give one of them"
            )
        return positive("gravity", gravity), ""
    if with_mass:
        return None, ""
    if joint is not None:
        return None, "m and f are left out: the joint has neither joint.mass nor joint.frequency"
    if units == "other":
        return None, 'mass and omega_s are left out: units = "other" needs gravity (length over time squared)'
    if units is None:
        return GRAVITY, (
            f"mass and omega_s assume a {source} in SI units, gravity = {GRAVITY:g}: for other units give the "
            "gravity in those units"
        )
    return GRAVITY, ""
