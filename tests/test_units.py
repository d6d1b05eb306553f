"""Units against the SI brochure: prefixes, lengths, and the numbers shown with them."""

from __future__ import annotations

from decimal import Decimal

import pytest

from asperity.units import FORCES, LENGTHS, amount, per_cent, plus_minus, prefix, quantity

SI = {"": 0, "c": -2, "m": -3, "u": -6, "µ": -6, "μ": -6, "n": -9, "p": -12, "f": -15}
SI |= {"k": 3, "M": 6, "G": 9, "T": 12, "P": 15}


@pytest.mark.parametrize(("table", "unit"), [(LENGTHS, "m"), (FORCES, "N")])
def test_each_unit_of_a_file_is_its_power_of_ten(table: dict[str, float], unit: str) -> None:
    assert len(table) > 4
    for name, factor in table.items():
        assert name.endswith(unit) and Decimal(str(factor)) == Decimal(10) ** SI[name.removesuffix(unit)], name
        assert name == "cm" or amount(f"3 {name}", (unit,)) == (pytest.approx(3.0 * factor), unit)


@pytest.mark.parametrize("power", range(-20, 20))
@pytest.mark.parametrize("unit", ["N", "Pa", "Hz", "m"])
def test_a_quantity_is_the_number_that_it_shows(power: int, unit: str) -> None:
    for mantissa in (1.0, 1.2345, 9.9996, 9.8765):
        value = mantissa * 10.0**power
        number, shown = quantity(value, unit).split(" ")
        assert float(number) * 10.0 ** SI[shown.removesuffix(unit)] == pytest.approx(value, rel=1e-3)
        factor, name = prefix(value, unit)
        assert factor == pytest.approx(10.0 ** -SI[name.removesuffix(unit)])
        assert 0.999 < abs(value * factor) < 1000.0 or abs(power) > 14 or (unit == "m" and power < -9)


@pytest.mark.parametrize("share", [0.0123, 0.2, 3.4e-4, 0.7, 2.5e-3])
def test_a_bar_is_the_share_that_it_shows(share: float) -> None:
    """To the two digits of a bar; and of a value within half of it."""
    for value in (1.2345, 98.765, 0.031415):
        number, _, rest = quantity(value, "N", bar=share).partition(" ")
        unit, percent = rest.split(" ± ")
        assert float(percent.removesuffix(" %")) == pytest.approx(100 * share, rel=0.05)
        shown = float(number) * 10.0 ** SI[unit.removesuffix("N")]
        assert abs(shown - value) <= 0.5 * share * value
        low, _, half = plus_minus(value, share * value).partition(" ± ")
        assert float(low) == pytest.approx(value, abs=0.5 * share * value)
        assert float(half) == pytest.approx(share * value, rel=0.06)
    assert float(per_cent(share).removesuffix("%")) == pytest.approx(100 * share, rel=0.05)
