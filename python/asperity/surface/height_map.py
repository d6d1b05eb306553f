"""A measured or computed height map on a regular grid, interpolated by a spline."""

from __future__ import annotations

import json
import math
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import PlainSerializer, WithJsonSchema

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.runtime.declaration import LENGTH, declared, key
from asperity.runtime.files import UNREADABLE
from asperity.surface.base import Side, Surface, check, short_wave_share
from asperity.surface.height_files import REGULAR, UNEQUAL, Heights, read_heights
from asperity.surface.maximum import global_maximum
from asperity.surface.scale_space import ScaleSpace
from asperity.surface.shapes import Flat
from asperity.surface.spline import DEGREE, interpolate, with_middles

if TYPE_CHECKING:
    from scipy.interpolate import BivariateSpline


MOST = 6000  # heights along a side: beyond it the spline and its derivatives need more than 6 GiB
DEEPEST, FARTHEST = 10.0, 1e6  # greatest plausible peak-to-valley height and distance of heights from zero [L]
_FIRST = 0.225  # width that the levels of smoothed maps start from, over the distance of the heights
_TREND = 8  # degree of the polynomial trend removed before the waves are separated by length
_SAME = 1e-6  # greatest difference of opposite edges of a periodic map, over the range of heights


@declared("surface", eq=False, kw_only=True)
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
    """

    path: Annotated[str | Path, WithJsonSchema({"type": "string"}), PlainSerializer(str)] = key(
        "file .npz, .npy or .csv", hint="a path relative to the case file"
    )
    L: Side = key(
        "side of the square patch", LENGTH, default=None, shown="that of the file, required where it has none"
    )

    kind: ClassVar[str] = "file"
    rough: ClassVar[bool] = True
    cutoff_key: ClassVar[str] = "asperity import-map --cutoff"

    def __post_init__(self) -> None:
        read = read_heights(Path(self.path))
        z, L = _as_patch(read, self.L, f"{self.path}: ")
        z.flags.writeable = False
        notes = tuple(f"{self.path}: {note}" for note in read.notes)
        for name, value in {"L": Flat(L=L).L, "_z": z, "_notes": notes}.items():
            object.__setattr__(self, name, value)
        super().__post_init__()

    @property
    def notes(self) -> tuple[str, ...]:
        """How the file was read."""
        found: tuple[str, ...] = self.__dict__.get("_notes", ())
        return found

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
        _check_heights(z)
        if not isinstance(L, tuple):
            _check_square(z)
        side, other = L if isinstance(L, tuple) else (L, L)
        side = Flat(L=side).L  # refuses a side that is not legal
        check(math.isclose(side, other, rel_tol=REGULAR), "L", L, "two equal sides")
        surface = object.__new__(cls)
        for name, value in {"path": "", "L": float(side), "_z": z}.items():
            object.__setattr__(surface, name, value)
        return surface

    @cached_property
    def about(self) -> dict[str, Any]:
        """How `asperity import-map` has read the map: file, channel, treatment; empty for other maps."""
        if Path(self.path).suffix.lower() == ".npz":
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
    def spline_rise(self) -> float:
        """Rise above the heights that a spline without limited slopes has (length), 0 if none is limited."""
        return self._interpolation[1]

    @cached_property
    def _derivatives(self) -> dict[tuple[int, int], Any]:
        return {(0, 0): self._interpolation[0]}

    def _derivative(self, dx: int, dy: int) -> Any:
        """Derivative as a spline, made once: it takes as long as 10,000 points."""
        if (dx, dy) not in self._derivatives:
            self._derivatives[dx, dy] = self._derivatives[0, 0].partial_derivative(dx, dy)
        return self._derivatives[dx, dy]

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

    def smoothed(self, x: ArrayLike, y: ArrayLike, s: ArrayLike) -> Array:
        return self._scales.heights(x, y, s)

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

    @property
    def _knots(self) -> tuple[Array, Array]:
        """Ends of the polynomials of the spline along x and y (length)."""
        along_x, along_y = (np.unique(t) for t in self._derivatives[0, 0].get_knots())
        return along_x, along_y

    def curvature_bound(self) -> float:
        """Bound of the Hessian (1/length) from the convex hull of the spline coefficients."""
        xx, xy, yy = (float(np.abs(self._derivative(*order).tck[2]).max()) for order in ((2, 0), (1, 1), (0, 2)))
        return max(xx, yy) + xy

    @cached_property
    def _maximum(self) -> tuple[float, float, float]:
        x, y = self._knots
        return global_maximum(self, (with_middles(x), with_middles(y)))


def _as_patch(read: Heights, side: float | None, where: str) -> tuple[Array, float]:
    """Heights (ny, nx) and side of a square patch (length); `side` is None where the file has it."""
    z, dx, dy, L = read.z, read.dx, read.dy, side
    _check_heights(z, where)
    if dx is not None and dy is not None:
        L, other = dx * (z.shape[1] - 1), dy * (z.shape[0] - 1)
        if not np.isclose(L, other, rtol=REGULAR):
            raise InputError(f"{where}the patch must be square, not {L:g} x {other:g}; import-map cuts one.")
        if side is not None and not np.isclose(L, side, rtol=REGULAR):
            raise InputError(
                f"{where}surface.L = {side:g} disagrees with the side {L:g} found in it; leave surface.L out or "
                "correct it."
            )
    if L is None:
        raise InputError(f"surface.L is missing: {where}it holds no lengths; give it, or use import-map.")
    if dx is None:
        _check_square(z, where)
    depth, level = float(z.max() / L - z.min() / L), float(np.abs(z).max() / L)
    if not (depth <= DEEPEST and level <= FARTHEST):
        raise InputError(
            f"{where}heights from {z.min():.3g} to {z.max():.3g} on a patch of side {L:.3g} are not plausible; give "
            "heights and surface.L in the same unit (m)."
        )
    return z, float(L)


def _check_square(z: Array, where: str = "") -> None:
    """Refuse heights that a side alone would stretch to a square."""
    if z.shape[0] != z.shape[1]:
        raise InputError(
            f"{where}{UNEQUAL.format(*z.shape[::-1])}: write dx and dy, or x and y, beside z into an .npz file, or cut "
            "a square with asperity import-map --pixel"
        )


def _check_heights(z: Array, where: str = "") -> None:
    if z.ndim != 2 or min(z.shape) <= DEGREE:
        raise InputError(
            f"{where}heights have shape {z.shape}; a map needs two dimensions of at least {DEGREE + 1} points"
        )
    if max(z.shape) > MOST:
        raise InputError(
            f"{where}{z.shape[1]} x {z.shape[0]} heights are more than the {MOST} x {MOST} of a surface; cut a window "
            "(asperity import-map --window), or filter the map and keep every second height"
        )
    bad = np.argwhere(~np.isfinite(z))
    if len(bad):
        raise InputError(
            f"{where}{len(bad)} height(s) are not finite, the first at row {bad[0][0]}, column "
            f"{bad[0][1]}; asperity import-map fills gaps."
        )
