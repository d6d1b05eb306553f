"""Studies: contents of a file, running and continuing its cases, and their evaluation."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from conftest import CLEAN, call

from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import AsperityWarning, InputError
from asperity.job.run_case import run
from asperity.study import Study, case_folder, run_study
from asperity.study.run import DONE, summarise_case
from asperity.surface import SurfaceWarning

ROOT = Path(__file__).parents[2]

# a wavy surface in some 500 dofs: seconds for a whole study
BASE: dict[str, Any] = {
    "units": "other",
    "surface": {"kind": "sinusoid", "L": 1.0, "amplitude": 0.05, "dims": 2},
    "material": {"E": 1.0, "nu": 0.3, "yield_strength": 0.01, "tangent_modulus": 0.05},
    "mesh": {"h_contact": 0.4, "h_max": 1.0, "growth": 1.0},
    "loading": {"delta_max": 0.02, "steps": 6},
}
ROUGH = {"kind": "weierstrass-mandelbrot", "L": 1.0, "D": 2.4, "G": 1.36e-5}


def study(**tables: Any) -> Study:
    """A study of BASE."""
    return Study.from_dict({"base": BASE} | tables)


def test_a_grid_is_every_combination_and_an_empty_text_removes_a_key() -> None:
    """Also of keys that vary together, and of keys without quotes."""
    together = {"material.yield_strength, material.tangent_modulus": [[0.01, 0.05], ["", ""]]}
    made = study(grid={"block.height": [1.0, 2.0]} | together)
    found = [tuple(map(e.value, made.keys)) for e in made.entries]
    assert made.keys == ("block.height", "material.yield_strength", "material.tangent_modulus")
    assert found == [(1.0, 0.01, 0.05), (1.0, None, None), (2.0, 0.01, 0.05), (2.0, None, None)]
    assert BASE["material"]["tangent_modulus"] == 0.05
    made = study(grid={"block": {"height": [1.0, 2.0]}})
    assert [e.value("block.height") for e in made.entries] == [1.0, 2.0]
    seeds = study(base=BASE | {"surface": ROUGH}, grid={"surface.seed": {"first": 3, "count": 2}})
    assert [e.value("surface.seed") for e in seeds.entries] == [3, 4]


@pytest.mark.filterwarnings("ignore:surface")
def test_a_study_of_cut_offs_with_unrelated_surfaces_warns() -> None:
    rough = BASE | {"surface": ROUGH}
    with pytest.warns(SurfaceWarning, match='surface.drawing = "nested" adds waves to the same surface'):
        study(base=rough, grid={"surface.f_max": [4, 5]})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = study(base=rough, grid={"surface.f_max": [4, 5], "surface.drawing": ["nested"]})
    waves = [e.case.build_surface().phases for e in made.entries]  # type: ignore[attr-defined]
    np.testing.assert_array_equal(waves[0], waves[1][:, :5])


MANY = {"block.height": list(range(1, 400)), "material.nu": [i / 1000 for i in range(400)]}
MISTAKES: list[tuple[dict[str, Any], str]] = [
    ({}, "nothing varies"), ({"grit": {}}, 'did you mean "grid"'), ({"grid": {}}, "nothing varies"),
    ({"points": [{"block.height": 1.0}]}, "not a key of the study file"), ({"grid": MANY}, "at most"),
    ({"grid": {"surface.amplitud": [0.1]}}, 'did you mean "amplitude"'),
    ({"grid": {"surface.amplitude": 0.1}}, "is not an axis"), ({"grid": {"surface.amplitude": []}}, "empty list"),
    ({"grid": {"surface.amplitude": [0.1, 0.1]}}, "twice"),
    ({"grid": {"material.nu": [0.3, 0.7]}}, "material.nu = 0.7"),
    ({"grid": {"surface.amplitude": {"from": 0, "to": 1, "count": 3, "log": True}}}, "is not an axis"),
    ({"grid": {"surface.seed": {"first": 0, "count": 10_000_000}}}, "is not an axis"),
    ({"grid": {"block.height, material.nu": [1.0, 2.0]}}, "2 values each"),
    ({"grid": {"block.height, material.nu": [[1.0, 0.2], [2.0]]}}, "2 values each"),
    ({"grid": {"block.height": [1.0], "block.height, material.nu": [[1.0, 0.3]]}}, "give it once"),
]  # fmt: skip


@pytest.mark.parametrize(("tables", "words"), MISTAKES)
def test_each_mistake_is_one_sentence(tables: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as error:
        study(**tables)
    assert words in str(error.value) and "\n" not in str(error.value)


def test_a_missing_base_is_named(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text('base = "gone.toml"\n[grid]\n"surface.D" = [2.4]\n')
    with pytest.raises(InputError, match=r"gone\.toml"):
        Study.load(path)


def test_a_study_is_run_continued_and_tabled(tmp_path: Path) -> None:
    tables = {"material.tangent_modulus": [0.01, 0.1], "block.height": [1.0, 0.04]}
    made = study(grid=tables)
    lines: list[str] = []
    counts = run_study(made, tmp_path / "out", say=lines.append)
    # the valley of the wave is deeper than the low block; the failure is recorded and the study continues
    assert (counts.cases, counts.done, counts.failed, counts.run) == (4, 2, 2, 4)
    assert len(lines) == 4 and sum("FAILED" in line for line in lines) == 2
    again = run_study(made, tmp_path / "out", say=lines.append)
    assert (again.done, again.failed, again.run, len(lines)) == (2, 2, 2, 6)  # what has failed is tried again

    with (tmp_path / "out/results.csv").open() as file:
        rows = list(csv.DictReader(file))
    soft, hard = (row for row in rows if row["exit_reason"] == "done")
    assert soft["material.tangent_modulus"] == "0.01" and hard["material.tangent_modulus"] == "0.1"
    assert float(soft["P_star_max"]) < float(hard["P_star_max"])
    failed = [r["exit_reason"] for r in rows if r["block.height"] == "0.04"]
    assert len(failed) == 2 and all(f.startswith("MeshError") and "deepest valley" in f for f in failed)
    place = case_folder(tmp_path / "out", soft["case"])
    curve = Curve.read(place / "curve.csv")
    assert len(curve.planned()) == 6 <= len(curve)
    assert (float(soft["k"]), float(soft["n"])) == (curve.fit().k, curve.fit().n)
    assert float(soft["force"]) == curve.force[-1] and float(soft["k_n"]) == curve.k_n[-1]
    assert Case.load(place / "case.toml").material.tangent_modulus == 0.01
    alone = run(next(e.case for e in made.entries if e.key == soft["case"]))
    np.testing.assert_allclose(alone.curve.force, curve.force, rtol=1e-9)


def test_a_case_warns_in_a_study_as_it_does_alone(tmp_path: Path) -> None:
    """The elements are too coarse for the waves of this surface."""
    rough = BASE | {"surface": ROUGH, "loading": {"delta_max": 0.002, "steps": 1}}
    made = study(base=rough, grid={"material.tangent_modulus": [0.01]})
    with pytest.warns(AsperityWarning) as caught:
        run_study(made, tmp_path / "out")
    with pytest.warns(AsperityWarning):
        alone = run(made.entries[0].case, tmp_path / "alone")
    assert not any("is not used" in str(w.message) for w in caught)
    place = case_folder(tmp_path / "out", made.entries[0].key)
    summary = json.loads((place / "summary.json").read_text())
    assert summary["warnings"] == alone.summary["warnings"]
    assert any("waves shorter than" in text for text in summary["warnings"])
    assert (place / "case.toml").read_text() == (tmp_path / "alone/case.toml").read_text()


def test_a_folder_with_other_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(InputError, match="holds no study"):
        run_study(study(grid={"block.height": [1.0]}), tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_two_jobs_do_not_work_in_one_folder(tmp_path: Path) -> None:
    made, messages = study(grid={"block.height": [1.0, 2.0]}), []

    def start_another(line: str) -> None:
        with pytest.raises(InputError, match="another process works in") as error:
            run_study(made, tmp_path / "out")
        messages.append(str(error.value))

    assert run_study(made, tmp_path / "out", say=start_another).done == 2
    assert len(messages) == 2
    assert run_study(made, tmp_path / "out").run == 0


def test_a_failed_case_is_listed_and_the_exit_code_is_3(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Also where a later call finds the failure in the folder."""
    path, out = tmp_path / "s.toml", tmp_path / "out"
    base = BASE | {"loading": {"delta_max": 0.005, "steps": 1}, "solver": {"newton_max": 15}}
    grid = {"block.height, material.nu": [[1.0, 0.3], [0.021, 0.25]]}  # the valleys reach the base
    path.write_text(tomli_w.dumps({"base": base, "grid": grid}))
    for _ in range(2):
        assert call("study", path, "-o", out) == 3
        printed, errors = capsys.readouterr()
        failed = [line for line in printed.splitlines() if "FAILED MeshError" in line]
        assert len(failed) == 1 and "height 0.021, nu 0.25" in failed[0]
        assert errors.splitlines()[-1].startswith("error: 1 of 2 cases failed; see exit_reason")
    assert call("study", path, "-o", out, "--quiet") == 3
    assert capsys.readouterr().out == ""


