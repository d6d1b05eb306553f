"""The law through the points of a curve, and the same law at the ends of its errors."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator, PPoly
from scipy.special import exprel

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.runtime.display import short_repr
from asperity.vibration.law import EXPONENT, Law
from asperity.vibration.local_fit import Local, LocalFit

MIN_POINTS = 5  # of a law without slopes
_STEEPEST = 0.9  # largest exponent of the stiffness over the force with which a law begins at zero approach
_REACHES = (np.inf, 0.4, 0.1, 0.025)  # distances in ln z from which points tell the curvature
_FEW, _MANY = 12, 100  # points, and slopes, that tell it, and points that suffice
_STIFFEST = 9.0  # times stiffer is a side at most: its bar says nothing
_BENT = 3.0  # of a side whose curvature is not resolved: its force still rises
_FLOOR = 1e-3  # of the bar of kappa
_APART = 1.25  # times the difference of curve and local fit, neither of which is exact
_UNSEEN = 3.0  # times the bars of scatter: points that are computed do not show by scatter what lies between them


class Bars(NamedTuple):
    """Errors of a law at a load (force): of its force and stiffness over them, of its approach (length), of kappa."""

    load: float
    force: float = 0.0
    approach: float = 0.0
    stiffness: float = 0.0
    kappa: float = 0.0


@dataclass(frozen=True, eq=False)
class CurveLaw(Law):
    """Law through points: a monotone cubic in (ln z, ln F), where every power law is straight.

    Its slopes are those given, elsewhere those of SciPy's shape-preserving cubic. Below the first point and beyond the
    last it is the power law with the slope there. Second and third derivatives are those of `LocalFit`.

    Attributes:
        z: approaches (length), rising, shape (m,); points with z <= origin are dropped
        F: forces, rising with z, shape (m,)
        origin: approach of first contact (length), subtracted from `z`
        name: name of the law in descriptions
        k: stiffness at the points (force/length), shape (m,), NaN where unknown; None without any
        bars: errors about one load, see `about`; None without any
        bends: load (force), F''/F' (1/length) and F'''/F' (1/length^2) at it; None where the points tell them

    Raises:
        InputError: the points are too few, not finite, or do not rise

    Examples:
        >>> z = np.linspace(0.1, 2.0, 20)
        >>> law = asp.CurveLaw(z, z**1.5)
        >>> law.describe(), law.known_to
        ('curve through 20 points', 2.0)
        >>> f"{law.n_loc(1.0):.4f}, {law.kappa(1.0):.5f}, {law.force(1.05):.4f}"
        '1.5000, -0.04167, 1.0759'
    """

    z: Array
    F: Array
    origin: float = 0.0
    name: str = "curve"
    k: Array | None = field(default=None, kw_only=True)
    bars: Bars | None = field(default=None, kw_only=True)
    bends: tuple[float, float, float] | None = field(default=None, kw_only=True)
    known_to: float = field(init=False, repr=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        z, F = np.asarray(self.z, float) - self.origin, np.asarray(self.F, float)
        k = np.full(z.shape, np.nan) if self.k is None else np.asarray(self.k, float)
        if z.ndim != 1 or z.shape != F.shape or k.shape != z.shape:
            raise InputError(f"a law needs columns of one length, got shapes {z.shape}, {F.shape} and {k.shape}")
        if not (np.isfinite(z).all() and np.isfinite(F).all()):
            raise InputError(f"point {int(np.argmin(np.isfinite(z) & np.isfinite(F)))} of the law is not finite")
        if (early := float(F[z <= 0].max(initial=0.0))) > 1e-6 * F.max(initial=0.0):
            raise InputError(
                f"the points have force {early:g} at or below zero approach: subtract the approach of first contact, "
                "or pass it as origin"
            )
        keep = (z > 0) & (F > 0)
        z, F, k = z[keep], F[keep], np.where(k[keep] > 0, k[keep], np.nan)
        least = MIN_POINTS if np.isnan(k).all() else 1 if np.isfinite(k).all() else 2
        if z.size < least:
            raise InputError(f"the law has {z.size} points in contact, at least {least} are needed: take more steps")
        for name, column in (("approach", z), ("force", F)):
            for i in np.flatnonzero(np.diff(column) <= 0):
                pair = f"({column[i]:g} to {column[i + 1]:g})"
                raise InputError(f"the {name} does not rise after point {i} of the law {pair}: sort or smooth it")
        derived = {"z": z, "F": F, "k": None if np.isnan(k).all() else k, "origin": 0.0, "known_to": float(z[-1])}
        for name, values in derived.items():
            object.__setattr__(self, name, values)

    @classmethod
    def of_stiffness(cls, force: ArrayLike, k: ArrayLike, name: str = "curve") -> CurveLaw:
        """Integrate dz = dF/k over at least two rising forces with the stiffness k > 0 (force/length), both (m,).

        Between two points the stiffness is a power of the force, and so it is below the first one. The approach is
        measured from where the force vanishes on this law.
        """
        F, stiffness = np.asarray(force, float), np.asarray(k, float)
        rise, more = np.diff(np.log(F)), np.diff(np.log(F / stiffness))
        start = F[0] / stiffness[0] / (1 - np.clip(1 - more[0] / rise[0], 0.0, _STEEPEST))
        steps = F[:-1] / stiffness[:-1] * exprel(more) * rise
        return cls(start + np.append(0.0, np.cumsum(steps)), F, k=stiffness, name=name)

    def about(
        self,
        load: float,
        fit: LocalFit | None = None,
        *,
        force: float = 0.0,
        stiffness: float = 0.0,
        origin: float = 0.0,
    ) -> CurveLaw:
        """Law with its errors at a load: those given, and what its points leave open.

        Args:
            load: preload (force)
            fit: of the rows whose scatter is the error; None for computed points
            force, stiffness: known errors over them
            origin: error of the approach of first contact (length)
        """
        z = self.deflection(load)
        local, unseen = (self._local(z), _UNSEEN) if fit is None else (fit.at(load), 1.0)
        law = replace(self, bends=(load, local.second / z, local.third / z**2))
        off = np.abs([np.log(z) - local.x, 0.0, np.log(law.at(z)[1]) - local.log_k, law.kappa(z) - local.kappa])
        of_z, _, of_k, of_kappa = unseen * local.bars + _APART * off
        bars = Bars(load, force, np.hypot(origin, z * of_z), np.hypot(stiffness, of_k), of_kappa + _FLOOR)
        return replace(law, bars=bars)

    def sides(self) -> tuple[tuple[Law, Law], ...]:
        if self.bars is None:
            return ()
        load, force, approach, stiffness, kappa = self.bars
        z = self.deflection(load)
        bent = 16.0 * kappa / self.n_loc(z) ** 2
        pairs = (
            (self._side(load, factor=-force), self._side(load, factor=force)),
            (self._side(load, shift=-min(approach, 0.9 * z)), self._side(load, shift=approach)),
            (self._side(load, tilt=-min(stiffness, 0.9)), self._side(load, tilt=min(stiffness, _STIFFEST))),
            (self._side(load, bend=-bent), self._side(load, bend=bent)),
        )
        return tuple(pair for pair, bar in zip(pairs, self.bars[1:], strict=True) if bar > 0.0)

    def _side(
        self, load: float, factor: float = 0.0, shift: float = 0.0, tilt: float = 0.0, bend: float = 0.0
    ) -> CurveLaw:
        """Law at one end of an error: with Y = ln(F/load), load exp(g(Y)) at the approach and a shift.

        ``g = ln(1 + factor) + (1 + tilt) (Y + bend/6 Y^3 exp(-Y^2/2))``: the load keeps its stiffness but for the
        factor and the tilt, and `bend` changes kappa by bend n^2/16. Away from the load a bend is at most `_BENT`.
        """
        z_s = self.deflection(load)
        z = np.union1d(self.z[np.abs(self.z / z_s - 1.0) > 1e-6], z_s)  # the load is a point of the side
        F, k = self.force(z), self.slope(z)
        Y, (first, second, third) = np.log(F / load), self.derivatives(z_s)
        bump = np.clip(bend, -_BENT, _BENT) / 6.0 * np.exp(-0.5 * Y * Y)
        g = np.log1p(factor) + (1.0 + tilt) * (Y + bump * Y**3)
        rate = (1.0 + tilt) * (1.0 + bump * (3.0 * Y**2 - Y**4))
        moved, m = load * np.exp(g), first / load
        bends = (
            load, second / first + tilt * m,
            third / first + 3.0 * tilt * m * second / first + (tilt * (tilt - 1.0) + bend) * m * m,
        )  # fmt: skip
        on = z + shift > 0.0
        return CurveLaw((z + shift)[on], moved[on], name=self.name, k=(k * rate * moved / F)[on], bends=bends)

    @property
    def knots(self) -> Array:  # type: ignore[override]
        return self.z

    def force(self, z: ArrayLike) -> Array:
        z = np.asarray(z, float)
        return np.where(z > 0, np.exp(self._curve(np.log(np.maximum(z, 1e-300)))), 0.0)

    def slope(self, z: ArrayLike) -> Array:
        z = np.asarray(z, float)
        s = np.maximum(z, 1e-300)
        return np.where(z > 0, self.force(s) * self._curve(np.log(s), 1) / s, 0.0)

    def derivatives(self, z: float) -> tuple[float, float, float]:
        force, slope = self.at(z)
        if self.bends is not None and abs(force / self.bends[0] - 1.0) < 1e-9:
            return slope, slope * self.bends[1], slope * self.bends[2]
        local = self._local(z)
        return slope, slope * local.second / z, slope * local.third / z**2

    def describe(self) -> str:
        return f"{self.name} through {self.z.size} points"

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
    def _found(self) -> dict[float, Local]:
        """Results of `_local` by approach."""
        return {}

    def _local(self, z: float) -> Local:
        """Results at z by the points within the distance in ln z that leaves kappa the least bar."""
        if z in self._found:
            return self._found[z]
        x, load = np.log(self.z / z), self.at(z)[0]
        known = np.full(x.size, np.nan) if self.k is None else self.k * self.z / self.F
        found: list[Local] = []
        for reach in _REACHES:
            near = np.flatnonzero(np.abs(x) <= reach)
            near = near[:: 1 + near.size // _MANY]
            if found and near.size + np.isfinite(known[near]).sum() < _FEW:
                break
            found.append(LocalFit(self.z[near], self.F[near], known[near]).at(load))
        self._found[z] = min(found, key=lambda local: float(local.bars[3]))
        return self._found[z]

    @cached_property
    def _curve(self) -> PPoly:
        """ln F over ln z, straight in the first and the last cell, below and beyond the points."""
        x, y, slopes = np.log(self.z), np.log(self.F), self._exponents
        ends = np.array([x[0] - 1.0, *x, x[-1] + 1.0])  # the outer cells continue to all z
        first, last = max(float(slopes[0]), EXPONENT[0]), float(slopes[-1])
        curve = CubicHermiteSpline(ends, [y[0] - first, *y, y[-1] + last], [first, *slopes, last])
        curve.c[:2, [0, -1]] = 0.0
        return curve
