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
        ("no heights in it", "no row of at least 2 numbers separated by commas, semicolons, tabs or white space"),
        (text([p[:2] for p in POINTS], ","), "120 lines of two numbers are a profile, not a map"),
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


PLAIN = text(Z, ",")
FRAME = "," + ",".join(map(str, range(NX))) + "\n" + "\n".join(f"{j}," + text(Z[j : j + 1], ",") for j in range(NY))
X = [f"{STEP * i:g}" for i in range(NX)]
Y = [f"{STEP * j:g}" for j in range(NY)]


def with_coordinates(corner: str, separator: str = ",") -> str:
    rows = [f"{y}{separator}" + text(Z[j : j + 1], separator) for j, y in enumerate(Y)]
    return separator.join([corner, *X]) + "\n" + "\n".join(rows)


@pytest.mark.parametrize(
    ("content", "note"),
    [
        (FRAME, "the first column is an index, not heights"),
        (",".join(map(str, range(NX))) + "\n" + PLAIN, "the first row is an index, not heights"),
        ("\n".join(f"{j + 1}," + text(Z[j : j + 1], ",") for j in range(NY)), "the first column is an index"),
        (with_coordinates(""), "the first column is coordinates, not heights"),
        (with_coordinates("y/x", ";"), "the first row is coordinates, not heights"),
        (with_coordinates(f"{NX}", " "), "the first row is coordinates, not heights"),
    ],
)
def test_an_index_and_coordinates_are_no_heights(tmp_path: Path, content: str, note: str) -> None:
    (tmp_path / "a.csv").write_text(content)
    for pixel, unit in ((STEP * 1e-6, "um"), (STEP, None)):  # an index gives no distance
        read = HeightField.read(tmp_path / "a.csv", pixel=pixel, unit=unit)
        np.testing.assert_allclose(read.z, Z if unit is None else 1e-6 * Z)
        assert any(note in one for one in read.notes)
    if "coordinates" in note:
        read = HeightField.read(tmp_path / "a.csv", unit="um")
        assert (read.dx, read.dy) == pytest.approx((STEP * 1e-6, STEP * 1e-6))


def test_a_plane_has_no_coordinates(tmp_path: Path) -> None:
    plane = np.add.outer(np.arange(10.0), 0.5 * np.arange(12.0))
    np.savetxt(tmp_path / "a.txt", plane)
    np.testing.assert_allclose(HeightField.read(tmp_path / "a.txt", pixel=1.0).z, plane)
    plane[0, 0] = 77.0
    np.savetxt(tmp_path / "a.txt", plane)
    with pytest.raises(InputError, match="may be coordinates or heights"):
        HeightField.read(tmp_path / "a.txt", pixel=1.0)


@pytest.mark.parametrize(
    ("cells", "value"),
    [
        (["1,234", "2,5"], [1.234, 2.5]),
        (["1,234", "0,567"], [1.234, 0.567]),
        (["1,234.5", "2,000"], [1234.5, 2000.0]),
        (["1.234,5", "2.000"], [1234.5, 2000.0]),
        (["1,234,567", "1,234"], [1234567.0, 1234.0]),
        (["1,234E-06", "2,345E-06"], [1.234e-6, 2.345e-6]),
        (["1,234", "0.5"], [1234.0, 0.5]),
    ],
)
def test_a_comma_is_read_in_the_only_way_that_all_numbers_allow(
    tmp_path: Path, cells: list[str], value: list[float]
) -> None:
    for separator, quote in ((";", ""), ("\t", ""), (",", '"')):
        row = separator.join(f"{quote}{cells[i % 2]}{quote}" for i in range(8))
        (tmp_path / "a.csv").write_text("\n".join([row] * 8))
        assert HeightField.read(tmp_path / "a.csv", pixel=1.0).z[0, :2].tolist() == value


def test_a_comma_that_may_separate_thousands_is_a_question(tmp_path: Path) -> None:
    for row in (";".join(["1,234", "12,345"] * 4), ";".join(["1,234", "7"] * 4)):
        (tmp_path / "a.csv").write_text("\n".join([row] * 8))
        with pytest.raises(InputError, match=r"'1,234' separates decimals or thousands.*--decimal comma"):
            HeightField.read(tmp_path / "a.csv", pixel=1.0)
        assert HeightField.read(tmp_path / "a.csv", pixel=1.0, decimal="comma").z[0, 0] == 1.234
        assert HeightField.read(tmp_path / "a.csv", pixel=1.0, decimal="point").z[0, 0] == 1234.0
    (tmp_path / "a.csv").write_text("\n".join(["1,5;2.5;" + ";".join("7" * 6)] * 8))
    with pytest.raises(InputError, match=r"'2\.5' has a decimal point, '1,5' a decimal comma"):
        HeightField.read(tmp_path / "a.csv", pixel=1.0)


