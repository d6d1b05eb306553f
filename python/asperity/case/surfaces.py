"""A section of the case file and the declaration of its keys; the section [surface], a model for each kind."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, Strict

from asperity.surface import Surface

Real = Annotated[float, Strict(), Field(allow_inf_nan=False)]
Whole = Annotated[int, Strict()]
Flag = Annotated[bool, Strict()]
Text = Annotated[str, Strict()]

LENGTH, FORCE, STRESS = "length", "force", "force/length^2"
MIDDLE = "middle of the patch"


def key(doc: str, default: Any = ..., *, unit: str = "", shown: str = "", hint: str = "", **limits: Any) -> Any:
    """Declare a key: what it is, its default (`shown` when it follows from others), unit, hint."""
    extra: dict[str, Any] = {"unit": unit, "shown": shown, "hint": hint}
    return Field(default, description=doc, json_schema_extra=extra, **limits)


def optional(doc: str, unit: str, shown: str = "", hint: str = "") -> Any:
    """Declare a positive number that may be left out."""
    return key(doc, None, unit=unit, shown=shown, hint=hint, gt=0)


class Section(BaseModel):
    """A table of the case file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def given(self) -> dict[str, Any]:
        """Keys and values, those without a value left out."""
        return self.model_dump(exclude_none=True)


class _Patch(Section):
    L: Real = key("side of the square patch", unit=LENGTH, ge=1e-20, le=1e20, hint="1e-6 is 1 um in SI")

    @cached_property
    def built(self) -> Surface:
        """The surface of these keys, made once: its spline and its summit take longer than its file."""
        return Surface.from_spec(**self.given())


class WeierstrassMandelbrotSection(_Patch):
    """Fractal surface, modified two-variable Weierstrass-Mandelbrot function."""

    kind: Literal["weierstrass-mandelbrot"]
    D: Real = key("fractal dimension", gt=2, lt=3, hint="2.4 is a usual value")
    G: Real = key("fractal roughness", unit=LENGTH, gt=0, hint="1.36e-11 m is a usual value")
    M: Whole = key("ridges run at the angles pi mu/M; M + 1 of them, or M with ridges = 1..M", 10, ge=1, le=1000)
    gamma: Real = key("frequency ratio", 1.5, gt=1, le=100)
    f_max: Whole | None = key("highest frequency index", None, shown="5, or from L_s", ge=0, le=100)
    L_s: Real | None = optional("shortest wavelength, sets f_max", LENGTH)
    seed: Whole = key("seed of the random phases", 0, ge=0, lt=2**63)
    drawing: Literal["array", "nested"] = key(
        "of the phases: all at once, or nested, where a larger f_max adds waves to the same surface", "array"
    )
    ridges: Literal["0..M", "1..M"] = key("ridges in the sum", "0..M")


class SelfAffineSection(_Patch):
    """Self-affine surface, random waves with a power spectrum of Hurst exponent H and a roll-off."""

    kind: Literal["self-affine"]
    H: Real = key("Hurst exponent", ge=0.001, le=1, hint="0.8 is a usual value")
    rms_height: Real | None = optional(
        "rms height with the waves shorter than lambda_short included (or rms_slope)", LENGTH
    )
    rms_slope: Real | None = key("rms slope of the waves down to lambda_short (or rms_height)", None, gt=0, le=10)
    lambda_short: Real = key("shortest wavelength", unit=LENGTH, gt=0, hint="0.05 L for a first run")
    lambda_roll: Real | None = optional("roll-off wavelength", LENGTH, "L")
    aspect: Real = key("anisotropy: features are longer along x by this factor", 1.0, ge=0.0625, le=16)
    seed: Whole = key("seed of the random phases", 0, ge=0, lt=2**63)
    periodic: Flag = key("opposite edges agree; false: a window of a surface with the period 2 L", True)


class SphereSection(_Patch):
    """Sphere pressed by the flat."""

    kind: Literal["sphere"]
    radius: Real = key("radius of the sphere", unit=LENGTH, gt=0)
    centre: tuple[Real, Real] | None = key("position of the summit (x, y)", None, unit=LENGTH, shown=MIDDLE)
    shape: Literal["sphere", "paraboloid"] = key("profile", "sphere")


class SinusoidSection(_Patch):
    """Wavy surface in one or two directions."""

    kind: Literal["sinusoid"]
    amplitude: Real = key("half of peak to valley", unit=LENGTH, gt=0)
    wavelength: Real | None = optional("wavelength", LENGTH, "L")
    dims: Whole = key("1: waves along x; 2: along x and y", 1, ge=1, le=2)
    centre: tuple[Real, Real] | None = key("position of a crest (x, y)", None, unit=LENGTH, shown=MIDDLE)


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
