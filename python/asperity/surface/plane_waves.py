"""Surfaces that are a sum of few plane waves, each evaluated at every point; the simplest is a sinusoid."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.runtime.declaration import LENGTH, Real, Whole, declared, key
from asperity.surface.base import Surface, short_wave_share
from asperity.surface.shapes import Point, on_patch

_BLOCK = 2**20  # waves times points evaluated at once: 8 MiB per temporary array


class Waves(NamedTuple):
    """Plane waves a cos(kx x + ky y + phi), one entry per wave, each (n,)."""

    a: Array  # amplitude (length)
    kx: Array  # wave vector (1/length)
    ky: Array
    phi: Array


class PlaneWaves(Surface):
    """Sum of plane waves about a height of its own."""

    @property
    @abstractmethod
    def waves(self) -> Waves:
        """The waves."""

    @cached_property
    def datum(self) -> float:
        """Height that the waves are added to (length)."""
        return 0.0

    def short_waves(self, wavelength: float, depth: float) -> float:
        a, kx, ky, _ = self.waves
        part = short_wave_share(2 * np.pi / np.hypot(kx, ky), wavelength)
        return float(np.sqrt(0.5 * np.sum((a * part) ** 2)))

    def _at(
        self, x: ArrayLike, y: ArrayLike, wave: Callable[[Array], Array], weights: list[Array], s: ArrayLike = 0.0
    ) -> tuple[Array, ...]:
        """sum_j weights[i][j] wave(theta_j) at every point: one array in the broadcast shape for each i.

        With standard deviations s (length) the sum is convolved with a Gaussian at each point.
        """
        points = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (x, y, s)))
        shape, (x, y, s) = points[0].shape, (v.ravel() for v in points)
        _, kx, ky, phi = self.waves
        w, smooth = np.stack(weights, axis=1), bool(s.any())
        out = np.empty((x.size, len(weights)))
        step = max(1, 2 * _BLOCK // kx.size)
        for i in range(0, x.size, step):
            part = slice(i, i + step)
            theta = np.multiply.outer(x[part], kx)
            theta += np.multiply.outer(y[part], ky)
            theta += phi
            values = wave(theta)
            if smooth:
                values *= np.exp(np.multiply.outer(s[part] ** 2, -0.5 * (kx**2 + ky**2)))
            out[part] = values @ w
        return tuple(z.reshape(shape) for z in out.T)

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return self.smoothed(x, y, 0.0)

    def smoothed(self, x: ArrayLike, y: ArrayLike, s: ArrayLike) -> Array:
        (z,) = self._at(x, y, np.cos, [self.waves.a], s)
        return z + self.datum

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        a, kx, ky, _ = self.waves
        zx, zy = self._at(x, y, np.sin, [-a * kx, -a * ky])
        return zx, zy

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        a, kx, ky, _ = self.waves
        xx, xy, yy = self._at(x, y, np.cos, [-a * kx**2, -a * kx * ky, -a * ky**2])
        return xx, xy, yy

    def on_product(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> Array:
        # a plane wave separates, so the sum over all waves is one real product (len(y), 2 waves) (2 waves, len(x))
        z = np.zeros((y.size, x.size))
        step = max(1, _BLOCK // max(x.size, y.size))
        for i in range(0, self.waves.a.size, step):
            a, kx, ky, phi = (entry[i : i + step] for entry in self.waves)
            along_x = np.exp(1j * np.multiply.outer(kx, x))
            along_y = np.exp(1j * (np.multiply.outer(y, ky) + phi)) * (a * (1j * kx) ** dx * (1j * ky) ** dy)
            z += np.hstack([along_y.real, -along_y.imag]) @ np.vstack([along_x.real, along_x.imag])
        return z if dx + dy else z + self.datum

    def mean(self) -> float:
        """Mean height over the patch (length), in closed form."""
        a, kx, ky, phi = self.waves
        hx, hy = 0.5 * self.L * kx, 0.5 * self.L * ky
        return self.datum + float(np.sum(a * np.cos(phi + hx + hy) * np.sinc(hx / np.pi) * np.sinc(hy / np.pi)))

    def curvature_bound(self) -> float:
        a, kx, ky, _ = self.waves
        return float(np.abs(a) @ (kx**2 + ky**2))


@declared("surface", eq=False, kw_only=True)
class Sinusoid(PlaneWaves):
    """Wavy surface: z = A cos(k (x - x0)), or A cos(k (x - x0)) cos(k (y - y0)) with dims = 2; k = 2 pi/lambda.

    >>> from asperity.surface import Sinusoid
    >>> wave = Sinusoid(L=1.0, amplitude=0.01, wavelength=0.5, centre=(0.0, 0.0))
    >>> float(wave.height(0.25, 0.7))
    -0.01
    """

    amplitude: Real = key("half of peak to valley", LENGTH, share=(1e-9, 1.0))
    wavelength: Real = key("wavelength", LENGTH, default=None, shown="L", share=(1e-3, 1e3))
    dims: Whole = key("1: waves along x; 2: along x and y", default=1, ge=1, le=2)
    centre: Point = key("position of a crest (x, y)", LENGTH, default=None, shown="middle of the patch")

    kind: ClassVar[str] = "sinusoid"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._complete(wavelength=self.L, centre=on_patch(self.centre, self.L))

    @cached_property
    def waves(self) -> Waves:
        """One wave along x; along x and y the two along the diagonals, whose sum is the product."""
        k, (x0, y0) = 2 * math.pi / self.wavelength, self.centre
        ky = k * np.array([1.0, -1.0] if self.dims == 2 else [0.0])
        kx = np.full(ky.shape, k)
        return Waves(np.full(ky.shape, self.amplitude / self.dims), kx, ky, -kx * x0 - ky * y0)

    @property
    def feature_size(self) -> float:
        """The wavelength (length)."""
        return self.wavelength

    @property
    def periodic(self) -> bool:
        """Whether L is a multiple of the wavelength."""
        waves = self.L / self.wavelength
        return round(waves) > 0 and math.isclose(waves, round(waves), rel_tol=1e-9)

    def maximum(self) -> tuple[float, float, float]:
        """Crest (x, y, z) at the centre (length)."""
        return (*self.centre, self.amplitude)
