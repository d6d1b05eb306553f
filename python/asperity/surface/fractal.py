"""The modified two-variable Weierstrass-Mandelbrot surface, as a sum of plane waves."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import field
from functools import cached_property
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.runtime.declaration import LENGTH, SCRIPT, Choices, Real, Whole, declared, key
from asperity.surface.base import Surface, check, short_wave_share

_SHORTEST = 1 / 2048  # least wavelength over L, that of `self_affine`: no mesh resolves shorter waves
_MAX_WAVES = 2500  # more would take minutes
_BLOCK = 2**20  # waves times points evaluated at once: 8 MiB per temporary array


class Waves(NamedTuple):
    """Plane waves a cos(kx x + ky y + phi), one entry per wave, each (n,)."""

    a: Array  # amplitude (length)
    kx: Array  # wave vector (1/length)
    ky: Array
    phi: Array


def cut_off_index(L: float, L_s: float, gamma: float) -> int:
    """floor(ln(L/L_s)/ln(gamma)), the index of the shortest wave not below L_s.

    Args:
        L: side of the patch (length)
        L_s: cut-off wavelength (length), 0 < L_s <= L
        gamma: ratio of successive wave numbers, > 1

    >>> from asperity.surface import cut_off_index
    >>> cut_off_index(1e-6, 1e-7, 1.5)
    5
    """
    # for a cut-off of exactly L/gamma^f the result must be f despite round-off
    return math.floor(math.log(L / L_s) / math.log(gamma) + 1e-12)


@declared("surface", eq=False, kw_only=True)
class WeierstrassMandelbrot(Surface):
    """Fractal surface of Yan and Komvopoulos, J. Appl. Phys. 84 (1998) 3617, on [0, L]^2.

    z(x, y) = L (G/L)^(D-2) sqrt(ln gamma / M) sum_mu sum_{f=0..f_max} gamma^(f(D-3))
              {cos phi - cos[2 pi gamma^f (x cos(pi mu/M) + y sin(pi mu/M))/L + phi]}

    with one phase phi per (mu, f). z(0, 0) = 0; the surface is not periodic.

    >>> from asperity.surface import WeierstrassMandelbrot
    >>> surface = WeierstrassMandelbrot(L=1e-6, D=2.4, G=1e-12, L_s=1e-7, seed=1)
    >>> surface.f_max
    5
    >>> float(surface.height(0.0, 0.0))
    0.0

    Attributes:
        f_max: highest frequency index. The shortest wavelength L/gamma^f_max is at least L/2048, and there are at most
            2500 waves, (M+1)(f_max+1).
        L_s: f_max = cut_off_index(L, L_s, gamma)
        drawing: "array" draws default_rng(seed).uniform(0, 2 pi, size=(M+1, f_max+1)): a different f_max gives an
            unrelated surface. "nested" draws each column from a separate stream, default_rng(SeedSequence(seed,
            spawn_key=(f,))).uniform(0, 2 pi, size=M+1): a larger f_max adds waves to the same surface.
        ridges: "0..M" (all M+1 rows of the phases; rows 0 and M are collinear, so the x
            direction has twice the power) or "1..M" (omits row 0 of the same phases)
        phases: explicit phases, shape (M+1, f_max+1), row mu, column f; replaces the seed
    """

    D: Real = key("fractal dimension", gt=2, lt=3, hint="2.4 is a usual value")
    G: Real = key("fractal roughness", LENGTH, share=(0.0, 1.0), hint="1.36e-11 m is a usual value")
    M: Whole = key(
        "ridges run at the angles pi mu/M; M + 1 of them, or M with ridges = 1..M", default=10, ge=1, le=1000
    )
    gamma: Real = key("frequency ratio", default=1.5, gt=1, le=100)
    f_max: Whole | None = key("highest frequency index", default=None, shown="5, or from L_s", ge=0)
    L_s: Real | None = key("shortest wavelength, sets f_max", LENGTH, default=None, share=(_SHORTEST, 1.0))
    seed: Whole = key("seed of the random phases", default=0, ge=0, lt=2**63)
    drawing: Annotated[str, Choices("array", "nested")] = key(
        "of the phases: all at once, or nested, where a larger f_max adds waves to the same surface", default="array"
    )
    ridges: Annotated[str, Choices("0..M", "1..M")] = key("ridges in the sum", default="0..M")
    phases: Annotated[Any, *SCRIPT] = field(default=None, repr=False)

    kind: ClassVar[str] = "weierstrass-mandelbrot"
    rough: ClassVar[bool] = True
    cutoff_key: ClassVar[str] = "surface.f_max or surface.L_s"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "f_max", self._check_f_max(self._resolve_f_max()))
        object.__setattr__(self, "phases", self._resolve_phases())

    @property
    def notes(self) -> tuple[str, ...]:
        if self.L_s is None or self.f_max is None:
            return ()
        expected = cut_off_index(self.L, self.L_s, self.gamma)
        told = f"surface: L_s = {self.L_s:g} gives f_max = {expected}, but f_max = {self.f_max} is given and used."
        return () if self.f_max == expected else (told,)

    def _resolve_f_max(self) -> int:
        if self.f_max is not None:
            return self.f_max
        return 5 if self.L_s is None else cut_off_index(self.L, self.L_s, self.gamma)

    def _check_f_max(self, f_max: int) -> int:
        most = cut_off_index(1.0, _SHORTEST, self.gamma)
        short = f"wavelengths L/gamma^f of at least {_SHORTEST:g} L"
        check(f_max <= most, "f_max", f_max, f"at most {most} with surface.gamma = {self.gamma:g}, for {short}")
        most = _MAX_WAVES // (self.M + 1) - 1
        few = f"(M + 1)(f_max + 1) waves of which there are no more than {_MAX_WAVES}"
        check(f_max <= most, "f_max", f_max, f"at most {most} with surface.M = {self.M}, for {few}")
        return f_max

    def _draw_phases(self) -> Array:
        assert self.f_max is not None
        if self.drawing == "array":
            return np.random.default_rng(self.seed).uniform(0, 2 * np.pi, size=(self.M + 1, self.f_max + 1))
        streams = (np.random.SeedSequence(self.seed, spawn_key=(f,)) for f in range(self.f_max + 1))
        columns = [np.random.default_rng(stream).uniform(0, 2 * np.pi, size=self.M + 1) for stream in streams]
        return np.stack(columns, axis=1)

    def _resolve_phases(self) -> Array:
        drawn = self._draw_phases()
        phases = drawn if self.phases is None else np.array(self.phases, dtype=float)
        legal = phases.shape == drawn.shape and bool(np.isfinite(phases).all())
        check(legal, "phases", phases.shape, f"a finite array of shape (M+1, f_max+1) = {drawn.shape}")
        phases.flags.writeable = False
        return phases

    @cached_property
    def _waves(self) -> Waves:
        assert self.phases is not None
        rows = slice(1 if self.ridges == "1..M" else 0, None)
        mu, f = np.indices(self.phases.shape)[:, rows]
        scale = self.L * (self.G / self.L) ** (self.D - 2) * math.sqrt(math.log(self.gamma) / self.M)
        a = scale * self.gamma ** (f * (self.D - 3.0))
        k = 2 * np.pi * self.gamma ** f.astype(float) / self.L
        angle = np.pi * mu / self.M
        return Waves(a.ravel(), (k * np.cos(angle)).ravel(), (k * np.sin(angle)).ravel(), self.phases[rows].ravel())

    @cached_property
    def _offset(self) -> float:
        return float(self._waves.a @ np.cos(self._waves.phi))

    @property
    def feature_size(self) -> float:
        """The shortest wavelength, L/gamma^f_max (length)."""
        assert self.f_max is not None
        return float(self.L / self.gamma**self.f_max)

    def short_waves(self, wavelength: float, depth: float) -> float:
        a, kx, ky, _ = self._waves
        part = short_wave_share(2 * np.pi / np.hypot(kx, ky), wavelength)
        return float(np.sqrt(0.5 * np.sum((a * part) ** 2)))

    def _at_points(
        self, x: ArrayLike, y: ArrayLike, wave: Callable[[Array], Array], weights: list[Array], s: ArrayLike = 0.0
    ) -> tuple[Array, ...]:
        """sum_j weights[i][j] wave(theta_j) at every point: one array in the broadcast shape for each i.

        With standard deviations s (length) the sum is convolved with a Gaussian at each point.
        """
        points = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (x, y, s)))
        shape, (x, y, s) = points[0].shape, (v.ravel() for v in points)
        _, kx, ky, phi = self._waves
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
        (z,) = self._at_points(x, y, np.cos, [-self._waves.a])
        return z + self._offset

    def smoothed(self, x: ArrayLike, y: ArrayLike, s: ArrayLike) -> Array:
        (z,) = self._at_points(x, y, np.cos, [-self._waves.a], s)
        return z + self._offset

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        a, kx, ky, _ = self._waves
        zx, zy = self._at_points(x, y, np.sin, [a * kx, a * ky])
        return zx, zy

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        a, kx, ky, _ = self._waves
        xx, xy, yy = self._at_points(x, y, np.cos, [a * kx**2, a * kx * ky, a * ky**2])
        return xx, xy, yy

    def on_product(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> Array:
        # a plane wave separates, so the sum over all waves is one real product (len(y), 2 waves) (2 waves, len(x))
        z = np.zeros((y.size, x.size))
        step = max(1, _BLOCK // max(x.size, y.size))
        for i in range(0, self._waves.a.size, step):
            a, kx, ky, phi = (entry[i : i + step] for entry in self._waves)
            along_x = np.exp(1j * np.multiply.outer(kx, x))
            along_y = np.exp(1j * (np.multiply.outer(y, ky) + phi)) * (-a * (1j * kx) ** dx * (1j * ky) ** dy)
            z += np.hstack([along_y.real, -along_y.imag]) @ np.vstack([along_x.real, along_x.imag])
        return z if dx + dy else z + self._offset

    def mean(self) -> float:
        """Mean height over the patch (length), in closed form."""
        a, kx, ky, phi = self._waves
        hx, hy = 0.5 * self.L * kx, 0.5 * self.L * ky
        return self._offset - float(np.sum(a * np.cos(phi + hx + hy) * np.sinc(hx / np.pi) * np.sinc(hy / np.pi)))

    def curvature_bound(self) -> float:
        a, kx, ky, _ = self._waves
        return float(a @ (kx**2 + ky**2))
