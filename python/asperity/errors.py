# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Exceptions and warnings, one per kind of failure; each exception has the exit code of the command line."""

from __future__ import annotations


class AsperityError(Exception):
    """Base class of all errors that this package raises intentionally.

    >>> import asperity as asp
    >>> asp.AsperityError.exit_code, asp.InputError("...").exit_code
    (1, 2)
    """

    exit_code = 1


class InputError(AsperityError):
    """A case file, an argument or a data file is wrong; nothing has been written.

    >>> import asperity as asp
    >>> asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.1, dims=3)
    Traceback (most recent call last):
        ...
    asperity.errors.InputError: surface.dims = 3 is not legal: it must be 1 or 2.
    """

    exit_code = 2


class MeshError(InputError):
    """The surface cannot be meshed with the requested size.

    >>> from asperity.errors import MeshError
    >>> from asperity.mesh.block import BlockMesh
    >>> try:
    ...     BlockMesh.read("absent.npz")
    ... except MeshError as error:
    ...     print(str(error)[:20])
    mesh.file: absent.np
    """


class RangeError(InputError):
    """A law or a table was evaluated outside its range.

    >>> import asperity as asp
    >>> issubclass(asp.RangeError, asp.InputError)
    True
    """


class ConvergenceError(AsperityError):
    """The solver stopped before the end of the load path; the curve up to there is kept.

    >>> import asperity as asp
    >>> asp.ConvergenceError.exit_code
    3
    """

    exit_code = 3


class Interrupted(ConvergenceError):
    """The run received a request to stop; the curve up to there is kept.

    Examples:
        >>> from asperity.errors import Interrupted
        >>> issubclass(Interrupted, asp.ConvergenceError), Interrupted.exit_code
        (True, 3)
    """


class CheckError(ConvergenceError):
    """The run ended, but its result violates a balance that every correct result satisfies.

    Examples:
        >>> from asperity.errors import CheckError
        >>> issubclass(CheckError, asp.ConvergenceError), CheckError.exit_code
        (True, 3)
    """


class CheckpointError(InputError):
    """A checkpoint is missing, damaged, or belongs to another case or mesh.

    >>> import asperity as asp
    >>> asp.CheckpointError("...").exit_code
    2
    """


class CompatError(AsperityError):
    """A package of the environment is missing or has an unsupported version.

    >>> from asperity.runtime.compat import require
    >>> require("absent", "python3-absent")
    Traceback (most recent call last):
        ...
    asperity.errors.CompatError: the Python module absent is missing: install python3-absent or asperity[solve]
    """

    exit_code = 4


class OutputError(AsperityError):
    """A result cannot be written (no space, no permission, no folder); earlier files are unchanged.

    Examples:
        >>> from asperity.errors import OutputError
        >>> OutputError("...").exit_code
        4
    """

    exit_code = 4


class AsperityWarning(UserWarning):
    """Base class of the warnings of this package; a run records them in its summary, log and report.

    Examples:
        >>> import warnings
        >>> import asperity as asp
        >>> with warnings.catch_warnings(record=True) as caught:
        ...     warnings.simplefilter("always", asp.AsperityWarning)
        ...     asp.Surface.from_spec("weierstrass-mandelbrot", L=1e-6, D=2.1, G=1e-10).check_small_slope()
        >>> [issubclass(w.category, asp.AsperityWarning) for w in caught]
        [True]
    """


class CaseWarning(AsperityWarning):
    """A case is legal, but a value is improbable or has no effect.

    Examples:
        >>> case = asp.Case.from_dict({
        ...     "surface": {"kind": "sphere", "L": 1e-6, "radius": 1e-5}, "material": {"E": 200e9, "nu": 0.3},
        ...     "loading": {"delta_max": 1e-9}, "contact": {"gamma": 2.0},
        ... })
        >>> case.warnings()  # `case.problem` issues each as a CaseWarning
        ['contact.gamma = 2 is not used: contact.method is active-set']
    """


class AssumptionWarning(AsperityWarning):
    """The result violates an assumption of the model.

    Examples:
        >>> from asperity.errors import AssumptionWarning
        >>> issubclass(AssumptionWarning, asp.AsperityWarning)
        True
    """


class ResolutionWarning(AsperityWarning):
    """The mesh is too coarse for the contact, or for the waves of the surface.

    Examples:
        >>> import warnings
        >>> from asperity.errors import ResolutionWarning
        >>> from asperity.mesh.resolution import warn_of_missed_waves
        >>> rough = asp.Surface.from_spec("weierstrass-mandelbrot", L=1e-6, D=2.4, G=1e-12)
        >>> with warnings.catch_warnings(record=True) as caught:
        ...     warnings.simplefilter("always")
        ...     warn_of_missed_waves(rough, h=0.2e-6, delta=1e-9)
        >>> [issubclass(w.category, ResolutionWarning) for w in caught]
        [True]
    """
