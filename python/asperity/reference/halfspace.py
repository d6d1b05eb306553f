"""Rough contact of a half-space or a layer in small-slope theory (boundary elements), with a greatest pressure.

It sees every spot of a surface in seconds, where a finite element mesh needs elements smaller than the spots.

The patch [0, L]^2 with sides u.n = 0 is one quarter of the period of its even mirror image: on the sides both the
normal displacement and the shear stress vanish by symmetry. The surface displacement is therefore a cosine series,
and each wave has the compliance of a half-space, or of a layer on a fixed base. With periodic sides the patch is the
period, and the series has sines too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array, Floats
from asperity.errors import ConvergenceError, InputError
from asperity.reference.elastic import block_modulus, reduced_modulus
from asperity.runtime.display import short_repr
from asperity.surface import Surface

HARDNESS = 3.0  # of a full plastic indentation over the yield strength; Tabor, The Hardness of Metals (1951)
_ITERATIONS = 200  # at one approach; what is left then is far below the use of the result
SINGLE = 1e-4  # tolerance from which single precision is enough: it changes forces by 1e-7 to 3e-5 at 1e-3
_SPOT_CELLS = 32.0  # along the radius of a spot
_STRIDE = 256  # cosine transforms of multiples of it take up to twice as long: their columns share cache lines


def cells_per_side(least: float) -> int:
    """Number of cells per side of a `RoughHalfSpace` with a fast transform, no fewer than `least`."""
    from scipy.fft import next_fast_len

    n = next_fast_len(math.ceil(least), real=True)  # no factors above 5, which the cosine transform wants too
    return n if n % _STRIDE else cells_per_side(n + 1)


@dataclass(frozen=True)
class RoughHalfSpace:
    """Rigid flat on a layer, small slopes, elastic up to a greatest pressure.

    The pressure minimises the complementary energy under 0 <= p <= hardness (Almqvist, Sahlin, Larsson & Glavatskih,
    Tribol. Int. 40 (2007) 574), by projected conjugate gradients with a cosine or Fourier transform.

    Attributes:
        n: cells per side of the patch
        height: thickness of the layer [L]
        nu: Poisson's ratio
        sides: "rollers" (u.n = 0), "periodic" or "free"; free sides change the compression of the layer only
        hardness: greatest pressure over E', inf for an elastic layer

    Examples:
        >>> surface = asp.Surface.from_spec("weierstrass-mandelbrot", L=1e-6, D=2.4, G=1.36e-11)
        >>> layer = asp.reference.RoughHalfSpace(n=64, height=1.0, nu=0.3)
        >>> curve = layer.curve(layer.heights(surface), surface.maximum()[2] / surface.L, [0.01, 0.02])
        >>> curve.P_star.round(4), bool(curve.area_fraction[0] < curve.area_fraction[1])
        (array([0.0008, 0.0056]), True)
    """

    n: int
    height: float
    nu: float
    sides: str = "rollers"
    hardness: float = np.inf

    def heights(self, surface: Surface) -> Floats:
        """Heights at the centres of the cells (n, n), index [iy, ix], in L."""
        centres = (np.arange(self.n) + 0.5) * (surface.L / self.n)
        return surface.on_product(centres, centres) / surface.L

    def curve(
        self,
        heights: Floats,
        summit: float,
        delta_star: ArrayLike,
        tolerance: float = 1e-3,
    ) -> RoughCurve:
        """Press the layer to ascending approaches.

        Args:
            heights, summit, delta_star, tolerance: see `pressures`

        Raises:
            InputError: the approaches do not ascend from above zero
        """
        delta = np.asarray(delta_star, dtype=float)
        touched_at = np.full(heights.shape, np.inf)
        force, area = [], []
        for k, p in enumerate(self.pressures(heights, summit, delta, tolerance)):
            touched_at[(p > 0.0) & np.isinf(touched_at)] = delta[k]
            force.append(float(p.mean()))
            area.append(self.area(p))
        return RoughCurve(delta, np.array(force), np.array(area), touched_at)

    def area(self, pressure: Floats) -> float:
        """True over nominal area of contact under a pressure (n, n), corrected for the perimeter."""
        return max(corrected_area(pressure > 0.0, self.sides), 0.0)

    def pressures(
        self,
        heights: Floats,
        summit: float,
        delta_star: ArrayLike,
        tolerance: float = 1e-3,
        starts: Sequence[Array] = (),
    ) -> Iterator[Floats]:
        """Pressures over E' (n, n) at ascending approaches, one after the other.

        Args:
            heights: of the surface at the centres of the cells (n, n) [L]
            summit: height that the flat touches first [L]
            delta_star: ascending approaches from there (k,) [L]
            tolerance: largest gap in contact and penetration elsewhere, over the greatest approach
            starts: pressures over E' to begin with, as of a similar surface (k, n, n); default those of the approach
                before

        Raises:
            InputError: the approaches do not ascend from above zero
        """
        delta = np.asarray(delta_star, dtype=float)
        if not (len(delta) and delta[0] > 0.0 and np.all(np.diff(delta) > 0.0)):
            raise InputError(f"delta_star = {delta.tolist()} must ascend from above 0")
        precision = np.single if tolerance >= SINGLE else np.double
        compliance = compliance_of_waves(self.n, self.height, self.nu, self.sides).astype(precision)
        p = np.zeros(heights.shape, dtype=precision)
        for k, d in enumerate(delta):
            penetration = (heights - (summit - d)).astype(precision)
            p = starts[k].astype(precision) if len(starts) else p
            within, outside = np.zeros(heights.shape, dtype=bool), penetration > 0.0
            if not outside.any():
                p = np.zeros_like(p)  # not that of another grid, which resolves the first spot
            while outside.any():  # a thin layer bulges beside the spots, and may touch where it would not undeformed
                within |= outside | (p > 0.0)  # few cells: what is done besides the transforms is done for them
                cells = np.flatnonzero(within)
                first = p if p.any() else np.maximum(penetration, 0.0) / compliance.max()
                p, displaced, _ = _iterate(
                    cells, np.clip(first.ravel()[cells], 0, self.hardness), penetration, compliance, self.sides,
                    self.hardness, tolerance * delta[-1],
                )  # fmt: skip
                outside = (displaced - penetration < -tolerance * delta[-1]) & ~within
            yield p.astype(float)


@dataclass(frozen=True)
class RoughCurve:
    """Curve of a `RoughHalfSpace`: approach over L, mean pressure over E' and corrected area fraction, each (k,).

    Attributes:
        touched_at: first of the approaches at which each cell is in contact, inf for never (n, n) [L]
    """

    delta_star: Floats
    P_star: Floats
    area_fraction: Floats
    touched_at: Floats

    __repr__ = short_repr


def _iterate(
    cells: Array, p: Array, penetration: Array, compliance: Array, sides: str, hardness: float, tolerance: float,
    load: float | None = None, most: int = _ITERATIONS,
) -> tuple[Array, Array, int]:  # fmt: skip
    """Pressure over E' and displacement by it (n, n) [L] after iterations at some cells, and their number.

    Args:
        cells: numbers of those that may touch (m,)
        p: pressure there at first (m,)
        penetration: of the undeformed surface into the flat (n, n) [L]
        compliance: of each wave (n, n) [L]
        tolerance: largest gap in contact and penetration elsewhere [L]
        load: mean pressure over E', with which the height of the flat is free; None at that of `penetration`
        most: iterations
    """
    grid = np.zeros(penetration.shape, penetration.dtype)  # in rows, for ravel to be a view

    def displaced(values: Array) -> Array:
        grid.ravel()[cells] = values
        return displacement(grid, compliance, sides)

    depth = penetration.ravel()[cells]
    direction, previous, conjugate, count = np.zeros_like(p), 1.0, False, 0
    for _ in range(most):
        count += 1
        displaced_by_p = displaced(p)
        gap = displaced_by_p.ravel()[cells] - depth
        if load is not None:
            gap -= gap[p > 0.0].mean()
        full = (p >= hardness) & (gap < 0.0)  # flows under the greatest pressure
        free = (p > 0.0) & ~full
        apart = -float(gap[~full].min(initial=0.0))
        if max(float(np.abs(gap[free]).max(initial=0.0)), apart) <= tolerance:
            break
        square = float(np.sum(gap[free] ** 2))
        direction = np.where(free, gap + (square / previous if conjugate else 0.0) * direction, 0.0)
        previous = square or 1.0
        image = displaced(direction).ravel()[cells]
        if load is not None:
            image -= image[free].mean()
        curvature = float(np.sum(image[free] * direction[free]))
        step = float(np.sum(gap[free] * direction[free])) / curvature if curvature > 0.0 else 0.0
        new = np.clip(p - step * direction, 0.0, hardness)
        overlap = (new == 0.0) & (gap < 0.0)
        new[overlap] -= (step or 1.0 / compliance.max()) * gap[overlap]
        conjugate = not overlap.any() and bool(np.all((new >= hardness) == (p >= hardness)))
        p = np.minimum(new, hardness)
        if load is not None:
            p *= load * penetration.size / p.sum()
    grid.ravel()[cells] = p
    return grid, displaced_by_p, count


@dataclass(frozen=True)
class HalfSpaceContact:
    """Rough elastic contact at one load.

    Attributes:
        P_star: mean pressure over E'
        delta_star: approach from first touch over L: of the interface alone for a half-space, of the whole
            block for a layer
        area_fraction: true over nominal contact area, corrected for the perimeter
        pressure: pressure over E' at the cell centres ((i + 1/2) L/n), shape (n, n), [iy, ix]
    """

    P_star: float
    delta_star: float
    area_fraction: float
    pressure: Array

    __repr__ = short_repr


def half_space_contact(
    surface: Surface,
    n: int,
    *,
    P_star: float | None = None,
    delta_star: float | None = None,
    height: float | None = None,
    nu: float = 0.3,
    tolerance: float = 1e-8,
    max_iterations: int = 5000,
    start: Array | None = None,
    sides: str = "rollers",
) -> HalfSpaceContact:
    """Press a rigid flat on an elastic rough surface to one load.

    Conjugate gradients on the contact set (Polonsky and Keer, Wear 231 (1999) 206) with a cosine or
    Fourier transform. Second order in L/n for force and approach.

    Args:
        surface: the surface; its exact maximum is the point of first touch
        n: cells per side
        P_star: mean pressure over E' (either this or delta_star)
        delta_star: approach over L; requires `height`, because the approach of a half-space to a mean pressure is
            infinite
        height: thickness h_b of the layer on a fixed base [length]; None for a half-space
        nu: Poisson's ratio, only used with height
        tolerance: largest gap in contact and penetration elsewhere, over the range of heights
        max_iterations: largest number of iterations
        start: initial pressure over E', shape (n, n)
        sides: "rollers" (u.n = 0) or "periodic"

    Raises:
        InputError: not exactly one load is given, or a value is out of range
        ConvergenceError: the largest number of iterations is reached

    Examples:
        >>> surface = asp.Surface.from_spec("weierstrass-mandelbrot", L=1e-6, D=2.4, G=1.36e-11)
        >>> light = asp.reference.half_space_contact(surface, 64, P_star=0.01)
        >>> bool(0.01 < light.delta_star < 0.03), bool(0.1 < light.area_fraction < 0.2)
        (True, True)
    """
    if (P_star is None) == (delta_star is None):
        raise InputError("Give exactly one of P_star and delta_star.")
    for name, value in (("P_star", P_star), ("delta_star", delta_star), ("height", height)):
        if value is not None and not value > 0:
            raise InputError(f"{name} = {value!r} must be positive.")
    if delta_star is not None and height is None:
        raise InputError("delta_star needs the height of the block: give height, or P_star instead.")
    # lengths over L, pressures over E'
    layer = RoughHalfSpace(n, 1.0 if height is None else height / surface.L, nu, sides)
    summit = surface.maximum()[2] / surface.L
    depth = layer.heights(surface) - summit + (delta_star or 0.0)
    compliance = compliance_of_waves(n, None if height is None else height / surface.L, nu, sides)
    if start is None:
        start = np.ones_like(depth) if delta_star is None else np.maximum(depth, 0.0) / compliance.max()
    p = np.array(start, dtype=float).ravel() if start.any() else (np.arange(depth.size) == depth.argmax()) * 1.0
    if P_star is not None:
        p *= P_star / p.mean()
    limit = tolerance * max(float(np.ptp(depth)), 1e-300)
    found, displaced, count = _iterate(
        np.arange(p.size), p, depth, compliance, sides, np.inf, limit, P_star, max_iterations + 2
    )
    if count > max_iterations + 1:
        raise ConvergenceError(
            f"Half-space contact: not to {tolerance:g} of the range of heights after {max_iterations} iterations; "
            "allow more iterations."
        )
    if delta_star is None:
        delta_star = -float(np.mean((depth - displaced)[found > 0.0]))
    return HalfSpaceContact(float(found.mean()), delta_star, corrected_area(found > 0.0, sides), found)


def added_to_spot(radius: float, centre: tuple[float, float], height: float, nu: float, sides: str) -> float:
    """Approach that a layer adds to that of a Hertzian spot on a half-space, over P*: negative where it is stiffer.

    The layer adds its compression, and takes away what its base and its sides, which mirror the spot, hold back. Both
    approaches are means over the pressure of Hertz. Free sides change the compression only: on blocks as high as wide
    and more, finite elements differ by 2 % of the approach.

    Args:
        radius: of the spot [L]
        centre: of the spot on the patch; in a corner a quarter of it is there [L]
        height, nu, sides: see `RoughHalfSpace`

    Returns:
        The approach over L and over the mean pressure on the patch in E'.

    Examples:
        On a high block with rollers: the compression less that by the images of a square lattice, Madelung's constant.

        >>> from asperity.reference.halfspace import added_to_spot
        >>> compression = 2.0 * asp.reference.reduced_modulus(1.0, 0.3) / asp.reference.block_modulus(1.0, 0.3)
        >>> print(f"{added_to_spot(0.05, (0.5, 0.5), 2.0, 0.3, 'rollers') - compression:.2f} {-3.9003 / np.pi:.2f}")
        -1.24 -1.24
    """
    n = round(min(max(_SPOT_CELLS / radius, 64), 1024))
    c = (np.arange(n) + 0.5) / n
    x, y = np.meshgrid(c - centre[0], c - centre[1])
    p = np.sqrt(np.maximum(1.0 - (x**2 + y**2) / radius**2, 0.0))
    u = displacement(p, compliance_of_waves(n, height, nu, sides), sides)
    # of a half-space u = 3F/(4 E' a) (1 - r^2/(2 a^2)), whose mean over the pressure is four fifths of the greatest
    alone = 0.8 * 0.75 * (2.0 / 3.0 * math.pi * radius**2) / radius
    return float((np.sum(p * u) / p.sum() - alone) / p.mean())


def displacement(p: Array, compliance: Array, sides: str = "rollers") -> Array:
    """Displacement (n, n) [L] under a pressure over E' (n, n), both at the centres of the cells.

    The compliance is that of `compliance_of_waves` for the same sides.
    """
    from scipy.fft import dctn, idctn, irfft2, rfft2

    if sides == "periodic":
        return np.asarray(irfft2(compliance[:, : p.shape[1] // 2 + 1] * rfft2(p), p.shape))
    return np.asarray(idctn(compliance * dctn(p, type=2), type=2))


def compliance_of_waves(n: int, height: float | None, nu: float, sides: str = "rollers") -> Array:
    """Displacement over pressure of each wave (n, n), in units of L and 1/E'.

    The waves are cosines of whole half waves, with periodic sides those of the discrete Fourier transform.

    Half-space: 2/q, and 0 for the mean. Layer bonded to a rigid base, frictionless top (Carbone
    and Mangialardi, J. Mech. Phys. Solids 56 (2008) 684): times S(q h), which tends to the
    confined compression h E'/M as q -> 0. Free sides change the mean only, M is then E.
    """
    along = 2 * math.pi * n * np.fft.fftfreq(n) if sides == "periodic" else math.pi * np.arange(n)
    q = np.hypot(*np.meshgrid(along, along))
    q[0, 0] = 1.0
    compliance = 2 / q
    if height is None:
        compliance[0, 0] = 0.0
        return compliance
    t = q * height
    decay = np.exp(-2 * t)  # numerator and denominator over cosh(2t), free of overflow
    sech, tanh = 2 * decay / (1 + decay**2), (1 - decay**2) / (1 + decay**2)
    m = 3 - 4 * nu
    layer = (m * tanh - 2 * t * sech) / (m + (5 - 12 * nu + 8 * nu**2 + 2 * t**2) * sech)
    compliance *= layer
    compliance[0, 0] = (
        height * reduced_modulus(1.0, nu) / block_modulus(1.0, nu, "free" if sides == "free" else "rollers")
    )
    return compliance


def corrected_area(contact: Array, sides: str = "rollers") -> float:
    """Contact fraction of cells (n, n) that touch, corrected for the perimeter.

    Yastrebov, Anciaux and Molinari, Tribol. Int. 114 (2017) 161: a cell counts when its centre touches, which
    overestimates the area by (pi - 1 + ln 2)/24 of a cell per face of the boundary. With periodic sides the faces
    between opposite sides count too.
    """
    faces = sum(np.count_nonzero(np.diff(contact, axis=axis)) for axis in (0, 1))
    if sides == "periodic":
        faces += np.count_nonzero(contact[0] != contact[-1]) + np.count_nonzero(contact[:, 0] != contact[:, -1])
    correction = (math.pi - 1 + math.log(2)) / 24 * faces / contact.size
    return float(contact.mean()) - correction
