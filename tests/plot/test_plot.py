"""Figures of a run: which are drawn and their content."""

from __future__ import annotations

import base64
import io
import shutil
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from made_up_run import FIT, write_run
from matplotlib.figure import Figure
from PIL import Image

import asperity as asp
from asperity.curve import Curve
from asperity.errors import InputError
from asperity.output.fields import gather_top_states
from asperity.output.results import Raster, Results
from asperity.plot import (
    contact_area,
    figures_of,
    force_curve,
    frequency,
    plot_run,
    pressure_maps,
    receptance,
    response,
    save,
    slip,
    stiffness,
    surface_map,
)
from asperity.plot.contact import growing_spots, pressed_thirds, turning_surface
from asperity.plot.curves import local_exponent
from asperity.runtime.run_folder import FIELD_PICTURES, PRODUCTS
from asperity.slip import SlipSettings, slip_of_curve


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def results(folder: Path) -> Results:
    return Results.read(folder)


def test_all_figures_of_a_run_are_drawn(folder: Path) -> None:
    written = plot_run(folder)
    assert {path.stem for path in written} == {*figures_of(Results.read(folder))} >= {"curve", "area", "pressure"}
    starts = {".png": b"\x89PNG", ".svg": b"<?xml"}
    assert all(path.read_bytes().startswith(starts[path.suffix]) for path in written)
    assert {path.stem for path in written if path.suffix == ".svg"}.isdisjoint(FIELD_PICTURES)
    assert {f"figures/{path.name}" for path in written} <= set(PRODUCTS)


def test_figures_without_data_are_left_out(tmp_path: Path) -> None:
    write_run(tmp_path, material={"E": 200e9, "nu": 0.3})
    shutil.rmtree(tmp_path / "fields")
    assert {*figures_of(Results.read(tmp_path))} == {"surface", "area", "curve"}
    for name in ("case.toml", "summary.json"):
        (tmp_path / name).unlink()
    assert {path.stem for path in plot_run(tmp_path)} == {"area", "curve"}


def test_every_axis_has_quantity_and_unit(results: Results) -> None:
    curve, surface = results.curve, results.surface
    k = 1e4 * curve.P_star
    known = replace(results, curve=replace(curve, k_n=k, k_n_elastic=2.0 * k, k_t=k, mean_gap=1e-7 - curve.delta))
    assert "stiffness" in figures_of(known) and "stiffness" not in figures_of(results)
    heights = surface_map(surface, n=33)
    assert heights.axes[1].get_ylabel() == "height above the mean plane (nm)"
    assert pressure_maps(results).axes[-1].get_ylabel().startswith("contact pressure (")
    for figure in (contact_area(results), force_curve(results), stiffness(known)):
        assert all(axis.get_xlabel() and axis.get_ylabel() for axis in figure.axes)
        assert [axis.get_title(loc="left")[:3] for axis in figure.axes] == ["(a)", "(b)", "(c)"][: len(figure.axes)]
    assert figure.axes[1].get_ylabel() == "mean gap (nm)"


def test_second_axes_are_in_physical_units(results: Results) -> None:
    axis = force_curve(results).axes[0]
    right, top = (axis.child_axes[k] for k in (1, 0))
    assert (top.get_xlabel(), right.get_ylabel()) == ("approach $\\delta$ (nm)", "force $P$ (µN)")
    axis.figure.draw_without_rendering()
    curve = results.curve
    assert top.get_xlim()[1] == pytest.approx(1e9 * axis.get_xlim()[1] * curve.delta[-1] / curve.delta_star[-1])
    assert right.get_ylim()[1] == pytest.approx(1e6 * axis.get_ylim()[1] * curve.force[-1] / curve.P_star[-1])


