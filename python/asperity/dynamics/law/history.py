# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""What the columns of a curve say about the state that a mass vibrates about: yield, stiffness, error bar."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.law.table import column_of, columns
from asperity.dynamics.law.tangent import TangentLaw
from asperity.errors import InputError, RangeError

_HYSTERESIS = 0.01  # share of the greatest force by which an unloading falls short of the loading after yield


@dataclass(frozen=True, eq=False)
class History:
    """Columns of a curve in the order of its steps, shape (n,); NaN where unknown.

    Attributes:
        delta: approach (length).
        force: force.
        branch: "load", "unload" or "reload"; all "load" where the curve has no such column.
        plastic: greatest accumulated plastic strain, or the share of the volume that has yielded.
        elastic: stiffness of unloading and small vibration (force/length), column k_n_elastic.
        bar: error bar of the force over the force.
        elastic_bar: error bar of the elastic stiffness over that stiffness, column error_k_n_elastic.
        branches: whether the curve has a column "branch".

    Examples:
        >>> from asperity.dynamics.law.history import History
        >>> history = History.of({"delta": [1.0, 2.0], "force": [1.0, 3.0], "max_plastic_strain": [0.0, 1e-3]})
        >>> history.yielded(1.0), history.yielded(2.0)
        (False, True)
    """

    delta: Array
    force: Array
    branch: Array
    plastic: Array
    elastic: Array
    bar: Array
    elastic_bar: Array
    branches: bool

    @classmethod
    def of(cls, curve: Any, factor: float = 1.0) -> History:
        """Read a `Curve`, a CSV file or a mapping.

        Args:
            curve: with the columns delta and force at least.
            factor: by which forces and stiffnesses are multiplied, nominal area of a joint over that of the patch.

        Raises:
            InputError: a required column is missing, empty, or contains something that is not a number.
        """
        delta, force, branch = columns(curve)
        if delta.size == 0:
            raise InputError("the curve is empty: it needs one row per approach")
        get = column_of(curve)

        def optional(name: str) -> Array:
            values = get(name)
            if values is None:
                return np.full(delta.size, np.nan)
            try:
                found = np.array([np.nan if value == "" else value for value in values], float)
            except (TypeError, ValueError) as error:
                raise InputError(f"the curve contains something that is not a number: {error}") from error
            return found

        strain, share = optional("max_plastic_strain"), optional("plastic_fraction")

        def relative(error: str, column: str) -> Array:
            with np.errstate(all="ignore"):
                share = optional(error) / optional(column)
            return np.where(np.isfinite(share) & (share >= 0), share, np.nan)

        return cls(
            delta,
            factor * force,
            np.full(delta.size, "load") if branch is None else branch,
            np.where(np.isnan(strain), share, strain),
            factor * optional("k_n_elastic"),
            relative("error_P_star", "P_star"),
            relative("error_k_n_elastic", "k_n_elastic"),
            branch is not None,
        )

    def mapping(self) -> dict[str, Array]:
        """Columns that `TableLaw.from_curve` and `unload_reload` read."""
        table = {"delta": self.delta, "force": self.force}
        return table | {"branch": self.branch} if self.branches else table

    @property
    def loading(self) -> Array:
        """Whether a row belongs to the first loading, shape (n,)."""
        return np.asarray(self.branch == "load")

    def yielded(self, load: float) -> bool | None:
        """Return whether the solid has yielded once the loading has reached a force; None if that is not known.

        The plastic strain decides: that of the first row at or above the force and of those before. Without it, an
        unloading that falls short of the loading does.

        Args:
            load: greatest force met (force).
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
        """Return the error bar of the force over the force at a load, by the nearest row; NaN if unknown.

        Args:
            load: force at which it is wanted (force).
            elastic: take that of the elastic stiffness instead, where it is known.
        """
        if elastic and np.isfinite(self.elastic_bar).any():
            bars = self.elastic_bar
        else:
            bars, elastic = self.bar, False
        known = np.flatnonzero(np.isfinite(bars))
        return float(bars[known[np.argmin(np.abs(self.force[known] - load))]]) if known.size else np.nan

    def rows_of(self, *, unloading: bool) -> Array:
        """Return the rows of the first loading, or of the last unloading with the row before it, by rising force."""
        if not unloading:
            rows = np.flatnonzero(self.loading)
        else:
            rows = np.flatnonzero(self.branch == "unload")
            rows = rows[np.append(np.flatnonzero(np.diff(rows) > 1) + 1, 0).max() :]
            rows = np.append(rows[:1] - 1, rows) if rows.size and rows[0] > 0 else rows
        rows = rows[np.argsort(self.force[rows], kind="stable")]
        return np.asarray(rows[np.append(True, np.diff(self.force[rows]) > 0)] if rows.size else rows)

    def tangent(self, load: float, *, unloading: bool = False, extrapolate: bool = False) -> TangentLaw:
        """Return the law with the elastic stiffness of the states on a branch.

        Args:
            load: preload that the branch must reach (force).
            unloading: take the last unloading instead of the first loading.
            extrapolate: see `TableLaw`.

        Raises:
            InputError: fewer than five rows of the branch have an elastic stiffness.
            RangeError: they end below the load.
        """
        rows = self.rows_of(unloading=unloading)
        rows = rows[(self.force[rows] > 0) & (self.elastic[rows] > 0)]
        if rows.size < 5:
            raise InputError(
                f"the curve has the elastic stiffness k_n_elastic in {rows.size} rows of the branch, at least 5 are "
                "needed: compute it with output.stiffness = true"
            )
        force = self.force[rows]
        if load > force[-1] * (1 + 1e-9):
            raise RangeError(
                f"load = {load:g} lies outside the rows with an elastic stiffness, which end at force {force[-1]:g}"
            )
        name = f"elastic tangent of the {'unloading' if unloading else 'loading'}"
        return TangentLaw.of(force, self.elastic[rows], name=name, extrapolate=extrapolate)
