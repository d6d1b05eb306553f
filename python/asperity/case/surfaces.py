"""The section [surface] of the case file, a model for each kind."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Literal, get_args

from asperity.case.section import LENGTH, Flag, Real, Section, Text, Whole, key

if TYPE_CHECKING:
    from asperity.surface import Surface


class _Patch(Section):
    L: Real = key("side of the square patch", unit=LENGTH, ge=1e-20, le=1e20, hint="1e-6 is 1 um in SI")

    @cached_property
    def built(self) -> Surface:
        """The surface of these keys, made once: its spline and its summit take longer than its file."""
        from asperity.surface import Surface

        return Surface.from_spec(**self.given())


class WeierstrassMandelbrotSection(_Patch):
    """Fractal surface, modified two-variable Weierstrass-Mandelbrot function."""

    kind: Literal["weierstrass-mandelbrot"]
    D: Real = key("fractal dimension", gt=2, lt=3, hint="2.4 is a usual value")
    G: Real = key("fractal roughness", unit=LENGTH, gt=0, hint="1.36e-11 m is a usual value")
    M: Whole = key("ridges run at the angles pi mu/M; M + 1 of them, or M with ridges = 1..M", 10, ge=1, le=1000)
    gamma: Real = key("frequency ratio", 1.5, gt=1, le=100)
    f_max: Whole | None = key("highest frequency index", None, shown="5, or from L_s", ge=0, le=100)
    L_s: Real | None = key("shortest wavelength, sets f_max", None, unit=LENGTH, gt=0)
    seed: Whole = key("seed of the random phases", 0, ge=0, lt=2**63)
    drawing: Literal["array", "nested"] = key(
        "of the phases: all at once, or nested, where a larger f_max adds waves to the same surface", "array"
    )
    ridges: Literal["0..M", "1..M"] = key("ridges in the sum", "0..M")


class SelfAffineSection(_Patch):
    """Self-affine surface, random waves with a power spectrum of Hurst exponent H and a roll-off."""

    kind: Literal["self-affine"]
    H: Real = key("Hurst exponent", ge=0.001, le=1, hint="0.8 is a usual value")
    rms_height: Real | None = key(
        "rms height with the waves shorter than lambda_short included (or rms_slope)", None, unit=LENGTH, gt=0
    )
    rms_slope: Real | None = key("rms slope of the waves down to lambda_short (or rms_height)", None, gt=0, le=10)
    lambda_short: Real = key("shortest wavelength", unit=LENGTH, gt=0, hint="0.05 L for a first run")
    lambda_roll: Real | None = key("roll-off wavelength", None, shown="L", unit=LENGTH, gt=0)
    aspect: Real = key("anisotropy: features are longer along x by this factor", 1.0, ge=0.0625, le=16)
    seed: Whole = key("seed of the random phases", 0, ge=0, lt=2**63)
    periodic: Flag = key("opposite edges agree; false: a window of a surface with the period 2 L", True)


class SphereSection(_Patch):
    """Sphere pressed by the flat."""

    kind: Literal["sphere"]
    radius: Real = key("radius of the sphere", unit=LENGTH, gt=0)
    centre: tuple[Real, Real] | None = key(
        "position of the summit (x, y)", None, shown="middle of the patch", unit=LENGTH
    )
    shape: Literal["sphere", "paraboloid"] = key("profile", "sphere")


class SinusoidSection(_Patch):
    """Wavy surface in one or two directions."""

    kind: Literal["sinusoid"]
    amplitude: Real = key("half of peak to valley", unit=LENGTH, gt=0)
    wavelength: Real | None = key("wavelength", None, shown="L", unit=LENGTH, gt=0)
    dims: Whole = key("1: waves along x; 2: along x and y", 1, ge=1, le=2)
    centre: tuple[Real, Real] | None = key("position of a crest (x, y)", None, shown="middle of the patch", unit=LENGTH)


class FlatSection(_Patch):
    """Plane top."""

    kind: Literal["flat"]


class FileSection(_Patch):
    """Height map on a regular grid."""

    kind: Literal["file"]
    path: Text = key("file .npz, .npy or .csv", hint="a path relative to the case file")


SurfaceSection = (
    WeierstrassMandelbrotSection | SelfAffineSection | SphereSection | SinusoidSection | FlatSection | FileSection
)
SURFACES: tuple[type[Section], ...] = get_args(SurfaceSection)
