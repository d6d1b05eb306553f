"""Warnings of a run about the limits of its model: limits in closed form, each warning once in every file."""

from __future__ import annotations

import json
import logging
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from html_page import Page

from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import AsperityWarning, AssumptionWarning, ConvergenceError, Interrupted, ResolutionWarning
from asperity.model.material import Material
from asperity.model.settings import MeshSize
from asperity.output.assumptions import (
    SMALL_STRAIN,
    beyond_mean_plane,
    bulk_yield,
    departures,
    large_strain,
    yield_pressure,
)
from asperity.quasistatic.solve_contact import solve_contact
from asperity.run_case import run
from asperity.runtime.notices import noting
from asperity.surface import Flat, Sinusoid, Sphere
from asperity.surface import fractal as fractal_module

STEEL = Material(200e9, 0.3, 1e9, 10e9)
ALUMINIUM = {"E": 1.0, "nu": 0.3, "yield_strength": 0.003, "tangent_modulus": 0.05}
YIELDING: dict[str, Any] = {
    "units": "other",
    "surface": {"kind": "sinusoid", "L": 1.0, "amplitude": 0.01},
    "material": ALUMINIUM,
    "mesh": {"h_contact": 0.4, "h_max": 1.0, "growth": 1.0},
    "loading": {"delta_max": 0.015, "steps": 3, "unload": True, "unload_steps": 1},
    "contact": {"gamma": 3.0},
}


def curve(**columns: float) -> Curve:
    """A light step, and one with the given values."""
    return Curve.from_rows([{"delta": 1e-9, "force": 1e-9}, {"delta": 1e-9, "force": 1e-9, **columns}])


# --- limits ---------------------------------------------------------------------------------------------------


def test_plastic_strain_beyond_small_strain() -> None:
    """At the limit the logarithmic strain is 5 % below the change of length."""
    assert 1 - np.log1p(SMALL_STRAIN) / SMALL_STRAIN == pytest.approx(0.05, abs=0.005)
    assert large_strain(curve(max_plastic_strain=0.999 * SMALL_STRAIN)) == ""
    assert "the plastic strain reaches 0.24, beyond 0.1" in large_strain(curve(max_plastic_strain=0.24))
    assert large_strain(curve(max_plastic_strain=1.001 * SMALL_STRAIN)) != ""
    assert large_strain(curve()) == ""  # unknown column
    assert large_strain(Curve.from_rows([])) == ""


@pytest.mark.parametrize("sides", ["rollers", "free"])
def test_mean_pressure_beyond_that_of_the_yielding_block(sides: str) -> None:
    side, limit = 1e-6, yield_pressure(STEEL, sides)
    assert limit == pytest.approx(1e9 * (0.7 / 0.4 if sides == "rollers" else 1.0))
    assert bulk_yield(curve(force=0.999 * limit * side**2), STEEL, side, sides) == ""
    assert f"beyond {limit:.3g}" in bulk_yield(curve(force=1.001 * limit * side**2), STEEL, side, sides)
    assert bulk_yield(curve(force=1e3 * limit * side**2), Material(200e9, 0.3), side, sides) == ""


@pytest.mark.parametrize(("sides", "nu"), [("rollers", 0.1), ("rollers", 0.3), ("free", 0.0)])
def test_a_plane_block_yields_at_that_pressure(sides: str, nu: float) -> None:
    """Computed by the solver, which does not use the limit: it is elastic just below, and yields just above.

    With free sides the clamped base leaves the stress uniform without lateral strain only.
    """
    from mpi4py import MPI

    material = Material(1.0, nu, 1e-3, 0.1)
    lame = material.E * nu / ((1 + nu) * (1 - 2 * nu))
    modulus = lame + material.E / (1 + nu) if sides == "rollers" else material.E
    for part in (0.99, 1.01):
        result = solve_contact(
            Flat(L=1.0), material, sides=sides, delta_max=part * yield_pressure(material, sides) / modulus, steps=1,
            integrator="backward-euler", size=MeshSize(0.5, 1.0, 1.0), comm=MPI.COMM_SELF,
        )  # fmt: skip
        yielded = float(result.curve.plastic_fraction[-1])
        assert yielded == pytest.approx(1.0 if part > 1 else 0.0, abs=1e-12)
        assert bool(bulk_yield(result.curve, material, 1.0, sides)) == (part > 1)


