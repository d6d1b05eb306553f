"""Run the studies of the paper, cases/paper/families.toml, and print the power law of every level.

    ./run mpirun -n 2 python3 benchmarks/paper.py out/paper [FAMILY ...]

What the folder holds already is not repeated.
"""

from __future__ import annotations

import argparse
import math
import tomllib
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from asperity.curve import Curve
from asperity.dynamics import ContactOscillator, PowerLaw
from asperity.study import Study, case_folder, read_table, run_study

HERE = Path(__file__).parent.parent / "cases/paper"
#: leading key of a family -> its symbol, factor and unit
KEYS = {
    "surface.D": ("D", 1.0, ""),
    "surface.G": ("G", 1.0, " m"),
    "material.yield_strength": ("σ_y", 1e9, " GPa"),
    "material.tangent_modulus": ("E_t", 1e9, " GPa"),
}
HEADER = ("family", "level", "δ*max", "k", "n", "n, log fit", "R²", "κ", "ω_loss/ω_s", "A/A₀", "p / block yield")
Row = dict[str, Any]


def solve(name: str, grid: dict[str, Any], folder: Path) -> dict[str, list[Row]]:
    """Rows of a family by level, lightest values first as in the file, each with the fits of its curve; collective."""
    study = Study.from_dict({"base": "base.toml", "grid": grid}, folder=HERE, source=name)
    run_study(study, folder, say=lambda line: print(line, flush=True))
    varied = [key for key in KEYS if len({entry.value(key) for entry in study.entries}) > 1]
    levels: dict[str, list[Row]] = {}
    for row in read_table(folder):
        if row["exit_reason"] != "done":
            continue
        symbol, factor, unit = KEYS[varied[0]]
        value = row[varied[0]]
        text = "elastic" if value is None else f"{symbol} = {value / factor:.4g}{unit}"
        curve = Curve.read(case_folder(folder, row["case"]) / "curve.csv")
        ends = ContactOscillator(PowerLaw(row["n"])).thresholds()
        row |= {"n_log": curve.fit("log").n, "kappa": ends.kappa, "omega_loss": ends.omega_loss}
        levels.setdefault(text, []).append(row)
    return levels


def spread(rows: Sequence[Row], name: str, form: str = ".3f") -> str:
    """Mean of a column, and its standard deviation over the surfaces; a dash where it is unknown."""
    values = np.array([math.nan if row[name] is None else row[name] for row in rows])
    values = values[np.isfinite(values)]
    if not values.size:
        return "-"
    return f"{values.mean():{form}}" + (f" ({values.std(ddof=1):{form}})" if values.size > 1 else "")


def fits(name: str, levels: dict[str, list[Row]]) -> list[tuple[str, ...]]:
    """Power law of each level of a family."""
    mean: Callable[[Sequence[Row], str], float] = lambda rows, column: float(np.mean([row[column] for row in rows]))  # noqa: E731
    return [
        (
            name, text, f"{mean(rows, 'delta_star_max'):.3g}", spread(rows, "k", ".3g"), spread(rows, "n"),
            spread(rows, "n_log"), f"{mean(rows, 'r2'):.4f}", spread(rows, "kappa"), spread(rows, "omega_loss"),
            spread(rows, "area_fraction", ".2f"), spread(rows, "block_load", ".2f"),
        )
        for text, rows in levels.items()
    ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of the studies")
    parser.add_argument("families", nargs="*", help="all by default")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    families = tomllib.loads((HERE / "families.toml").read_text(encoding="utf-8"))
    levels = {
        name: solve(name, grid, arguments.folder)
        for name, grid in families.items()
        if not arguments.families or name in arguments.families
    }
    if MPI.COMM_WORLD.rank == 0:
        rows = [row for name, found in levels.items() for row in fits(name, found)]
        print(*("| " + " | ".join(line) + " |" for line in (HEADER, ["---"] * len(HEADER), *rows)), sep="\n")


if __name__ == "__main__":
    main()
