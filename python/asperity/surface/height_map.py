"""A measured or computed regular height map, interpolated by a spline."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from asperity.errors import InputError
from asperity.runtime.files import UNREADABLE, one_line, read_matrix, read_npy, read_npz, real
from asperity.surface.base import Array, Surface, check, check_positive, is_integer, nodes

if TYPE_CHECKING:
    from scipy.interpolate import RectBivariateSpline


DEEPEST, FARTHEST = 10.0, 1e6  # peak to valley and distance from zero of heights that make sense [L]


@dataclass(frozen=True, eq=False, kw_only=True)
class HeightMap(Surface):
    """Heights on a regular grid over a square patch, joined by a tensor-product spline.

    Files: .npz with z and either x, y or L; .npy with z; .csv with rows of z, or with a header
    x,y,z and one point a line. z has the index order [iy, ix]; its first and last rows and
    columns lie on the edges of the patch. Spacings in x and y may differ, the patch must be
    square; the origin is shifted to (0, 0). All lengths in metres.

    Attributes:
        path: the file.
        L: side of the patch (length); needed when the file has no coordinates, else checked.
        order: degree of the spline, 3 (default) to 5.
    """

    path: str | Path
    L: float = None  # type: ignore[assignment]  # from the file, see __post_init__
    order: int = 3

    kind: ClassVar[str] = "file"
    rough: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check(isinstance(self.path, (str, Path)), "path", self.path, "the name of a file")
        check(is_integer(self.order) and 3 <= self.order <= 5, "order", self.order, "3, 4 or 5")
        if self.L is not None:
            check_positive("L", self.L)
        z, side = _read(Path(self.path))
        _check_heights(z, self.order, self.path)
        if side is not None and self.L is not None and not np.isclose(side, self.L, rtol=1e-6):
            raise InputError(
                f"surface.L = {self.L:g} disagrees with the side {side:g} found in {self.path}; "
                "leave surface.L out or correct it."
            )
        L = side if side is not None else self.L
        if L is None:
            raise InputError(f"surface.L is missing: {self.path} holds heights without lengths.")
        depth, level = float(z.max() / L - z.min() / L), float(np.abs(z).max() / L)
        if not (depth <= DEEPEST and level <= FARTHEST):
            raise InputError(
                f"{self.path}: heights from {z.min():.3g} to {z.max():.3g} on a patch of side {L:.3g} are no surface; "
                "give heights and surface.L in the same unit (m)."
            )
        z.flags.writeable = False
        object.__setattr__(self, "L", float(L))
        object.__setattr__(self, "_z", z)

    @property
    def heights(self) -> Array:
        """The map as read (length), index [iy, ix]."""
        z: Array = self.__dict__["_z"]
        return z

    @cached_property
    def _spline(self) -> RectBivariateSpline:
        from scipy.interpolate import RectBivariateSpline

        ny, nx = self.heights.shape
        x, y = np.linspace(0, self.L, nx), np.linspace(0, self.L, ny)
        # the spline's first axis is x
        return RectBivariateSpline(x, y, self.heights.T, kx=self.order, ky=self.order, s=0)

    @property
    def feature_size(self) -> float:
        """Twice the larger sample spacing (length)."""
        return 2 * self.L / (min(self.heights.shape) - 1)

    def _at(self, x: ArrayLike, y: ArrayLike, dx: int = 0, dy: int = 0) -> Array:
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        values = self._spline.ev(x.ravel(), y.ravel(), dx=dx, dy=dy)
        return np.asarray(values, dtype=float).reshape(x.shape)

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return self._at(x, y)

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        return self._at(x, y, 1, 0), self._at(x, y, 0, 1)

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        return self._at(x, y, 2, 0), self._at(x, y, 1, 1), self._at(x, y, 0, 2)

    # on a grid a tensor-product spline costs far less than at scattered points

    def _product(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        z, zx, zy = (self._spline(x, y, dx, dy).T for dx, dy in ((0, 0), (1, 0), (0, 1)))
        return z, zx, zy

    def grid(self, n: int) -> Array:
        return self._product(nodes(self.L, n), nodes(self.L, n))[0]

    def grid_gradient(self, n: int) -> tuple[Array, Array]:
        _, zx, zy = self._product(nodes(self.L, n), nodes(self.L, n))
        return zx, zy

    def grid_hessian(self, n: int) -> tuple[Array, Array, Array]:
        s = nodes(self.L, n)
        xx, xy, yy = (self._spline(s, s, dx, dy).T for dx, dy in ((2, 0), (1, 1), (0, 2)))
        return xx, xy, yy

    def mean(self) -> float:
        """Return the mean of the spline over the patch (length), exact."""
        return float(self._spline.integral(0, self.L, 0, self.L)) / self.L**2

    def curvature_bound(self) -> float:
        """Return a bound of the Hessian (1/length) from the hull of the spline coefficients."""
        bounds = [
            float(np.abs(self._spline.partial_derivative(dx, dy).tck[2]).max()) for dx, dy in ((2, 0), (1, 1), (0, 2))
        ]
        return max(bounds[0], bounds[2]) + bounds[1]


def _check_heights(z: Array, order: int, path: str | Path) -> None:
    if z.ndim != 2 or min(z.shape) < order + 1:
        raise InputError(
            f"{path}: heights have shape {z.shape}; a map needs two dimensions of at least "
            f"{order + 1} points (spline order {order})."
        )
    bad = np.argwhere(~np.isfinite(z))
    if len(bad):
        raise InputError(
            f"{path}: {len(bad)} height(s) are not finite, the first at row {bad[0][0]}, column "
            f"{bad[0][1]}; fill the gaps before use."
        )


def _read(path: Path) -> tuple[Array, float | None]:
    """Return heights [iy, ix] and the side of the patch (None when the file does not tell)."""
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
    with path.open(encoding="utf-8") as file:
        header = [name.strip() for name in file.readline().split(",")]
    if header != ["x", "y", "z"]:
        return read_matrix(path, ","), None
    table = read_matrix(path, ",", skip=1)
    x, column = np.unique(table[:, 0], return_inverse=True)
    y, row = np.unique(table[:, 1], return_inverse=True)
    if len(table) != x.size * y.size or np.unique(row * x.size + column).size != len(table):
        raise InputError(f"{path}: {len(table)} points do not fill a regular map of {x.size} x and {y.size} y values.")
    z = np.empty((y.size, x.size))
    z[row, column] = table[:, 2]
    return z, _side(x, y, path)


def _side(x: Array, y: Array, path: Path) -> float:
    """Return the side of the patch, refusing irregular spacing and patches that are not square."""
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