def on_two_ranks(path: Path, out: Path, *options: str) -> str:
    """Output of `asperity study` on two ranks."""
    command = ["mpirun", "-n", "2", sys.executable, "-m", "asperity", "study", str(path), "-o", str(out), *options]
    done = subprocess.run(command, env=CLEAN, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_two_ranks_continue_a_study_of_one_rank(tmp_path: Path) -> None:
    path, out = tmp_path / "s.toml", tmp_path / "out"
    base = BASE | {"block": {"sides": "free"}, "loading": {"delta_max": 0.01, "steps": 1}}
    path.write_text(tomli_w.dumps({"base": base, "grid": {"material.tangent_modulus": [0.01, 0.05, 0.1]}}))
    assert run_study(study(base=base, grid={"material.tangent_modulus": [0.05]}), out).done == 1
    printed = on_two_ranks(path, out)
    assert "3 of 3 cases done, 0 failed, 2 run now" in printed
    with (out / "results.csv").open() as file:
        loads = [float(row["P_star_max"]) for row in csv.DictReader(file)]
    assert loads == sorted(loads) and len(loads) == 3


def test_the_results_of_an_exact_power_law() -> None:
    delta = np.linspace(0, 0.03, 13)[1:]
    rows = [{"delta": d, "delta_star": d, "P_star": 2.0 * d**2.2, "force": 2.0 * d**2.2 / 0.91} for d in delta]
    full = {"area_fraction": 0.5, "plastic_fraction": 0.1, "max_plastic_strain": 0.02}
    row = summarise_case(Curve.from_rows([full | row for row in rows]), {"dofs": 7})
    assert (row["k"], row["n"], row["P_star_max"]) == pytest.approx((2.0, 2.2, 2.0 * 0.03**2.2))
    assert row["force"] == pytest.approx(row["P_star_max"] / 0.91) and row["area_fraction"] == 0.5
    assert row["dofs"] == 7 and row["error_P_star"] is None


SMALL = BASE | {"output": {"figures": False, "report": False}}
ONE = {"block.height": [1.0]}
MANY_STEPS = {"mesh": {"h_contact": 0.2, "h_max": 0.5}, "loading": {"delta_max": 0.02, "steps": 12}}


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> Curve:
    """Curve of the case of MANY_STEPS, never stopped."""
    made, out = study(base=SMALL | MANY_STEPS, grid=ONE), tmp_path_factory.mktemp("straight")
    assert run_study(made, out).done == 1
    return Curve.read(case_folder(out, made.entries[0].key) / "curve.csv")


def test_a_stopped_case_continues_and_is_no_failure(tmp_path: Path, straight: Curve) -> None:
    """As a scheduler ends a job that is out of time."""
    made, out, path = study(base=SMALL | MANY_STEPS, grid=ONE), tmp_path / "out", tmp_path / "s.toml"
    path.write_text(tomli_w.dumps({"base": SMALL | MANY_STEPS, "grid": ONE}))
    place = case_folder(out, made.entries[0].key)
    command = [sys.executable, "-m", "asperity", "study", str(path), "-o", str(out)]
    process = subprocess.Popen(command, env=CLEAN, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 120
    while not ((place / "checkpoint/state.npz").exists() and (place / "curve.csv").exists()):
        assert time.monotonic() < end and process.poll() is None, process.communicate()
        time.sleep(0.02)
    process.terminate()
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 3, errors
    assert not (place / DONE).exists()
    assert 0 < len(Curve.read(place / "curve.csv")) < len(straight)
    saved = place / "checkpoint/mesh.npz"
    begun = saved.stat().st_mtime_ns
    counts = run_study(made, out)
    assert (counts.done, counts.failed, counts.run) == (1, 0, 1)
    assert saved.stat().st_mtime_ns == begun  # a new start writes its mesh
    np.testing.assert_array_equal(Curve.read(place / "curve.csv").force, straight.force)


def test_a_saved_state_that_is_damaged_is_not_continued(tmp_path: Path) -> None:
    made = study(grid=ONE)
    assert run_study(made, tmp_path).done == 1
    place = case_folder(tmp_path, made.entries[0].key)
    (place / DONE).unlink()
    (place / "summary.json").unlink()
    state = place / "checkpoint/state.npz"
    state.write_bytes(state.read_bytes()[:-100])
    assert run_study(made, tmp_path).done == 1
