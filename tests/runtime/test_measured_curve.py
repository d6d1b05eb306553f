"""Curves that instruments and spreadsheets write: dialects and units that keep the law and its bar, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from asperity.curve import Curve
from asperity.vibration import Joint, law_from, run_dynamics
from asperity.errors import InputError
from asperity.vibration.source import CurveColumns

DELTA = 1e-7 * np.arange(26)
FORCE = 20.0 * (np.exp(DELTA / 0.5e-6) - 1.0)  # 100 N: k = 240 MN/m


def text(rows: object, separator: str = ",", decimal: str = ".") -> str:
    return "\n".join(separator.join(f"{v:.7g}".replace(".", decimal) for v in row) for row in rows)  # type: ignore


ROWS = list(zip(DELTA, FORCE, strict=True))
CLEAN = "delta,force\n" + text(ROWS)
HELD = [*ROWS[:13], ROWS[12], ROWS[12], *ROWS[13:]]
UNLOADING = [(d, 0.97 * f) for d, f in ROWS[-2:5:-1]]


def numbers(path: Path) -> tuple[float, float, tuple[str, ...]]:
    """Stiffness under 100 N, half of its bar, and notes."""
    found = run_dynamics(path, preload=100.0, joint=Joint(mass=5.0), model=("exact",), forcing=(0.001,))
    assert found.uncertainty is not None
    return found.uncertainty.k_n.value, found.uncertainty.k_n.half, found.notes


@pytest.mark.parametrize(
    ("content", "note"),
    [
        (CLEAN.replace("\n", "\n\n"), ""),
        (CLEAN.replace("\n", "\n,\n"), ""),
        ("delta;force\n" + text(ROWS, ";", ","), ""),
        ("Weg [µm]\tKraft [N]\n" + text(((1e6 * d, f) for d, f in ROWS), "\t", ","), "metres and newtons"),
        (CLEAN.replace(",", " , "), ""),
        ("# press 7, 2026-11-26\nz (nm); F (mN)\n" + text(((1e9 * d, 1e3 * f) for d, f in ROWS), ";"), "read as delta"),
        ("delta,force\nmm,kN\n" + text((1e3 * d, 1e-3 * f) for d, f in ROWS), "metres and newtons"),
        ("time,delta_um,force_N\n" + text((3.0, 1e6 * d, f) for d, f in ROWS), "metres and newtons"),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_measured_curve_keeps_its_law_and_its_bar(tmp_path: Path, content: str, note: str, encoding: str) -> None:
    (tmp_path / "clean.csv").write_text(CLEAN)
    (tmp_path / "a.csv").write_text(content, encoding=encoding)
    if encoding != "utf-8":  # the law is that of the same columns
        a, b = (CurveColumns.of(tmp_path / name) for name in ("a.csv", "clean.csv"))
        np.testing.assert_allclose(a.delta, b.delta, rtol=1e-6)
        np.testing.assert_allclose(a.force, b.force, rtol=1e-6)
        return
    k, half, _ = numbers(tmp_path / "clean.csv")
    again, bar, notes = numbers(tmp_path / "a.csv")
    assert (again, bar) == pytest.approx((k, half), rel=1e-5) and k == pytest.approx(240e6, rel=1e-3)
    assert not note or any(note in one for one in notes)


@pytest.mark.parametrize("separator", [" ", "   ", "\t", ";"])
def test_decimal_commas_in_two_columns(tmp_path: Path, separator: str) -> None:
    (tmp_path / "a.csv").write_text(f"Weg[um]{separator}Kraft[N]\n" + text([(1.5, 2.5), (2.5, 7.5)], separator, ","))
    found = CurveColumns.of(tmp_path / "a.csv")
    assert found.delta == pytest.approx([1.5e-6, 2.5e-6]) and found.force.tolist() == [2.5, 7.5]


def test_an_unloading_without_a_column_is_one(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("delta,force\n" + text([*ROWS, *UNLOADING]))
    columns = CurveColumns.of(tmp_path / "a.csv")
    assert columns.branch.tolist() == ["load"] * 26 + ["unload"] * len(UNLOADING)
    assert "the last 19 rows, of falling approach, are the unloading" in columns.notes
    law, _ = law_from(tmp_path / "a.csv", load=100.0)
    assert law.describe().startswith("unload-reload branch")


def test_a_curve_of_a_run_is_not_repaired(tmp_path: Path) -> None:
    curve = Curve.from_rows([{"delta": d, "force": f} for d, f in HELD])
    curve.write(tmp_path / "a.csv")
    assert len(Curve.read(tmp_path / "a.csv")) == len(HELD) == len(CurveColumns.of(tmp_path / "a.csv").delta)


def test_a_single_row_is_in_no_order(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("delta,force\n1e-9,2\n")
    assert CurveColumns.of(tmp_path / "a.csv").force.tolist() == [2.0]
    with pytest.raises(InputError, match="1 usable rows"):
        law_from(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("delta [um],force\n1,2\n2,3\n", "the unit of force is missing"),
        ("delta [um],force [lb]\n1,2\n2,3\n", "the unit 'lb' of force is unknown"),
        ("delta,force\n" + text(HELD), "row 15 repeats the approach before it: keep one row of a hold"),
        ("delta,force\n" + text(ROWS[::-1]), "falling order: reverse them"),
        ("delta,force\n0,0\n-5e-10,-0.2\n" + text(ROWS), "row 3 has delta < 0: leave out the rows out of contact"),
        ("1,2\n2,3\n3,4\n", "no column names; name the columns"),
        ("delta;other\n1;2\n2;3\n", "column 'force' is missing"),
        ("delta;force\n1;2\n2;x\n", "row 3 has 'x'"),
        ("delta;force\n1;n/a\n2;3\n", "'1, n/a' is no heading and no row of numbers: give a number"),
        ("delta;force\n1;2\n2;\n3;4\n", "row 3 has no force"),
        ("delta;force\n1;-2\n2;-3\n", "no force is positive: compression counts positive"),
        ("delta;force\n-1;2\n-2;3\n", "no delta is positive"),
        ("delta;F;force\n1;2;3\n2;3;4\n", "occurs twice"),
        ("delta;force\n1;1,234\n2;2,345\n", "separates decimals or thousands"),
        ("delta;force\n1;2,5\n2;3.5\n", "has a decimal point"),
    ],
)
def test_what_is_not_understood_is_refused(tmp_path: Path, content: str, words: str) -> None:
    (tmp_path / "a.csv").write_text(content)
    with pytest.raises(InputError) as caught:
        CurveColumns.of(tmp_path / "a.csv")
    assert words in str(caught.value)
