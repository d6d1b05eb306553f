"""A measured or computed height map on a regular grid, interpolated by a spline."""

from __future__ import annotations

import itertools
import json
import math
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.errors import InputError, warn
from asperity.runtime.files import UNREADABLE, real
from asperity.surface.base import Surface, SurfaceWarning, check, check_positive, nodes, short_wave_share
from asperity.surface.height_files import REGULAR, read_heights
from asperity.surface.maximum import global_maximum
from asperity.surface.patch import as_patch, check_heights, check_square
from asperity.surface.scale_space import Heights, ScaleSpace, gaussian_filtered, spline_gain, spline_heights
from asperity.surface.spline import DEGREE, interpolate, spline_rms, with_middles
from asperity.surface.statistics import SurfaceStatistics

if TYPE_CHECKING:
    from scipy.interpolate import BivariateSpline


_FIRST = 0.225  # width that the levels of smoothed maps start from, over the distance of the heights
_SPACING = 0.5  # distance of the heights of a smoothed map over its width
_RINGS = 0.75  # width below which the spline of smoothed heights overshoots at steps, over the distance of the heights
_TREND = 8  # degree of the polynomial trend removed before the waves are separated by length
_SAME = 1e-6  # greatest difference of opposite edges of a periodic map, over the range of heights


