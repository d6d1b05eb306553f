# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Complete vibration analysis of one law."""

from __future__ import annotations

import os
import tomllib
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity.dynamics.forcing import forcings, window
from asperity.dynamics.joint import Joint, Numbers, loads_of_case
from asperity.dynamics.law.checks import positive
from asperity.dynamics.law.choice import LAWS, Choice, choose, read_history
from asperity.dynamics.law.damping import DAMPING, LOOPS, Damping
from asperity.dynamics.law.history import History
from asperity.dynamics.law.law import Law
from asperity.dynamics.law.loop_damping import LoopDamping
from asperity.dynamics.law.two_branches import TwoBranchLaw
from asperity.dynamics.laws import LawTable, tabulate
from asperity.dynamics.motion.sweep import ESCAPED, Sweep
from asperity.dynamics.orbits.free import FreeVibration
from asperity.dynamics.orbits.response import FrequencyResponse
from asperity.dynamics.orbits.thresholds import Thresholds
from asperity.dynamics.oscillator import GRAVITY, ContactOscillator
from asperity.dynamics.results import Dynamics, numbers_of
from asperity.dynamics.uncertainty import Band, Uncertainty, response_band, uncertainty
from asperity.errors import AsperityError, AsperityWarning, InputError
from asperity.loops import LoopTable
from asperity.runtime import run_folder

__all__ = ["LAWS", "MODELS", "law_from", "run_dynamics", "small_vibration"]

MODELS = ("exact", "taylor")
ZETA = 0.01  # default damping ratio
FORCING, OMEGA = (0.01,), (0.5, 1.3)  # default F^ and window
_SWEEP_POINTS = 41


def law_from(
    source: Any,
    law: str = "auto",
    load: float | None = None,
    *,
    overload: float | None = None,
    extrapolate: bool = False,
) -> tuple[Law, float]:
    """Return the static law and the preload (force) of a curve.

    Args:
        source: a `Law`, a `Curve`, a CSV file with columns delta and force, or a directory with curve.csv.
        law: "auto": after yield the unload-reload branch through the preload, else the elastic tangent of the states on
            the loading (columns k_n_elastic), else "paper" with a warning; before yield "table". By name:
            "unload-reload" (branch computed about the preload), "elastic" (the elastic tangent), "table" (the points
            of the loading branch), "paper" (power law of `Curve.fit`, as a reversible spring).
        load: preload (force); default half of the largest force of the curve.
        overload: for "auto", greatest force before the vibration (force); default that of the unloading through the
            preload, if there is one, else the preload. Equal to the preload, it is the weight itself.
        extrapolate: whether the laws by name continue beyond their last point; "auto" and "paper" always do.

    Raises:
        InputError: the law is unknown, or the curve does not contain what it needs.
        RangeError: the curve does not reach the load.

    Examples:
        >>> from asperity.dynamics import law_from
        >>> delta = np.linspace(0.0, 1.0, 11)
        >>> law, load = law_from({"delta": delta, "force": 2.0 * delta**1.5})
        >>> print(law.describe(), "preload", load)
        table, 10 points, interpolated preload 1.0
        >>> law_from({"delta": delta, "force": 2.0 * delta**1.5}, "paper")[0].describe()
        'power law n = 1.5, K = 2'
    """
    if isinstance(source, Law):
        return source, load if load is not None else ContactOscillator(source).restoring.load
    choice = choose(read_history(source), law, load, overload=overload, extrapolate=extrapolate)
    if choice.note:
        warnings.warn(choice.note, AsperityWarning, stacklevel=2)
    return choice.law, choice.load