def test_the_local_exponent_is_that_of_the_law(results: Results) -> None:
    x, exponent = local_exponent(results.curve)
    assert len(x) == 12
    np.testing.assert_allclose(exponent, 1.55, rtol=1e-6)
    delta = np.linspace(0.001, 0.03, 40)
    P = delta**2 + 0.05 * delta  # exponent (2 delta + 0.05)/(delta + 0.05)
    rows = [{"delta": d, "force": p, "delta_star": d, "P_star": p} for d, p in zip(delta, P, strict=True)]
    curve = Curve.from_rows(rows)
    x, exponent = local_exponent(curve)
    np.testing.assert_allclose(exponent[1:-1], ((2 * x + 0.05) / (x + 0.05))[1:-1], rtol=5e-3)


def test_the_curve_shows_branches_fit_and_error_band(results: Results) -> None:
    linear, logarithmic, _ = force_curve(results).axes
    legend = [text.get_text() for text in linear.get_legend().get_texts()]
    assert legend[0] == "loading" and "error bar" in legend and "unloading" in legend
    assert any("1.550" in text for text in legend)
    assert logarithmic.get_xscale() == logarithmic.get_yscale() == "log"
    for axis in (linear, logarithmic):
        fit = next(line for line in axis.lines if "1.550" in str(line.get_label()))
        x, y = (np.asarray(values, float) for values in fit.get_data())
        np.testing.assert_allclose(y, 0.42 * x**1.55, rtol=1e-12)
        assert (x.min(), x.max()) == pytest.approx(FIT["range"], rel=1e-12)  # and nothing beyond
    unloading = next(line for line in linear.lines if line.get_label() == "unloading")
    assert unloading.get_linestyle() == "--"
    assert len(linear.collections) == 2  # bands of loading and unloading


def test_pressure_maps_share_one_scale_and_skip_empty_levels(results: Results) -> None:
    figure = pressure_maps(results, count=4)
    assert len(figure.axes) == 5  # with the spot and the colour bar
    titles = [axis.get_title(loc="left") for axis in figure.axes[:3]]
    assert all("0.0000" not in title for title in titles)
    assert titles[-1].startswith("(c) unloading") and all(title.endswith("µN ± 3 %") for title in titles)
    limits = {axis.images[-1].get_clim() for axis in figure.axes[:4]}
    assert len(limits) == 1 and min(limits)[0] == 0.0  # over the shaded surface
    step = int(results.top["steps"][-1])
    spots = np.where(results.curve.step == step, 7, 0)
    counted = pressure_maps(replace(results, curve=replace(results.curve, spots=spots)), count=4)
    assert counted.axes[2].get_title(loc="left").endswith("µN ± 3 %, 7 spots")
    assert not any(axis.texts for axis in counted.axes)  # which would hide spots


@pytest.mark.usefixtures("blank_figures")
@pytest.mark.parametrize("rows", [0, 1])
def test_a_run_that_stopped_early_has_figures(tmp_path: Path, rows: int) -> None:
    write_run(tmp_path)
    curve = Curve.read(tmp_path / "curve.csv")
    curve.where(np.arange(rows)).write(tmp_path / "curve.csv")
    fields = dict(np.load(tmp_path / "fields/top.npz"))
    for name in ("steps", "branch", "delta", "pressure", "gap", "touched"):
        fields[name] = fields[name][:rows]  # the first level carries no load
    np.savez(tmp_path / "fields/top.npz", **fields)
    expected = {"pressure", "area", "curve"} if rows else set()
    assert {path.stem for path in plot_run(tmp_path)} == {"surface"} | expected


def write_vibration(folder: Path) -> None:
    """free.csv of a softening law; response.csv with folds, in two times three pieces."""
    u = np.linspace(0, 2, 21)
    free = [f"{m},{a},{1 - 0.05 * a * a},{-1.2 * a}" for m in ("exact", "taylor") for a in u]
    (folder / "free.csv").write_text("\n".join(["model,u0,omega_ratio,u_min", *free]))
    t = np.linspace(0, 1, 41)
    omega, height = 0.8 + 0.5 * t**2 - 0.25 * t, np.sin(np.pi * t)
    head = "model,F_hat,zeta,Omega,u_max,u_min,a1,stable,branch,contact_loss"
    rows = []
    for shift, first in ((0.0, 0), (2.0, 2)):
        for w, a, s in zip(omega, height + shift, t, strict=True):
            rows.append(f"exact,0.05,0.01,{w},{a},{-a},{a},{s > 0.25},{first + (s > 0.25)},{a > 0.8}")
    (folder / "response.csv").write_text("\n".join([head, *rows]))


