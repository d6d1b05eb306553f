"""Runs that are killed, stopped, out of disk space, or fail on one rank; each in separate processes."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from conftest import CLEAN, MPIRUN, assert_same

from asperity.curve import Curve
from asperity.runtime.files import is_aside, read_npz

CASE = """
units = "other"
surface = {kind = "sinusoid", L = 1.0, amplitude = 0.05, dims = 2}
material = {E = 1.0, nu = 0.3, yield_strength = 0.005, tangent_modulus = 0.05}
mesh = {h_contact = 0.2, h_max = 0.5}
loading = {delta_max = 0.02, steps = 4, unload = true, integrator = "backward-euler"}
"""
needs_mpirun = pytest.mark.skipif(shutil.which("mpirun") is None, reason="there is no mpirun")

# Breaks something on the second rank after some calls, then runs the command line.
SABOTAGE = """
import sys
from mpi4py import MPI
import asperity.runtime.parallel
from asperity.fem.kernels import ElementKernels
from asperity.cli import main

asperity.runtime.parallel.PATIENCE = 2.0
error = {"MemoryError": MemoryError, "ValueError": ValueError}[sys.argv[1]]
original, calls = ElementKernels.add_internal_force, iter(range(10**9))

def broken(self, u, b):
    if MPI.COMM_WORLD.rank == 1 and next(calls) == 15:
        raise error("sabotage")
    original(self, u, b)

ElementKernels.add_internal_force = broken
main(sys.argv[2:])
"""


@pytest.fixture
def case(tmp_path: Path) -> Path:
    path = tmp_path / "case.toml"
    path.write_text(CASE)
    return path


def asperity(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-W", "ignore", "-m", "asperity", *map(str, arguments)]


def call(command: Sequence[str], timeout: float = 300.0) -> tuple[int, str, str]:
    done = subprocess.run(command, env=CLEAN, capture_output=True, text=True, timeout=timeout, check=False)
    return done.returncode, done.stdout, done.stderr


def run(case: Path, out: Path, *options: str, ranks: int = 1) -> Curve:
    """A run that must succeed."""
    command = asperity("run", case, "-o", out, "-q", *options)
    code, _, err = call(command if ranks == 1 else [*MPIRUN, str(ranks), *command])
    assert code == 0, err
    return Curve.read(out / "curve.csv")


def start(command: Sequence[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command, env=CLEAN, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def wait_for_steps(out: Path, steps: int) -> None:
    """Wait until a run has accepted some steps."""
    for _ in range(3000):
        if (out / "curve.csv").is_file() and len(Curve.read(out / "curve.csv")) >= steps:
            return
        time.sleep(0.05)
    raise AssertionError("the run did not get there")


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=needs_mpirun)])
def test_killed_runs_continue_without_a_difference(case: Path, tmp_path: Path, ranks: int) -> None:
    """SIGKILL at random moments, and the same command again: no file is half-written, and no saved step is lost."""
    random, out, kills, saved = np.random.default_rng(ranks), tmp_path / "out", 0, 0
    straight = run(case, tmp_path / "straight", ranks=ranks)
    command = [*([*MPIRUN, str(ranks)] if ranks > 1 else []), *asperity("run", case, "-o", out, "-q", "--resume")]
    while True:
        process = start(command)
        wait_for_steps(out, min(len(straight), random.integers(saved, saved + 3)) if kills < 5 else 0)
        try:
            _, err = process.communicate(timeout=random.uniform(0.0, 0.3) if kills < 5 else 300.0)
            break
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
        kills += 1
        whole = [path for path in out.rglob("*.npz") if not is_aside(path.name)]
        steps = [len(json.loads(read_npz(path)["meta"].tobytes())["rows"]) for path in whole if path.stem == "state"]
        assert sum(steps) >= saved
        saved = sum(steps)
    assert process.returncode == 0 and kills, err
    assert_same(straight, Curve.read(out / "curve.csv"), 0.0 if ranks == 1 else 1e-8, points=1.0)


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run on one rank that was never stopped."""
    folder = tmp_path_factory.mktemp("straight")
    (folder / "case.toml").write_text(CASE)
    run(folder / "case.toml", folder / "out")
    return folder / "out"


def test_a_signal_ends_the_run_after_its_step(case: Path, tmp_path: Path, straight: Path) -> None:
    """Also where nobody reads its errors, as where its terminal has been closed."""
    out = tmp_path / "out"
    process = start(asperity("run", case, "-o", out))
    wait_for_steps(out, 2)
    assert process.stderr is not None
    process.stderr.close()
    process.send_signal(signal.SIGTERM)
    assert process.wait(120) == 3
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["exit_reason"].startswith("stopped by SIGTERM after step")
    assert summary["steps"] == len(Curve.read(out / "curve.csv"))
    assert 2 <= len(Curve.read(out / "curve.csv")) < len(Curve.read(straight / "curve.csv"))
    assert_same(Curve.read(straight / "curve.csv"), run(case, out, "--resume"), 0.0)


def test_a_killed_run_leaves_no_lock(case: Path, tmp_path: Path) -> None:
    command = asperity("run", case, "-o", tmp_path / "out", "-q", "--force")
    process = start([*command, "--set", "loading.steps=500"])
    wait_for_steps(tmp_path / "out", 1)
    assert call(command)[0] == 2
    process.kill()
    process.communicate()
    assert call(command)[0] == 0


def test_a_second_signal_ends_at_once(case: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = start(asperity("run", case, "-o", out))
    wait_for_steps(out, 1)
    process.send_signal(signal.SIGINT)
    assert process.stderr is not None
    assert "second signal" in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=120)
    assert process.returncode in (-signal.SIGINT, 3)  # 3 if the step had ended before
    run(case, out, "--resume")


