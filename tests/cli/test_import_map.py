"""`asperity import-map`: what it writes of good maps, and one sentence for each bad one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import call, files

from asperity.case import Case
from asperity.errors import InputError
from asperity.surface import HeightMap, SelfAffine, height_map
from asperity.surface.scans import HeightField

SIDE = 0.5e-6
SCAN = SelfAffine(L=SIDE, H=0.8, slope=0.4, lambda_roll=0.1e-6, lambda_short=8e-9, periodic=False, seed=4).grid(256)


@pytest.fixture(autouse=True)
def without_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """tests/test_interactive.py makes them."""
    for name in ("save", "surface_map", "contact.spectrum_figure"):
        monkeypatch.setattr(f"asperity.plot.{name}", lambda *_, **__: None)


def import_map(*arguments: Any) -> int:
    return call("import-map", *arguments)


def write(folder: Path, z: Any, **lengths: Any) -> Path:
    np.savez(folder / "scan.npz", z=z, **(lengths or {"L": SIDE}))
    return folder / "scan.npz"


def changed(**places: float) -> np.ndarray:
    z = SCAN.copy()
    for index, value in enumerate(places.values()):
        z[40 + 60 * index, 50] = value
    return z


def islands(share: float) -> np.ndarray:
    z = SCAN.copy()
    z[20 : 20 + round(share * 256), :] = np.nan
    z[200:204, 10:30] = np.nan
    return z


def test_a_case_is_made_with_statistics(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert import_map(write(tmp_path, SCAN), "-o", tmp_path / "out") == 0
    shown = capsys.readouterr().out
    assert "rms slope" in shown and "Hurst exponent" in shown
    about = json.loads((tmp_path / "out/measured.json").read_text())
    assert about["self_affine"]["H"] == pytest.approx(0.8, abs=0.12)
    assert about["self_affine"]["lambda_roll"] == pytest.approx(0.1e-6, rel=0.4)
    case = Case.load(tmp_path / "out/case.toml")
    assert case.accuracy.tolerance == 0.05 and case.loading.delta_max is not None
    cut = (SCAN > SCAN.max() - case.loading.delta_max).mean()
    assert 0.01 < cut < 0.03


def test_a_run_is_not_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scan = write(tmp_path, SCAN)
    assert import_map(scan, "-o", scan) == 2 and "is a file; give another folder" in capsys.readouterr().err
    (tmp_path / "checkpoint").mkdir()
    (tmp_path / "checkpoint/state.npz").touch()
    assert import_map(scan, "-o", tmp_path) == 2 and "holds a run" in capsys.readouterr().err
    assert not (tmp_path / "case.toml").exists()


def test_plateaus_are_pressed_as_lightly_as_summits(tmp_path: Path) -> None:
    """Half of the summit's height above the mean plane would press a worn surface by most of its roughness."""
    worn = np.minimum(SCAN, np.quantile(SCAN, 0.5)) + 0.02 * SCAN
    assert import_map(write(tmp_path, worn), "-o", tmp_path / "out") == 0
    delta = Case.load(tmp_path / "out/case.toml").loading.delta_max
    assert delta is not None and delta < 0.25 * (worn.max() - worn.mean())


@pytest.mark.parametrize(
    ("z", "lengths"),
    [
        (changed(up=1e-6, down=-3e-6), {}),  # spikes
        (changed(a=np.inf, b=-np.inf, c=np.nan), {}),
        (islands(0.1), {}),
        (np.rint(SCAN * 1e9).astype(np.int16), {"dx": 20.0}),
        (SCAN.astype(np.float32), {}),
        (SCAN[:100], {"dx": 2e-9}),
        (SCAN[:100, :200], {"dx": 2e-9, "dy": 3.3e-9}),
        (SCAN + 1.0, {}),
        (SCAN[:8, :8], {"dx": 2e-9}),
    ],
    ids=["spikes", "infinite", "islands", "integers", "single", "oblong", "pixels", "offset", "tiny"],
)
def test_odd_maps_give_a_result(
    tmp_path: Path, z: np.ndarray, lengths: dict[str, float], capsys: pytest.CaptureFixture[str]
) -> None:
    assert import_map(write(tmp_path, z, **lengths), "-o", tmp_path / "out") == 0
    gaps = np.mean(~np.isfinite(z))
    assert json.loads((tmp_path / "out/measured.json").read_text())["filled"] == gaps
    assert ("gaps that were filled" in capsys.readouterr().out) == (gaps > 0.0)
    surface = Case.load(tmp_path / "out/case.toml").surface
    assert np.isfinite([*surface.maximum(), *surface.grid(5).ravel()]).all()