def test_vibration_figures(tmp_path: Path) -> None:
    write_run(tmp_path)
    write_vibration(tmp_path)
    results = Results.read(tmp_path)
    assert {"frequency", "response"} <= {*figures_of(results)}
    assert len(frequency(results).axes) == 1
    figure = response(results)
    (axis,) = figure.axes
    keys = [text.get_text() for text in figure.legends[0].get_texts()]
    assert any("$F$ = 0.0775 $W$" in key for key in keys)  # n_loc = 1.55 times 0.05
    # no line runs from one piece to another
    lines = [np.asarray(line.get_ydata()) for line in axis.lines]
    assert all(np.ptp(y) < 1.5 for y in lines)


def test_the_receptance_of_a_run_has_the_units_of_the_joint(tmp_path: Path) -> None:
    write_run(tmp_path)
    joint = asp.Joint(nominal_area=1e-6, pressure=2e8, mass=2.0)
    result = asp.run_dynamics(tmp_path, joint=joint, forcing=1e-4, out_dir=tmp_path)
    results = Results.read(tmp_path)
    assert "receptance" in figures_of(results)
    (own,) = receptance(results).axes
    numbers = result.numbers
    for line in own.lines[:2]:  # the linear one, and that of a light force
        r, y = (np.asarray(data, float) for data in line.get_data())
        np.testing.assert_allclose(y, 1.0 / np.hypot(1 - r**2, 2 * numbers.damping * r), rtol=2e-3)
    own.figure.draw_without_rendering()
    top, right = own.child_axes
    hertz = {"frequency (Hz)": 1.0, "frequency (kHz)": 1e3}[top.get_xlabel()]
    metres = {f"receptance $|X/F|$ ({unit}/N)": f for unit, f in (("pm", 1e-12), ("nm", 1e-9), ("µm", 1e-6))}[
        right.get_ylabel()
    ]
    assert hertz * top.get_xlim()[1] == pytest.approx(numbers.frequency * own.get_xlim()[1])
    assert metres * right.get_ylim()[1] == pytest.approx(own.get_ylim()[1] / numbers.stiffness)


def test_the_loops_of_slip_are_apart_and_have_the_energy_of_a_cycle(tmp_path: Path) -> None:
    """The displacement without slip takes nothing from the area of a loop, and narrows its width."""
    z, steel = np.linspace(0.0, 1e-8, 41), asp.Material(E=200e9, nu=0.3)
    settings = SlipSettings(friction=0.3, amplitudes=(0.2, 0.4, 0.6, 0.8), steps=100)
    curve = Curve.from_rows([{"delta": d, "force": 2e9 * d**1.5} for d in z[1:]])
    found = slip_of_curve(curve, settings, steel, patch=1e-12, height=1e-6)
    found.write(tmp_path)
    curve.write(tmp_path / "curve.csv")
    loops = [line.get_xydata()[100:] for line in slip(Results.read(tmp_path)).axes[0].lines]
    areas = np.array([0.5 * abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) for x, y in (loop.T for loop in loops)])
    energy = np.array([row["energy"] for row in found.loops()])
    np.testing.assert_allclose(areas / areas[-1], energy / energy[-1], rtol=0.02)
    width, reach = (np.array([np.ptp(loop[:, 0][np.argsort(np.abs(loop[:, 1]))[:2]]) for loop in loops]),
                    np.array([np.ptp(loop[:, 0]) for loop in loops]))  # fmt: skip
    assert np.all(width > 0.2 * reach) and np.all(np.diff(np.log(reach)) > 0.4)