def test_a_full_disk_is_a_clear_error_and_loses_no_results(case: Path, tmp_path: Path, straight: Path) -> None:
    """The limit on the size of a file represents a disk with that much free space."""
    out = tmp_path / "out"
    sizes = {path.name: path.stat().st_size for path in (straight / "checkpoint").iterdir()}
    limit = (sizes["state.npz"] + sizes["mesh.npz"]) // 2  # the mesh fits, the states of the last steps do not
    assert sizes["mesh.npz"] < limit < sizes["state.npz"]
    # MPI, which has files of its own, starts before
    limited = "import resource, sys; from asperity.runtime import compat, compiled; compat.start(); "
    limited += f"resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit})); "
    limited += "sys.argv[0] = 'asperity'; from asperity.cli import main; main(sys.argv[1:])"
    code, _, err = call([sys.executable, "-c", limited, "run", str(case), "-o", str(out), "-q"])
    assert code == 4
    assert "cannot write" in err and "state.npz: File too large" in err and "--resume" in err
    assert [path.name for path in out.rglob(".*")] == [".lock"]
    assert_same(Curve.read(straight / "curve.csv"), run(case, out, "--resume"), 0.0)


SHORT = ("loading.unload=false", "loading.steps=2")


@pytest.mark.slow
@needs_mpirun
@pytest.mark.parametrize(
    ("ranks", "keys"),
    [
        *((ranks, ()) for ranks in (2, 3, 4)),
        # a small spot: most ranks have no facet of it and no cell that yields
        (6, (*SHORT, "mesh.h_contact=0.1", "loading.delta_max=0.005")),
        # a high block: ranks without a top, and a contact that needs the stress in its cells
        (6, (*SHORT, "block.height=3.0", "mesh.h_contact=0.3", "mesh.growth=1.0", "contact.method=nitsche")),
    ],
    ids=["2", "3", "4", "small spot", "high block"],
)
def test_any_number_of_ranks_gives_the_same_curve(case: Path, tmp_path: Path, ranks: int, keys: Sequence[str]) -> None:
    """And continues it where all of it is there."""
    options = [word for key in keys for word in ("--set", key)]
    alone, out = run(case, tmp_path / "1", *options), tmp_path / "many"
    assert_same(alone, run(case, out, *options, ranks=ranks), 1e-8, points=1.0)
    (out / "summary.json").unlink()  # as if the run had not finished
    assert_same(alone, run(case, out, *options, "--resume", ranks=ranks), 1e-8, points=1.0)


@pytest.mark.slow
@needs_mpirun
def test_a_run_continues_on_another_number_of_ranks(case: Path, tmp_path: Path) -> None:
    """Two ranks, stopped by a signal to one of them, continued by three, stopped again, continued by one."""
    sharp = ("--set", "solver.rtol=1e-10")
    alone, out = run(case, tmp_path / "1", *sharp), tmp_path / "out"
    for ranks, steps in ((2, 1), (3, 3)):
        command = asperity("run", case, "-o", out, "-q", *sharp, *(["--resume"] if steps > 1 else []))
        # the last rank reports its process number and receives the signal
        note = tmp_path / f"pid{ranks}"
        shell = f'[ "$OMPI_COMM_WORLD_RANK" = {ranks - 1} ] && echo $$ > {note}; exec "$@"'
        process = start([*MPIRUN, str(ranks), "sh", "-c", shell, "sh", *command])
        wait_for_steps(out, steps)
        os.kill(int(note.read_text()), signal.SIGTERM)
        _, err = process.communicate(timeout=300)
        assert process.returncode == 3, err
        assert err.count("stopped by SIGTERM after step") == 1
    assert_same(alone, run(case, out, "--resume", *sharp), 1e-10, points=1.0)


@pytest.mark.slow
@needs_mpirun
@pytest.mark.parametrize(
    ("error", "code", "message"), [("MemoryError", 3, "out of memory"), ("ValueError", 70, "ValueError: sabotage")]
)
def test_an_error_on_one_rank_ends_all(case: Path, tmp_path: Path, error: str, code: int, message: str) -> None:
    program = [
        sys.executable,
        "-W",
        "ignore",
        "-c",
        SABOTAGE,
        error,
        "run",
        str(case),
        "-o",
        str(tmp_path / "out"),
        "-q",
    ]
    found, _, err = call([*MPIRUN, "2", *program])
    assert found == code and err.count(message) == 1, err


def test_nothing_is_written_outside_the_output_folder(case: Path, tmp_path: Path) -> None:
    """For any names of the file and its texts; the folder of the case is only read."""
    place = tmp_path / "place"
    place.mkdir()
    odd = place / "..%2F..%2Fevil<b>.toml"
    odd.write_text(case.read_text() + "[output]\nreport = true\n")
    before = sorted(tmp_path.rglob("*"))
    work = place / "work"
    work.mkdir()
    command = asperity("run", odd, "-q", "--set", "loading.steps=1", "--set", "loading.unload=false")
    done = subprocess.run(command, env=CLEAN, cwd=work, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    folder = work / "out" / odd.stem
    written = {path for path in tmp_path.rglob("*") if path.is_file()} - set(before)
    assert written and all(path.is_relative_to(folder) for path in written)
    page = (folder / "report.html").read_text()
    assert "evil<b>" not in page and "evil&lt;b&gt;" in page


def test_an_output_folder_that_vanishes_is_a_clear_error(case: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = start(asperity("run", case, "-o", out))
    wait_for_steps(out, 1)
    out.rename(tmp_path / "moved")
    _, err = process.communicate(timeout=120)
    assert process.returncode == 4 and "cannot write" in err and "No such file" in err
    assert "Traceback" not in err
    run(case, tmp_path / "moved", "--resume")
