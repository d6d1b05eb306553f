"""How time and memory of a load step grow with the size of the problem, and the time of a load path in two clones.

    ./run python3 benchmarks/speed.py step [H ...]
    ./run python3 benchmarks/speed.py path CLONE ...      # by turns

The surface of cases/single.toml with its material is pressed to 0.02 L, in a process of its own: in one step, or in ten
and released. H is the element size in the contact in units of L.
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
TURNS = 3
SIZES = (0.03, 0.0125, 0.0066, 0.0053)  # of the elements [L]


def one(h: float, **path: Any) -> dict[str, Any]:
    """Facts of one run."""
    warnings.simplefilter("ignore")
    surface = asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=L, D=2.4, G=1.36e-11)
    cpu = process_time()
    result = asp.solve_contact(surface, STEEL, size=asp.MeshSize(h * L), delta_max=DELTA * L, **path)
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
        facts = run_apart(str(h), sys.executable)
        now = [(facts["dofs"], facts["cpu"]), (facts["dofs"], facts["cpu"] / facts["newton"])]
        orders = [f"{_slope(a, b):.2f}" for a, b in zip(before, now, strict=True)] if before else ["", ""]
        row((facts["dofs"], facts["newton"], facts["krylov"], now[0][1], orders[0], now[1][1], orders[1],
             facts["memory"] / 2**30))  # fmt: skip
        before = now


def path(clones: list[str]) -> None:
    """A row for each run: CPU seconds of a load path in the clones by turns."""
    row(("clone", "Newton", "Krylov", "CPU s"))
    row(["---"] * 4)
    for clone in TURNS * clones:
        facts = run_apart("path", f"{clone}/run", "python3")
        row((clone, facts["newton"], facts["krylov"], facts["cpu"]))


def _slope(a: tuple[int, float], b: tuple[int, float]) -> float:
    return log(b[1] / a[1]) / log(b[0] / a[0])


def run_apart(what: str, *python: str) -> dict[str, Any]:
    """A run in a process of its own, so that its memory is its own."""
    command = [*python, __file__, "one", what]
    out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    facts: dict[str, Any] = json.loads(out.splitlines()[-1])
    return facts


if __name__ == "__main__":
    if sys.argv[1:] == ["one", "path"]:
        print(json.dumps(one(0.06, steps=10, unload_steps=5)))
    elif sys.argv[1:2] == ["one"]:
        print(json.dumps(one(float(sys.argv[2]), steps=1, integrator="backward-euler")))
    elif sys.argv[1:2] == ["path"]:
        path(sys.argv[2:])
    else:
        step(tuple(map(float, sys.argv[2:])) or SIZES)
