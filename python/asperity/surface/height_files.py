"""Files of height maps on regular grids: arrays of NumPy, text, and the formats of instruments."""

from __future__ import annotations

import logging
import math
import re
import warnings
from contextlib import redirect_stdout, suppress
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.errors import CompatError, InputError
from asperity.runtime.files import UNREADABLE, one_line, read_npy, read_npz, real
from asperity.surface.text_map import PROFILE, Heights, read_text_map, without_marks
from asperity.units import LENGTHS

TEXT = (".csv", ".txt", ".dat", ".tsv", ".asc", ".xyz")
PLAIN = (".npz", ".npy", *TEXT)
REGULAR = 1e-6  # relative difference of steps, or of sides, that were rounded
WIDEST = 1.0  # side of a map of an instrument that is believed [m]
_HEIGHT = re.compile(r"height|topograph|h(ö|oe)he|zsensor|^z\b", re.IGNORECASE)  # name of a channel
UNEQUAL = "{} x {} heights on a side L would have different distances along x and y"
MOST_READ = 400_000_000  # heights of a file, 3.2 GB; the largest instruments have 1e8


def metres_of(unit: str | None) -> float | None:
    """Metres of one unit of length, given by its name or as a number; None stays.

    Raises:
        InputError: it is neither

    Examples:
        >>> metres_of("um"), metres_of("6e-8")
        (1e-06, 6e-08)
    """
    if unit is None or unit in LENGTHS:
        return None if unit is None else LENGTHS[unit]
    with suppress(ValueError):
        if 0.0 < (value := float(unit)) < math.inf:
            return value
    raise InputError(f"unit = {unit!r} is unknown; choose {', '.join(LENGTHS)}, or give the metres of one unit")


