# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Ranks that the command line starts itself: their number, curve, exit codes and signals."""

from __future__ import annotations

import math
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from asperity.curve import Curve
from asperity.runtime.launch import (
    STARTED,
    THREADS,
    Room,
    choose,
    cpu_limit,
    environment,
    find_room,
    physical_cores,
    started_ranks,
)

CASE = """
units = "other"
surface = {kind = "sinusoid", L = 1.0, amplitude = 0.05, dims = 2}
material = {E = 1.0, nu = 0.3, yield_strength = 0.005, tangent_modulus = 0.05}
mesh = {h_contact = 0.2, h_max = 0.5}
loading = {delta_max = 0.02, steps = 6, unload = true}
"""
MACHINE = Room(4, "the cores of this machine", False)
# neither the ranks of another test nor what ./run sets for mpirun
STRANGE = ("OMPI_COMM", "OMPI_ALLOW", "PMIX_", "PRTE_", "PMI_", "OMP_", STARTED)
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


def test_the_room_in_a_job_is_that_of_the_scheduler(tmp_path: Path) -> None:
    nodes = tmp_path / "nodes"
    nodes.write_text("a\na\nb\nb\n")
    assert find_room({"SLURM_JOB_ID": "1", "SLURM_NTASKS": "16"}).ranks == 16
    assert find_room({"SLURM_JOB_ID": "1", "SLURM_NTASKS": "16"}, multiple=5).ranks == 15
    assert find_room({"PBS_JOBID": "1", "PBS_NODEFILE": str(nodes)}) == Room(4, "the job of PBS", True)
    assert find_room({"LSB_JOBID": "1", "LSB_DJOB_NUMPROC": "6"}) == Room(6, "the job of LSF", True)
    alone = find_room({})
    assert not alone.scheduled and 1 <= alone.ranks <= len(os.sched_getaffinity(0))
    assert find_room({}, multiple=64).ranks == 64


def test_two_threads_of_a_core_count_once(tmp_path: Path) -> None:
    for cpu in range(8):
        file = tmp_path / f"devices/system/cpu/cpu{cpu}/topology/thread_siblings_list"
        file.parent.mkdir(parents=True)
        file.write_text(f"{cpu % 4},{cpu % 4 + 4}\n")
    assert physical_cores(range(8), tmp_path) == 4
    assert physical_cores({0, 4, 1}, tmp_path) == 2  # an affinity
    assert physical_cores({0, 1}, tmp_path / "absent") == 2


def test_the_cpu_limit_is_the_least_of_the_groups_above(tmp_path: Path) -> None:
    group = tmp_path / "fs/cgroup/user/job"
    group.mkdir(parents=True)
    (group / "cpu.max").write_text("max 100000\n")
    (group.parent / "cpu.max").write_text("250000 100000\n")
    membership = tmp_path / "membership"
    membership.write_text("0::/user/job\n")
    assert cpu_limit(tmp_path, membership) == 2.5
    old = tmp_path / "fs/cgroup/cpu/box"
    old.mkdir(parents=True)
    (old / "cpu.cfs_quota_us").write_text("-1\n")
    (old / "cpu.cfs_period_us").write_text("100000\n")
    membership.write_text("4:memory:/box\n3:cpu,cpuacct:/box\n")
    assert cpu_limit(tmp_path, membership) == math.inf
    (old / "cpu.cfs_quota_us").write_text("300000\n")
    assert cpu_limit(tmp_path, membership) == 3.0
    assert cpu_limit(tmp_path / "absent", tmp_path / "absent") == math.inf


def test_the_number_of_ranks_and_what_is_said_of_it() -> None:
    assert choose(3, MACHINE, None) == (3, "")
    assert choose(None, MACHINE, 100)[0] == choose(None, MACHINE, None)[0] == 4
    assert choose(None, MACHINE, 2)[0] == 2
    count, words = choose(9, MACHINE, None)
    assert count == 9 and "9 ranks on 4 cores take turns" in words
    job = Room(16, "the job of SLURM", True)
    assert choose(4, job, None) == (4, "")
    assert choose(None, job, 2) == (16, "16 ranks: so many has the job of SLURM")


def test_a_job_of_a_scheduler_keeps_its_binding() -> None:
    alone, job = environment(2, MACHINE, {}), environment(2, Room(2, "the job of SLURM", True), {})
    assert alone["PRTE_MCA_hwloc_default_binding_policy"] == "none"
    assert not [name for name in job if "binding" in name or "mapping" in name]
    assert all(each[name] == "1" for each in (alone, job) for name in THREADS)
    own = environment(2, MACHINE, {"PRTE_MCA_hwloc_default_binding_policy": "core", "OMP_NUM_THREADS": "8"})
    assert own["PRTE_MCA_hwloc_default_binding_policy"] == "core" and own["OMP_NUM_THREADS"] == "1"


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
        (("--set", "material.nu=0.7"), 2, "material.nu"),  # refused before mpirun
        (("--set", "loading.delta_max=0.5"), 2, "leaves no gap"),  # refused by the ranks
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
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_to_the_command_ends_the_ranks_after_their_step(tmp_path: Path, number: signal.Signals) -> None:
    """Sent to mpirun itself it would kill them."""
    out = tmp_path / "out"
    process = start(tmp_path, "-o", out, "--ranks", "2")
    for _ in range(3000):
        if (out / "curve.csv").is_file() and len(Curve.read(out / "curve.csv")) >= 2:
            break
        time.sleep(0.02)
    process.send_signal(number)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 3, err
    assert err.count("stopped by SIGTERM or SIGINT after step") == 1 and "Traceback" not in err
    again = start(tmp_path, "-o", out, "--ranks", "2", "--resume")
    assert again.communicate(timeout=300) and again.returncode == 0


@needs_mpirun
def test_killed_with_the_command_no_rank_is_left(tmp_path: Path) -> None:
    process = start(tmp_path, "-o", tmp_path / "out", "--ranks", "2", "--set", "loading.steps=500")
    while not (tmp_path / "out/curve.csv").is_file():
        time.sleep(0.02)
    process.kill()
    process.communicate(timeout=60)

    def left() -> list[str]:
        found = []
        for place in Path("/proc").glob("[0-9]*"):
            try:
                words = (place / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if os.fsencode(tmp_path / "case.toml") in words:
                found.append(place.name)
        return found

    for _ in range(500):
        if not left():
            break
        time.sleep(0.02)
    assert not left()


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
    assert "--ranks starts nothing: the ranks of an MPI job are there, 1 of them" in out
    assert STARTED not in os.environ


def test_a_number_of_ranks_is_a_number_or_auto(tmp_path: Path) -> None:
    for word in ("0", "-1", "two", "1.5"):
        process = start(tmp_path, "-o", tmp_path / "out", f"--ranks={word}")
        _, err = process.communicate(timeout=60)
        assert process.returncode == 2 and "give auto, or a number from 1" in err


def test_no_mpirun_is_a_sentence(tmp_path: Path) -> None:
    process = start(tmp_path, "-o", tmp_path / "out", "--ranks", "2", PATH=str(tmp_path))
    _, err = process.communicate(timeout=60)
    assert process.returncode == 4 and "there is no mpirun" in err