def run_dynamics(
    source: Any,
    *,
    zeta: float | None = None,
    damping: str | LoopDamping | None = None,
    forcing: float | Iterable[float] | None = None,
    models: Sequence[str] | None = None,
    omega: Sequence[float] | None = None,
    load: float | None = None,
    law: str | None = None,
    overload: float | None = None,
    joint: Joint | None = None,
    patch_area: float | None = None,
    out_dir: str | os.PathLike[str] | None = None,
    sweeps: bool | None = None,
    detached: bool = False,
    bands: bool = True,
    tol: float = 1e-5,
    gravity: float | None = None,
    units: str | None = None,
    extrapolate: bool = False,
) -> Dynamics:
    """Compute free vibration, frequency response, thresholds and on request more, of a mass on a contact.

    What is not given is taken from the section [dynamics] of the case of a run directory; the defaults named here are
    those of another source.

    Args:
        source: a `Law`, a `Curve`, a CSV file with columns delta and force, or a run directory (curve.csv).
        zeta: damping ratio of small motion, 0 <= zeta < 1; default 0.01.
        damping: "always", "contact", "hunt-crossley", or "loops": in addition to zeta that of the loops.csv of a run
            directory (or a `LoopDamping`); default "always".
        forcing: F^ = F/(n_loc W) with the preload W, one or several, each 1e-9 to 1e6; default 0.01.
        models: "exact" and/or "taylor"; default both.
        omega: lowest and highest Omega = omega/omega_s, 0.01 to 100; default 0.5 and 1.3.
        load: preload W (force); default that of the joint, or half of the largest force of the curve.
        law: "auto", "unload-reload", "elastic", "table" or "paper", see `law_from`; default "auto". Ignored when
            `source` is a `Law`.
        overload: greatest force before the vibration (force), see `law_from`. That of a case is not taken where `law`
            or a preload is given.
        joint: nominal area, preload and mass; default the section [joint] of the case of a run directory. With a joint
            all forces are those of the joint, and the mass is that of the joint, not the preload over gravity.
        patch_area: nominal area of the curve (length^2); default L^2 of the case of a run directory.
        out_dir: directory for free.csv, response.csv, thresholds.json and band.csv; None writes nothing. For figures
            see `asperity.plot.oscillator.plot_dynamics`.
        sweeps: also integrate sweeps up and down (half a second per forcing; not for zeta = 0); default no.
        detached: also search for branches that no other branch reaches (several seconds).
        bands: also carry the error bar of the force and the spread of the laws to the response (about 1 s per forcing);
            for a `Law` with intervals, these.
        tol: relative truncation error of the response.
        gravity: gravitational acceleration in the units of the source (length/time^2), used for mass and omega_s
            only, where no joint has a mass; default that of the case of a run directory, or 9.80665 with SI units.
        units: units of the source, "SI" or "other"; with "other" and no `gravity`, mass and omega_s are left out.
            Default those of the case of a run directory, otherwise SI, which a note reports.
        extrapolate: continue the laws "table" and "unload-reload" beyond their last point, along the last slope in
            (ln z, ln F).

    Returns:
        The results. Files are written only after all input has been checked.

    Raises:
        InputError: an argument or the curve is wrong.
        RangeError: the law does not reach the preload, or an orbit leaves a table at once.
        ConvergenceError: no orbit can be found.

    Examples:
        >>> delta = np.linspace(0.0, 1e-8, 11)
        >>> curve = {"delta": delta, "force": 2e9 * delta**1.5}
        >>> result = asp.run_dynamics(curve, units="SI", forcing=0.005, models=["exact"], omega=(0.9, 1.1), tol=1e-3,
        ...                           sweeps=False, bands=False)
        >>> omega, u_max = result.responses["exact"][0].peak
        >>> print(f"peak u = {u_max:.3f} at Omega = {omega:.3f}")
        peak u = 0.245 at Omega = 0.997
    """
    case = _case_of(Path(source)) if isinstance(source, (str, os.PathLike)) else {}
    of_case = case.get("dynamics", {})
    values = forcings(of_case.get("forcing", FORCING) if forcing is None else forcing)
    omega = window(of_case.get("omega", OMEGA) if omega is None else omega)
    sweeps = of_case.get("sweeps", False) if sweeps is None else sweeps
    names = tuple(of_case.get("model", MODELS) if models is None else models)
    for name in names:
        if name not in MODELS:
            raise InputError(f'model = "{name}" is unknown: choose one of {", ".join(MODELS)}')
    if not names:
        raise InputError("model is empty: choose exact, taylor or both")
    joint = joint_of(source, {}) if joint is None else joint
    if patch_area is None and "surface" in case:
        patch_area = float(case["surface"]["L"]) ** 2
    if load is None:
        load, met = loads_of_case(of_case.get("preload"), of_case.get("overload"), joint, patch_area)
        overload = met if law is None and overload is None else overload
    law = of_case.get("law", "auto") if law is None else law
    static, preload, chosen = _law(source, law, load, joint, patch_area, overload=overload, extrapolate=extrapolate)
    units = case.get("units") if units is None else units
    gravity, assumed = _gravity(case, gravity, units, joint, "law" if isinstance(source, Law) else "curve")
    if zeta is None:
        zeta = joint.damping if joint is not None and joint.damping is not None else of_case.get("zeta", ZETA)
    damping = of_case.get("damping", DAMPING[0]) if damping is None else damping
    if damping == LOOPS:
        damping = _loops_of(source)
    loop_note = ""
    if isinstance(damping, LoopDamping):
        factor = 1.0 if joint is None else joint.factor(patch_area)
        at = ContactOscillator(static, load=preload).restoring
        damping, loop_note = damping.on(at.scale / at.z_s / factor, preload / factor)
    exact = _oscillator(static, preload, gravity, joint, zeta=zeta, damping=damping)
    laws = None
    if chosen is not None:
        known = exact.mass if np.isfinite(exact.mass) else None
        laws = tabulate(*chosen, known, extrapolate=extrapolate or law == "auto")
    oscillators = {name: exact if name == "exact" else exact.taylor() for name in names}
    notes = [note for note in (assumed, loop_note) if note]
    notes += [] if laws is None else list(_yield_notes(laws.choice))
    free: dict[str, FreeVibration] = {}
    responses: dict[str, tuple[FrequencyResponse, ...]] = {}
    swept: dict[str, tuple[Sweep, ...]] = {}
    onset: dict[str, Thresholds] = {}
    for name, oscillator in oscillators.items():
        onset[name] = oscillator.thresholds(values)
        free[name] = oscillator.free()
        responses[name] = tuple(oscillator.response(f, omega, tol=tol, detached=detached) for f in values)
        swept[name] = ()
        if sweeps and zeta > 0:
            try:
                swept[name] = oscillator.sweep(values, omega, points=_SWEEP_POINTS)
            except AsperityError as error:
                notes.append(f"{name}: no sweep: {error}")
        notes.extend(_notes(name, oscillator, responses[name], swept[name]))
    members = laws.members() if laws is not None else None
    spread = _uncertainty(exact, members, laws, notes)
    enveloped: list[Band] = []
    if bands and spread is not None and "exact" in oscillators:
        for f in values:
            try:
                enveloped.append(response_band(exact, f, omega, members=members))
            except AsperityError as error:
                notes.append(f"exact, F^ = {f:g}: no band: {error}")
    result = Dynamics(
        oscillators, free, responses, swept, onset, spread, tuple(enveloped), tuple(notes), gravity, laws, joint, units
    )  # fmt: skip
    if out_dir is not None:
        result.write(out_dir)
    return result


