"""Exponent, stiffness and curvature of a force through points at a load, with the scatter of the points as their bar.

ln F over x = ln z is a straight line, a power law, and a sum of bumps of one width. Widths, sizes of the bumps and the
approach of first contact are not chosen: each has its likelihood by the points, and all results are means over them
(Bayesian model averaging; O'Hagan, J. R. Stat. Soc. B 40 (1978) 1, for the prior of a curve).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from asperity.arrays import Array
from asperity.errors import InputError

WIDTHS, SIZES = (0.15, 0.4, 1.0, 2.5), (0.03, 0.15, 0.6, 2.0)  # of the bumps, in ln z and in ln F
#: Standard deviations that make a bar: the bars hold in 90 of 100 draws of each family, see benchmarks/measured.py.
BAR = 3.0
_PRIOR = ((0.0, 1e-4), (1.7, 4.0))  # mean and weight of ln F at the last point (no matter) and of the exponent
_LOWEST = -7.0  # ln z over that of the last point, below which there are no bumps
_GROUPS = 100  # of points that are averaged
_GRID = 15  # approaches of first contact
_NAMED = 25.0  # ln of the odds that rows without scatter name first contact: the last without force, or zero
_LIKELY = 12.0  # ln of the likelihood over that of the best, beyond which a contact point is left out
_LEAST = 1e-9, 1e-5  # noise of computed points over them, and of an instrument over the greatest force


class Local(NamedTuple):
    """ln z, ln k, exponents d^i ln F/d(ln z)^i and kappa at a load, and the bars of ln z, n, ln k and kappa."""

    x: float
    log_k: float
    exponents: tuple[float, float, float]
    kappa: float
    bars: tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class _Part:
    """One width, size and contact point: its fit, with covariance."""

    likelihood: float
    w: Array
    covariance: Array
    centres: Array
    width: float
    origin: float
    end: float  # approach of the last point from first contact
    noise: float


def curvature_of(a: float, b: float, c: float) -> float:
    """Kappa from d^i ln F/d(ln z)^i, see `Law.kappa`."""
    second, third = (a * a - a + b) / a, (a**3 - 3 * a * a + 2 * a + 3 * b * (a - 1) + c) / a
    return (3.0 * third - 5.0 * second**2) / 48.0


def _basis(x: Array, centres: Array, width: float, order: int) -> Array:
    """Derivative of line and bumps at x (m,), (m, 2 + bumps)."""
    t = (x[:, None] - centres) / width
    factor: Any = (1.0, -t, t * t - 1.0, 3.0 * t - t**3)[order]
    line = np.zeros((x.size, 2))
    line[:, 0], line[:, 1] = (order == 0), (x if order == 0 else float(order == 1))
    return np.column_stack([line, factor / width**order * np.exp(-0.5 * t * t)])


class LocalFit:
    """Fit of points (delta, force) of a rising contact.

    Args:
        delta, force: approach (length) and force (m,), in the order of the approach
        origin: approach of first contact; None finds it, with the rows before, whose force is noise about zero
        exponents: d ln F/d ln z at the points (m,), NaN where unknown; None without any
        relative: whether the scatter is a share of each force, as of computed points, or of one size

    Raises:
        InputError: too few points in contact
    """

    def __init__(
        self, delta: Array, force: Array, *, origin: float | None = 0.0, exponents: Array | None = None,
        relative: bool = True,
    ) -> None:  # fmt: skip
        self._slopes = exponents if exponents is not None and np.isfinite(exponents).any() else None
        self._relative = relative
        count: Array = np.ones(delta.size)
        if not relative and delta.size > _GROUPS:
            groups = np.array_split(np.arange(delta.size), _GROUPS)
            count = np.array([float(len(rows)) for rows in groups])
            delta, force = (np.array([column[rows].mean() for rows in groups]) for column in (delta, force))
        self._delta, self._count, self._top = delta, count, float(np.sort(force)[-3:].mean())
        self._force = force / self._top
        self._named: list[float] = []
        models = [(1.0, 0.0), *product(WIDTHS, SIZES)]
        found = [self._fit(at, *m) for at in self._contacts(origin) for m in models]
        parts = [part for part in found if part is not None and np.isfinite(part.likelihood)]
        if not parts:
            raise InputError(f"the curve has {delta.size} rows, too few in contact: at least 4 are needed")
        exact = 2.0 * _LEAST[not relative]
        parts = [
            replace(part, likelihood=part.likelihood + _NAMED)
            if part.origin in self._named and part.noise < exact
            else part
            for part in parts
        ]
        best = max(part.likelihood for part in parts)
        parts = [part for part in parts if part.likelihood > best - 9.0]
        self._parts = parts
        self._weights = np.array([np.exp(part.likelihood - best) for part in parts])
        self._weights /= self._weights.sum()

    @property
    def origin(self) -> tuple[float, float]:
        """Approach of first contact and its bar (length)."""
        at = np.array([part.origin for part in self._parts])
        mean = float(self._weights @ at)
        return mean, BAR * float(np.sqrt(self._weights @ (at - mean) ** 2))

    @property
    def noise(self) -> float:
        """Standard deviation of the scatter (force), or over the force of each point where that is its scale."""
        return float(self._weights @ [part.noise for part in self._parts]) * (1.0 if self._relative else self._top)

    def curve(self, z: Array) -> tuple[Array, Array]:
        """Mean force and exponent d ln F/d ln z at approaches from first contact > 0 (m,)."""
        value, slope = np.zeros(z.size), np.zeros(z.size)
        for weight, part in zip(self._weights, self._parts, strict=True):
            x = np.log(z / part.end)
            value += weight * (_basis(x, part.centres, part.width, 0) @ part.w)
            slope += weight * (_basis(x, part.centres, part.width, 1) @ part.w)
        return self._top * np.exp(value), slope

    def at(self, load: float) -> Local:
        """Results at a load (force)."""
        values, spread, width_of = [], [], []
        for part in self._parts:
            x, fit = 0.0, (part.centres, part.width)
            for _ in range(60):
                level, n = (float(_basis(np.array([x]), *fit, i)[0] @ part.w) for i in (0, 1))
                step = float(np.clip((np.log(load / self._top) - level) / max(n, 0.2), -0.3, 0.3))
                x += step
                if abs(step) < 1e-13:
                    break
            rows = np.array([_basis(np.array([x]), *fit, i)[0] for i in range(4)])
            a, b, c = (float(v) for v in rows[1:] @ part.w)
            move = -rows[0] / a  # of x by the coefficients
            by_a, by_b, by_c = rows[1] + b * move, rows[2] + c * move, rows[3]
            h = 1e-5
            partial = [
                (curvature_of(a + i * h, b + j * h, c + k * h) - curvature_of(a - i * h, b - j * h, c - k * h))
                / (2 * h)
                for i, j, k in np.eye(3)
            ]
            to = np.array([move, by_a, by_a / a - move, np.array(partial) @ [by_a, by_b, by_c]])
            x += np.log(part.end)
            values.append([x, a, np.log(a * load) - x, curvature_of(a, b, c), b, c])
            spread.append(to @ part.covariance @ to.T)
            width_of.append(part.width)
        found, w = np.array(values), self._weights
        mean = w @ found
        variance = w @ [np.diag(v) for v in spread] + w @ (found[:, :4] - mean[:4]) ** 2
        # bumps of another width tell what no scatter shows
        best = int(np.argmax(w))
        others = [i for i, width in enumerate(width_of) if width != width_of[best]]
        apart = np.abs(found[max(others, key=lambda i: w[i])] - found[best])[:4] if others else np.zeros(4)
        bars = BAR * np.sqrt(np.maximum(variance, 0.0)) + apart
        x, a, log_k, kappa, b, c = (float(value) for value in mean)
        return Local(x, log_k, (a, b, c), kappa, (float(bars[0]), float(bars[1]), float(bars[2]), float(bars[3])))

    def _contacts(self, origin: float | None) -> Array:
        """Approaches of first contact that the points allow."""
        d, f = self._delta, self._force
        if origin is not None:
            return np.array([origin])
        low = d[0] - 2.0 * (d[-1] - d[0])
        high = d[int(np.argmax(np.maximum.accumulate(f) >= 0.5 * f.max()))]
        lowest, highest = low, high
        tried = [(1.0, 0.0), *zip(WIDTHS, SIZES, strict=True)]
        for _ in range(12):
            grid = np.linspace(low, high, _GRID)
            best = [max((p.likelihood for m in tried if (p := self._fit(at, *m))), default=-np.inf) for at in grid]
            likely = np.flatnonzero(np.array(best) > max(best) - _LIKELY)
            if likely.size == 0:
                break
            low, high = grid[max(likely[0] - 1, 0)], grid[min(likely[-1] + 1, _GRID - 1)]
            if likely.size > _GRID // 2:
                break
        self._named = [float(at) for at in (0.0, *d[:-1][f[:-1] == 0.0][-1:]) if lowest < at < highest]
        return np.unique(np.append(np.linspace(low, high, _GRID), self._named))

    def _fit(self, origin: float, width: float, size: float) -> _Part | None:
        """Most likely bumps of one width and size for a contact point; None where too few points are in contact."""
        on = self._delta > origin + 1e-9 * (self._delta[-1] - origin)
        known = np.isfinite(self._slopes[on]) if self._slopes is not None and self._relative else np.zeros(0, bool)
        if not on.any() or on.sum() + known.sum() < 2 + 2 * (not known.any()):
            return None
        z, F, count, rest = self._delta[on] - origin, self._force[on], self._count[on], self._force[~on]
        x = np.log(z / z[-1])
        lowest = x[0] if self._relative else max(x[0], _LOWEST)
        centres = np.arange(0.6 * width, lowest - width, -0.6 * width) if size > 0.0 else np.empty(0)
        A = _basis(x, centres, width, 0)
        prior = np.append([weight for _, weight in _PRIOR], np.full(centres.size, size**-2 if size else 0.0))
        mean = np.append([value for value, _ in _PRIOR], np.zeros(centres.size))
        extra: Array = np.zeros((0, prior.size))
        wanted: Array = np.zeros(0)
        if known.any() and self._slopes is not None:  # a slope tells as much as the difference of neighbours
            scale = float(np.median(np.diff(x))) if x.size > 1 else 1.0
            extra, wanted = scale * _basis(x[known], centres, width, 1), scale * self._slopes[on][known]
        total, lost = count.sum() + rest.size + wanted.size, float(self._count[~on] @ rest**2)
        w = self._start(A, F, count, mean)
        variance, gradient, sums, least = 0.0, np.zeros(0), 0.0, _LEAST[not self._relative] ** 2
        for _ in range(15):
            level = np.minimum(A @ w, 2.0)
            if self._relative:
                J, r = np.vstack([A, extra]), np.append(np.log(F) - level, wanted - extra @ w)
                weight = np.ones(r.size)
            else:
                J, r, weight = np.exp(level)[:, None] * A, F - np.exp(level), count
            sums = float(weight @ r**2) + lost
            variance = variance or max(sums / total, least)
            normal = J.T @ (weight[:, None] * J) / variance
            H = normal + np.diag(prior + 1e-13 * float(np.max(np.diag(normal))))
            gradient = J.T @ (weight * r) / variance - prior * (w - mean)
            step = np.linalg.solve(H, gradient)
            step *= min(1.0, 1.0 / max(float(np.abs(A @ step).max()), 1e-12))
            w = w + step
            groups = len(self._delta) + wanted.size
            free = max(groups - float(np.trace(np.linalg.solve(H, normal))), 0.5 * groups**0.5)
            new = max(sums / free, least)
            settled = np.abs(step).max() < 1e-7 and abs(np.log(new / variance)) < 1e-3
            variance = new
            if settled:
                break
        size_of = groups * np.log(variance) + np.linalg.slogdet(H)[1] - np.sum(np.log(prior))
        likelihood = -0.5 * (sums / variance + float(prior @ (w - mean) ** 2) + size_of)
        return _Part(likelihood, w, np.linalg.inv(H), centres, width, origin, float(z[-1]), float(np.sqrt(variance)))

    def _start(self, A: Array, F: Array, count: Array, mean: Array) -> Array:
        """Power law through the greater forces."""
        rows = F > 0.02
        weight = F[rows] ** 2 * count[rows]
        w, line = mean.copy(), A[rows, :2]
        if rows.sum() > 2:
            line_fit = np.linalg.lstsq(np.sqrt(weight)[:, None] * line, np.sqrt(weight) * np.log(F[rows]), rcond=None)[
                0
            ]
            if 0.2 < line_fit[1] < 10.0:
                w[:2] = line_fit
        return w
