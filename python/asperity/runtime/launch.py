"""The ranks of a job: whether they are there, and their start by mpirun."""

from __future__ import annotations

import os
import pwd
import shutil
import sys
import tempfile
from collections.abc import Mapping, Sequence
from typing import NoReturn

from asperity.errors import CompatError

TERMINAL = "ASPERITY_TERMINAL"  # for ranks that are started, the standard streams that are terminals
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")


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


def on_terminal(stream: str = "stdout") -> bool:
    """Whether a standard stream is a terminal; mpirun gives its ranks one where it has none, and the reverse."""
    if started_ranks() is not None:
        return stream in os.environ.get(TERMINAL, "").split()
    return bool(getattr(sys, stream).isatty())


def ensure_home() -> None:
    """Set HOME where it is not set: without it Open MPI ends the process."""
    if not os.environ.get("HOME"):
        try:
            os.environ["HOME"] = pwd.getpwuid(os.getuid()).pw_dir
        except KeyError:  # a user without an entry, as in some containers
            os.environ["HOME"] = tempfile.gettempdir()


def available_cores() -> int:
    """Number of logical processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def start(arguments: Sequence[str], ranks: int) -> NoReturn:
    """Replace this process by mpirun with a command of asperity on new ranks, of one thread each.

    Variables of the environment tell mpirun what to do, because the options of Open MPI and MPICH differ. Ranks are not
    bound to cores: two jobs on one machine that both bind would share the first cores and leave the others idle.

    Raises:
        CompatError: there is no mpirun
    """
    # The mpirun beside Python comes first: a virtual environment that is not activated may have an MPI of its own.
    path = f"{os.path.dirname(sys.executable)}{os.pathsep}{os.environ.get('PATH', os.defpath)}"
    mpirun = shutil.which("mpirun", path=path) or shutil.which("mpiexec", path=path)
    if mpirun is None:
        raise CompatError(f"--ranks {ranks}: there is no mpirun on the PATH; install openmpi-bin, or use ./run")
    defaults = {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",  # in a container
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
        "PRTE_MCA_hwloc_default_binding_policy": "none",
    }
    command = [mpirun, "-n", str(ranks), sys.executable, "-P", "-m", "asperity", *arguments]  # -P: no local modules
    defaults[TERMINAL] = " ".join(filter(on_terminal, ("stdout", "stderr")))
    sys.stdout.flush()
    os.execve(mpirun, command, defaults | dict(os.environ) | dict.fromkeys(THREADS, "1"))
