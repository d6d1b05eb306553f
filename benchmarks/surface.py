# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Print the CPU time and memory of surface evaluation as a Markdown table."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable

import numpy as np

from asperity.surface import WeierstrassMandelbrot


def cpu_seconds(task: Callable[[], object]) -> float:
    """Return the CPU seconds of one call."""
    start = time.process_time()
    task()
    return time.process_time() - start


def main() -> None:
    """Time grids, scattered points, the exact maximum and the statistics of the base surface."""
    L = 1e-6
    x, y = np.random.default_rng(0).uniform(0, L, size=(2, 1_000_000))

    def surface(f_max: int = 5) -> WeierstrassMandelbrot:
        return WeierstrassMandelbrot(L=L, f_max=f_max)

    tasks: dict[str, Callable[[], object]] = {
        "heights on a 4096 x 4096 grid": lambda: surface().grid(4096),
        "heights at 1e6 scattered points": lambda: surface().height(x, y),
        "gradients at 1e6 scattered points": lambda: surface().gradient(x, y),
        "exact maximum, f_max = 5": lambda: surface().maximum(),
        "exact maximum, f_max = 10": lambda: surface(10).maximum(),
        "exact maximum, f_max = 20": lambda: surface(20).maximum(),
        "statistics, 1025 x 1025": lambda: surface().statistics(),
        "radial power spectrum, 1024 x 1024": lambda: surface().psd(),
    }
    print("| task | CPU s | peak memory so far, MiB |\n|---|---|---|")
    for name, task in tasks.items():
        seconds = cpu_seconds(task)
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"| {name} | {seconds:.3f} | {memory:.0f} |")


if __name__ == "__main__":
    main()
