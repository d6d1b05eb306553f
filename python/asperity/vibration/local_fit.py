"""Exponent, stiffness and curvature of a force at a load by its rows, with bars, and the approach of first contact.

ln F over x = ln z is a straight line, a power law, and a sum of bumps of one width. First contact is a parameter of
the fit. Width and size of the bumps are not chosen: each has its likelihood by the rows, and all results are means over
them (Bayesian model averaging; O'Hagan, J. R. Stat. Soc. B 40 (1978) 1, for the prior of a curve).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from asperity.arrays import Array

#: Standard deviations that make a bar: the bars hold in 90 of 100 draws of each family, see benchmarks/measured.py.
BAR = 3.0
WIDTHS, SIZES = (0.05, 0.15, 0.4, 1.0, 2.5), (0.03, 0.15, 0.6, 2.0)  # of the bumps, in ln z and in ln F
_SPACING, _BUMPS = 0.6, 67  # distance of bumps over their width, and most of them
_PRIOR = ((0.0, 1e-4), (1.7, 4.0))  # mean and weight of ln F at the last row (no matter) and of the exponent
_GROUPS = 100  # of rows that are averaged
_LEAST = 1e-7, 1e-5  # noise of computed rows over them, and of an instrument over the greatest force
_TEMPER = 0.5  # power of the likelihood: scatter is not quite white, and no law is of one width


class Local(NamedTuple):
    """Results at a load: ln z, n, ln k, kappa, z F''/F' and z^2 F'''/F'; the bars of the first four."""

    x: float
    n: float
    log_k: float
    kappa: float
    second: float
    third: float
    bars: Array


@dataclass(frozen=True, eq=False)
class _Part:
    """Most likely bumps of one width and size."""

    likelihood: float
    w: Array  # coefficients of the line and the bumps
    covariance: Array  # of these and of first contact
    centres: Array
    width: float
    origin: float
    end: float  # approach of the last row from first contact
    noise: float

    def __call__(self, x: Array, order: int) -> Array:
        """Derivative of ln F at x = ln z over that of the last row (m,)."""
        return np.asarray(_basis(x, self.centres, self.width, order) @ self.w)

    def at(self, level: float) -> tuple[Array, Array]:
        """The numbers of `Local` where ln F is `level`, and the variances of the first four."""
        x = np.zeros(1)
        for _ in range(60):
            x += np.clip((level - self(x, 0)) / np.maximum(self(x, 1), 0.2), -0.3, 0.3)
        rows = [_basis(x, self.centres, self.width, order)[0] for order in range(4)]
        a, b, c = max(float(rows[1] @ self.w), 1e-3), float(rows[2] @ self.w), float(rows[3] @ self.w)
        second, third = (a * a - a + b) / a, (a**3 - 3 * a * a + 2 * a + 3 * b * (a - 1) + c) / a
        move = -rows[0] / a  # of x by the coefficients
        n, by_b, by_c = rows[1] + b * move, rows[2] + c * move, rows[3]
        by_a = 6 * a - 9 + 3 * (3 * b - c) / a**2 - 10 * second * (1 - b / a**2)
        kappa = (by_a * n + (9 * (a - 1) - 10 * second) / a * by_b + 3 / a * by_c) / 48
        by = np.column_stack([[move, n, n / a - move, kappa], np.array([-1.0, 0.0, 1.0, 0.0]) / self.end])
        at = float(x[0]) + np.log(self.end)
        numbers = [at, a, np.log(a) + level - at, (3 * third - 5 * second**2) / 48, second, third]
        return np.array(numbers), np.einsum("ij,jk,ik->i", by, self.covariance, by)


def _basis(x: Array, centres: Array, width: float, order: int) -> Array:
    """Derivative of line and bumps at x (m,), (m, 2 + bumps)."""
    t = (x[:, None] - centres) / width
    factor: Any = (1.0, -t, t * t - 1.0, 3.0 * t - t**3)[order]
    line = np.zeros((x.size, 2))
    line[:, 0], line[:, 1] = (order == 0), (x if order == 0 else float(order == 1))
    return np.column_stack([line, factor / width**order * np.exp(-0.5 * t * t)])


