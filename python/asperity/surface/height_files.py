# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Files of height maps on regular grids."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.runtime.files import UNREADABLE, one_line, read_npy, read_npz, real
from asperity.surface.base import check_positive
from asperity.surface.text_map import read_text_map


def read_heights(path: Path) -> tuple[Array, float | None]:
    """Heights (ny, nx) and side of the patch, None if the file does not contain it [length].

    Raises:
        InputError: the file is missing, of another type, damaged, or not a regular map of a square patch
    """
    readers = {".npz": _read_npz, ".npy": _read_npy, ".csv": _read_csv}
    if path.suffix not in readers:
        raise InputError(f"surface.path = {str(path)!r}: unknown type {path.suffix!r}; legal: .npz, .npy, .csv.")
    if not path.is_file():
        raise InputError(f"surface.path = {str(path)!r}: there is no such file.")
    try:
        return readers[path.suffix](path)
    except UNREADABLE as error:
        raise InputError(f"{path}: cannot be read as a height map ({one_line(error)}).") from error


def _read_npy(path: Path) -> tuple[Array, None]:
    return real(read_npy(path)), None


def _read_npz(path: Path) -> tuple[Array, float | None]:
    data = read_npz(path)
    if "z" not in data:
        raise InputError(f"{path}: no array 'z'; it has {', '.join(data) or 'none'}.")
    z = real(data["z"])
    if "x" in data and "y" in data:
        x, y = (real(data[key]) for key in ("x", "y"))
        if x.ndim == y.ndim == 2:
            if x.shape != z.shape or y.shape != z.shape:
                raise InputError(f"{path}: x {x.shape}, y {y.shape}, z {z.shape} must agree.")
            if not (np.allclose(x, x[0]) and np.allclose(y, y[:, :1])):
                raise InputError(f"{path}: x must vary along columns only, y along rows only.")
            x, y = x[0], y[:, 0]
        if z.shape != (y.size, x.size):
            raise InputError(f"{path}: z has shape {z.shape}, expected (len(y), len(x)) = ({y.size}, {x.size}).")
        return z, _side(x, y, path)
    if "L" in data:
        side = float(real(data["L"]))
        check_positive("L", side)
        return z, side
    return z, None


def _read_csv(path: Path) -> tuple[Array, float | None]:
    z, dx, dy = read_text_map(path, 1.0, np.asarray)
    if dx is None or dy is None:
        return z, None
    ny, nx = z.shape
    return z, _side(dx * np.arange(nx), dy * np.arange(ny), path)


def _side(x: Array, y: Array, path: Path) -> float:
    """Side of the patch (length).

    Raises:
        InputError: the spacing is irregular, or the patch is not square
    """
    for name, values in (("x", x), ("y", y)):
        steps = np.diff(values)
        if values.ndim != 1 or values.size < 2 or not np.all(steps > 0):
            raise InputError(f"{path}: {name} must be a rising sequence of at least two values.")
        if np.ptp(steps) > 1e-6 * steps.mean():
            raise InputError(
                f"{path}: {name} is not regularly spaced (steps {steps.min():g} to {steps.max():g}); resample the map."
            )
    sides = float(np.ptp(x)), float(np.ptp(y))
    if not np.isclose(*sides, rtol=1e-6):
        raise InputError(
            f"{path}: the patch must be square, but x spans {sides[0]:g} and y {sides[1]:g}; crop the map."
        )
    return sides[0]
