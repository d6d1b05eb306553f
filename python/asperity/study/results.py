"""Results of a study: a table with one row per case."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import InputError
from asperity.output.assumption import DOUBTFUL
from asperity.output.assumptions import ON_EDGE
from asperity.output.run_files import read_summary
from asperity.runtime.files import UNREADABLE, read_csv, read_text, write_csv
from asperity.runtime.run_folder import CURVE
from asperity.study.definition import Study

Row = dict[str, Any]

TABLE = "results.csv"
DONE = "done.json"  # exit reason and time of a case
TEXTS = ("case", "exit_reason", "doubtful")
#: Columns of results.csv after "case" and the keys that vary.
RESULT_COLUMNS = (
    "exit_reason", "summit_on_edge", "delta_star_max", "P_star_max", "error_P_star", "k", "n", "n_low", "n_high", "r2",
    "force", "k_n", "error_k_n", "area_fraction", "plastic_fraction", "max_plastic_strain", "block_load", "doubtful",
    "dofs", "cells", "newton", "seconds",
)  # fmt: skip


def summarise_case(case: Case, curve: Curve, summary: Mapping[str, Any]) -> Row:
    """Results of one case; those that cannot be computed from its curve are missing.

    Args:
        case: as it was run
        curve: its curve
        summary: contents of its summary.json, or an empty mapping

    Returns:
        columns of the curve at the greatest load; k, n, n_low, n_high, r2 of its power law, with the interval of n;
        block_load, the mean pressure over that at which the block itself yields; names of doubtful assumptions
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
        "summit_on_edge": int(any(name.startswith(ON_EDGE) for name in doubts)),
        **{name: summary.get(name) for name in ("dofs", "cells", "newton")},
    }
    if case.material.yield_strength is not None:
        limit = case.surface.L**2 * case.material.solid.yield_pressure(case.block.sides)
        row["block_load"] = float(load.force[-1]) / limit
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
                row = summarise_case(entry.case, curve, read_summary(place)) | row
            except UNREADABLE:  # a summary with values of other types
                row = summarise_case(entry.case, curve, {}) | row
        rows.append(row)
    write_csv(folder / TABLE, ("case", *study.keys, *RESULT_COLUMNS), rows)


def read_table(folder: str | Path) -> list[Row]:
    """Rows of results.csv, numbers as floats, missing values None; `pandas.read_csv` reads it too.

    Raises:
        InputError: the folder contains no study
    """
    try:
        columns = read_csv(Path(folder) / TABLE)
    except (OSError, ValueError) as error:
        raise InputError(f"{folder} holds no study: {error}; run asperity study first") from None

    def value(name: str, text: str) -> float | str | None:
        if text == "" or name in TEXTS:
            return text or None
        with suppress(ValueError):
            return float(text)
        return text

    rows = zip(*columns.values(), strict=True)
    return [{name: value(name, text) for name, text in zip(columns, row, strict=True)} for row in rows]


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
