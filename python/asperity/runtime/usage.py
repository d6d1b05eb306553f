"""What a run takes: wall-clock time of each phase, memory, and the memory that is left."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpi4py import MPI

GROUPS = Path("/sys/fs/cgroup")


@dataclass
class Phases:
    """Wall-clock time [s] and number of calls of each named phase; phases must not be nested."""

    seconds: dict[str, float] = field(default_factory=dict)
    calls: dict[str, int] = field(default_factory=dict)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Add the time of a with-block to the phase `name`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
            self.calls[name] = self.calls.get(name, 0) + 1


def peak() -> int:
    """Greatest memory of this process so far [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def free_share(comm: MPI.Comm) -> float:
    """Equal share of the free memory of a machine for each of its ranks, inf where it is unknown [bytes]; collective.

    That of the machine, or what a limit of the process, a batch system or a container (control groups) leaves of it.
    """
    from mpi4py import MPI

    here = comm.Split_type(MPI.COMM_TYPE_SHARED)
    share = float(here.allreduce(_free(), op=MPI.MIN)) / here.size
    here.Free()
    return share


def _free() -> float:
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    free = inf if most == resource.RLIM_INFINITY else float(most)
    with suppress(OSError, KeyError, ValueError):  # where there is no Linux
        machine = _numbers(Path("/proc/meminfo"))
        free = min(free, 1024.0 * machine["MemAvailable:"])
        if Path("/proc/sys/vm/overcommit_memory").read_text().strip() == "2":  # no more is given than there is
            free = min(free, 1024.0 * (machine["CommitLimit:"] - machine["Committed_AS:"]))
        name = Path("/proc/self/cgroup").read_text().rpartition("0::")[2].strip()
        group = GROUPS / name.lstrip("/")
        for each in (group, *group.parents):
            with suppress(OSError, KeyError, ValueError):  # the first has no limit, and a limit may be "max"
                free = min(free, int((each / "memory.max").read_text()) - _numbers(each / "memory.stat")["anon"])
    return max(free, 0.0)


def _numbers(path: Path) -> dict[str, int]:
    """Names at the beginning of the lines of a file, and the numbers after them."""
    return {words[0]: int(words[1]) for line in path.read_text().splitlines() if len(words := line.split()) > 1}
