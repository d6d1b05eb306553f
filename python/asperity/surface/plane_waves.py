"""Sums of plane waves: values on product grids and mean squares over a patch, in bounded memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from asperity.arrays import Array

DEVIATIONS = 10.0  # waves of random phases exceed this many with a probability below exp(-50) (Chernoff)
BLOCK = 2**20  # pairs, or waves times nodes, evaluated at once: 8 MiB per temporary array
_NEAR = 1e-3  # below it sin(h)/h is taken from its series


class Waves(NamedTuple):
    """Plane waves a cos(kx x + ky y + phi), one entry per wave, each (n,)."""

    a: Array  # amplitude (length)
    kx: Array  # wave vector (1/length)
    ky: Array
    phi: Array


def at_points(
    waves: Waves, x: Array, y: Array, wave: Callable[[Array], Array], weights: list[Array], s: Array | None = None
) -> tuple[Array, ...]:
    """sum_j weights[i][j] wave(theta_j) at every point, one array for each i.

    Args:
        waves: the waves
        x, y: points, each (m,) (length)
        wave: function of the angle theta
        weights: each (n,)
        s: standard deviations (m,) (length) of a Gaussian that the sum is convolved with; default none
    """
    _, kx, ky, phi = waves
    w = np.stack(weights, axis=1)
    out = np.empty((x.size, len(weights)))
    step = max(1, 2 * BLOCK // kx.size)
    for i in range(0, x.size, step):
        part = slice(i, i + step)
        theta = np.multiply.outer(x[part], kx)
        theta += np.multiply.outer(y[part], ky)
        theta += phi
        values = wave(theta)
        if s is not None:
            values *= np.exp(np.multiply.outer(s[part] ** 2, -0.5 * (kx**2 + ky**2)))
        out[part] = values @ w
    return tuple(out.T)


def on_product(waves: Waves, x: Array, y: Array, *weights: Array) -> tuple[Array, ...]:
    """Re sum_j w_j exp(i theta_j) at all (x[i], y[j]), (len(y), len(x)), for each complex weight array w (n,).

    A plane wave separates, exp(i(kx x + ky y)) = exp(i kx x) exp(i ky y), so the sum over
    all waves is one real matrix product (len(y) x 2 waves)(2 waves x len(x)).
    """
    grids = tuple(np.zeros((y.size, x.size)) for _ in weights)
    step = max(1, BLOCK // max(x.size, y.size))
    for i in range(0, waves.a.size, step):
        part = slice(i, i + step)
        _, kx, ky, phi = (entry[part] for entry in waves)
        along_x = np.exp(1j * np.multiply.outer(kx, x))
        right = np.vstack([along_x.real, along_x.imag])
        along_y = np.exp(1j * (np.multiply.outer(y, ky) + phi))
        for grid, w in zip(grids, weights, strict=True):
            left = along_y * w[part]
            grid += np.hstack([left.real, -left.imag]) @ right
    return grids


def mean_squares(waves: Waves, L: float) -> tuple[float, float, float]:
    """Means of s^2, |grad s|^2 and (laplacian s)^2 over [0, L]^2, s being the sum of the waves.

    The product of two waves is the sum of two waves, with the sum and the difference of the wave vectors. The mean
    of a wave over the patch is its value in the middle times sin(h)/h in x and y, h = k L/2. Sines of sums are
    expanded into products of sines and cosines. The pairs are evaluated in blocks, each pair once.
    """
    a, kx, ky, phi = waves
    k2 = kx**2 + ky**2
    hx, hy = kx * L / 2, ky * L / 2
    middle = phi + hx + hy
    u, v = a * np.cos(middle), a * np.sin(middle)
    square = slope = curvature = 0.0
    rows = max(1, BLOCK // a.size)
    for i in range(0, a.size, rows):
        one, other = slice(i, i + rows), slice(i, None)
        twice = np.where(np.arange(a.size - i) < rows, 1.0, 2.0)  # a pair of different waves occurs twice in the square
        uu, vv = np.multiply.outer(u[one], u[other]), np.multiply.outer(v[one], v[other])
        plus, minus = uu - vv, uu + vv
        for h in (hx, hy):
            of_sum, of_difference = _sincs(h[one], h[other])
            plus *= of_sum
            minus *= of_difference
        both, apart = plus + minus, minus - plus
        square += float(both.sum(axis=0) @ twice) / 2
        slope += sum(float((k[one] @ apart) @ (twice * k[other])) for k in (kx, ky)) / 2
        curvature += float((k2[one] @ both) @ (twice * k2[other])) / 2
    return square, slope, curvature


def _sincs(g: Array, h: Array) -> tuple[Array, Array]:
    """sin(t)/t for t = g + h and for t = g - h, each (len(g), len(h))."""
    left = np.multiply.outer(np.sin(g), np.cos(h))
    right = np.multiply.outer(np.cos(g), np.sin(h))
    out = []
    for sine, t in ((left + right, np.add.outer(g, h)), (left - right, np.subtract.outer(g, h))):
        near = np.abs(t) < _NEAR
        sine[near], t[near] = 1.0 - t[near] ** 2 / 6, 1.0
        out.append(sine / t)
    return out[0], out[1]
