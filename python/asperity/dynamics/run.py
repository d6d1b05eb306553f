"""Complete vibration analysis of one law."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.curve import fitted_rows
from asperity.dynamics.forcing import forcings, window
from asperity.dynamics.law.checks import positive
from asperity.dynamics.law.damping import DAMPING
from asperity.dynamics.law.law import Law
from asperity.dynamics.law.power import PowerLaw
from asperity.dynamics.law.table import TableLaw, columns, unload_reload
from asperity.dynamics.motion.sweep import ESCAPED, Sweep
from asperity.dynamics.orbits.free import FreeVibration
from asperity.dynamics.orbits.response import FrequencyResponse
from asperity.dynamics.orbits.thresholds import Thresholds
from asperity.dynamics.oscillator import GRAVITY, ContactOscillator
from asperity.dynamics.results import Dynamics
from asperity.dynamics.uncertainty import Band, response_band, uncertainty
from asperity.errors import AsperityError, InputError, RangeError
from asperity.power_law import fit_power_law

MODELS = ("exact", "taylor")
LAWS = ("paper", "unload-reload", "table")
ZETA = 0.01  # default damping ratio
_SWEEP_POINTS = 41
_NOISE = 0.05  # share of the largest force by which the force of a measured curve may fall


def law_from(
    source: Any, law: str = "paper", load: float | None = None, *, extrapolate: bool = False
) -> tuple[Law, float]:
    """Return the static law and the preload (force) of a curve.

    Args:
        source: a `Law`, a `Curve`, a CSV file with columns delta and force, or a directory with curve.csv.
        law: "paper" (power law of `Curve.fit`, as a reversible spring), "unload-reload" (the
            branch computed about the preload), or "table" (the points of the loading branch).
        load: preload (force); default half of the largest force of the curve.
        extrapolate: whether "unload-reload" and "table" continue beyond their last point; a power law always does.

    Raises:
        InputError: the law is unknown, or the curve does not contain what it needs.
        RangeError: the curve does not reach the load.

    Examples:
        >>> from asperity.dynamics import law_from
        >>> delta = np.linspace(0.0, 1.0, 11)
        >>> law, load = law_from({"delta": delta, "force": 2.0 * delta**1.5})
        >>> print(law.describe(), "preload", load)
        power law n = 1.5, K = 2 preload 1.0
    """
    if isinstance(source, Law):
        return source, load if load is not None else ContactOscillator(source).restoring.load
    if law not in LAWS:
        raise InputError(f'law = "{law}" is unknown: choose one of {", ".join(LAWS)}')
    if isinstance(source, (str, os.PathLike)):
        path = Path(source)
        if path.is_dir():
            path = path / "curve.csv"
        if not path.is_file():
            raise InputError(f"there is no curve at {path}")
        source = path
    delta, force, branches = columns(source)
    if delta.size == 0:
        raise InputError("the curve is empty: it needs one row per approach")
    if load is None:
        load = 0.5 * float(np.max(force))
    if law == "unload-reload":
        return unload_reload(source, load, extrapolate=extrapolate), load
    if law == "table":
        return TableLaw.from_curve(source, extrapolate=extrapolate), load
    if branches is not None:
        delta, force = delta[branches == "load"], force[branches == "load"]
    length, unit = float(delta.max(initial=0.0)), float(force.max(initial=0.0))
    if not (length > 0 and unit > 0):
        raise InputError("the loading branch of the curve never makes contact: no power law can be fitted")
    _check_rising(delta, force)
    if load > unit:
        raise RangeError(
            f"load = {load:g} lies outside the curve, which ends at force {unit:g}; lower the load, or compute the "
            "curve further"
        )
    rows = fitted_rows(delta, force)
    fit = fit_power_law(delta[rows] / length, force[rows] / unit)
    return PowerLaw.from_fit(fit, length, unit), load


def _check_rising(delta: Array, force: Array) -> None:
    """Refuse a curve whose force falls by more than noise: a power law cannot describe it."""
    f = force[np.argsort(delta, kind="stable")]
    fall = np.maximum.accumulate(f) - f
    if fall.max() > _NOISE * f.max():
        row = int(fall.argmax())
        raise InputError(
            f"the force of the curve does not rise with the approach: it falls from {f[:row].max():g} to {f[row]:g}, "
            f"by more than {100 * _NOISE:g} % of its largest value, the limit for noise: smooth it"
        )


def run_dynamics(
    source: Any,
    *,
    zeta: float | None = None,
    damping: str | None = None,
    forcing: float | Iterable[float] = (0.01,),
    models: Sequence[str] = MODELS,
    omega: Sequence[float] = (0.5, 1.3),
    load: float | None = None,
    law: str = "paper",
    out_dir: str | os.PathLike[str] | None = None,
    sweeps: bool = True,
    detached: bool = False,
    bands: bool = True,
    tol: float = 1e-5,
    gravity: float | None = None,
    units: str | None = None,
    extrapolate: bool = False,
) -> Dynamics:
    """Compute free vibration, frequency response, sweeps and thresholds of a mass on a contact.

    Args:
        source: a `Law`, a `Curve`, a CSV file with columns delta and force, or a run directory (curve.csv).
        zeta: damping ratio of small motion, 0 <= zeta < 1; default that of the case of a run directory, or 0.01.
        damping: "always", "contact" or "hunt-crossley"; default that of the case of a run directory, or "always".
        forcing: F^ = F/(n_loc m g), one or several, each 1e-9 to 1e6.
        models: "exact" and/or "taylor".
        omega: lowest and highest Omega = omega/omega_s, 0.01 to 100.
        load: preload W = m g (force); default half of the largest force of the curve.
        law: "paper", "unload-reload" or "table", see `law_from`; ignored when `source` is a `Law`.
        out_dir: directory for free.csv, response.csv, thresholds.json and band.csv; None writes nothing. For figures
            see `asperity.plot.oscillator.plot_dynamics`.
        sweeps: also integrate sweeps up and down (a few seconds; not for zeta = 0).
        detached: also search for branches that no other branch reaches (several seconds).
        bands: also propagate the confidence of the law, if it has any, to the response (about 1 s per forcing).
        tol: relative truncation error of the response.
        gravity: gravitational acceleration in the units of the source (length/time^2), used for mass and omega_s
            only; default that of the case of a run directory, or 9.80665 with SI units.
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
    values, omega = forcings(forcing), window(omega)
    names = tuple(models)
    for name in names:
        if name not in MODELS:
            raise InputError(f'model = "{name}" is unknown: choose one of {", ".join(MODELS)}')
    if not names:
        raise InputError("model is empty: choose exact, taylor or both")
    static, preload = law_from(source, law, load, extrapolate=extrapolate)
    case = _case_of(Path(source)) if isinstance(source, (str, os.PathLike)) else {}
    gravity, assumed = _gravity(case, gravity, units, "law" if isinstance(source, Law) else "curve")
    of_case = case.get("dynamics", {})
    zeta = of_case.get("zeta", ZETA) if zeta is None else zeta
    damping = of_case.get("damping", DAMPING[0]) if damping is None else damping
    exact = ContactOscillator(static, load=preload, zeta=zeta, damping=damping, gravity=gravity)
    oscillators = {name: exact if name == "exact" else exact.taylor() for name in names}
    notes = [assumed] if assumed else []
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
    try:
        spread = uncertainty(exact)
    except InputError:
        spread = None
    enveloped: list[Band] = []
    if bands and spread is not None and "exact" in oscillators:
        for f in values:
            try:
                enveloped.append(response_band(exact, f, omega))
            except AsperityError as error:
                notes.append(f"exact, F^ = {f:g}: no confidence band: {error}")
    result = Dynamics(oscillators, free, responses, swept, onset, spread, tuple(enveloped), tuple(notes), gravity)
    if out_dir is not None:
        result.write(out_dir)
    return result


