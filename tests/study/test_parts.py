"""Parts of a study in jobs of their own: every case once, one table, also after signals and kills."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from asperity.cli import main
from asperity.curve import Curve
from asperity.errors import InputError
from asperity.study import Study, collect_study, run_study
from asperity.study.results import DONE, TABLE, case_folder
from asperity.study.run import part
from asperity.study.shared_mesh import mesh_key

BASE: dict[str, Any] = {
    "units": "other",
    "surface": {"kind": "sinusoid", "L": 1.0, "amplitude": 0.05, "dims": 2},
    "material": {"E": 1.0, "nu": 0.3, "yield_strength": 0.01, "tangent_modulus": 0.05},
    "mesh": {"h_contact": 0.4, "h_max": 1.0, "growth": 1.0},
    "loading": {"delta_max": 0.02, "steps": 3},
    "output": {"figures": False, "report": False},
}
GRID = {"material.tangent_modulus": [0.01, 0.05, 0.1], "block.height": [1.0, 2.0]}


def study(grid: dict[str, list[float]] = GRID, **base: Any) -> Study:
    return Study.from_dict({"base": BASE | base, "grid": grid})


def job(path: Path, out: Path, *options: str) -> subprocess.Popen[str]:
    """`asperity study` in a process of its own, not as a rank of the job that runs the tests."""
    environ = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_"))}
    command = [sys.executable, "-m", "asperity", "study", str(path), "-o", str(out), *options]
    return subprocess.Popen(command, env=environ, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def table(out: Path) -> list[dict[str, str]]:
    """Rows of the table without their times."""
    with (out / TABLE).open(newline="") as file:
        return [{k: v for k, v in row.items() if k != "seconds"} for row in csv.DictReader(file)]


@pytest.mark.parametrize("parts", [1, 2, 4, 6, 9])
def test_the_parts_are_the_study(parts: int) -> None:
    entries = study().entries
    found = [part(entries, i + 1, parts) for i in range(parts)]
    assert sorted(i for numbers in found for i in numbers) == list(range(6))
    assert max(map(len, found)) - min(map(len, found)) <= 1
    meshes = [{mesh_key(entries[i].case) for i in numbers} for numbers in found]
    if parts == 2:  # two heights of the block, two meshes
        assert [len(m) for m in meshes] == [1, 1] and not meshes[0] & meshes[1]


@pytest.mark.parametrize("wrong", [(0, 2), (3, 2), (1, 0)])
def test_a_part_that_does_not_exist_is_refused(wrong: tuple[int, int], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"is no part: the first is 1/"):
        run_study(study(), tmp_path / "out", only=wrong)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("text", ["3", "a/b", "-1/2", "1/2/3", "/2"])
def test_a_wrong_option_is_one_sentence(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["study", "s.toml", f"--only={text}"])
    assert left.value.code == 2
    assert f"{text} is no part; give I/N" in capsys.readouterr().err


def test_parts_at_the_same_time_give_the_table_of_the_whole_study(tmp_path: Path) -> None:
    path, out = tmp_path / "s.toml", tmp_path / "parts"
    path.write_text(tomli_w.dumps({"base": BASE, "grid": GRID}))
    jobs = [job(path, out, "--only", f"{i}/2") for i in (1, 2)]
    for process in jobs:
        printed, errors = process.communicate(timeout=300)
        assert process.returncode == 0, errors
        assert "of 2: " in printed
    assert not (out / TABLE).exists()  # parts leave it alone
    assert collect_study(study(), out).done == 6
    collected = table(out)
    whole = job(path, out)
    assert "6 of 6 cases done, 0 failed, 0 run now" in whole.communicate(timeout=300)[0]
    assert table(out) == collected
    assert run_study(study(), tmp_path / "whole").done == 6
    assert table(tmp_path / "whole") == collected


def test_a_case_of_another_job_is_left_to_it(tmp_path: Path) -> None:
    """Jobs of different divisions overlap: a case is computed by one of them only."""
    made, out = study({"material.tangent_modulus": [0.01, 0.05, 0.1]}), tmp_path / "out"
    key = made.entries[1].key
    out.mkdir()
    hold = f"""
