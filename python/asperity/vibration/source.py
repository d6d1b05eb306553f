"""The law of a curve about a preload: its columns, and which of its branches is the spring of a small vibration."""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array, Flags
from asperity.curve import BRANCHES
from asperity.curve.power_law import fit_power_law
from asperity.curve.slope import fitted_rows, legs
from asperity.errors import AsperityError, AsperityWarning, InputError, RangeError, warn
from asperity.vibration.checks import LAWS, MIN_ROWS, one_of, positive, within
from asperity.vibration.curve_law import MIN_POINTS, CurveLaw
from asperity.vibration.law import Law, PowerLaw
from asperity.vibration.local_fit import LocalFit
from asperity.vibration.measured import FALL, branches, law_of_rows, read_table

SIZES = (1e-100, 1e100)  # of the greatest approach and force, so that products do not overflow
LEAST = 1e-3  # share of the compliance that the interface must have: less is lost in the error of the block
TOUCH = 1e-9  # share of the largest force above which a row is in contact
TOO_LOW = (
    "the law is the paper's power law of the loading, whose frequency is too low, by a factor of 1.5 on a fractal "
    "surface"
)
LACK = (
    "the contact has yielded, and the curve has neither an unloading through the preload nor the elastic stiffness: "
    f"{TOO_LOW}; compute the curve with loading.unload = true or output.stiffness = true"
)
_HYSTERESIS = 0.01  # share of the greatest force by which an unloading falls short of the loading after yield
_SAME = 1e-9  # relative difference of forces that are equal
_SHORT = 2e-6  # the same where a load path by force ends


@dataclass(frozen=True, eq=False)
class CurveColumns:
    """Columns of a curve in the order of its steps, shape (n,); NaN where unknown."""

    delta: Array  # approach (length)
    force: Array
    branch: Array  # "load", "unload" or "reload"; all "load" where the curve has no such column
    plastic: Array  # greatest accumulated plastic strain, or the share of the volume that has yielded
    elastic: Array  # stiffness of unloading and small vibration (force/length), column k_n_elastic
    bar: Array  # error bar of the force over the force
    elastic_bar: Array  # error bar of the elastic stiffness over that stiffness, column error_k_n_elastic
    measured: bool = False  # whether the rows are those of an instrument: they scatter, and contact begins anywhere
    notes: tuple[str, ...] = ()  # how the rows were read, a sentence each

    @classmethod
    def of(cls, source: Any, factor: float = 1.0, block: float = 0.0) -> CurveColumns:
        """Read a `Curve`, a mapping, a CSV file, or a directory with curve.csv, with delta and force at least.

        Forces and stiffnesses are multiplied by `factor`, the nominal area of a joint over that of the patch. The
        compliance `block` (length/force) of the block behind the patch is taken out of approach and stiffness.

        Raises:
            InputError: there is no such file, or a column is missing, empty, or contains what is not a number
        """
        if isinstance(source, cls):
            return source
        table, notes = _read(Path(source)) if isinstance(source, (str, os.PathLike)) else (source, ())
        measured = isinstance(table, Mapping) and not any(table.get(n) is not None for n in ("step", "k_n_elastic"))

        def column(name: str) -> Any:
            return table.get(name) if isinstance(table, Mapping) else getattr(table, name, None)

        for name in ("delta", "force"):
            if column(name) is None:
                found = f", only {', '.join(map(repr, table))}" if isinstance(table, Mapping) else ""
                raise InputError(f'the curve has no column "{name}"{found}')
        size = len(column("delta"))
        if size == 0:
            raise InputError("the curve is empty: it needs one row per approach")

        def sized(name: str) -> Any:
            values = column(name)
            if values is not None and not np.ndim(values):
                raise InputError(f"{name} of the curve is no column of {size} values")
            if values is not None and len(values) != size:
                raise InputError(f"the curve has {size} values of delta and {len(values)} of {name}")
            return values

        def number(name: str) -> Array:
            values = sized(name)
            try:
                return np.array([np.nan if v == "" else v for v in ([""] * size if values is None else values)], float)
            except (TypeError, ValueError) as error:
                raise InputError(f"the curve contains something that is not a number: {error}") from error

        def relative(name: str) -> Array:
            with np.errstate(all="ignore"):
                share = number(f"error_{name}") / number(name)
            return np.where(np.isfinite(share) & (share >= 0), share, np.nan)

        delta, force, strain = number("delta"), number("force"), number("max_plastic_strain")
        if not (known := np.isfinite(delta) & np.isfinite(force)).all():
            raise InputError(f"row {int(np.argmin(known))} of the curve is not finite in delta or force")
        if force.max() <= 0.0:
            raise InputError("no force of the curve is positive: compression counts positive, so reverse its sign")
        for name, values in (("delta", delta), ("force", force)):
            if greatest := float(np.abs(values).max()):
                within(f"the greatest {name} of the curve", greatest, SIZES)
        names = sized("branch")
        rows: Array = np.arange(size)
        if measured and names is None:
            rows, names, done = branches(delta, force)
            notes += (done,) if done else ()
        names = ["load"] * size if names is None else names
        branch = np.array([str(name).strip() for name in names])
        if unknown := set(branch.tolist()) - set(BRANCHES):
            raise InputError(f"branch {min(map(repr, unknown))} of the curve is unknown: use {', '.join(BRANCHES)}")
        k = number("k_n_elastic")
        share = 1.0 - block * np.where(k > 0.0, k, 0.0)  # of the interface in the compliance
        with np.errstate(all="ignore"):
            alone = np.where(share > LEAST, k / share, np.nan)
        return cls(
            (delta - block * force)[rows], factor * force[rows], branch,
            plastic=np.where(np.isnan(strain), number("plastic_fraction"), strain)[rows],
            elastic=factor * alone[rows], bar=relative("P_star")[rows],
            elastic_bar=(relative("k_n_elastic") / np.maximum(share, LEAST))[rows], measured=measured, notes=notes,
        )  # fmt: skip

    @property
    def loading(self) -> Flags:
        """Whether a row belongs to the first loading, shape (n,)."""
        return np.asarray(self.branch == "load")

    def yielded(self, load: float) -> bool | None:
        """Whether the solid has yielded once the loading has reached a force; None if that is not known.

        The plastic strain decides: that of the first row at or above the force and of those before. Without it, an
        unloading that falls short of the loading does.
        """
        rows = np.flatnonzero(self.loading)
        first = int(np.argmax(self.force[rows] >= load * (1 - 1e-9))) if rows.size else 0
        strain = self.plastic[rows[: first + 1]]
        if np.isfinite(strain).any():
            return bool(np.nanmax(strain) > 0.0)
        down = np.flatnonzero(self.branch == "unload")
        if not down.size or rows.size < 2:
            return None
        order = rows[np.argsort(self.delta[rows], kind="stable")]
        up = np.interp(self.delta[down], self.delta[order], self.force[order])
        return bool(np.max(up - self.force[down]) > _HYSTERESIS * self.force.max())

    def bar_at(self, load: float, *, elastic: bool = False) -> float:
        """Error bar of the force, or of the elastic stiffness, over it, of the row nearest in force; NaN if unknown."""
        bars = self.elastic_bar if elastic else self.bar
        known = np.flatnonzero(np.isfinite(bars))
        return float(bars[known[np.argmin(np.abs(self.force[known] - load))]]) if known.size else np.nan

    def rising(self, among: Flags) -> Array:
        """Rows among those marked, shape (n,), in the order of their force, each force once."""
        return np.flatnonzero(among)[np.unique(self.force[among], return_index=True)[1]]

    def unloadings(self) -> list[Array]:
        """Rows of each unloading with the row before, the last one first."""
        found: list[Array] = [
            np.arange(max(begin - 1, 0), end) for begin, end in legs(self.branch) if self.branch[begin] == "unload"
        ]
        return found[::-1]


