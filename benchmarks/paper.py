"""Run the studies of the paper, cases/paper/families.toml, and print the power law of every level.

    ./run mpirun -n 2 python3 benchmarks/paper.py out/paper [FAMILY ...]

What the folder holds already is not repeated.
"""

from __future__ import annotations

import itertools
import math
import sys
import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from asperity.case import Case
from asperity.curve import Curve
from asperity.curve.slope import fitted_rows
from asperity.errors import AsperityError
from asperity.job.run_case import run
from asperity.runtime import compat
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


def cases_of(grid: dict[str, list[Any]]) -> list[tuple[dict[str, Any], Case]]:
    """Points of a grid with their cases; "a.b, c.d" varies two keys together, an empty text removes a key."""
    axes = []
    for names, values in grid.items():
        keys = names.split(", ")
        axes.append([dict(zip(keys, value if len(keys) > 1 else [value], strict=True)) for value in values])
    points = [{key: value for part in parts for key, value in part.items()} for parts in itertools.product(*axes)]
    return [(point, Case.load(HERE / "base.toml", [f"{k}={v}" for k, v in point.items()])) for point in points]


def results(case: Case, curve: Curve) -> tuple[float, ...]:
    """Values of the columns of a case."""
    load, fit, yields = curve.loading(), curve.fit(), math.nan
    if case.material.yield_strength is not None:
        yields = case.surface.L**2 * case.material.yield_pressure(case.block.sides)
    ends = ContactOscillator(PowerLaw(fit.n)).thresholds()
    rows = fitted_rows(load.delta, load.force)
    of_logarithms = np.polyfit(np.log(load.delta_star[rows]), np.log(load.P_star[rows]), 1)[0]
    return (
        float(load.delta_star.max()), fit.k, fit.n, float(of_logarithms), fit.r2, ends.kappa, ends.omega_loss,
        float(load.area_fraction[-1]), float(load.force[-1]) / yields,
    )  # fmt: skip


def levels(name: str, grid: dict[str, Any], folder: Path) -> list[list[str]]:
    """A line for each level of a family, the lightest values first as in the file; collective."""
    comm, cases = MPI.COMM_WORLD, cases_of(grid)
    curves = {}
    for number in range(comm.rank, len(cases), comm.size):
        place = folder / cases[number][1].hash()[:15]
        try:
            curves[number] = run(cases[number][1], place, resume=True, comm=MPI.COMM_SELF).curve
        except AsperityError as error:
            print(f"{name}, {cases[number][0]}: {error}", flush=True)
    curves = {number: curve for part in comm.allgather(curves) for number, curve in part.items()}
    key = next(key for key in KEYS if len({point.get(key) for point, _ in cases}) > 1)
    symbol, factor, unit = KEYS[key]
    found: dict[str, list[tuple[float, ...]]] = {}
    for number in sorted(curves):
        point, case = cases[number]
        text = "elastic" if point[key] == "" else f"{symbol} = {point[key] / factor:.4g}{unit}"
        found.setdefault(text, []).append(results(case, curves[number]))
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
    compat.start()
    families = tomllib.loads((HERE / "families.toml").read_text(encoding="utf-8"))
    chosen = {name: grid for name, grid in families.items() if not sys.argv[2:] or name in sys.argv[2:]}
    rows = [line for name, grid in chosen.items() for line in levels(name, grid, Path(sys.argv[1]) / name)]
    if MPI.COMM_WORLD.rank == 0:
        header = ["family", "level", *COLUMNS]
        print(*("| " + " | ".join(line) + " |" for line in (header, ["---"] * len(header), *rows)), sep="\n")
