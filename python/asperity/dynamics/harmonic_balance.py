"""Harmonic balance of the forced oscillator, with exact integrals of the contact force.

The orbit is ``u(theta) = x_0 + SUM a_k cos(k theta) + b_k sin(k theta)``, ``theta = Omega tau / p`` (p = 1, or 2
for a subharmonic of order 2). The contact force vanishes in flight and is smooth in contact, except where the
contact yields again. Its Fourier integrals are computed by Gauss quadrature between the angles of contact loss and of
yield of the current orbit; an orbit away from both uses the uniform grid, which is then spectrally accurate. So there
is no aliasing, unlike in the alternating frequency-time method (Cameron & Griffin 1989), and the conservative force
does no spurious work, however light the damping.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import roots_legendre

from asperity.arrays import Array
from asperity.dynamics.equation import Equation, primitive, rate

MAX_HARMONICS = 640  # a Newton step with them takes 0.2 s
_GRID = 8  # uniform samples per harmonic: the integrals are exact to 1e-10 with 4, to round-off with 6
_TABULATED = 64  # largest number of harmonics whose basis on the uniform grid is cached
_NEAR = 0.02  # distance from contact loss within which integrals are split there: exact to round-off


@dataclass(frozen=True)
class Balance(Equation):
    """Residual of the harmonic balance ``Omega^2 u'' + 2 zeta Omega G(u)' + f(u) - F^ cos(p theta) = 0``.

    Attributes:
        restoring, zeta, damping: see `asperity.dynamics.equation.Equation`
        order: p, periods of the forcing per period of the orbit
    """

    order: int = 1

    def evaluate(self, x: Array, omega: float, forcing: float) -> tuple[Array, Array, Array]:
        """Residual, its Jacobian and its derivative with respect to Omega.

        The coefficients x (2 K + 1) are the mean, K cosines and K sines; the arrays have the shapes (2 K + 1,),
        (2 K + 1, 2 K + 1) and (2 K + 1,).
        """
        size = x.size
        count = size // 2
        basis, weight = self._quadrature(x)
        u = basis @ x
        residual, jacobian = _projected(basis, weight, *self.restoring.pull(u))
        residual[0] -= 1.0 / self.restoring.n_loc
        nu = omega / self.order
        k = np.tile(np.arange(1.0, count + 1.0), 2)
        inertia = -((nu * k) ** 2)
        entries, step = jacobian.reshape(-1), size + 1  # a view, for its diagonals
        entries[step::step] += inertia
        d_omega = np.zeros(size)
        d_omega[1:] = inertia * x[1:]
        residual[1:] += d_omega[1:]
        d_omega *= 2.0 / omega
        residual[self.order] -= forcing
        if self.zeta:
            cos, sin = slice(1, count + 1), slice(count + 1, None)
            c = (2.0 * self.zeta * nu) * k[:count]
            if self.damping == "always":
                damper = x
                entries[step + count : step + count + count * step : step] += c
                entries[step * (count + 1) - count :: step] -= c
            else:
                r, flight = self.restoring, np.full(int(self.restoring.contact), -1.0)  # none in a Taylor law
                stored = primitive(r, self.damping, u) - primitive(r, self.damping, flight).sum()
                damper, tangent = _projected(basis, weight, stored, rate(r, self.damping, u))
                jacobian[cos] += c[:, None] * tangent[sin]
                jacobian[sin] -= c[:, None] * tangent[cos]
            loss_cos, loss_sin = c * damper[sin], -c * damper[cos]
            residual[cos] += loss_cos
            residual[sin] += loss_sin
            d_omega[cos] += loss_cos / omega
            d_omega[sin] += loss_sin / omega
        return residual, jacobian, d_omega

    def _quadrature(self, x: Array) -> tuple[Array, Array]:
        """Basis (points, 2 K + 1) and weights (points,) that integrate the contact force along the orbit."""
        count = x.size // 2
        points = _GRID * max(count, 8)
        if self.restoring.contact:
            s = 1.0 + (uniform_basis(count, points) @ x if count <= _TABULATED else samples(stack([x]), points)[0])
            lowest, highest, top = float(s.min()), float(s.max()), 1.0 + self.restoring.kink
            near, edges = _NEAR * max(1.0, 0.5 * (highest - lowest)), []
            if lowest <= near:
                edges.append(_edges(x, s, near))
            if highest > top - near:  # where the distance to the kink vanishes, as 1 + u does at contact loss
                below = -x
                below[0] += top - 2.0
                edges.append(_edges(below, top - s, near))
            if edges:
                theta, weight = _panels(x, np.sort(np.concatenate(edges)), s[0] > 0.0)
                return basis_at(theta, count), weight
        return uniform_basis(count, points), np.full(points, 2.0 * np.pi / points)


def _projected(basis: Array, weight: Array, force: Array, slope: Array) -> tuple[Array, Array]:
    """Fourier coefficients of a force along the orbit, and their derivatives with respect to those of u.

    A product of two waves is half the sum of the waves of sum and difference. The derivatives are therefore sums of
    the coefficients of the slope, up to twice the harmonics of u, and no matrix product is needed.
    """
    size = basis.shape[1]
    count = size // 2
    columns = np.empty((4, weight.size))
    columns[0] = weight * force
    columns[1] = weight * slope
    columns[2] = columns[1] * basis[:, count]
    columns[3] = columns[1] * basis[:, -1]
    project, low, cos, sin = columns @ basis
    double = np.zeros((4, size))  # cosines, negative cosines, sines, negative sines
    double[0, : count + 1] = low[: count + 1]
    double[0, count + 1 :] = cos[1 : count + 1] - sin[count + 1 :]
    double[2, 1 : count + 1] = low[count + 1 :]
    double[2, count + 1 :] = sin[1 : count + 1] + cos[count + 1 :]
    double *= 0.5 / np.pi
    double[1], double[3] = -double[0], -double[2]
    one, other = _pairs(count)
    jacobian = double.take(one)
    jacobian += double.take(other)
    jacobian[0] *= 0.5
    project /= np.pi
    project[0] *= 0.5
    return project, jacobian


@lru_cache(maxsize=16)
def _pairs(count: int) -> tuple[Array, Array]:
    """Indices of both terms of each product of waves in the table of `_projected`, two square arrays."""
    size = 2 * count + 1
    k = np.concatenate([np.arange(count + 1), np.arange(1, count + 1)])
    sine = np.arange(size) > count
    mixed = sine[:, None] != sine
    both = sine[:, None] & sine
    lead = np.where(sine, k, -k)[:, None] + np.where(sine, k, -k)  # of the sine less that of the cosine, if mixed
    one = np.abs(k[:, None] - k) + size * np.where(mixed, np.where(lead < 0, 3, 2), 0)
    other = k[:, None] + k + size * np.where(mixed, 2, np.where(both, 1, 0))
    return one, other


def basis_at(theta: Array, count: int) -> Array:
    """Fourier basis (len(theta), 2 count + 1): 1, cosines, sines."""
    powers = np.empty((theta.size, count), complex)
    powers[:] = np.exp(1j * theta)[:, None]
    np.multiply.accumulate(powers, axis=1, out=powers)
    out = np.empty((theta.size, 2 * count + 1))
    out[:, 0] = 1.0
    out[:, 1 : count + 1] = powers.real
    out[:, count + 1 :] = powers.imag
    return out


@lru_cache(maxsize=32)
def uniform_basis(count: int, points: int) -> Array:
    """Fourier basis at ``points`` equidistant angles from 0."""
    out = basis_at(2.0 * np.pi / points * np.arange(points), count)
    out.flags.writeable = False
    return out


def stack(orbits: list[Array]) -> Array:
    """Coefficient vectors of any lengths as complex rows c, u = Re SUM c_k exp(i k theta)."""
    count = max(x.size for x in orbits) // 2
    out = np.zeros((len(orbits), count + 1), complex)
    for row, x in zip(out, orbits, strict=True):
        k = x.size // 2
        row[: k + 1] = x[: k + 1]
        row[1 : k + 1] -= 1j * x[k + 1 :]
    return out


def unstack(c: Array, count: int) -> Array:
    """One row of `stack` as a coefficient vector of `count` harmonics."""
    return np.concatenate([c[: count + 1].real, -c[1 : count + 1].imag])


def samples(c: Array, points: int) -> Array:
    """Values (orbits, points) of the orbits at equidistant angles."""
    half = c * (0.5 * points)
    half[:, 0] *= 2.0
    return np.fft.irfft(half, points, axis=1)


def resize(x: Array, count: int) -> Array:
    """Pad coefficients with zeros, or truncate them, to `count` harmonics."""
    old = x.size // 2
    keep = min(old, count)
    out = np.zeros(2 * count + 1)
    out[: keep + 1] = x[: keep + 1]
    out[count + 1 : count + 1 + keep] = x[old + 1 : old + 1 + keep]
    return out


def tail(x: Array) -> float:
    """Relative size of the last quarter of the spectrum, the truncation error estimate."""
    count = x.size // 2
    power = x[1 : count + 1] ** 2 + x[count + 1 :] ** 2
    total = power.sum()
    return float(np.sqrt(power[-(count // 4) :].sum() / total)) if total > 0 else 0.0


def _edges(x: Array, s: Array, near: float) -> Array:
    """Angles at which 1 + u (samples s) vanishes along an orbit, and those of its positive minima near zero."""
    h = 2.0 * np.pi / s.size
    angle: Array = h * np.arange(s.size + 1)
    value: Array = np.append(s, s[0])
    marks: Array = np.empty(0)
    low = np.flatnonzero(np.abs(s) < 4.0 * near)
    dips = low[(s[low] <= s[low - 1]) & (s[low] < value[low + 1])]
    if dips.size:  # a short grazing arc may lie between samples: locate the minima themselves
        marks, depth = _minima(x, s, dips, h)
        angle, value = np.concatenate([angle, marks]), np.concatenate([value, depth])
        order = np.argsort(angle, kind="stable")
        angle, value, marks = angle[order], value[order], marks[depth > 0.0] % (2.0 * np.pi)
    i = np.flatnonzero((value[1:] > 0) != (value[:-1] > 0))
    return np.append(marks, _roots(x, angle[i], angle[i + 1], value[i], value[i + 1]) if i.size else ())


def _waves(x: Array) -> tuple[Array, Array]:
    """Harmonic numbers times i, and complex coefficients of u, u' and u'' (K + 1, 3)."""
    (c,) = stack([x])
    ik = 1j * np.arange(c.size)
    return ik, np.stack([c, ik * c, ik * ik * c], axis=1)


