"""Legal values of single arguments, and of forces on a patch."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from asperity.errors import InputError

LEAST_FORCE = 1e-12  # over the nominal area and E'


def check_force(key: str, value: float | None, full: float) -> None:
    """Refuse a force or pressure that no contact has; `full` is the nominal area times E', or E' [the same unit]."""
    if value is not None and not LEAST_FORCE * full <= value <= full:
        of = "E/(1 - nu^2)" if key == "pressure_max" else "L^2 E/(1 - nu^2)"
        raise InputError(
            f"loading.{key} = {value:g} is {value / full:.2g} of {of}, legal are {LEAST_FORCE:g} to 1; check the units"
        )


def positive(name: str, value: float, *, zero: bool = False) -> float:
    """`value` as a float; raise `InputError` unless it is finite and positive (or zero)."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {value!r} is not legal: it must be a number") from None
    if not np.isfinite(number) or number < 0 or (number == 0 and not zero):
        legal = "at least 0" if zero else "greater than 0"
        raise InputError(f"{name} = {value} is not legal: it must be finite and {legal}")
    return number


def within(name: str, value: float, legal: tuple[float, float]) -> float:
    """`value` as a float; raise `InputError` unless it is in the legal range."""
    number, (low, high) = positive(name, value), legal
    if not low <= number <= high:
        raise InputError(f"{name} = {number:g} is not legal: it must lie between {low:g} and {high:g}")
    return number


def one_of(name: str, value: Any, legal: Iterable[str]) -> None:
    """Raise `InputError` unless `value` is one of the legal names."""
    if value not in legal:
        raise InputError(f'{name} = "{value}" is unknown: choose one of {", ".join(legal)}')


def positives(name: str, values: Any) -> tuple[float, ...]:
    """One number or several as a tuple; raise `InputError` if there is none or one is not positive."""
    several = isinstance(values, Iterable) and not isinstance(values, str) and getattr(values, "ndim", 1) > 0
    numbers = tuple(positive(name, value) for value in (values if several else (values,)))
    if not numbers:
        raise InputError(f"{name} is empty: give at least one value greater than 0")
    return numbers
