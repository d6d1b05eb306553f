"""How a curve becomes the law of a small vibration about a preload.

`CurveColumns.of` reads the columns, `choose` takes the branch on which the contact moves and makes its law: through
computed points here, through measured rows in `asperity.vibration.measured`.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Indices
from asperity.curve import COLUMNS, Curve
from asperity.curve.curve import read_curve
from asperity.curve.power_law import fit_power_law
from asperity.curve.slope import fitted_rows, legs
from asperity.errors import AsperityError, AsperityWarning, InputError, RangeError, warn
from asperity.model.dynamics import LAWS
from asperity.model.limits import one_of, positive, within
from asperity.vibration.curve_law import MIN_POINTS, CurveLaw
from asperity.vibration.law import Law, PowerLaw
from asperity.vibration.local_fit import LocalFit
from asperity.vibration.measured import branches, law_of_rows

SIZES = (1e-100, 1e100)  # of the greatest approach and force, so that products do not overflow
LEAST = 1e-3  # share of the compliance that the interface must have: less is lost in the error of the block
TOUCH = 1e-9  # share of the largest force above which a row is in contact
LACK = (
    "the contact has yielded, and the curve has neither an unloading through the preload nor the elastic stiffness: "
    "the law is the paper's power law of the loading, whose frequency is too low, by a factor of 1.5 on a fractal "
    "surface; compute the curve with loading.unload = true or output.stiffness = true"
)
REASONS = {
    "unload-reload": "unloaded through the preload",
    "elastic": "yielded, and the elastic stiffness is known",
    "paper": "yielded, no other law",
}
_SAME = 1e-9  # relative difference of forces that are equal
_SHORT = 2e-6  # the same where a load path by force ends


@dataclass(frozen=True, eq=False)
class CurveColumns:
    """A curve for a law, in the order of its steps.

    Attributes:
        curve: of the interface of a joint: on its nominal area, without the block behind the patch
        solid: greatest approach with the block (length)
        measured: whether the rows are those of an instrument: they scatter, and contact begins anywhere
        notes: how the rows were read, a sentence each
    """

    curve: Curve
    solid: float
    measured: bool = False
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, source: Any, factor: float = 1.0, block: float = 0.0) -> CurveColumns:
        """Read a `Curve`, a mapping, a CSV file, or a directory with curve.csv, with delta and force at least.

        Forces and stiffnesses are multiplied by `factor`, the nominal area of a joint over that of the patch. The
        compliance `block` (length/force) of the block behind the patch is taken out of approach and stiffness.

        Raises:
            InputError: there is no such file, or a column is missing, empty, or contains what is not a number
        """
        if isinstance(source, (str, os.PathLike)):
            curve, names, *notes = read_curve(Path(source))
        elif isinstance(source, Curve):
            curve, names, notes = source, set(COLUMNS), []
        else:
            curve, names, notes = Curve.from_columns(source), set(source), []
        if not len(curve) or curve.force.max() <= 0.0:
            raise InputError("no force of the curve is positive: compression counts positive, so reverse its sign")
        for name in ("delta", "force"):
            if greatest := float(np.abs(getattr(curve, name)).max()):
                within(f"the greatest {name} of the curve", greatest, SIZES)
        measured = not {"step", "k_n_elastic"} & names
        if measured and "branch" not in names:
            rows, branch, done = branches(curve.delta, curve.force)
            curve, notes = replace(curve.where(rows), branch=branch), [*notes, done]
        k, solid = curve.k_n_elastic, float(curve.delta.max())
        share = 1.0 - block * np.where(k > 0.0, k, 0.0)  # of the interface in the compliance
        part = factor / np.where(share > LEAST, share, np.nan)
        curve = replace(
            curve, delta=curve.delta - block * curve.force, force=factor * curve.force, k_n_elastic=part * k,
            error_k_n_elastic=part / share * curve.error_k_n_elastic,
        )  # fmt: skip
        return cls(curve, solid, measured, tuple(filter(None, notes)))

    def bar_at(self, load: float, name: str = "P_star") -> float:
        """Error bar of a column over it, see `Curve.bar`, of the row nearest in force; NaN if unknown."""
        bars = np.array([self.curve.bar(name, row) for row in range(len(self.curve))])
        known = np.flatnonzero(np.isfinite(bars))
        return float(bars[known[np.argmin(np.abs(self.curve.force[known] - load))]]) if known.size else np.nan

    def yielded(self, load: float) -> bool | None:
        """Whether the solid has yielded once the loading has reached a force, by its strain; None if it is unknown."""
        curve, rows = self.curve, self.loading
        first = int(np.argmax(curve.force[rows] >= load * (1 - _SAME))) if rows.size else 0
        strain = np.where(np.isnan(curve.max_plastic_strain), curve.plastic_fraction, curve.max_plastic_strain)
        strain = strain[rows[: first + 1]]
        return bool(np.nanmax(strain) > 0.0) if np.isfinite(strain).any() else None

    @property
    def loading(self) -> Indices:
        """Rows of the first loading."""
        return np.flatnonzero(self.curve.branch == "load")

    def unloadings(self) -> list[Indices]:
        """Rows of each unloading with the row before, the last one first."""
        branch = self.curve.branch
        starts = [(begin, end) for begin, end in legs(branch) if branch[begin] == "unload"]
        return [np.arange(max(begin - 1, 0), end) for begin, end in starts[::-1]]

    def unloading(self, load: float) -> Indices:
        """Rows of the last unloading that passes through a preload (force), in the order of approach.

        Raises:
            InputError: the curve has no unloading rows
            RangeError: no branch with enough rows in contact reaches the preload
        """
        force, found = self.curve.force, self.unloadings()
        if not found:
            raise InputError("the curve has no unloading branch: compute one with loading.unload = true")
        enough = [rows for rows in found if np.sum(force[rows] > TOUCH * force[rows].max()) >= MIN_POINTS] or found
        reaching = [rows for rows in enough if force[rows].max() >= load * (1 - _SAME)]
        if not reaching:
            top = max(float(force[rows].max()) for rows in enough)
            raise RangeError(f"preload = {load:g} exceeds the unload-reload branch, which ends at force {top:g}")
        rows = next((rows for rows in reaching if force[rows].min() < load), reaching[0])
        return rows[np.argsort(self.curve.delta[rows], kind="stable")]


@dataclass(frozen=True, eq=False)
class Choice:
    """A law of a curve as the spring of a vibration."""

    name: str  # of the law, one of `LAWS`
    law: Law
    rows: Indices  # of the curve that the law was made of, in the order of approach
    load: float  # preload (force)
    yielded: bool | None  # None if the curve does not show it
    reason: str  # why it is this law, a part of a sentence
    note: str = ""  # sentence on a law to be doubted
    done: str = ""  # how the rows were read, and what was done with measured ones


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
        A contact that separates at a residual indentation of 0.3:

        >>> from asperity.vibration.source import law_from
        >>> up, down = np.linspace(0.0, 1.0, 21), np.linspace(0.95, 0.3, 14)
        >>> curve = {"delta": [*up, *down], "force": [*up**1.5, *((down - 0.3) / 0.7) ** 1.5]}
        >>> law, load = law_from(curve | {"branch": ["load"] * 21 + ["unload"] * 14})
        >>> print(law.describe(), "preload", load, "approach", round(law.deflection(load), 3))
        unload-reload branch through 14 points preload 0.5 approach 0.441
    """
    if isinstance(source, Law):
        return source, source.default_load if load is None else load
    choice = choose(CurveColumns.of(source), law, load)
    if choice.note:
        warn(choice.note, AsperityWarning)
    return choice.law, choice.load


