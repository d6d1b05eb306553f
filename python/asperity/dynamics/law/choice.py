# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Which law of a curve is the spring of a vibration, and which others stand next to it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.curve import fitted_rows
from asperity.dynamics.law.checks import positive
from asperity.dynamics.law.history import History
from asperity.dynamics.law.law import Law
from asperity.dynamics.law.power import PowerLaw
from asperity.dynamics.law.table import TableLaw, unload_reload
from asperity.dynamics.law.two_branches import TwoBranchLaw
from asperity.errors import AsperityError, InputError, RangeError
from asperity.power_law import fit_power_law

#: Laws by name, those of a contact that has yielded first.
NAMES = ("unload-reload", "elastic", "table", "paper")
LAWS = ("auto", *NAMES)
AFTER_YIELD = NAMES[:2]
LACK = (
    "the contact has yielded, and the curve has neither an unloading through the preload nor the elastic stiffness: "
    "the law is the paper's power law of the loading, whose frequency is too low, by a factor of 1.5 on the demo "
    "surface; compute the curve with loading.unload = true or output.stiffness = true"
)
_NOISE = 0.05  # share of the largest force by which the force of a measured curve may fall
_SAME = 1e-9  # relative difference of forces that are equal


@dataclass(frozen=True, eq=False)
class Choice:
    """A law of a curve as the spring of a vibration.

    Attributes:
        name: of the law, one of "unload-reload", "elastic", "table", "paper"; "given" for a `Law` from elsewhere.
        law: the law.
        load: preload (force).
        reached: greatest force before the vibration (force); an amplitude that passes it yields again. None where
            nothing has yielded, or where this is not known.
        yielded: whether the solid has yielded; None if the curve does not show it.
        reason: why it is this law, a part of a sentence.
        note: sentence that a reader of the results needs, or "".
    """

    name: str
    law: Law
    load: float
    reached: float | None
    yielded: bool | None
    reason: str
    note: str = ""

    @property
    def yields_at(self) -> float | None:
        """Displacement u = (z - z_s)/z_s above which the contact yields again; None where it has not yielded."""
        if self.reached is None:
            return None
        return max(self.law.deflection(self.reached) / self.law.deflection(self.load) - 1.0, 0.0)


def read_history(source: Any, factor: float = 1.0) -> History:
    """Read the curve of a `Curve`, a mapping, a CSV file or a directory with curve.csv.

    Args:
        source: the curve.
        factor: by which forces and stiffnesses are multiplied.

    Raises:
        InputError: there is no curve, or it is not legal.
    """
    if isinstance(source, (str, os.PathLike)):
        path = Path(source)
        if path.is_dir():
            path = path / "curve.csv"
        if not path.is_file():
            raise InputError(f"there is no curve at {path}")
        source = path
    return History.of(source, factor)


def choose(
    history: History,
    law: str = "auto",
    load: float | None = None,
    *,
    overload: float | None = None,
    extrapolate: bool = False,
) -> Choice:
    """Choose the law of a curve for the vibration about a preload.

    "auto" takes, after yield, the unload-reload branch through the preload, else the elastic tangent of the states on
    the loading, else the paper's law with a note; before yield the points of the loading. Beyond their last point it
    continues them.

    Args:
        history: columns of the curve.
        law: one of `LAWS`.
        load: preload (force); default half of the largest force of the curve.
        overload: greatest force before the vibration (force); default that of the unloading through the preload, if
            there is one, else the preload. Equal to the preload it is the weight itself that made the contact yield.
        extrapolate: whether the laws by name continue beyond their last point; a power law always does.

    Raises:
        InputError: an argument is not legal, or the curve does not contain what it needs.
        RangeError: the curve does not reach the load.
    """
    if law not in LAWS:
        raise InputError(f'law = "{law}" is unknown: choose one of {", ".join(LAWS)}')
    top = float(np.max(history.force))
    load = 0.5 * top if load is None else positive("load", load)
    if overload is not None:
        if law != "auto":
            raise InputError(f'overload = {overload:g} cannot go with law = "{law}": it is for law = "auto"')
        if not load * (1 - _SAME) <= overload <= top * (1 + _SAME):
            raise InputError(
                f"overload = {overload:g} must lie between the preload {load:g} and {top:g}, the greatest force of the "
                "curve; compute the curve further"
            )
    if law != "auto":
        found = law_named(history, law, load, extrapolate=extrapolate)
        yielded = history.yielded(top if law == "unload-reload" else load)
        reached = load if law == "elastic" else None
        if law == "unload-reload" and isinstance(found, TableLaw):
            reached = _top(found)
        return Choice(law, found, load, reached if yielded else None, yielded, "named")
    if not 0 < load <= top * (1 + _SAME):
        raise RangeError(
            f"load = {load:g} lies outside the curve, which ends at force {top:g}; lower the load, or compute the "
            "curve further"
        )
    return _automatic(history, min(load, top), None if overload is None else min(overload, top))


