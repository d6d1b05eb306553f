"""The law through the points of a curve, and the same law at the ends of its errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PchipInterpolator, PPoly

from asperity.arrays import Array
from asperity.errors import InputError, RangeError
from asperity.runtime.display import short_repr
from asperity.vibration.checks import positive
from asperity.vibration.law import EXPONENT, Law
from asperity.vibration.local_fit import Local, LocalFit

MIN_POINTS = 5  # of a law without slopes
_STEEPEST = 0.9  # largest exponent of the stiffness over the force with which a law begins at zero approach
_REACHES = 0.8 * 0.5 ** np.arange(6)  # distances in ln z from which points tell the curvature
_FEW = 12  # points, and slopes, that tell it
_BENT = 3.0  # of a side whose curvature is not resolved
_FLOOR = 1e-3  # of the bar of kappa
_UNSEEN = 3.0  # times the bars of scatter: points that are computed do not show by scatter what lies between them
_CELL_X, _CELL_W = np.polynomial.legendre.leggauss(10)


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
    known_to: float = field(init=False, repr=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        z, F = np.asarray(self.z, float) - self.origin, np.asarray(self.F, float)
        k = np.full(z.shape, np.nan) if self.k is None else np.asarray(self.k, float)
        if z.ndim != 1 or z.shape != F.shape or k.shape != z.shape:
            raise InputError(f"a law needs columns of one length, got shapes {z.shape}, {F.shape} and {k.shape}")
        if not (np.isfinite(z).all() and np.isfinite(F).all()):
            raise InputError(f"point {int(np.argmin(np.isfinite(z) & np.isfinite(F)))} of the law is not finite")
        keep = (z > 0) & (F > 0)
        if (early := float(F[z <= 0].max(initial=0.0))) > 1e-6 * F.max(initial=0.0):
            raise InputError(
                f"the points have force {early:g} at or below zero approach: subtract the approach of first contact, "
                "or pass it as origin"
            )
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
        p = np.diff(np.log(stiffness)) / np.diff(np.log(F))
        flat = np.abs(1 - p) < 1e-6  # there F/k is constant, and z a logarithm
        power = np.diff(F / stiffness) / np.where(flat, 1.0, 1 - p)
        steps = np.where(flat, F[:-1] / stiffness[:-1] * np.diff(np.log(F)), power)
        start = F[0] / stiffness[0] / (1 - np.clip(p[0], 0.0, _STEEPEST))
        return cls(start + np.append(0.0, np.cumsum(steps)), F, k=stiffness, name=name)

    def about(self, load: float, force: float = 0.0, stiffness: float = 0.0) -> CurveLaw:
        """Law with its errors at a load: those of force and stiffness over them, and what its points leave open."""
        z = self.deflection(load)
        local = self._local(z)
        off = np.abs([np.log(self.at(z)[1]) - local.log_k, self.kappa(z) - local.kappa])
        of_k = float(np.hypot(stiffness, _UNSEEN * local.bars[2] + 1.25 * off[0]))
        of_z = z * (_UNSEEN * local.bars[0] + abs(float(np.log(z)) - local.x))
        return replace(self, bars=Bars(load, force, of_z, of_k, _UNSEEN * local.bars[3] + float(off[1]) + _FLOOR))

    def sides(self) -> tuple[tuple[Law, Law], ...]:
        if self.bars is None:
            return ()
        load, force, approach, stiffness, kappa = self.bars
        bend = 16.0 * kappa / self.n_loc(self.deflection(load)) ** 2
        sides = (
            (force, {"factor": force}), (approach, {"shift": approach}),
            (stiffness, {"tilt": min(stiffness, 0.9)}), (kappa, {"bend": min(bend, _BENT)}),
        )  # fmt: skip
        return tuple(
            (Side(self, load, **{n: -v for n, v in by.items()}), Side(self, load, **by))
            for bar, by in sides
            if bar > 0.0
        )

    @property
    def top(self) -> float:
        """Largest force of the points."""
        return float(self.F[-1])

    @property
    def default_load(self) -> float:
        return 0.5 * self.top

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

    def potential(self, z: ArrayLike) -> Array:
        z = np.asarray(np.maximum(z, 0.0), float)
        energy, n = self._energy
        cell = np.clip(np.searchsorted(self.z, z, side="right") - 1, 0, self.z.size - 1)
        inside = _work(self.force, self.z[cell], z)
        return np.where(z < self.z[0], energy[0] * (z / self.z[0]) ** (n + 1.0), energy[cell] + inside)

    def derivatives(self, z: float) -> tuple[float, float, float]:
        force, slope = self.at(z)
        _, b, c = self._local(z).exponents
        return of_exponents(z * slope / force, b, c, force, z)

    def deflection(self, load: float) -> float:
        below = float(self._curve.c[2, 0])
        if load < self.F[0] and below < 1.0:
            raise RangeError(
                f"load = {load:g} lies below the first point of the law (force {self.F[0]:g}), where the force "
                f"rises with the power {below:.3g} of the approach, and the stiffness would rise as the load "
                "falls: give points at lighter loads, or the approach of first contact as origin"
            )
        at_point = np.flatnonzero(np.abs(self.F / positive("load", load) - 1.0) < 1e-12)
        return float(self.z[at_point[0]]) if at_point.size else super().deflection(load)

    def doubts(self, load: float) -> tuple[str, ...]:
        if load >= self.F[0]:
            return ()
        return (
            f"load {load:g} lies below the first point of the law (force {self.F[0]:g}): the law there is the power "
            f"{self._curve.c[2, 0]:.3g} of the approach, as at the first points",
        )

    def describe(self) -> str:
        return f"{self.name} through {self.z.size} points"

    @cached_property
    def slopes(self) -> Array:
        """Stiffness at the points (force/length), shape (m,)."""
        return self._exponents * self.F / self.z

    @cached_property
    def _known(self) -> Array:
        return np.full(self.z.size, np.nan) if self.k is None else self.k * self.z / self.F

    @cached_property
    def _exponents(self) -> Array:
        """Slopes d ln F / d ln z at the points, so small that the law rises between them."""
        x, y, known = np.log(self.z), np.log(self.F), self._known
        if x.size == 1:
            return known
        slopes = np.where(np.isnan(known), PchipInterpolator(x, y).derivative()(x), known)
        secants = np.diff(y) / np.diff(x)
        steepest = 3.0 * np.minimum(np.append(secants[0], secants), np.append(secants, secants[-1]))
        return np.asarray(np.clip(slopes, 1e-3 * steepest, steepest))

    @cached_property
    def _found(self) -> dict[int, LocalFit]:
        return {}

    def _local(self, z: float) -> Local:
        """Results at z by the points within the distance in ln z that leaves kappa the least bar."""
        x, load = np.log(self.z / z), self.at(z)[0]
        if (nearest := int(np.argmin(np.abs(x)))) not in self._found:
            tried: list[tuple[float, LocalFit]] = []
            for reach in (np.inf, *_REACHES):
                near = np.abs(x) <= reach
                if tried and near.sum() + np.isfinite(self._known[near]).sum() < _FEW:
                    break
                fit = LocalFit(self.z[near], self.F[near], exponents=self._known[near])
                tried.append((fit.at(load).bars[3], fit))
            self._found[nearest] = min(tried, key=lambda one: one[0])[1]
        return self._found[nearest].at(load)

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
        cells = _work(self.force, z[:-1], z[1:])
        return self.F[0] * z[0] / (n + 1.0) + np.append(0.0, np.cumsum(cells)), n


@dataclass(frozen=True, eq=False)
class Side(Law):
    """Law at one end of an error: with Y = ln(F/load) of a law, load exp(g(Y)) at the approach less a shift.

    ``g' = (1 + tilt) exp(bend Y^2/2 exp(-Y^2/2))``, g(0) = ln(1 + factor): the load keeps its stiffness but for the
    factor and the tilt, and `bend` changes kappa by bend n^2/16. The force rises as that of the law does, and has
    no end: at the end of a law its lower side would not reach the preload.
    """

    law: Law
    load: float
    factor: float = 0.0
    shift: float = 0.0
    tilt: float = 0.0
    bend: float = 0.0

    @property
    def knots(self) -> Array:  # type: ignore[override]
        return np.asarray(self.law.knots + self.shift)

    def force(self, z: ArrayLike) -> Array:
        Y, touching = self._level(z)
        return np.where(touching, self.load * np.exp(self._map(Y)[0]), 0.0)

    def slope(self, z: ArrayLike) -> Array:
        (Y, touching), s = self._level(z), np.asarray(z, float) - self.shift
        force = self.load * np.exp(self._map(Y)[0])
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(touching, force * self._map(Y)[1] * self.law.slope(s) / self.law.force(s), 0.0)

    def potential(self, z: ArrayLike) -> Array:
        z = np.asarray(np.maximum(z, 0.0), float)
        top = float(z.max())
        knots = np.unique(np.concatenate([[0.0], self.knots[self.knots > 0.0], np.geomspace(1e-6, 1.0, 60) * top]))
        energy = np.append(0.0, np.cumsum(_work(self.force, knots[:-1], knots[1:])))
        cell = np.clip(np.searchsorted(knots, z, side="right") - 1, 0, knots.size - 1)
        return energy[cell] + _work(self.force, knots[cell], z)

    def derivatives(self, z: float) -> tuple[float, float, float]:
        s = z - self.shift
        force, p = self.law.at(s)[0], self.law.derivatives(s)
        q = [p[0] / force, p[1] / force, p[2] / force]  # of ln F by z
        a, b = q[0], q[1] - q[0] ** 2
        c = q[2] - 3.0 * q[0] * q[1] + 2.0 * q[0] ** 3
        Y, h = np.log(force / self.load), 1e-4
        first, low, high = (float(self._map(np.array([v]))[1][0]) for v in (Y, Y - h, Y + h))
        second, third = (high - low) / (2.0 * h), (high - 2.0 * first + low) / h**2
        a, b, c = first * a, second * a * a + first * b, third * a**3 + 3.0 * second * a * b + first * c
        F = self.at(z)[0]
        return F * a, F * (a * a + b), F * (a**3 + 3.0 * a * b + c)

    def describe(self) -> str:
        return f"{self.law.describe()}, at an end of its error bar"

    def _level(self, z: ArrayLike) -> tuple[Array, Array]:
        force = self.law.force(np.asarray(z, float) - self.shift)
        touching = force > 0.0
        return np.log(np.where(touching, force, self.load) / self.load), touching

    def _map(self, Y: Array) -> tuple[Array, Array]:
        """G and its derivative at Y."""
        level = np.log1p(self.factor) + (1.0 + self.tilt) * Y
        if not self.bend:
            return level, np.full(np.shape(Y), 1.0 + self.tilt)
        grid, growth = _bent(self.bend)
        rate = np.exp(0.5 * self.bend * Y**2 * np.exp(-0.5 * Y**2))
        return level + (1.0 + self.tilt) * growth(np.clip(Y, grid[0], grid[-1])), (1.0 + self.tilt) * rate


@cache
def _bent(bend: float) -> tuple[Array, PPoly]:
    """Integral of g' - 1 of a bend over Y, beyond whose ends it is constant."""
    Y = np.linspace(-8.0, 8.0, 1601)
    rate = CubicSpline(Y, np.expm1(0.5 * bend * Y**2 * np.exp(-0.5 * Y**2)))
    integral = rate.antiderivative()
    integral.c[-1] -= float(integral(0.0))
    return Y, integral


def of_exponents(a: float, b: float, c: float, force: float, z: float) -> tuple[float, float, float]:
    """Derivatives of F at z from those of ln F with respect to ln z."""
    third = a**3 - 3 * a * a + 2 * a + 3 * b * (a - 1) + c
    return a * force / z, (a * a - a + b) * force / z**2, third * force / z**3


def _work(force: Callable[[Array], Array], start: Array, end: Array) -> Array:
    """Integral of a force from each approach to another, by Gauss' rule of ten points."""
    half = 0.5 * (end - start)
    return half * (force(start[..., None] + half[..., None] * (1.0 + _CELL_X)) @ _CELL_W)
