"""A case from its file to its results: what is written, what is left alone, exit codes, units."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from conftest import call, files, leave_figures_blank

import asperity
from asperity.adaptive.meshes import LevelSolver
from asperity.case import Case
from asperity.curve import COLUMNS, Curve
from asperity.curve.power_law import with_misfit
from asperity.curve.slope import planned_rows
from asperity.errors import ConvergenceError, MeshError, OutputError
from asperity.job.run_case import RunResult, run
from asperity.job.stages import _evidence
from asperity.mesh.block import BlockMesh
from asperity.output.results import Results
from asperity.reference import radiation_loss
from asperity.runtime.run_folder import PRODUCTS
from asperity.vibration import PowerLaw, law_from

pytestmark = pytest.mark.usefixtures("blank_figures")

SURFACE: dict[str, Any] = {"kind": "weierstrass-mandelbrot", "L": 1e-6, "D": 2.4, "G": 1.36e-11}
STEEL: dict[str, Any] = {"E": 200e9, "nu": 0.3, "yield_strength": 1e9, "tangent_modulus": 10e9}
MESH: dict[str, Any] = {"h_contact": 0.2e-6, "growth": 0.6, "h_max": 0.5e-6}
LOADING: dict[str, Any] = {"delta_max": 0.03e-6, "steps": 6, "unload": True, "unload_steps": 3}
CASE: dict[str, Any] = {"surface": SURFACE, "material": STEEL, "mesh": MESH, "loading": LOADING}


def case_of(**sections: Mapping[str, Any] | str) -> Case:
    return Case.from_dict({**CASE, **sections})


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RunResult]:
    """A run with everything a case can ask for."""
    folder = tmp_path_factory.mktemp("full") / "new" / "folder"
    everything = {"figures": True, "fields": True, "report": True, "snapshots": 2}
    everything |= {"stiffness": True}
    dynamics = {"law": "paper", "zeta": 0.05, "forcing": [0.02], "model": ["exact"]}
    material = CASE["material"] | {"density": 7800.0}
    case = case_of(material=material, output=everything, dynamics=dynamics)
    with pytest.MonkeyPatch.context() as patch:
        leave_figures_blank(patch)
        return folder, run(case, folder)


def test_only_a_run_on_one_mesh_is_judged_by_the_size_of_its_elements() -> None:
    """Also where a run with a tolerance has stopped before it has a bar."""
    for accuracy, h in (({}, 0.2e-6), ({"tolerance": 0.05}, None)):
        case = case_of(accuracy=accuracy)
        solved = SimpleNamespace(accurate=None, strain=None, contact=SimpleNamespace(curve=None), problem=None)
        job: Any = SimpleNamespace(case=case, solved=solved, numbers=None)
        assert _evidence(job, None).h == h


# --- files ----------------------------------------------------------------------------------------------------


def test_files_of_a_run(full: tuple[Path, RunResult]) -> None:
    folder, _ = full
    files = {str(p.relative_to(folder)) for p in folder.rglob("[!.]*") if p.is_file()}
    promised = ("case.toml curve.csv summary.json run.log free.csv response.csv thresholds.json "
                "report.html fields/top.npz fields/contact.vtkhdf")  # fmt: skip
    assert files >= {*promised.split()} and "figures/curve.svg" in files
    assert {name for name in files if not name.startswith("checkpoint/")} <= set(PRODUCTS)  # which --force removes


def test_stored_curve_is_the_one_returned(full: tuple[Path, RunResult]) -> None:
    folder, result = full
    stored = Curve.read(folder / "curve.csv")
    for column in COLUMNS:
        np.testing.assert_array_equal(getattr(stored, column), getattr(result.curve, column))
    loading = stored.loading()
    assert list(stored.branch) == ["load"] * len(loading) + ["unload"] * (len(stored) - len(loading))
    np.testing.assert_allclose(stored.delta_star * SURFACE["L"], stored.delta, rtol=8 * np.finfo(float).eps)
    prime = STEEL["E"] / (1 - STEEL["nu"] ** 2)
    force = stored.P_star * prime * SURFACE["L"] ** 2
    np.testing.assert_allclose(force, stored.force, rtol=8 * np.finfo(float).eps)  # of five products
    for planned in LOADING["delta_max"] * np.arange(1, 7) / 6:  # the first steps are cut to pieces
        assert np.min(np.abs(loading.delta / planned - 1)) < 1e-14
    assert np.all(np.diff(loading.force) > 0) and stored.force[-1] == 0.0
    assert 1e9 < stored.max_pressure.max() < 10e9  # between yield strength and some hardnesses, in Pa
    assert np.all(stored.seconds > 0) and np.all(stored.newton > 0)


QUIET: dict[str, Any] = {
    "loading": {"delta_max": 0.01e-6, "steps": 1},
    "material": {"E": 200e9, "nu": 0.3},
    "output": {"figures": False, "report": False},
}


def test_a_run_that_is_refused_on_its_way_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exit code 2 after a first mesh, whose steps were saved; files of other origin stay."""
    solve, out, calls = LevelSolver.press, tmp_path / "out", []

    def refuse(*arguments: Any) -> Any:
        calls.append(arguments)
        if len(calls) % 2 == 0:
            assert (out / "case.toml").is_file() and (out / "checkpoint").is_dir()
            raise MeshError("the second mesh cannot be made")
        return solve(*arguments)

    monkeypatch.setattr(LevelSolver, "press", refuse)
    case = case_of(surface={"kind": "flat", "L": 1e-6}, **QUIET, mesh={}, accuracy={"tolerance": 0.1})
    with pytest.raises(MeshError, match="the second mesh"):
        run(case, out)
    assert not out.exists()


