"""Which law of a curve is the spring of a vibration about a preload."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.curve.power_law import fit_power_law
from asperity.curve.slope import fitted_rows
from asperity.errors import AsperityError, AsperityWarning, InputError, RangeError, warn
from asperity.force_law import LAWS, MIN_ROWS
from asperity.force_law.checks import one_of, positive
from asperity.force_law.columns import CurveColumns
from asperity.force_law.law import Law, PowerLaw
from asperity.force_law.points import FALL, MIN_POINTS, TOUCH, fit_origin
from asperity.force_law.table import TableLaw

TOO_LOW = (
    "the law is the paper's power law of the loading, whose frequency is too low, by a factor of 1.5 on a fractal "
    "surface"
)
LACK = (
    "the contact has yielded, and the curve has neither an unloading through the preload nor the elastic stiffness: "
    f"{TOO_LOW}; compute the curve with loading.unload = true or output.stiffness = true"
)
_SAME = 1e-9  # relative difference of forces that are equal
_SHORT = 2e-6  # the same where a load path by force ends


@dataclass(frozen=True, eq=False)
class Choice:
    """A law of a curve as the spring of a vibration."""

    name: str  # of the law, one of `NAMES`
    law: Law
    load: float  # preload (force)
    yielded: bool | None  # None if the curve does not show it
    reason: str  # why it is this law, a part of a sentence
    note: str = ""  # sentence on a law to be doubted


def law_from(source: Any, law: str = "auto", load: float | None = None) -> tuple[Law, float]:
    """Static law and the preload (force) of a curve.

    Args:
        source: a `Law`, a `Curve`, a mapping or CSV file with columns delta and force, or a directory with curve.csv
        law: "unload-reload" (branch about the preload), "elastic" (elastic tangent of the states on the loading, column
            k_n_elastic), "table" (points of the loading) or "paper" (power law of `Curve.fit`, as a reversible spring);
            "auto": after yield the first of these without "table" that the curve has, before yield "table"
        load: preload (force); default half of the largest force of the curve

    Raises:
        InputError: the law is unknown, or the curve does not contain what it needs
        RangeError: the curve does not reach the load

    Examples:
        >>> from asperity.dynamics import law_from
        >>> delta = np.linspace(0.0, 1.0, 11)
        >>> law, load = law_from({"delta": delta, "force": 2.0 * delta**1.5}, "paper")
        >>> print(law.describe(), "preload", load)
        power law n = 1.5, K = 2 preload 1.0
    """
    if isinstance(source, Law):
        return source, source.default_load if load is None else load
    choice = choose(CurveColumns.of(source), law, load)
    if choice.note:
        warn(choice.note, AsperityWarning)
    return choice.law, choice.load


def choose(columns: CurveColumns, law: str = "auto", load: float | None = None) -> Choice:
    """Choose the law of a curve for the vibration about a preload; for arguments and errors see `law_from`."""
    one_of("law", law, LAWS)
    top = float(np.max(columns.force))
    load, lowered = met(0.5 * top if load is None else positive("load", load), top, columns.bar_at(top))
    if law == "auto":
        choice = _automatic(columns, load)
        return replace(choice, note="; ".join(filter(None, (choice.note, lowered))))
    found = law_named(columns, law, load)
    yielded = columns.yielded(top if law == "unload-reload" else load)
    return Choice(law, found, load, yielded, "named", lowered)


def met(load: float, top: float, bar: float, name: str = "load") -> tuple[float, str]:
    """Preload on a curve that ends at a force: lowered to that within the error bar of the force, with a note, or "".

    Raises:
        RangeError: the curve does not reach it
    """
    if load <= top * (1 + _SAME):
        return min(load, top), ""
    if load <= top * (1 + max(_SHORT, bar if bar > 0 else 0.0)):
        return top, (
            f"{name} = {load:.6g} exceeds the greatest force of the curve by {100 * (load / top - 1):.2g} %, which is "
            f"within its error: the preload is {top:.6g}"
        )
    raise RangeError(
        f"{name} = {load:.6g} lies outside the curve, which ends at force {top:.6g}; lower it, or compute the curve "
        "further"
    )


def law_named(columns: CurveColumns, name: str, load: float) -> Law:
    """Law of `NAMES` about a preload (force); errors as of `law_from`."""
    if name == "unload-reload":
        return unload_reload(columns, load)
    if name == "table":
        return TableLaw.from_curve(columns)
    if name == "elastic":
        return elastic_tangent(columns, load)
    delta, force = columns.delta[columns.loading], columns.force[columns.loading]
    length, unit = float(delta.max(initial=0.0)), float(force.max(initial=0.0))
    if not (length > 0 and unit > 0):
        raise InputError("the loading branch of the curve never makes contact: no power law can be fitted")
    up = force[np.argsort(delta, kind="stable")]
    if (fall := float(np.max(np.maximum.accumulate(up) - up))) > FALL * unit:
        raise InputError(
            f"the force of the curve does not rise with the approach: it falls by {fall:g}, by more than "
            f"{100 * FALL:g} % of its largest value, the limit for noise: smooth it, or name its unloading in a "
            "column branch"
        )
    rows = fitted_rows(delta, force)
    fitted = PowerLaw.from_fit(fit_power_law(delta[rows] / length, force[rows] / unit), length, unit)
    return replace(fitted, fitted_to=max(fitted.fitted_to, fitted.deflection(unit)))  # to the force of the curve


def unload_reload(curve: Any, load: float | None = None) -> TableLaw:
    """Physical law of a plastic contact about a preload: the last unloading of a curve that passes through it.

    Its slopes are the elastic stiffness of
    the rows (column k_n_elastic), if known. The approach is measured from the row at which the contact separates;
    without one the law ends at zero force with the power that its lowest rows have.

    Args:
        curve: a `Curve`, CSV file or mapping with delta, force and branch
        load: preload that the branch must reach (force), or None

    Raises:
        InputError: the curve has no unloading rows, or no branch with enough of them in contact
        RangeError: no branch reaches the preload

    Examples:
        A contact that separates at a residual indentation of 0.3:

        >>> up, down = np.linspace(0.0, 1.0, 21), np.linspace(0.95, 0.3, 14)
        >>> curve = {"delta": [*up, *down], "force": [*up**1.5, *((down - 0.3) / 0.7) ** 1.5]}
        >>> law = asp.unload_reload(curve | {"branch": ["load"] * 21 + ["unload"] * 14}, load=0.5)
        >>> round(law.origin, 4), round(law.deflection(0.5), 4)
        (0.3, 0.441)
    """
    columns = CurveColumns.of(curve)
    force, rows = columns.force, leg_rows(columns, load)
    touching = _touching(force, rows)
    free = np.setdiff1d(rows, touching)
    z, F, k = columns.delta[touching], force[touching], columns.elastic[touching]
    if free.size == 1 or (free.size and touching.size < MIN_POINTS):
        origin = float(columns.delta[free].max())
    elif touching.size > 1 and np.all(k[:2] > 0) and not free.size:
        origin = float(z[0] - TableLaw.of_stiffness(F[:2], k[:2]).z[0])
    else:
        origin = fit_origin(columns.delta[rows], force[rows])  # measured rows: none lies at the separation
    known = bool(np.any(k > 0)) or touching.size < MIN_POINTS
    return TableLaw(z, F, origin=origin, k=k if known else None, name="unload-reload branch")


def leg_rows(columns: CurveColumns, load: float | None = None) -> Array:
    """Rows of the unloading of `unload_reload`, in the order of their approach; errors as there."""
    force, found = columns.force, columns.unloadings()
    if not found:
        raise InputError("the curve has no unloading branch: compute one with loading.unload = true")
    enough = [rows for rows in found if _touching(force, rows).size >= MIN_POINTS] or found
    reaching = [rows for rows in enough if load is None or force[rows].max() >= load * (1 - _SAME)]
    if not reaching:
        top = max(float(force[rows].max()) for rows in enough)
        raise RangeError(f"preload = {load:g} exceeds the unload-reload branch, which ends at force {top:g}")
    rows = next((rows for rows in reaching if load is None or force[rows].min() < load), reaching[0])
    return rows[np.argsort(columns.delta[rows], kind="stable")]


def _touching(force: Array, rows: Array) -> Array:
    return rows[force[rows] > TOUCH * force[rows].max()]


def elastic_tangent(columns: CurveColumns, load: float) -> TableLaw:
    """Law of a contact that was never overloaded: the elastic stiffness of the states on the loading."""
    rows = columns.rising(columns.loading & (columns.force > 0) & (columns.elastic > 0))
    if rows.size < 2:
        raise InputError(
            f"the curve has the elastic stiffness k_n_elastic in {rows.size} rows of the loading, at least 2 are "
            "needed: compute it with output.stiffness = true"
        )
    force = columns.force[rows]
    if load > force[-1] * (1 + _SAME):
        raise RangeError(
            f"load = {load:g} lies outside the rows with an elastic stiffness, which end at force {force[-1]:g}"
        )
    return TableLaw.of_stiffness(force, columns.elastic[rows], name="elastic tangent of the loading")


def _automatic(columns: CurveColumns, load: float) -> Choice:
    leg, lack = _leg(columns, load)
    yielded = columns.yielded(load if leg is None else leg.top)
    if not yielded:
        why = "nothing has yielded up to the preload" if yielded is False else "the curve does not show that it yields"
        try:
            return Choice("table", TableLaw.from_curve(columns), load, yielded, why)
        except InputError as error:
            lack = str(error)
        try:
            found = law_named(columns, "paper", load)
        except InputError as error:
            raise InputError(f"{lack}; no power law either: {error}") from error
        reason = lack.split(":")[0]
        note = (
            f"the points of the loading are no law ({reason}): the law is the power law through all of them, without "
            "an error bar"
        )
        return Choice("paper", found, load, yielded, reason, note)
    if leg is not None:
        return Choice("unload-reload", leg, load, True, "yielded, and unloaded through the preload", lack)
    try:
        tangent = elastic_tangent(columns, load)
    except AsperityError:
        doubt = f"{lack}; until then {TOO_LOW}" if lack else LACK
        return Choice("paper", law_named(columns, "paper", load), load, True, "yielded, no other law", doubt)
    return Choice("elastic", tangent, load, True, "yielded, and the elastic stiffness is known", lack)


def _leg(columns: CurveColumns, load: float) -> tuple[TableLaw | None, str]:
    """Unload-reload branch that passes through a preload, None if there is none, and a doubt or ""."""
    forces = [columns.force[rows] for rows in columns.unloadings()]
    if not any(force.min() <= load <= force.max() * (1 + _SAME) for force in forces):
        return None, ""
    more = f"compute it with loading.unload_steps = {MIN_POINTS} or more, and output.stiffness = true"
    try:
        leg = unload_reload(columns, load)
    except AsperityError as error:
        return None, f"the unloading through the preload gives no law: {error}; {more}"
    least = MIN_ROWS[leg.k is not None and not np.isnan(leg.k).any()]
    if leg.z.size >= least:
        return leg, ""
    rows = f"{leg.z.size} rows in contact, and at least {least} show its curvature"
    return leg, f"the unloading through the preload has {rows}; {more}"
