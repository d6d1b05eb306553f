"""Files of heights: what has one meaning is read as it was written, all else is refused in one sentence."""

from __future__ import annotations

import io
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from asperity.errors import CompatError, InputError
from asperity.surface import HeightMap
from asperity.surface.scans import HeightField

NY, NX, STEP = 10, 12, 0.5
Z = np.round(np.random.default_rng(3).normal(size=(NY, NX)), 4)
POINTS = [(STEP * i, STEP * j, Z[j, i]) for j in range(NY) for i in range(NX)]
FIRST = f"{Z[0, 0]:.4f}"
X, Y = (STEP * np.arange(n) for n in (NX, NY))


def text(rows: object, separator: str = ",", decimal: str = ".") -> str:
    return "\n".join(separator.join(f"{v:.4f}".replace(".", decimal) for v in row) for row in rows)  # type: ignore


def saved(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


MATRIX = text(Z)


@st.composite
def written(draw: st.DrawFn) -> tuple[str, bytes, dict[str, Any], int]:
    """Name, content and options of a file of Z in micrometres; one height may be missing."""
    kind, gap = draw(st.sampled_from(["arrays", "array", "matrix", "points"])), draw(st.integers(-1, Z.size - 1))
    z, options = Z.copy(), dict[str, Any](unit="um")
    z.ravel()[gap] = np.nan if gap >= 0 else z.ravel()[gap]
    pixel = draw(st.sampled_from([STEP * 1e-6, (STEP * 1e-6, STEP * 1e-6)]))
    if kind == "arrays":
        orders = [draw(st.permutations(range(n))) for n in Z.shape]  # as rows from the top down, of a picture
        lengths: Any = draw(st.sampled_from([{"dx": STEP}, {"dx": STEP, "dy": STEP}, {"L": [X[-1], Y[-1]]}, "axes"]))
        if lengths == "axes":
            z, lengths = z[np.ix_(*orders)], {"x": X[orders[1]], "y": Y[orders[0]]}
        return "a.npz", saved(z=z, **lengths), options, gap
    if kind == "array":
        buffer = io.BytesIO()
        np.save(buffer, z)
        return "a.npy", buffer.getvalue(), options | {"pixel": pixel}, gap

    marks: list[tuple[str, str]] = [*((s, ".") for s in ",;\t "), *((s, ",") for s in (";", "\t", "  "))]
    separator, decimal = draw(st.sampled_from(marks))
    if kind == "matrix":
        options["pixel"] = pixel
        blank = draw(st.sampled_from(["nan", "NaN", *(("",) if separator != " " and separator != "  " else ())]))
        rows = text(z, separator, decimal).replace("nan", blank)
        if separator in ",;\t" and draw(st.booleans()):
            rows = rows.replace("\n", separator + "\n") + separator
        if draw(st.booleans()):
            rows = f"# Channel: Height\nPixel size: 0.5 µm\n{rows}"
    else:
        points = [POINTS[k] for k in draw(st.permutations(range(len(POINTS)))) if k != gap]
        rows = text(points, separator, decimal)
        names = ("x [µm]", "y [µm]", "z [µm]") if draw(st.booleans()) else ("X", "Y", "Z")
        rows = (separator.strip(" ") or " ").join(names) + "\n" + rows if draw(st.booleans()) else rows
    ends, encoding = (
        draw(st.sampled_from(["\n", "\r\n"])),
        draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"])),
    )
    return "a.txt", rows.replace("\n", ends).encode(encoding), options, gap


@settings(
    max_examples=200, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(written())
def test_a_file_is_read_as_it_was_written(tmp_path: Path, file: tuple[str, bytes, dict[str, Any], int]) -> None:
    name, content, options, gap = file
    (tmp_path / name).write_bytes(content)
    read = HeightField.read(tmp_path / name, **options)
    assert (read.dx, read.dy) == pytest.approx((STEP * 1e-6, STEP * 1e-6))
    assert np.flatnonzero(np.isnan(read.z)).tolist() == [gap] * (gap >= 0)
    np.testing.assert_allclose(read.z, np.where(np.isnan(read.z), np.nan, 1e-6 * Z), rtol=1e-12)


def test_lengths_without_a_unit_are_metres_and_others_are_not(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text('made today\n"x (um)", "y (um)", "z (nm)"\n' + text(POINTS))
    for unit in (None, "mm"):  # the file has its own
        read = HeightField.read(tmp_path / "a.csv", unit=unit)
        assert read.dx == pytest.approx(STEP * 1e-6) and read.z[2, 3] == pytest.approx(1e-9 * Z[2, 3])
    (tmp_path / "a.xyz").write_text(text(POINTS, " "))
    assert HeightField.read(tmp_path / "a.xyz").size == pytest.approx(((NX - 1) * STEP, (NY - 1) * STEP))


def test_a_rectangular_map_is_not_stretched_to_the_square_of_its_side(tmp_path: Path) -> None:
    """64 x 32 heights on L = 0.63 um gave 6.31 uN for 4.09."""
    z = 1e-9 * np.random.default_rng(0).normal(size=(32, 64))
    np.save(tmp_path / "a.npy", z)
    np.savez(tmp_path / "b.npz", z=z, L=6.3e-7)
    for make in (lambda: HeightMap(path=tmp_path / "a.npy", L=6.3e-7), lambda: HeightMap.of(z, 6.3e-7),
                 lambda: HeightField.read(tmp_path / "b.npz")):  # fmt: skip
        with pytest.raises(InputError, match="64 x 32 heights on a side L would have different distances"):
            make()
    assert HeightField.read(tmp_path / "a.npy", pixel=1e-8).square().size == pytest.approx((3.1e-7, 3.1e-7))
    np.savez(tmp_path / "a.npz", z=z, dx=6.3e-7 / 63, dy=6.3e-7 / 31)
    for surface in (HeightMap(path=tmp_path / "a.npz"), HeightMap.of(z, (6.3e-7, 6.3e-7))):
        assert surface.L == pytest.approx(6.3e-7)
    with pytest.raises(InputError, match="the patch must be square"):
        HeightMap.of(z, (6.3e-7, 3.1e-7))


def with_coordinates(corner: str) -> str:
    rows = (f"{place:g}," + text([row]) for place, row in zip(Y, Z, strict=True))
    return "\n".join([",".join([corner, *(f"{place:g}" for place in X)]), *rows])


@pytest.mark.parametrize(
    "content",
    [
        b"", b"no map", np.zeros((9, 9), dtype=complex), np.zeros(9), np.zeros((9, 9, 3)),
        MATRIX.replace("\n", ",1.0\n", 1), text(Z, ";").replace(";", ";oops;", 1),
        *(MATRIX.replace(FIRST, cell, 1) for cell in ("oops", "1 234.5", '"1,234.5"', "\u22121.5", "-9999")),
        text(Z[:3]), MATRIX + "\n\n" + MATRIX, text(Z, ",", ","), text(np.array(POINTS)[:, :2]),
        ";".join(["1,234"] * 8) + "\n" + ";".join(["7"] * 8), "1,5;2.5;" + ";".join("7" * 6),
        "\n".join(f"{j}," + text([row]) for j, row in enumerate(Z)), ",".join(map(str, range(NX))) + "\n" + MATRIX,
        with_coordinates(""), with_coordinates("y/x"), "x,y,z\n" + text((x**2, y, z) for x, y, z in POINTS),
        text(POINTS + POINTS[:1]), text(POINTS[:NX]), text((x, x, z) for x, _, z in POINTS[:NX]),
        "z,x,y\n" + text(POINTS), "x [um],y [um],z\n" + text(POINTS), "x [um],y [um],z [V]\n" + text(POINTS),
    ],
    ids=range(29),
)  # fmt: skip
def test_a_file_without_a_meaning_or_with_two_is_refused(tmp_path: Path, content: Any) -> None:
    for name in ("a.csv", "a.npy", "a.npz")[: 1 if isinstance(content, str) else 3]:
        path = tmp_path / name
        if isinstance(content, np.ndarray):
            with path.open("wb") as file:
                (np.savez if name == "a.npz" else np.save)(file, content)
        else:
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        for read in (lambda file: HeightField.read(file, pixel=1e-6), lambda file: HeightMap(path=file, L=1.0)):
            with pytest.raises(InputError, match=name) as caught:
                read(path)
            assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match=r"gone\.npz: there is no such file"):
        HeightField.read(tmp_path / "gone.npz")


SQUARE, BENT = Z[:, :NY], np.where(np.arange(NY) == 3, Y + 0.3 * STEP, Y)  # one irregular step
NO_PATCH: list[tuple[dict[str, Any], float | None]] = [
    ({"z": SQUARE}, None), ({"z": SQUARE, "L": -1.0}, None), ({"z": SQUARE, "x": Y, "y": Y}, 2.0),
    ({"h": SQUARE, "g": SQUARE}, 4.5), ({"z": Z[:3, :3], "L": 1.0}, None), ({"z": Z[0], "L": 1.0}, None),
    ({"z": np.where(SQUARE > 1.0, np.nan, SQUARE), "L": 4.5}, None), ({"z": SQUARE, "x": BENT, "y": Y}, None),
    ({"z": SQUARE, "x": Y, "y": 2 * Y}, None), ({"z": Z.T, "x": X, "y": Y}, None), ({"z": Z, "L": 1.0}, None),
    ({"z": SQUARE, "L": [1.0, 2.0]}, None), ({"z": 1e3 * SQUARE, "L": 4.5}, None),
]  # fmt: skip


@pytest.mark.parametrize(("arrays", "side"), NO_PATCH, ids=range(len(NO_PATCH)))
def test_arrays_that_are_no_square_patch_are_refused(
    tmp_path: Path, arrays: dict[str, Any], side: float | None
) -> None:
    """Each for one reason, without which it is read."""
    path, given = tmp_path / "map.npz", {} if side is None else {"L": side}
    np.savez(path, z=SQUARE, x=Y, y=Y)
    assert HeightMap(path=path, L=4.5).L == HeightMap(path=path).L == 4.5
    np.savez(path, **arrays)
    with pytest.raises(InputError, match=r"map\.npz: |surface\.L") as caught:
        HeightMap(path=path, **given)
    assert "\n" not in str(caught.value)
    for other, words in ((tmp_path / "map.tif", "import-map makes a surface"), (None, "surface.path = None must be")):
        with pytest.raises(InputError, match=words):
            HeightMap(path=other, L=1.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "content",
    [
        f"pixel size=4.0e-007 m\nheight conversion factor (-> m)=6.0e-008\n{text(Z, ' ')}",
        f"ncols {NX}\nnrows {NY}\ncellsize {STEP}\n{text(Z, ' ')}",
        "# Value units: nm\nx,y,z\n" + text(POINTS),
        "a,b,c\n" + text(POINTS),
    ],
    ids=range(4),
)
def test_a_header_is_not_read_and_not_passed_over(tmp_path: Path, content: str) -> None:
    """Its unit is that of the user, or there is none."""
    (tmp_path / "a.txt").write_text(content, encoding="utf-8")
    for read in (HeightField.read, lambda path: HeightMap(path=path, L=1.0)):
        with pytest.raises(InputError, match=r"is a header, and none is read: .*--unit"):
            read(tmp_path / "a.txt")
    pixel = None if text(POINTS) in content else 5e-7
    np.testing.assert_allclose(HeightField.read(tmp_path / "a.txt", unit="6e-8", pixel=pixel).z, 6e-8 * Z)


@pytest.mark.parametrize("corner", [0.0, 77.0, np.nan])
@pytest.mark.parametrize("profile", [0.01 * np.arange(12.0), 0.3 * np.abs(np.arange(12.0) - 5.0)], ids=["flat", "ramp"])
def test_coordinates_beside_heights_are_refused_and_a_plane_has_none(
    tmp_path: Path, corner: float, profile: np.ndarray
) -> None:
    """A tilted flat, and a standard with ramps: with coordinates of rows, of columns and of both."""
    heights = np.add.outer(0.02 * np.arange(10.0), profile)
    rows, columns = np.column_stack([STEP * np.arange(10.0), heights]), np.vstack([STEP * np.arange(12.0), heights])
    both = np.vstack([np.append(corner, columns[0]), rows])
    for table in (both, rows, columns, both.T, rows.T, columns.T):
        np.savetxt(tmp_path / "a.txt", table)
        with pytest.raises(InputError, match="may be coordinates"):
            HeightField.read(tmp_path / "a.txt", pixel=1.0)
    np.savetxt(tmp_path / "a.txt", heights)
    np.testing.assert_allclose(HeightField.read(tmp_path / "a.txt", pixel=1.0).z, heights)


@pytest.mark.parametrize("name", ["a.npy", "a.csv", "a.xyz"])
def test_a_mark_of_missing_heights_is_named_or_denied(tmp_path: Path, name: str) -> None:
    z = np.where(Z == Z[3, 4], -32768.0, Z)
    np.save(tmp_path / "a.npy", z)
    np.savetxt(tmp_path / "a.csv", z, delimiter=",")
    np.savetxt(tmp_path / "a.xyz", [(x, y, h) for (x, y, _), h in zip(POINTS, z.ravel(), strict=True)])
    given: dict[str, Any] = {} if name == "a.xyz" else {"pixel": 1.0}
    for missing in (None, 0.0, -9999.0):  # none is left as a height
        with pytest.raises(InputError, match="import-map --missing -32768"):
            HeightField.read(tmp_path / name, **given, missing=missing)
    assert HeightField.read(tmp_path / name, **given, missing=-32768.0).missing == 1 / Z.size
    assert HeightField.read(tmp_path / name, **given, missing=np.nan).z[3, 4] == -32768.0


# ---------------------------------------------------------------------------------------- instruments


def test_without_surfacetopography_the_remedy_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    for name, kind in (("scan.sur", CompatError), ("scan.dat", InputError), ("scan.xyz", InputError)):
        (tmp_path / name).write_bytes(b"x\0")
        with pytest.raises(kind, match=r"no plain text.*pip install .asperity\[scan\]"):
            HeightField.read(tmp_path / name)


@pytest.mark.parametrize("name", ["a.nc", "a.x3p", "a.gwy", "a.txt"])
def test_surfacetopography_reads_what_it_has_written(tmp_path: Path, name: str) -> None:
    """Files of instruments, and the header of an ASCII export, with a conversion factor and distances."""
    package, path = pytest.importorskip("SurfaceTopography"), tmp_path / name
    map_of_x = package.Topography(Z.T, (NX * STEP, NY * STEP), unit="um")
    header = "# Channel: Z\n# Width: 6 µm\n# Height: 5 µm\n# Value units: µm\n"
    writers = {".nc": "to_netcdf", ".x3p": "to_x3p", ".gwy": "to_gwy"}
    if path.suffix in writers:
        getattr(map_of_x, writers[path.suffix])(str(path))
    else:
        path.write_text(header + text(Z, " "))
    read = HeightField.read(path, channel="1")
    assert (read.dx, read.dy) == pytest.approx((1e-6 * STEP, 1e-6 * STEP))
    np.testing.assert_allclose(read.z, 1e-6 * Z, atol=1e-15)


def test_instrument_files_are_read_by_surfacetopography(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stand-in with the package's interface: first index x, micrometres, masked heights."""
    heights = np.ma.masked_greater(np.arange(80.0).reshape(10, 8), 78.5)
    channels: list[Any] = []
    asked: list[int] = []

    class Topography:
        unit, pixel_size = "um", (0.5e-6, 1e-6)

        def to_unit(self, unit: str) -> Topography:
            assert unit == "m"
            return self

        def heights(self) -> Any:
            return heights * 1e-6

    def topography(channel_index: int, **sizes: Any) -> Topography:
        asked.append(channel_index)
        return Topography()

    def name(*names: str) -> None:
        channels[:] = [types.SimpleNamespace(name=n, index=i, dim=2, physical_sizes=(5.0, 8.0), nb_grid_pts=(10, 8))
                       for i, n in enumerate(names)]  # fmt: skip
        reader.default_channel = channels[0]

    reader = types.SimpleNamespace(channels=channels, topography=topography)
    package = types.ModuleType("SurfaceTopography")
    package.open_topography = lambda path: reader  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "SurfaceTopography", package)
    path = tmp_path / "scan.sur"
    path.write_bytes(b"x")
    name("Height")
    read = HeightField.read(path)
    assert read.z.shape == (8, 10) and (read.dx, read.dy) == (0.5e-6, 1e-6)
    assert read.z[3, 5] == pytest.approx((5 * 8 + 3) * 1e-6)
    assert np.isnan(read.z[7, 9]) and read.missing == pytest.approx(1 / 80)
    assert read.notes == () and read.channel == ""
    (tmp_path / "scan.txt").write_text("Pixel size: 1 um")
    np.testing.assert_array_equal(HeightField.read(tmp_path / "scan.txt", channel="1").z, read.z)

    name("Amplitude", "Height", "Phase\n")
    reader.default_channel = channels[1]
    listed = "1 'Amplitude', 2 'Height', 3 'Phase'"
    for wanted, index, found in ((None, 1, "Height"), ("Phase", 2, "Phase"), ("1", 0, "Amplitude")):
        read = HeightField.read(path, channel=wanted)
        assert asked[-1] == index and read.channel == found
        assert read.notes[0].startswith(f"channel {index + 1} {found!r} of {listed}")
    with pytest.raises(InputError, match=f"no channel 'Retrace': choose a name or a number of {listed}"):
        HeightField.read(path, channel="Retrace")

    channels[1].physical_sizes = None
    with pytest.raises(InputError, match="without lengths; give the distance"):
        HeightField.read(path)
    monkeypatch.setattr(Topography, "unit", None)
    with pytest.raises(InputError, match="does not give the unit"):
        HeightField.read(path, pixel=1e-6)
    assert HeightField.read(path, pixel=(1e-6, 2e-6), unit="2").z[3, 5] == pytest.approx(2 * (5 * 8 + 3) * 1e-6)

    def broken(error: Exception) -> Any:
        raise error

    for error in (IndexError("list index out of range"), AssertionError(), KeyError("z"), MemoryError(), TypeError()):
        monkeypatch.setattr(reader, "topography", lambda error=error, **_: broken(error))
        with pytest.raises(InputError, match="SurfaceTopography finds no height map in it"):
            HeightField.read(path, unit="um", pixel=1e-6)
