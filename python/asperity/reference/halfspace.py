"""Independent solver for elastic rough contact in small-slope theory (boundary elements).

The patch [0, L]^2 with sides u.n = 0 is one quarter of the period of its even mirror image: on the sides both the
normal displacement and the shear stress vanish by symmetry. The surface displacement is therefore a cosine series,
and each wave has the compliance of a half-space, or of a layer on a fixed base. With periodic sides the patch is the
period, and the series has sines too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from asperity.arrays import Array
from asperity.errors import ConvergenceError, InputError
from asperity.reference.elastic import block_modulus, reduced_modulus
from asperity.runtime.display import short_repr
from asperity.surface import Surface


@dataclass(frozen=True)
class HalfSpaceContact:
    """Rough elastic contact at one load.

    Attributes:
        P_star: mean pressure over E'
        delta_star: approach from first touch over L: of the interface alone for a half-space, of the whole
            block for a layer
        area_fraction: true over nominal contact area, corrected for the perimeter
        pressure: pressure over E' at the cell centres ((i + 1/2) L/n), shape (n, n), [iy, ix]
        iterations: conjugate gradient steps
    """

    P_star: float
    delta_star: float
    area_fraction: float
    pressure: Array
    iterations: int

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
    """Press a rigid flat on an elastic rough surface.

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
        >>> surface = asp.reference.rough_elastic_surface()
        >>> light = asp.reference.half_space_contact(surface, 64, P_star=0.01)
        >>> print(f"delta* = {light.delta_star:.4f}, A/A_0 = {light.area_fraction:.3f}")
        delta* = 0.0193, A/A_0 = 0.154
    """
    _check_load(P_star, delta_star, height)
    # lengths over L, pressures over E'
    centres = (np.arange(n) + 0.5) * (surface.L / n)
    z = surface.on_product(centres, centres) / surface.L
    summit = surface.maximum()[2] / surface.L
    compliance = compliance_of_waves(n, None if height is None else height / surface.L, nu, sides)
    scale = max(float(np.ptp(z)), 1e-300)

    def displace(p: Array) -> Array:
        return displacement(p, compliance, sides)

    p = _start(start, z, P_star, delta_star, compliance, summit)
    direction, previous, conjugate = np.zeros_like(p), 1.0, False
    for iteration in range(max_iterations + 1):
        g = displace(p) - z
        contact = p > 0
        # the gap; under load control the height of the flat is unknown
        g -= g[contact].mean() if delta_star is None else delta_star - summit
        error = max(float(np.abs(g[contact]).max(initial=0.0)), -float(g.min())) / scale
        if error <= tolerance:
            break
        if iteration == max_iterations:
            raise ConvergenceError(
                f"Half-space contact: error {error:.2g} of the range of heights after "
                f"{max_iterations} iterations, tolerance {tolerance:g}; allow more iterations."
            )
        square = float(np.sum(g[contact] ** 2))
        direction = np.where(contact, g + (square / previous if conjugate else 0) * direction, 0.0)
        previous = square
        image = displace(direction)
        if P_star is not None:
            image -= image[contact].mean()
        curvature = float(np.sum(image[contact] * direction[contact]))
        step = float(np.sum(g[contact] * direction[contact])) / curvature if curvature > 0 else 0.0
        p = np.maximum(p - step * direction, 0.0)
        overlap = (p == 0) & (g < 0)
        conjugate = not overlap.any()
        p[overlap] -= (step or 1 / compliance.max()) * g[overlap]
        if P_star is not None:
            p *= P_star / p.mean()
    if delta_star is None:
        flat = float(np.mean((z - displace(p))[p > 0]))
        delta_star = summit - flat
    return HalfSpaceContact(float(p.mean()), delta_star, corrected_area(p > 0, sides), p, iteration)


def _check_load(P_star: float | None, delta_star: float | None, height: float | None) -> None:
    if (P_star is None) == (delta_star is None):
        raise InputError("Give exactly one of P_star and delta_star.")
    for name, value in (("P_star", P_star), ("delta_star", delta_star), ("height", height)):
        if value is not None and not value > 0:
            raise InputError(f"{name} = {value!r} must be positive.")
    if delta_star is not None and height is None:
        raise InputError("delta_star needs the height of the block: give height, or P_star instead.")


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


def _start(
    start: Array | None,
    z: Array,
    P_star: float | None,
    delta_star: float | None,
    compliance: Array,
    summit: float,
) -> Array:
    """Non-negative initial pressure (n, n), with the prescribed mean under load control."""
    if start is not None:
        p = np.array(start, dtype=float)
    elif delta_star is not None:
        p = np.maximum(z - (summit - delta_star), 0.0) / compliance.max()
    else:
        p = np.ones_like(z)
    if not p.any():
        p[np.unravel_index(np.argmax(z), z.shape)] = 1.0
    return p if P_star is None else p * (P_star / p.mean())


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
