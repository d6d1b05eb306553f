"""Columns of a curve and its file."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from conftest import make_curve
from hypothesis import example, given, settings
from hypothesis import strategies as st

from asperity.curve import BRANCHES, COLUMNS, Curve
from asperity.curve.slope import planned_rows
from asperity.errors import InputError
from asperity.model.load_path import MIDPOINT, Schedule
from asperity.output.comparison import compare_curves


@pytest.mark.parametrize("header", [{}, {"case": "sphere", "tolerances": {"force": 0.01}}])
def test_csv_is_lossless(tmp_path, header):
    curve = make_curve(**header)
    path = tmp_path / "curve.csv"
    curve.write(path)
    copy = Curve.read(path)
    assert copy.header == header
    for name in COLUMNS:
        a, b = getattr(curve, name), getattr(copy, name)
        assert a.dtype.kind == b.dtype.kind
        np.testing.assert_array_equal(a, b)
    assert path.read_text().startswith("#") == bool(header)
    assert "nan" not in path.read_text() and ",," in path.read_text()
    assert list(tmp_path.iterdir()) == [path]


def test_branches_and_rows():
    curve = make_curve()
    assert len(curve) == 4
    assert len(curve.loading()) == 2 and [leg.step.tolist() for leg in curve.legs()] == [[0, 1], [1, 2], [2, 3]]
    assert curve.where(curve.branch == "unload").step.tolist() == [2]
    row = list(curve.rows())[2]
    assert row["branch"] == "unload" and type(row["newton"]) is int and type(row["force"]) is float


def test_curves_are_immutable():
    curve = make_curve()
    with pytest.raises(AttributeError):
        curve.force = np.zeros(4)  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        curve.force[0] = 1.0


def test_a_measured_curve_needs_only_approach_and_force(tmp_path):
    path = tmp_path / "measured.csv"
    path.write_text("delta, force\n1e-9,2\n2e-9,5\n")
    curve = Curve.read(path)
    assert curve.force.tolist() == [2, 5]
    assert curve.step.tolist() == [0, 1] and set(curve.branch) == {"load"}
    assert np.isnan(curve.P_star).all() and not curve.newton.any()


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
def test_a_heading_names_columns_and_units(tmp_path, separator):
    """In any order; a column with a unit that is not read is left out."""
    path = tmp_path / "measured.txt"
    rows = ["force [mN]", "time [ms]", "stage", "delta ( um )"], ["2", "3", "7", "1"], ["5", "4", "7", "2"]
    path.write_text("from an instrument\n" + "\n".join(map(separator.join, rows)))
    curve = Curve.read(path)
    np.testing.assert_allclose([curve.delta, curve.force], [[1e-6, 2e-6], [2e-3, 5e-3]], rtol=1e-15)
    assert np.isnan(curve.time).all() and curve.header == {}
    path.write_text("delta,force,\n1,2,\n2,5,\n")
    assert Curve.read(path).force.tolist() == [2.0, 5.0]
    for heading in ("delta [um],force", "delta [um],force [um]", "delta,force,Delta"):
        path.write_text(f"{heading}\n1,2,3\n2,5,3\n")
        with pytest.raises(InputError, match=r"as (delta|force) \[UNIT\]|occurs twice: delta"):
            Curve.read(path)


def test_an_unknown_value_is_an_empty_cell_or_nan(tmp_path):
    """NaN occurs in curves stored by earlier versions."""
    path = tmp_path / "curve.csv"
    path.write_text("delta,force,area_fraction,newton,error_P_star\n1,2,,,\n2,5,nan,3, nan\n")
    curve = Curve.read(path)
    assert np.isnan(curve.area_fraction).all() and np.isnan(curve.error_P_star).all()
    assert curve.newton.tolist() == [0, 3]
    curve.write(tmp_path / "again.csv")
    assert "nan" not in (tmp_path / "again.csv").read_text()
    assert compare_curves(Curve.read(tmp_path / "again.csv"), curve) == []


PIECES = ("delta", "force", "P_star", "newton", "branch", "# {}", "# [1]", "1", "2.5", "nan", "", "up", "load", "é")


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.lists(st.lists(st.sampled_from(PIECES), min_size=1, max_size=4).map(",".join), max_size=5).map("\n".join))
@example("delta,force,delta\n1,2,3\n")
@example("# {}\ndelta,force,newton\n1,2,1.5\n")
@example("# " + "[" * 100_000 + "\ndelta,force\n")
@example(f"delta,force,step\n1,2,{10**30}\n")
@example(f"delta,force\n1,{'2' * 200_000}\n")
def test_any_text_is_a_sound_curve_or_refused_by_the_name_of_its_file(text: str) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "curve.csv"
        path.write_text(text)
        try:
            curve = Curve.read(path)
        except InputError as error:
            assert str(error).startswith(f"{path} cannot be read as a curve: ")
            return
        assert np.isfinite(curve.delta).all() and np.isfinite(curve.force).all() and set(curve.branch) <= set(BRANCHES)
        curve.write(path)
        again = Curve.read(path)
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(again, name), getattr(curve, name))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("delta,forces\n1,2\n", "must name columns delta and force, and has 'delta, forces'"),
        ("# {'a'}\ndelta,force\n1,2\n", "the first line is not JSON"),
        ("delta,force\n1,2\n3,four\n", "row 3 has 'four' .*: give a number"),
        ("delta,force,newton\n1,2,1.5\n", "'newton' counts"),
        ("delta,force,step\n1,2\n", "its rows have 2 values for 3 columns"),
        ("delta,force\n1,\n", "'force' is not finite in step 1"),
    ],
)
def test_the_message_names_the_column_or_the_line(tmp_path, text, message):
    path = tmp_path / "curve.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        Curve.read(path)


def test_missing_and_binary_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read as a curve"):
        Curve.read(tmp_path / "none.csv")
    (tmp_path / "curve.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read as a curve"):
        Curve.read(tmp_path / "curve.csv")
    (tmp_path / "curve.csv").write_bytes(b"\xef\xbb\xbfdelta,force\n1,2\n")  # a spreadsheet begins so
    assert Curve.read(tmp_path / "curve.csv").force.tolist() == [2.0]


def test_planned_points_are_those_of_equal_steps():
    planned, pieces = [1.0, 2.0, 3.0, 4.0], [0.25, 0.5, 0.75, 1.5, 2.25]
    rows = [{"delta": d * 0.1 / 4, "force": d} for d in sorted(planned + pieces)]
    curve = Curve.from_rows(rows)
    assert curve.where(planned_rows(curve.delta)).force.tolist() == planned
    assert len(planned_rows(np.array([0.1, 0.25, 0.33]))) == 3
    assert len(planned_rows(np.empty(0))) == 0


def test_a_dimensionless_fit_needs_dimensionless_columns():
    measured = Curve.from_rows([{"delta": d, "force": d**2} for d in (1.0, 2.0, 3.0, 4.0)])
    with pytest.raises(InputError, match="no delta_star and P_star"):
        measured.fit()


@pytest.mark.parametrize("first", [1e-320, 1e-13, 1e-3])
def test_planned_points_of_a_curve_with_a_tiny_first_approach(first: float):
    """There cannot be more increments than rows."""
    assert planned_rows(np.array([first, 1.0, 2.0, 3.0])).tolist() == [1, 2, 3]


@pytest.mark.parametrize("substeps", [1, 2, 4])
@pytest.mark.parametrize("steps", [3, 4, 5, 6, 10, 50])
def test_planned_points_of_the_midpoint_rule(steps: int, substeps: int):
    """Its first steps are divided; this adds no planned points."""
    stops = Schedule(delta_max=1.0, steps=steps, integrator=MIDPOINT, substeps=substeps).stops()
    planned = np.array(stops)[planned_rows(0.03e-6 * np.array(stops))]
    np.testing.assert_allclose(planned, np.arange(1, steps * substeps + 1) / (steps * substeps), rtol=1e-12)


def test_the_message_of_an_unresolved_contact_is_true_for_a_large_one():
    """A few facets are none where they are most of the patch, and a share of it has no error above 1."""
    small, large = (
        Curve.from_rows([{"delta": 1.0, "force": 1.0, "area_fraction": a, "error_area_fraction": e}]).unresolved()
        for a, e in ((0.02, 0.03), (0.85, 1.8))
    )
    assert "touches a few facets only: area_fraction = 0.02 with an error of 0.03" in small
    assert "a few facets" not in large and "area_fraction = 0.85 with an error of 0.85" in large


def test_bars_of_a_row():
    curve = Curve.from_rows([{"delta": 1.0, "force": 0.0, "P_star": p, "error_P_star": 0.1} for p in (0.0, 2.0)])
    assert np.isnan(curve.bar("P_star", 0)) and curve.bar("P_star", 1) == 0.05 and np.isnan(curve.bar("k_n", 1))