def small_vibration(
    source: Any,
    *,
    law: str = "auto",
    load: float | None = None,
    overload: float | None = None,
    zeta: float = ZETA,
    gravity: float | None = None,
    joint: Joint | None = None,
    units: str | None = None,
    patch_area: float | None = None,
) -> Numbers:
    """Return stiffness, mass, frequency, static approach and damping of the small vibration on a curve.

    Args:
        source, law, load, overload, zeta, gravity, joint, units, patch_area: as in `run_dynamics`.

    Raises:
        InputError, RangeError: as `run_dynamics`.

    Examples:
        >>> import numpy as np
        >>> from asperity.dynamics.run import small_vibration
        >>> delta = np.linspace(0.0, 2e-7, 41)
        >>> joint = asp.Joint(preload=1e-3, frequency=1000.0)
        >>> numbers = small_vibration({"delta": delta, "force": 1e4 * delta}, joint=joint)
        >>> f"{numbers.stiffness:.0f} {numbers.frequency:.0f}"
        '10000 1000'
    """
    static, preload, _ = _law(source, law, load, joint, patch_area, overload=overload)
    gravity, _ = _gravity({}, gravity, units, joint, "curve")
    return numbers_of(_oscillator(static, preload, gravity, joint, zeta=zeta))


def _oscillator(law: Law, load: float, gravity: float | None, joint: Joint | None, **damping: Any) -> ContactOscillator:
    """Return the oscillator on a law, with the mass of the joint if it has one."""
    exact = ContactOscillator(law, load=load, gravity=gravity, **damping)
    mass = None if joint is None else joint.mass_at(exact.restoring.scale / exact.restoring.z_s)
    return exact if mass is None else replace(exact, gravity=load / mass)


def _loops_of(source: Any) -> Damping:
    """Return the damping of the loops of a run directory, "loops" where there are none."""
    folder = Path(source) if isinstance(source, (str, os.PathLike)) else None
    if folder is not None and not folder.is_dir():
        folder = folder.parent
    if folder is None or not (folder / run_folder.LOOPS).is_file():
        return LOOPS
    return LoopDamping.of(LoopTable.read(folder / run_folder.LOOPS))


def joint_of(source: Any, given: Mapping[str, float | None]) -> Joint | None:
    """Return the joint of the case of a run directory with some values replaced; None if nothing gives a joint.

    Args:
        source: as in `run_dynamics`.
        given: values of `Joint` by name, None where not given.
    """
    case = _case_of(Path(source)) if isinstance(source, (str, os.PathLike)) else {}
    if "joint" not in case and all(value is None for value in given.values()):
        return None
    return Joint(**case.get("joint", {})).replaced(given)