BAD: list[tuple[Any, dict[str, Any], tuple[str, ...]]] = [
    (np.full((50, 50), 3e-9), {}, ()),
    (np.add.outer(np.arange(50.0), np.arange(50.0)) * 1e-10, {}, ()),
    *((z, {"dx": 2e-9}, ()) for z in (SCAN[:1], np.zeros((20, 20, 3)), np.full((50, 50), np.nan), islands(0.5))),
    *((factor * SCAN, {}, ()) for factor in (1e6, 1e300)),
    (np.full((20, 20), "x"), {}, ()),
    *((SCAN, {"L": side}, ()) for side in (-1.0, 0.0, "long", np.nan)),
    *((SCAN, {}, ("--cutoff", length)) for length in ("1e-3", "nan", "1nm")),
    *((SCAN, {}, ("--window", *corner)) for corner in (("0", "0", "1"), ("0", "nan", "1e-7"), ("0", "0", "1nm"))),
    *((SCAN, {}, ("--pixel", length)) for length in ("0", "-1", "1um", "1,2,3", "one")),
    *((SCAN, {}, options) for options in (("--unit", "inch"), ("--unit", "-1"), ("--channel", "1"), ("--array", "q"))),
]


@pytest.mark.parametrize("bad", BAD, ids=range(len(BAD)))
def test_bad_maps_and_options_are_one_sentence_that_names_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], bad: Any
) -> None:
    """The map, or the option and its value."""
    z, lengths, options = bad
    assert import_map(write(tmp_path, z, **lengths), "-o", tmp_path / "out", *options) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1 and not (tmp_path / "out").exists()
    words = (options[0], options[0].lstrip("-")) if options else ("scan.npz", "the map", "heights")
    assert any(word in error for word in words)


def test_a_spike_is_filled_where_it_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for spike, options in (np.nan, ()), (0.3e-6, ("--spikes", "fill")):
        assert import_map(write(tmp_path, changed(up=spike)), *options, "-o", tmp_path / "out") == 0
        assert "stand above" not in capsys.readouterr().out
        assert json.loads((tmp_path / "out/measured.json").read_text())["filled"] == 1 / SCAN.size
    clean = HeightField(SCAN, 1.0, 1.0).levelled("plane").z
    found = HeightMap(path=tmp_path / "out/patch.npz").heights
    assert np.abs(found - clean).max() < 0.1 * np.ptp(clean) < 0.01 * 0.3e-6


@pytest.mark.parametrize("places", [1, 30])
def test_a_filter_hides_no_spike(tmp_path: Path, capsys: pytest.CaptureFixture[str], places: int) -> None:
    """Spikes of hundreds of rms heights, which a filter smears over its cut-off; filled, the map is the clean one."""
    z, rng, cutoff = 0.01 * SCAN, np.random.default_rng(5), ("--cutoff", f"{SIDE / 12:g}")
    iy, ix = rng.integers(3, 253, (2, places))
    z[iy, ix] += 300e-9 * rng.uniform(0.1, 1.0, places)
    assert import_map(write(tmp_path, z), "-o", tmp_path / "out", *cutoff) == 0
    assert f"{places} heights stand above" in capsys.readouterr().out
    smeared = HeightMap(path=tmp_path / "out/patch.npz").heights
    assert import_map(write(tmp_path, z), "-o", tmp_path / "out", *cutoff, "--spikes", "fill") == 0
    filled = HeightMap(path=tmp_path / "out/patch.npz").heights
    assert import_map(write(tmp_path, 0.01 * SCAN), "-o", tmp_path / "out", *cutoff) == 0
    clean = HeightMap(path=tmp_path / "out/patch.npz").heights
    assert np.abs(filled - clean).max() < 0.05 * clean.std() < 0.05 * np.abs(smeared - clean).max()


