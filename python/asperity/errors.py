"""Exceptions and warnings, one per kind of failure; each exception has the exit code of the command line."""

from __future__ import annotations

import logging
import sys
import warnings
from typing import Any

WARNINGS = "asperity.warnings"  # the logger that has a record of each warning, whatever filters do with it


class AsperityError(Exception):
    """Base class of all errors that this package raises intentionally."""

    exit_code = 1


class InputError(AsperityError):
    """A case file, an argument or a data file is wrong; nothing has been written."""

    exit_code = 2


class MeshError(InputError):
    """The surface cannot be meshed with the requested size."""


class RangeError(InputError):
    """A law or a table was evaluated outside its range, as by a preload beyond the curve."""

    exit_code = 3


class ConvergenceError(AsperityError):
    """The solver stopped before the end of the load path; `result`, where it is known, holds what was reached."""

    exit_code = 3

    def __init__(self, message: str, result: Any = None) -> None:
        super().__init__(message)
        self.result = result


class Interrupted(ConvergenceError):
    """The run received a request to stop; the curve up to there is kept."""


class CheckError(ConvergenceError):
    """The run ended, but its result, which `result` holds, violates a balance that every correct result satisfies."""


class CheckpointError(InputError):
    """A checkpoint is missing, damaged, or belongs to another case or mesh."""


class CompatError(AsperityError):
    """A package of the environment is missing or has an unsupported version."""

    exit_code = 4


class OutputError(AsperityError):
    """A result cannot be written (no space, no permission, no folder); earlier files are unchanged."""

    exit_code = 4


class AsperityWarning(UserWarning):
    """Base class of the warnings of this package; a run records them in its summary, log and report."""


class CaseWarning(AsperityWarning):
    """A case is legal, but a value is improbable or has no effect."""


class AssumptionWarning(AsperityWarning):
    """The result violates an assumption of the model."""


class ResolutionWarning(AsperityWarning):
    """The mesh is too coarse for the contact, or for the waves of the surface."""


def warn(text: str, category: type[AsperityWarning] = AsperityWarning) -> None:
    """Issue a warning that points to the line which called this package, whatever is in between; and log it."""
    logging.getLogger(WARNINGS).info("warning: %s", text)
    frame, level, outside = sys._getframe(1), 2, 2  # 1 is this function
    while frame is not None:
        if frame.f_globals.get("__name__", "").partition(".")[0] == __name__.partition(".")[0]:
            outside = level + 1
        frame, level = frame.f_back, level + 1  # type: ignore[assignment]
    warnings.warn(text, category, stacklevel=outside)
