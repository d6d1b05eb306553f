"""Surfaces with a textbook contact solution, and indenters: sphere, cone, pyramid, flat."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.runtime.declaration import LENGTH, Choices, Real, Whole, declared, key
from asperity.surface.base import Surface, check

Point = tuple[Real, Real]
SHARP = 1e-9  # radius of an edge or a tip that counts as sharp [L]


def on_patch(centre: Point | None, L: float) -> Point:
    """A point of the patch, its middle where none is given (length)."""
    point = (L / 2, L / 2) if centre is None else centre
    check(all(0 <= c <= L for c in point), "centre", point, f"two coordinates between 0 and surface.L = {L:g}")
    return point


def _points(x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    return x, y


@declared("surface", eq=False, kw_only=True)
class Flat(Surface):
    """The plane z = 0.

    >>> from asperity.surface import Flat
    >>> Flat(L=2.0).maximum()
    (1.0, 1.0, 0.0)
    """

    kind: ClassVar[str] = "flat"

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return np.zeros(_points(x, y)[0].shape)

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        zero = self.height(x, y)
        return zero, zero.copy()

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        zero = self.height(x, y)
        return zero, zero.copy(), zero.copy()

    @property
    def periodic(self) -> bool:
        """Always."""
        return True

    def curvature_bound(self) -> float:
        return 0.0

    def maximum(self) -> tuple[float, float, float]:
        """Middle of the patch (x, y, z) (length); every point is a highest one."""
        return self.L / 2, self.L / 2, 0.0


@declared("surface", eq=False, kw_only=True)
class Indenter(Surface):
    """A body with one summit, at height 0."""

    centre: Point = key("position of the summit (x, y)", LENGTH, default=None, shown="middle of the patch")

    def __post_init__(self) -> None:
        super().__post_init__()
        self._complete(centre=on_patch(self.centre, self.L))

    def _offset(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        x, y = _points(x, y)
        return x - self.centre[0], y - self.centre[1]

    def maximum(self) -> tuple[float, float, float]:
        """Apex (x, y, z) (length)."""
        return (*self.centre, 0.0)


class Bump(Indenter):
    """A body of revolution: a cap of a sphere and the tangent cone beyond."""

    @property
    def _cap(self) -> tuple[float, float]:
        """Radius of the sphere, and that of the circle where cap and cone meet (length)."""
        raise NotImplementedError

    def _profile(self, r: Array) -> tuple[Array, Array, Array]:
        """z, z'/r and (z'' - z'/r)/r^2 of the radial profile in the shape of r; all are finite at r = 0."""
        R, rim = self._cap
        root = np.sqrt(R**2 - np.minimum(r, rim) ** 2)
        slope = -rim / math.sqrt(R**2 - rim**2)
        cap = r <= rim
        outer = np.where(cap, rim, r)
        z = np.where(cap, -(np.minimum(r, rim) ** 2) / (R + root), root - R + slope * (r - rim))
        over_r = np.where(cap, -1 / root, slope / outer)
        bend = np.where(cap, -1 / root**3, -slope / outer**3)
        return z, over_r, bend

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return self._profile(np.hypot(*self._offset(x, y)))[0]

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        dx, dy = self._offset(x, y)
        over_r = self._profile(np.hypot(dx, dy))[1]
        return over_r * dx, over_r * dy

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        dx, dy = self._offset(x, y)
        _, over_r, bend = self._profile(np.hypot(dx, dy))
        return over_r + bend * dx**2, bend * dx * dy, over_r + bend * dy**2

    def curvature_bound(self) -> float:
        R, rim = self._cap
        return R**2 / (R**2 - rim**2) ** 1.5  # meridian, at the rim of the cap


@declared("surface", eq=False, kw_only=True)
class Sphere(Bump):
    """One spherical bump with its apex at height 0.

    The shape "sphere" is z = sqrt(R^2 - r^2) - R up to r = 0.8 R (slope 4/3) and the tangent cone
    beyond, so that the surface is C1 and single-valued on any patch; "paraboloid" is z = -r^2/(2R),
    the profile of Hertz theory. With the centre in a corner the patch is a quarter of the bump
    (the sides u.n = 0 are then its planes of symmetry).

    >>> from asperity.surface import Sphere
    >>> sphere = Sphere(L=1.0, radius=10.0, centre=(0.0, 0.0), shape="paraboloid")
    >>> float(sphere.height(1.0, 0.0))
    -0.05
    """

    radius: Real = key("radius of the sphere", LENGTH, share=(1e-2, 1e9))
    shape: Annotated[str, Choices("sphere", "paraboloid")] = key("profile", default="sphere")

    kind: ClassVar[str] = "sphere"
    cap: ClassVar[float] = 0.8  # r/R of the circle where cap and cone meet

    @property
    def _cap(self) -> tuple[float, float]:
        return self.radius, self.cap * self.radius

    def _profile(self, r: Array) -> tuple[Array, Array, Array]:
        if self.shape == "paraboloid":
            return -(r**2) / (2 * self.radius), np.full(r.shape, -1 / self.radius), np.zeros(r.shape)
        return super()._profile(r)

    def curvature_bound(self) -> float:
        return 1 / self.radius if self.shape == "paraboloid" else super().curvature_bound()


@declared("surface", eq=False, kw_only=True)
class Cone(Bump):
    """A cone with its apex at height 0, which may be rounded by the sphere that touches the flank.

    >>> from asperity.surface import Cone
    >>> cone = Cone(L=1.0, half_angle=45.0)
    >>> round(float(cone.height(0.5, 0.75)), 6)
    -0.25
    """

    half_angle: Real = key("angle of the flank to the axis [degrees]", ge=5, lt=90, hint="70.3 for that of Berkovich")
    radius: Real = key("radius of the tip, 0 for a sharp one", LENGTH, default=0.0, ge=0, le=1e20)

    kind: ClassVar[str] = "cone"

    @property
    def _cap(self) -> tuple[float, float]:
        R = max(self.radius, SHARP * self.L)
        return R, R * math.cos(math.radians(self.half_angle))


@declared("surface", eq=False, kw_only=True)
class Pyramid(Indenter):
    """A pyramid with its apex at height 0: Berkovich's, Vickers', the corner of a cube.

    One of three faces falls along y; those of four fall along x and y.

    >>> from asperity.surface import Pyramid
    >>> vickers = Pyramid(L=1.0, faces=4, angle=68.0)
    >>> round(float(vickers.height(0.5, 0.75)), 6)
    -0.101007
    """

    faces: Whole = key("number of faces", default=3, ge=3, le=4)
    angle: Real = key(
        "angle of the faces to the axis [degrees]", default=65.3, ge=5, lt=90,
        hint="Berkovich 65.3, Vickers 68, corner of a cube 35.26",
    )  # fmt: skip

    kind: ClassVar[str] = "pyramid"

    def _faces(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """Heights of the planes of all faces (..., faces), and their slopes along x and y (faces, 2)."""
        at = np.pi * (0.5 + 2.0 * np.arange(self.faces) / self.faces)
        slopes = -np.stack([np.cos(at), np.sin(at)], axis=-1) / math.tan(math.radians(self.angle))
        return np.stack(self._offset(x, y), axis=-1) @ slopes.T, slopes

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return np.asarray(self._faces(x, y)[0].min(axis=-1))

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        z, slopes = self._faces(x, y)
        along: Array = slopes[z.argmin(axis=-1)]
        return along[..., 0], along[..., 1]

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        zero = np.zeros(_points(x, y)[0].shape)
        return zero, zero.copy(), zero.copy()

    def curvature_bound(self) -> float:
        return 1.0 / (SHARP * self.L)  # of its edges
