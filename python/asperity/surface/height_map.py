"""A measured or computed height map on a regular grid, interpolated by a spline that does not ring at steps.

Of a smooth map it is a cubic spline: where that rises above the heights around a cell, as it does at a summit between
them, neighbours agree on the parabola. Steps, scratches and single pits have no such neighbours, and a cubic spline has
summits beside them that are not there. Of a map with these the slopes at the heights are those of monotone cubics
(Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300), which exceed no height. The bicubic Hermite polynomials
of these slopes are a spline with double knots.
"""

from __future__ import annotations

import json
import math
from contextlib import suppress
from dataclasses import field as dataclass_field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import PlainSerializer, WithJsonSchema

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.runtime.declaration import LENGTH, SCRIPT, declared, key
from asperity.runtime.files import UNREADABLE
from asperity.surface.base import Side, light_depth, short_wave_share
from asperity.surface.height_files import ARRAYS, EXACT, TEXT, steps_of
from asperity.surface.maximum import global_maximum
from asperity.surface.scans import HeightField
from asperity.surface.shapes import Flat
from asperity.surface.spline_surface import ScaleSpace, SplineSurface

if TYPE_CHECKING:
    from scipy.interpolate import BivariateSpline


MOST = 6000  # heights along a side: beyond it the spline and its derivatives need more than 6 GiB
DEEPEST, FARTHEST = 10.0, 1e6  # greatest plausible peak-to-valley height and distance of heights from zero [L]
MATTERS = 0.03  # rise of a cubic spline above what neighbours agree on, over the depth of a light contact
AGREED = 2.0  # rise that is believed, over that of the lesser parabola of two neighbours
_FIRST = 0.225  # width that the levels of smoothed maps start from, over the distance of the heights
_TREND = 8  # degree of the polynomial trend removed before the waves are separated by length
_SAME = 1e-6  # greatest difference of opposite edges of a periodic map, over the range of heights


