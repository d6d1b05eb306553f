"""Height maps of instruments: reading, filling gaps, levelling, filtering, and cutting the square patch for a contact.

field = HeightField.read("scan.sur").filled().levelled("plane")
field.window(5e-6, 5e-6, 20e-6).save("patch.npz")          # kind = "file", path = "patch.npz" in a case
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from asperity.arrays import Array, Flags
from asperity.errors import InputError
from asperity.runtime.files import write_npz
from asperity.runtime.text_table import is_text
from asperity.surface.base import FLAT
from asperity.surface.height_files import PLAIN, TEXT, metres_of, read_heights, read_instrument
from asperity.surface.height_map import DEEPEST

Trend = Literal["mean", "plane", "curvature"]

MOST_MISSING = 0.2  # share of heights that may be filled; more would be guesswork
SPIKE = 10.0  # distance of a spike from the median of its neighbours over the usual one; 7 at most on rough surfaces
SAME = 1e-3  # relative difference of lengths that were rounded
STEEPEST = 30.0  # greatest plausible rms slope

POWERS: dict[str, tuple[tuple[int, int], ...]] = {
    "mean": ((0, 0),),
    "plane": ((0, 0), (1, 0), (0, 1)),
    "curvature": ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)),
}


@dataclass(frozen=True, eq=False)
class HeightField:
    """Heights at the nodes of a regular grid; immutable.

    >>> import numpy as np
    >>> from asperity.surface.measured import HeightField
    >>> tilted = HeightField(np.add.outer(np.arange(9.0), np.arange(17.0)), dx=0.5, dy=0.5)
    >>> tilted.size
    (8.0, 4.0)
    >>> bool(abs(tilted.levelled("plane").z).max() < 1e-12), tilted.square().size
    (True, (4.0, 4.0))

    Attributes:
        z: heights (ny, nx), index [iy, ix] (length); NaN where the instrument measured nothing
        dx, dy: distance between neighbouring nodes (length)
        channel: of the file, empty where it has one
        notes: how the file was read, a sentence each
    """

    z: Array
    dx: float
    dy: float
    channel: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        z = np.array(self.z, dtype=float)
        if z.ndim != 2 or min(z.shape) < 8:
            raise InputError(f"a height field needs at least 8 x 8 heights, not shape {z.shape}")
        for name in ("dx", "dy"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(
                    f"{name} = {value} is not a distance between heights; give a positive length (--pixel)"
                )
        z[~np.isfinite(z)] = np.nan
        z.flags.writeable = False
        object.__setattr__(self, "z", z)

    @property
    def size(self) -> tuple[float, float]:
        """Distance of the first and the last node along x and along y (length)."""
        ny, nx = self.z.shape
        return (nx - 1) * self.dx, (ny - 1) * self.dy

    @property
    def missing(self) -> float:
        """Share of the heights that are missing."""
        return float(np.isnan(self.z).mean())

    @staticmethod
    def read(
        path: str | Path,
        *,
        pixel: float | tuple[float, float] | None = None,
        unit: str | None = None,
        missing: float | None = None,
        channel: str | None = None,
        array: str | None = None,
    ) -> HeightField:
        """Read a file of heights.

        Arrays of NumPy and text as in `height_files.read_heights`; other files, and text of which a channel is given,
        by SurfaceTopography, which reads the formats of some forty instruments.

        Args:
            path: the file
            pixel: distance between heights (m), or that along x and along y, for files that do not contain it
            unit: of lengths whose unit the file does not name, a key of `units.LENGTHS`, or the metres of one unit as
                a number; default metres
            missing: value in the file that stands for a missing height, besides NaN
            channel: name, or number from 1, of the channel of an instrument's file; default that of SurfaceTopography
            array: name of the heights in an .npz file; default z, or the only map

        Raises:
            InputError: the file cannot be read, it has no lengths and `pixel` is missing, or others than `pixel`
            CompatError: the file requires SurfaceTopography, which is not installed
        """
        path = Path(path)
        both = (pixel, pixel) if isinstance(pixel, (int, float)) else pixel
        metres, kind = metres_of(unit), path.suffix.lower()
        other = kind not in PLAIN
        if kind in TEXT and path.is_file():
            with path.open("rb") as file:  # some instruments give their files the name of a text
                other = channel is not None or not is_text(file.read(4096))
        if other and path.is_file():
            read = read_instrument(path, both, metres, channel)
        else:
            read = read_heights(path, unit=metres, missing=missing, channel=channel, array=array)
        dx, dy = read.dx, read.dy
        if both is not None:
            for name, own, given in (("dx", dx, both[0]), ("dy", dy, both[1])):
                if own is not None and not math.isclose(own, given, rel_tol=SAME):
                    raise InputError(
                        f"{path} has lengths of its own, {name} = {own:.6g} between heights, not {given:g}: leave out "
                        "--pixel, or correct the file"
                    )
            dx, dy = both[0] if dx is None else dx, both[1] if dy is None else dy
        if dx is None or dy is None:
            raise InputError(f"{path} contains heights without lengths; give the distance between heights (--pixel)")
        return HeightField(read.z, dx, dy, read.channel, read.notes)

    def missing_in(self, x: float, y: float, side: float) -> float:
        """Share of the heights that are missing in the square of :meth:`window`, 0 outside the map."""
        of_y, of_x = (
            np.abs(step * np.arange(n) - start - side / 2) < side / 2 + (1 - 1e-6) * step  # not the next row
            for n, step, start in zip(self.z.shape, (self.dy, self.dx), (y, x), strict=True)
        )
        part = np.isnan(self.z[np.ix_(of_y, of_x)])
        return float(part.mean()) if part.size else 0.0

    def filled(self, window: tuple[float, float, float] | None = None) -> HeightField:
        """Fill missing heights by the harmonic function through their neighbours.

        Args:
            window: square that will be cut, x, y and side (length); gaps elsewhere are not limited

        Raises:
            InputError: more than a fifth of the heights is missing
        """
        if not self.missing:
            return self
        share = self.missing if window is None else self.missing_in(*window)
        if share > MOST_MISSING:
            raise InputError(
                f"{share:.0%} of the heights are missing, at most {MOST_MISSING:.0%} can be filled; "
                "choose a window with fewer gaps"
            )
        return replace(self, z=_harmonic_fill(self.z, np.isnan(self.z)))

    def spikes(self) -> Flags:
        """Heights (ny, nx) that stand far above their neighbours, as those of dust and of spikes of an instrument do.

        The distance from the median of 5 x 5 heights exceeds that of nearly all heights, see SPIKE, and the rms height:
        on a smooth surface nearly all have none. A step is no spike, and neither is dust wider than three pixels.

        Raises:
            InputError: heights are missing
        """
        from scipy.ndimage import median_filter

        self._require_complete("searched for spikes")
        above = self.z - median_filter(self.z, 5, mode="nearest")
        usual = 1.4826 * float(np.median(np.abs(above)))  # the deviation of a normal distribution
        usual = max(usual, 0.5 * float(np.sqrt(np.mean(above**2))))  # of flats most have none
        return np.asarray((above > SPIKE * usual) & (above > self.z.std()))

    def without(self, heights: Flags) -> HeightField:
        """The map with some heights (ny, nx) missing."""
        return replace(self, z=np.where(heights, np.nan, self.z))

    def levelled(self, trend: Trend = "plane") -> HeightField:
        """Subtract the least-squares polynomial: "mean", "plane", or "curvature" (second order)."""
        if trend not in POWERS:
            raise InputError(f'trend = "{trend}" is unknown; choose mean, plane or curvature')
        return replace(self, z=self.z - _trend(self.z, trend))

    def filtered(self, cutoff: float) -> HeightField:
        """Apply a Gaussian low-pass filter with 50 % transmission at the wavelength `cutoff` (length), ISO 16610-61.

        Filter a map that is finer than the mesh of the contact. The heights are mirrored at the edges.

        Raises:
            InputError: heights are missing, or the cut-off is below two pixels or beyond the side
        """
        self._require_complete("filtered")
        if not 2 * min(self.dx, self.dy) <= cutoff <= max(self.size):
            raise InputError(
                f"cutoff = {cutoff:g} must lie between two pixels, {2 * min(self.dx, self.dy):g}, and the side, "
                f"{max(self.size):g}"
            )
        return replace(self, z=gaussian_filtered(self.z, self.size, cutoff))

    def window(self, x: float, y: float, side: float) -> HeightField:
        """Cut the square [x, x + side] x [y, y + side] (lengths from the first node).

        If its edges are not on nodes, or the spacings differ, a cubic spline resamples it with the finer spacing.

        Raises:
            InputError: heights are missing, or the square is not inside the map or has fewer than 8 nodes per side
        """
        from scipy.interpolate import RectBivariateSpline

        self._require_complete("cut")
        width, depth = self.size
        slack = 1e-9 * max(width, depth)
        if not (side > 0 and x >= -slack and y >= -slack and x + side <= width + slack and y + side <= depth + slack):
            raise InputError(
                f"the window x = {x:g}, y = {y:g}, side {side:g} is not inside the map of {width:g} x {depth:g}"
            )
        widest, axis = max((self.dx, "x"), (self.dy, "y"))
        if side < (7 - 1e-6) * widest:
            raise InputError(
                f"the window of side {side:g} has fewer than 8 heights along {axis}, which are {widest:g} apart"
            )
        place = np.array([x / self.dx, side / self.dx, y / self.dy, side / self.dy])
        if self.dx == self.dy and np.allclose(place, np.rint(place), atol=1e-6, rtol=0):
            i, n, j, m = np.rint(place).astype(int)
            return HeightField(self.z[j : j + m + 1, i : i + n + 1], self.dx, self.dy)
        ny, nx = self.z.shape
        spline = RectBivariateSpline(np.arange(ny) * self.dy, np.arange(nx) * self.dx, self.z)
        count = round(side / min(self.dx, self.dy)) + 1
        s = np.linspace(0.0, side, count)
        return HeightField(spline(y + s, x + s), s[1], s[1])

    def square(self) -> HeightField:
        """Cut the largest square in the middle of the map."""
        side = min(self.size)
        x, y = ((extent - side) / 2 for extent in self.size)
        if self.dx == self.dy:
            x, y = round(x / self.dx) * self.dx, round(y / self.dx) * self.dx
        return self.window(x, y, side)

    def check_plausible(self) -> None:
        """Refuse heights that are all equal, or that cannot have the unit of the distances between them.

        Raises:
            InputError: they are
        """
        depth = float(np.nanmax(self.z) - np.nanmin(self.z))
        if depth <= FLAT * max(self.size):
            raise InputError(f"the map is flat: heights differ by {depth:.2g} m on a side of {max(self.size):.3g} m")
        zy, zx = (np.diff(self.z, axis=axis) / step for axis, step in enumerate((self.dy, self.dx)))
        with np.errstate(over="ignore"):
            slope = math.sqrt(float(np.nanmean(zx**2)) + float(np.nanmean(zy**2)))
        if STEEPEST > slope and depth <= DEEPEST * max(self.size):
            return
        raise InputError(
            f"heights that differ by {depth:.3g} m over a side of {max(self.size):.3g} m, with an rms slope of "
            f"{slope:.2g}, are not plausible: give all lengths in one unit (--pixel 0.2um, --unit of the file)"
        )

    def save(self, path: str | Path, about: Mapping[str, Any] | None = None) -> Path:
        """Write the square patch as .npz with z and L, for kind = "file" in a case; return the path.

        Args:
            path: the file
            about: see `HeightMap.about`

        Raises:
            InputError: the patch is not square, or heights are missing
        """
        self._require_complete("saved as a surface")
        width, depth = self.size
        if not math.isclose(width, depth, rel_tol=1e-9):
            raise InputError(f"the map of {width:g} x {depth:g} is not square; cut a window first")
        path = Path(path).with_suffix(".npz")
        arrays: dict[str, Array] = {"z": self.z, "L": np.array(width)}
        if about is not None:
            arrays["about"] = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
        write_npz(path, arrays.items(), compress=True)
        return path

    def _require_complete(self, what: str) -> None:
        if self.missing:
            raise InputError(f"{self.missing:.2%} of the heights are missing; fill them before the map is {what}")


def _trend(z: Array, trend: str) -> Array:
    """Least-squares polynomial of the known heights at every node (ny, nx) (length); terms are powers of y and x."""
    powers = POWERS[trend]
    y, x = (np.linspace(-1, 1, n)[:, None] ** np.arange(5) for n in z.shape)
    known = np.isfinite(z)
    if known.sum() < len(powers):
        raise InputError("there are too few heights to level; choose another window")
    middle = float(np.mean(z, where=known))
    moments = y.T @ known.astype(float) @ x
    right = y.T @ np.where(known, z - middle, 0.0) @ x
    matrix = np.array([[moments[j + n, i + m] for m, n in powers] for i, j in powers])
    coefficients = np.zeros((3, 3))
    coefficients[tuple(zip(*((j, i) for i, j in powers), strict=True))] = np.linalg.lstsq(
        matrix, [right[j, i] for i, j in powers], rcond=None
    )[0]
    return middle + np.asarray(y[:, :3] @ coefficients @ x[:, :3].T)


def _harmonic_fill(z: Array, gaps: Flags) -> Array:
    """Heights (ny, nx) in which each missing value is the mean of its neighbours on the grid (length)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import cg

    number = np.full(z.shape, -1)
    number[gaps] = np.arange(gaps.sum())
    numbers, heights = np.pad(number, 1, constant_values=-2), np.pad(z, 1)  # -1: known, -2: beyond the edge
    iy, ix = np.nonzero(np.pad(gaps, 1))
    me = numbers[iy, ix]
    diagonal, right = np.zeros(me.size), np.zeros(me.size)
    rows, columns = [], []
    for place in ((iy, ix + 1), (iy, ix - 1), (iy + 1, ix), (iy - 1, ix)):
        other = numbers[place]
        diagonal += other != -2
        right += np.where(other == -1, heights[place], 0.0)
        rows.append(me[other >= 0])
        columns.append(other[other >= 0])
    i, j = np.concatenate(rows), np.concatenate(columns)
    matrix = coo_matrix((-np.ones(i.size), (i, j)), shape=(me.size, me.size)).tocsr()
    matrix.setdiag(diagonal)
    full, middle = np.array(z), float(np.mean(z[~gaps]))
    start = np.full(me.size, middle)
    full[gaps], _ = cg(matrix, right, start, rtol=1e-12, maxiter=10_000)
    return full


def gaussian_filtered(z: Array, size: tuple[float, float], cutoff: float) -> Array:
    """Heights after a Gaussian low-pass filter of ISO 16610-61, mirrored at the edges.

    Args:
        z: heights (ny, nx) (length)
        size: of the map along x and along y (length)
        cutoff: wavelength of 50 % transmission (length)
    """
    from scipy.fft import dctn, idctn

    waves = dctn(z, type=1)
    for axis, (n, length) in enumerate(zip(z.shape, size[::-1], strict=True)):
        half_waves = np.arange(n) / (2 * length)  # 1/wavelength
        waves *= np.expand_dims(np.exp(-np.pi * (0.46971863934982566 * cutoff * half_waves) ** 2), 1 - axis)
    return np.asarray(idctn(waves, type=1, overwrite_x=True))