@pytest.mark.parametrize(
    ("pixel", "options", "side"),
    [("31.25um", (), 250e-6), ("31.25e-6", (), 250e-6), ("0.03125mm,31250 nm", (), 250e-6),
     ("31.25um", ("--window", "0", "0.025mm", "220um"), 220e-6)],
)  # fmt: skip
def test_lengths_have_units(tmp_path: Path, pixel: str, options: tuple[str, ...], side: float) -> None:
    np.save(tmp_path / "map.npy", 1e-6 * np.random.default_rng(3).normal(size=(9, 9)))
    assert import_map(tmp_path / "map.npy", "--pixel", pixel, *options, "-o", tmp_path / "out") == 0
    assert HeightMap(path=tmp_path / "out/patch.npz").L == pytest.approx(side, rel=1e-9)


def test_a_length_without_unit_beside_another_unit_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It may be meant in either; the factor of a million between them is the mistake of a map of 250 m."""
    np.save(tmp_path / "map.npy", np.random.default_rng(3).normal(size=(9, 9)))
    with_unit = (tmp_path / "map.npy", "--unit", "um", "-o", tmp_path / "out", "--pixel")
    for given in (["31.25"], ["31.25um", "--cutoff", "80"], ["1um", "--window", *"017"]):
        assert import_map(*with_unit, *given) == 2
        assert "has no unit beside --unit um; write" in capsys.readouterr().err
    assert import_map(*with_unit, "31.25um") == 0


def test_of_a_huge_map_a_window_is_cut(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here from 100 heights a side."""
    monkeypatch.setattr(height_map, "MOST", 100)
    scan, out = write(tmp_path, SCAN), tmp_path / "out"
    assert import_map(scan, "-o", out) == 2
    assert "256 x 256 heights are more than the 100 x 100" in capsys.readouterr().err
    assert import_map(scan, "-o", out, "--window", "0.1e-6", "0.1e-6", "0.15e-6") == 0
    with pytest.raises(InputError, match="more than the 100 x 100 of a surface"):
        HeightMap(path=scan)


