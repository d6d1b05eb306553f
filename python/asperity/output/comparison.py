"""Reference curves: stored with case, mesh and versions, and compared with a tolerance per column."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity.case import Case
from asperity.curve import COLUMNS, Curve
from asperity.errors import InputError
from asperity.output.results import Results
from asperity.runtime.display import show
from asperity.runtime.run_folder import CASE

#: Relative tolerances of all columns except the branch, which must be the same, and the cost of a step.
TOLERANCES: Mapping[str, float] = {
    name: 1e-3 for name in COLUMNS if name not in ("step", "branch", "newton", "krylov", "seconds")
} | {"delta": 1e-9, "delta_star": 1e-9, "force": 1e-6, "P_star": 1e-6}


def store_curve(folder: str | Path, file: str | Path, tolerances: Mapping[str, float] | None = None) -> Curve:
    """Write the curve of a finished run as a reference for `compare_curves`; its header records how it was computed.

    Args:
        folder: of the run
        file: CSV file to write
        tolerances: relative, of columns that have others than TOLERANCES

    Raises:
        InputError: the folder contains no finished run, or a tolerance is illegal
    """
    folder, file = Path(folder), Path(file)
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder of a run, from which a reference is stored")
    if file.is_dir():
        raise InputError(f"{file} is a folder; give the file that receives the reference")
    results = Results.read(folder)
    if not results.summary.get("finished"):
        raise InputError(f"{folder}: the run is not finished, a reference must be")
    case = Case.from_dict(results.case, folder=folder)
    if results.summary.get("case_hash") != case.hash():
        raise InputError(f"{folder / CASE} is not the case of the run beside it: run it again")
    place, mesh = file.resolve().parent, case.to_dict()["mesh"]
    if case.mesh.file is not None:  # no element size was used
        mesh = {"file": os.path.relpath(case.mesh.file, place)}
    header = {
        "case": case.hash(),
        "command": f"asperity compare RUN {file.name} --store",
        "mesh": {key: results.summary[key] for key in ("cells", "dofs")}
        | {key: value for key, value in mesh.items() if value is not None},
        "seed": results.summary["seed"],
        "steps": len(results.curve),
        "tolerances": compared(results.curve, results.curve, tolerances),
        "versions": results.summary["versions"],
    }
    curve = replace(results.curve, header=header)
    curve.write(file)
    return curve


@dataclass(frozen=True)
class Difference:
    """Greatest difference of two curves in one column.

    Attributes:
        column: name of the column, or "rows" when the steps do not correspond
        row: row of the greatest difference, from 0
        a: value of the first curve there
        b: value of the second curve there
        error: |a - b| over the largest magnitude of the column in the second curve
        tolerance: of the column
    """

    column: str
    row: int
    a: Any
    b: Any
    error: float
    tolerance: float

    def __str__(self) -> str:
        """One line for a report."""
        if self.column == "rows":
            return f"rows: {self.a} against {self.b}, first at step {self.row + 1}"
        return (
            f"{self.column}: {self.a!r} against {self.b!r} at step {self.row + 1}, relative difference "
            f"{self.error:.3g} > {self.tolerance:g}"
        )


def compare_curves(a: Curve, b: Curve, tolerances: Mapping[str, float] | None = None) -> list[Difference]:
    """Compare a curve with a reference, step by step.

    Args:
        a: the curve
        b: the reference; errors are relative to the largest magnitude of each of its columns
        tolerances: see `compared`

    Returns:
        One difference for each column that exceeds its tolerance, or one for the first step without
        counterpart; empty if the curves agree. NaN agrees with NaN only.

    Raises:
        InputError: as for `compared`, or the reference has no step

    Examples:
        >>> a, b = (asp.Curve.from_rows([{"delta": 1.0, "force": force, "spots": 2}]) for force in (2.0, 2.1))

        >>> [difference.column for difference in compare_curves(a, b)], compare_curves(a, b, {"force": 0.1})
        (['force'], [])
    """
    chosen = compared(a, b, tolerances)
    if not len(b):
        raise InputError("The reference has no step, so nothing is compared.")
    shared = min(len(a), len(b))
    changed = np.flatnonzero(a.branch[:shared] != b.branch[:shared])
    if changed.size:
        row = int(changed[0])
        return [Difference("rows", row, str(a.branch[row]), str(b.branch[row]), math.inf, 0.0)]
    if len(a) != len(b):
        return [Difference("rows", shared, f"{len(a)} steps", f"{len(b)} steps", math.inf, 0.0)]
    differences = []
    for name, tolerance in chosen.items():
        x, y = getattr(a, name).astype(float), getattr(b, name).astype(float)
        scale = np.max(np.abs(y[np.isfinite(y)]), initial=0.0) or 1.0
        error = np.where((x == y) | (np.isnan(x) & np.isnan(y)), 0.0, np.abs(x - y) / scale)
        error = np.nan_to_num(error, nan=np.inf, posinf=np.inf)
        row = int(np.argmax(error))
        if error[row] > tolerance:
            values = getattr(a, name)[row].item(), getattr(b, name)[row].item()
            differences.append(Difference(name, row, *values, float(error[row]), tolerance))
    return differences


def compared(a: Curve, b: Curve, tolerances: Mapping[str, float] | None = None) -> dict[str, float]:
    """Columns of a curve and its reference that are compared, with their relative tolerances.

    All columns with values in both curves, columns with a tolerance in the header of the reference, and columns of
    `tolerances`.

    Args:
        tolerances: of single columns, in place of those of the header and of TOLERANCES

    Raises:
        InputError: a tolerance is negative or no number, its column is unknown, or has no value in the reference
    """
    stored = _checked(b.header["tolerances"]) if "tolerances" in b.header else {}
    given = {} if tolerances is None else _checked(tolerances)
    if missing := [name for name in given if not _known(b, name)]:
        raise InputError(f"The reference has no value in {', '.join(missing)}, so nothing is compared there.")
    both = {name: rtol for name, rtol in TOLERANCES.items() if _known(a, name) and _known(b, name)}
    return both | {name: rtol for name, rtol in stored.items() if _known(b, name)} | given


def _known(curve: Curve, name: str) -> bool:
    """Whether a column has values; a count that no row has is 0."""
    values = getattr(curve, name)
    return bool(np.any(values != 0) if values.dtype.kind == "i" else np.isfinite(values).any())


def _checked(tolerances: Any) -> dict[str, float]:
    if not isinstance(tolerances, Mapping):
        raise InputError(f"tolerances = {show(tolerances)} must be one number for each column that is compared.")
    if not tolerances:
        raise InputError("No column has a tolerance, so nothing is compared: give one, for example force = 1e-6.")
    for name, tolerance in tolerances.items():
        if name not in COLUMNS or name == "branch":
            raise InputError(f"No tolerance can be set for {name!r}; legal: {', '.join(COLUMNS)}.")
        if not (isinstance(tolerance, int | float | np.floating | np.integer) and 0 <= tolerance < math.inf):
            raise InputError(f"The tolerance of {name} must be a finite number >= 0, not {tolerance!r}.")
    return dict(tolerances)
