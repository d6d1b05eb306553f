"""Run the cases of a study: the ranks take them in turn, failures are recorded, and a table has a row a case."""

from __future__ import annotations

import gc
import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import AssumptionWarning, CheckpointError, InputError, Interrupted
from asperity.output.assumption import DOUBTFUL
from asperity.output.run_files import read_summary
from asperity.runtime.files import UNREADABLE, is_aside, read_text, remove_asides, replace_file, write_csv
from asperity.runtime.parallel import on_root_bcast
from asperity.runtime.progress import duration
from asperity.runtime.run_folder import CURVE, LOCK, working_in
from asperity.study.definition import Entry, Study

if TYPE_CHECKING:
    from mpi4py import MPI

Row = dict[str, Any]

TABLE = "results.csv"
DONE = "done.json"  # exit reason and time of a case
#: Columns of results.csv after "case" and the keys that vary.
RESULT_COLUMNS = (
    "exit_reason", "delta_star_max", "P_star_max", "error_P_star", "k", "n", "n_low", "n_high", "r2", "force", "k_n",
    "error_k_n", "area_fraction", "plastic_fraction", "max_plastic_strain", "doubtful", "dofs", "cells", "newton",
    "seconds",
)  # fmt: skip


class StudyCounts(NamedTuple):
    """Numbers of cases of a study: all, finished now or before, failed, and run now."""

    cases: int
    done: int
    failed: int
    run: int


def run_study(
    study: Study, folder: str | Path, *, comm: MPI.Intracomm | None = None, say: Callable[[str], None] | None = None
) -> StudyCounts:  # fmt: skip
    """Run the missing cases of a study and write its table; collective over `comm`.

    Each rank takes the next case by a common counter. A case whose results are in the folder is not repeated; cases are
    identified by the hash of the completed input. An error is recorded with its case, and the next case starts. A case
    that was stopped, or has failed, continues from its last saved step when the job is started again.

    Args:
        study: the study to run
        folder: receives results.csv and cases/HASH/
        comm: communicator; default all ranks
        say: called with a line for each case, on its rank

    Raises:
        InputError: the folder contains other files, or another job works in it
        Interrupted: a signal requested the end; what is finished is kept

    Examples:
        >>> from asperity.study import Study
        >>> base = {
        ...     "units": "other", "surface": {"kind": "flat", "L": 1.0}, "material": {"E": 1.0, "nu": 0.3},
        ...     "mesh": {"h_contact": 1.0, "h_max": 1.0}, "loading": {"delta_max": 0.01, "steps": 3},
        ... }
        >>> run_study(Study.from_dict({"base": base, "grid": {"material.nu": [0.2, 0.3]}}), "out/study")
        StudyCounts(cases=2, done=2, failed=0, run=2)
    """
    from mpi4py import MPI
    from mpi4py.util.sync import Counter

    comm = MPI.COMM_WORLD if comm is None else comm
    folder = Path(folder)
    total, run = len(study.entries), 0
    with ExitStack() as lock:
        todo = on_root_bcast(comm, partial(_prepare, study, folder, lock))
        turns, ended = Counter(comm=comm), Counter(comm=comm)
        start = perf_counter()
        while (turn := next(turns)) < len(todo):
            entry = study.entries[todo[turn]]
            state = _run_case(entry.case, case_folder(folder, entry.key))
            run += 1
            finished = next(ended) + 1
            if say is not None:
                left = (perf_counter() - start) * (len(todo) / finished - 1)
                say(_line(entry, state, study.keys, total - len(todo) + finished, total, left))
        turns.free()  # waits for all ranks
        ended.free()
    run = comm.allreduce(run)
    states = on_root_bcast(comm, lambda: [case_state(folder, entry.key) for entry in study.entries])
    reasons = [state["exit_reason"] for state in states if state is not None]
    done = reasons.count("done")
    return StudyCounts(total, done, len(reasons) - done, run)


