"""Run the studies of the paper, cases/paper/families.toml, and print the power law of every level.

    ./run mpirun -n 2 python3 benchmarks/paper.py out/paper [FAMILY ...]

What the folder holds already is not repeated.
"""

from __future__ import annotations

import math
import sys
import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from asperity.curve import Curve
from asperity.curve.slope import fitted_rows
from asperity.study import Entry, Study, case_folder, run_study
from asperity.study.run import case_state
from asperity.vibration import ContactOscillator, PowerLaw

HERE = Path(__file__).parent.parent / "cases/paper"
#: leading key of a family -> its symbol, factor and unit
KEYS = {
    "surface.D": ("D", 1.0, ""),
    "surface.G": ("G", 1.0, " m"),
    "material.yield_strength": ("σ_y", 1e9, " GPa"),
    "material.tangent_modulus": ("E_t", 1e9, " GPa"),
}
#: Columns after family and level, with their formats: mean, and standard deviation over the surfaces.
COLUMNS = {
    "δ*max": ".3g", "k": ".3g", "n": ".3f", "n, log fit": ".3f", "R²": ".4f", "κ": ".3f", "ω_loss/ω_s": ".3f",
    "A/A₀": ".2f", "p / block yield": ".2f",
}  # fmt: skip


def results(entry: Entry, folder: Path) -> tuple[float, ...]:
    """Values of the columns of a case."""
    curve, solid = Curve.read(case_folder(folder, entry.key) / "curve.csv"), entry.case.material.solid
    load, fit, yields = curve.loading(), curve.fit(), math.nan
    if entry.case.material.yield_strength is not None:
        yields = entry.case.surface.L**2 * solid.yield_pressure(entry.case.block.sides)
    ends = ContactOscillator(PowerLaw(fit.n)).thresholds()
    rows = fitted_rows(load.delta, load.force)
    of_logarithms = np.polyfit(np.log(load.delta_star[rows]), np.log(load.P_star[rows]), 1)[0]
    return (
        float(load.delta_star.max()), fit.k, fit.n, float(of_logarithms), fit.r2, ends.kappa, ends.omega_loss,
        float(load.area_fraction[-1]), float(load.force[-1]) / yields,
    )  # fmt: skip


def levels(name: str, grid: dict[str, Any], folder: Path) -> list[list[str]]:
    """A line for each level of a family, the lightest values first as in the file; collective."""
    study = Study.from_dict({"base": "base.toml", "grid": grid}, folder=HERE, source=name)
    run_study(study, folder, say=lambda line: print(line, flush=True))
    key = next(key for key in KEYS if len({entry.value(key) for entry in study.entries}) > 1)
    symbol, factor, unit = KEYS[key]
    found: dict[str, list[tuple[float, ...]]] = {}
    for entry in study.entries:
        if (case_state(folder, entry.key) or {}).get("exit_reason") != "done":
            continue
        value = entry.value(key)
        text = "elastic" if value is None else f"{symbol} = {value / factor:.4g}{unit}"
        found.setdefault(text, []).append(results(entry, folder))
    lines = []
    for text, rows in found.items():
        line = [name, text]
        for values, form in zip(np.transpose(rows), COLUMNS.values(), strict=True):
            spread = f" ({values.std(ddof=1):{form}})" if np.ptp(values) > 0.0 else ""
            line.append(f"{values.mean():{form}}{spread}" if np.isfinite(values).all() else "-")
        lines.append(line)
    return lines


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    families = tomllib.loads((HERE / "families.toml").read_text(encoding="utf-8"))
    chosen = {name: grid for name, grid in families.items() if not sys.argv[2:] or name in sys.argv[2:]}
    rows = [line for name, grid in chosen.items() for line in levels(name, grid, Path(sys.argv[1]) / name)]
    if MPI.COMM_WORLD.rank == 0:
        header = ["family", "level", *COLUMNS]
        print(*("| " + " | ".join(line) + " |" for line in (header, ["---"] * len(header), *rows)), sep="\n")
