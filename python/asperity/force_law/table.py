"""Law through computed or measured points: one cubic Hermite curve in (ln z, ln F), where every power law is straight.

Its slopes are those given (the elastic stiffness of the states), elsewhere those of SciPy's shape-preserving cubic.
Below the first point and beyond the last it is the power law with the slope there. A smoothing spline replaces points
that scatter.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PchipInterpolator, PPoly

from asperity.arrays import Array
from asperity.errors import InputError, RangeError
from asperity.force_law.checks import positive
from asperity.force_law.columns import CurveColumns
from asperity.force_law.law import EXPONENT, SAMPLING, Law, curvature
from asperity.force_law.points import MAX_ROUGHNESS, MIN_POINTS, roughness, smoothed
from asperity.runtime.display import short_repr

_GROUPS = 4  # of points that are left out in turn
_REACHES = 0.4 * 0.5 ** np.arange(9)  # distances in ln z of the divided differences, tried in turn
_UNSEEN = 12.0  # range of kappa between points over that which four points each show; for 95 % of curves of summits
_STEEPEST = 0.9  # largest exponent of the stiffness over the force with which a law begins at zero approach
_SURE = 1.645  # standard deviations that hold 90 % of a normal distribution
_CELL_X, _CELL_W = np.polynomial.legendre.leggauss(10)


@dataclass(frozen=True, eq=False)
class TableLaw(Law):
    """Law through points (z_i, F_i).

    Attributes:
        z: approaches from first contact (length), rising, shape (m,); rows with z <= 0 are dropped
        F: forces, rising with z, shape (m,)
        origin: approach of the curve at first contact (length), subtracted from `z`
        name: name of the law in descriptions
        k: stiffness at the points (force/length), shape (m,), NaN where unknown; None without any
        noise: relative uncertainty of the stiffness through points that scatter, 0 if they do not (derived)

    Raises:
        InputError: the table is empty, too short, not finite, or not rising

    Examples:
        >>> z = np.linspace(0.1, 2.0, 20)
        >>> law = asp.TableLaw(z, z**1.5)
        >>> law.describe(), law.known_to
        ('table, 20 points, interpolated', 2.0)
        >>> f"{law.n_loc(1.0):.4f}, {law.kappa(1.0):.5f}, {law.force(1.05):.4f}"
        '1.5000, -0.04167, 1.0759'
    """

    z: Array
    F: Array
    origin: float = 0.0
    name: str = "table"
    k: Array | None = field(default=None, kw_only=True)
    noise: float = field(default=0.0, init=False)
    known_to: float = field(init=False, repr=False)
    _measured: Array = field(init=False, repr=False)  # the forces given, in contact

    __repr__ = short_repr

    def __post_init__(self) -> None:
        z, F, k = self._checked_points()
        measured, noise = F, 0.0
        if k is None and np.all(np.diff(z) > 0):
            noise = roughness(z, F)
            if noise > MAX_ROUGHNESS:
                F, k = smoothed(z, F)
        sort, smooth = "sort it, or name its unloading in a column branch", "smooth it, or fit a power law to it"
        for name, column, remedy in (("approach", z, sort), ("force", F, smooth)):
            for i in np.flatnonzero(np.diff(column) <= 0):
                pair = f"({column[i]:g} to {column[i + 1]:g})"
                raise InputError(f"the {name} does not rise after row {i} of the table {pair}: {remedy}")
        derived = {"z": z, "F": F, "k": k, "known_to": float(z[-1]), "_measured": measured}
        derived["noise"] = noise if F is not measured else 0.0
        for name, values in derived.items():
            if isinstance(values, np.ndarray):
                values.flags.writeable = False
            object.__setattr__(self, name, values)
        if self.noise and (top := measured.max()) > F[-1]:
            # the curve through scattered points may end below them: it goes on to their force, by one step at most
            farther = z[-1] * (top / F[-1]) ** (1.0 / max(float(self._exponents[-1]), 0.1))
            object.__setattr__(self, "known_to", float(min(farther, 2.0 * z[-1] - z[-2])))

    def _checked_points(self) -> tuple[Array, Array, Array | None]:
        """Points in contact, from first contact."""
        try:
            z, F = np.asarray(self.z, float), np.asarray(self.F, float)
            k = None if self.k is None else np.asarray(self.k, float)
        except (TypeError, ValueError) as error:
            raise InputError(f"the table contains something that is not a number: {error}") from None
        if z.ndim != 1 or z.shape != F.shape or (k is not None and k.shape != z.shape):
            raise InputError(f"a table needs two columns of one length, got shapes {z.shape} and {F.shape}")
        if z.size == 0:
            raise InputError("the table is empty: it needs one row per approach")
        if not (np.isfinite(z).all() and np.isfinite(F).all()):
            raise InputError(f"row {int(np.argmin(np.isfinite(z) & np.isfinite(F)))} of the table is not finite")
        z = z - self.origin
        keep = (z > 0) & (F > 0)
        for i in np.flatnonzero((z > 0) & (F <= 0) & (np.cumsum(keep) > 0)):
            raise InputError(f"row {i} of the table has force {F[i]:g} <= 0 inside the contact")
        gap, early = z[(z > 0) & (F <= 0)].max(initial=0.0), F[z <= 0].max(initial=0.0)
        if early > 1e-6 * F.max() or gap > 1e-9 * z.max():
            raise InputError(
                f"the table has force {early:g} at or below zero approach, and none up to {gap:g}: its origin is "
                "offset; subtract the approach of first contact, or pass it as origin"
            )
        z, F, k = z[keep], F[keep], None if k is None else np.where(k[keep] > 0, k[keep], np.nan)
        least = MIN_POINTS if k is None else 1 if np.isfinite(k).all() else 2
        if z.size < least:
            raise InputError(f"the table has {z.size} usable rows, at least {least} are needed: take more steps")
        return z, F, k

    @classmethod
    def from_curve(cls, curve: Any, *, origin: float = 0.0) -> TableLaw:
        """Law through the loading of a `Curve`, a CSV file or a mapping with the columns delta and force.

        Args:
            curve: source of the columns
            origin: approach of first contact (length)

        Raises:
            InputError: as for `TableLaw`, or the columns cannot be read
        """
        columns = CurveColumns.of(curve)
        return cls(columns.delta[columns.loading], columns.force[columns.loading], origin=origin)

    @classmethod
    def of_stiffness(cls, force: ArrayLike, k: ArrayLike, name: str = "table") -> TableLaw:
        """Integrate dz = dF/k over at least two rising forces with the stiffness k > 0 (force/length), both (m,).

        Between two points the stiffness is a power of the force, and so it is below the first one. The approach is
        measured from where the force vanishes on this law.
        """
        F, stiffness = np.asarray(force, float), np.asarray(k, float)
        p = np.diff(np.log(stiffness)) / np.diff(np.log(F))
        flat = np.abs(1 - p) < 1e-6  # there F/k is constant, and z a logarithm
        power = np.diff(F / stiffness) / np.where(flat, 1.0, 1 - p)
        steps = np.where(flat, F[:-1] / stiffness[:-1] * np.diff(np.log(F)), power)
        start = F[0] / stiffness[0] / (1 - np.clip(p[0], 0.0, _STEEPEST))
        return cls(start + np.append(0.0, np.cumsum(steps)), F, k=stiffness, name=name)

    def scaled(self, force: float = 1.0, stiffness: float | None = None) -> TableLaw:
        """Law with forces and stiffnesses multiplied by factors, the stiffness by default as the force."""
        k = force if stiffness is None else stiffness
        length = force / k
        given = None if self.k is None else self.k * k
        law = replace(self, z=self.z * length, F=self.F * force, origin=0.0, k=given)
        # of points that scatter these are not those of the smoothed points
        derived = {"noise": self.noise, "known_to": self.known_to * length, "_measured": self._measured * force}
        for name, values in derived.items():
            object.__setattr__(law, name, values)
        return law

    @cached_property
    def thinned(self) -> tuple[TableLaw, ...]:
        """The law without every fourth of its points but the last, in all ways; what this changes is its error."""
        every = np.arange(self.z.size)
        groups = [np.setdiff1d(every, every[:-1][i::_GROUPS]) for i in range(min(_GROUPS, self.z.size - 1))]
        return self._of_rows(groups)

    @cached_property
    def coarser(self) -> tuple[tuple[TableLaw, ...], ...]:
        """Of points that scatter: the laws of every second, fourth, eighth ... point and the last, from four starts.

        A smoothing spline hides what its neighbouring points agree on; that of fewer points hides more, and this shows.
        """
        every, laws, step = np.arange(self.z.size), [], 2
        while self.noise and self.z.size >= step * (MIN_POINTS - 1):
            starts = range(0, step, max(step // _GROUPS, 1))
            laws.append(self._of_rows([np.union1d(every[i::step], every[-1:]) for i in starts]))
            step *= 2
        return tuple(laws)

    def _of_rows(self, groups: list[Array]) -> tuple[TableLaw, ...]:
        """The laws of some of the points; where these scatter, without those that are too few or fall once smoothed."""
        laws = []
        for kept in groups:
            F, k = self.F[kept], np.full(kept.size, np.nan) if self.k is None else self.k[kept]
            if not self.noise:
                laws.append(replace(self, z=self.z[kept], F=F, k=k, origin=0.0))
            elif kept.size >= MIN_POINTS:
                F, k = smoothed(self.z[kept], self._measured[kept])
                with suppress(InputError):
                    laws.append(replace(self, z=self.z[kept], F=F, k=k, origin=0.0))
        return tuple(laws)

    @property
    def others(self) -> tuple[TableLaw, ...]:
        """Laws that the points may mean as well: without some of them, and unknown slopes of a cubic spline."""
        unknown = np.full(self.z.size, True) if self.k is None else np.isnan(self.k)
        if not unknown.any():
            return self.thinned
        x = np.log(self.z)
        slopes = CubicSpline(x, np.log(self.F))(x, 1) * self.F / self.z
        return (*self.thinned, replace(self, k=np.where(unknown, slopes, self.slopes), origin=0.0))

    @property
    def top(self) -> float:
        """Largest force of the points."""
        return float(self.F[-1])

    @property
    def default_load(self) -> float:
        return 0.5 * self.top

    def both(self, z: Array) -> tuple[Array, Array]:
        z = np.asarray(z, float)
        s = np.maximum(z, 1e-300)
        force = np.where(z > 0, np.exp(self._curve(np.log(s))), 0.0)
        return force, np.where(z > 0, force * self._curve(np.log(s), 1) / s, 0.0)

    def potential(self, z: ArrayLike) -> Array:
        z = np.maximum(np.asarray(z, float), 0.0)
        energy, n = self._energy
        cell = np.clip(np.searchsorted(self.z, z, side="right") - 1, 0, self.z.size - 1)
        left = self.z[cell]
        half = 0.5 * (z - left)
        inside = half * (self.both(left[..., None] + half[..., None] * (1.0 + _CELL_X))[0] @ _CELL_W)
        return np.where(z < self.z[0], energy[0] * (z / self.z[0]) ** (n + 1.0), energy[cell] + inside)

    def derivatives(self, z: float) -> tuple[float, float, float]:
        """First derivative of the law, and divided differences of ln F over ln z for the others.

        Their reach is the one at which half the reach and half the points change kappa least.
        """
        rows, _, best = self._reaches(z)
        return _derivatives(rows[best], float(self.both(np.array([z]))[0][0]), z)

    def kappa_bar(self, z: float) -> float:
        """How far kappa at `z` is from those of the cubics through four neighbouring points, and how these differ.

        Where summits touch in turn, kappa differs more between two points than the points can tell. Of given slopes and
        points that scatter: how much it differs without some and with few, and, of slopes, for shorter reaches.
        """
        _, kappa, best = self._reaches(z)
        x, i = np.log(self.z / z), int(np.searchsorted(self.z, z))
        bar = 0.0 if self.k is None else float(np.abs(kappa[1:, best] - kappa[0, best]).sum())
        for laws in self.coarser:
            coarse = [curvature(_derivatives(law._differences(z)[best], 1.0, 1.0), 1.0) for law in laws]
            bar += float(np.abs(np.array(coarse) - kappa[0, best]).max(initial=0.0))
        if x.size < 4 or (self.k is not None and not self.noise):
            first, last = max(i - 2, 0), min(i + 1, x.size - 1)
            apart = max((x[last] - x[first]) / max(last - first, 1), _REACHES[-1])
            return bar + float(np.abs(kappa[0, : int(np.sum(apart < 1.5 * _REACHES)) + 1] - kappa[0, best]).max())
        near = []
        for k in range(min(max(i - 4, 0), x.size - 4), min(i + 1, x.size - 3)):
            fit = polynomial.polyfit(x[k : k + 4], np.log(self.F[k : k + 4]), 3)[1:] * (1.0, 2.0, 6.0)
            near.append(curvature(_derivatives(fit, 1.0, 1.0), 1.0))
        return bar + float(np.abs(near - kappa[0, best]).max() + _UNSEEN * np.ptp(near))

    def scatter(self, z: float) -> Array:
        """Relative bars at `z` of n, kappa (none), z and stiffness of points that scatter too little to be smoothed."""
        if self.k is not None or self.z.size < MIN_POINTS:
            return np.zeros(4)
        found, i = roughness(self.z, self.F), int(np.clip(np.searchsorted(self.z, z), 1, self.z.size - 1))
        step = float(np.log(self.z[i] / self.z[i - 1]))  # the scatter in force over the rise is that in z over this
        return found * np.array([1.0, 0.0, _SURE * step / np.sqrt(2.0), 1.0])

    def _reaches(self, z: float) -> tuple[Array, Array, int]:
        """Differences and kappa for each reach, with kappa without some points, and the reach with the least error."""
        rows = [law._differences(z) for law in (self, *self.thinned)]
        kappa = np.array([[curvature(_derivatives(y, 1.0, 1.0), 1.0) for y in row] for row in rows])
        change = np.abs(np.diff(kappa[0]))
        change = np.maximum(change, np.append(0.0, change[:-1]))
        error = change + np.abs(kappa - kappa[0]).sum(axis=0)[:-1]
        return rows[0], kappa, int(error.argmin())

    def without_slopes(self) -> TableLaw:
        """The law by its points alone; `InputError` where they are too few."""
        return replace(self, k=None, origin=0.0)

    def _differences(self, z: float) -> Array:
        """First three derivatives of ln F with respect to ln z for each reach, shape (reaches, 3)."""
        x, h = np.log(z), _REACHES
        low, mid, high = (np.asarray(self._curve(v)) for v in (x - h, np.full(h.size, x), x + h))
        first = np.full(h.size, float(self._curve(x, 1)))
        return np.stack([first, (high - 2 * mid + low) / h**2, 6 * ((high - low) / (2 * h) - first) / h**2], axis=1)

    def cells(self, about: float, rtol: float = SAMPLING) -> tuple[Array, Array]:
        curve = self._curve  # its outer cells, of which the edges are no points, are straight
        own = curve.x[1:-1], np.column_stack([curve.x[:-1], curve.c[::-1].T])
        return own if rtol <= SAMPLING else min(own, super().cells(about, rtol), key=lambda cells: cells[0].size)

    def deflection(self, load: float) -> float:
        below = float(self._curve.c[2, 0])
        if load < self.F[0] and below < 1.0:
            raise RangeError(
                f"load = {load:g} lies below the first point of the table (force {self.F[0]:g}), where the force "
                f"rises with the power {below:.3g} of the approach, and the stiffness would rise as the load "
                "falls: give points at lighter loads, or the approach of first contact as origin"
            )
        at_point = np.flatnonzero(np.abs(self.F / positive("load", load) - 1.0) < 1e-12)
        return float(self.z[at_point[0]]) if at_point.size else super().deflection(load)

    def doubts(self, load: float) -> tuple[str, ...]:
        if load < self.F[0]:
            return (
                f"load {load:g} lies below the first point of the table (force {self.F[0]:g}): the law there is the "
                f"power {self._curve.c[2, 0]:.3g} of the approach, that of the first points",
            )
        if not self.noise:
            return ()
        return (
            f"the points scatter so that the stiffness through them is uncertain by {100 * self.noise:.0f} %: the "
            "table is noisy, and the law a smoothing spline through it",
        )

    def describe(self) -> str:
        return f"{self.name}, {self.z.size} points, {'smoothed' if self.noise else 'interpolated'}"

    @cached_property
    def slopes(self) -> Array:
        """Stiffness at the points (force/length), shape (m,)."""
        return self._exponents * self.F / self.z

    @cached_property
    def _exponents(self) -> Array:
        """Slopes d ln F / d ln z at the points, so small that the law rises between them."""
        x, y = np.log(self.z), np.log(self.F)
        known = np.full(x.size, np.nan) if self.k is None else self.k * self.z / self.F
        if x.size == 1:
            return known
        slopes = np.where(np.isnan(known), PchipInterpolator(x, y).derivative()(x), known)
        secants = np.diff(y) / np.diff(x)
        steepest = 3.0 * np.minimum(np.append(secants[0], secants), np.append(secants, secants[-1]))
        return np.asarray(np.clip(slopes, 1e-3 * steepest, steepest))

    @cached_property
    def _curve(self) -> PPoly:
        """ln F over ln z, straight in the first and the last cell, below and beyond the points."""
        x, y, slopes = np.log(self.z), np.log(self.F), self._exponents
        ends = np.array([x[0] - 1.0, *x, x[-1] + 1.0])  # the outer cells continue to all z
        first, last = max(float(slopes[0]), EXPONENT[0]), float(slopes[-1])
        curve = CubicHermiteSpline(ends, [y[0] - first, *y, y[-1] + last], [first, *slopes, last])
        curve.c[:2, [0, -1]] = 0.0
        return curve

    @cached_property
    def _energy(self) -> tuple[Array, float]:
        """Energy stored up to each point (force * length), and the exponent below the first."""
        z, n = self.z, float(self._curve.c[2, 0])
        half = 0.5 * np.diff(z)[:, None]
        cells = half[:, 0] * (self.both(z[:-1, None] + half * (1.0 + _CELL_X))[0] @ _CELL_W)
        return self.F[0] * z[0] / (n + 1.0) + np.append(0.0, np.cumsum(cells)), n


def _derivatives(y: Array, force: float, z: float) -> tuple[float, float, float]:
    """Derivatives of F from those of ln F with respect to ln z."""
    a, b, c = (float(value) for value in y)
    third = a**3 - 3 * a * a + 2 * a + 3 * b * (a - 1) + c
    return a * force / z, (a * a - a + b) * force / z**2, third * force / z**3