@dataclass(frozen=True, eq=False, kw_only=True)
class HeightMap(Surface):
    """Heights on a regular grid over a square patch, interpolated by a bicubic spline.

    Files: see `height_files.read_heights`. z has the index order [iy, ix]; its first and last rows and columns lie on
    the edges of the patch. Spacings in x and y may differ, but the patch must be square; the origin is shifted to
    (0, 0). All lengths in metres.

    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from asperity.surface import HeightMap
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "map.npz"
    ...     np.savez(path, z=np.tile(np.linspace(0.0, 1e-8, 9), (9, 1)), L=1e-6)
    ...     surface = HeightMap(path=path)
    >>> surface.L, round(float(surface.height(5e-7, 5e-7)) * 1e9, 6)
    (1e-06, 5.0)

    Attributes:
        path: the file
        L: side of the patch (length); required if the file has no coordinates, checked against them otherwise
    """

    path: str | Path
    L: float = None  # type: ignore[assignment]  # from the file, see __post_init__

    kind: ClassVar[str] = "file"
    rough: ClassVar[bool] = True
    smoother: ClassVar[str] = "a filtered map"
    cutoff_key: ClassVar[str] = "asperity import-map --cutoff"

    def __post_init__(self) -> None:
        check(isinstance(self.path, (str, Path)), "path", self.path, "the name of a file")
        if self.L is not None:
            check_positive("L", self.L)
        read = read_heights(Path(self.path))
        for note in read.notes:
            warn(f"{self.path}: {note}", SurfaceWarning)
        z, L = as_patch(read, self.L, f"{self.path}: ")
        z.flags.writeable = False
        object.__setattr__(self, "L", float(L))
        object.__setattr__(self, "_z", z)
        _ = self.left_out  # is judged with the rest of the file

    @classmethod
    def of(cls, z: Array, L: float | tuple[float, float]) -> HeightMap:
        """Map of heights that are in no file.

        Args:
            z: finite heights (ny, nx), index [iy, ix], the outer ones on the edges of the patch (length)
            L: side of the patch, or its two equal sides along x and y, which heights in unequal distances need (length)

        Raises:
            InputError: another shape, a height that is not finite, or an illegal side
        """
        z = np.asarray(z, dtype=float)
        check_heights(z)
        if not isinstance(L, tuple):
            check_square(z)
        side, other = L if isinstance(L, tuple) else (L, L)
        check_positive("L", side)
        check(math.isclose(side, other, rel_tol=REGULAR), "L", L, "two equal sides")
        surface = object.__new__(cls)
        for name, value in {"path": "", "L": float(side), "_z": z}.items():
            object.__setattr__(surface, name, value)
        return surface

    @cached_property
    def left_out(self) -> tuple[float, float, float] | None:
        """Waves left out because of the instrument, as `asperity import-map` has written them into the file.

        Their greatest wavelength (length), and the change of force and area of a light contact by what the instrument
        shows of them.
        """
        if Path(self.path).suffix.lower() != ".npz":
            return None
        try:
            with np.load(self.path, allow_pickle=False) as file:  # reads this array only
                if "left_out" not in file:
                    return None
                wavelength, force, area = map(float, real(file["left_out"]).ravel())
        except UNREADABLE:
            wavelength = force = area = math.nan
        if not (0.0 < wavelength < math.inf and math.isfinite(force) and math.isfinite(area)):
            raise InputError(
                f"{self.path}: the array left_out must hold three numbers, a wavelength and the changes of force and "
                "area, as asperity import-map writes it; leave it out"
            )
        return wavelength, force, area

    @cached_property
    def about(self) -> dict[str, Any]:
        """How `asperity import-map` has read the map: file, channel, treatment; empty for other maps."""
        if Path(self.path).suffix.lower() != ".npz":
            return {}
        with suppress(*UNREADABLE), np.load(self.path, allow_pickle=False) as file:
            found = json.loads(bytes(file["about"]))
            return found if isinstance(found, dict) else {}
        return {}

    @property
    def heights(self) -> Array:
        """Heights as read, (ny, nx), index [iy, ix] (length)."""
        z: Array = self.__dict__["_z"]
        return z

    @cached_property
    def _interpolation(self) -> tuple[BivariateSpline, float]:
        return interpolate(self.heights, self.L)

    @property
    def _spline(self) -> BivariateSpline:
        return self._interpolation[0]

    @property
    def spline_rise(self) -> float:
        """Rise above all heights that the spline without limited slopes has (length), 0 if none is limited."""
        return self._interpolation[1]

    @property
    def limited(self) -> bool:
        """Whether the heights have steps or edges, at which the slopes of the spline are limited."""
        return self.spline_rise > 0.0

    @cached_property
    def _derivatives(self) -> dict[tuple[int, int], Any]:
        return {(0, 0): self._spline}

    def _derivative(self, dx: int, dy: int) -> Any:
        """Derivative as a spline, made once: it takes as long as 10,000 points."""
        if (dx, dy) not in self._derivatives:
            self._derivatives[dx, dy] = self._spline.partial_derivative(dx, dy)
        return self._derivatives[dx, dy]

    @property
    def feature_size(self) -> float:
        """Twice the larger sample spacing (length)."""
        return 2 * self.L / (min(self.heights.shape) - 1)

    @cached_property
    def _waves(self) -> tuple[list[Array], Array]:
        """Cosine transforms of the heights without a smooth trend, extended by a margin, and the wavelengths (length).

        Each of the two transforms extends the heights in another way beyond the edges: by odd reflection, which keeps
        the slope, and by even reflection. An edge that causes short waves in one of them causes none in the other.
        """
        from scipy.fft import dctn

        z, trends = self.heights, []
        for n in z.shape:
            s = np.linspace(-1, 1, n)
            trends.append(np.linalg.qr(np.polynomial.legendre.legvander(s, min(_TREND, n - 1)))[0])
        of_y, of_x = trends
        z = (z - of_y @ (of_y.T @ z @ of_x) @ of_x.T).astype(np.float32)  # enough for an rms value
        margins = [(m, m) for m in self._margins]
        straight = np.pad(z, margins, mode="reflect", reflect_type="odd")
        mirrored = np.pad(z, margins, mode="reflect", reflect_type="even")
        halves = [  # half waves per side
            np.arange(n) * (m - 1) / (n - 1) for n, m in zip(straight.shape, z.shape, strict=True)
        ]
        lengths = 2 * self.L / np.maximum(np.hypot(halves[0][:, None], halves[1]), 0.5)
        return [dctn(wide, type=1) for wide in (straight, mirrored)], lengths

    @property
    def _margins(self) -> tuple[int, ...]:
        """Nodes added at each end along y and x, an eighth of the map and a few more for a fast transform."""
        from scipy.fft import next_fast_len

        least = (n // 8 for n in self.heights.shape)
        return tuple(
            next(m for m in itertools.count(m) if next_fast_len(n + 2 * m - 1, real=True) == n + 2 * m - 1)
            for n, m in zip(self.heights.shape, least, strict=True)
        )

    def short_waves(self, wavelength: float, depth: float) -> float:
        """Rms height (length) of the waves shorter than a cut-off; see :meth:`Surface.short_waves`.

        It is evaluated over the samples less than `depth` below the highest one, and over those less than a quarter of
        it; the greater value counts, so that smooth parts elsewhere do not hide a rough summit.
        """
        from scipy.fft import idctn

        transforms, lengths = self._waves
        gap = self.heights.max() - self.heights
        part = short_wave_share(lengths, wavelength).astype(np.float32)
        found = []
        for waves in transforms:
            rest = idctn(waves * part, type=1)
            rest = rest[tuple(slice(m, n - m) for n, m in zip(rest.shape, self._margins, strict=True))]
            edge = [int(min(wavelength / self.L, 0.25) * n) for n in rest.shape]
            inner = tuple(slice(m, n - m) for n, m in zip(rest.shape, edge, strict=True))
            places = []
            for reached in (gap <= depth, gap <= 0.25 * depth):
                inside = rest[inner][reached[inner]]  # the transform rings at the edges
                places.append(inside if inside.size else rest[reached])
            found.append(max(float(np.sqrt(np.mean(np.square(heights, dtype=float)))) for heights in places))
        return min(found)

    def smoothed(self, x: ArrayLike, y: ArrayLike, s: ArrayLike) -> Array:
        return self._smoothed(self._scales, x, y, s)

    @cached_property
    def _scales(self) -> ScaleSpace:
        spacing = self.L / (max(self.heights.shape) - 1)
        if self.limited:
            return ScaleSpace(2 * _FIRST * spacing, 2 * self.L, self._limited_level)
        return ScaleSpace(_FIRST * spacing, 2 * self.L, self._level)

    @cached_property
    def _dense(self) -> HeightMap:
        """Map of heights twice as dense."""
        ny, nx = self.heights.shape
        return self.of(self.on_product(nodes(self.L, 2 * nx - 1), nodes(self.L, 2 * ny - 1)), (self.L, self.L))

    def _limited_level(self, s: float) -> Heights:
        """Smoothed heights, see :meth:`_level`; a spline of little smoothed samples would ring as without limits."""
        rings = 0 < s < _RINGS * self.L / (max(self.heights.shape) - 1)
        return self._dense._level(s) if rings else self._level(s)

    @cached_property
    def _cosines(self) -> Array:
        """Cosine transform of the heights."""
        from scipy.fft import dctn

        return np.asarray(dctn(self.heights, type=1))

    def _level(self, s: float) -> Heights:
        """Heights, as a function of points, smoothed with the standard deviation s (length).

        The Gaussian multiplies the cosine transform, so the map is mirrored at its edges; of a periodic map the Fourier
        transform. What is left has no waves shorter than a few s, and a coarser grid holds it.
        """
        from scipy.fft import idctn

        if s == 0:
            return self.height
        if self.periodic:
            return self._periodic_level(s)
        shape = self.heights.shape
        fewer = [min(n, max(8, math.ceil(self.L / (_SPACING * s)) + 1)) for n in shape]
        waves = self._cosines[: fewer[0], : fewer[1]].astype(np.float32)
        mean = float(self._cosines[0, 0]) / math.prod(2 * (n - 1) for n in shape)
        waves[0, 0] = 0.0
        for axis, (m, n) in enumerate(zip(fewer, shape, strict=True)):
            omega = np.linspace(0, np.pi, m)
            gain = np.exp(-((omega * s * (m - 1) / self.L) ** 2) / 2) / spline_gain(omega) * ((m - 1) / (n - 1))
            waves *= np.expand_dims(gain.astype(np.float32), 1 - axis)
        ny, nx = fewer
        spacing = self.L / (ny - 1), self.L / (nx - 1)
        return spline_heights(idctn(waves, type=1, overwrite_x=True), spacing, "mirror", mean)

    @cached_property
    def _fourier(self) -> Array:
        """Fourier coefficients of a period of the heights (ny - 1, (nx - 1)//2 + 1) (length)."""
        from scipy.fft import rfft2

        return np.asarray(rfft2(self.heights[:-1, :-1], norm="forward"))

    def _periodic_level(self, s: float) -> Heights:
        """Smoothed heights of a periodic map, see :meth:`_level`."""
        from scipy.fft import fftfreq, irfft2

        period = [n - 1 for n in self.heights.shape]
        ny, nx = (min(n, max(8, math.ceil(self.L / (_SPACING * s)))) for n in period)
        rows = np.rint(fftfreq(ny, 1 / ny)).astype(int)
        waves = self._fourier[rows, : nx // 2 + 1].copy()
        mean, waves[0, 0] = float(waves[0, 0].real), 0.0
        for axis, (k, n) in enumerate(((rows, ny), (np.arange(nx // 2 + 1), nx))):
            gain = np.exp(-((2 * np.pi * k * s / self.L) ** 2) / 2) / spline_gain(2 * np.pi * k / n)
            waves *= np.expand_dims(gain, 1 - axis)
        coefficients = irfft2(waves, s=(ny, nx), norm="forward")
        return spline_heights(coefficients, (self.L / ny, self.L / nx), "grid-wrap", mean)

    def _at(self, x: ArrayLike, y: ArrayLike, dx: int = 0, dy: int = 0) -> Array:
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        values = self._derivative(dx, dy)(x.ravel(), y.ravel(), grid=False)
        return np.asarray(values, dtype=float).reshape(x.shape)

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return self._at(x, y)

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        return self._at(x, y, 1, 0), self._at(x, y, 0, 1)

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        return self._at(x, y, 2, 0), self._at(x, y, 1, 1), self._at(x, y, 0, 2)

    # a tensor-product spline costs far less on a grid than at scattered points

    def on_product(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> Array:
        return np.asarray(self._derivative(dx, dy)(x, y).T)

    def mean(self) -> float:
        """Exact mean of the spline over the patch (length)."""
        return float(self._spline.integral(0, self.L, 0, self.L)) / self.L**2

    @cached_property
    def periodic(self) -> bool:
        """Whether the first and last rows and columns agree, and are no sharper an edge than there are inside.

        The difference of the slopes on the two sides of the edge, from node to node, is compared with that at the other
        nodes: its rms value may be twice as large.
        """
        z, found = self.heights, []
        for rows in (z, z.T):
            bend = np.diff(rows, 2, axis=0)
            across = (rows[1] - rows[0]) - (rows[-1] - rows[-2])
            same = np.allclose(rows[0], rows[-1], rtol=0.0, atol=_SAME * np.ptp(z))
            found.append(same and np.sqrt(np.mean(across**2)) <= 2.0 * np.sqrt(np.mean(bend**2)))
        return all(found)

    def exact_rms(self) -> tuple[float, float, float]:
        """(Sq, rms slope, rms curvature) of the spline over the patch; see :func:`spline_rms`."""
        return self._exact_rms

    @cached_property
    def _exact_rms(self) -> tuple[float, float, float]:
        return spline_rms(self._spline.tck[:2], self._coefficients)

    def rms_slope(self) -> float:
        """sqrt(<|grad z|^2>) of the spline over the patch (dimensionless)."""
        return self.exact_rms()[1]

    def statistics(self, n: int = 1025) -> SurfaceStatistics:
        """Roughness parameters, those of :meth:`exact_rms` exactly, the others of an n x n grid."""
        Sq, slope, curvature = self.exact_rms()
        return replace(super().statistics(n), Sq=Sq, rms_slope=slope, rms_curvature=curvature)

    def cut_off(self, wavelength: float) -> HeightMap:
        """Map after a Gaussian filter with 50 % transmission at a wavelength (length)."""
        return self.of(gaussian_filtered(self.heights, sides := (self.L, self.L), wavelength), sides)

    def curvature_bound(self) -> float:
        """Bound of the Hessian (1/length) from the convex hull of the spline coefficients."""
        return self._curvature_bound

    @cached_property
    def _curvature_bound(self) -> float:
        xx, xy, yy = (float(np.abs(self._coefficients(*order)).max()) for order in ((2, 0), (1, 1), (0, 2)))
        return max(xx, yy) + xy

    def _coefficients(self, dx: int, dy: int) -> Array:
        """B-spline coefficients of a derivative, index [iy, ix]; degree and number are less by its order."""
        c = self._derivative(dx, dy).tck[2]
        nx, ny = (len(t) - DEGREE - 1 for t in self._spline.get_knots())
        return np.asarray(c).reshape(nx - dx, ny - dy).T

    @cached_property
    def _maximum(self) -> tuple[float, float, float]:
        x, y = (with_middles(np.unique(t)) for t in self._spline.get_knots())
        return global_maximum(self, (x, y))
