"""Units of length and force in files, and numbers with SI prefixes and the digits that their error bar allows."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from decimal import Decimal

_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T", 15: "P"}
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "nm": 1e-9, "pm": 1e-12}  # in m
FORCES = {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "uN": 1e-6, "µN": 1e-6, "μN": 1e-6, "nN": 1e-9, "pN": 1e-12}
_MOST_DIGITS = 9  # of a number with an error bar
_LEAST_BAR = 1e-6  # over its value


def prefix(value: float, unit: str) -> tuple[float, str]:
    """Factor and unit that show a value as a number from 1 to 1000; lengths below a nanometre stay in nanometres.

    Args:
        value: a representative size, in `unit`
        unit: "m", "N", "Pa" ...; "" if the system of units is unknown

    Examples:
        >>> prefix(4.5e-8, "m"), prefix(4.5e-12, "m")
        ((1000000000.0, 'nm'), (1000000000.0, 'nm'))
    """
    if not unit or not math.isfinite(value) or value == 0:
        return 1.0, unit
    exponent = 3 * math.floor(math.log10(abs(value) * (1 + 1e-12)) / 3)
    exponent = min(max(exponent, -9 if unit == "m" else -15), 15)
    return 10.0**-exponent, _PREFIXES[exponent] + unit


def quantity(value: float, unit: str, digits: int = 4, *, bar: float = math.nan) -> str:
    """Value with its unit, see `prefix`, and with its error bar where that is known.

    A bar has two digits, and is left out below a millionth. The last digit of the value is worth between a hundredth
    and a tenth of its bar.

    Args:
        digits: significant ones of a value without an error bar
        bar: error bar over the value; NaN if unknown

    Examples:
        >>> quantity(4.455e-8, "m"), quantity(3.6062e10, "N/m", bar=0.0012), quantity(1.0, "N", bar=0.013)
        ('44.55 nm', '36.06 GN/m ± 0.12 %', '1.00 N ± 1.3 %')
        >>> quantity(123.4, "N", bar=0.1), quantity(0.0045, "", bar=1.5)
        ('120 N ± 10 %', '0.004 (0 to 0.01)')
    """
    factor, name = prefix(value, unit)
    known = math.isfinite(bar) and (bar == 0.0 or bar >= _LEAST_BAR)
    if known and bar > 0.0:
        digits = min(max(1 - math.floor(math.log10(bar)), 1), _MOST_DIGITS)
    value = float(f"{value * factor:.{digits}g}")
    shown = f"{value:.{max(digits, 4)}g}"  # four digits show 1 to 1000 without an exponent
    if known and bar > 0.0 and "e" not in shown:
        shown = f"{Decimal(f'{value:.{digits - 1}e}'):f}"  # with its zeros: 1.00 ± 1.3 %
    text = f"{shown} {name}".rstrip()
    if known and bar >= 1.0:  # a positive quantity of which no more is known
        return f"{text} (0 to {quantity((1.0 + bar) * (value / factor), unit, 2)})"
    return f"{text} ± {per_cent(bar)}" if known else text


def amount(text: str, units: Iterable[str]) -> tuple[float, str]:
    """Number of a text, and which of the units it has; a prefix of the unit is taken into the number.

    Raises:
        ValueError: it is no number with one of these units

    Examples:
        >>> amount("5 kHz", ("N", "Hz")), amount("2e-8m", ("m",)), amount("3 mm/s^2", ("m", "m/s^2"))
        ((5000.0, 'Hz'), (2e-08, 'm'), (0.003, 'm/s^2'))
    """
    factors = {"u": 1e-6, "μ": 1e-6} | {name: 10.0**power for power, name in _PREFIXES.items()}
    pattern = f"([-+.0-9eE]+) ?({'|'.join(factors)})({'|'.join(map(re.escape, units))})"
    found = re.fullmatch(pattern, text.strip())
    if found is None:
        raise ValueError(f"{text[:60]!r} is no number with the unit {' or '.join(units)}")
    return float(found[1]) * factors[found[2]], found[3]


def metres(text: str) -> tuple[float, bool]:
    """Length of a text as "31.25um" [m], and whether the text names its unit; a number alone is in metres.

    Raises:
        ValueError: it is no length

    Examples:
        >>> metres("31.25um"), metres("2.5e-7 m"), metres("1e-6")
        ((3.125e-05, True), (2.5e-07, True), (1e-06, False))
    """
    found = re.fullmatch(rf"(.*?) ?({'|'.join(sorted(LENGTHS, key=len, reverse=True))})?", text.strip())
    assert found is not None
    number, unit = found.groups()
    return float(number) * LENGTHS.get(unit, 1.0), unit is not None


def plus_minus(value: float, half: float) -> str:
    """Number with the half width of its interval, of two digits, both to the same decimal.

    A width below a millionth of the value, or an unknown one (NaN), is left out.

    Examples:
        >>> plus_minus(2.2203, 0.1234), plus_minus(1234.0, 120.0), plus_minus(0.5, float("nan"))
        ('2.22 ± 0.12', '1230 ± 120', '0.5')
    """
    if not _LEAST_BAR * abs(value) < half < math.inf:
        return f"{value:.4g}"
    half = float(f"{half:.2g}")
    decimals = 1 - math.floor(math.log10(half))
    value, shown = round(value, decimals), max(decimals, 0)
    return f"{value:.{shown}f} ± {half:.{shown}f}"


def points(share: float, half: float) -> str:
    """Share in per cent with the half width of its interval in percentage points, as `plus_minus`.

    Examples:
        >>> points(0.0516, 0.0015), points(0.5, float("nan"))
        ('5.16 % ± 0.15 percentage points', '50 %')
    """
    value, _, bar = plus_minus(100.0 * share, 100.0 * half).partition(" ± ")
    return f"{value} % ± {bar} percentage points" if bar else f"{value} %"


def per_cent(share: float) -> str:
    """Share in per cent to two digits, without an exponent.

    Examples:
        >>> per_cent(0.0123), per_cent(1e-6), per_cent(1.234)
        ('1.2 %', '0.0001 %', '120 %')
    """
    return f"{Decimal(f'{100.0 * share:.2g}'):f} %"
