"""Exceptions, one per kind of failure; each carries the process exit code of the command line."""

from __future__ import annotations


class AsperityError(Exception):
    """Base of every error this package raises on purpose."""

    exit_code = 1


class InputError(AsperityError):
    """A case file, an argument or a data file is wrong; nothing has been written."""

    exit_code = 2


class MeshError(InputError):
    """The surface cannot be meshed at the requested size."""


class RangeError(InputError):
    """A law or a table is asked for a value outside the range it is known on."""


class ConvergenceError(AsperityError):
    """The solver stopped before the end; the part of the curve before it is kept."""

    exit_code = 3


class Interrupted(ConvergenceError):
    """The run was asked to stop; the part of the curve before it is kept."""


class CheckError(ConvergenceError):
    """The run ended, but its result violates a balance that every correct result keeps."""


class CheckpointError(InputError):
    """A checkpoint is missing, damaged, or belongs to another case or mesh."""


class CompatError(AsperityError):
    """A package of the environment is missing or has an unsupported version."""

    exit_code = 4


class OutputError(AsperityError):
    """A result cannot be written: no space, no permission, no folder; earlier files are untouched."""

    exit_code = 4


class AsperityWarning(UserWarning):
    """Base of the warnings of this package; a run keeps those given meanwhile in its summary, log and report."""


class CaseWarning(AsperityWarning):
    """A case is legal, but a value is improbable or has no effect."""


class AssumptionWarning(AsperityWarning):
    """The result lies beyond what the model assumes."""


class ResolutionWarning(AsperityWarning):
    """The mesh is too coarse for the contact, or for the waves of the surface."""
