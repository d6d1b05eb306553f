# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Newton and Krylov iterations of a load step on rough maps with many contact spots.

    ./run python3 benchmarks/iterations.py [N] [H] [SEED ...]     N x N heights, element size H in the contact [L]

The surfaces are those of scan.py, one for each seed, pressed to one per cent of contact area in ten planned steps when
elastic and eight when elastic-plastic. The last column is the time of the load path in CPU seconds.
"""

from __future__ import annotations

import sys
import warnings
from time import process_time

from scan import MATERIALS, L, approach

import asperity as asp
from asperity.surface import SelfAffine

STEPS = {"elastic": 10, "plastic": 8}


def main(n: int, h: float, seeds: tuple[int, ...]) -> None:
    """Print the table."""
    print("| map | seed | material | dofs | steps | Newton a step | Krylov a solve | shortened | spots | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for seed in seeds:
        surface = SelfAffine(L=L, H=0.8, slope=0.46, lambda_roll=L / 4, lambda_short=5 * L / n, seed=seed)
        for name, material in MATERIALS.items():
            depth = approach(surface, material)
            start = process_time()
            size = asp.MeshSize(h * L)
            result = asp.solve_contact(surface, material, delta_max=depth, steps=STEPS[name], size=size)
            seconds = process_time() - start - result.phases.seconds["mesh"]
            counts, spots = result.counts, result.curve.spots[-1]
            print(
                f"| {n} | {seed} | {name} | {result.dofs} | {counts.steps} | {counts.newton / counts.steps:.2f} | "
                f"{counts.krylov / counts.newton:.2f} | {counts.shortened} | {spots:.0f} | {seconds:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    numbers = sys.argv[1:]
    n = int(numbers[0]) if numbers else 256
    h = float(numbers[1]) if len(numbers) > 1 else 0.016
    main(n, h, tuple(map(int, numbers[2:])) or (1, 2, 3))
