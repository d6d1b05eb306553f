# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Measure the cost of a degree of freedom:  python3 benchmarks/estimate.py

Runs the surface of the demo on a row of meshes, each in a process of its own, and prints the table of
docs/tables/estimate.csv and the constants of `asperity.adaptive.estimate`. CPU seconds, so that other work on the
machine matters little.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asperity.adaptive.estimate import ELASTIC, PLASTIC, Rates, estimate
from asperity.case import Case

SIZES = (0.1, 0.06, 0.04, 0.03)  # h_contact [L]
DEMO = Path(__file__).parent.parent / "cases/demo.toml"
COMMON = (
    *(f"output.{name}=false" for name in ("figures", "fields", "report", "stiffness")),
    *("loading.unload=false", "loading.steps=6", "loading.delta_max=0.03e-6", 'material.kinematics="small"'),
)
MATERIALS = {"elastic": ("material.yield_strength=", "material.tangent_modulus="), "plastic": ()}


@dataclass(frozen=True)
class Sample:
    """One run: its input, what it was, what it took."""

    case: Case
    dofs: int
    steps: int
    setup: float
    seconds: float
    memory: float


def measure(kind: str, h: float) -> Sample:
    """Run a case and read what it took; seconds of CPU, memory in bytes."""
    keys = [*COMMON, *MATERIALS[kind], f"mesh.h_contact={h}e-6"]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        data = Case.load(DEMO, keys).to_dict()
        data.pop("dynamics")
        case = Case.from_dict(data)
        (Path(folder) / "case.toml").write_text(case.to_toml(), encoding="utf-8")
        command = [sys.executable, "-m", "asperity", "run", f"{folder}/case.toml", "-o", str(out), "--quiet"]
        process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        if status:
            raise SystemExit(f"{' '.join(command)} failed")
        process.returncode = 0
        summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    phases = summary["seconds"]
    cpu = usage.ru_utime + usage.ru_stime
    # shares of the wall time carry over to the CPU time
    setup = (phases["mesh"] + phases["set-up"]) / sum(phases.values())
    return Sample(case, summary["dofs"], summary["steps"], setup * cpu, cpu, usage.ru_maxrss * 1024.0)


def rates(samples: list[Sample], finite: float) -> Rates:
    """Least squares in the logarithms of the step, straight lines in memory; `finite` as in the table it comes from."""
    dofs = np.array([s.dofs for s in samples], dtype=float)
    step = np.array([(s.seconds - s.setup) / s.steps for s in samples])
    growth, logarithm = np.polyfit(np.log(dofs / 1e4), np.log(step / 1e4), 1)
    per_dof, base = np.polyfit(dofs, [s.memory for s in samples], 1)
    return Rates(float(np.mean([s.setup / s.dofs for s in samples])), float(np.exp(logarithm)), float(growth),
                 float(base), float(per_dof), finite)  # fmt: skip


def main() -> None:
    """Print the table and the constants."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=float, nargs="+", default=SIZES, help="h_contact [L]")
    arguments = parser.parse_args()
    print("| solid | h_contact/L | dofs | estimated | CPU s | estimated | MiB | estimated |")
    print("|---|---|---|---|---|---|---|---|")
    constants = {}
    for kind in MATERIALS:
        samples = [measure(kind, h) for h in arguments.sizes]
        for h, s in zip(arguments.sizes, samples, strict=True):
            e = estimate(s.case)
            print(f"| {kind} | {h:g} | {s.dofs} | {e.dofs} | {s.seconds:.1f} | {e.seconds:.1f} | "
                  f"{s.memory / 2**20:.0f} | {e.memory / 2**20:.0f} |", flush=True)  # fmt: skip
        constants[kind] = rates(samples, {"elastic": ELASTIC, "plastic": PLASTIC}[kind].finite)
    print()
    for kind, r in constants.items():
        memory = f"{r.base:.3g}, {r.per_dof:.3g}"
        print(f"{kind.upper()} = Rates({r.mesh:.2g}, {r.step:.2g}, {r.growth:.3g}, {memory}, {r.finite:.3g})")


if __name__ == "__main__":
    main()
