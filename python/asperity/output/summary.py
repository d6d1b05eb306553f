"""Contents of summary.json."""

from __future__ import annotations

import platform
from dataclasses import asdict
from importlib import metadata
from typing import Any

from asperity.case import Case
from asperity.power_law import PowerLawFit
from asperity.quasistatic.solve_contact import ContactResult

PACKAGES = ("numpy", "scipy", "mpi4py", "petsc4py", "gmsh")


def summarise(case: Case, contact: ContactResult, fit: PowerLawFit | None, ranks: int) -> dict[str, Any]:
    """Contents of summary.json."""
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
        "case_hash": case.hash(),
        "versions": versions(),
    }


def versions() -> dict[str, str]:
    """Versions of this package and of what it computes with."""
    from asperity import __version__

    found = {"asperity": __version__, "python": platform.python_version()}
    try:
        import dolfinx

        found["dolfinx"] = dolfinx.__version__
    except ImportError:
        pass
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found
