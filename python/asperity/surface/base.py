"""Base class of all surfaces, and construction of a surface from the [surface] section of a case."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from asperity.arrays import Array
from asperity.errors import AsperityWarning, InputError, warn
from asperity.runtime.declaration import LENGTH, Real, check_shares, declared, key
from asperity.runtime.display import nearest, short_repr, show
from asperity.surface.maximum import global_maximum
from asperity.surface.spectrum import Spectrum, psd

#: A summit closer to an edge of the patch than this counts as on the edge, and its mesh node is placed there [L].
EDGE = 1e-3
SMALL_SLOPE = 0.1  # rms slope up to which small-strain, small-slope contact theory is accurate
FLAT = 1e-12  # depth over the side below which a surface is a plane: that of round-off

_GRID = 1010  # nodes per side for statistics: 1009 intervals, a prime, are out of step with those of any other map
_SAMPLES = 513  # nodes per side of the heights of a surface that is no map
_CELLS, _POINTS = (128, 1024), 4  # of the rule for the mean height: cells along a side, points in a cell
LIGHT, LEAST = 0.02, 0.02  # share of the heights above the flat at a light load; least depth over their range
_STEEPNESS, _LONG = 16, 1e6  # exponent in `short_wave_share`, and ratio of lengths beyond which that is zero


Side = Annotated[Real, Field(ge=1e-20, le=1e20)]  # of the patch


class SurfaceWarning(AsperityWarning):
    """A surface is legal, but probably not the intended one, or its slopes exceed small-slope theory."""


@dataclass(frozen=True)
class SurfaceStatistics:
    """Roughness parameters of the patch from a regular grid; heights are taken about their mean.

    Attributes:
        Sq: rms height (length)
        Sz: height of the highest above the lowest node (length)
        rms_slope: sqrt(<|grad z|^2>) (dimensionless)
        rms_curvature: sqrt(<(laplacian z)^2>)/2 (1/length)
    """

    Sq: float
    Sz: float
    rms_slope: float
    rms_curvature: float

    __repr__ = short_repr


@declared("surface", eq=False, kw_only=True)
class Surface(ABC):
    """A height field z(x, y) on the closed patch [0, L]^2; immutable.

    >>> from asperity.surface import Surface
    >>> surface = Surface.from_spec("sphere", L=2.0, radius=5.0, shape="paraboloid")
    >>> surface.maximum()
    (1.0, 1.0, 0.0)
    >>> float(surface.height(2.0, 1.0))
    -0.1
    """

    L: Side = key("side of the square patch", LENGTH, hint="1e-6 is 1 um in SI")

    #: Name in the case file.
    kind: ClassVar[str] = ""
    #: Whether slope statistics over the patch describe the contact (False for a single bump).
    rough: ClassVar[bool] = False
    #: What cuts off its short waves, for a message.
    cutoff_key: ClassVar[str] = ""

    def __post_init__(self) -> None:
        check_shares(self, self.L)
        for note in self.notes:
            warn(note, SurfaceWarning)

    def _complete(self, **defaults: Any) -> None:
        """Give the arguments that were left out (None) their values."""
        for name, value in defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is doubtful of the arguments, or was taken for granted: a sentence each."""
        return ()

    @staticmethod
    def from_spec(kind: str, **parameters: Any) -> Surface:
        """Build a surface from the keys of the [surface] section.

        Args:
            kind: name of the kind, for example "weierstrass-mandelbrot"
            parameters: the keys of that kind; None leaves one out

        Raises:
            InputError: unknown kind or key (the message suggests the closest legal name), missing key, or
                a value outside its legal range
        """
        cls: Any = surface_kind(kind)
        names = {info.serialization_alias: name for name, info in cls.__pydantic_fields__.items()}
        surface: Surface = cls(**{names.get(name, name): v for name, v in parameters.items() if v is not None})
        return surface

    @abstractmethod
    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        """z (length) at the points (x, y), in the broadcast shape of x and y."""

    @abstractmethod
    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(dz/dx, dz/dy), dimensionless, in the broadcast shape of x and y."""

    @abstractmethod
    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        """(z_xx, z_xy, z_yy) (1/length), in the broadcast shape of x and y."""

    def mean(self) -> float:
        """Mean height over the patch (length), by Gauss's rule in cells, two at least for each `feature_size`."""
        n = int(np.clip(2.0 * self.L / self.feature_size, *_CELLS))
        at, weight = np.polynomial.legendre.leggauss(_POINTS)
        s = ((np.arange(n)[:, None] + 0.5 * (1.0 + at)) * (self.L / n)).ravel()
        share = np.tile(0.5 * weight / n, n)
        return float(share @ self.on_product(s, s) @ share)

    @abstractmethod
    def curvature_bound(self) -> float:
        """Upper bound of the spectral norm of the Hessian over the patch (1/length)."""

    @property
    def feature_size(self) -> float:
        """Shortest length on which the surface varies (length); it sets sampling grids."""
        return self.L

    def short_waves(self, wavelength: float, depth: float) -> float:
        """Rms height (length) of the waves shorter than a cut-off, see :func:`short_wave_share`.

        It is zero for smooth surfaces such as a sphere.

        Args:
            wavelength: cut-off (length)
            depth: depth below the summit (length); a surface that is not statistically uniform is judged above it
        """
        return 0.0

    @property
    def periodic(self) -> bool:
        """Whether heights and slopes agree at opposite edges of the patch."""
        return False

    def smoothed(self, x: ArrayLike, y: ArrayLike, s: ArrayLike) -> Array:
        """Heights of the surface convolved with an isotropic Gaussian, in the broadcast shape of x, y and s.

        A mesh whose elements are larger than the roughness follows these heights. They equal :meth:`height` for s = 0
        and tend to the mean for large s. Beyond the patch a formula continues; a map is mirrored at its edges. A
        surface without short waves, such as a sphere, is not smoothed: its heights are exact whatever s.

        Args:
            x, y: points of the patch (length)
            s: standard deviation of the Gaussian at each point (length), >= 0
        """
        x, y, _ = np.broadcast_arrays(x, y, s)
        return self.height(x, y)

    def maximum(self) -> tuple[float, float, float]:
        """(x, y, z) of the highest point of the closed patch, edges and corners included.

        The global maximum is found by :meth:`curvature_bound` and Newton iteration, so it does not depend on a grid.
        """
        return self._maximum

    @cached_property
    def _maximum(self) -> tuple[float, float, float]:
        return global_maximum(self)

    def edges_of_summit(self, near: float = 0.0) -> dict[str, float]:
        """Edges of the patch that the summit lies on, with the slope of the surface away from them.

        When the surface is mirrored at the edge, it has a ridge there if it falls away from the edge. It has no ridge
        if it is symmetric about the edge, or if it rises inwards to a summit close by.

        Args:
            near: distance from an edge below which the summit counts as on it (length), no less than EDGE L

        Returns:
            For each of "x = 0", "x = L", "y = 0" and "y = L" that applies: the slope across that edge at the
            summit, positive where the surface falls away from the edge (dimensionless)
        """
        place, found = self.maximum()[:2], {}
        for axis, name in enumerate("xy"):
            for end, inwards in (("0", 1.0), ("L", -1.0)):
                edge = 0.0 if end == "0" else self.L
                if abs(place[axis] - edge) < max(near, EDGE * self.L):
                    foot = [edge if i == axis else c for i, c in enumerate(place)]
                    found[f"{name} = {end}"] = -inwards * float(self.gradient(*foot)[axis])
        return found

    def grid(self, n: int) -> Array:
        """Heights (length) at the nodes linspace(0, L, n)^2, shape (n, n).

        Index order is [iy, ix]: row iy has y = iy L/(n-1), column ix has x = ix L/(n-1).
        """
        s = nodes(self.L, n)
        return self.on_product(s, s)

    def grid_gradient(self, n: int) -> tuple[Array, Array]:
        """(dz/dx, dz/dy) at the nodes of :meth:`grid`, each (n, n), index [iy, ix]."""
        s = nodes(self.L, n)
        return self.on_product(s, s, 1, 0), self.on_product(s, s, 0, 1)

    def grid_hessian(self, n: int) -> tuple[Array, Array, Array]:
        """(z_xx, z_xy, z_yy) at the nodes of :meth:`grid`, each (n, n), index [iy, ix]."""
        s = nodes(self.L, n)
        return self.on_product(s, s, 2, 0), self.on_product(s, s, 1, 1), self.on_product(s, s, 0, 2)

    def on_product(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> Array:
        """Derivative of z, dx times by x and dy times by y, at all pairs of x (nx,) and y (ny,): (ny, nx)."""

        def rows(y: Array) -> Array:
            at = x[None, :], y[:, None]
            return self.height(*at) if dx + dy == 0 else (self.gradient if dx + dy == 1 else self.hessian)(*at)[dy]

        step = max(1, 2**18 // x.size)
        return np.concatenate([rows(y[i : i + step]) for i in range(0, y.size, step)])

    def statistics(self, n: int = _GRID) -> SurfaceStatistics:
        """Roughness parameters of an n x n grid, whose nodes have the same weight; see :class:`SurfaceStatistics`."""
        z, (zx, zy), (xx, _, yy) = self.grid(n), self.grid_gradient(n), self.grid_hessian(n)
        slope, curvature = (float(np.sqrt(np.mean(square))) for square in (zx**2 + zy**2, (xx + yy) ** 2))
        return SurfaceStatistics(Sq=float(np.std(z)), Sz=float(np.ptp(z)), rms_slope=slope, rms_curvature=curvature / 2)

    def psd(self, n: int = 1024, window: str = "hann") -> Spectrum:
        """Radial power spectral density of the heights; see :func:`spectrum.psd`."""
        return psd(self.grid(n + 1)[:-1, :-1], self.L, window)

    @cached_property
    def heights(self) -> Array:
        """Heights from edge to edge (ny, nx), index [iy, ix] (length): those of a map, else of a grid of 513 x 513."""
        return self.grid(_SAMPLES)

    def light_approach(self) -> float:
        """Approach from the summit (length), at most a tenth of the side, with a small share of the heights above it.

        The share does not depend on the spectrum. A spike takes all of the approach.
        """
        return min(light_depth(self.heights, self.maximum()[2]), 0.1 * self.L)

    def rms_slope(self) -> float:
        """sqrt(<|grad z|^2>) over the patch (dimensionless)."""
        zx, zy = self.grid_gradient(_GRID)
        return float(np.sqrt(np.mean(zx**2 + zy**2)))

    def check_small_slope(self) -> None:
        """Warn (SurfaceWarning) when the rms slope exceeds SMALL_SLOPE, a limit of small strain."""
        slope = self.rms_slope()
        if slope > SMALL_SLOPE * (1.0 + 1e-9):  # the same in all units
            warn(
                f"surface: rms slope {slope:.3g} exceeds {SMALL_SLOPE:g}; small-strain results are approximate, "
                'material.kinematics = "auto" shows by how much.',
                SurfaceWarning,
            )


def surface_kind(kind: Any) -> type[Surface]:
    """Class of a kind (InputError: there is none of this name)."""
    kinds = surface_kinds()
    if not isinstance(kind, str) or kind not in kinds:
        state = "is missing" if kind is None else f"= {show(kind)} is unknown{nearest(str(kind).lower()[:50], kinds)}"
        raise InputError(f"surface.kind {state}; legal: {', '.join(map(show, sorted(kinds)))}")
    return kinds[kind]


def surface_kinds() -> dict[str, type[Surface]]:
    """All kinds of surfaces by their name in the case file: the subclasses with a `kind` of their own."""
    found: dict[str, type[Surface]] = {}
    waiting = Surface.__subclasses__()
    while waiting:
        cls = waiting.pop()
        waiting += cls.__subclasses__()
        if vars(cls).get("kind"):  # an inherited one is that of the base class
            found[cls.kind] = cls
    return found


def short_wave_share(length: Array | float, wavelength: float) -> Array:
    """Share of the amplitude of waves of a given length that counts as shorter than `wavelength`.

    The share falls from 1 for short waves to 0 for long ones and is 1/2 at the cut-off.

    Args:
        length: of the waves, any shape (length)
        wavelength: cut-off (length)
    """
    return np.asarray(1.0 / (1.0 + (np.minimum(np.asarray(length) / wavelength, _LONG)) ** _STEEPNESS))


def light_depth(z: Array, summit: float | None = None) -> float:
    """Depth below the summit, or the highest height, with a small share of the heights above it (length).

    >>> from asperity.surface.base import light_depth
    >>> round(float(light_depth(np.linspace(0.0, 1.0, 101))), 9)
    0.02
    """
    highest = float(z.max()) if summit is None else summit
    return max(highest - float(np.quantile(z, 1.0 - LIGHT)), LEAST * float(np.ptp(z)))


def nodes(L: float, n: int) -> Array:
    """linspace(0, L, n) (length).

    Raises:
        InputError: n is not an integer >= 2
    """
    if not (isinstance(n, int | np.integer) and n >= 2):
        raise InputError(f"A grid needs an integer number of nodes per side >= 2, not {n!r}.")
    return np.linspace(0.0, L, n)


def check(legal: bool, key: str, value: Any, rule: str) -> None:
    """Raise InputError 'surface.key = value is not legal: rule' unless legal."""
    if not legal:
        raise InputError(f"surface.{key} = {show(value)} is not legal: it must be {rule}.")