def _read(path: Path) -> tuple[Mapping[str, Any], tuple[str, ...]]:
    """Columns of a file, and how it was read."""
    file = path / "curve.csv" if path.is_dir() else path
    try:
        return read_table(file)
    except OSError as error:
        raise InputError(f"cannot read the curve {path}: {error.strerror}") from error
    except (ValueError, csv.Error) as error:
        raise InputError(f"the curve {path} cannot be read: {error}") from error


@dataclass(frozen=True, eq=False)
class Choice:
    """A law of a curve as the spring of a vibration."""

    name: str  # of the law, one of `NAMES`
    law: Law
    load: float  # preload (force)
    yielded: bool | None  # None if the curve does not show it
    reason: str  # why it is this law, a part of a sentence
    note: str = ""  # sentence on a law to be doubted
    done: str = ""  # what was done with measured rows


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
        >>> from asperity.vibration.source import law_from
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
    """Law of a curve for the vibration about a preload; for arguments and errors see `law_from`.

    After yield a small motion unloads and reloads. So its spring is the unloading through the preload, else the elastic
    stiffness of the states on the loading, and before yield the loading itself. The power law of the loading is too
    soft after yield: it is taken where the curve has nothing else, with a note.
    """
    one_of("law", law, LAWS)
    top = float(np.max(columns.force))
    load, lowered = met(0.5 * top if load is None else positive("load", load), top, columns.bar_at(top))
    if law != "auto":
        found, done = law_named(columns, law, load)
        return Choice(
            law, found, load, columns.yielded(top if law == "unload-reload" else load), "named", lowered, done
        )
    forces = [columns.force[rows] for rows in columns.unloadings()]
    through = any(force.min() <= load <= force.max() * (1 + _SAME) for force in forces)
    yielded, lack = columns.yielded(load), ""
    if through:
        try:
            leg, done = law_named(columns, "unload-reload", load)
            yielded = columns.yielded(columns.force[leg_rows(columns, load)].max())
            if yielded:
                note = "; ".join(filter(None, (_few(leg.knots.size), lowered)))
                reason = "yielded, and unloaded through the preload"
                return Choice("unload-reload", leg, load, True, reason, note, done)
        except AsperityError as error:
            lack = (
                f"the unloading through the preload gives no law: {error}; compute it with loading.unload_steps = "
                f"{MIN_POINTS} or more, and output.stiffness = true"
            )
    if not yielded:
        found, done = law_named(columns, "table", load)
        why = "nothing has yielded up to the preload" if yielded is False else "the curve does not show that it yields"
        return Choice("table", found, load, yielded, why, lowered, done)
    notes = [lack, lowered]
    try:
        found, name, reason = elastic_tangent(columns, load), "elastic", "yielded, and the elastic stiffness is known"
    except AsperityError:
        found, name, reason = law_named(columns, "paper", load)[0], "paper", "yielded, no other law"
        notes[0] = f"{lack}; until then {TOO_LOW}" if lack else LACK
    return Choice(name, found, load, True, reason, "; ".join(filter(None, notes)))