import sys; from pathlib import Path; from asperity.study.locks import claimed
with claimed(Path({str(out)!r}), {key!r}) as mine:
    print(mine, flush=True); sys.stdin.read()
"""
    with subprocess.Popen(
        [sys.executable, "-c", hold], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None and other.stdout.readline() == "True\n"
        counts = run_study(made, out, only=(1, 1))
        assert (counts.cases, counts.done, counts.run) == (3, 2, 2)
        assert not case_folder(out, key).exists()
        other.kill()  # a killed job holds nothing
    counts = run_study(made, out, only=(2, 3))
    assert (counts.cases, counts.done, counts.run) == (1, 1, 1)
    assert run_study(made, out).done == 3


def test_a_whole_study_and_its_parts_exclude_each_other(tmp_path: Path) -> None:
    made, tried = study({"block.height": [1.0, 2.0]}), []

    def start(line: str, *kinds: tuple[int, int] | None) -> None:
        for only in kinds:
            with pytest.raises(InputError, match="is running"):
                run_study(made, tmp_path / "out", only=only)
            tried.append(only)

    assert run_study(made, tmp_path / "out", only=(1, 2), say=lambda line: start(line, None)).run == 1
    assert run_study(made, tmp_path / "out", say=lambda line: start(line, None, (2, 2))).run == 1
    assert tried == [None, None, (2, 2)]


ONE = {"block.height": [1.0]}
MANY_STEPS = {"mesh": {"h_contact": 0.2, "h_max": 0.5}, "loading": {"delta_max": 0.02, "steps": 12}}


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> Curve:
    """Curve of the case of MANY_STEPS, never stopped."""
    made, out = study(ONE, **MANY_STEPS), tmp_path_factory.mktemp("straight")
    assert run_study(made, out).done == 1
    return Curve.read(case_folder(out, made.entries[0].key) / "curve.csv")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_stopped_case_continues_and_is_no_failure(number: signal.Signals, tmp_path: Path, straight: Curve) -> None:
    """As a scheduler ends a job that is out of time."""
    made, out, path = study(ONE, **MANY_STEPS), tmp_path / "out", tmp_path / "s.toml"
    path.write_text(tomli_w.dumps({"base": BASE | MANY_STEPS, "grid": ONE}))
    place = case_folder(out, made.entries[0].key)
    process = job(path, out, "--only", "1/1")
    end = time.monotonic() + 120
    while not ((place / "checkpoint/state.npz").exists() and (place / "curve.csv").exists()):
        assert time.monotonic() < end and process.poll() is None, process.communicate()
        time.sleep(0.02)
    process.send_signal(number)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == (3 if number == signal.SIGTERM else -number), errors
    assert not (place / DONE).exists()
    assert 0 < len(Curve.read(place / "curve.csv")) < len(straight)
    saved = place / "checkpoint/mesh.npz"
    begun = saved.stat().st_mtime_ns
    counts = run_study(made, out, only=(1, 1))
    assert (counts.done, counts.failed, counts.run) == (1, 0, 1)
    assert saved.stat().st_mtime_ns == begun  # a new start writes its mesh
    np.testing.assert_array_equal(Curve.read(place / "curve.csv").force, straight.force)


def test_a_saved_state_that_is_damaged_is_not_continued(tmp_path: Path) -> None:
    made = study({"block.height": [1.0]})
    assert run_study(made, tmp_path).done == 1
    place = case_folder(tmp_path, made.entries[0].key)
    (place / DONE).unlink()
    (place / "summary.json").unlink()
    state = place / "checkpoint/state.npz"
    state.write_bytes(state.read_bytes()[:-100])
    assert run_study(made, tmp_path).done == 1


def test_there_is_nothing_to_collect_before_the_first_part(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no study"):
        collect_study(study(), tmp_path)
