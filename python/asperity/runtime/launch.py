# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The ranks of a job: how many there is room for, and their start by mpirun, with signals and exit code handed through.

Only variables of the environment tell mpirun what to do, because the options of Open MPI and MPICH differ.
"""

from __future__ import annotations

import ctypes
import math
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType

from asperity.errors import CompatError

STARTED = "ASPERITY_RANKS"  # number of ranks that `start` started, in their environment
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")
DOFS_PER_RANK = 12_500  # fewer cost more in messages than they save; PETSc advises 10,000 to 20,000
OWN_CODES = range(5)  # exit codes of the command line


@dataclass(frozen=True)
class Room:
    """Ranks that there is room for.

    Attributes:
        ranks: their number, a core each
        source: what sets it, in words
        scheduled: whether it is the allocation of a job scheduler

    Examples:
        >>> find_room({"SLURM_JOB_ID": "7", "SLURM_NTASKS": "16"})
        Room(ranks=16, source='the job of SLURM', scheduled=True)
    """

    ranks: int
    source: str
    scheduled: bool


def started_ranks(environ: Mapping[str, str] = os.environ) -> int | None:
    """Number of ranks of the MPI job that this process is one of; None outside of such a job, 0 where it is not known.

    SLURM_NTASKS alone is no sign: the script of a job has it as well, not only the ranks that srun starts.
    """
    for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE"):
        if environ.get(name, "").isdigit():
            return int(environ[name])
    tasks = environ.get("SLURM_STEP_NUM_TASKS", "")
    if tasks.isdigit() and int(tasks) > 1:
        return int(tasks)
    return 0 if {"PMIX_RANK", "PMI_RANK"} & environ.keys() else None


def find_room(environ: Mapping[str, str] = os.environ, multiple: int = 1) -> Room:
    """Ranks of the job that a scheduler runs here, otherwise the cores that this process may use.

    Args:
        environ: of this process
        multiple: of which the number is one, rounded down, but not to 0
    """
    found = _find_room(environ)
    return replace(found, ranks=max(found.ranks // max(multiple, 1), 1) * max(multiple, 1))


def _find_room(environ: Mapping[str, str]) -> Room:
    for name, job, count in (("SLURM", "SLURM_JOB_ID", "SLURM_NTASKS"), ("LSF", "LSB_JOBID", "LSB_DJOB_NUMPROC")):
        if job in environ and environ.get(count, "").isdigit():
            return Room(max(int(environ[count]), 1), f"the job of {name}", True)
    if "PBS_JOBID" in environ and Path(environ.get("PBS_NODEFILE", "")).is_file():
        slots = Path(environ["PBS_NODEFILE"]).read_text().split()
        return Room(max(len(slots), 1), "the job of PBS", True)
    return Room(available_cores(), "the cores of this machine", False)


def available_cores() -> int:
    """Physical cores that this process may use: those of its affinity, no more than the CPU limit of its cgroup."""
    every = range(os.cpu_count() or 1)
    cores = physical_cores(os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else every)
    return min(cores, int(min(cpu_limit(), cores)))


def physical_cores(cpus: Collection[int], system: Path = Path("/sys")) -> int:
    """Number of cores that logical processors belong to.

    Args:
        cpus: numbers of logical processors
        system: where the kernel describes them
    """

    def siblings(cpu: int) -> str:
        path = system / f"devices/system/cpu/cpu{cpu}/topology/thread_siblings_list"
        return path.read_text().strip() if path.is_file() else f"{cpu}"

    return len({siblings(cpu) for cpu in cpus})


def cpu_limit(system: Path = Path("/sys"), membership: Path = Path("/proc/self/cgroup")) -> float:
    """Least limit of CPU time over time among the control groups of this process; inf without one.

    Args:
        system: where the groups are, of version 2 or 1
        membership: file with the groups of the process
    """
    root, limits = system / "fs/cgroup", [math.inf]
    text = membership.read_text() if membership.is_file() else ""
    for line in text.splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers and "cpu" not in controllers.split(","):
            continue
        group = Path(path.lstrip("/"))
        for place in (group, *group.parents):
            folder = root / "cpu" / place if controllers else root / place
            with_quota = [folder / "cpu.max"] if not controllers else [
                folder / "cpu.cfs_quota_us", folder / "cpu.cfs_period_us",
            ]  # fmt: skip
            if all(file.is_file() for file in with_quota):
                quota, period = " ".join(file.read_text().strip() for file in with_quota).split()[:2]
                if quota not in ("max", "-1"):
                    limits.append(max(int(quota) / int(period), 1.0))
    return min(limits)


def choose(requested: int | None, room: Room, most: int | None) -> tuple[int, str]:
    """Number of ranks to start, and a sentence about it, empty where there is nothing to say.

    Args:
        requested: by the user; None for as many as make sense
        room: for ranks
        most: that make sense for the work, None if unknown

    Examples:
        >>> choose(None, Room(8, "the cores of this machine", False), most=3)
        (3, '3 ranks, one thread each: more would not make so small a problem faster')
        >>> choose(32, Room(16, "the job of SLURM", True), most=None)
        (16, '16 ranks instead of 32: so many has the job of SLURM')
    """
    if room.scheduled:
        if requested is not None and requested <= room.ranks:
            return requested, ""
        instead = "" if requested is None else f" instead of {requested}"
        return room.ranks, f"{room.ranks} rank{_s(room.ranks)}{instead}: so many has {room.source}"
    if requested is not None:
        if requested <= room.ranks:
            return requested, ""
        return requested, f"{requested} ranks on {room.ranks} core{_s(room.ranks)} take turns: that is slower"
    if most is not None and most < room.ranks:
        return most, f"{most} rank{_s(most)}, one thread each: more would not make so small a problem faster"
    return room.ranks, f"{room.ranks} rank{_s(room.ranks)}, one thread each: {room.source}"


def start(arguments: Sequence[str], ranks: int, room: Room) -> int:
    """Run a command of asperity on new ranks and return its exit code.

    A first SIGTERM or SIGINT reaches the ranks as SIGUSR1, which mpirun passes on, whereas it would answer the signals
    themselves by killing the ranks. If this process is killed, so are the ranks.

    Args:
        arguments: of the command line
        ranks: their number; one is started without mpirun, and does not return
        room: for ranks

    Raises:
        CompatError: there is no mpirun
    """
    environ = environment(ranks, room)
    command = [sys.executable, "-P", "-m", "asperity", *arguments]  # -P: no module of the current folder
    if ranks == 1:
        sys.stdout.flush()
        os.execve(sys.executable, command, environ)
    mpirun = shutil.which("mpirun") or shutil.which("mpiexec")
    if mpirun is None:
        raise CompatError("there is no mpirun to start --ranks: install openmpi-bin, or use ./run")
    sys.stdout.flush()
    parent = os.getpid()

    def end_with_parent() -> None:
        ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG
        if os.getppid() != parent:
            os._exit(1)

    received: list[int] = []
    process: subprocess.Popen[bytes] | None = None

    def pass_on(number: int, frame: FrameType | None) -> None:
        received.append(number)
        if process is not None:
            process.send_signal(signal.SIGUSR1)

    before = {s: signal.signal(s, pass_on) for s in (signal.SIGTERM, signal.SIGINT)}
    try:
        # in a process group of its own, so that Ctrl-C does not reach mpirun, and so without the terminal's input
        process = subprocess.Popen(
            [mpirun, "-n", str(ranks), *command],
            env=environ,
            stdin=subprocess.DEVNULL,
            process_group=0,
            preexec_fn=end_with_parent if sys.platform == "linux" else None,
        )
        if received:
            process.send_signal(signal.SIGUSR1)
        code = process.wait()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if received and code not in OWN_CODES:
        return 128 + received[-1]
    return code if code >= 0 else 128 - code


def environment(ranks: int, room: Room, environ: Mapping[str, str] = os.environ) -> dict[str, str]:
    """Environment of the ranks: one thread each; on a machine without a scheduler no rank is bound to a core.

    Two jobs on one machine that both bind their ranks would share the first cores and leave the others idle.

    Args:
        ranks: their number
        room: for ranks
        environ: of this process
    """
    chosen = dict.fromkeys(THREADS, "1") | {STARTED: str(ranks)}
    if os.geteuid() == 0:
        chosen |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    if not sys.stdout.isatty():  # mpirun gives the ranks a terminal even where it writes to a file
        chosen["TERM"] = "dumb"
    defaults: dict[str, str] = {}
    if not room.scheduled:  # for Open MPI 5 and 4
        defaults |= {
            "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
            "OMPI_MCA_rmaps_base_oversubscribe": "1",
        }
        defaults |= {"PRTE_MCA_hwloc_default_binding_policy": "none", "OMPI_MCA_hwloc_base_binding_policy": "none"}
        if ranks > room.ranks:
            defaults |= {"OMPI_MCA_mpi_yield_when_idle": "1"}
    return defaults | dict(environ) | chosen


def _s(count: int) -> str:
    return "" if count == 1 else "s"