def _run_case(case: Case, place: Path) -> dict[str, Any]:
    """Run or continue a case in its folder on this rank, and return its exit state."""
    from mpi4py import MPI

    from asperity.job.run_case import run

    start, reason = perf_counter(), "done"
    try:
        (place / DONE).unlink(missing_ok=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", AssumptionWarning)  # the summary of each case has them
            try:
                run(case, place, resume=True, comm=MPI.COMM_SELF)
            except CheckpointError:  # what a killed job left cannot be continued
                run(case, place, force=True, comm=MPI.COMM_SELF)
    except Interrupted:
        raise  # the case has not ended
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
    gc.collect()
    found = {"exit_reason": reason, "seconds": round(perf_counter() - start, 3)}
    place.mkdir(parents=True, exist_ok=True)
    replace_file(place / DONE, (json.dumps(found, indent=2) + "\n").encode())
    return found


def _prepare(study: Study, folder: Path, lock: ExitStack) -> list[int]:
    """Numbers of the cases to run; `lock` locks the folder, refused if not usable, and ends with the table."""
    try:
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder} is a file; give a folder to -o")
        names = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
        if TABLE not in names and any(name != LOCK and not is_aside(name) for name in names):
            raise InputError(f"{folder} is not empty and holds no study; give another folder to -o")
        folder.mkdir(parents=True, exist_ok=True)
        lock.enter_context(working_in(folder))
        remove_asides(folder)
        write_table(study, folder)
    except OSError as error:
        raise InputError(f"{folder} cannot be written: {error.strerror}") from None
    lock.callback(write_table, study, folder)  # also where the study is stopped
    states = [case_state(folder, entry.key) for entry in study.entries]
    return [i for i, state in enumerate(states) if state is None or state["exit_reason"] != "done"]


def _line(entry: Entry, state: dict[str, Any], keys: Sequence[str], done: int, total: int, left: float) -> str:
    values = ", ".join(f"{k.split('.')[1]} {v:.6g}" for k in keys if isinstance(v := entry.value(k), int | float))
    end = "" if state["exit_reason"] == "done" else f"  FAILED {state['exit_reason']}"
    return f"{done:{len(str(total))}}/{total}  {values}  {state['seconds']:.1f} s, {duration(left)} left{end}"


def summarise_case(curve: Curve, summary: Mapping[str, Any]) -> Row:
    """Results of one case; those that cannot be computed from its curve are missing.

    Args:
        curve: its curve
        summary: contents of its summary.json, or an empty mapping

    Returns:
        columns of the curve at the greatest load; k, n, n_low, n_high, r2 of its power law, with the interval of n;
        names of doubtful assumptions
    """
    load = curve.loading()
    if not len(load):
        return {}
    doubts = [line["name"] for line in summary.get("assumptions", []) if line["verdict"] == DOUBTFUL]
    last = list(load.rows())[-1]
    row: Row = {
        **{name: None if last.get(name) != last.get(name) else last.get(name) for name in RESULT_COLUMNS},
        "delta_star_max": float(load.delta_star.max()),
        "P_star_max": float(load.P_star.max()),
        "seconds": sum((summary.get("seconds") or {}).values()) or None,
        "doubtful": "; ".join(doubts) or None,
        **{name: summary.get(name) for name in ("dofs", "cells", "newton")},
    }
    fit = curve.fit_or_none()
    if fit is not None:
        row |= {"k": fit.k, "n": fit.n, "n_low": fit.ci_n[0], "n_high": fit.ci_n[1], "r2": fit.r2}
    return row


def write_table(study: Study, folder: Path) -> None:
    """Write results.csv: a row for each case that has ended, in the order of the study."""
    rows = []
    for entry in study.entries:
        done = case_state(folder, entry.key)
        if done is None:
            continue
        row = {"case": entry.key, **{k: entry.value(k) for k in study.keys}}
        row |= {name: done.get(name) for name in ("exit_reason", "seconds")}
        place = case_folder(folder, entry.key)
        if (place / CURVE).is_file():
            curve = Curve.read(place / CURVE)
            try:
                row = summarise_case(curve, read_summary(place)) | row
            except UNREADABLE:  # a summary with values of other types
                row = summarise_case(curve, {}) | row
        rows.append(row)
    write_csv(folder / TABLE, ("case", *study.keys, *RESULT_COLUMNS), rows)


def case_folder(folder: str | Path, key: str) -> Path:
    """Folder of a case, with the files of its run."""
    return Path(folder) / "cases" / key


def case_state(folder: Path, key: str) -> dict[str, Any] | None:
    """exit_reason and seconds [s] of a case; None if it has not ended."""
    try:
        state: dict[str, Any] = json.loads(read_text(case_folder(folder, key) / DONE))
    except (OSError, ValueError):
        return None
    return state
