"""Files of heights on a regular grid.

NumPy reads arrays and plain text; SurfaceTopography, of the extra `scan`, reads the formats of instruments.
"""

from __future__ import annotations

import math
import re
import warnings
from contextlib import redirect_stdout, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from asperity.arrays import Array
from asperity.errors import CompatError, InputError
from asperity.runtime.files import UNREADABLE, one_line, read_npy, read_npz, real
from asperity.runtime.text_table import TextTable, is_text, lines_of
from asperity.units import LENGTHS

ARRAYS, TEXT = (".npz", ".npy"), (".csv", ".txt", ".dat", ".tsv", ".asc", ".xyz")
EXACT = 1e-6  # relative difference of sides, or of steps of an array, that are the same
OFF_GRID, STRAIGHT = 0.1, 0.02  # deviation of coordinates of points, and of those beside a matrix, over their step
LEAST = 4  # heights along a side of a map, for a cubic spline
MARKS = (-32768.0, -2147483648.0, -9999.0, -99999.0)  # usual ones of missing heights


class Heights(NamedTuple):
    """What a file holds.

    Attributes:
        z: heights (ny, nx), index [iy, ix], NaN where they are missing [m]
        steps: distances along x and along y [m], None where the file has none
        channel: of the file, or name of the array; empty where there is one only
        note: how the file was read, empty or a sentence
    """

    z: Array
    steps: tuple[float, float] | None
    channel: str = ""
    note: str = ""


def read_heights(
    path: Path, pixel: tuple[float, float] | None = None, unit: str | None = None, missing: float | None = None,
    channel: str | None = None, array: str | None = None,
) -> Heights:  # fmt: skip
    """Read a file, with the arguments of `scans.HeightField.read`."""
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    kind, metres = path.suffix.lower(), _metres_of(unit)
    with path.open("rb") as file:  # some instruments give their files the name of a text
        text = kind in TEXT and channel is None and is_text(file.read(4096))
    if not text and kind not in ARRAYS:
        return _of_instrument(path, pixel, metres, channel)
    if channel is not None or (array is not None and kind != ".npz"):
        name, files = ("--channel", "instruments") if channel is not None else ("--array", "type .npz")
        raise InputError(f"{path}: {name} is for files of {files}")
    try:
        return _of_text(path, metres, missing) if text else _of_arrays(path, metres or 1.0, missing, array)
    except (InputError, *UNREADABLE) as error:
        raise InputError(f"{path}: cannot be read as a height map ({one_line(error)})") from None


def _metres_of(unit: str | None) -> float | None:
    """Metres of one unit of length, given by its name or as a number; None stays."""
    if unit is None:
        return None
    with suppress(ValueError):
        if 0.0 < (value := float(LENGTHS.get(unit, unit))) < math.inf:
            return value
    raise InputError(f"unit = {unit!r} is unknown; choose {', '.join(LENGTHS)}, or give the metres of one unit")


def steps_of(z: Array, sides: Any) -> tuple[float, float]:
    """Distances of heights (ny, nx) along x and y on a side, or on two sides (unit of the sides).

    Raises:
        InputError: there is one side only, and as many heights along x as along y there are not
    """
    sides = np.ravel(sides)
    if z.ndim != 2 or not 0 < sides.size < 3:
        raise InputError(
            f"heights of shape {z.shape} and {sides.size} sides are no map: give (ny, nx) and L, or [Lx, Ly]"
        )
    ny, nx = z.shape
    if sides.size == 1 and nx != ny:
        raise InputError(
            f"{nx} x {ny} heights on a side L would have different distances along x and y: write dx and dy, or both "
            "sides as L = [Lx, Ly], beside z into an .npz file, or cut a square with asperity import-map --pixel"
        )
    return float(sides[0]) / max(nx - 1, 1), float(sides[-1]) / max(ny - 1, 1)


def _without_marks(z: Array, missing: float | None) -> Array:
    """Heights with NaN in place of `missing` (unit of the file); ValueError where another usual mark is left."""
    if missing is not None and np.isnan(missing):
        return z
    if left := [mark for mark in MARKS if mark != missing and (z == mark).any()]:
        raise ValueError(
            f"heights of {left[0]:g} usually stand for missing ones: say so (import-map --missing {left[0]:g}), or "
            "that they are heights (--missing nan), or write NaN in their place into the file"
        )
    return z if missing is None else np.where(z == missing, np.nan, z)


