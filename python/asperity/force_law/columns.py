"""What the columns of a curve say about the state that a mass vibrates about: branches, yield, stiffness, error bar."""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array, Flags
from asperity.curve import BRANCHES
from asperity.curve.slope import legs
from asperity.errors import InputError
from asperity.force_law.checks import within
from asperity.runtime.measured_curve import read_measured_curve

SIZES = (1e-100, 1e100)  # of the greatest approach and force, so that products do not overflow
_HYSTERESIS = 0.01  # share of the greatest force by which an unloading falls short of the loading after yield


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
    notes: tuple[str, ...] = ()  # how a file was read, a sentence each

    @classmethod
    def of(cls, source: Any, factor: float = 1.0) -> CurveColumns:
        """Read a `Curve`, a mapping, a CSV file, or a directory with curve.csv, with delta and force at least.

        Forces and stiffnesses are multiplied by `factor`, the nominal area of a joint over that of the patch.

        Raises:
            InputError: there is no such file, or a column is missing, empty, or contains what is not a number
        """
        if isinstance(source, cls):
            return source
        table, notes = _read(Path(source)) if isinstance(source, (str, os.PathLike)) else (source, ())

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
        for name, values in (("delta", delta), ("force", force)):
            if greatest := float(np.abs(values).max()):
                within(f"the greatest {name} of the curve", greatest, SIZES)
        names = ["load"] * size if sized("branch") is None else sized("branch")
        branch = np.array([str(name).strip() for name in names])
        if unknown := set(branch.tolist()) - set(BRANCHES):
            raise InputError(f"branch {min(map(repr, unknown))} of the curve is unknown: use {', '.join(BRANCHES)}")
        return cls(
            delta=delta, force=factor * force, branch=branch,
            plastic=np.where(np.isnan(strain), number("plastic_fraction"), strain),
            elastic=factor * number("k_n_elastic"), bar=relative("P_star"), elastic_bar=relative("k_n_elastic"),
            notes=notes,
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
        measured = read_measured_curve(file)
    except OSError as error:
        raise InputError(f"cannot read the curve {path}: {error.strerror}") from error
    except (ValueError, csv.Error) as error:
        raise InputError(f"the curve {path} cannot be read: {error}") from error
    return measured.columns, measured.notes
