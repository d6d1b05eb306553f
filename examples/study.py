"""A study: one case with some keys varied, one process a run; a run that is finished is not repeated.

    ./run python3 examples/study.py out/study 2

The folder receives one folder a run and results.csv, a row a run; the number is that of runs at a time. Change CASE and
GRID for a study of your own. The same command continues a study that was stopped.
Another base case takes another folder.
"""

import csv
import itertools
import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import asperity as asp

CASE = "cases/quick.toml"
GRID: dict[str, list[Any]] = {"surface.seed": [0, 1], "material.nu": [0.25, 0.3]}


def row_of(folder: Path, base: str, point: dict[str, Any]) -> dict[str, Any]:
    """Run or continue a point of the grid, unless it is finished; its results at the greatest load, or the reason."""
    place = folder / ",".join(f"{key.rpartition('.')[2]}={value}" for key, value in point.items())
    summary = place / "summary.json"
    if not (summary.is_file() and json.loads(summary.read_text())["finished"]):
        changes = [f"--set={key}={value}" for key, value in point.items()]
        command = [sys.executable, "-m", "asperity", "run", base, *changes, "-o", str(place), "--resume", "--quiet"]
        done = subprocess.run(command, stderr=subprocess.PIPE, text=True)
        if done.returncode:
            return point | {"reason": done.stderr.strip().rpartition("\n")[2]}
    curve = asp.Curve.read(place / "curve.csv")
    fit = curve.fit()
    return point | {"k": fit.k, "n": fit.n, "force": curve.force.max(), "reason": "done"}


def main(folder: str, runs: int = 2, base: str = CASE, grid: dict[str, list[Any]] = GRID) -> list[dict[str, Any]]:
    """Run the missing points of a grid, some at a time; return and write their rows."""
    points = [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]
    for point in points:  # before the first run starts
        asp.Case.load(base, [f"{key}={value}" for key, value in point.items()])
    with ThreadPoolExecutor(runs) as pool:
        rows = list(pool.map(lambda point: row_of(Path(folder), base, point), points))
    with (Path(folder) / "results.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, (*grid, "k", "n", "force", "reason"))
        writer.writeheader()
        writer.writerows(rows)
    return rows


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
