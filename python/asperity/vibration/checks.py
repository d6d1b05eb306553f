"""What arguments of the vibration must be: names of laws, and numbers within their legal range."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from asperity.errors import InputError

#: Laws of a curve by name, those of a contact that has yielded first.
NAMES = ("unload-reload", "elastic", "table", "paper")
LAWS = ("auto", *NAMES)
#: Rows in contact that show the curvature of an unloading, without and with the stiffness of each.
MIN_ROWS = (5, 3)


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
