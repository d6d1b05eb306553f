"""asperity against CalculiX and Tamaas: time and memory at equal error of the force.

    benchmarks/peers/install                                        once: fetches the programs
    ./run python3 benchmarks/peers/compare.py [elastic] [plastic]

All programs press the same surface on the same block in the same ten load steps (`scene`; more where the table says
so), on one thread, each run in a process of its own. Seconds are CPU seconds of that process, user and system, start-up
included; what is not counted is the making of the meshes and decks of the others. Errors are root mean squares over the
path, relative to the reference force. Each run is kept in out/peers: the command continues where it was stopped; what
is to be made again is removed there. Prints Markdown tables; `../evidence.py` draws the stored ones.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import programs
import scene
from programs import Job, Run

TARGETS = (0.05, 0.02, 0.01, 0.005)
TOLERANCE = {"elastic": 0.002, "plastic": 0.01}  # of the reference: greatest error bar
FARTHEST = 100.0  # times the CPU time of the most expensive run, up to which its line is extended


@dataclass(frozen=True)
class Point:
    """A run and its error over the path; NaN when it did not end."""

    run: Run
    error: float


@dataclass(frozen=True)
class Cost:
    """What an error costs: `sign` is "" between two runs, "≈" beyond them, "≤" where the cheapest run is better."""

    sign: str
    cpu: float
    memory: float

    def __str__(self) -> str:
        return f"{self.sign}{number(self.cpu)} s, {self.sign}{number(self.memory / 2**20)} MiB"


def jobs(material: str, force: scene.Floats) -> Iterator[Job]:
    """The runs, quick ones of each program first."""
    plastic = material == "plastic"
    for h in (0.2, 0.14, 0.1, 0.07, 0.05, 0.035):
        yield programs.asperity(material, "size", h, 20 if plastic and h < 0.12 else scene.STEPS)
    for tolerance in (0.2, 0.1, 0.05, 0.02, 0.01):
        if tolerance > TOLERANCE[material]:
            yield programs.asperity(material, "tolerance", tolerance)
    if not plastic:
        for n in (32, 64, 128, 256):
            yield programs.tamaas(n, (force[0], force[-1]))
    for h in (0.14, 0.1) if plastic else (0.14, 0.1, 0.07):
        yield programs.calculix_own(material, h)
    for n in (16, 24, 32, 64):
        yield programs.calculix_grid(material, n)
    if plastic:
        yield programs.calculix_own(material, 0.1, 40)
        yield programs.calculix_grid(material, 32, 40)


def measure(material: str, folder: Path) -> list[Point]:
    """Make the runs and print their table."""
    reference = programs.asperity(material, "tolerance", TOLERANCE[material]).run(folder)
    assert reference.bar is not None
    force = np.array(reference.force)
    print(f"\n## {material}\n\nThe reference force is known to {reference.bar:.1%}.\n")
    print("| program | mesh | dofs | CPU s | memory MiB | rms error % | at first step % | at last step % |")
    print("|---|---|---|---|---|---|---|---|")
    points = []
    for job in jobs(material, force):
        run = job.run(folder)
        whole = len(run.force) == len(force)
        off = 100.0 * (np.array(run.force) / force[: len(run.force)] - 1.0)
        error = float(np.sqrt(np.mean(off**2))) / 100.0 if whole else np.nan
        points.append(Point(run, error))
        cells = [run.program, run.mesh, run.dofs, number(run.cpu), round(run.memory / 2**20)]
        if run.ended != "done":
            cells[3] = f"> {cells[3]}, {run.ended} in step {len(off) + 1}"
        cells += [f"{100 * error:.2f}" if whole else "", f"{off[0]:+.1f}" if len(off) else ""]
        print("| " + " | ".join(map(str, [*cells, f"{off[-1]:+.1f}" if whole else ""])) + " |", flush=True)
    return points


def number(value: float) -> str:
    """Three digits, without exponent."""
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def cost(points: list[Point], target: float) -> Cost | None:
    """CPU time and memory from which on the error stays below a target, on the line through a program's runs.

    The line is straight in logarithms between two runs; a run with a small error does not count where a more expensive
    one has a larger one again: nobody knows beforehand which mesh is lucky. Beyond the most expensive run the line is
    that of the last two. None where it does not fall, or too slowly.
    """
    done = sorted((p for p in points if np.isfinite(p.error)), key=lambda p: p.run.cpu)
    if len(done) < 2:
        return None
    error = np.log([p.error for p in done])
    costs = np.log([(p.run.cpu, p.run.memory) for p in done])
    over = np.flatnonzero(error > np.log(target))
    if not len(over):
        return Cost("≤", *np.exp(costs[0]))
    k = min(over[-1], len(done) - 2)
    if error[k] <= error[k + 1]:
        return None
    part = (error[k] - np.log(target)) / (error[k] - error[k + 1])
    there = costs[k] + part * (costs[k + 1] - costs[k])
    if there[0] > costs[-1, 0] + np.log(FARTHEST):
        return None
    return Cost("≈" if part > 1.0 else "", *np.exp(there))


def compare(points: list[Point]) -> None:
    """Print what each error costs with each program, and how many times what it costs with asperity."""
    names = list(dict.fromkeys(p.run.program for p in points))
    lines = {name: [cost([p for p in points if p.run.program == name], t) for t in TARGETS] for name in names}
    print(
        "\n| program | " + " | ".join(f"{100 * t:g} %: CPU, memory | times the CPU of asperity" for t in TARGETS) + " |"
    )
    print("|---" * (1 + 2 * len(TARGETS)) + "|")
    for name, costs in lines.items():
        cells = []
        for own, found in zip(lines["asperity"], costs, strict=True):
            cells += ["not reached" if found is None else str(found), ratio(found, own)]
        print(f"| {name} | " + " | ".join(cells) + " |")


def ratio(found: Cost | None, own: Cost | None) -> str:
    """How many times the CPU time of asperity it is; a bound where one of the two is."""
    if found is None or own is None:
        return ""
    sign = found.sign or {"≤": "≥"}.get(own.sign, own.sign)
    return f"{sign}{number(found.cpu / own.cpu)}"


def main(materials: list[str], folder: Path) -> None:
    """Make the runs that are missing, print the tables."""
    print(f"Versions: {programs.versions()}\n\n{programs.cpu_name()}")
    for material in materials or scene.MATERIALS:
        compare(measure(material, folder))


if __name__ == "__main__":
    main(sys.argv[1:], Path("out/peers").absolute())