class LocalFit:
    """Fit of rows (delta, force) of a rising contact.

    Args:
        delta, force: approach (length) and force (m,), in the order of the approach
        exponents: d ln F/d ln z at the rows (m,), NaN where unknown; None without any
        measured: whether the rows are those of an instrument, whose scatter has one size, and contact begins anywhere:
            the forces of the rows before are noise about zero. Else the scatter is a share of each force, as of
            computed rows, and the approach is from first contact
    """

    def __init__(self, delta: Array, force: Array, exponents: Array | None = None, *, measured: bool = False) -> None:
        groups = np.array_split(np.arange(delta.size), min(delta.size, _GROUPS)) if measured else []
        self._count: Array = np.array([float(rows.size) for rows in groups]) if measured else np.ones(delta.size)
        if measured:
            delta, force = (np.array([column[rows].mean() for rows in groups]) for column in (delta, force))
        self._measured, self._top = measured, float(np.sort(force)[-3:].mean())
        self._delta, self._force = delta, force / self._top
        self._exponents = np.full(delta.size, np.nan) if measured or exponents is None else exponents
        start = self._power()
        self._parts = [self._part(start, *model) for model in ((1.0, 0.0), *product(WIDTHS, SIZES))]
        likelihood = np.array([part.likelihood for part in self._parts])
        self._weights = np.exp(_TEMPER * (likelihood - likelihood.max()))
        self._weights /= self._weights.sum()

    @property
    def origin(self) -> tuple[float, float]:
        """Approach of first contact and its bar (length)."""
        at, variance = np.array([(part.origin, part.covariance[-1, -1]) for part in self._parts]).T
        mean = float(self._weights @ at)
        return mean, BAR * float(np.sqrt(self._weights @ (variance + (at - mean) ** 2)))

    @property
    def noise(self) -> float:
        """Standard deviation of the scatter (force), or over the force of each row where that is its scale."""
        return float(self._weights @ [part.noise for part in self._parts]) * (self._top if self._measured else 1.0)

    def curve(self, z: Array) -> tuple[Array, Array]:
        """Mean force and exponent d ln F/d ln z at approaches from first contact > 0 (m,)."""
        value, slope = (self._weights @ [part(np.log(z / part.end), i) for part in self._parts] for i in (0, 1))
        return self._top * np.exp(value), slope

    def at(self, load: float) -> Local:
        """Results at a load (force)."""
        found, spread = zip(*(part.at(float(np.log(load / self._top))) for part in self._parts), strict=True)
        numbers, w = np.array(found), self._weights
        numbers[:, 2] += np.log(self._top)
        mean = w @ numbers
        variance = w @ np.array(spread) + w @ (numbers[:, :4] - mean[:4]) ** 2
        # bumps of another width tell what no scatter shows
        best = int(np.argmax(w))
        other = max((w[i], i) for i, part in enumerate(self._parts) if part.width != self._parts[best].width)[1]
        apart = np.abs(numbers[other] - numbers[best])[:4]
        x, n, log_k, kappa, second, third = (float(value) for value in mean)
        return Local(x, n, log_k, kappa, second, third, BAR * np.sqrt(np.maximum(variance, 0.0)) + apart)

    def _linear(self, w: Array, origin: float, centres: Array, width: float) -> tuple[Array, Array]:
        """Residuals over the scale of the error, and their derivatives with opposite sign."""
        z, scale = self._delta - origin, 1.0 if self._measured else self._force
        on = z > 1e-9 * z[-1]
        x, known = np.log(np.where(on, z, z[-1]) / z[-1]), np.isfinite(self._exponents)
        A, n = (_basis(x, centres, width, order) for order in (0, 1))
        model = np.where(on, np.exp(np.minimum(A @ w, 2.0)), 0.0) / scale
        J = model[:, None] * np.column_stack([A, self._measured * (n @ w) * (1.0 / z[-1] - 1.0 / np.where(on, z, 1.0))])
        # an exponent tells as much as the difference of neighbours
        step = float(np.median(np.abs(np.diff(x)))) if x.size > 1 else 1.0
        extra = step * np.column_stack([n[known], np.zeros(known.sum())])
        r = np.append(self._force / scale - model, step * self._exponents[known] - extra[:, :-1] @ w)
        return r, np.vstack([J, extra])

    def _part(self, start: tuple[float, Array], width: float, size: float) -> _Part:
        """Fit of bumps of one width and size, by Gauss-Newton steps from a power law."""
        origin, unit = start[0], float(self._delta[-1]) - start[0]
        first = float(np.log((self._delta[self._delta > origin][0] - origin) / unit))
        lowest = max(first / width, 1.0 - _BUMPS * _SPACING)
        centres = width * np.arange(_SPACING, lowest - 1.0, -_SPACING) if size > 0.0 else np.empty(0)
        bumps = np.full(centres.size, size**-2 if size else 0.0)
        prior = np.concatenate([[weight for _, weight in _PRIOR], bumps, [0.01 if self._measured else 1e24]])
        mean = np.concatenate([[value for value, _ in _PRIOR], 0.0 * bumps, [origin / unit]])
        in_length = np.append(np.ones(centres.size + 2), unit)
        weight = np.append(self._count, np.ones(np.isfinite(self._exponents).sum()))
        least, variance = _LEAST[self._measured] ** 2, 0.0

        def linear(w: Array) -> tuple[Array, Array, float]:
            """Residuals, derivatives and weighted squares."""
            r, J = self._linear(w[:-1], w[-1] * unit, centres, width)
            return r, J * in_length, float(weight @ r**2)

        w = np.concatenate([start[1], mean[2:]])
        r, J, squares = linear(w)
        for _ in range(40):
            variance = variance or max(squares / weight.sum(), least)
            normal = J.T @ (weight[:, None] * J) / variance
            H = normal + np.diag(prior + 1e-15 * float(np.max(np.diag(normal))))
            move = np.linalg.solve(H, J.T @ (weight * r) / variance - prior * (w - mean))
            move *= min(1.0, 1.0 / max(float(np.abs(J @ move).max()), 1e-12))
            cost = squares / variance + prior @ (w - mean) ** 2
            for _ in range(6):
                r, J, squares = linear(w + move)
                if squares / variance + prior @ (w + move - mean) ** 2 < cost:
                    break
                move = 0.3 * move
            w = w + move
            free = max(weight.size - float(np.trace(np.linalg.solve(H, normal))), 0.5 * weight.size**0.5)
            before, variance = variance, max(squares / free, least)
            if np.abs(move).max() < 1e-7 and abs(np.log(variance / before)) < 1e-3:
                break
        entropy = weight.size * np.log(variance) + np.linalg.slogdet(H)[1] - np.sum(np.log(prior))
        likelihood = -0.5 * (squares / variance + float(prior @ (w - mean) ** 2) + entropy)
        e = np.sqrt(weight) * r
        alike = float(np.clip(e[:-1] @ e[1:] / max(float(e @ e), 1e-300), 0.0, 0.9))  # neighbours, where no law fits
        spread = np.outer(in_length, in_length) * np.linalg.inv(H) * (1.0 + alike) / (1.0 - alike)
        at, noise = float(w[-1]) * unit, float(np.sqrt(variance))
        return _Part(float(likelihood), w[:-1], spread, centres, width, at, float(self._delta[-1]) - at, noise)

    def _power(self) -> tuple[float, Array]:
        """First contact, and ln F at the last row and exponent of the power law next to the forces."""
        delta, force = self._delta, self._force
        tried: Array = np.zeros(1)
        if self._measured:
            half = delta[int(np.argmax(np.maximum.accumulate(force) >= 0.5 * force.max()))]
            tried = np.linspace(delta[0] - 2.0 * np.ptp(delta), half, 121)[:-1]
        best = (np.inf, 0.0, np.zeros(2))
        for origin in map(float, tried):
            z, weight = (delta - origin) / (delta[-1] - origin), np.sqrt(self._count) * force
            on = (z > 0.0) & (force > 0.02)
            A = np.vstack([np.column_stack([np.ones(on.sum()), np.log(z[on])]) * weight[on, None], [0.0, 1e-3]])
            line = np.linalg.lstsq(A, np.append(np.log(force[on]) * weight[on], 1.7e-3), rcond=None)[0]
            line[1] = np.clip(line[1], 0.2, 10.0)
            model = np.exp(line[0]) * np.maximum(z, 0.0) ** line[1]
            best = min(best, (float(self._count @ (force - model) ** 2), origin, line), key=lambda one: one[0])
        return best[1:]
