# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Run the cases of a study: groups of ranks pull them from a queue, meshes are shared, failures are recorded."""

from __future__ import annotations

import gc
import hashlib
import json
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.case.validation import doubt_of_edge
from asperity.errors import AsperityError, AssumptionWarning, CheckpointError, InputError, Interrupted
from asperity.runtime import compat
from asperity.runtime.files import is_aside, remove_asides, replace_file
from asperity.runtime.parallel import on_root, on_root_bcast
from asperity.runtime.progress import duration
from asperity.study.definition import Entry, Study
from asperity.study.locks import LOCK_FILES, FolderLock, claimed
from asperity.study.results import ABOUT, DONE, case_folder, case_state, write_about, write_tables

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.case import Case

MESHES = "meshes"  # folder of the meshes that cases share
ERROR = "error.txt"  # traceback of a case that ended with an unexpected error
PORTIONS = 4  # portions per group, approximately: with fewer, groups become idle; with more, meshes are built twice

Say = Callable[[str], None]


@dataclass(frozen=True)
class StudyCounts:
    """Numbers of cases of a study after a run.

    Attributes:
        cases: all cases of the study, or of its part.
        done: finished, in this run or before.
        failed: with a recorded failure.
        run: run now.

    Examples:
        >>> counts = StudyCounts(cases=10, done=9, failed=1, run=4)
        >>> counts.cases - counts.done - counts.failed  # to be run
        0
    """

    cases: int
    done: int
    failed: int
    run: int


