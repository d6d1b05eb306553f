"""Folder of a run: its checkpoint, and input, curve and summary, written as it proceeds; contents of the summary."""

from __future__ import annotations

import json
import platform
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict
from functools import cached_property, partial
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from asperity.case import Case
from asperity.case.case_file import identity, refuse_run_of_another
from asperity.curve import Curve
from asperity.errors import ConvergenceError, InputError
from asperity.output.results import Results
from asperity.runtime import run_folder
from asperity.runtime.files import UNREADABLE, files_into, read_text, remove_asides, replace_file
from asperity.runtime.parallel import on_root, on_root_bcast
from asperity.runtime.usage import peak
from asperity.version import __version__

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.quasistatic.checkpoint import Checkpoint
    from asperity.quasistatic.contact_result import ContactResult

T = TypeVar("T")

PACKAGES = ("dolfinx", "numpy", "scipy", "mpi4py", "petsc4py", "gmsh")


class RunFiles:
    """Folder of a run; without one nothing is written. All methods are collective, and rank 0 writes.

    Attributes:
        folder: of the run
    """

    def __init__(
        self, case: Case, folder: Path | None, comm: MPI.Comm, open_log: Callable[[bool], None] = lambda append: None
    ) -> None:
        """`open_log` starts the log file, or appends to it."""
        self.folder = folder
        self._case, self._comm, self._open_log = case, comm, open_log
        self._begun = self._continues = self._replaces = self._whole = False

    @contextmanager
    def opened(self, resume: bool, force: bool) -> Iterator[tuple[Curve, dict[str, Any]] | None]:
        """Lock the folder against other runs, and see whether there is a state to continue from; writes no result.

        Where a finished run holds everything the case requests, its curve and summary are all that is read.

        Raises:
            InputError: what `run_folder.check` refuses
            CheckpointError: of a run that cannot be continued
            OutputError: the folder cannot be written
        """
        self._on_root(partial(run_folder.check, resume=resume, force=force))
        done = self._finished() if resume else None
        if done is not None or self.checkpoint is None:
            yield done
            return
        with ExitStack() as lock:
            self._on_root(lambda folder: lock.enter_context(run_folder.working_in(folder)))
            self._replaces, self._continues = force, resume and self.checkpoint.found()
            if resume and not self._continues:
                self._on_root(partial(refuse_run_of_another, self._case))
            if not self._continues:
                self.checkpoint.ignore()
            yield None

    def _on_root(self, work: Callable[[Path], T]) -> T | None:
        """Call a function with the folder, if there is one, and broadcast its result."""
        return None if self.folder is None else on_root_bcast(self._comm, partial(work, self.folder))

    @cached_property
    def checkpoint(self) -> Checkpoint | None:
        """Checkpoint of the run, if it has a folder."""
        from asperity.quasistatic.checkpoint import Checkpoint

        if self.folder is None:
            return None
        place, every = self.folder / run_folder.CHECKPOINT, self._case.output.checkpoint
        return Checkpoint(place, identity(self._case), self._comm, every)

    def _finished(self) -> tuple[Curve, dict[str, Any]] | None:
        """Curve and summary when the folder holds everything the case requests, else None."""

        def read(folder: Path) -> tuple[Curve, dict[str, Any]] | None:
            summary = read_summary(folder)
            if summary.get("finished") is not True or summary.get("case_hash") != self._case.hash():
                return None
            try:
                text = read_text(folder / run_folder.CASE)
                curve = Curve.read(folder / run_folder.CURVE)
            except (*UNREADABLE, InputError):
                return None
            return (curve, summary) if text == self._case.to_toml() else None

        return self._on_root(read)

    def begin(self) -> None:
        """Write the completed input and start the log, at the first call.

        Of a run that continues, a finished one is marked unfinished, and the files that it writes again are removed.
        """

        def mark(folder: Path) -> None:
            before = read_summary(folder)
            if before.get("finished"):
                _write_summary(before | {"finished": False}, folder)
            replace_file(folder / run_folder.CASE, self._case.to_toml().encode())

        def clear(folder: Path) -> None:
            remove_asides(folder)
            run_folder.clear(folder, run_folder.PRODUCTS if self._replaces else run_folder.DERIVED)

        if self._begun or self.checkpoint is None:
            return
        self._on_root(mark)  # first: what a kill leaves counts as a run, and not as a finished one
        if not self._continues:
            self.checkpoint.clear()
        self._on_root(clear)
        self._begun = True
        self._open_log(self._continues)

    def saved(self) -> bool:
        """Whether the checkpoint holds a state."""
        states = f"{run_folder.CHECKPOINT}/**/{run_folder.STATE}"
        return bool(self._on_root(lambda folder: any(folder.glob(states))))

    def withdraw(self) -> None:
        """Remove what a run wrote that is refused after it began, for example when its next mesh cannot be made.

        A run that continues keeps its files, and files of other origin stay.
        """

        def withdraw(folder: Path) -> None:
            run_folder.clear(folder)
            (folder / run_folder.CASE).unlink(missing_ok=True)

        if self.checkpoint is not None and self._begun and not self._continues:
            self.checkpoint.clear()
            self._on_root(withdraw)

    def curve(self, curve: Curve, whole: bool = True) -> None:
        """Write the curve; the steps so far replace no whole one, which a coarser mesh has given."""
        if whole or not self._whole:
            self._whole = whole
            self._on_root(lambda folder: curve.write(folder / run_folder.CURVE))

    def fields(self, contact: ContactResult) -> None:
        """Write the snapshots of a run with a folder into fields/: for figures and ParaView."""
        from asperity.output import fields

        assert self.folder is not None
        E, place = self._case.material.E, self.folder / run_folder.FIELDS
        top = fields.gather_top_states(contact, self._case.surface.L, E)
        grid = fields.gather_grid(contact, E) if self._case.output.fields else {}

        def write() -> None:
            assert top is not None
            with files_into(place) as aside:
                np.savez_compressed(aside / run_folder.TOP, **top)
                if grid:
                    fields.write_grid(aside / run_folder.VTKHDF, grid, [s.step for s in contact.snapshots])

        on_root(self._comm, write)

    def summary(self, summary: dict[str, Any], failure: ConvergenceError | None) -> None:
        """Write summary.json; a failure is its reason to end."""
        if failure is not None:
            summary["exit_reason"] = str(failure)
        self._on_root(partial(_write_summary, summary))