def choose(columns: CurveColumns, law: str = "auto", load: float | None = None, name: str = "load") -> Choice:
    """Law of a curve for the vibration about a preload, which has a name in messages; see `law_from` for the rest.

    A small motion unloads and reloads. So its spring is the unloading through the preload, else after yield the elastic
    stiffness of the states on the loading, and before yield the loading itself. The power law of the loading is too
    soft after yield: it is taken where the curve has nothing else, with a note.
    """
    one_of("law", law, LAWS)
    load, lowered = _met(columns, load, name)
    forces = [columns.curve.force[rows] for rows in columns.unloadings()]
    through = [float(f.max()) for f in forces if f.min() <= load <= f.max() * (1 + _SAME)]
    yielded = columns.yielded(through[0] if through and law in ("auto", "unload-reload") else load)
    names, notes, chosen = (law,), [lowered], law
    if law == "auto":
        unloaded = ("unload-reload",) if through and yielded is not False else ()
        names = (*unloaded, *(("elastic", "paper") if yielded else ("table",)))
    for chosen in names:
        try:
            found, rows, done = _MAKE[chosen](columns, load)
            if isinstance(found, CurveLaw) and found.bars is None:  # of the curve, beside what the points leave open
                of_force, of_k = np.nan_to_num([columns.bar_at(load, of) for of in ("P_star", "k_n_elastic")])
                found = found.about(load, force=of_force, stiffness=0.0 if found.k is None else of_k)
            break
        except AsperityError as error:
            if chosen == names[-1]:
                raise
            if chosen == "unload-reload":
                notes.append(
                    f"the unloading through the preload gives no law: {error}; compute it with loading.unload_steps = "
                    f"{MIN_POINTS} or more, and output.stiffness = true"
                )
    if law == "auto" and chosen == "paper":
        notes.append(LACK)
    if isinstance(found, CurveLaw) and load < found.F[0]:
        notes.append(
            f"load {load:g} lies below the first point of the law (force {found.F[0]:g}): the law there is a power of "
            "the approach, as at the first points"
        )
    loading = "nothing has yielded up to the preload" if yielded is False else "the curve does not show that it yields"
    reason = REASONS.get(chosen, loading) if law == "auto" else "named"
    done = "; ".join(filter(None, (done, *columns.notes)))
    return Choice(chosen, found, rows, load, yielded, reason, "; ".join(filter(None, notes)), done)


