"""Legal values: an argument or key that has another one is refused with the key, the value and what is legal."""

from __future__ import annotations

import operator
from dataclasses import fields
from math import isfinite
from numbers import Integral, Real
from typing import Any

from asperity.errors import InputError
from asperity.runtime.display import brief

#: Declared types that are checked, and what to write.
FORMS = {
    "float": "a number",
    "int": "a whole number",
    "str": "a text in quotes",
    "Surface": 'a surface, for example asp.Surface.from_spec("sphere", L=1e-6, radius=1e-5)',
    "Material": "a material, for example asp.Material(E=200e9, nu=0.3)",
    "MeshSize": "element sizes, for example asp.MeshSize(h_contact=0.04e-6)",
    "Formulation": 'a formulation, for example asp.Formulation("active-set")',
    "SolverOptions": 'options, for example asp.SolverOptions(linear="cg")',
    "AccuracyTarget": "a target, for example asp.AccuracyTarget(0.01)",
    "Schedule": "a load path, for example Schedule(delta_max=0.03e-6)",
}
# key -> legal range as a fraction of the side: wide enough for any sensible model, narrow enough to catch metres mixed
# with micrometres
FRACTIONS = {
    "block.height": (1e-3, 1e2),
    "loading.delta_max": (1e-7, 1e3),
    "mesh.h_contact": (1e-5, 1.0),
    "mesh.h_max": (1e-5, 1e3),
    "surface.G": (0.0, 1.0),
    "surface.L_s": (1e-9, 1.0),
    "surface.rms_height": (1e-9, 1.0),
    "surface.lambda_short": (1 / 2048, 2.0),
    "surface.lambda_roll": (1 / 2048, 2.0),
    "surface.amplitude": (1e-9, 1.0),
    "surface.wavelength": (1e-3, 1e3),
    "surface.radius": (1e-2, 1e9),
}
LEAST_FORCE = 1e-12  # over the nominal area and E'


def bounds(interval: str) -> dict[str, Any]:
    """Finite bounds of an interval such as "[0, 1)", by the names that pydantic and operator have for them."""
    low, high = (float(end) for end in interval[1:-1].split(","))
    found = {"ge" if interval[0] == "[" else "gt": low, "le" if interval[-1] == "]" else "lt": high}
    return {name: bound for name, bound in found.items() if isfinite(bound)}


def check_kind(name: str, value: Any, declared: str) -> None:
    """Refuse (InputError) a value of another type than declared, as in float | None, if that is in `FORMS`."""
    kinds = [kind.strip() for kind in declared.split("|") if kind.strip() != "None"]
    if not set(kinds) <= set(FORMS) or (value is None and "None" in declared):
        return
    numbers = tuple({"float": Real, "int": Integral}[kind] for kind in kinds if kind in ("float", "int"))
    if isinstance(value, numbers) and not isinstance(value, bool):
        return
    if not {base.__name__ for base in type(value).__mro__} & (set(kinds) - {"int"}):
        raise InputError(f"{name} = {brief(value)} must be {' or '.join(FORMS[kind] for kind in kinds)}")


def check(thing: Any, section: str = "", **legal: str | tuple[str, ...]) -> None:
    """Refuse a dataclass with a field of another type than declared, see `check_kind`, or with an illegal value.

    Args:
        thing: of a dataclass
        section: of a case file that has its fields as keys
        legal: interval of a field that is not None, for example "(0, 1]", or its words

    Raises:
        InputError: with the key, the value and what is legal
    """
    for field in fields(thing):
        check_kind(f"{section}.{field.name}" if section else field.name, getattr(thing, field.name), str(field.type))
    for name, values in legal.items():
        value = getattr(thing, name)
        if value is None:
            continue
        if isinstance(values, tuple):
            if value not in values:
                raise InputError(f'{section}.{name} = "{value}" is not one of {", ".join(values)}')
        elif not (
            value < float("inf") and all(getattr(operator, op)(value, end) for op, end in bounds(values).items())
        ):
            raise InputError(f"{section}.{name} = {value!r} must lie in {values}")


def check_length(key: str, value: float | None, side: float) -> None:
    """Refuse a length, None where it is not given, far from the side of the patch; the key is one of `FRACTIONS`."""
    low, high = FRACTIONS[key]
    if value is not None and not low * side <= value <= high * side:
        raise InputError(
            f"{key} = {value:g} is {value / side:.2g} of surface.L = {side:g}, legal are {low:g} to {high:g}; give all "
            "lengths in the same unit (m)"
        )


def check_force(key: str, value: float | None, full: float) -> None:
    """Refuse a force or pressure that no contact has; `full` is the nominal area times E', or E' [the same unit]."""
    if value is not None and not LEAST_FORCE * full <= value <= full:
        of = "E/(1 - nu^2)" if key == "pressure_max" else "L^2 E/(1 - nu^2)"
        raise InputError(
            f"loading.{key} = {value:g} is {value / full:.2g} of {of}, legal are {LEAST_FORCE:g} to 1; check the units"
        )
