# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Loops of the force about a preload on the demo surface: loss factors, first and last loop, docs/damping.md.

    python3 benchmarks/loops.py [--h-contact 0.06] [--steps 4]

Prints a table: isotropic and kinematic hardening, the preload as the greatest load and after twice as much.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path
from time import process_time

import asperity as asp
from asperity.case import Case
from asperity.quasistatic.force_loops import solve_loops

CASE = Path(__file__).parent.parent / "cases" / "demo.toml"
AMPLITUDES, CYCLES = (0.1, 0.3, 0.6), 8


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--h-contact", type=float, default=0.06, help="element size at the contact over L")
    parser.add_argument("--steps", type=int, default=4, help="of a quarter of a loop")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    heads = (
        "hardening", "greatest force over preload", "amplitude of the force", "deflection over L", "eta, first loop",
        "eta, last loop", "loops", "greatest imbalance", "CPU s",
    )  # fmt: skip
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|")
    for hardening in ("isotropic", "kinematic"):
        keys = [f"mesh.h_contact={options.h_contact}e-6", "loading.unload=false", "material.kinematics=small"]
        case = Case.load(CASE, [*keys, "loading.steps=10", f"material.hardening={hardening}"])
        problem = case.problem()
        result = asp.solve_problem(problem)
        top, side = float(result.curve.force[-1]), problem.surface.L
        for over in (1, 2):
            for amplitude in AMPLITUDES:
                begun = process_time()
                preload = top / over
                table = solve_loops(problem, result, preload, [amplitude], cycles=CYCLES, steps=options.steps)
                found = table.loops
                worst = max(abs(loop.imbalance) for loop in found)
                print(
                    f"| {hardening} | {over} | {amplitude:g} | {found[-1].deflection / side:.3g} | "
                    f"{found[0].eta:.2g} | {found[-1].eta:.1e} | {len(found)} | {worst:.1e} | "
                    f"{process_time() - begun:.0f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