@pytest.mark.parametrize(
    ("header", "step", "metres"),
    [
        (f"h={NY} w={NX}\npixel size=4.0e-007 m\ndata unit=rad\nheight conversion factor (-> m)=6.0e-008", 4e-7, 6e-8),
        ("Breite: 6,0 µm\nHöhe: 5,0 µm\nEinheit der Werte: nm", 5e-7, 1e-9),
        ("Breite = 6.0 um; Hoehe = 5.0 um\nEinheit = um", 5e-7, 1e-6),
        (f"Spalten: {NX}\nZeilen: {NY}\nPunktabstand [µm]: 0,5\nHöhe [nm]", 5e-7, 1e-9),
        ("# Pixel size: 0.5 x 0.5 µm\n# Z unit: nm", 5e-7, 1e-9),
        ("dx_um = 0.5, dy_um = 0.5\nz factor: 2 nm\nDate: 2024-01-02 10:30", 5e-7, 2e-9),
        (f"nx {NX}\nny {NY}\ndx 0.5 um\ndy 0.5 um\nHeight (nm)", 5e-7, 1e-9),
        ("File: C:\\scans\\a12.txt\nWidth: 6.0 um\nHeight: 5.0 um\nValue units: nm", 5e-7, 1e-9),
    ],
)
def test_headers_in_words_are_understood(tmp_path: Path, header: str, step: float, metres: float) -> None:
    (tmp_path / "a.txt").write_text(f"{header}\n{text(Z, ' ')}", encoding="utf-8")
    read = HeightField.read(tmp_path / "a.txt")
    assert (read.dx, read.dy) == pytest.approx((step, step))
    np.testing.assert_allclose(read.z, metres * Z)


@pytest.mark.parametrize(
    "header",
    [
        "pixel size=4.0e-007 m\ndata unit=rad",
        "pixel size = 0.5 um\nZ scale: 0.25",
        "pixel size = 0.5 um\nsensitivity 25 nm/V",
        "Width: 6.0 um\nDepth range: 3 um",
        f"{NX} {NY} 0.5",
        f"w={NX + 1} h={NY}",
        "pixel size = 0.5 um\npixel size = 0.7 um",
        "pixel size = 0.5 um\nunit = nm\nheight factor (-> m) = 6e-8",
        "Width: 6.0 um",
    ],
)
def test_a_header_that_is_not_understood_is_a_question(tmp_path: Path, header: str) -> None:
    (tmp_path / "a.txt").write_text(f"{header}\n{text(Z, ' ')}")
    with pytest.raises(InputError, match=r"--pixel|--unit"):
        HeightField.read(tmp_path / "a.txt")
    if "0.5 um" not in header and "4.0e-007" not in header:
        read = HeightField.read(tmp_path / "a.txt", pixel=5e-7, unit="6e-8")  # what the user says counts
        np.testing.assert_allclose(read.z, 6e-8 * Z)


def test_points_whose_units_are_named_in_part_are_a_question(tmp_path: Path) -> None:
    rows = text(POINTS, ",")
    for header in ("x [um],y [um],z", "# Value units: nm\nx,y,z"):
        (tmp_path / "a.csv").write_text(f"{header}\n{rows}")
        with pytest.raises(InputError, match="unit of some of x, y and z only"):
            HeightField.read(tmp_path / "a.csv")
        assert HeightField.read(tmp_path / "a.csv", unit="um").dx == pytest.approx(5e-7)
    turned = text([(z, x, y) for x, y, z in POINTS], ";")
    (tmp_path / "a.csv").write_text(f"Höhe [nm];X [um];Y [um]\n{turned}", encoding="utf-8")
    read = HeightField.read(tmp_path / "a.csv")
    np.testing.assert_allclose(read.z, 1e-9 * Z)
    (tmp_path / "a.csv").write_text(",x,y,z\n" + "\n".join(f"{i}," + text([p], ",") for i, p in enumerate(POINTS)))
    np.testing.assert_allclose(HeightField.read(tmp_path / "a.csv").z, Z)
    (tmp_path / "a.csv").write_text(f"X,Y,Z\num,um,[nm]\n{rows}")
    np.testing.assert_allclose(HeightField.read(tmp_path / "a.csv").z, 1e-9 * Z)
    (tmp_path / "a.csv").write_text(f"a,b,c\n{rows}")
    with pytest.raises(InputError, match="are not x, y and z"):
        HeightField.read(tmp_path / "a.csv")