def _minima(x: Array, s: Array, dips: Array, h: float) -> tuple[Array, Array]:
    """Angles of the minima near the samples `dips`, and 1 + u there."""
    ik, c = _waves(x)
    right = s[(dips + 1) % s.size]
    curvature = s[dips - 1] - 2.0 * s[dips] + right
    start = h * dips
    theta = start + 0.5 * h * (s[dips - 1] - right) / np.maximum(curvature, 1e-300)
    for _ in range(4):
        u = (np.exp(np.multiply.outer(theta, ik)) @ c[:, 1:]).real
        theta = theta - np.clip(u[:, 0] / np.maximum(np.abs(u[:, 1]), 1e-300), -0.5 * h, 0.5 * h)
    theta = np.clip(theta, np.maximum(start - h, 0.0), start + h)
    return theta, 1.0 + (np.exp(np.multiply.outer(theta, ik)) @ c[:, 0]).real


def _roots(x: Array, a: Array, b: Array, fa: Array, fb: Array) -> Array:
    """Angles in the brackets [a, b] where 1 + u = 0, by a safeguarded Newton iteration."""
    ik, c = _waves(x)
    c = c[:, :2]
    theta, rising = a + (b - a) * fa / (fa - fb), fb > fa
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(60):
            u = (np.exp(np.multiply.outer(theta, ik)) @ c).real
            f = 1.0 + u[:, 0]
            above = (f > 0) == rising
            a, b, new = np.where(above, a, theta), np.where(above, theta, b), theta - f / u[:, 1]
            inside = (new >= a) & (new <= b)
            new = np.where(inside, new, 0.5 * (a + b))
            moved = float(np.abs(new - theta).max())
            theta = new
            if moved < (1e-8 if inside.all() else 1e-14):  # the remaining error is the square of a Newton step
                break
    return theta