def _few(rows: int) -> str:
    """Sentence on an unloading of too few rows in contact; empty for others."""
    if rows >= MIN_ROWS[1]:
        return ""
    return (
        f"the unloading through the preload has {rows} rows in contact, and at least {MIN_ROWS[1]} show its curvature: "
        "compute it with more unload_steps"
    )


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


def law_named(columns: CurveColumns, name: str, load: float) -> tuple[Law, str]:
    """Law of `NAMES` about a preload (force), with its bars, and what was done with measured rows; see `law_from`."""
    if name == "unload-reload":
        return _branch(columns, leg_rows(columns, load), load, "unload-reload branch")
    if name == "elastic":
        return elastic_tangent(columns, load), ""
    if name == "table":
        return _branch(columns, np.flatnonzero(columns.loading), load, "loading")
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
    return replace(fitted, fitted_to=max(fitted.fitted_to, fitted.deflection(unit))), ""  # to the force of the curve


def _branch(columns: CurveColumns, rows: Array, load: float, name: str) -> tuple[CurveLaw, str]:
    """Law through the rows of one branch about a load, with its bars."""
    delta, force, k = columns.delta[rows], columns.force[rows], columns.elastic[rows]
    first = columns.loading[rows].all()
    if first and columns.yielded(load):
        k = np.full(k.shape, np.nan)  # the slope of a loading that yields is not its elastic stiffness
    bar, of_k = columns.bar_at(load), columns.bar_at(load, elastic=True)
    bar = bar if bar > 0.0 else 0.0
    if columns.measured:
        return law_of_rows(delta, force, load, bar=bar, k=k, name=name)
    touching = force > TOUCH * force.max()
    if first:
        origin = 0.0
    elif np.sum(~touching) == 1:
        origin = float(delta[~touching][0])
    elif np.all(k[touching][:2] > 0) and touching.all() and k.size > 1:
        origin = float(delta[0] - CurveLaw.of_stiffness(force[:2], k[:2]).z[0])
    else:
        origin = LocalFit(delta, force, origin=None, relative=False).origin[0]
    law = CurveLaw(delta, force, origin=origin, k=k, name=name)
    return law.about(load, bar, of_k if law.k is not None and of_k > 0.0 else 0.0), ""


def unload_reload(curve: Any, load: float | None = None) -> CurveLaw:
    """Law of a plastic contact: the last unloading of a curve that passes through a preload (force), if one is given.

    Its slopes are the elastic stiffness of the rows (column k_n_elastic), if known. The approach is measured from the
    row at which the contact separates, else from where the branch reaches zero force.

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
        >>> round(law.deflection(0.5), 3)
        0.441
    """
    columns = CurveColumns.of(curve)
    rows = leg_rows(columns, load)
    return _branch(
        columns, rows, 0.5 * float(columns.force[rows].max()) if load is None else load, "unload-reload branch"
    )[0]


def leg_rows(columns: CurveColumns, load: float | None = None) -> Array:
    """Rows of the unloading of `unload_reload`, in the order of their approach; errors as there."""
    force, found = columns.force, columns.unloadings()
    if not found:
        raise InputError("the curve has no unloading branch: compute one with loading.unload = true")
    enough = [rows for rows in found if np.sum(force[rows] > TOUCH * force[rows].max()) >= MIN_POINTS] or found
    reaching = [rows for rows in enough if load is None or force[rows].max() >= load * (1 - _SAME)]
    if not reaching:
        top = max(float(force[rows].max()) for rows in enough)
        raise RangeError(f"preload = {load:g} exceeds the unload-reload branch, which ends at force {top:g}")
    rows = next((rows for rows in reaching if load is None or force[rows].min() < load), reaching[0])
    return rows[np.argsort(columns.delta[rows], kind="stable")]


def elastic_tangent(columns: CurveColumns, load: float) -> CurveLaw:
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
    law = CurveLaw.of_stiffness(force, columns.elastic[rows], name="elastic tangent of the loading")
    bars = (columns.bar_at(load), columns.bar_at(load, elastic=True))
    return law.about(load, *(bar if bar > 0.0 else 0.0 for bar in bars))