def test_a_refused_map_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where it fails last, when patch and case are there already; an earlier result stays as it is."""
    scan, out = write(tmp_path, SCAN), tmp_path / "out"

    def refuse(*_: Any) -> None:
        raise InputError("no picture")

    assert import_map(scan, "-o", out) == 0
    before = files(out)
    monkeypatch.setattr("asperity.plot.save", refuse)
    for folder in (out, tmp_path / "new"):
        assert import_map(scan, "-o", folder, "--cutoff", "0.1um") == 2 and "no picture" in capsys.readouterr().err
    assert files(out) == before and sorted(path.name for path in tmp_path.iterdir()) == ["out", "scan.npz"]


# ---------------------------------------------------------------------------------------- advice

S = np.linspace(0.0, 100e-6, 200)
X, Y = np.meshgrid(S, S)
NOISE = np.random.default_rng(7).normal(size=X.shape)


def rough(seed: int, height: float = 0.3e-6, lambda_short: float = 2e-6) -> np.ndarray:
    return SelfAffine(
        L=S[-1], H=0.8, rms_height=height, lambda_roll=30e-6, lambda_short=lambda_short, periodic=False, seed=seed,
    ).grid(S.size)  # fmt: skip


def turned(feed: float) -> np.ndarray:
    return ((X + 0.03 * Y) % feed - feed / 2) ** 2 / 80e-6 + rough(11, 15e-9, lambda_short=1.2e-6) + 4e-9 * NOISE


def surfaces_without_spikes() -> dict[str, np.ndarray]:
    """Sharp, smooth, quantised, worn, stepped and scratched surfaces."""
    rng, x, y = np.random.default_rng(2), *np.meshgrid(np.arange(256.0), np.arange(256.0))
    noise, steps = rng.normal(size=x.shape), np.ptp(SCAN) / 8
    cones = np.maximum(0.0, 10.0 - np.hypot(x % 20 - 10, y % 20 - 10))
    scratched = np.where(rng.uniform(size=256) < 0.1, -50.0, 0.0)[:, None] + noise
    return {
        "smooth": rough(2, lambda_short=30e-6), "rough": SCAN, "quantised": steps * np.rint(SCAN / steps),
        "worn": np.minimum(SCAN, np.quantile(SCAN, 0.5)) + 0.02 * SCAN, "cones": cones,
        "step": np.where(x < 100, 0.0, 1000.0) + noise, "scratched": scratched, "turned": turned(9e-6),
    }  # fmt: skip


@pytest.mark.parametrize("name", surfaces_without_spikes())
def test_other_surfaces_have_no_spikes(name: str) -> None:
    assert not HeightField(surfaces_without_spikes()[name], 1.0, 1.0).spikes().any()


def test_a_pixel_does_not_replace_lengths_of_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scan, own = write(tmp_path, SCAN), SIDE / 255
    assert import_map(scan, "-o", tmp_path / "out", "--pixel", "1e-6") == 2
    assert "has lengths of its own, dx = 1.96078e-09" in capsys.readouterr().err and not (tmp_path / "out").exists()
    assert import_map(scan, "-o", tmp_path / "out", "--pixel", f"{own:.4g}") == 0
    assert HeightMap(path=tmp_path / "out/patch.npz").L == pytest.approx(SIDE)


STEP = float(np.ptp(SCAN)) / 8  # of eight steps H would be 0.3 ± 0.1 for 0.8
DOUBTS = (
    "the rms slope of",
    "is long for roughness",
    "or is far from a power law",
    "9 different heights",
    "stand above",
)


@pytest.mark.parametrize(
    ("z", "side", "doubts"),
    [
        (rough(1), 1.0, "01"), (1e6 * rough(1), 100.0, "1"), (rough(3), S[-1], ""), (turned(9e-6), S[-1], "2"),
        (turned(22e-6), S[-1], "2"), (STEP * np.rint(SCAN / STEP), SIDE, "3"), (changed(up=0.3e-6), SIDE, "4"),
    ],
    ids=["metres beside micrometres", "micrometres", "fine", "fine grooves", "grooves", "steps", "dust"],
)  # fmt: skip
def test_what_is_improbable_is_questioned_and_nothing_else(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], z: np.ndarray, side: float, doubts: str
) -> None:
    assert import_map(write(tmp_path, z, L=side), "-o", tmp_path / "out") == 0
    said = " ".join("".join(capsys.readouterr()).split())
    assert "".join(str(i) for i, words in enumerate(DOUBTS) if words in said) == doubts
    assert ("no Hurst exponent" in said) == (doubts in tuple("234"))  # dust bends the spectrum


def test_units_missing_heights_and_form_are_treated_as_told(tmp_path: Path) -> None:
    z = 1e6 * (rough(4) - (X**2 + Y**2) / 6e-4) + 100.0
    scan = write(tmp_path, np.where(NOISE > 2.0, 0.0, z), L=100.0)
    assert import_map(scan, "-o", tmp_path / "out", "--unit", "um", "--missing", "0", "--level", "curvature") == 0
    patch = HeightMap(path=tmp_path / "out/patch.npz")
    assert patch.L == pytest.approx(100e-6) and patch.statistics().Sq == pytest.approx(0.3e-6, rel=0.3)


def test_channel_and_array_are_named_where_the_map_goes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In the output, in measured.json and with the surface of the case, from where it gets into summary and report."""
    np.savez(tmp_path / "two.npz", topo=SCAN, other=-SCAN, L=SIDE)
    assert import_map(tmp_path / "two.npz", "-o", tmp_path / "out") == 2
    assert "name the heights with --array" in capsys.readouterr().err
    assert import_map(tmp_path / "two.npz", "--array", "topo", "-o", tmp_path / "out") == 0
    assert "the heights are the array 'topo'" in capsys.readouterr().out
    assert json.loads((tmp_path / "out/measured.json").read_text())["channel"] == "topo"
    about = HeightMap(path=tmp_path / "out/patch.npz").about
    assert about["file"].endswith("two.npz") and about["channel"] == "topo" and about["level"] == "plane"
    assert import_map(tmp_path / "two.npz", "--array", "third", "-o", tmp_path / "out") == 2
    assert "no array 'third'" in capsys.readouterr().err
    np.savez(tmp_path / "one.npz", topo=SCAN, L=SIDE, about="none")
    assert HeightField.read(tmp_path / "one.npz").channel == "topo"
    assert import_map(tmp_path / "two.npz", "--channel", "topo", "-o", tmp_path / "out") == 2
    assert "--channel is for files of instruments" in capsys.readouterr().err
