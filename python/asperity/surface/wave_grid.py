"""Periodic sums of many plane waves, interpolated at any points from a grid that an FFT fills.

The interpolation is the non-uniform FFT of type 2: the waves are divided by the transform of a kernel of small support,
summed on a grid of twice the necessary density, and the kernel is applied at each point (Greengard and Lee, SIAM Review
46 (2004) 443; the kernel of Kaiser and Bessel: Jackson et al., IEEE Trans. Med. Imaging 10 (1991) 473).
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from asperity.arrays import Array

_WIDTH = 12  # nodes under the kernel along each axis
_SHAPE = 28.0  # of the kernel, for twice the density: least error
_LEAST = 3 * _WIDTH  # nodes of a period
_CHUNK = 2**13  # points at once: 9 MiB of gathered nodes


class WaveGrid:
    """The function Re sum c exp(2 pi i (m y + n x)/period), with derivatives to the second.

    At scattered points the error is below 1e-11 of the sum of the amplitudes of the waves; that of the first and second
    derivatives is below 1e-8 and 1e-6 of those of the shortest wave with this amplitude.

    Args:
        waves: complex amplitudes (2 S + 1, S + 1) (length): rows m = -S to S along y, columns n = 0 to S along x; zero
            where n = 0 and m <= 0
        period: along both axes (length)
    """

    def __init__(self, waves: Array, period: float) -> None:
        self.waves, self.period = waves, period
        self._most = waves.shape[1] - 1

    @cached_property
    def wave_numbers(self) -> tuple[Array, Array]:
        """Angular wave numbers along y (2 S + 1, 1) and along x (1, S + 1) (1/length)."""
        k = 2 * np.pi / self.period
        return k * np.arange(-self._most, self._most + 1)[:, None], k * np.arange(self._most + 1)[None, :]

    @cached_property
    def _nodes(self) -> Array:
        """Sum of the divided waves on a period and the width of the kernel beyond."""
        from scipy.fft import next_fast_len

        n = max(_LEAST, next_fast_len(4 * self._most, real=True))
        gain = _transform(2 * np.pi * np.arange(self._most + 1) / n)
        both = np.concatenate([gain[:0:-1], gain])
        return np.pad(_synthesis(self.waves / (both[:, None] * gain), n), (0, _WIDTH), mode="wrap")

    def at(self, x: Array, y: Array, orders: list[tuple[int, int]]) -> list[Array]:
        """Derivatives of the given orders (along y, along x), up to the second, at points x, y, each (n,)."""
        out: list[Array] = [np.empty(x.size) for _ in orders]
        most = max(max(order) for order in orders)
        windows = np.lib.stride_tricks.sliding_window_view(self._nodes, (_WIDTH, _WIDTH))
        for i in range(0, x.size, _CHUNK):
            part = slice(i, i + _CHUNK)
            (jx, wx), (jy, wy) = (self._weights(s[part], most) for s in (x, y))
            values = windows[jy, jx]
            along_x = {k: np.matmul(values, wx[k][:, :, None])[:, :, 0] for k in {order[1] for order in orders}}
            for result, (oy, ox) in zip(out, orders, strict=True):
                result[part] = np.einsum("ij,ij->i", wy[oy], along_x[ox])
        return out

    def product(self, x: Array, y: Array, order: tuple[int, int]) -> Array:
        """Derivative of an order (along y, along x) at all pairs of x (nx,) and y (ny,), (ny, nx)."""
        from scipy.sparse import csr_matrix

        def matrix(s: Array, order: int) -> Any:
            first, weights = self._weights(s, order)
            columns = first[:, None] + np.arange(_WIDTH)
            start = np.arange(0, columns.size + 1, _WIDTH)
            return csr_matrix((weights[order].ravel(), columns.ravel(), start), shape=(s.size, len(self._nodes)))

        of_y, of_x = matrix(y, order[0]), matrix(x, order[1])
        return np.ascontiguousarray((of_x @ (of_y @ self._nodes).T).T)

    def _weights(self, s: Array, most: int) -> tuple[Array, list[Array]]:
        """First node under the kernel (n,), and the kernel with its derivatives there, each (n, width)."""
        n = len(self._nodes) - _WIDTH
        scale = n / self.period
        t = s * scale
        first = np.ceil(t - _WIDTH / 2).astype(np.int64)
        away = (t - first)[:, None] - np.arange(_WIDTH)
        return first % n, [k * scale**order for order, k in enumerate(_kernel(away, most))]


def _synthesis(waves: Array, n: int) -> Array:
    """Sum of the waves (2 S + 1, S + 1) at n > 2 S nodes of a period along both axes."""
    from scipy.fft import ifft, irfft

    most = waves.shape[1] - 1
    spectrum = np.zeros((n, most + 1), dtype=complex)
    spectrum[: most + 1] = waves[most:]
    spectrum[n - most :] = waves[:most]
    spectrum[n - most :, 0] = np.conj(waves[:most:-1, 0])  # the other half of the waves along y
    columns = ifft(spectrum, axis=0, norm="forward", overwrite_x=True)
    return np.asarray(irfft(0.5 * columns, n, axis=1, norm="forward"))


def _kernel(t: Array, most: int) -> list[Array]:
    """I0(b sqrt(1 - (2 t/w)^2))/I0(b) and its derivatives up to `most` at distances |t| <= w/2 (nodes)."""
    from scipy.special import i0e, i1e, ive

    ratio = (2 * _SHAPE / _WIDTH) ** 2
    g = np.maximum(np.sqrt(np.maximum(_SHAPE**2 - ratio * t**2, 0.0)), 1e-3)  # quotients of g are even and smooth
    scale = np.exp(g - _SHAPE) / i0e(_SHAPE)
    found = [i0e(g) * scale]
    if most >= 1:
        first = i1e(g) / g
        found.append(-ratio * t * first * scale)
    if most >= 2:
        found.append(-ratio * (first - ratio * t**2 * ive(2, g) / g**2) * scale)
    return found


def _transform(omega: Array) -> Array:
    """Fourier transform of the kernel at angular wave numbers per node, |omega| < 2 b/w."""
    from scipy.special import i0e

    root = np.sqrt(_SHAPE**2 - (omega * _WIDTH / 2) ** 2)
    return np.asarray(_WIDTH * np.exp(root - _SHAPE) * -np.expm1(-2 * root) / (2 * root * i0e(_SHAPE)))
