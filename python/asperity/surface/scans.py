"""Scans: gaps, levels, filters, the square patch of a contact, and its parameters of ISO 25178.

field = HeightField.read("scan.sur").filled().levelled("plane")
field.window(5e-6, 5e-6, 20e-6).save("patch.npz")          # kind = "file", path = "patch.npz" in a case
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from asperity.arrays import Array, Flags
from asperity.errors import InputError
from asperity.runtime.files import write_npz
from asperity.surface.base import FLAT
from asperity.surface.height_files import EXACT, LEAST, read_heights, steps_of

Trend = Literal["mean", "plane", "curvature"]

DEGREES = {"mean": 0, "plane": 1, "curvature": 2}
LEAST_PATCH = 8  # heights along a side of a patch that is cut
ROUNDED = 1e-3  # relative difference of pixels that were rounded
MOST_MISSING = 0.2  # share of heights that may be filled; more would be guesswork
SPIKE = 10.0  # distance of a spike from the median of its neighbours over the usual one; 7 at most on rough surfaces
STEEPEST = 30.0  # greatest plausible rms slope
LAGS = 2048  # heights per side for the autocorrelation
ISO = ("Sq", "Sa", "Sz", "Sp", "Sv", "Ssk", "Sku", "Sdq", "Sdr", "Sal", "Str", "Sk", "Spk", "Svk", "Smr1", "Smr2")


@dataclass(frozen=True, eq=False)
class HeightField:
    """Heights at the nodes of a regular grid; immutable.

    >>> import numpy as np
    >>> from asperity.surface.scans import HeightField
    >>> tilted = HeightField(np.add.outer(np.arange(9.0), np.arange(17.0)), dx=0.5, dy=0.5)
    >>> tilted.size
    (8.0, 4.0)
    >>> bool(abs(tilted.levelled("plane").z).max() < 1e-12), tilted.square().size
    (True, (4.0, 4.0))

    Attributes:
        z: heights (ny, nx), index [iy, ix] (length); NaN where the instrument measured nothing
        dx, dy: distance between neighbouring nodes (length)
        channel: of the file, or name of its array; empty where it has one
        notes: how the file was read, a sentence each
    """

    z: Array
    dx: float
    dy: float
    channel: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        z = np.array(self.z, dtype=float)
        if z.ndim != 2 or min(z.shape) < LEAST:
            raise InputError(f"a map needs two dimensions of at least {LEAST} heights, not shape {z.shape}")
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

    @classmethod
    def read(
        cls, path: str | Path, *, pixel: float | tuple[float, float] | None = None, side: float | None = None,
        unit: str | None = None, missing: float | None = None, channel: str | None = None, array: str | None = None,
    ) -> HeightField:  # fmt: skip
        """Read a file of heights: .npz, .npy, text, or the format of an instrument.

        An .npz file has z and x and y, dx and dy, or L, the extent along x and y; a text is a matrix, or lines of x, y
        and z. Text of which a channel is given is read by SurfaceTopography too.

        Args:
            path: the file
            pixel: distance between heights (m), or that along x and along y, for files that do not contain it
            side: extent of a square map (m), in place of `pixel`
            unit: of lengths whose unit the file does not name, a key of `units.LENGTHS`, or the metres of one unit as
                a number; default metres
            missing: value in the file that stands for a missing height, besides NaN
            channel: name, or number from 1, of the channel of an instrument's file; default that of SurfaceTopography
            array: name of the heights in an .npz file; default z, or the only map

        Raises:
            InputError: the file cannot be read, it has no lengths and none are given, or it has other ones
            CompatError: the file requires SurfaceTopography, which is not installed
        """
        path = Path(path)
        given = (pixel, pixel) if isinstance(pixel, (int, float)) else pixel
        z, own, name, note = read_heights(path, given, unit, missing, channel, array)
        try:
            if given is None and side is not None:
                given = steps_of(z, (side, side) if own else side)
            if own and given and not np.allclose(own, given, rtol=EXACT if pixel is None else ROUNDED, atol=0.0):
                raise ValueError(
                    f"it has lengths of its own, dx = {own[0]:.6g} and dy = {own[1]:.6g}, not {given[0]:.6g} and "
                    f"{given[1]:.6g}: leave out {'surface.L' if pixel is None else '--pixel'}, or correct the file"
                )
            if (steps := own or given) is None:
                raise ValueError(
                    "it has no lengths; give the distance between heights (--pixel), or surface.L in a case"
                )
            return cls(z, *steps, name, (note,) if note else ())
        except (ValueError, InputError) as error:
            raise InputError(f"{path}: {error}") from None

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
        share = self.missing if window is None else self.missing_in(*window)
        if share > MOST_MISSING:
            raise InputError(
                f"{share:.0%} of the heights are missing, at most {MOST_MISSING:.0%} can be filled; "
                "choose a window with fewer gaps"
            )
        return replace(self, z=_harmonic_fill(self.z)) if self.missing else self

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

    def levelled(self, trend: Trend = "plane") -> HeightField:
        """Subtract the least-squares polynomial: "mean", "plane", or "curvature" (second order)."""
        if trend not in DEGREES:
            raise InputError(f'trend = "{trend}" is unknown; choose mean, plane or curvature')
        degree = DEGREES[trend]
        powers = [(j, i) for j in range(degree + 1) for i in range(degree + 1 - j)]  # of y and of x
        y, x = (np.linspace(-1, 1, n)[:, None] ** np.arange(2 * degree + 1) for n in self.z.shape)
        known = np.isfinite(self.z)
        if known.sum() < len(powers):
            raise InputError("there are too few heights to level; choose another window")
        middle = float(np.mean(self.z, where=known))
        moments, right = y.T @ known.astype(float) @ x, y.T @ np.where(known, self.z - middle, 0.0) @ x
        matrix = np.array([[moments[j + n, i + m] for n, m in powers] for j, i in powers])
        factors = np.zeros((degree + 1, degree + 1))
        factors[tuple(zip(*powers, strict=True))] = np.linalg.lstsq(matrix, [right[p] for p in powers], rcond=None)[0]
        return replace(self, z=self.z - middle - y[:, : degree + 1] @ factors @ x[:, : degree + 1].T)

    def filtered(self, cutoff: float) -> HeightField:
        """Apply a Gaussian low-pass filter with 50 % transmission at the wavelength `cutoff` (length), ISO 16610-61.

        Filter a map that is finer than the mesh of the contact. The heights are mirrored at the edges.

        Raises:
            InputError: heights are missing, or the cut-off is below two pixels or beyond the side
        """
        from scipy.fft import dctn, idctn

        self._require_complete("filtered")
        least, most = 2 * min(self.dx, self.dy), max(self.size)
        if not least <= cutoff <= most:
            raise InputError(f"cutoff = {cutoff:g} must lie between two pixels, {least:g}, and the side, {most:g}")
        waves = dctn(self.z, type=1)
        for axis, (n, length) in enumerate(zip(self.z.shape, self.size[::-1], strict=True)):
            passed = 0.5 ** ((cutoff * np.arange(n) / (2 * length)) ** 2)
            waves *= np.expand_dims(passed, 1 - axis)
        return replace(self, z=idctn(waves, type=1, overwrite_x=True))

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
        if side < (LEAST_PATCH - 1 - 1e-6) * widest:
            raise InputError(
                f"the window of side {side:g} has fewer than {LEAST_PATCH} heights along {axis}, which are {widest:g} "
                "apart"
            )
        place = np.array([x / self.dx, side / self.dx, y / self.dy, side / self.dy])
        if self.dx == self.dy and np.allclose(place, np.rint(place), atol=1e-6, rtol=0):
            i, n, j, m = np.rint(place).astype(int)
            return replace(self, z=self.z[j : j + m + 1, i : i + n + 1])
        ny, nx = self.z.shape
        spline = RectBivariateSpline(np.arange(ny) * self.dy, np.arange(nx) * self.dx, self.z)
        s = np.linspace(0.0, side, round(side / min(self.dx, self.dy)) + 1)
        return replace(self, z=spline(y + s, x + s), dx=s[1], dy=s[1])

    def square(self) -> HeightField:
        """Cut the largest square in the middle of the map."""
        side = min(self.size)
        x, y = ((extent - side) / 2 for extent in self.size)
        if self.dx == self.dy:
            x, y = round(x / self.dx) * self.dx, round(y / self.dx) * self.dx
        return self.window(x, y, side)

    def check_plausible(self) -> None:
        """Refuse (InputError) heights that are all equal, or that cannot have the unit of their distances."""
        depth, side = float(np.ptp(self.z)), max(self.size)
        if depth <= FLAT * side:
            raise InputError(f"the map is flat: heights differ by {depth:.2g} m on a side of {side:.3g} m")
        with np.errstate(over="ignore"):
            slopes = (np.mean((np.diff(self.z, axis=i) / step) ** 2) for i, step in enumerate((self.dy, self.dx)))
            slope = math.sqrt(sum(slopes))
        if slope >= STEEPEST:
            raise InputError(
                f"heights that differ by {depth:.3g} m over a side of {side:.3g} m, with an rms slope of {slope:.2g}, "
                "are not plausible: give all lengths in one unit (--pixel 0.2um, --unit of the file)"
            )

    def save(self, path: str | Path, about: Mapping[str, Any] | None = None) -> Path:
        """Write the patch as .npz, for kind = "file" in a case; `about` is `HeightMap.about`; return the path."""
        path = Path(path).with_suffix(".npz")
        arrays: dict[str, Array] = {"z": self.z, "L": np.array(self.size)}
        if about is not None:
            arrays["about"] = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
        write_npz(path, arrays.items(), compress=True)
        return path

    def iso25178(self) -> dict[str, float | None] | None:
        """Parameters of ISO 25178-2 by surfalize, see ISO, with ratios of areas as shares; None without surfalize.

        A parameter is None where the patch is too small for it. Beyond LAGS heights a side Sal and Str skip some.
        """
        with warnings.catch_warnings(action="ignore"):
            try:
                from surfalize import Surface  # type: ignore[import-not-found, import-untyped, unused-ignore]
            except ImportError:
                return None
            step = -(-max(self.z.shape) // LAGS)
            whole = Surface(self.z - self.z.mean(), self.dx, self.dy)
            coarse = Surface(self.z[::step, ::step] - self.z.mean(), step * self.dx, step * self.dy)
            values = {name: float(getattr(coarse if name in ("Sal", "Str") else whole, name)()) for name in ISO}
        values |= {name: values[name] / 100.0 for name in ("Sdr", "Smr1", "Smr2")}
        return {name: value if math.isfinite(value) else None for name, value in values.items()}

    def _require_complete(self, what: str) -> None:
        if self.missing:
            raise InputError(f"{self.missing:.2%} of the heights are missing; fill them before the map is {what}")


def _harmonic_fill(z: Array) -> Array:
    """Heights (ny, nx) in which each missing value is the mean of its neighbours on the grid (length)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import cg

    gaps = np.isnan(z)
    iy, ix = np.nonzero(gaps)
    number = np.full(z.shape, -1)
    number[gaps] = np.arange(iy.size)
    diagonal, right, pairs = np.zeros(iy.size), np.zeros(iy.size), []
    for jy, jx in ((iy, ix + 1), (iy, ix - 1), (iy + 1, ix), (iy - 1, ix)):
        inside = np.flatnonzero((jy >= 0) & (jy < z.shape[0]) & (jx >= 0) & (jx < z.shape[1]))
        other, height = (values[jy[inside], jx[inside]] for values in (number, z))
        diagonal[inside] += 1.0
        right[inside] += np.where(other < 0, height, 0.0)
        pairs.append((inside[other >= 0], other[other >= 0]))
    i, j = np.concatenate(pairs, axis=1)
    matrix = coo_matrix((-np.ones(i.size), (i, j)), shape=(iy.size, iy.size)).tocsr()
    matrix.setdiag(diagonal)
    full = np.array(z)
    full[gaps], _ = cg(matrix, right, np.full(iy.size, np.nanmean(z)), rtol=1e-12, maxiter=10_000)
    return full
