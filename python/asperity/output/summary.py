"""Contents of summary.json."""

from __future__ import annotations

import platform
import sys
from dataclasses import asdict
from importlib import metadata
from typing import Any

from asperity.case import Case
from asperity.quasistatic.contact_result import ContactResult
from asperity.runtime.memory import peak
from asperity.runtime.timing import Clock
from asperity.version import __version__

PACKAGES = ("dolfinx", "numpy", "scipy", "mpi4py", "petsc4py", "gmsh")


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


def of_ranks(comm: Any, seconds: dict[str, float], clock: Clock) -> dict[str, Any]:
    """Memory and time by ranks, as a section; collective.

    Args:
        seconds: by phase, of this rank
        clock: of the job, since its last start
    """
    peaks, times = zip(*comm.allgather((round(peak() / 2**20, 1), seconds)), strict=True)
    slowest = {name: round(max(each.get(name, 0.0) for each in times), 4) for name in times[0]}
    return {
        "peak_memory_MiB": list(peaks),
        "slowest_seconds": slowest,
        "rank_0_alone_seconds": round(clock.alone, 4),
        "serial_share": round(clock.alone / clock.wall, 4),
    }


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