def _notes(
    name: str, oscillator: ContactOscillator, responses: Iterable[FrequencyResponse], sweeps: Iterable[Sweep]
) -> Iterator[str]:
    """Yield the notes on the results of a model."""
    for r in responses:
        yield from _beyond_fit(name, oscillator, r)
        yield from (f"{name}, F^ = {r.setting.F_hat:g}: {note}" for note in r.notes)
    for s in sweeps:
        if ESCAPED in s.status:
            where = float(s.Omega[s.status.index(ESCAPED)])
            yield (
                f"{name}, F^ = {s.setting.F_hat:g}: the sweep {s.direction} escapes from the Taylor "
                f"well at Omega = {where:.4g}, a property of the truncation"
            )


def _gravity(case: dict[str, Any], gravity: float | None, units: str | None, source: str) -> tuple[float | None, str]:
    """Return gravity in the units of a source, None if unknown, and a note on it ("" if none is needed).

    Args:
        case: of the source, empty if there is none.
        gravity, units: as in `run_dynamics`.
        source: what the note calls the source.
    """
    if units not in (None, "SI", "other"):
        raise InputError(f'units = "{units}" is unknown: choose SI or other')
    if gravity is not None:
        return positive("gravity", gravity), ""
    if units is None:
        units, gravity = case.get("units"), case.get("dynamics", {}).get("gravity")
    if gravity is not None:
        return float(gravity), ""
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


def _beyond_fit(name: str, oscillator: ContactOscillator, r: FrequencyResponse) -> list[str]:
    """Return a note if the response goes beyond the points that a power law was fitted to."""
    known = getattr(oscillator.law, "fitted_to", np.inf) / oscillator.restoring.z_s - 1.0
    top = max(float(b.u_max.max()) for b in r.branches)
    if top <= known:
        return []
    return [
        f"{name}, F^ = {r.setting.F_hat:g}: the response reaches u = {top:.4g}, the curve that the law was fitted to "
        f"ends at u = {known:.4g}: beyond it the law is extrapolated"
    ]