def read_heights(
    path: Path,
    *,
    unit: float | None = None,
    missing: float | None = None,
    channel: str | None = None,
    array: str | None = None,
) -> Heights:
    """Read an array of NumPy, or text.

    Args:
        path: .npz with z and with x and y, dx and dy, or L, the extent along x and y; .npy with z; or text, see
            `text_map`
        unit: metres of one unit of the lengths whose unit the file does not name; default metres

    The others are those of `HeightField.read`.

    Raises:
        InputError: the file is missing, of another type, damaged, or no regular map
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    kind = path.suffix.lower()
    if kind not in PLAIN:
        raise InputError(
            f"{path}: files of type {path.suffix!r} are none of {', '.join(PLAIN)}; asperity import-map makes a "
            "surface of the files of instruments"
        )
    if channel is not None or (array is not None and kind != ".npz"):
        name = "--channel" if channel is not None else "--array"
        raise InputError(f"{path}: {name} is for files of {'instruments' if name == '--channel' else 'type .npz'}")
    try:
        if kind in TEXT:
            return read_text_map(path, unit, missing)
        z, dx, dy, name = _read_arrays(path, array)
        z = without_marks(z, missing)
    except UNREADABLE as error:
        raise InputError(f"{path}: cannot be read as a height map ({one_line(error)})") from None
    factor = 1.0 if unit is None else unit
    dx, dy = (None if step is None else factor * step for step in (dx, dy))
    named = name not in ("", "z")
    notes = (f"the heights are the array {name!r}",) if named else ()
    return Heights(factor * z, dx, dy, channel=name if named else "", notes=notes)


def _read_arrays(path: Path, wanted: str | None) -> tuple[Array, float | None, float | None, str]:
    """Heights (ny, nx), spacings (unit of the file) and name of the array of a file of NumPy."""
    if path.suffix.lower() == ".npy":
        return real(read_npy(path)), None, None, ""
    data = read_npz(path)
    maps = [name for name, array in data.items() if np.ndim(array) == 2 and name not in ("x", "y")]
    name = wanted or ("z" if "z" in data or len(maps) != 1 else maps[0])
    if name not in data:
        more = "" if wanted else ": name the heights with --array"
        raise ValueError(f"no array {name!r}; it has {', '.join(data) or 'none'}{more}")
    z = real(data[name])
    if "x" in data and "y" in data:
        x, y = real(data["x"]), real(data["y"])
        if z.shape != (y.size, x.size):
            raise ValueError(f"z has shape {z.shape}, expected (len(y), len(x)) = ({y.size}, {x.size})")
        return z, _step("x", x), _step("y", y), name
    if "dx" in data:
        return z, float(data["dx"]), float(data["dy"] if "dy" in data else data["dx"]), name
    if "L" not in data:
        return z, None, None, name
    sides, (ny, nx) = real(data["L"]).ravel(), z.shape if z.ndim == 2 else (1, z.shape[-1])
    if sides.size == 1 and nx != ny and min(nx, ny) > 3:
        raise ValueError(f"{UNEQUAL.format(nx, ny)}: write dx and dy, or both sides as L = [Lx, Ly]")
    if not 0 < sides.size < 3:
        raise ValueError("L must be the side of the patch, or its two sides")
    return z, float(sides[0]) / max(nx - 1, 1), float(sides[-1]) / max(ny - 1, 1), name


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


def read_instrument(
    path: Path, pixel: tuple[float, float] | None = None, unit: float | None = None, channel: str | None = None
) -> Heights:
    """Read the file of an instrument by SurfaceTopography, with the arguments of `HeightField.read`; `unit` in metres.

    Raises:
        InputError: the file cannot be read as a map, lacks pixel or unit, has no such channel, or has the name of a
            text and is none, without SurfaceTopography
        CompatError: SurfaceTopography is not installed
    """
    try:
        import SurfaceTopography  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError:
        if channel is None and path.suffix.lower() in TEXT:
            raise InputError(
                f"{path} is no text: it is damaged, or the file of an instrument under the name of a text, which "
                "SurfaceTopography reads (pip install 'asperity[scan]')"
            ) from None
        raise CompatError(
            f"{path} is no text and no array of NumPy: the files of instruments need SurfaceTopography, pip install "
            "'asperity[scan]'"
        ) from None
    from SurfaceTopography.Exceptions import (  # type: ignore[import-not-found, import-untyped, unused-ignore]
        CannotDetectFileFormat,
    )

    reader, logged = None, logging.root.manager.disable
    try:
        with warnings.catch_warnings(), redirect_stdout(None):
            warnings.simplefilter("ignore")
            logging.disable(logging.CRITICAL)
            reader = SurfaceTopography.open_topography(str(path))
            return _of_reader(path, reader, pixel, unit, channel)
    except (InputError, CompatError):
        raise
    except CannotDetectFileFormat:
        raise InputError(f"{path} is in none of the formats that SurfaceTopography reads, or damaged") from None
    except Exception as error:  # readers of forty formats raise what they like
        who = "SurfaceTopography" if reader is None else f"{type(reader).__name__} of SurfaceTopography"
        raise InputError(f"{path}: cannot be read as a height map by {who} ({one_line(error)})") from None
    finally:
        logging.disable(logged)


def _of_reader(
    path: Path, reader: Any, pixel: tuple[float, float] | None, unit: float | None, wanted: str | None
) -> Heights:
    """Heights of a channel of a file."""
    who = f"{type(reader).__name__} of SurfaceTopography"
    channel, name, notes = _channel(path, reader, wanted, who)
    grid = tuple(int(n) for n in channel.nb_grid_pts)
    seen = f"channel {_printable(channel.name)!r} of {' x '.join(map(str, grid))} heights by {who}"
    if math.prod(grid) > MOST_READ:  # before memory for it is allocated
        raise InputError(
            f"{path} is read as {seen}, more than {MOST_READ:.0e} heights: probably a file of another format; export "
            "the map as .npz or .gwy"
        )
    sizes: dict[str, Any] = {}
    if channel.physical_sizes is None:
        if pixel is None:
            raise InputError(
                f"{path} contains heights without lengths, as {seen}; if they are a map, give the distance between "
                "heights (--pixel)"
            )
        sizes = {"physical_sizes": tuple(n * step for n, step in zip(grid, pixel, strict=True)), "unit": "m"}
    topography = reader.topography(channel_index=channel.index, **sizes)
    if topography.dim != 2 or not topography.is_uniform:
        raise InputError(f"{path} holds a line scan: {PROFILE}")
    if topography.unit is None and unit is None:
        raise InputError(f"{path} does not give the unit of its lengths: give it (--unit)")
    in_metres, factor = (topography, unit) if topography.unit is None and unit else (topography.to_unit("m"), 1.0)
    dx, dy = (factor * float(p) for p in in_metres.pixel_size)
    side = max(n * step for n, step in zip(grid, (dx, dy), strict=True))
    if not 0.0 < side < WIDEST:
        raise InputError(
            f"{path} is read as {seen}, {side:.3g} m wide: the reader mistakes its unit or its format; export the map "
            "as .npz, .gwy or text"
        )
    z = np.ma.filled(np.ma.masked_invalid(np.ma.asarray(in_metres.heights(), dtype=float)), np.nan)
    return Heights(factor * np.asarray(z).T, dx, dy, name, notes)  # its first index is x


def _channel(path: Path, reader: Any, wanted: str | None, who: str) -> tuple[Any, str, tuple[str, ...]]:
    """Channel with the heights, its name where there are several, and a sentence then."""
    channels = list(reader.channels)
    if not channels:
        raise InputError(f"{path}: {who} finds no channel with heights in it")
    names = [_printable(channel.name) for channel in channels]
    numbered = [f"{i} {name!r}" for i, name in enumerate(names, 1)]
    listed, more = ", ".join(numbered), ""
    if wanted is not None:
        if wanted in names:
            at = names.index(wanted)
        elif wanted.isdecimal() and 0 < int(wanted) <= len(channels):
            at = int(wanted) - 1
        else:
            raise InputError(f"{path} has no channel {wanted!r}: choose a name or a number of {listed}")
    elif len(channels) == 1:
        return reader.default_channel, "", ()
    else:
        own, more = reader.default_channel, ": --channel chooses another"
        at = next((i for i, one in enumerate(channels) if one is own or one.index == own.index), 0)
        maps = [i for i, one in enumerate(channels) if one.dim == 2 and _HEIGHT.search(names[i])]
        if maps and not _HEIGHT.search(names[at]):
            raise InputError(
                f"{path}: the default channel {names[at]!r} may be no heights, as {names[maps[0]]!r} may be: choose "
                f"with --channel a name or a number of {listed}"
            )
    return channels[at], names[at] if len(channels) > 1 else "", (f"channel {numbered[at]} of {listed}{more}",)


def _printable(name: Any) -> str:
    return "".join(c for c in str(name) if c.isprintable())
