"""Text files of height maps: matrices, points and grids, as programs of instruments and spreadsheets write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from asperity.errors import InputError
from asperity.surface.measured import HeightField

NY, NX, STEP = 10, 12, 0.5
Z = np.round(np.random.default_rng(3).normal(size=(NY, NX)), 4)
POINTS = [(STEP * i, STEP * j, Z[j, i]) for j in range(NY) for i in range(NX)]


def text(rows: object, separator: str, decimal: str = ".") -> str:
    return "\n".join(separator.join(f"{v:.4f}".replace(".", decimal) for v in row) for row in rows)  # type: ignore


MATRIX = text(Z, ",")
ESRI = f"ncols {NX}\nnrows {NY}\nxllcorner 0.0\nyllcorner 0.0\ncellsize {STEP}\nNODATA_value 7777\n"
GWYDDION = f"# Channel: Height\n# Width: {NX * STEP} µm\n# Height: {NY * STEP} µm\n# Value units: um\n"
FIRST = f"{Z[0, 0]:.4f}"


@pytest.mark.parametrize(
    ("name", "content", "pixel", "missing"),
    [
        ("a.csv", MATRIX, True, 0),
        ("a.csv", text(Z, ";"), True, 0),
        ("a.csv", text(Z, ";", ","), True, 0),
        ("a.txt", text(Z, "\t", ","), True, 0),
        ("a.txt", text(Z, "  ", ","), True, 0),
        ("a.csv", text(Z, ",").replace("\n", ",\n") + ",\n\n", True, 0),
        ("a.dat", text(Z, " ").replace("\n", "\r\n"), True, 0),
        ("a.csv", MATRIX.replace(FIRST, "", 1), True, 1),
        ("a.csv", MATRIX.replace(FIRST, "-32768", 1), True, 1),
        ("a.csv", MATRIX.replace(FIRST, "n/a", 1), True, 1),
        ("a.csv", "x,y,z\n" + text(POINTS, ","), False, 0),
        ("a.csv", "X;Y;Z\n" + text(POINTS[::-1], ";", ","), False, 0),
        ("a.csv", "x [µm];y [µm];z [µm]\n" + text(POINTS, ";"), False, 0),
        ("a.xyz", text(POINTS, " "), False, 0),
        ("a.xyz", "# x y z\n" + text(POINTS[1:], "\t"), False, 1),
        ("a.asc", ESRI + text(Z, " ").replace(FIRST, "7777", 1), False, 1),
        ("a.txt", GWYDDION + text(Z, "\t"), False, 0),
    ],
)
def test_text_of_many_kinds_is_read(tmp_path: Path, name: str, content: str, pixel: bool, missing: int) -> None:
    for encoding in ("utf-8", "utf-16", "latin-1"):
        (tmp_path / name).write_bytes(content.encode(encoding))
        read = HeightField.read(tmp_path / name, pixel=STEP * 1e-6 if pixel else None, unit="um")
        assert (read.dx, read.dy) == pytest.approx((STEP * 1e-6, STEP * 1e-6))
        gaps = np.isnan(read.z)
        assert gaps.sum() == missing and (not missing or gaps[0, 0])
        np.testing.assert_allclose(read.z[~gaps], 1e-6 * Z[~gaps], rtol=1e-12)


def test_lengths_without_a_unit_are_metres_and_others_are_not(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x (um),y (um),z (nm)\n" + text(POINTS, ","))
    for unit in (None, "mm"):  # the file has its own
        read = HeightField.read(tmp_path / "a.csv", unit=unit)
        assert read.dx == pytest.approx(STEP * 1e-6) and read.z[2, 3] == pytest.approx(1e-9 * Z[2, 3])
    (tmp_path / "a.xyz").write_text(text(POINTS, " "))
    assert HeightField.read(tmp_path / "a.xyz").size == pytest.approx(((NX - 1) * STEP, (NY - 1) * STEP))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (MATRIX.replace("\n", ",1.0\n", 1), "row 1 has 13 cells separated by commas, others have 12"),
        (text(Z, ";").replace(";", ";oops;", 1), "row 1 has 13 cells separated by semicolons"),
        (
            text(Z, ";").replace(FIRST, "oops", 1),
            "row 1 has 'oops' among its cells separated by semicolons: give a num",
        ),
        (text(Z[:4], ","), "4 rows of 12 cells separated by commas, from row 1 on, are no map"),
        ("x,y,z\n" + text([(x**2, y, z) for x, y, z in POINTS], ","), "x of points x, y, z is no regular grid"),
        ("x,y,z\n" + text(POINTS + POINTS[:1], ","), "several points x, y, z have the same place"),
        ("x,y,z\n" + text(POINTS[:NX], ","), "have the same y: give a map, not a profile"),
        ("no heights in it", "no row of at least 3 numbers separated by commas, semicolons, tabs or white space"),
        (text([p[:2] for p in POINTS], ","), "write the heights as a matrix, or as lines of x, y, z"),
    ],
)
def test_what_is_no_map_is_one_sentence_that_says_where(tmp_path: Path, content: str, words: str) -> None:
    (tmp_path / "a.csv").write_text(content)
    with pytest.raises(InputError) as caught:
        HeightField.read(tmp_path / "a.csv", pixel=1e-6)
    assert words in str(caught.value)


def test_marks_of_missing_heights_are_none_inside_the_range_of_the_others(tmp_path: Path) -> None:
    z = np.linspace(-40000.0, 40000.0, 120).reshape(10, 12)
    z[3, 4] = -32768.0
    np.save(tmp_path / "a.npy", z)
    assert HeightField.read(tmp_path / "a.npy", pixel=1e6).missing == 0.0
    np.save(tmp_path / "a.npy", np.where(z == -32768.0, z, 0.5 * z).astype(np.int16))
    assert HeightField.read(tmp_path / "a.npy", pixel=1e3).missing == pytest.approx(1 / 120)
