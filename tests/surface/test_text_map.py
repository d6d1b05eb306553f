"""Text files of height maps: those that have one meaning are read, all others are refused with what to give."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from asperity.errors import InputError
from asperity.surface import HeightMap
from asperity.surface.scans import HeightField

NY, NX, STEP = 10, 12, 0.5
Z = np.round(np.random.default_rng(3).normal(size=(NY, NX)), 4)
POINTS = [(STEP * i, STEP * j, Z[j, i]) for j in range(NY) for i in range(NX)]
FIRST = f"{Z[0, 0]:.4f}"


def text(rows: object, separator: str = ",", decimal: str = ".") -> str:
    return "\n".join(separator.join(f"{v:.4f}".replace(".", decimal) for v in row) for row in rows)  # type: ignore


MATRIX = text(Z)
INDEXED = "\n".join(f"{j}," + text([row]) for j, row in enumerate(Z))
X, Y = (STEP * np.arange(n) for n in (NX, NY))


def with_coordinates(corner: str, x: np.ndarray = X, y: np.ndarray = Y) -> str:
    rows = (f"{place:g}," + text([row]) for place, row in zip(y, Z, strict=True))
    return "\n".join([",".join([corner, *(f"{place:g}" for place in x)]), *rows])


@pytest.mark.parametrize(
    ("content", "pixel", "missing"),
    [
        (MATRIX, True, 0),
        (text(Z, ";"), True, 0),
        (text(Z, ";", ","), True, 0),
        (text(Z, "\t", ","), True, 0),
        (text(Z, "  ", ","), True, 0),
        ("\n".join(",".join(f'"{v:.4f}"'.replace(".", ",") for v in row) for row in Z), True, 0),
        (MATRIX.replace("\n", ",\n") + ",\n\n", True, 0),
        (text(Z, " ").replace("\n", "\r\n"), True, 0),
        (MATRIX.replace(FIRST, "", 1), True, 1),
        (MATRIX.replace(FIRST, "NaN", 1), True, 1),
        (f"# Channel: Height\nPixel size: 0.5 µm\n{MATRIX}", True, 0),
        (text(POINTS, " "), False, 0),
        ("X;Y;Z\n" + text(POINTS[::-1], ";", ","), False, 0),
        ("# x y z\n" + text(POINTS[1:], "\t"), False, 1),
        ("x [µm];y [µm];z [µm]\n" + text(POINTS, ";"), False, 0),
        ('made today\n"x (um)", "y (um)", "z (um)"\n' + text(POINTS), False, 0),
    ],
    ids=range(16),
)
def test_text_is_read_with_the_unit_that_is_given(tmp_path: Path, content: str, pixel: bool, missing: int) -> None:
    for encoding in ("utf-8", "utf-8-sig", "utf-16", "latin-1"):
        (tmp_path / "a.txt").write_bytes(content.encode(encoding))
        read = HeightField.read(tmp_path / "a.txt", pixel=STEP * 1e-6 if pixel else None, unit="um")
        assert (read.dx, read.dy) == pytest.approx((STEP * 1e-6, STEP * 1e-6))
        gaps = np.isnan(read.z)
        assert gaps.sum() == missing and (not missing or gaps[0, 0])
        np.testing.assert_allclose(read.z[~gaps], 1e-6 * Z[~gaps], rtol=1e-12)


def test_lengths_without_a_unit_are_metres_and_others_are_not(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x (um),y (um),z (nm)\n" + text(POINTS))
    for unit in (None, "mm"):  # the file has its own
        read = HeightField.read(tmp_path / "a.csv", unit=unit)
        assert read.dx == pytest.approx(STEP * 1e-6) and read.z[2, 3] == pytest.approx(1e-9 * Z[2, 3])
    (tmp_path / "a.xyz").write_text(text(POINTS, " "))
    assert HeightField.read(tmp_path / "a.xyz").size == pytest.approx(((NX - 1) * STEP, (NY - 1) * STEP))


@pytest.mark.parametrize(
    "content",
    [
        MATRIX.replace("\n", ",1.0\n", 1),
        text(Z, ";").replace(";", ";oops;", 1),
        *(MATRIX.replace(FIRST, cell, 1) for cell in ("oops", "1 234.5", '"1,234.5"', "\u22121.5", "-9999")),
        text(Z[:3]),
        MATRIX + "\n\n" + MATRIX,
        ";".join(["1,234"] * 8) + "\n" + ";".join(["7"] * 8),
        "1,5;2.5;" + ";".join("7" * 6),
        "no heights in it",
        "",
        text([p[:2] for p in POINTS]),
        INDEXED,
        ",".join(map(str, range(NX))) + "\n" + MATRIX,
        with_coordinates(""),
        with_coordinates("0", X**2, Y**2),
        with_coordinates("", Z[0], Y**2),
        with_coordinates("", X**2, Z[:, 0]),
        with_coordinates("y/x"),
        "x,y,z\n" + text((x**2, y, z) for x, y, z in POINTS),
        text(POINTS + POINTS[:1]),
        text(POINTS[:NX]),
        text((x, x, z) for x, _, z in POINTS[:NX]),
        "z,x,y\n" + text(POINTS),
        "x [um],y [um],z\n" + text(POINTS),
        "x [um],y [um],z [V]\n" + text(POINTS),
        text(Z, ",", ","),
    ],
    ids=range(29),
)
def test_text_without_a_meaning_or_with_two_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "a.csv").write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=r"a\.csv: .*\(.+\)$") as caught:
        HeightField.read(tmp_path / "a.csv", pixel=1e-6)
    assert "\n" not in str(caught.value)


HEADED = [
    f"pixel size=4.0e-007 m\nheight conversion factor (-> m)=6.0e-008\n{text(Z, ' ')}",
    f"ncols {NX}\nnrows {NY}\ncellsize {STEP}\n{text(Z, ' ')}",
    f"# Value units: nm\n{MATRIX}",
    "# Value units: nm\nx,y,z\n" + text(POINTS),
    "a,b,c\n" + text(POINTS),
]


@pytest.mark.parametrize("content", HEADED, ids=range(5))
def test_a_header_is_not_read_and_not_passed_over(tmp_path: Path, content: str) -> None:
    """Its unit is that of the user, or there is none."""
    (tmp_path / "a.txt").write_text(content, encoding="utf-8")
    for read in (HeightField.read, lambda path: HeightMap(path=path, L=1.0)):
        with pytest.raises(InputError, match=r"is a header, and none is read: .*--unit"):
            read(tmp_path / "a.txt")
    pixel = None if text(POINTS) in content else 5e-7
    np.testing.assert_allclose(HeightField.read(tmp_path / "a.txt", unit="6e-8", pixel=pixel).z, 6e-8 * Z)


def test_surfacetopography_reads_headers(tmp_path: Path) -> None:
    """A conversion factor, and the distances of an ASCII export, beside what the file says."""
    pytest.importorskip("SurfaceTopography")
    (tmp_path / "a.txt").write_text(f"# Channel: Z\n# Width: 6 µm\n# Height: 5 µm\n# Value units: nm\n{text(Z, ' ')}")
    read = HeightField.read(tmp_path / "a.txt", channel="1")
    assert (read.dx, read.dy) == pytest.approx((0.5e-6, 0.5e-6))
    np.testing.assert_allclose(read.z, 1e-9 * Z, atol=1e-18)


def test_a_plane_has_no_coordinates(tmp_path: Path) -> None:
    plane = np.add.outer(np.arange(10.0), 0.5 * np.arange(12.0))
    np.savetxt(tmp_path / "a.txt", plane)
    np.testing.assert_allclose(HeightField.read(tmp_path / "a.txt", pixel=1.0).z, plane)


@pytest.mark.parametrize("corner", [0.0, 77.0, np.nan])
@pytest.mark.parametrize("profile", [0.01 * np.arange(12.0), 0.3 * np.abs(np.arange(12.0) - 5.0)], ids=["flat", "ramp"])
def test_coordinates_beside_heights_in_equal_steps_are_refused(
    tmp_path: Path, corner: float, profile: np.ndarray
) -> None:
    """A tilted flat, and a standard with ramps: with coordinates of rows, of columns and of both."""
    heights = np.add.outer(0.02 * np.arange(10.0), profile)
    rows = np.column_stack([STEP * np.arange(10.0), heights])
    columns = np.vstack([STEP * np.arange(12.0), heights])
    both = np.vstack([np.append(corner, columns[0]), rows])
    for table in (both, rows, columns, both.T, rows.T, columns.T):
        np.savetxt(tmp_path / "a.txt", table)
        with pytest.raises(InputError, match="may be coordinates"):
            HeightField.read(tmp_path / "a.txt", pixel=1.0)
    np.savetxt(tmp_path / "a.txt", heights)
    np.testing.assert_allclose(HeightField.read(tmp_path / "a.txt", pixel=1.0).z, heights)


@pytest.mark.parametrize("name", ["a.npy", "a.csv"])
def test_a_mark_of_missing_heights_is_named_or_denied(tmp_path: Path, name: str) -> None:
    z = np.where(Z == Z[3, 4], -32768.0, Z)
    np.save(tmp_path / "a.npy", z)
    np.savetxt(tmp_path / "a.csv", z, delimiter=",")
    with pytest.raises(InputError, match="import-map --missing -32768"):
        HeightField.read(tmp_path / name, pixel=1.0)
    assert HeightField.read(tmp_path / name, pixel=1.0, missing=-32768.0).missing == 1 / Z.size
    (tmp_path / "a.xyz").write_text("x (um),y (um),z (nm)\n" + text(POINTS).replace(FIRST, "-9999", 1))
    with pytest.raises(InputError, match="import-map --missing -9999"):
        HeightField.read(tmp_path / "a.xyz")
    assert HeightField.read(tmp_path / "a.xyz", missing=-9999.0).missing == 1 / Z.size
    assert HeightField.read(tmp_path / name, pixel=1.0, missing=np.nan).z[3, 4] == -32768.0
    for missing in (0.0, -9999.0):  # none is left as a height
        with pytest.raises(InputError, match="import-map --missing -32768"):
            HeightField.read(tmp_path / name, pixel=1.0, missing=missing)