def read_summary(folder: Path) -> dict[str, Any]:
    """Contents of summary.json of a run; nothing where it is absent or damaged."""
    with suppress(InputError):
        return dict(Results.read(folder, parts=("summary",)).summary)
    return {}


def _write_summary(summary: dict[str, Any], folder: Path) -> None:
    text = json.dumps(summary, indent=2, default=float)
    replace_file(folder / run_folder.SUMMARY, f"{text}\n".encode())


def summarise(case: Case, contact: ContactResult, ranks: int) -> dict[str, Any]:
    """Contents of summary.json."""
    fit = contact.curve.fit_or_none()
    return {
        "exit_reason": contact.reason,
        "finished": False,
        "fit": None if fit is None else fit.to_dict(),
        "dofs": contact.dofs,
        "cells": contact.cells,
        **asdict(contact.counts),
        "checks": contact.checks.physical(case.surface.L, case.material.E),
        "unresolved": contact.curve.unresolved(),
        "seconds": {k: round(v, 4) for k, v in contact.phases.seconds.items()},
        "calls": contact.phases.calls,
        "peak_memory_MiB": round(contact.memory / 2**20, 1),
        "ranks": ranks,
        "seed": getattr(case.surface, "seed", None),
        **({"scan": about} if (about := getattr(case.surface, "about", None)) else {}),
        "case_hash": case.hash(),
        **({"law": {"source": law.source, "sha256": law.digest or None}} if (law := case.material.law) else {}),
        "versions": versions(),
    }


def of_ranks(comm: Any, seconds: dict[str, float]) -> dict[str, Any]:
    """Memory of each rank, and the longest time of each phase, as a section; collective."""
    peaks, times = zip(*comm.allgather((round(peak() / 2**20, 1), seconds)), strict=True)
    slowest = {name: round(max(each.get(name, 0.0) for each in times), 4) for name in times[0]}
    return {"peak_memory_MiB": list(peaks), "slowest_seconds": slowest}


def versions() -> dict[str, str]:
    """Versions of this package and of what it computes with."""
    found = {"asperity": __version__, "python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:  # dolfinx of Debian, and petsc4py in PyPI's wheel of dolfinx
            if hasattr(sys.modules.get(name), "__version__"):
                found[name] = sys.modules[name].__version__
    return found
