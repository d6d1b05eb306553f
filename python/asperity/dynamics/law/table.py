# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Laws from computed or measured points: loading curves and unload-reload branches.

Values come from a shape-preserving cubic through the points in (ln z, ln F), where every power law is a
straight line. Derivatives come from a local polynomial fit in (ln z, ln F), with its confidence interval: those
of the interpolant would be useless, because half a percent of noise ruins the second one.
"""

from __future__ import annotations

import csv
import os
from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import exp, log
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator
from scipy.optimize import minimize_scalar
from scipy.special import stdtrit

from asperity.arrays import Array
from asperity.dynamics.law.checks import positive
from asperity.dynamics.law.law import Law, dense
from asperity.dynamics.law.local_fit import LocalFit, log_derivatives, regress, roughness
from asperity.dynamics.law.power import PowerLaw
from asperity.errors import InputError, RangeError
from asperity.runtime.display import short_repr

_POINTS = 5  # smallest number of points of a table
_TOUCH = 1e-9  # share of the largest force above which a row is in contact
_CLOSED = 1e-3  # a reloading closes its loop if it ends within this share below the top, in approach or force
_NOISY = 0.1  # relative uncertainty of the stiffness through the points
_CELL_X, _CELL_W = np.polynomial.legendre.leggauss(10)


@dataclass(frozen=True, eq=False)
class TableLaw(Law):
    """Law through points (z_i, F_i).

    Attributes:
        z: approaches from first contact (length), rising, shape (m,); rows with z <= 0 are dropped.
        F: forces, rising with z, shape (m,).
        origin: approach of the curve at first contact (length), subtracted from `z`.
        values: "interpolant" (through the points) or "fit" (power law fitted to all points, for noisy data).
        degree: degree of the local fit for the derivatives (1 to 3); lowered if points are few.
        extrapolate: continue beyond the last point along the last slope in (ln z, ln F).
        name: name of the law in descriptions.

    Below the first point the law runs to the origin as a power of z, with the slope at the first point.

    Raises:
        InputError: the table is empty, too short, not finite, or not rising.

    Examples:
        >>> z = np.linspace(0.1, 2.0, 20)
        >>> law = asp.TableLaw(z, z**1.5)
        >>> law.describe(), law.z_range
        ('table, 20 points, interpolated', (0.0, 2.0))
        >>> f"{law.n_loc(1.0):.4f}, {law.force(1.05):.4f}"
        '1.5000, 1.0759'
    """

    z: Array
    F: Array
    origin: float = 0.0
    values: str = "interpolant"
    degree: int = 3
    extrapolate: bool = False
    name: str = "table"
    contact: bool = field(default=True, init=False)

    scalar = True

    __repr__ = short_repr

    def __post_init__(self) -> None:
        try:
            z, F = np.asarray(self.z, float), np.asarray(self.F, float)
        except (TypeError, ValueError) as error:
            raise InputError(f"the table contains something that is not a number: {error}") from None
        if z.ndim != 1 or z.shape != F.shape:
            raise InputError(f"a table needs two columns of one length, got shapes {z.shape} and {F.shape}")
        if z.size == 0:
            raise InputError("the table is empty: it needs one row per approach")
        if not (np.isfinite(z).all() and np.isfinite(F).all()):
            raise InputError(f"row {int(np.argmin(np.isfinite(z) & np.isfinite(F)))} of the table is not finite")
        if self.values not in ("interpolant", "fit"):
            raise InputError(f'values = "{self.values}" is unknown: choose "interpolant" or "fit"')
        if not 1 <= self.degree <= 3:
            raise InputError(f"degree = {self.degree} must be 1, 2 or 3")
        z = z - self.origin
        keep = (z > 0) & (F > 0)
        stray = np.flatnonzero((z > 0) & (F <= 0) & (np.cumsum(keep) > 0))
        if stray.size:
            raise InputError(f"row {int(stray[0])} of the table has force {F[stray[0]]:g} <= 0 inside the contact")
        if ((z <= 0) & (F > 1e-6 * F.max())).any():
            raise InputError(
                f"the table has force {F[z <= 0].max():g} at or below zero approach: its origin is offset; "
                'pass the approach of first contact as origin, or use from_curve(..., origin="fit")'
            )
        gap = np.flatnonzero((z > 0) & (F <= 0))
        if gap.size and z[gap[-1]] > 1e-9 * z.max():
            raise InputError(
                f"the force is zero up to approach {z[gap[-1]]:g}: the origin is offset; pass origin = "
                f'{z[gap[-1]] + self.origin:g}, or use from_curve(..., origin="fit")'
            )
        rows = np.flatnonzero(keep)
        z, F = z[keep], F[keep]
        if z.size < _POINTS:
            raise InputError(f"the table has {z.size} usable rows, at least {_POINTS} are needed")
        for label, column in (("approach", z), ("force", F)):
            bad = np.flatnonzero(np.diff(column) <= 0)
            if bad.size and not (label == "force" and self.values == "fit"):
                remedy = "sort it" if label == "approach" else 'smooth it, or use values="fit"'
                raise InputError(
                    f"the {label} does not rise after row {int(rows[bad[0]])} of the table "
                    f"({column[bad[0]]:g} to {column[bad[0] + 1]:g}): {remedy}"
                )
        z.flags.writeable = F.flags.writeable = False
        object.__setattr__(self, "z", z)
        object.__setattr__(self, "F", F)

    @classmethod
    def from_curve(cls, curve: Any, *, branch: str = "load", origin: float | str = 0.0, **options: Any) -> TableLaw:
        """Build a table from a `Curve`, a CSV file or a mapping with the columns delta and force.

        Args:
            curve: source of the columns.
            branch: branch to use if there is a column "branch".
            origin: approach of first contact (length), or "fit" to find it with the power law.
            **options: `values`, `degree`, `extrapolate`, `name`.

        Raises:
            InputError: as for `TableLaw`, or the columns cannot be read.
        """
        delta, force, branches = columns(curve)
        if branches is not None:
            delta, force = delta[branches == branch], force[branches == branch]
        if isinstance(origin, str):
            if origin != "fit":
                raise InputError(f'origin = "{origin}" is unknown: give an approach or "fit"')
            origin = fit_origin(delta, force)
        return cls(delta, force, origin=float(origin), **options)

    @property
    def z_range(self) -> tuple[float, float]:
        """Approach from first contact to the last point (length), 1e6 times as far if extrapolated."""
        return (0.0, 1e6 * float(self.z[-1]) if self.extrapolate else float(self.z[-1]))

    @property
    def known_to(self) -> float:
        """Approach of the last point (length)."""
        return float(self.z[-1])

    @property
    def knots(self) -> Array:
        """Approaches at which the law is not smooth (length)."""
        return self.z if self.values == "interpolant" else np.empty(0)

    def fit(self) -> PowerLaw:
        """Fit a power law to all points in (ln z, ln F), with 95 % confidence intervals."""
        c, covariance, freedom = regress(np.log(self.z), np.log(self.F), 1)
        half = np.sqrt(np.diag(covariance)) * float(stdtrit(freedom, 0.975))
        n, K = float(c[1]), float(np.exp(c[0]))
        product = float(np.sqrt(covariance[0, 0] * covariance[1, 1]))
        return PowerLaw(
            n,
            K,
            (max(n - float(half[1]), 1e-12), n + float(half[1])),
            (K * float(np.exp(-half[0])), K * float(np.exp(half[0]))),
            float(covariance[0, 1]) / product if product > 0 else 0.0,
        )

    def local_fit(self, z: float) -> LocalFit:
        """Fit ln F over ln z to the points within a factor 4 of `z` (length), at least 2 degree + 2 of them."""
        x = np.log(self.z / z)
        near = np.flatnonzero(np.abs(x) <= np.log(4.0))
        if near.size < min(2 * self.degree + 2, x.size):
            near = np.argsort(np.abs(x), kind="stable")[: 2 * self.degree + 2]
        degree = max(1, min(self.degree, (near.size - 2) // 2))
        c, covariance, freedom = regress(x[near], np.log(self.F[near]), degree)
        residual = np.log(self.F[near]) - np.vander(x[near], degree + 1, increasing=True) @ c
        scatter = float(np.sqrt(residual @ residual / freedom))
        close = np.sort(np.abs(x))[: min(4, x.size)]
        return LocalFit(float(z), c, covariance, freedom, scatter, float(close[-1]) / 2.0)

    def both(self, z: Array) -> tuple[Array, Array]:
        z = np.asarray(z, float)
        s = np.maximum(z, 1e-300)
        if self.values == "fit":
            return self._smooth.both(z)
        x = np.log(s)
        y, slope = self._log_values(x)
        force = np.where(z > 0, np.exp(y), 0.0)
        return force, np.where(z > 0, force * slope / s, 0.0)

    def push(self, z: Array) -> Array:
        if self.values == "fit":
            return self._smooth.push(z)
        return np.interp(z, *self._dense)

    def at(self, z: float) -> tuple[float, float]:
        if self.values == "fit":
            return self._smooth.at(z)
        if z <= 0.0:
            return 0.0, 0.0
        x = log(z)
        edges, cubics = self._cells
        (a, b, c, d), start = cubics[bisect_right(edges, x)]
        t = x - start
        force = exp(((a * t + b) * t + c) * t + d)
        return force, force * ((3.0 * a * t + 2.0 * b) * t + c) / z

    def potential(self, z: ArrayLike) -> Array:
        if self.values == "fit":
            return self._smooth.potential(z)
        z = np.maximum(np.asarray(z, float), 0.0)
        knots, energy = self._energy
        cell = np.clip(np.searchsorted(knots, z, side="right") - 1, 0, knots.size - 1)
        left = knots[cell]
        half = 0.5 * (z - left)
        inside = half * (self.both(left[..., None] + half[..., None] * (1.0 + _CELL_X))[0] @ _CELL_W)
        n0 = self._ends[1]
        below = self.F[0] * self.z[0] / (n0 + 1.0) * (z / self.z[0]) ** (n0 + 1.0)
        return np.where(z < self.z[0], below, energy[cell] + inside)

    def derivatives(self, z: float) -> tuple[float, float, float]:
        if self.values == "fit":
            return self._smooth.derivatives(z)
        slopes = self.local_fit(z).logarithmic() if z >= self.z[0] else np.array([self._ends[1], 0.0, 0.0])
        return log_derivatives(slopes, float(self.both(np.array([z]))[0][0]), z)

    def deflection(self, load: float) -> float:
        if self.values == "fit":
            z = self._smooth.deflection(load)
            if z > self.z_range[1]:
                raise RangeError(f"load = {load:g} lies outside the table, which ends at force {self.F[-1]:g}")
            return z
        if load < self.F[0]:
            return float(self.z[0] * (positive("load", load) / self.F[0]) ** (1.0 / self._ends[1]))
        return super().deflection(load)

    def doubts(self, load: float) -> tuple[str, ...]:
        if self.values == "fit":
            return ()
        if load < self.F[0]:
            return (
                f"load {load:g} lies below the first point of the table (force {self.F[0]:g}): the law "
                "there is extrapolated",
            )
        z = self.deflection(load)
        rough = roughness(np.log(self.z / z), np.log(self.F))
        if rough <= _NOISY:
            return ()
        return (
            f"the points scatter so that the stiffness through them is uncertain by {100 * rough:.0f} % "
            f'at z = {z:g}: the table is noisy; values="fit" is safer',
        )

    def describe(self) -> str:
        how = "interpolated" if self.values == "interpolant" else "as fitted power law"
        return f"{self.name}, {self.z.size} points, {how}"

    @cached_property
    def _smooth(self) -> PowerLaw:
        return self.fit()

    @cached_property
    def _curve(self) -> Any:
        spline = PchipInterpolator(np.log(self.z), np.log(self.F))
        return spline, spline.derivative()

    @cached_property
    def _ends(self) -> tuple[Array, float, float]:
        """Logarithms of the end points (x, y of both), and the log-log slopes there."""
        x, y = np.log(self.z), np.log(self.F)
        first = float(self._curve[1](x[0]))
        last = float(self._curve[1](x[-1]))
        return np.array([x[0], y[0], x[-1], y[-1]]), max(first, 0.1), max(last, 1e-3)

    @cached_property
    def _cells(self) -> tuple[list[float], list[tuple[tuple[float, float, float, float], float]]]:
        """Edges in ln z, and for each cell, those beyond both ends too, coefficients of ln F and where they start."""
        spline = self._curve[0]
        (x0, y0, x1, y1), n0, n1 = self._ends
        rows = list(zip(map(tuple, spline.c.T.tolist()), spline.x.tolist(), strict=False))
        below, above = ((0.0, 0.0, n0, float(y0)), float(x0)), ((0.0, 0.0, n1, float(y1)), float(x1))
        return spline.x.tolist(), [below, *rows, above]

    @cached_property
    def _dense(self) -> tuple[Array, Array]:
        return dense(self, self.known_to, self.knots)

    @cached_property
    def _energy(self) -> tuple[Array, Array]:
        """Knots (length), and the energy stored up to each (force * length)."""
        z = self.z
        half = 0.5 * np.diff(z)[:, None]
        cells = (half[:, 0]) * (self.both(z[:-1, None] + half * (1.0 + _CELL_X))[0] @ _CELL_W)
        first = self.F[0] * z[0] / (self._ends[1] + 1.0)
        return z, first + np.concatenate([[0.0], np.cumsum(cells)])

    def _log_values(self, x: Array) -> tuple[Array, Array]:
        (x0, y0, x1, y1), n0, n1 = self._ends
        inside = np.clip(x, x0, x1)
        y, slope = self._curve[0](inside), self._curve[1](inside)
        below, above = x < x0, x > x1
        y = np.where(below, y0 + n0 * (x - x0), np.where(above, y1 + n1 * (x - x1), y))
        return y, np.where(below, n0, np.where(above, n1, slope))


def unload_reload(curve: Any, load: float | None = None, **options: Any) -> TableLaw:
    """Return the physical law of a plastic contact about a preload: the last unload-reload loop of a curve.

    The law is the reloading of the last closed loop, up to the point where its unloading began. Without a closed
    loop it is the last unloading, including that point. The approach is measured from the point where the
    unloading flat separates, found by fitting a power law to the rows.

    Args:
        curve: a `Curve`, CSV file or mapping with delta, force and branch.
        load: preload that the loop must reach (force), or None.
        **options: see `TableLaw`.

    Raises:
        InputError: the curve has no unloading rows, or no branch with enough of them in contact.
        RangeError: no branch reaches the preload.

    Examples:
        A contact that separates at a residual indentation of 0.3:

        >>> up, down = np.linspace(0.0, 1.0, 21), np.linspace(0.95, 0.3, 14)
        >>> curve = {
        ...     "delta": [*up, *down],
        ...     "force": [*up**1.5, *((down - 0.3) / 0.7) ** 1.5],
        ...     "branch": ["load"] * 21 + ["unload"] * 14,
        ... }
        >>> law = asp.unload_reload(curve, load=0.5)
        >>> round(law.origin, 4), round(law.deflection(0.5), 4)
        (0.3, 0.441)
    """
    delta, force, branches = columns(curve)
    found = [] if branches is None else _loops(delta, force, branches)
    if not found:
        raise InputError("the curve has no unloading branch: compute one with loading.unload = true")
    enough = [rows for rows in found if (force[rows] > _TOUCH * force[rows].max()).sum() >= _POINTS] or found
    reaching = [rows for rows in enough if load is None or force[rows].max() >= load]
    if not reaching:
        top = max(float(force[rows].max()) for rows in enough)
        raise RangeError(f"preload = {load:g} exceeds the unload-reload branch, which ends at force {top:g}")
    about = [rows for rows in reaching if load is None or force[rows].min() < load] or reaching
    rows = about[0][np.argsort(delta[about[0]], kind="stable")]
    z, f = delta[rows], force[rows]
    return TableLaw(z, f, origin=fit_origin(z, f), name="unload-reload branch", **options)


def _loops(delta: Array, force: Array, branches: Array) -> list[Array]:
    """Return the rows of closing reloadings, then of unloadings with the row before, each the last one first."""
    legs = np.split(np.arange(len(delta)), np.flatnonzero(branches[1:] != branches[:-1]) + 1)
    up, down = [], []
    top = None  # row at which the last unloading began
    for leg in legs:
        if branches[leg[0]] == "unload":
            top = leg[0] - 1 if leg[0] > 0 else None
            down.append(leg if top is None else np.append(top, leg))
        elif branches[leg[0]] == "reload" and (
            top is None
            or delta[leg].max() >= (1 - _CLOSED) * delta[top]
            or force[leg].max() >= (1 - _CLOSED) * force[top]
        ):
            up.append(leg)
    return [*reversed(up), *reversed(down)]


def columns(curve: Any) -> tuple[Array, Array, Array | None]:
    """Read the columns delta (length), force and branch (or None) of a `Curve`, CSV file or mapping."""
    get = column_of(curve)
    for name in ("delta", "force"):
        if get(name) is None:
            raise InputError(f'the curve has no column "{name}"')
    try:
        delta, force = np.array(get("delta"), float), np.array(get("force"), float)
    except (TypeError, ValueError) as error:
        raise InputError(f"the curve contains something that is not a number: {error}") from error
    branches = get("branch")
    return delta, force, None if branches is None else np.asarray(branches)


def column_of(curve: Any) -> Callable[[str], Any]:
    """Return the function from name to column, None where there is none, of a `Curve`, CSV file or mapping."""
    if isinstance(curve, (str, os.PathLike)):
        table: dict[str, list[str]] = {}
        try:
            with open(curve, newline="", encoding="utf-8") as file:
                reader = csv.DictReader(line for line in file if not line.startswith("#"))
                table = {name: [] for name in reader.fieldnames or ()}
                for row in reader:
                    for name in table:
                        table[name].append(row[name])
        except OSError as error:
            raise InputError(f"cannot read the curve {os.fspath(curve)}: {error.strerror}") from error
        except (UnicodeDecodeError, csv.Error) as error:
            raise InputError(f"the curve {os.fspath(curve)} is not a table of text: {error}") from error
        curve = table
    return curve.get if isinstance(curve, Mapping) else lambda name: getattr(curve, name, None)


def fit_origin(delta: Array, force: Array) -> float:
    """Return the approach of first contact: the best offset of a power law in (ln z, ln F)."""
    order = np.argsort(delta, kind="stable")
    z, f = delta[order], force[order]
    touching = f > _TOUCH * f.max()
    if touching.sum() < _POINTS:
        raise InputError(f"the branch has {int(touching.sum())} rows in contact, at least {_POINTS} are needed")
    first = z[touching][0]
    free = z[~touching]
    span = z[-1] - first
    lowest = float(free.max()) if free.size else first - span
    z, f = z[touching], np.log(f[touching])

    def misfit(offset: float) -> float:
        x = np.log(z - offset)
        c, *_ = np.linalg.lstsq(np.stack([np.ones_like(x), x], axis=1), f, rcond=None)
        return float(np.sum((f - c[0] - c[1] * x) ** 2))

    highest = first - 1e-6 * span
    if lowest >= highest:
        return lowest
    best = minimize_scalar(misfit, bounds=(lowest, highest), method="bounded", options={"xatol": 1e-12 * span})
    return float(best.x)
