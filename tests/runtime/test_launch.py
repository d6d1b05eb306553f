"""Ranks that the command line starts itself: their number, curve, exit codes and signals."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import numpy as np
import pytest

from asperity.cli import options
from asperity.curve import Curve
from asperity.runtime import launch
from asperity.runtime.launch import started_ranks

CASE = """
units = "other"
surface = {kind = "sinusoid", L = 1.0, amplitude = 0.05, dims = 2}
material = {E = 1.0, nu = 0.3, yield_strength = 0.005, tangent_modulus = 0.05}
mesh = {h_contact = 0.4, h_max = 1.0, growth = 1.0}
loading = {delta_max = 0.02, steps = 3}
"""
# neither the ranks of another test nor what ./run sets for mpirun
STRANGE = ("OMPI_COMM", "OMPI_ALLOW", "PMIX_", "PRTE_", "PMI_", "OMP_")
CLEAN = {name: value for name, value in os.environ.items() if not name.startswith(STRANGE)}
needs_mpirun = pytest.mark.skipif(shutil.which("mpirun") is None, reason="there is no mpirun")


@pytest.mark.parametrize(
    ("environ", "size"),
    [
        ({}, None),
        ({"OMPI_COMM_WORLD_SIZE": "3", "PMIX_RANK": "0"}, 3),
        ({"PMI_SIZE": "2", "PMI_RANK": "1"}, 2),
        ({"SLURM_JOB_ID": "1", "SLURM_NTASKS": "8", "SLURM_PROCID": "0"}, None),  # the script of a job
        ({"SLURM_JOB_ID": "1", "SLURM_NTASKS": "8", "SLURM_STEP_NUM_TASKS": "8", "SLURM_PROCID": "0"}, 8),  # srun
        ({"SLURM_STEP_NUM_TASKS": "1"}, None),  # srun --pty bash
        ({"PMIX_RANK": "0"}, 0),
    ],
)
def test_ranks_of_a_launcher_are_recognised(environ: dict[str, str], size: int | None) -> None:
    assert started_ranks(environ) == size


def start(tmp_path: Path, *options: str | Path, **environ: str) -> subprocess.Popen[str]:
    (tmp_path / "case.toml").write_text(CASE)
    command = [sys.executable, "-m", "asperity", "run", str(tmp_path / "case.toml"), *map(str, options)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, env=CLEAN | environ, stdout=pipe, stderr=pipe, text=True, start_new_session=True)


@needs_mpirun
def test_ranks_that_are_started_give_the_curve_of_one(tmp_path: Path) -> None:
    alone = start(tmp_path, "-o", tmp_path / "1", "--ranks", "1")
    out, err = alone.communicate(timeout=300)
    assert alone.returncode == 0, err
    both = start(tmp_path, "-o", tmp_path / "2", "--ranks", "2")
    out, err = both.communicate(timeout=300)
    assert both.returncode == 0, err
    assert out.count("written to") == 1 and "\x1b" not in out  # one rank speaks, and in lines: this is no terminal
    one, two = (Curve.read(tmp_path / name / "curve.csv") for name in ("1", "2"))
    np.testing.assert_allclose(two.force, one.force, rtol=0, atol=1e-8 * one.force.max())
    np.testing.assert_allclose(two.area_fraction, one.area_fraction, rtol=0, atol=1e-8 * one.area_fraction.max())
    for name, ranks in (("1", 1), ("2", 2)):
        assert f'"ranks": {ranks}' in (tmp_path / name / "summary.json").read_text()


@needs_mpirun
@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (("--set", "accuracy.tolerance=0.1", "--set", "accuracy.max_dofs=1000"), 2, "max_dofs"),  # refused by the ranks
        (("--set", "solver.newton_max=1"), 3, "no convergence"),
    ],
)
def test_the_exit_code_of_the_ranks_is_that_of_the_command(
    tmp_path: Path, options: tuple[str, ...], code: int, message: str
) -> None:
    process = start(tmp_path, "-o", tmp_path / "out", "-q", "--ranks", "2", *options)
    _, err = process.communicate(timeout=300)
    assert process.returncode == code, err
    assert err.count("error: ") == 1 and message in err


@needs_mpirun
def test_the_signal_that_mpirun_passes_on_ends_the_ranks_after_their_step(tmp_path: Path) -> None:
    out = tmp_path / "out"
    many = ("--set", "loading.steps=15")
    process = start(tmp_path, "-o", out, "--ranks", "2", *many)
    for _ in range(3000):
        if (out / "curve.csv").is_file() and len(Curve.read(out / "curve.csv")) >= 2:
            break
        time.sleep(0.02)
    process.send_signal(signal.SIGUSR1)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 3, err
    assert err.count("stopped by SIGUSR1 after step") == 1 and "Traceback" not in err
    assert err.count("the run ends after this step") == 1
    again = start(tmp_path, "-o", out, "--ranks", "2", "--resume", *many)
    assert again.communicate(timeout=300) and again.returncode == 0


def test_auto_is_a_rank_for_each_core_that_the_process_may_use(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[list[str]] = []
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(7))
    monkeypatch.setattr(os, "execve", lambda path, command, environ: started.append(command))
    monkeypatch.setattr(launch, "started_ranks", lambda: None)
    monkeypatch.setattr(shutil, "which", lambda name, path: "mpirun")
    context = click.Context(click.Command("asperity"), obj=["run", "case.toml"])
    with context:
        options.start_ranks(0, quiet=True)
        options.start_ranks(5, quiet=True)
        options.start_ranks(1, quiet=True)
        options.start_ranks(None, quiet=True)
    assert [command[2] for command in started] == ["7", "5"]
    assert all(command[-2:] == ["run", "case.toml"] for command in started)


def test_a_module_of_the_current_folder_does_not_replace_one_of_the_package(tmp_path: Path) -> None:
    (tmp_path / "numpy.py").write_text("raise SystemExit(9)\n")
    (tmp_path / "case.toml").write_text(CASE)
    script = "import sys; sys.path.remove(''); from asperity.cli import main; main()"  # like the installed command
    command = [sys.executable, "-c", script, "run", "case.toml", "-o", "out", "-q", "--ranks", "1"]
    done = subprocess.run(command, cwd=tmp_path, env=CLEAN, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr


def test_ranks_that_are_there_are_used(tmp_path: Path) -> None:
    """As srun or mpirun would start them; one rank here, without its launcher."""
    process = start(tmp_path, "-o", tmp_path / "out", "--ranks", "2", PMI_SIZE="1", PMI_RANK="0")
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    assert "--ranks 2 starts nothing: this MPI job has 1 ranks already" in out


@pytest.mark.skipif((Path(sys.executable).parent / "mpirun").exists(), reason="mpirun is beside Python")
def test_no_mpirun_is_a_sentence(tmp_path: Path) -> None:
    process = start(tmp_path, "-o", tmp_path / "out", "--ranks", "2", PATH=str(tmp_path))
    _, err = process.communicate(timeout=60)
    assert process.returncode == 4 and "there is no mpirun" in err


def test_the_solver_loads_the_mpi_of_the_wheels_before_dolfinx(tmp_path: Path) -> None:
    """PyPI's wheel of dolfinx needs another module first; the package alone loads neither."""
    (tmp_path / "dolfinx_solver.py").write_text("")
    (tmp_path / "dolfinx.py").write_text("import sys\nassert 'dolfinx_solver' in sys.modules\n")
    code = "import sys, asperity; assert 'dolfinx_solver' not in sys.modules; asperity.solve_contact; import dolfinx"
    changed = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=changed, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
