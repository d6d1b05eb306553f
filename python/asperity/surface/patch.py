"""Heights of a file as those of a square patch: what a map in a case must be."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.surface.base import check_positive
from asperity.surface.height_files import REGULAR, UNEQUAL, Heights
from asperity.surface.spline import DEGREE

MOST = 6000  # heights along a side: beyond it the spline and its derivatives need more than 6 GiB
DEEPEST, FARTHEST = 10.0, 1e6  # greatest plausible peak-to-valley height and distance of heights from zero [L]


def as_patch(read: Heights, side: float | None, where: str) -> tuple[Array, float]:
    """Heights (ny, nx) and side of a square patch (length).

    Args:
        read: heights of a file
        side: of the patch, None where the file has it (length)
        where: name of the file, for messages

    Raises:
        InputError: they are too few, too many, or incomplete, or no square patch
    """
    z, dx, dy, L = read.z, read.dx, read.dy, side
    check_heights(z, where)
    if max(z.shape) > MOST:
        raise InputError(
            f"{where}{z.shape[1]} x {z.shape[0]} heights are more than the {MOST} x {MOST} of a surface; cut "
            "a window, or filter the map and keep fewer (asperity import-map --window or --cutoff)."
        )
    if dx is not None and dy is not None:
        L, other = dx * (z.shape[1] - 1), dy * (z.shape[0] - 1)
        check_positive("L", L)
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
        check_square(z, where)
    depth, level = float(z.max() / L - z.min() / L), float(np.abs(z).max() / L)
    if not (depth <= DEEPEST and level <= FARTHEST):
        raise InputError(
            f"{where}heights from {z.min():.3g} to {z.max():.3g} on a patch of side {L:.3g} are not plausible; give "
            "heights and surface.L in the same unit (m)."
        )
    return z, float(L)


def check_square(z: Array, where: str = "") -> None:
    """Refuse heights that a side alone would stretch to a square."""
    if z.shape[0] != z.shape[1]:
        raise InputError(
            f"{where}{UNEQUAL.format(*z.shape[::-1])}: write dx and dy, or x and y, beside z into an .npz file, or cut "
            "a square with asperity import-map --pixel"
        )


def check_heights(z: Array, where: str = "") -> None:
    if z.ndim != 2 or min(z.shape) <= DEGREE:
        raise InputError(
            f"{where}heights have shape {z.shape}; a map needs two dimensions of at least {DEGREE + 1} points"
        )
    bad = np.argwhere(~np.isfinite(z))
    if len(bad):
        raise InputError(
            f"{where}{len(bad)} height(s) are not finite, the first at row {bad[0][0]}, column "
            f"{bad[0][1]}; asperity import-map fills gaps."
        )