def _of_arrays(path: Path, metres: float, missing: float | None, wanted: str | None) -> Heights:
    """Heights of a file of NumPy; an .npz file has x and y, dx and dy, or L beside them."""
    data, name = ({"z": read_npy(path)}, "z") if path.suffix.lower() == ".npy" else (read_npz(path), wanted)
    if name is None:
        maps = [name for name, array in data.items() if np.ndim(array) == 2 and name not in ("x", "y")]
        name = "z" if "z" in data or len(maps) != 1 else maps[0]
    if name not in data:
        more = "" if wanted else ": name the heights with --array"
        raise ValueError(f"no array {name!r}; it has {', '.join(data) or 'none'}{more}")
    z, steps = metres * _without_marks(real(data[name]), missing), None
    if "x" in data and "y" in data:
        (nx, dx, ix), (ny, dy, iy) = (_grid(axis, real(data[axis]), EXACT) for axis in "xy")
        if not z.shape == (ny, nx) == (iy.size, ix.size):
            raise ValueError(f"z has shape {z.shape}, expected (len(y), len(x)) = ({iy.size}, {ix.size})")
        z[np.ix_(iy, ix)] = z.copy()
        steps = dx, dy
    elif "dx" in data:
        steps = float(data["dx"]), float(data["dy"] if "dy" in data else data["dx"])
    elif "L" in data:
        steps = steps_of(z, real(data["L"]))
    if steps is not None:
        steps = metres * steps[0], metres * steps[1]
    return Heights(z, steps) if name == "z" else Heights(z, steps, name, f"the heights are the array {name!r}")


def _grid(name: str, values: Array, off: float) -> tuple[int, float, Array]:
    """Number of places of a coordinate (n,) on a regular grid, their distance, and the place of each value."""
    ordered, place = np.unique(values, return_inverse=True)
    if ordered.size < 2:
        raise ValueError(f"all {values.size} points have the same {name}: give a map, not a profile")
    steps, regular = np.diff(ordered), np.linspace(ordered[0], ordered[-1], ordered.size)
    if not np.abs(ordered - regular).max() <= off * (regular[1] - regular[0]):
        raise ValueError(
            f"{name} is not a regular grid, with steps from {steps.min():.4g} to {steps.max():.4g}; resample the map"
        )
    return ordered.size, float(regular[1] - regular[0]), place


def _of_text(path: Path, metres: float | None, missing: float | None) -> Heights:
    """Heights of a matrix, or of lines x, y, z in any order, of which a few may be missing.

    Only the names of the columns x, y, z are read of a header: with any other one `metres` must be given.
    """
    text = TextTable.of(lines_of(path), 2)
    table, header = text.numbers(), [line for _, line in text.header]
    last = header[-1][:60] if header else ""
    table[np.isinf(table)] = np.nan
    named = text.columns(dict.fromkeys("xyz", LENGTHS))
    places, units = (list(column) for column in zip(*(named.get(name, (-1, None)) for name in "xyz"), strict=True))
    known = table.shape[1] == 3 and sorted(places) == [0, 1, 2]
    if not known and sorted(re.findall(r"\b[xyz]\b", last.lower())) == ["x", "y", "z"]:
        raise ValueError(f"{last!r} is not understood: name the columns x, y, z alone, as x [um]")
    if metres is None and None in units and header[: -1 if known else None]:
        raise ValueError(
            f"{last!r} is a header, and none is read: give unit and distance of heights (--unit 6e-8 --pixel 1e-6), "
            "let SurfaceTopography read it (--channel 1), or remove it"
        )
    if table.shape[1] == 2:
        raise ValueError(f"{len(table)} lines of two numbers are a profile: a contact needs heights over an area")
    if table.shape[1] != 3:
        if not all(line.strip() for line in text.lines[text.first :]):
            raise ValueError("blank lines separate its rows: write one map into a file, without them")
        if min(table.shape) < LEAST:
            raise ValueError(
                f"{table.shape[0]} rows of {table.shape[1]} cells are no map: give {LEAST} x {LEAST} or more"
            )
        _refuse_coordinates(table)
        return Heights((metres or 1.0) * _without_marks(table, missing), None)
    table = table[:, places] if known else table
    table = table[np.isfinite(table[:, :2]).all(axis=1)]
    (nx, dx, ix), (ny, dy, iy) = (_grid(name, table[:, i], OFF_GRID) for i, name in enumerate("xy"))
    if nx * ny > 2 * len(table) or np.unique(iy * nx + ix).size != len(table):
        raise ValueError(f"{len(table)} points x, y, z are no map of {nx} x {ny} places, one height for each")
    z = np.full((ny, nx), np.nan)
    z[iy, ix] = _without_marks(table[:, 2], missing)
    ux, uy, uz = ((metres or 1.0) if unit is None else unit for unit in units)
    return Heights(z * uz, (dx * ux, dy * uy))