def test_the_suffix_is_that_of_a_picture(tmp_path: Path) -> None:
    assert save(Figure(), tmp_path / "a.PNG").read_bytes()[1:4] == b"PNG"
    with pytest.raises(InputError, match=r"a\.xyz has no suffix"):
        save(Figure(), tmp_path / "a.xyz")


def test_the_pressures_of_the_thirds_have_the_force_and_the_area_of_the_curve() -> None:
    """Unlike those at the nodes, which reach beyond the contact."""
    wave = asp.Surface.from_spec("sinusoid", L=1e-6, amplitude=5e-9, dims=2)
    size = asp.MeshSize(h_contact=0.1e-6)
    result = asp.solve_contact(wave, asp.Material(E=200e9, nu=0.3), delta_max=4e-9, steps=3, size=size, snapshots=3)
    top = gather_top_states(result, wave.L, 200e9)
    assert top is not None and len(top["steps"]) == 3
    for i, step in enumerate(top["steps"]):
        row = result.curve.where(result.curve.step == step)
        pressure, area = pressed_thirds(top, i)
        assert pressure @ area == pytest.approx(row.force[0], rel=1e-6)
        assert area.sum() == pytest.approx(row.area_fraction[0] * wave.L**2, rel=1e-9)


# --- the surface that turns on the page ------------------------------------------------------------------------

MOST = 300_000  # bytes that the surface may add to a page


def test_the_data_of_the_page_are_those_of_the_run(results: Results) -> None:
    shown = turning_surface(results, Raster(results.top))
    assert shown is not None and len(shown["heights"]) + len(shown["colours"]) < MOST
    heights = np.frombuffer(base64.b64decode(shown["heights"]), "<u2").reshape(shown["nodes"], shown["nodes"])
    gap = results.top["gap"][4].reshape(91, 91)  # at the greatest approach, on the grid of the file
    there = 1.0 - gap / gap.max()
    x = (np.arange(0, 400, 3) + 0.5) / 400 * 90
    nearest = there[np.ix_(x.round().astype(int), x.round().astype(int))]
    assert np.corrcoef(heights.ravel(), nearest.ravel())[0, 1] > 0.99
    picture = matplotlib.image.imread(io.BytesIO(base64.b64decode(shown["colours"])))[..., :3]
    coloured = np.ptp(picture, axis=-1) > 0.01
    assert coloured.mean() == pytest.approx(results.top["touched"][4].mean(), rel=0.1)
    assert "30 nm, under a load of 403 µN ± 3 %, with" in shown["caption"] and shown["side"] == "1 µm"


def test_the_spots_grow_as_those_of_the_run(results: Results) -> None:
    """The pixels in colour are those of the contact and of the scale beside it, which is the same in all frames."""
    moving = Image.open(io.BytesIO(base64.b64decode(growing_spots(results, Raster(results.top)) or "")))
    pressed = (results.top["branch"] == "load") & (results.top["pressure"].max(axis=1) > 0.0)
    assert moving.n_frames == pressed.sum()  # type: ignore[attr-defined]
    coloured, touched = [], results.top["touched"][pressed].mean(axis=1)
    for frame in range(moving.n_frames):  # type: ignore[attr-defined]
        moving.seek(frame)
        coloured.append((np.ptp(np.asarray(moving.convert("RGB"), float), axis=-1) > 10.0).sum())
    of_patch, of_scale = np.polyfit(touched, coloured, 1)
    np.testing.assert_allclose(of_patch * touched + of_scale, coloured, atol=0.03 * np.ptp(coloured))
    assert np.ptp(touched) > 0.1 and 0.3 < of_patch / (moving.width * moving.height) < 0.9


def test_without_pressure_there_is_none(tmp_path: Path) -> None:
    results = Results.read(write_run(tmp_path))
    results.top["pressure"][:] = 0.0
    assert turning_surface(results, on_grid := Raster(results.top)) is None and growing_spots(results, on_grid) is None
