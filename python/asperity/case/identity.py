"""Whether a run may go on under a case: the keys that its checkpoint depends on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from asperity.case.case_file import Case
from asperity.case.tables import NAMED_FILES
from asperity.errors import CheckpointError, InputError
from asperity.runtime.display import show
from asperity.runtime.run_folder import CASE, is_empty

#: Sections and keys that a continuation may change, because they change the curve only within the tolerance of the
#: equations; loading.cycles may also grow.
CHANGEABLE = frozenset(
    {
        *("units", "dynamics", "joint", "slip", "output"),
        *("material.density", "material.conductivity", "material.conductivity_other"),
        *("solver.linear", "accuracy.max_dofs"),
    }
)


def identity(case: Case) -> dict[str, Any]:
    """Keys of a case that its checkpoint depends on, with their values; SHA-256 of the content for a file."""
    tables = {name: table for name, table in case.content().items() if name not in CHANGEABLE}
    keys = {f"{section}.{key}": value for section, table in tables.items() for key, value in table.items()}
    return {name: value for name, value in keys.items() if name not in CHANGEABLE}


def refuse_another(path: Path, saved: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Refuse (CheckpointError) to continue the run of a file under another case, by the identities of both."""
    different = []
    for name in sorted({*saved, *now}):
        old, new = saved.get(name), now.get(name)
        more_cycles = name == "loading.cycles" and isinstance(old, int) and isinstance(new, int) and new > old
        if old != new and not more_cycles:
            there, here = ("absent" if value is None else show(value) for value in (old, new))
            is_file = tuple(name.split(".")) in NAMED_FILES
            different.append(f"{name} has another content" if is_file else f"{name} = {there} there, {here} here")
    if different:
        more = f"; and {len(different) - 3} more keys" if len(different) > 3 else ""
        raise CheckpointError(
            f"{path} belongs to another case: {'; '.join(different[:3])}{more}; resume with the case it was made for, "
            "or start again with --force"
        )


def refuse_run_of_another(case: Case, folder: Path) -> None:
    """Refuse (CheckpointError) a folder whose run, without a saved state, is not of this case or has none."""
    if is_empty(folder):
        return
    try:
        there = Case.load(folder / CASE)
    except InputError as error:
        raise CheckpointError(
            f"{folder} holds no state to resume from, and no case to start again: {error}; start again with --force"
        ) from None
    refuse_another(folder / CASE, identity(there), identity(case))
