"""How time and memory of a load step grow with the size of the problem.

    ./run python3 benchmarks/speed.py step [H ...]

The surface of cases/single.toml with its material is pressed to 0.02 L in one step, in a process of its own. H is the
element size in the contact in units of L.
"""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from collections.abc import Iterable
from math import log
from time import process_time
from typing import Any

import asperity as asp

L = 1e-6
STEEL = asp.Material(200e9, 0.3, 1e9, 10e9)
DELTA = 0.02  # greatest approach [L]
SIZES = (0.03, 0.0125, 0.0066, 0.0053)  # of the elements [L]


def one(h: float) -> dict[str, Any]:
    """Facts of one run."""
    warnings.simplefilter("ignore")
    surface = asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=L, D=2.4, G=1.36e-11)
    cpu = process_time()
    path: dict[str, Any] = {"delta_max": DELTA * L, "steps": 1, "integrator": "backward-euler"}
    result = asp.solve_contact(surface, STEEL, size=asp.MeshSize(h * L), **path)
    counts = {"dofs": result.dofs, "newton": result.counts.newton, "krylov": result.counts.krylov}
    return counts | {"cpu": process_time() - cpu, "memory": result.memory}


def row(cells: Iterable[object]) -> None:
    """Print a row of a table."""
    print("| " + " | ".join(f"{c:.3g}" if isinstance(c, float) else str(c) for c in cells) + " |", flush=True)


def step(sizes: tuple[float, ...]) -> None:
    """A row for each size: one step of backward Euler, which does not depend on the path."""
    row(("dofs", "Newton", "Krylov", "CPU s", "order", "CPU s a Newton iteration", "order", "GiB"))
    row(["---"] * 8)
    before: list[tuple[int, float]] = []
    for h in sizes:
        facts = run_apart(h)
        now = [(facts["dofs"], facts["cpu"]), (facts["dofs"], facts["cpu"] / facts["newton"])]
        orders = [f"{_slope(a, b):.2f}" for a, b in zip(before, now, strict=True)] if before else ["", ""]
        row((facts["dofs"], facts["newton"], facts["krylov"], now[0][1], orders[0], now[1][1], orders[1],
             facts["memory"] / 2**30))  # fmt: skip
        before = now


def _slope(a: tuple[int, float], b: tuple[int, float]) -> float:
    return log(b[1] / a[1]) / log(b[0] / a[0])


def run_apart(h: float) -> dict[str, Any]:
    """A run in a process of its own, so that its memory is its own."""
    command = [sys.executable, __file__, "one", str(h)]
    out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    facts: dict[str, Any] = json.loads(out.splitlines()[-1])
    return facts


if __name__ == "__main__":
    if sys.argv[1:2] == ["one"]:
        print(json.dumps(one(float(sys.argv[2]))))
    else:
        step(tuple(map(float, sys.argv[2:])) or SIZES)