def _met(columns: CurveColumns, load: float | None, name: str) -> tuple[float, str]:
    """Preload on a curve: lowered to its end within the error bar of the force, with a note, or "".

    Raises:
        RangeError: the curve does not reach it
    """
    top = float(columns.curve.force.max())
    load = 0.5 * top if load is None else positive(name, load)
    if load <= top * (1 + _SAME):
        return min(load, top), ""
    if load <= top * (1 + max(_SHORT, np.nan_to_num(columns.bar_at(top)))):
        return top, (
            f"{name} = {load:.6g} exceeds the greatest force of the curve by {100 * (load / top - 1):.2g} %, which is "
            f"within its error: the preload is {top:.6g}"
        )
    raise RangeError(
        f"{name} = {load:.6g} lies outside the curve, which ends at force {top:.6g}; lower it, or compute the curve "
        "further"
    )


Made = tuple[Law, Indices, str]  # law, its rows, and what was done with measured rows


def _table(columns: CurveColumns, load: float) -> Made:
    """Points of the first loading, with the elastic stiffness as slopes where nothing has yielded."""
    return _through(columns, load, columns.loading, "loading", slopes=not columns.yielded(load), origin=0.0)


def _unload_reload(columns: CurveColumns, load: float) -> Made:
    """Points of the last unloading, from where it separates."""
    return _through(columns, load, columns.unloading(load), "unload-reload branch")


def _through(
    columns: CurveColumns, load: float, rows: Indices, name: str, *, slopes: bool = True, origin: float | None = None
) -> Made:
    """Law through rows in the order of approach, with bars; the approach of first contact is found if it is None."""
    curve = columns.curve
    if columns.solid > curve.delta.max():  # without the block: the law ends where the interface does not close any more
        rows = rows[np.argsort(curve.force[rows], kind="stable")]
        rows = rows[: int(np.argmax(curve.delta[rows])) + 1]
        if curve.delta[rows[-1]] < LEAST * columns.solid or load > curve.force[rows[-1]] * (1 + _SAME):
            raise InputError(
                "the curve is as stiff as the block at the preload: its contact is complete, or nearly, and nothing is "
                "left for the interface; take a smaller preload"
            )
    delta, force, k = curve.delta[rows], curve.force[rows], curve.k_n_elastic[rows]
    if columns.measured:
        law, done = law_of_rows(delta, force, load, name)
        return law, rows, done
    touching = force > TOUCH * force.max()
    if origin is None:
        if np.sum(~touching) == 1:
            origin = float(delta[~touching][0])
        elif np.all(k[:2] > 0) and touching.all() and k.size > 1:
            origin = float(delta[0] - CurveLaw.of_stiffness(force[:2], k[:2]).z[0])
        else:
            origin = LocalFit(delta, force, measured=True).origin[0]
    return CurveLaw(delta, force, origin=origin, k=k if slopes else None, name=name), rows, ""


def _elastic(columns: CurveColumns, load: float) -> Made:
    """Law of a contact that was never overloaded: the elastic stiffness of the states on the loading."""
    force, k = columns.curve.force, columns.curve.k_n_elastic
    rows = columns.loading[((force > 0) & (k > 0))[columns.loading]]
    rows = rows[np.unique(force[rows], return_index=True)[1]]
    if rows.size < 2 or load > force[rows[-1]] * (1 + _SAME):
        raise InputError(
            f"the curve has the elastic stiffness k_n_elastic in {rows.size} rows of the loading, at least 2 are "
            "needed, up to the preload: compute it with output.stiffness = true"
        )
    return CurveLaw.of_stiffness(force[rows], k[rows], name="elastic tangent of the loading"), rows, ""


def _paper(columns: CurveColumns, load: float) -> Made:
    """Power law of the loading, known to its greatest force."""
    loading = columns.loading
    delta, force = columns.curve.delta[loading], columns.curve.force[loading]
    length, unit = float(delta.max(initial=0.0)), float(force.max(initial=0.0))
    if not (length > 0 and unit > 0):
        raise InputError("the loading branch of the curve never makes contact: no power law can be fitted")
    rows = fitted_rows(delta, force)
    fit = fit_power_law(delta[rows] / length, force[rows] / unit)
    with np.errstate(over="ignore"):
        law = PowerLaw(fit.n, float(unit * fit.k * np.float64(length) ** -fit.n))
    return replace(law, known_to=max(fit.range[1] * length, law.deflection(unit))), loading[rows], ""


#: Law about a preload (force), by its name.
_MAKE: dict[str, Callable[[CurveColumns, float], Made]] = {
    "unload-reload": _unload_reload,
    "elastic": _elastic,
    "table": _table,
    "paper": _paper,
}