def law_named(history: History, name: str, load: float, *, extrapolate: bool = False) -> Law:
    """Return a law of `NAMES` about a preload (force).

    Raises:
        InputError: the curve does not contain what the law needs.
        RangeError: the law does not reach the load.
    """
    if name == "unload-reload":
        return unload_reload(history.mapping(), load, extrapolate=extrapolate)
    if name == "table":
        return TableLaw.from_curve(history.mapping(), extrapolate=extrapolate)
    if name == "elastic":
        return history.tangent(load, unloading=_leg(history, load) is not None, extrapolate=extrapolate)
    delta, force = history.delta[history.loading], history.force[history.loading]
    length, unit = float(delta.max(initial=0.0)), float(force.max(initial=0.0))
    if not (length > 0 and unit > 0):
        raise InputError("the loading branch of the curve never makes contact: no power law can be fitted")
    _check_rising(delta, force)
    if load > unit * (1 + _SAME):
        raise RangeError(
            f"load = {load:g} lies outside the curve, which ends at force {unit:g}; lower the load, or compute the "
            "curve further"
        )
    rows = fitted_rows(delta, force)
    fit = fit_power_law(delta[rows] / length, force[rows] / unit)
    return PowerLaw.from_fit(fit, length, unit)


def _automatic(history: History, load: float, overload: float | None) -> Choice:
    leg = _leg(history, load)
    met = overload if overload is not None else load if leg is None else _top(leg)
    yielded = history.yielded(met)
    if not yielded:
        why = "nothing has yielded up to the preload" if yielded is False else "the curve does not show that it yields"
        try:
            return Choice("table", law_named(history, "table", load, extrapolate=True), load, None, yielded, why)
        except InputError:
            found = law_named(history, "paper", load)
            return Choice("paper", found, load, None, yielded, "the points of the loading do not rise")
    if leg is not None and met >= _top(leg) * (1 - 1e-6):
        above = _above(history)
        found = leg if above is None else TwoBranchLaw(leg, above, min(_top(leg), above.F[-1]))
        return Choice("unload-reload", found, load, _top(leg), True, "yielded, and unloaded through the preload")
    try:
        tangent = history.tangent(met, extrapolate=True)
    except AsperityError as error:
        if overload is not None:
            raise InputError(
                f"overload = {overload:g} lies below the force at which the curve unloads: its branch needs the "
                "elastic stiffness of the loading; compute the curve with output.stiffness = true, or load it to the "
                "overload"
            ) from error
        return Choice("paper", law_named(history, "paper", load), load, None, True, "yielded, no other law", LACK)
    if overload is None:
        return Choice("elastic", tangent, load, load, True, "yielded, and the elastic stiffness is known")
    above = _above(history)
    if above is None:
        raise InputError("the points of the loading do not rise, so nothing is known above the overload: smooth them")
    found = TwoBranchLaw(tangent, above, met)
    return Choice("elastic", found, load, met, True, "yielded up to the overload, with the elastic stiffness")


def _leg(history: History, load: float) -> TableLaw | None:
    """Return the unload-reload branch that passes through a preload, None if there is none."""
    if not np.any(history.force[~history.loading] <= load):
        return None  # it stops above
    try:
        return unload_reload(history.mapping(), load * (1 - _SAME))
    except AsperityError:
        return None


def _top(leg: TableLaw) -> float:
    """Return the greatest force of an unload-reload branch."""
    return float(leg.F[-1])


def _above(history: History) -> TableLaw | None:
    """Return the loading curve, continued beyond its end; None where its points do not rise."""
    try:
        return TableLaw.from_curve(history.mapping(), extrapolate=True)
    except InputError:
        return None


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