def _refuse_coordinates(table: Array) -> None:
    """Refuse a matrix whose first column or row has equal steps that the next one does not continue."""
    for name, lines in (("column", table.T), ("row", table)):
        edge, steps = lines[0], np.diff(lines[:2, 1:], axis=1)
        step = float(np.mean(steps[0]))
        straight, continued = np.abs(steps - step).max(axis=1) <= STRAIGHT * abs(step)
        if step != 0.0 and straight and not continued:
            raise ValueError(
                f"the first {name}, {edge[1]:g}, {edge[2]:g}, {edge[3]:g} ..., may be coordinates: leave coordinates "
                "out and give the distance between heights (--pixel), or write an .npz file or lines of x, y, z"
            )


def _of_instrument(path: Path, pixel: tuple[float, float] | None, metres: float | None, wanted: str | None) -> Heights:
    """Heights of a file that SurfaceTopography reads."""
    try:
        from SurfaceTopography import open_topography  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError:
        wrong = InputError if wanted is None and path.suffix.lower() in TEXT else CompatError
        raise wrong(
            f"{path} is no array and no plain text: SurfaceTopography reads it, pip install 'asperity[scan]'"
        ) from None
    try:
        with warnings.catch_warnings(action="ignore"), redirect_stdout(None):
            reader = open_topography(str(path))
            channel, name, note = _channel(path, list(reader.channels), reader.default_channel.index, wanted)
            sizes: dict[str, Any] = {}
            if channel.physical_sizes is None:
                if pixel is None:
                    raise InputError(f"{path} has heights without lengths; give the distance between them (--pixel)")
                sizes = {"physical_sizes": tuple(np.multiply(channel.nb_grid_pts, pixel)), "unit": "m"}
            found = reader.topography(channel_index=channel.index, **sizes)
            if found.unit is None and metres is None:
                raise InputError(f"{path} does not give the unit of its lengths: give it (--unit)")
            found, factor = (found, metres or 1.0) if found.unit is None else (found.to_unit("m"), 1.0)
            dx, dy = (factor * float(step) for step in found.pixel_size)
            z = np.ma.filled(np.ma.masked_invalid(np.ma.asarray(found.heights(), dtype=float)), np.nan)
    except InputError:
        raise
    except Exception as error:  # readers of forty formats raise what they like
        raise InputError(f"{path}: SurfaceTopography finds no height map in it ({one_line(error)})") from None
    return Heights(factor * np.asarray(z).T, (dx, dy), name, note)  # its first index is x


def _channel(path: Path, channels: list[Any], own: int, wanted: str | None) -> tuple[Any, str, str]:
    """Channel of a name or a number, and its name and a sentence where there are several; `own` is the default."""
    names = ["".join(c for c in str(channel.name) if c.isprintable()) for channel in channels]
    listed = ", ".join(f"{i} {name!r}" for i, name in enumerate(names, 1))
    keys = [*names, *(str(i) for i in range(1, len(names) + 1))]
    if wanted is not None and wanted not in keys:
        raise InputError(f"{path} has no channel {wanted!r}: choose a name or a number of {listed}")
    at = [c.index for c in channels].index(own) if wanted is None else keys.index(wanted) % len(names)
    if len(channels) == 1:
        return channels[at], "", ""
    return channels[at], names[at], f"channel {at + 1} {names[at]!r} of {listed}: --channel chooses another"