def test_a_preload_beyond_the_curve_keeps_the_curve(tmp_path: Path) -> None:
    """Only the curve tells that it is too great: the exit code is not that of input that was refused."""
    for sections in (
        {"dynamics": {"law": "paper", "preload": 0.1, "model": ["exact"]}},
        {"slip": {"friction": 0.3, "preload": 0.1}},
    ):
        out = tmp_path / next(iter(sections))
        with pytest.raises(ConvergenceError, match="the curve is kept") as caught:
            run(case_of(**QUIET, **sections), out)
        assert caught.value.exit_code == 3
        summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
        assert summary["finished"] is False and summary["exit_reason"] == str(caught.value)
        assert len(Curve.read(out / "curve.csv")) >= 1


@pytest.mark.parametrize(("method", "saved"), [("curve.Curve.write", True), ("output.run_files.remove_asides", False)])
def test_a_full_disk_mentions_a_saved_state_only_where_there_is_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: str, saved: bool
) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device", "curve.csv")

    monkeypatch.setattr(f"asperity.{method}", full)
    with pytest.raises(OutputError, match="No space left") as caught:
        run(case_of(**QUIET), tmp_path / "out")
    assert ("--resume continues from the last step saved" in str(caught.value)) == saved


def test_the_assumptions_take_the_vibration_that_was_computed() -> None:
    """A joint with a mass only leaves the preload to [dynamics]."""
    dynamics = {
        "law": "paper",
        "model": ["exact"],
        "preload": 5e-5,
        "omega": [0.9, 0.95],
        "zeta": 0.2,
        "simulate": ["half-sine"],
    }
    quiet = {"figures": False, "report": False}
    material = CASE["material"] | {"density": 7800.0}
    case = case_of(material=material, joint={"mass": 1e-12}, dynamics=dynamics, output=quiet)
    result = run(case)
    assert result.dynamics.first.load == pytest.approx(5e-5)
    lines = {line["name"]: line for line in result.summary["assumptions"]}
    radiated, found, solid = lines["inertia: damping ratio by radiation"], result.dynamics.numbers, case.material
    eta = radiation_loss(found.stiffness, 2 * np.pi * found.frequency, E=solid.E, nu=solid.nu, density=7800.0)
    assert radiated["value"] == pytest.approx(0.5 * eta) and radiated["detail"].startswith("the model has 0.2")