@lru_cache(maxsize=256)
def _clustered(points: int) -> tuple[Array, Array]:
    """Gauss rule on [0, 1] clustered at both ends, where the force behaves like (distance)^n."""
    x, w = roots_legendre(points)
    y = 0.5 * (1.0 + x)
    return y * y * (3.0 - 2.0 * y), 0.5 * w * 6.0 * y * (1.0 - y)


def _panels(x: Array, edges: Array, touching: bool) -> tuple[Array, Array]:
    """Quadrature points and weights over the intervals between rising angles in which the orbit is in contact.

    Without an angle it is either always in contact or never (`touching`).
    """
    if not edges.size:
        edges = np.zeros(int(touching))
    ends, count = np.append(edges[1:], edges[:1] + 2.0 * np.pi), x.size // 2
    ik, c = _waves(x)
    inside = 1.0 + (np.exp(np.multiply.outer(0.5 * (edges + ends), ik)) @ c[:, 0]).real > 0.0
    nodes, weights = [np.empty(0)], [np.empty(0)]
    for begin, end in zip(edges[inside], ends[inside], strict=True):
        width = end - begin
        points = 24 + int(1.2 * count * width)
        unit = max(4, 1 << points.bit_length() - 4)  # few different rules, which are cached
        points = unit * -(-points // unit)
        rule, w = _clustered(points)
        nodes.append(begin + width * rule)
        weights.append(width * w)
    return np.concatenate(nodes), np.concatenate(weights)
