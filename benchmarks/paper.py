"""Run the studies of the paper, cases/paper/families.toml, and print the power law of every level.

    ./run mpirun -n 2 python3 benchmarks/paper.py out/paper [FAMILY ...]

What the folder holds already is not repeated. The second table has the steps of the exponent between the levels of a
family, surface by surface.
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
from scipy.stats import ttest_1samp

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


def steps(name: str, levels: dict[str, list[Row]]) -> list[tuple[str, ...]]:
    """Change of n from level to level, surface by surface, with its 95 % interval."""
    out: list[tuple[str, ...]] = []
    for (low, before), (high, after) in zip(list(levels.items())[:-1], list(levels.items())[1:], strict=True):
        n = [{row["surface.seed"]: row["n"] for row in rows} for rows in (before, after)]
        change = np.array([n[1][seed] - n[0][seed] for seed in n[0].keys() & n[1].keys()])
        ends = ttest_1samp(change, 0.0).confidence_interval() if change.size > 1 else (-math.inf, math.inf)
        up = int(np.sum(change > 0.0))
        out.append(
            (
                name,
                f"{low} to {high}",
                f"{change.mean():+.3f}",
                "{:+.3f} to {:+.3f}".format(*ends),
                f"{up} of {change.size}",
            )
        )
    return out


def show(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a Markdown table."""
    print(
        *("| " + " | ".join(line) + " |" for line in (header, ["---"] * len(header), *rows)), "", sep="\n", flush=True
    )


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
        show(HEADER, [row for name, found in levels.items() for row in fits(name, found)])
        names = ("family", "levels", "change of n", "95 %", "surfaces on which n rises")
        show(names, [row for name, found in levels.items() for row in steps(name, found)])


if __name__ == "__main__":
    main()