def _law(
    source: Any, law: str, load: float | None, joint: Joint | None, patch: float | None, **options: Any
) -> tuple[Law, float, tuple[History, Choice] | None]:
    """Return law and preload of a source, with the columns and the choice if it is a curve."""
    if isinstance(source, Law):
        if joint is not None and joint.nominal_area is not None:
            raise InputError("joint.nominal_area is for a curve: a law has the force of the joint already")
        return *law_from(source, law, load), None
    if load is None and joint is not None:
        load = joint.load(patch)
    history = read_history(source, 1.0 if joint is None else joint.factor(patch))
    choice = choose(history, law, load, **options)
    return choice.law, choice.load, (history, choice)


def _uncertainty(
    oscillator: ContactOscillator, members: tuple[Law, ...] | None, laws: LawTable | None, notes: list[str]
) -> Uncertainty | None:
    """Return the intervals of an oscillator; None without an error bar, another law, or intervals of the law itself."""
    try:
        if members is None or laws is None:
            return uncertainty(oscillator)
        return uncertainty(oscillator, members, laws.describe_members()) if members else None
    except InputError:
        return None
    except AsperityError as error:
        notes.append(f"no interval: {error}")
        return None


def _yield_notes(choice: Choice) -> Iterator[str]:
    """Yield what a reader must know about the history of the contact before it vibrates."""
    if choice.note:
        yield choice.note
    if choice.reached is not None and choice.reached <= choice.load * (1 + 1e-9):
        settled = "the law is that of the cycles that follow"
        if isinstance(choice.law, TwoBranchLaw):
            settled = (
                "above the preload the law is that of this cycle, the loading curve; those that follow move on the "
            )
            settled += "unloading branch of their own greatest force"
        yield (
            "the preload is the greatest force that the contact has met: any motion yields in its first cycle; "
            f"{settled}"
        )


def _notes(
    name: str,
    oscillator: ContactOscillator,
    responses: Iterable[FrequencyResponse],
    sweeps: Iterable[Sweep],
) -> Iterator[str]:
    """Yield the notes on the results of a model."""
    for r in responses:
        where = f"{name}, F^ = {r.setting.F_hat:g}: the response"
        yield from _beyond_fit(where, oscillator, max(float(b.u_max.max()) for b in r.branches))
        yield from (f"{name}, F^ = {r.setting.F_hat:g}: {note}" for note in r.notes)
    for s in sweeps:
        if ESCAPED in s.status:
            escape = float(s.Omega[s.status.index(ESCAPED)])
            yield (
                f"{name}, F^ = {s.setting.F_hat:g}: the sweep {s.direction} escapes from the Taylor "
                f"well at Omega = {escape:.4g}, a property of the truncation"
            )


def _gravity(
    case: dict[str, Any], gravity: float | None, units: str | None, joint: Joint | None, source: str
) -> tuple[float | None, str]:
    """Return gravity in the units of a source, None if unknown or of no use, and a note on it ("" if none is needed).

    Args:
        case: of the source, empty if there is none.
        gravity, units: as in `run_dynamics`; units of the case if there is one.
        joint: whose mass does not follow from gravity.
        source: what the note calls the source.
    """
    if units not in (None, "SI", "other"):
        raise InputError(f'units = "{units}" is unknown: choose SI or other')
    with_mass = joint is not None and (joint.mass is not None or joint.frequency is not None)
    if gravity is not None:
        if with_mass:
            raise InputError(
                f"gravity = {gravity:g} takes the mass from the preload, and the joint has its own: give one of them"
            )
        return positive("gravity", gravity), ""
    if with_mass:
        return None, ""
    gravity = case.get("dynamics", {}).get("gravity")
    if gravity is not None:
        return float(gravity), ""
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


def _case_of(path: Path) -> dict[str, Any]:
    """Read the completed case of a run directory, or of the curve.csv in one; empty if there is none."""
    folder = path if path.is_dir() else path.parent
    if folder != path and path.name != "curve.csv":
        return {}
    try:
        return tomllib.loads((folder / "case.toml").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def _beyond_fit(where: str, oscillator: ContactOscillator, top: float) -> Iterator[str]:
    """Yield notes on a motion in which the contact yields again, or which goes beyond the points of the law.

    Args:
        where: which motion of which model.
        oscillator: the model.
        top: greatest u of the motion.
    """
    law, z_s = oscillator.law, oscillator.restoring.z_s
    known = round(law.known_to / z_s - 1.0, 9)
    where = f"{where} reaches u = {top:.4g}"
    again = law.yields_at / z_s - 1.0 if isinstance(law, TwoBranchLaw) else np.inf
    if 1e-9 < again < top:
        yield (
            f"{where}, and above u = {again:.4g} the contact yields again: there the law is the loading curve, which "
            "holds for the first cycle of that amplitude; those that follow find a stiffer contact"
        )
    if law.extrapolate and known < top:
        yield (
            f"{where}, the curve that the law was fitted to ends at u = {max(known, 0.0):.4g}: beyond it the law is "
            "extrapolated"
        )
