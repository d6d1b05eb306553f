"""Numbers with SI prefixes, for tables and the axes of figures."""

from __future__ import annotations

import math

_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}


def prefix(value: float, unit: str) -> tuple[float, str]:
    """Factor and unit that show a value as a number from 1 to 1000.

    Args:
        value: a representative size, in `unit`.
        unit: "m", "N", "Pa" ...; "" when the system of units is not known.

    Returns:
        factor to multiply values with, and the name of the unit they then have.
    """
    if not unit or not math.isfinite(value) or value == 0:
        return 1.0, unit
    exponent = 3 * math.floor(math.log10(abs(value) * (1 + 1e-12)) / 3)
    exponent = min(max(exponent, -15), 12)
    return 10.0**-exponent, _PREFIXES[exponent] + unit


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """A value with its unit, for example "44.55 nm"."""
    factor, name = prefix(value, unit)
    return f"{value * factor:.{digits}g} {name}".rstrip()
