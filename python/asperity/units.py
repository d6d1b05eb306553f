# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Units of length in files, and numbers with SI prefixes, for tables and the axes of figures."""

from __future__ import annotations

import math

_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T", 15: "P"}
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "nm": 1e-9, "pm": 1e-12}  # in m


def prefix(value: float, unit: str) -> tuple[float, str]:
    """Return factor and unit that show a value as a number from 1 to 1000.

    Args:
        value: a representative size, in `unit`.
        unit: "m", "N", "Pa" ...; "" if the system of units is unknown.

    Returns:
        Factor for the values, and the name of their unit.

    Examples:
        >>> prefix(4.5e-8, "m")
        (1000000000.0, 'nm')
    """
    if not unit or not math.isfinite(value) or value == 0:
        return 1.0, unit
    exponent = 3 * math.floor(math.log10(abs(value) * (1 + 1e-12)) / 3)
    exponent = min(max(exponent, -15), 15)
    return 10.0**-exponent, _PREFIXES[exponent] + unit


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Return a value with its unit.

    Examples:
        >>> quantity(4.455e-8, "m")
        '44.55 nm'
    """
    factor, name = prefix(value, unit)
    return f"{value * factor:.{digits}g} {name}".rstrip()