def run_study(
    study: Study,
    folder: str | Path,
    *,
    only: tuple[int, int] | None = None,
    ranks_per_case: int = 1,
    retry: bool = False,
    comm: MPI.Intracomm | None = None,
    say: Say | None = None,
) -> StudyCounts:
    """Run the missing cases of a study and write its tables; collective over `comm`.

    The ranks are split into groups; the first rank of each group pulls the next cases from a common counter. A case
    whose results are in the folder is not repeated; cases are identified by the hash of the completed input. An error
    of the solver is recorded with its case, and the next case starts. An unexpected error is recorded too if a group is
    a single rank; otherwise it ends the job, which can be started again. A case that was stopped by a signal continues
    from its last saved step when the job is started again.

    Parts (`only`) may run side by side, in jobs of their own, also on several machines that see the folder. A case that
    another job is computing is left to it. Parts leave the table alone; `collect_study`, or the whole study once they
    have ended, writes it.

    Args:
        study: the study to run.
        folder: receives results.csv, study.json, cases/HASH/ and meshes/.
        only: (number, parts): run this part of the cases, counted from 1, see `part`; default all cases.
        ranks_per_case: number of ranks in a group.
        retry: whether to repeat the cases that failed.
        comm: communicator; default all ranks.
        say: called with a line for each case, on the first rank of each group.

    Returns:
        Numbers of cases, the same on all ranks.

    Raises:
        InputError: the folder contains other files, another job works on the whole study, there is no such part, or the
            ranks cannot be divided into groups.
        Interrupted: a signal requested the end; what is finished is kept.

    Examples:
        >>> from asperity.study import Study
        >>> base = {
        ...     "units": "other", "surface": {"kind": "flat", "L": 1.0}, "material": {"E": 1.0, "nu": 0.3},
        ...     "mesh": {"h_contact": 1.0, "h_max": 1.0}, "loading": {"delta_max": 0.01, "steps": 3},
        ...     "output": {"figures": False, "report": False},
        ... }

        >>> run_study(Study.from_dict({"base": base, "grid": {"material.nu": [0.2, 0.3]}}), "out/study")
        StudyCounts(cases=2, done=2, failed=0, run=2)
    """
    from mpi4py import MPI

    comm = MPI.COMM_WORLD if comm is None else comm
    folder = Path(folder)
    if ranks_per_case < 1 or comm.size % ranks_per_case:
        raise InputError(
            f"--ranks-per-case = {ranks_per_case} must divide the number of ranks, {comm.size}: "
            f"with {max(comm.size // max(ranks_per_case, 1), 1) * max(ranks_per_case, 1)} ranks it would"
        )
    chosen = range(len(study.entries)) if only is None else part(study.entries, *only)
    lock = FolderLock(folder, shared=only is not None)
    if comm.size > 1:
        compat.start()  # of PETSc: rank 0 presses blocks with free sides on its own, for the tables
    plan = _prepare(study, folder, lock, chosen, retry, comm.size // ranks_per_case) if comm.rank == 0 else None
    portions = comm.bcast(plan)
    if isinstance(portions, AsperityError):
        lock.release()
        raise portions
    group = comm.Split(comm.rank // ranks_per_case, comm.rank)
    queue = Queue(comm)
    todo, run = sum(len(p) for p in portions), 0
    start = perf_counter()
    try:
        while (turn := group.bcast(queue.take() if group.rank == 0 else None)) < len(portions):
            entries = [study.entries[i] for i in portions[turn]]
            for entry, state in run_portion(entries, folder, group, retry):
                run += group.rank == 0
                if group.rank == 0 and say is not None:
                    finished = queue.count()
                    left = (perf_counter() - start) * (todo / finished - 1)
                    say(_line(entry, state, study.keys, len(chosen) - todo + finished, len(chosen), left))
    except BaseException:
        if comm.rank == 0 and only is None:
            write_tables(study, folder)  # the tables of a stopped study contain its finished cases
        lock.release()
        raise
    queue.close()  # waits for all ranks
    group.Free()
    if comm.rank == 0 and only is None:
        write_tables(study, folder)
    lock.release()
    run = comm.allreduce(run)
    return comm.bcast(_count(study, folder, chosen, run) if comm.rank == 0 else None)


def collect_study(study: Study, folder: str | Path) -> StudyCounts:
    """Write the tables of the cases that have ended, and run nothing; for parts, also while they run.

    Args:
        study: the study.
        folder: where its parts were run.

    Raises:
        InputError: the folder contains no study.

    Examples:
        >>> from asperity.study import Study, collect_study, run_study
        >>> base = {
        ...     "units": "other", "surface": {"kind": "flat", "L": 1.0}, "material": {"E": 1.0, "nu": 0.3},
        ...     "mesh": {"h_contact": 1.0, "h_max": 1.0}, "loading": {"delta_max": 0.01, "steps": 3},
        ...     "output": {"figures": False, "report": False},
        ... }
        >>> study = Study.from_dict({"base": base, "grid": {"material.nu": [0.2, 0.3]}})
        >>> run_study(study, "out/parts", only=(1, 2)).run, run_study(study, "out/parts", only=(2, 2)).run
        (1, 1)
        >>> collect_study(study, "out/parts")
        StudyCounts(cases=2, done=2, failed=0, run=0)
    """
    folder = Path(folder)
    if not (folder / ABOUT).is_file():
        raise InputError(f"{folder} holds no study; run asperity study first")
    write_tables(study, folder)
    return _count(study, folder, range(len(study.entries)), 0)


def _count(study: Study, folder: Path, chosen: Sequence[int], run: int) -> StudyCounts:
    states = [state for i in chosen if (state := case_state(folder, study.entries[i].key)) is not None]
    done = sum(state["exit_reason"] == "done" for state in states)
    return StudyCounts(len(chosen), done, len(states) - done, run)


def part(entries: Sequence[Entry], number: int, parts: int) -> list[int]:
    """Return the case numbers of a part of a study; all parts together are the study.

    Cases with the same mesh are next to each other, so that few parts build the same mesh. The parts differ by one case
    at most, and depend on the study only, not on what is finished.

    Args:
        entries: of the study.
        number: of the part, from 1.
        parts: number of all parts; those beyond the number of cases are empty.

    Raises:
        InputError: there is no part of that number.

    Examples:
        >>> from asperity.study.run import part
        >>> part([], 1, 2)
        []
    """
    if not 1 <= number <= parts:
        raise InputError(
            f"--only {number}/{parts} is no part: the first is 1/{max(parts, 1)}, the last {parts}/{parts}"
        )
    batches: dict[str, list[int]] = {}
    for i, entry in enumerate(entries):
        batches.setdefault(mesh_key(entry.case), []).append(i)
    ordered = [i for batch in batches.values() for i in batch]
    first, last = ((n * len(ordered)) // parts for n in (number - 1, number))
    return ordered[first:last]


def run_portion(
    entries: Sequence[Entry], folder: Path, comm: MPI.Comm, retry: bool = False
) -> Iterator[tuple[Entry, dict[str, Any]]]:
    """Run cases that share a mesh; yields each case with its exit state; collective.

    A case is left out that another job computes, or has ended since the portions were made.
    """
    mesh: Path | AsperityError | None = None
    for entry in entries:
        with ExitStack() as claim:
            mine, before = on_root_bcast(comm, partial(_claim, claim, folder, entry.key))
            if not mine or not _is_due(before, retry):
                continue
            start = perf_counter()
            if mesh is None and shares_mesh(entry.case):
                mesh = shared_mesh(entry.case, folder, comm)
            found = _attempt(entry.case, case_folder(folder, entry.key), mesh, before is not None, comm)
            gc.collect()
            found |= {"seconds": round(perf_counter() - start, 3)}
            if comm.rank == 0:
                _write(case_folder(folder, entry.key) / DONE, json.dumps(found, indent=2) + "\n")
            yield entry, found


def _claim(claim: ExitStack, folder: Path, key: str) -> tuple[bool, dict[str, Any] | None]:
    """Claim a case until `claim` is closed: whether that succeeded, and the exit state of the case."""
    return claim.enter_context(claimed(folder, key)), case_state(folder, key)


def _is_due(state: dict[str, Any] | None, retry: bool) -> bool:
    """Whether a case is to be run, by its exit state."""
    return state is None or (retry and state["exit_reason"] != "done")


def _attempt(case: Case, place: Path, mesh: Path | AsperityError | None, again: bool, comm: MPI.Comm) -> dict[str, Any]:
    """Run a case; return its exit state; collective.

    Args:
        case: the input.
        place: its folder.
        mesh: the file of its mesh, None for one of its own, or why there is none.
        again: whether it has ended before, so that it starts anew.
        comm: the ranks.

    Raises:
        Interrupted: a signal requested the end.
    """
    found: dict[str, Any] = {}
    try:
        if isinstance(mesh, AsperityError):
            raise mesh
        on_root(comm, partial(remove_outcome, place))
        surface = case.build_surface()
        found["summit_on_edge"] = int(bool(doubt_of_edge(case.block.sides, surface)))
        _run(case, place, mesh, again, comm)
        reason = "done"
    except Interrupted:
        raise  # the case has not ended
    except AsperityError as error:
        reason = f"{type(error).__name__}: {error}"
    except Exception as error:
        if comm.size > 1:
            raise
        place.mkdir(parents=True, exist_ok=True)
        _write(place / ERROR, traceback.format_exc())
        reason = f"{type(error).__name__}: {error}"
    return {"exit_reason": reason} | found


def remove_outcome(place: Path) -> None:
    """Remove the files that record the end of an earlier run of a case; `run` does not know them."""
    for name in (DONE, ERROR):
        (place / name).unlink(missing_ok=True)


def _run(case: Case, place: Path, mesh: Path | None, again: bool, comm: MPI.Comm) -> None:
    from asperity.mesh.block import BlockMesh
    from asperity.run_case import run

    block = None if mesh is None else on_root(comm, partial(BlockMesh.read, mesh))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AssumptionWarning)  # the summary of each case has them
        try:
            run(case, place, resume=not again, force=again, block=block, comm=comm)
        except CheckpointError:  # what a killed job left cannot be continued
            if again:
                raise
            run(case, place, force=True, block=block, comm=comm)


def shares_mesh(case: Case) -> bool:
    """Whether the mesh of a case depends only on its surface, block, element sizes and greatest approach."""
    return case.accuracy.tolerance is None and case.mesh.file is None and case.loading.delta_max is not None


def mesh_key(case: Case) -> str:
    """Return the name of the mesh of a case; cases with the same name can share it."""
    data = case.content()
    parts = [data["surface"], data["block"]["height"], data["mesh"], data["loading"].get("delta_max")]
    if case.block.sides == "periodic":  # opposite sides of its mesh fit
        parts.append(case.block.sides)
    if not shares_mesh(case):
        parts.append(case.hash())
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def shared_mesh(case: Case, folder: Path, comm: MPI.Comm) -> Path | AsperityError:
    """Return the file of the mesh of a case, built if missing, or the error of building it; collective."""
    from asperity.model.settings import MeshSize
    from asperity.quasistatic.make import make_block

    path = (folder / MESHES / f"{mesh_key(case)}.npz").absolute()
    if comm.bcast(path.is_file() if comm.rank == 0 else None):
        return path
    m, delta = case.mesh, case.loading.delta_max
    assert delta is not None

    def save() -> None:
        assert block is not None
        path.parent.mkdir(parents=True, exist_ok=True)
        block.save(path)

    try:
        size = MeshSize(m.h_contact, m.growth, m.h_max)
        block = make_block(comm, case.build_surface(), case.block.height, delta, size, case.block.sides)
        on_root(comm, save)
    except AsperityError as error:
        return error
    return path


def _prepare(
    study: Study, folder: Path, lock: FolderLock, chosen: Sequence[int], retry: bool, groups: int
) -> list[list[int]] | AsperityError:
    """Return portions of the numbers of the cases to run, or why none can be run."""
    try:
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder} is a file; give a folder to -o")
        names = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
        if ABOUT not in names and any(name not in LOCK_FILES and not is_aside(name) for name in names):
            raise InputError(f"{folder} is not empty and holds no study; give another folder to -o")
        folder.mkdir(parents=True, exist_ok=True)
        lock.take()
        if lock.shared:
            write_about(study, folder)
        else:
            for place in (folder, folder / MESHES):
                remove_asides(place)
            write_tables(study, folder)
    except AsperityError as error:
        return error
    except OSError as error:
        return InputError(f"{folder} cannot be written: {error.strerror}")
    todo = [i for i in chosen if _is_due(case_state(folder, study.entries[i].key), retry)]
    return portions(study.entries, todo, groups)


def portions(entries: Sequence[Entry], todo: Sequence[int], groups: int) -> list[list[int]]:
    """Divide case numbers into portions with one mesh each, small enough to keep all groups busy to the end."""
    batches: dict[str, list[int]] = {}
    for i in todo:
        batches.setdefault(mesh_key(entries[i].case), []).append(i)
    size = max(1, -(-len(todo) // (PORTIONS * groups))) if groups > 1 else len(todo)
    return [batch[i : i + size] for batch in batches.values() for i in range(0, len(batch), size)]


class Queue:
    """Two counters shared by all ranks of a communicator: portions taken and cases finished.

    They are in the memory of rank 0 and are updated by atomic one-sided operations, so that rank 0 can compute at the
    same time.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        from mpi4py import MPI

        self._comm, self._add = comm, MPI.SUM
        size = MPI.INT64_T.Get_size()
        self._window = MPI.Win.Allocate(2 * size if comm.rank == 0 else 0, size, comm=comm)
        if comm.rank == 0:
            np.frombuffer(self._window.tomemory(), dtype=np.int64)[:] = 0
        comm.Barrier()

    def take(self) -> int:
        """Return the number of the next portion and advance the counter."""
        return self._next(0)

    def count(self) -> int:
        """Count a finished case; return the number of finished cases."""
        return self._next(1) + 1

    def _next(self, place: int) -> int:
        one, before = np.ones(1, np.int64), np.zeros(1, np.int64)
        self._window.Lock(0)
        self._window.Fetch_and_op(one, before, 0, place, self._add)
        self._window.Unlock(0)
        return int(before[0])

    def close(self) -> None:
        """Wait for all ranks and free the counters; collective."""
        self._comm.Barrier()
        self._window.Free()


def _line(entry: Entry, state: dict[str, Any], keys: Sequence[str], done: int, total: int, left: float) -> str:
    values = ", ".join(f"{k.split('.')[1]} {v:.6g}" for k in keys if isinstance(v := entry.value(k), int | float))
    end = "" if state["exit_reason"] == "done" else f"  FAILED {state['exit_reason']}"
    return f"{done:{len(str(total))}}/{total}  {values}  {state['seconds']:.1f} s, {duration(left)} left{end}"


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, text.encode())
