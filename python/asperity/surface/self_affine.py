"""Self-affine surfaces with a roll-off: random waves whose power spectrum is a power law beyond the roll-off."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.runtime.declaration import LENGTH, Flag, Positive, Real, Whole, declared, key
from asperity.surface.base import check, short_wave_share
from asperity.surface.spline_surface import ScaleSpace, SplineSurface, quintic_gain

if TYPE_CHECKING:
    from scipy.interpolate import BivariateSpline

_MOST = 2048  # waves of the shortest length along a side of the period
_PER_WAVE, _NODES = (4, 8), (256, 4096)  # nodes of the spline: at least and usual ones on the shortest wave; a side's
_SUMMED = 256  # waves per period up to which the ideal spectrum is summed; beyond that it is integrated


@declared("surface", eq=False, kw_only=True)
class SelfAffine(SplineSurface):
    """Self-affine surface with roll-off and cut-off on [0, L]^2.

    Its spectrum is C(q) = const up to q_r = 2 pi/lambda_roll, or zero with plateau = False, C ~ q^(-2-2H) up to
    q_s = 2 pi/lambda_short, and zero beyond (Persson et al., J. Phys.: Condens. Matter 17 (2005) R1; conventions of
    Jacobs, Junge and Pastewka, Surf. Topogr.: Metrol. Prop. 5 (2017) 013001). The wave vectors are all those of a
    square lattice. Every wave has exactly the amplitude of the spectrum, sqrt(2 C) times 2 pi over the period, and a
    random phase: surfaces of different seeds have the same rms height and slope over a period.

    The waves are summed once, by an FFT, at the nodes of a quintic spline: eight on the shortest wave up to 512 of them
    on a period, four at least beyond. A wave with p nodes is wrong by 2/p^6 of its height, by p times as much of its
    slope and by p^2 times as much of its curvature.

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
    lambda_roll: Positive = key("roll-off wavelength", LENGTH, default=None, shown="L")
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
    plateau: Flag = key("the spectrum is constant beyond lambda_roll; false: there are no longer waves", default=True)
    aspect: Real = key("anisotropy: features are longer along x by this factor", default=1.0, ge=0.0625, le=16)
    seed: Whole = key("seed of the random phases", default=0, ge=0, lt=2**63)
    periodic: Flag = key("opposite edges agree; false: a window of a surface with the period 2 L", default=True)

    kind: ClassVar[str] = "self-affine"
    rough: ClassVar[bool] = True
    cutoff_key: ClassVar[str] = "surface.lambda_short"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._complete(lambda_roll=self.L)
        period = f"the period, {self.period:g} by surface.L and surface.periodic"
        rule = f"a length up to {period}, and not below surface.lambda_short = {self.lambda_short:g}"
        check(self.lambda_short <= self.lambda_roll <= self.period, "lambda_roll", self.lambda_roll, rule)
        least = self.period / _MOST * self._stretch
        stretched = f"with surface.aspect = {self.aspect:g}"
        rule = f"at least {least:.3g}, for no more than {_MOST} waves along {period}, {stretched}"
        check(self.lambda_short >= least, "lambda_short", self.lambda_short, rule)
        rule = f"at most half of surface.lambda_roll = {self.lambda_roll:g} without a plateau"
        check(self.plateau or 2 * self.lambda_short <= self.lambda_roll, "lambda_short", self.lambda_short, rule)
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
        over_roll = np.sqrt(self.aspect * n**2 + m**2 / self.aspect) * (self.lambda_roll / self.period)
        with np.errstate(divide="ignore"):
            law = over_roll ** (-1 - self.H)
        return np.asarray(np.minimum(1.0, law) if self.plateau else np.where(over_roll < 1 - 1e-12, 0.0, law))

    def with_cutoff(self, lambda_short: float) -> SelfAffine:
        """Same surface with waves down to another shortest wavelength (length)."""
        return replace(self, lambda_short=lambda_short, rms_height=self._ideal_rms, slope=None)

    @cached_property
    def _ideal_sum(self) -> float:
        """Mean square of the heights with waves of all lengths, with amplitude 1 at the roll-off."""
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
        square = np.sum((np.abs(self._unit) * 2 * np.pi / self._wave_lengths) ** 2) / 2
        return self.slope * math.sqrt(self._ideal_sum / square)

    @cached_property
    def _unit(self) -> Array:
        """Complex amplitudes of the waves (2 S + 1, S + 1), 1 at the roll-off.

        Rows m = -S to S are waves per period along y, columns n = 0 to S along x; zero where n = 0 and m <= 0.
        """
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
        return waves

    @cached_property
    def _waves(self) -> Array:
        """The same waves with their amplitudes (length)."""
        return np.asarray(self._ideal_rms / math.sqrt(self._ideal_sum) * self._unit)

    @property
    def _wave_numbers(self) -> tuple[Array, Array]:
        """Angular wave numbers of the waves along y (2 S + 1, 1) and along x (1, S + 1) (1/length)."""
        k, most = 2 * np.pi / self.period, self._shortest
        return k * np.arange(-most, most + 1)[:, None], k * np.arange(most + 1)[None, :]

    @cached_property
    def _wave_lengths(self) -> Array:
        ky, kx = self._wave_numbers
        return 2 * np.pi / np.maximum(np.hypot(kx, ky), np.pi / self.period)

    @property
    def feature_size(self) -> float:
        """The shortest wavelength along x or y (length)."""
        return self.lambda_short / self._stretch

    def short_waves(self, wavelength: float, depth: float) -> float:
        part = short_wave_share(self._wave_lengths, wavelength)
        return float(np.sqrt(np.sum(np.abs(self._waves * part) ** 2) / 2))

    def _make_spline(self) -> BivariateSpline:
        from scipy.fft import next_fast_len
        from scipy.interpolate import BivariateSpline

        least, usual = (k * self._shortest for k in _PER_WAVE)
        n = next_fast_len(max(least, min(max(usual, _NODES[0]), _NODES[1])), real=True)
        gain = [quintic_gain(k * (self.period / n)) for k in self._wave_numbers]
        nodes = _synthesis(self._waves / (gain[0] * gain[1]), n)
        knots = np.arange(-5.0, n + 6) * (self.period / n)
        return BivariateSpline._from_tck((knots, knots, np.pad(nodes, (2, 3), mode="wrap").ravel(), 5, 5))

    def _at(self, x: ArrayLike, y: ArrayLike, dx: int = 0, dy: int = 0) -> Array:
        return super()._at(np.mod(x, self.period), np.mod(y, self.period), dx, dy)

    def mean(self) -> float:
        """Mean height over the patch (length), in closed form; 0 for a periodic surface."""
        ky, kx = (k * self.L / 2 for k in self._wave_numbers)
        over = np.exp(1j * ky) * np.sinc(ky / np.pi), np.exp(1j * kx) * np.sinc(kx / np.pi)
        return 0.0 if self.periodic else float((over[0].T @ self._waves @ over[1].T).real.item())

    def _moment(self, order: int) -> float:
        """Mean of |grad^order z|^2 over a period (length^(2 - 2 order))."""
        lengths = self._wave_lengths
        return float(np.sum(np.abs(self._waves * (2 * np.pi / lengths) ** order) ** 2)) / 2

    def exact_rms(self) -> tuple[float, float, float]:
        """(Sq, rms slope, rms curvature) over a period in closed form.

        Units: length, 1, 1/length; curvature is half the Laplacian, as in SurfaceStatistics.
        """
        return math.sqrt(self._moment(0)), math.sqrt(self._moment(1)), math.sqrt(self._moment(2)) / 2

    def rms_slope(self) -> float:
        """sqrt(<|grad z|^2>) (dimensionless): over a period in closed form, or over the patch."""
        return math.sqrt(self._moment(1)) if self.periodic else super().rms_slope()

    @cached_property
    def _scales(self) -> ScaleSpace:
        from scipy.fft import next_fast_len

        n = next_fast_len(4 * self._shortest, real=True)  # nodes for a spline of the shortest wave
        s = np.arange(n) * (self.period / n)
        return ScaleSpace(self.height, self.on_product(s, s), self.period, self.feature_size / (4 * np.pi))


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