def test_summary(full: tuple[Path, RunResult]) -> None:
    folder, result = full
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["exit_reason"] == "done" and summary["finished"] is True
    fit = summary["fit"]
    assert {"k", "n", "range", "points", "r2", "ci"} <= set(fit)
    load = result.curve.loading()
    planned = load.where(planned_rows(load.delta))
    assert fit["points"] == len(planned) == 6 and fit["range"] == pytest.approx([0.005, 0.03])
    refit = asperity.fit_power_law(planned.delta_star, planned.P_star)
    assert (fit["k"], fit["n"]) == pytest.approx((refit.k, refit.n))
    assert summary["dofs"] > 1000 and summary["cells"] > 100 and summary["ranks"] == 1
    assert summary["steps"] == len(result.curve)
    assert summary["newton"] >= result.curve.newton.sum()
    assert summary["seed"] == 0
    checks, load = summary["checks"], result.curve.loading()
    assert checks["force_balance"] < 1e-6 and checks["violated"] == {}
    # in the units of the case
    assert checks["greatest_force"] == pytest.approx(load.force.max(), rel=1e-12)
    force, delta = np.append(0.0, load.force), np.append(0.0, load.delta)
    work = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(delta))
    assert checks["work_at_peak"] == pytest.approx(work, rel=1e-9) and checks["peak"] == pytest.approx(work, rel=0.05)
    assert 0.0 <= checks["penetration"] < 1e-6 * load.delta[-1]
    assert checks["units"]["greatest_force"] == "force" and checks["units"]["work"] == "force*length"
    assert summary["case_hash"] == Case.load(folder / "case.toml").hash()
    parallel, seconds = summary["parallel"], summary["seconds"]
    assert min(parallel["peak_memory_MiB"]) > 10 and seconds.keys() > {"mesh", "tangent", "residual", "linear solve"}
    assert parallel["slowest_seconds"] == {name: pytest.approx(value, abs=1e-3) for name, value in seconds.items()}


def test_one_power_law_in_all_that_a_run_leaves(full: tuple[Path, RunResult], tmp_path: Path) -> None:
    """Some steps of the run were cut to pieces: a fit that takes these as well gives another exponent."""
    folder, result = full
    curve, case = Curve.read(folder / "curve.csv"), Case.load(folder / "case.toml")
    fit = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["fit"]
    n, K = fit["n"], fit["k"] * case.material.reduced_modulus * SURFACE["L"] ** (2 - fit["n"])
    load = curve.loading()
    every = asperity.fit_power_law(load.delta_star, load.P_star)
    assert len(load) > fit["points"] and abs(every.n / n - 1) > 1e-3

    of_mass = json.loads((folder / "thresholds.json").read_text(encoding="utf-8"))
    assert of_mass["n_loc"] == pytest.approx(n, rel=1e-12)
    assert of_mass["load"] / of_mass["z_s"] ** n == pytest.approx(K, rel=1e-12)
    bare = tmp_path / "bare.csv"
    pairs = zip(load.delta, load.force, strict=True)
    bare.write_text("delta,force\n" + "".join(f"{1e6 * d:.17g},{1e3 * f:.17g}\n" for d, f in pairs))  # in um and mN
    for source, length, force in ((folder, 1.0, 1.0), (curve, 1.0, 1.0), (result.curve, 1.0, 1.0), (bare, 1e6, 1e3)):
        law = law_from(source, "paper")[0]
        assert isinstance(law, PowerLaw) and law.n == pytest.approx(n, rel=1e-12)
        assert float(law.force(0.02e-6 * length)) == pytest.approx(force * K * 0.02e-6**n, rel=1e-12)
        assert law.known_to == pytest.approx(length * 0.03e-6, rel=1e-12)
    assert f"{with_misfit(fit)[1]} (misfit of the fit)" in (folder / "report.html").read_text(encoding="utf-8")


