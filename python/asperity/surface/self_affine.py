"""Self-affine surfaces with a roll-off: random waves whose power spectrum is a constant followed by a power law."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.runtime.declaration import LENGTH, Flag, Positive, Real, Whole, declared, key
from asperity.surface.base import Surface, check, short_wave_share
from asperity.surface.maximum import global_maximum
from asperity.surface.scale_space import ScaleSpace

_DEVIATIONS = 10.0  # waves of random phases exceed this many with a probability below exp(-50) (Chernoff)
_MOST = 2048  # waves of the shortest length along a side of the period: grids of 8192 x 8192 nodes
_SUMMED = 256  # waves per period up to which the ideal spectrum is summed; beyond that it is integrated
_WIDTH = 12  # nodes under the kernel along each axis
_SHAPE = 28.0  # of the kernel, for twice the density: least error
_LEAST = 3 * _WIDTH  # nodes of a period
_CHUNK = 2**13  # points at once: 9 MiB of gathered nodes


@declared("surface", eq=False, kw_only=True)
class SelfAffine(Surface):
    """Self-affine surface with roll-off and cut-off on [0, L]^2.

    Its spectrum is C(q) = const up to q_r = 2 pi/lambda_roll, C ~ q^(-2-2H) up to q_s = 2 pi/lambda_short, and zero
    beyond (Persson et al., J. Phys.: Condens. Matter 17 (2005) R1; conventions of Jacobs, Junge and Pastewka, Surf.
    Topogr.: Metrol. Prop. 5 (2017) 013001). The wave vectors are all those of a square lattice. Every wave has exactly
    the amplitude of the spectrum, sqrt(2 C) times 2 pi over the period, and a random phase: surfaces of different seeds
    have the same rms height and slope over a period.

    A shorter lambda_short with the same seed, H, lambda_roll, aspect and rms_height adds waves to the same surface;
    :meth:`with_cutoff` does so whatever sets the height.

    >>> from asperity.surface import SelfAffine
    >>> surface = SelfAffine(L=1e-6, H=0.8, slope=0.1, lambda_roll=0.5e-6, lambda_short=0.05e-6, seed=1)
    >>> round(surface.rms_slope(), 12), surface.periodic
    (0.1, True)
    >>> surface.with_cutoff(0.1e-6).rms_slope() < 0.1
    True

    Attributes:
        lambda_short: shortest wavelength (length); at least 1/2048 of the period
        lambda_roll: roll-off wavelength (length), up to the period
        rms_height: root of the mean square of the heights about their mean over a period (length). The long waves do
            not depend on the cut-off. The surface itself has a little less, see :meth:`exact_rms`.
        slope: sqrt(<|grad z|^2>) over a period (dimensionless); the key of a case is rms_slope
        aspect: the spectrum depends on q = sqrt(aspect qx^2 + qy^2/aspect), and the rms height stays
        seed: of the phases. Wave vectors are counted outwards, in squares max(|m|, |n|) = 1, 2, ..., and phases are
            drawn in this order by default_rng(seed).uniform(0, 2 pi).
        periodic: True: the period is L, heights and slopes agree at opposite edges. False: the period is 2 L, and the
            patch is one quarter of it, as a measurement is a window of a larger surface; opposite edges are then
            farthest apart, and waves longer than L tilt the patch.
    """

    H: Real = key("Hurst exponent", ge=0.001, le=1, hint="0.8 is a usual value")
    lambda_short: Positive = key("shortest wavelength", LENGTH, hint="0.05 L for a first run")
    lambda_roll: Positive | None = key("roll-off wavelength", LENGTH, default=None, shown="L")
    rms_height: Real | None = key(
        "rms height with the waves shorter than lambda_short included (or rms_slope)",
        LENGTH,
        default=None,
        share=(1e-9, 1.0),
    )
    # rms_slope() is a method of every surface
    slope: Annotated[Real | None, Field(serialization_alias="rms_slope")] = key(
        "rms slope of the waves down to lambda_short (or rms_height)", default=None, gt=0, le=10
    )
    aspect: Real = key("anisotropy: features are longer along x by this factor", default=1.0, ge=0.0625, le=16)
    seed: Whole = key("seed of the random phases", default=0, ge=0, lt=2**63)
    periodic: Flag = key("opposite edges agree; false: a window of a surface with the period 2 L", default=True)

    kind: ClassVar[str] = "self-affine"
    rough: ClassVar[bool] = True
    cutoff_key: ClassVar[str] = "surface.lambda_short"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "lambda_roll", self.L if self.lambda_roll is None else self.lambda_roll)
        assert self.lambda_roll is not None
        period = f"the period, {self.period:g} by surface.L and surface.periodic"
        rule = f"a length up to {period}, and not below surface.lambda_short = {self.lambda_short:g}"
        check(self.lambda_short <= self.lambda_roll <= self.period, "lambda_roll", self.lambda_roll, rule)
        least = self.period / _MOST * self._stretch
        stretched = f"with surface.aspect = {self.aspect:g}"
        rule = f"at least {least:.3g}, for no more than {_MOST} waves along {period}, {stretched}"
        check(self.lambda_short >= least, "lambda_short", self.lambda_short, rule)
        if (self.rms_height is None) == (self.slope is None):
            state = "both missing" if self.slope is None else "both given"
            raise InputError(f"surface.rms_height and surface.rms_slope are {state}; give exactly one of them.")
        check(self._shortest >= 1, "lambda_short", self.lambda_short, f"shorter than {period}, {stretched}")

    @property
    def period(self) -> float:
        """Side of the square after which the heights repeat (length)."""
        return self.L if self.periodic else 2 * self.L

    @property
    def _stretch(self) -> float:
        """Ratio of lambda_short to the shortest wavelength along x or y."""
        return math.sqrt(max(self.aspect, 1 / self.aspect))

    @property
    def _shortest(self) -> int:
        """Waves of the shortest length along a side of the period."""
        return math.floor(self.period / self.lambda_short * self._stretch * (1 + 1e-12))

    def _shape(self, m: Array, n: Array) -> Array:
        """Amplitudes over that at the roll-off of waves with m along y and n along x per period."""
        assert self.lambda_roll is not None
        over_roll = np.sqrt(self.aspect * n**2 + m**2 / self.aspect) * (self.lambda_roll / self.period)
        with np.errstate(divide="ignore"):
            return np.asarray(np.minimum(1.0, over_roll ** (-1 - self.H)))

    def with_cutoff(self, lambda_short: float) -> SelfAffine:
        """Same surface with waves down to another shortest wavelength (length)."""
        return replace(self, lambda_short=lambda_short, rms_height=self._ideal_rms, slope=None)

    @cached_property
    def _ideal_sum(self) -> float:
        """Mean square of the heights with waves of all lengths, with amplitude 1 at the roll-off."""
        assert self.lambda_roll is not None
        roll = self.period / self.lambda_roll
        reach = max(float(_SUMMED), 4 * roll)
        most = math.floor(reach * self._stretch)
        n, m = np.arange(most + 1.0)[None, :], np.arange(most + 1.0)[:, None]
        copies = (1.0 + (n > 0)) * (1.0 + (m > 0)) / 2  # of the quarter, in half of the plane
        inside = (self.aspect * n**2 + m**2 / self.aspect <= reach**2) & (n + m > 0)
        summed = np.sum(copies * inside * np.where(inside, self._shape(m, n), 0.0) ** 2) / 2
        return float(summed + math.pi * roll**2 / (4 * self.H) * (roll / reach) ** (2 * self.H))

    @cached_property
    def _ideal_rms(self) -> float:
        """Rms height with waves of all lengths (length)."""
        if self.rms_height is not None:
            return self.rms_height
        assert self.slope is not None
        ky, kx = self._unit.wave_numbers
        square = np.sum(np.abs(self._unit.waves) ** 2 * (kx**2 + ky**2)) / 2
        return self.slope * math.sqrt(self._ideal_sum / square)

    @cached_property
    def _unit(self) -> WaveGrid:
        """The waves, with amplitude 1 at the roll-off."""
        most = self._shortest
        s = np.repeat(np.arange(1, most + 1), 4 * np.arange(1, most + 1))
        j = np.arange(s.size) - 2 * s * (s - 1)  # outwards square by square, each from the y axis anticlockwise
        m = np.where(j < s, s, np.where(j < 3 * s, 2 * s - j, -s))
        n = np.where(j < s, j, np.where(j < 3 * s, s, 4 * s - j))
        phase = np.random.default_rng(self.seed).uniform(0, 2 * np.pi, s.size)
        q2 = self.aspect * n.astype(float) ** 2 + m.astype(float) ** 2 / self.aspect
        kept = q2 <= (self.period / self.lambda_short * (1 + 1e-12)) ** 2
        m, n, phase = m[kept], n[kept], phase[kept]
        waves = np.zeros((2 * most + 1, most + 1), dtype=complex)
        waves[m + most, n] = self._shape(m.astype(float), n.astype(float)) * np.exp(1j * phase)
        return WaveGrid(waves, self.period)

    @cached_property
    def _waves(self) -> WaveGrid:
        scale = self._ideal_rms / math.sqrt(self._ideal_sum)
        return WaveGrid(scale * self._unit.waves, self.period)

    @cached_property
    def _wave_lengths(self) -> Array:
        ky, kx = self._waves.wave_numbers
        return 2 * np.pi / np.maximum(np.hypot(kx, ky), np.pi / self.period)

    @property
    def feature_size(self) -> float:
        """The shortest wavelength along x or y (length)."""
        return self.lambda_short / self._stretch

    def short_waves(self, wavelength: float, depth: float) -> float:
        part = short_wave_share(self._wave_lengths, wavelength)
        return float(np.sqrt(np.sum(np.abs(self._waves.waves * part) ** 2) / 2))

    def _at(self, x: ArrayLike, y: ArrayLike, orders: list[tuple[int, int]]) -> list[Array]:
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        return [values.reshape(x.shape) for values in self._waves.at(x.ravel(), y.ravel(), orders)]

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return self._at(x, y, [(0, 0)])[0]

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        zx, zy = self._at(x, y, [(0, 1), (1, 0)])
        return zx, zy

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        xx, xy, yy = self._at(x, y, [(0, 2), (1, 1), (2, 0)])
        return xx, xy, yy

    def on_product(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> Array:
        return self._waves.product(x, y, (dy, dx))

    def mean(self) -> float:
        """Mean height over the patch (length), in closed form; 0 for a periodic surface."""
        ky, kx = (k * self.L / 2 for k in self._waves.wave_numbers)
        over = np.exp(1j * ky) * np.sinc(ky / np.pi), np.exp(1j * kx) * np.sinc(kx / np.pi)
        return 0.0 if self.periodic else float((over[0].T @ self._waves.waves @ over[1].T).real.item())

    def _moment(self, order: int) -> float:
        """Mean of |grad^order z|^2 over a period (length^(2 - 2 order))."""
        lengths = self._wave_lengths
        return float(np.sum(np.abs(self._waves.waves * (2 * np.pi / lengths) ** order) ** 2)) / 2

    def exact_rms(self) -> tuple[float, float, float]:
        """(Sq, rms slope, rms curvature) over a period in closed form.

        Units: length, 1, 1/length; curvature is half the Laplacian, as in SurfaceStatistics.
        """
        return math.sqrt(self._moment(0)), math.sqrt(self._moment(1)), math.sqrt(self._moment(2)) / 2

    def rms_slope(self) -> float:
        """sqrt(<|grad z|^2>) (dimensionless): over a period in closed form, or over the patch."""
        return math.sqrt(self._moment(1)) if self.periodic else super().rms_slope()

    def curvature_bound(self) -> float:
        return float(np.sum(np.abs(self._waves.waves) * (2 * np.pi / self._wave_lengths) ** 2))

    @cached_property
    def _maximum(self) -> tuple[float, float, float]:
        return global_maximum(self, K=min(self.curvature_bound(), _DEVIATIONS * math.sqrt(self._moment(2))))

    def smoothed(self, x: ArrayLike, y: ArrayLike, s: ArrayLike) -> Array:
        return self._scales.heights(x, y, s)

    @cached_property
    def _scales(self) -> ScaleSpace:
        from scipy.fft import next_fast_len

        n = next_fast_len(4 * self._shortest, real=True)  # nodes for a spline of the shortest wave
        s = np.arange(n) * (self.period / n)
        return ScaleSpace(self.height, self.on_product(s, s), self.period, self.feature_size / (4 * np.pi))


class WaveGrid:
    """The function Re sum c exp(2 pi i (m y + n x)/period), with derivatives to the second, at any points.

    It is interpolated from a grid by a non-uniform FFT of type 2: the waves are divided by the transform of a kernel of
    small support, summed on a grid of twice the necessary density, and the kernel is applied at each point (Greengard
    and Lee, SIAM Review 46 (2004) 443; the kernel of Kaiser and Bessel: Jackson et al., IEEE Trans. Med. Imaging 10
    (1991) 473).

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
