"""Files of height maps on regular grids: arrays of NumPy, text, and the formats of instruments."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.errors import CompatError, InputError
from asperity.runtime.files import UNREADABLE, one_line, read_npy, read_npz, real
from asperity.surface.text_map import read_text_map
from asperity.units import LENGTHS

TEXT = (".csv", ".txt", ".dat", ".tsv", ".asc", ".xyz")
PLAIN = (".npz", ".npy", *TEXT)
MARKS = (-32768.0, -2147483648.0, -9999.0, -99999.0)  # usual ones of missing heights
OUTSIDE = 0.1  # distance of a mark from the nearest of the other heights, over their range
REGULAR = 1e-6  # relative difference of steps that were rounded
MOST_READ = 400_000_000  # heights of a file, 3.2 GB; the largest instruments have 1e8

Heights = tuple[Array, float | None, float | None]


def read_heights(path: Path, unit: float = 1.0, missing: float | None = None) -> Heights:
    """Heights (ny, nx), NaN where they are missing, and their distances along x and y, None without one [m].

    Args:
        path: .npz with z and with x and y, dx, or L, the extent along x; .npy with z; or text, see `text_map`
        unit: of the lengths whose unit the file does not name [m]
        missing: value in the file that stands for a missing height, besides those of MARKS

    Raises:
        InputError: the file is missing, of another type, damaged, or no regular map
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    if path.suffix.lower() not in PLAIN:
        raise InputError(
            f"{path}: files of type {path.suffix!r} are none of {', '.join(PLAIN)}; asperity import-map makes a "
            "surface of the files of instruments"
        )
    try:
        if path.suffix.lower() in TEXT:
            return read_text_map(path, unit, lambda z: _without_marks(z, missing))
        z, *steps = _read_arrays(path)
    except UNREADABLE as error:
        raise InputError(f"{path}: cannot be read as a height map ({one_line(error)})") from None
    dx, dy = (None if step is None else unit * step for step in steps)
    return unit * _without_marks(z, missing), dx, dy


def _without_marks(z: Array, missing: float | None) -> Array:
    """Heights with NaN in place of values that mark missing ones (unit of the file).

    A mark of `MARKS` counts only if it lies outside all other heights.
    """
    for mark in MARKS if missing is None else (*MARKS, missing):
        at = z == mark
        if not at.any():
            continue
        if mark != missing and not at.all():
            rest = z[np.isfinite(z) & ~at]
            at &= bool(rest.size) and float(rest.min()) - mark > OUTSIDE * float(np.ptp(rest))
        z = np.where(at, np.nan, z)
    return z


def _read_arrays(path: Path) -> Heights:
    """Heights (ny, nx) and spacings of a file of NumPy (unit of the file)."""
    if path.suffix.lower() == ".npy":
        return real(read_npy(path)), None, None
    data = read_npz(path)
    if "z" not in data:
        raise ValueError(f"no array 'z'; it has {', '.join(data) or 'none'}")
    z = real(data["z"])
    if "x" in data and "y" in data:
        x, y = real(data["x"]), real(data["y"])
        if x.ndim == y.ndim == 2:
            if not (np.allclose(x, x[0]) and np.allclose(y, y[:, :1])):
                raise ValueError("x must vary along columns only, y along rows only")
            x, y = x[0], y[:, 0]
        if z.shape != (y.size, x.size):
            raise ValueError(f"z has shape {z.shape}, expected (len(y), len(x)) = ({y.size}, {x.size})")
        return z, _step("x", x), _step("y", y)
    if "dx" in data:
        return z, float(data["dx"]), float(data["dy"] if "dy" in data else data["dx"])
    if "L" in data:
        step = float(data["L"]) / max(z.shape[-1] - 1, 1)
        return z, step, step
    return z, None, None