def test_fields(full: tuple[Path, RunResult]) -> None:
    folder, result = full
    L = SURFACE["L"]
    with np.load(folder / "fields" / "top.npz") as top:
        assert list(top["branch"]) == ["load", "load"]
        np.testing.assert_allclose(top["delta"], [0.015e-6, 0.03e-6])
        at = top["steps"] - 1
        np.testing.assert_allclose(top["delta"], result.curve.delta[at])
        np.testing.assert_allclose(top["pressure"].max(axis=1), result.curve.max_pressure[at])
        assert top["gap"].min() >= 0.0 and top["gap"].max() < 0.3 * L
        x, triangles = top["points"], top["triangles"]
        a, b, c = (x[triangles[:, k]] for k in range(3))
        areas = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        assert areas.sum() == pytest.approx(L**2)
        for k, force in enumerate(result.curve.force[at]):
            pressure = top["pressure"][k][triangles].mean(axis=1)
            assert areas @ pressure == pytest.approx(force, rel=1e-9)


def test_a_saved_mesh_is_used(tmp_path: Path, full: tuple[Path, RunResult]) -> None:
    _, result = full
    assert result.contact is not None and result.contact.block is not None
    result.contact.block.save(tmp_path / "block.npz")
    again = run(case_of(mesh={**MESH, "file": str(tmp_path / "block.npz")}))
    np.testing.assert_array_equal(again.curve.force, result.curve.force)
    with pytest.raises(MeshError, match=r"mesh\.file: the mesh has the height 1e-06, block\.height is 2e-06"):
        run(case_of(mesh={**MESH, "file": str(tmp_path / "block.npz")}, block={"height": 2e-6}))
    with pytest.raises(MeshError, match=r"mesh\.file: the top of the mesh is not this surface"):
        run(case_of(mesh={**MESH, "file": str(tmp_path / "block.npz")}, surface={**SURFACE, "seed": 1}))


# --- failures -------------------------------------------------------------------------------------------------


def test_resumed_with_more_dofs_the_meshes_are_those_of_a_fresh_run(tmp_path: Path) -> None:
    """The saved level of a mesh that the old limit had made coarser is not taken for the finer one."""

    def attempt(max_dofs: int, name: str, resume: bool = False) -> list[int]:
        case = case_of(
            surface={"kind": "sphere", "L": 1.0, "radius": 3.0, "centre": [0.3, 0.4]},
            material={"E": 1.0, "nu": 0.3},
            mesh={},
            loading={"delta_max": 0.01, "steps": 2},
            accuracy={"tolerance": 1e-4, "max_dofs": max_dofs},
        )
        with pytest.raises(ConvergenceError, match="allows no more"):
            run(case, tmp_path / name, resume=resume)
        return [level["dofs"] for level in Results.read(tmp_path / name).summary["accuracy"]["levels"]]

    few = attempt(5_000, "limited")
    more = attempt(8_000, "limited", resume=True)
    assert max(few) <= 5_000 < more[-1]
    assert more == attempt(8_000, "fresh")


