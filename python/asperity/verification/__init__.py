"""Verification: computed cases against the references of `asperity.reference`, each row with an error bar.

A row passes if its error is within its bar. The bar is computed: it is the error of the discretisation, estimated from
three meshes, plus the error of the reference for this problem (scatter of a fit, grid of a numerical solution, slopes
and sides that a theory neglects). The cases run on one rank.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from typing import TYPE_CHECKING

from asperity.errors import InputError
from asperity.runtime.display import nearest

if TYPE_CHECKING:
    from asperity.verification.table import Row

# name -> module and function that yields its rows
_CASES = {
    "patch": "patch.patch",
    "hertz": "hertz.hertz",
    "stiffness": "stiffness.stiffness",
    "slip": "slip.slip",
    "westergaard": "waves.westergaard",
    "flattened-sphere": "flattening.flattened_sphere",
}
NAMES = tuple(_CASES)


def verify(names: Iterable[str] = (), on_case: Callable[[str, list[Row]], None] | None = None) -> list[Row]:
    """Compute cases and compare them with their references; returns the rows of all.

    Args:
        names: of NAMES; all when empty
        on_case: called after each case with its name and rows

    Raises:
        InputError: unknown name

    Examples:
        >>> rows = verify(["patch"])
        >>> all(row.passed for row in rows)
        True
    """
    names = tuple(names) or NAMES
    for name in names:
        if name not in _CASES:
            raise InputError(f'verification case "{name}" is not one of {", ".join(NAMES)}{nearest(name, NAMES)}')
    out: list[Row] = []
    for name in names:
        module, function = _CASES[name].split(".")
        case: Callable[[], Iterator[Row]] = getattr(import_module(f"{__name__}.{module}"), function)
        rows = list(case())
        out += rows
        if on_case is not None:
            on_case(name, rows)
    return out