def test_approach_beyond_the_mean_plane() -> None:
    """A cosine rises above its mean by its amplitude, a shallow cap in the middle of the patch by L^2/(12 R)."""
    wave = Sinusoid(L=1e-6, amplitude=1e-8, dims=2)
    assert beyond_mean_plane(curve(delta=0.999e-8), wave) == ""
    assert "1e-08 below its summit" in beyond_mean_plane(curve(delta=1.001e-8), wave)
    cap = Sphere(L=1.0, radius=10.0, shape="paraboloid")
    depth = 1 / 120  # mean of (x^2 + y^2)/(2 R) over the square of side 1
    assert beyond_mean_plane(curve(delta=0.999 * depth), cap) == ""
    assert beyond_mean_plane(curve(delta=1.001 * depth), cap) != ""
    assert beyond_mean_plane(curve(delta=0.5), Flat(L=1.0)) == ""
    assert beyond_mean_plane(Curve.from_rows([]), wave) == ""


def test_all_assumptions_are_checked() -> None:
    far = curve(delta=1e-7, force=1.0, max_plastic_strain=0.5)
    found = departures(far, STEEL, Sinusoid(L=1e-6, amplitude=1e-8), "rollers")
    assert len(found) == 3 and all("beyond" in text for text in found)
    assert departures(curve(max_plastic_strain=0.05), STEEL, Sinusoid(L=1e-6, amplitude=1e-8), "rollers") == []


# --- in the files of a run ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def warned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """A run beyond two limits, with an unused key; and its warnings."""
    folder = tmp_path_factory.mktemp("warned") / "out"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run(Case.from_dict({**YIELDING, "output": {"report": True}}), folder)
    return folder, [str(w.message) for w in caught if issubclass(w.category, AsperityWarning)]


def test_warnings_are_in_summary_log_and_report(warned: tuple[Path, list[str]]) -> None:
    folder, shown = warned
    assert len(shown) == len(set(shown)) == 3
    for text, part in zip(shown, ("contact.gamma = 3", "the mean pressure reaches", "the flat has moved"), strict=True):
        assert part in text
    assert json.loads((folder / "summary.json").read_text())["warnings"] == shown
    log = (folder / "run.log").read_text()
    assert all(log.count(f"warning: {text}") == 1 for text in shown)
    html = (folder / "report.html").read_text(encoding="utf-8")
    box = html[html.index('class="warnings"') : html.index("</section>")]
    assert all(text in box for text in shown)
    assert all(html.count(text) == 1 for text in shown)


def test_the_report_of_a_finished_run_shows_its_warnings(warned: tuple[Path, list[str]]) -> None:
    page = Page(warned[0] / "report.html")
    assert "finished yes" in page.text and "finished no" not in page.text
    assert json.loads((warned[0] / "summary.json").read_text())["finished"] is True


def test_the_report_of_a_missed_tolerance_says_so(tmp_path: Path) -> None:
    case = {
        "units": "other",
        "surface": {"kind": "sphere", "L": 1.0, "radius": 1.5},
        "material": {"E": 1.0, "nu": 0.3},
        "loading": {"delta_max": 0.02, "steps": 2},
        "accuracy": {"tolerance": 1e-4, "max_dofs": 30_000},
        "output": {"report": True},
    }
    with pytest.raises(ConvergenceError, match=r"accuracy\.max_dofs = 30000 allows no more"):
        run(Case.from_dict(case), tmp_path)
    text = Page(tmp_path / "report.html").text
    assert "finished no" in text and "met no" in text and "allows no more" in text and "finished yes" not in text


def test_a_run_without_warnings_has_no_box(tmp_path: Path) -> None:
    quiet = {k: v for k, v in YIELDING.items() if k != "contact"} | {
        "material": {"E": 1.0, "nu": 0.3},
        "loading": {"delta_max": 0.005, "steps": 1},
        "output": {"report": True},
    }
    assert run(Case.from_dict(quiet), tmp_path).summary["warnings"] == []
    assert "Warnings" not in Page(tmp_path / "report.html").text