@declared("surface", eq=False, kw_only=True)
class HeightMap(SplineSurface):
    """Heights on a regular grid over a square patch, interpolated by a bicubic spline.

    Files: see `scans.HeightField.read`. z has the index order [iy, ix]; its first and last rows and columns lie on
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
    """

    path: Annotated[str | Path, WithJsonSchema({"type": "string"}), PlainSerializer(str)] = key(
        "file .npz, .npy or .csv", hint="a path relative to the case file"
    )
    L: Side = key(
        "side of the square patch", LENGTH, default=None, shown="that of the file, required where it has none"
    )

    field: Annotated[Any, *SCRIPT] = dataclass_field(default=None, repr=False)  # the HeightField

    kind: ClassVar[str] = "file"
    rough: ClassVar[bool] = True
    cutoff_key: ClassVar[str] = "asperity import-map --cutoff"

    def __post_init__(self) -> None:
        where = f"{self.path}: " if self.field is None else ""
        if where and Path(self.path).suffix.lower() not in (*ARRAYS, *TEXT):
            raise InputError(
                f"{where}a case reads {', '.join((*ARRAYS, *TEXT))}; asperity import-map makes a surface of the files "
                "of instruments"
            )
        self._complete(field=HeightField.read(self.path, side=self.L) if self.field is None else None)
        _check_patch(self.field, where)
        object.__setattr__(self, "L", Flat(L=self.field.size[0]).L)  # which refuses a side that is not legal
        super().__post_init__()

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
        return cls(path="", field=HeightField(z, *steps_of(z, L)))

    @property
    def heights(self) -> Array:
        """Heights of the map (ny, nx), index [iy, ix] (length)."""
        z: Array = self.field.z
        return z

    @property
    def notes(self) -> tuple[str, ...]:
        """How the file was read."""
        return tuple(f"{self.path}: {note}" for note in self.field.notes)

    @cached_property
    def about(self) -> dict[str, Any]:
        """How `asperity import-map` has read the map: file, channel, treatment; empty for other maps."""
        if Path(self.path).suffix.lower() == ".npz":
            with suppress(*UNREADABLE), np.load(self.path, allow_pickle=False) as file:
                found = json.loads(bytes(file["about"]))
                return found if isinstance(found, dict) else {}
        return {}

    @cached_property
    def spline_rise(self) -> float:
        """Rise above the heights that a cubic spline has (length), 0 where the surface is that spline."""
        rise = _ringing(self.heights, self._cubic(*map(_with_middles, self._nodes)))
        return rise if rise > MATTERS * light_depth(self.heights) else 0.0

    @property
    def _nodes(self) -> tuple[Array, Array]:
        """Places of the heights along y (ny,) and along x (nx,) (length)."""
        ny, nx = self.heights.shape
        return np.linspace(0, self.L, ny), np.linspace(0, self.L, nx)

    @cached_property
    def _cubic(self) -> BivariateSpline:
        from scipy.interpolate import RectBivariateSpline

        return RectBivariateSpline(*self._nodes, self.heights, s=0)

    def _make_spline(self) -> BivariateSpline:
        return _limited(self.heights, *self._nodes) if self.spline_rise else self._cubic

    @property
    def feature_size(self) -> float:
        """Twice the larger sample spacing (length)."""
        return 2 * self.L / (min(self.heights.shape) - 1)

    @cached_property
    def _waves(self) -> tuple[Array, Array]:
        """Cosine transform of the heights without a smooth trend, and the wavelengths (length).

        A margin extends them beyond the edges by odd reflection, which keeps the slope.
        """
        from scipy.fft import dctn

        z, trends = self.heights, []
        for n in z.shape:
            s = np.linspace(-1, 1, n)
            trends.append(np.linalg.qr(np.polynomial.legendre.legvander(s, min(_TREND, n - 1)))[0])
        of_y, of_x = trends
        z = (z - of_y @ (of_y.T @ z @ of_x) @ of_x.T).astype(np.float32)  # enough for an rms value
        wide = np.pad(z, [(n // 8, n // 8) for n in z.shape], mode="reflect", reflect_type="odd")
        halves = [np.arange(n) * (m - 1) / (n - 1) for n, m in zip(wide.shape, z.shape, strict=True)]  # half waves
        lengths = 2 * self.L / np.maximum(np.hypot(halves[0][:, None], halves[1]), 0.5)
        return dctn(wide, type=1), lengths

    def short_waves(self, wavelength: float, depth: float) -> float:
        """Rms height (length) of the waves shorter than a cut-off; see :meth:`Surface.short_waves`.

        It is evaluated over the samples less than `depth` below the highest one, and over those less than a quarter of
        it; the greater value counts, so that smooth parts elsewhere do not hide a rough summit.
        """
        from scipy.fft import idctn

        waves, lengths = self._waves
        gap = self.heights.max() - self.heights
        rest = idctn(waves * short_wave_share(lengths, wavelength).astype(np.float32), type=1)
        rest = rest[tuple(slice(n // 8, n // 8 + n) for n in gap.shape)]
        edge = [int(min(wavelength / self.L, 0.25) * n) for n in rest.shape]
        inner = tuple(slice(m, n - m) for n, m in zip(rest.shape, edge, strict=True))
        found = []
        for reached in (gap <= depth, gap <= 0.25 * depth):
            inside = rest[inner][reached[inner]]  # the transform rings at the edges
            heights = inside if inside.size else rest[reached]
            found.append(float(np.sqrt(np.mean(np.square(heights, dtype=float)))))
        return max(found)

    @cached_property
    def _scales(self) -> ScaleSpace:
        """Levels of smoothed heights; the map is mirrored at its edges unless it is periodic."""
        z, first = self.heights, _FIRST * self.L / (max(self.heights.shape) - 1)
        if self.spline_rise:  # a spline of little smoothed samples would ring as one without limits
            y, x = (np.linspace(0.0, self.L, 2 * n - 1) for n in z.shape)
            z, first = self.on_product(x, y), 2 * first
        mean = float(z.mean())
        z = (z - mean).astype(np.float32)
        if self.periodic:
            return ScaleSpace(self.height, z[:-1, :-1], self.L, first, mean)
        return ScaleSpace(
            self.height, np.pad(z, [(0, n - 2) for n in z.shape], mode="reflect"), 2 * self.L, first, mean
        )

    def mean(self) -> float:
        """Exact mean of the spline over the patch (length)."""
        return float(self._derivatives[0, 0].integral(0, self.L, 0, self.L)) / self.L**2

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

    @cached_property
    def _maximum(self) -> tuple[float, float, float]:
        y, x = (_with_middles(np.unique(t)) for t in self._derivatives[0, 0].get_knots())
        return global_maximum(self, (x, y))


def _check_patch(field: HeightField, where: str) -> None:
    """Refuse (InputError) a field that is not square, complete and plausible."""
    z, (L, other) = field.z, field.size
    ny, nx = z.shape
    if not math.isclose(L, other, rel_tol=EXACT):
        raise InputError(f"{where}the patch must be square, not {L:g} x {other:g}; import-map cuts one.")
    if max(z.shape) > MOST:
        raise InputError(
            f"{where}{nx} x {ny} heights are more than the {MOST} x {MOST} of a surface; cut a window (asperity "
            "import-map --window), or filter the map and keep every second height"
        )
    if len(bad := np.argwhere(np.isnan(z))):
        raise InputError(
            f"{where}{len(bad)} height(s) are not finite, the first at row {bad[0][0]}, column {bad[0][1]}; "
            "asperity import-map fills gaps."
        )
    if not (np.ptp(z / L) <= DEEPEST and np.abs(z / L).max() <= FARTHEST):
        raise InputError(
            f"{where}heights from {z.min():.3g} to {z.max():.3g} on a patch of side {L:.3g} are not plausible; "
            "give heights and surface.L in the same unit (m)."
        )


def _limited(z: Array, y: Array, x: Array) -> BivariateSpline:
    """Spline through heights (ny, nx) at y (ny,) and x (nx,) that exceeds none of them (length)."""
    from scipy.interpolate import BivariateSpline, PchipInterpolator

    slopes = (step * PchipInterpolator(at, z, axis=axis)(at, 1) for at, step, axis in ((x, x[1], 1), (y, y[1], 0)))
    signs, knots = [], []
    for n, step in zip(z.shape, (y[1], x[1]), strict=True):
        sign = np.tile([-1.0, 1.0], n) / 3.0
        sign[0] = sign[-1] = 0.0  # the end of the patch
        signs.append(sign)
        knots.append(step * np.repeat(np.arange(n), [4, *[2] * (n - 2), 4]))
    heights, dx, dy = (np.repeat(np.repeat(f, 2, axis=0), 2, axis=1) for f in (z, *slopes))
    c = heights + signs[1] * dx + signs[0][:, None] * dy
    return BivariateSpline._from_tck((*knots, c.ravel(), 3, 3))


def _ringing(z: Array, fine: Array) -> float:
    """Greatest rise of a spline above the highest height, beyond what neighbours explain.

    Args:
        z: heights (ny, nx) (length)
        fine: of the spline there and halfway between them (2 ny - 1, 2 nx - 1) (length)
    """
    from scipy.ndimage import maximum_filter

    believed: Array = np.zeros((len(z) - 1, z.shape[1] - 1))
    for heights, cells in ((z, believed), (z.T, believed.T)):
        bend = np.pad(np.maximum(-np.diff(heights, 2, axis=1), 0.0), ((0, 0), (1, 1)), mode="edge")
        both = np.minimum(bend[:, 1:], bend[:, :-1])
        cells += AGREED / 8.0 * np.maximum(both[1:], both[:-1])
    top = maximum_filter(fine, 3)[1::2, 1::2]
    explained = maximum_filter(z, 2)[1:, 1:] + believed
    return float(np.max(top - np.maximum(explained, z.max()), initial=0.0))


def _with_middles(t: Array) -> Array:
    """Ascending values and those halfway between them (2n - 1,)."""
    out = np.empty(2 * t.size - 1)
    out[::2], out[1::2] = t, 0.5 * (t[1:] + t[:-1])
    return out
