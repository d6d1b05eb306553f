# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Cases per hour of a study on two cores, against shell loops over the same cases.

    ./run python3 benchmarks/ensembles.py [SEEDS]       four seeds unless told; two materials each

The three ways run one after another: `asperity study --ranks 2`; a loop of `asperity run`; two such loops side by side.
Processor seconds are those of all processes, and on a busy machine they compare better than the seconds of the clock.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import perf_counter

STRENGTHS = ("1e9", "2e9")
BASE = """
[surface]
kind = "weierstrass-mandelbrot"
L = 1e-6
D = 2.4
G = 1.36e-11
[material]
E = 200e9
nu = 0.3
yield_strength = 1e9
tangent_modulus = 10e9
kinematics = "small"
[loading]
delta_max = 0.01e-6
steps = 5
[mesh]
h_contact = 0.08e-6
"""


def run(folder: Path, *arguments: str) -> None:
    """Run a command of asperity in a folder."""
    subprocess.run(
        ["asperity", *arguments], cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


def study(folder: Path, seeds: int) -> None:
    """All cases by one command."""
    grid = f'"surface.seed" = {{first = 0, count = {seeds}}}\n"material.yield_strength" = [{", ".join(STRENGTHS)}]'
    (folder / "study.toml").write_text(f'title = "Ensemble"\nbase = "base.toml"\n[grid]\n{grid}\n')
    run(folder, "study", "study.toml", "-o", "study", "--ranks", "2", "--no-figures", "--quiet")


def loop(folder: Path, seeds: int, loops: int = 1) -> None:
    """A command for each case, in so many loops side by side."""

    def case(number: int) -> None:
        changed = f"surface.seed={number // 2}", f"material.yield_strength={STRENGTHS[number % 2]}"
        settings = [part for text in changed for part in ("--set", text)]
        run(folder, "run", "base.toml", "-o", f"loop{loops}-{number}", "--quiet", *settings)

    with ThreadPoolExecutor(loops) as pool:
        list(pool.map(case, range(2 * seeds)))


def main(seeds: int) -> None:
    """Print the table."""
    ways: dict[str, Callable[[Path], None]] = {
        "asperity study --ranks 2": lambda folder: study(folder, seeds),
        "loop of asperity run": lambda folder: loop(folder, seeds),
        "two such loops side by side": lambda folder: loop(folder, seeds, 2),
    }
    print("| way | cases | s | cases an hour | processor s a case |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder, cases = Path(name), 2 * seeds
        (folder / "base.toml").write_text(BASE)
        for way, work in ways.items():
            start, before = perf_counter(), processor_time()
            work(folder)
            seconds = perf_counter() - start
            spent = (processor_time() - before) / cases
            print(f"| {way} | {cases} | {seconds:.1f} | {3600 * cases / seconds:.0f} | {spent:.2f} |", flush=True)


def processor_time() -> float:
    """Processor seconds of the processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 4)