def test_a_resumed_run_keeps_its_warnings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped, continued, and called again after its end; the curve is checked at the end, not before."""
    from asperity.runtime import interrupt

    def attempt() -> list[str]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return list(run(Case.from_dict(YIELDING), tmp_path / "out", resume=True).summary["warnings"])

    answers = iter(["", "", "", "", "the test"])
    with monkeypatch.context() as patch:
        patch.setattr(interrupt.StopRequest, "agreed", lambda self: next(answers))
        with pytest.raises(Interrupted, match="stopped by the test after step"):
            attempt()
    stopped = json.loads((tmp_path / "out/summary.json").read_text())
    assert 0 < stopped["steps"] and len(stopped["warnings"]) == 1
    went_on = attempt()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        straight = run(Case.from_dict(YIELDING)).summary["warnings"]
    assert went_on == straight == attempt() and len(straight) == 3


def test_an_unresolved_contact_warns_once(tmp_path: Path) -> None:
    case = {
        **YIELDING,
        "surface": {"kind": "sphere", "L": 1.0, "radius": 3.0},
        "material": {"E": 1.0, "nu": 0.3},
        "loading": {"delta_max": 1e-3, "steps": 1},
    }
    with pytest.warns(ResolutionWarning, match="touches a few facets only") as caught:
        result = run(Case.from_dict(case), tmp_path)
    assert len([w for w in caught if issubclass(w.category, ResolutionWarning)]) == 1
    (text,) = (text for text in result.summary["warnings"] if "facets" in text)
    assert text == f"{result.summary['unresolved']}; make mesh.h_contact smaller"


# --- collecting -----------------------------------------------------------------------------------------------


def world() -> Any:
    from mpi4py import MPI

    return MPI.COMM_WORLD


@pytest.mark.mpi
def test_a_warning_of_any_rank_is_known_to_all_and_shown_once() -> None:
    comm = world()
    with warnings.catch_warnings(record=True) as caught, noting(comm) as notices:
        for _ in range(2):
            warnings.warn("of all", AssumptionWarning, stacklevel=1)
            warnings.warn(f"of rank {comm.rank}", ResolutionWarning, stacklevel=1)
        notices.share()
        notices.share()
        last = ["of one, later"] if comm.rank == comm.size - 1 else []
        for text in last:
            warnings.warn(text, AssumptionWarning, stacklevel=1)
        notices.share()
    wanted = ["of all", *(f"of rank {k}" for k in range(comm.size)), "of one, later"]
    assert notices.texts == wanted
    shown = [str(w.message) for w in caught]
    assert shown == (wanted if comm.rank == 0 else [])


def test_the_filters_of_the_caller_decide_what_is_shown(caplog: pytest.LogCaptureFixture) -> None:
    """They do not decide which warnings are recorded; warnings of other packages are not recorded."""

    def warn() -> list[str]:
        with noting(world()) as notices:
            warnings.warn("ours", AssumptionWarning, stacklevel=1)
            warnings.warn("another's", UserWarning, stacklevel=1)
        return notices.texts

    caplog.set_level(logging.INFO, "asperity")
    for action, shown in (("always", ["ours", "another's"]), ("ignore", [])):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter(action)
            before = list(warnings.filters), warnings.showwarning
            assert warn() == ["ours"]
            assert (list(warnings.filters), warnings.showwarning) == before
        assert [str(w.message) for w in caught] == shown
    assert [r.message for r in caplog.records] == ["warning: ours"] * 2
    with warnings.catch_warnings():
        warnings.simplefilter("error", AssumptionWarning)
        with pytest.raises(AssumptionWarning, match="ours"):
            warn()
    with warnings.catch_warnings(record=True) as caught:  # one per run, from the same line
        warnings.simplefilter("default")
        for _ in range(3):
            assert warn() == ["ours"]
    assert [str(w.message) for w in caught].count("ours") == 3


# --- work done once -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("loading", [{"delta_max": 0.01}, {"force_max": 1e-4}], ids=["approach", "force"])
def test_the_summit_is_searched_once_in_a_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, loading: dict[str, float]
) -> None:
    """Checks, mesh, solver and the figures of surface and mesh share the result."""
    searched: list[object] = []
    true_search = fractal_module.highest_point

    def search(surface: fractal_module.WeierstrassMandelbrot, *waves: Any) -> tuple[float, float, float]:
        searched.append(surface)
        return true_search(surface, *waves)

    monkeypatch.setattr(fractal_module, "highest_point", search)
    case = {
        "units": "other",
        "surface": {"kind": "weierstrass-mandelbrot", "L": 1.0, "D": 2.3, "G": 1e-7, "f_max": 3},
        "material": {"E": 1.0, "nu": 0.3},
        "mesh": {"h_contact": 0.3, "growth": 1.0, "h_max": 0.6},
        "loading": {**loading, "steps": 1},
        "output": {"figures": True, "report": True, "snapshots": 1},
    }
    run(Case.from_dict(case), tmp_path)
    assert {path.stem for path in (tmp_path / "figures").iterdir()} >= {"surface", "mesh", "curve"}
    assert len(searched) == 1