def _step(name: str, values: Array) -> float:
    """Distance of rising values (n,) in equal steps."""
    steps = np.diff(values)
    if values.ndim != 1 or not steps.size or not np.all(steps > 0):
        raise ValueError(f"{name} must be a rising sequence of at least two values")
    if np.ptp(steps) > REGULAR * steps.mean():
        raise ValueError(
            f"{name} is not a regular grid, with steps from {steps.min():g} to {steps.max():g}; resample the map"
        )
    return float(np.mean(steps))


def read_instrument(path: Path, pixel: float | None, unit: str | None) -> tuple[Array, float, float, float, float]:
    """Heights, their distances, tip radius and resolution, 0 where unknown, by SurfaceTopography [m].

    Args:
        path: the file
        pixel: distance between heights, for a file that does not contain it [m]
        unit: of its lengths, where it does not name it

    Raises:
        InputError: the file cannot be read as a map, or lacks pixel or unit
        CompatError: SurfaceTopography is not installed
    """
    try:
        import SurfaceTopography  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError:
        raise CompatError(
            f"{path}: files of type {path.suffix!r} need the package SurfaceTopography: pip install SurfaceTopography"
        ) from None
    from SurfaceTopography.Exceptions import (  # type: ignore[import-not-found, import-untyped, unused-ignore]
        CannotDetectFileFormat,
        ReadFileError,
    )

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            channel = (reader := SurfaceTopography.open_topography(str(path))).default_channel
            _check_plausible(path, reader, channel)
            sizes: dict[str, Any] = {}
            if channel.physical_sizes is None:
                if pixel is None:
                    raise InputError(
                        f"{path} contains heights without lengths, as {_seen_as(reader, channel)}; if they are a map, "
                        "give the distance between heights (--pixel)"
                    )
                sizes = {"physical_sizes": tuple(n * pixel for n in channel.nb_grid_pts), "unit": "m"}
            topography = reader.topography(**sizes)
    except CannotDetectFileFormat:
        raise InputError(f"{path} is in none of the formats that SurfaceTopography reads, or damaged") from None
    except (ReadFileError, ValueError, OSError) as error:
        raise InputError(f"{path}: cannot be read as a height map ({one_line(error)})") from None
    if topography.dim != 2 or not topography.is_uniform:
        raise InputError(f"{path} holds a line scan; contact needs a map of heights")
    if topography.unit is None and unit is None:
        raise InputError(f"{path} does not give the unit of its lengths: give it (--unit)")
    in_metres, factor = (
        (topography, LENGTHS[unit]) if topography.unit is None and unit else (topography.to_unit("m"), 1.0)
    )
    dx, dy = (factor * float(p) for p in in_metres.pixel_size)
    z = np.ma.filled(np.ma.masked_invalid(np.ma.asarray(in_metres.heights(), dtype=float)), np.nan)
    limits = (topography.info.get("instrument") or {}).get("parameters") or {}
    tip, resolution = (
        float(given["value"]) * LENGTHS[given["unit"]] if (given := limits.get(name)) else 0.0
        for name in ("tip_radius", "resolution")
    )
    return factor * np.asarray(z).T, dx, dy, tip, resolution  # its first index is x


def _check_plausible(path: Path, reader: Any, channel: Any) -> None:
    """Refuse what a reader sees in a file that it mistakes for one of its own, before memory for it is allocated."""
    if math.prod(map(int, channel.nb_grid_pts)) > MOST_READ:
        raise InputError(
            f"{path} is read as {_seen_as(reader, channel)}, more than {MOST_READ:.0e} heights: probably a file of "
            "another format; export the map as .npz or .gwy"
        )


def _seen_as(reader: Any, channel: Any) -> str:
    """Format, channel and grid that SurfaceTopography found, for messages."""
    grid = " x ".join(str(int(n)) for n in channel.nb_grid_pts)
    name = "".join(c for c in str(channel.name) if c.isprintable())
    return f"channel {name!r} of {grid} heights by {type(reader).__name__} of SurfaceTopography"