@pytest.mark.parametrize(("trouble", "older"), [("deep", True), ("another surface", False)])
def test_a_surface_that_cannot_be_meshed_leaves_the_folder_as_it_is(tmp_path: Path, trouble: str, older: bool) -> None:
    """Exit code 2: nothing has been written, and --force has removed nothing."""
    out = tmp_path / "out"
    if older:
        run(case_of(loading={"delta_max": 0.001e-6, "steps": 1}), out)
    before = files(out)
    deep = {"kind": "sphere", "L": 1e-6, "radius": 0.45e-6, "centre": [0.0, 0.0], "shape": "paraboloid"}
    block = BlockMesh(np.zeros((10, 3)), np.arange(10)[None, :], 1e-6, 1e-6)
    block.save(tmp_path / "other.npz")
    kinds: dict[str, dict[str, Any]] = {
        "deep": {"surface": deep},
        "another surface": {"mesh": {"file": str(tmp_path / "other.npz")}},
    }
    case = tmp_path / "case.toml"
    case.write_text(Case.from_dict({**CASE, **kinds[trouble], "units": "other"}).to_toml(), encoding="utf-8")
    assert call("run", case, "-o", out, "--force") == 2
    assert files(out) == before
    assert out.exists() == older


# --- units ----------------------------------------------------------------------------------------------------


def test_micrometres_and_gigapascal_give_the_curve_of_metres_and_pascal() -> None:
    def curve(length: float, stress: float) -> Curve:
        def scaled(section: Mapping[str, Any], unit: float, *keys: str) -> dict[str, Any]:
            return {k: v / unit if k in keys else v for k, v in section.items()}

        return run(
            Case.from_dict(
                {
                    "units": "other",
                    "surface": scaled(SURFACE, length, "L", "G"),
                    "material": scaled(STEEL, stress, "E", "yield_strength", "tangent_modulus"),
                    "mesh": scaled(MESH, length, "h_contact", "h_max"),
                    "loading": scaled(LOADING, length, "delta_max"),
                }
            )
        ).curve

    si, micro = curve(1.0, 1.0), curve(1e-6, 1e9)
    assert list(si.branch) == list(micro.branch)
    for column in ("delta_star", "P_star", "area_fraction", "plastic_fraction", "max_plastic_strain"):
        a, b = getattr(micro, column), getattr(si, column)
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-8 * np.max(b, initial=1e-300), err_msg=column)
    np.testing.assert_allclose(micro.force * 1e9 * 1e-12, si.force, rtol=1e-7, atol=1e-8 * si.force.max())
    np.testing.assert_allclose(micro.max_pressure * 1e9, si.max_pressure, rtol=0, atol=1e-6 * si.max_pressure.max())


def test_too_few_newton_steps_end_in_a_partial_curve(tmp_path: Path) -> None:
    """A true failure, without any help."""
    with pytest.raises(ConvergenceError, match=r"diverged_max_it after 3 Newton iterations"):
        run(case_of(solver={"newton_max": 3, "linear": "lu"}), tmp_path / "out")
    assert Curve.read(tmp_path / "out" / "curve.csv").delta_star[-1] < 0.03 - 1e-9
    log = (tmp_path / "out" / "run.log").read_text(encoding="utf-8")
    cutbacks = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["cutbacks"]
    assert log.count("given up after 3 Newton steps, diverged_max_it") == cutbacks > 1
    assert log.count("step cut to") == cutbacks - 1  # the last one ends the run


def test_the_patches_of_a_joint_are_pressed_by_its_nominal_pressure(monkeypatch: pytest.MonkeyPatch) -> None:
    """Preload over nominal area, whatever the patch is; the side of the joint is the root of that area."""
    asked: list[Any] = []

    def spread(_: Any, pressure: float) -> None:
        asked.append(pressure)

    def assumptions(evidence: Any) -> list[Any]:
        asked.append(evidence.side)
        return []

    monkeypatch.setattr("asperity.job.stages.spread_of_patches", spread)
    monkeypatch.setattr("asperity.job.stages.assumptions_of", assumptions)
    quiet = {"figures": False, "report": False}
    elastic, light = {"E": 200e9, "nu": 0.3}, {"delta_max": 0.01e-6, "steps": 2}
    joint = {"nominal_area": 4e-4, "preload": 1e3}
    run(case_of(material=elastic, loading=light, joint=joint, output=quiet))
    assert asked == pytest.approx([1e3 / 4e-4, 2e-2])
