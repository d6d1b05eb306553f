"""What `asperity check` expects of a case, beside what its run takes: meshes, dofs, memory, CPU time.

    python3 benchmarks/check.py [NAME]...

Each case is estimated and run in a process of its own, on one rank. Prints a row a case: meshes, dofs of the last
one, memory (MiB) and CPU seconds, as expected / as found, and the greatest of the last three ratios, either way; at
the end how many cases are within a factor of 1.5.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import warnings
from contextlib import suppress
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import asperity as asp
from asperity.adaptive.estimate import estimate
from asperity.case import Case
from asperity.errors import ConvergenceError
from asperity.surface import SelfAffine

ELASTIC = {"E": 1.0, "nu": 0.3, "kinematics": "small"}
YIELDING = ELASTIC | {"yield_strength": 0.004, "tangent_modulus": 0.05}
FINITE, AUTO = ({**YIELDING, "kinematics": name} for name in ("finite", "auto"))
SPHERE = {"kind": "sphere", "L": 1.0, "radius": 10.0, "shape": "paraboloid"}
FRACTAL = {"kind": "weierstrass-mandelbrot", "L": 1.0, "D": 2.5, "G": 1e-5, "seed": 7}
AFFINE = {"kind": "self-affine", "L": 1.0, "H": 0.8, "rms_slope": 0.04, "lambda_roll": 0.4, "lambda_short": 0.06}
# surface (nodes per side of a map), material, approach, force or pressure, element size in the contact or tolerance
CASES: dict[str, tuple[Any, ...]] = {
    "sphere": (SPHERE, ELASTIC, {"delta_max": 0.01}, {"h_contact": 0.04}),
    "sphere, yielding": (SPHERE, YIELDING, {"force_max": 2e-3}, {"h_contact": 0.04}),
    "fractal": (FRACTAL, ELASTIC, {"delta_max": 0.01}, {"h_contact": 0.05}),
    "fractal, yielding, unloaded": (FRACTAL, YIELDING, {"delta_max": 0.006, "unload": True}, {"h_contact": 0.05}),
    "fractal, finite strain": (FRACTAL, FINITE, {"delta_max": 0.006}, {"h_contact": 0.06}),
    "fractal, either strain": (FRACTAL, AUTO, {"delta_max": 0.006}, {"h_contact": 0.06}),
    "self-affine, periodic": (AFFINE, ELASTIC, {"delta_max": 0.005}, {"h_contact": 0.04}, "periodic"),
    "map of 64, coarse": (64, ELASTIC, {"force_max": 1e-3}, {"h_contact": 0.2}),
    "map of 128": (128, YIELDING, {"pressure_max": 1e-3}, {"h_contact": 0.04}),
    "map of 256": (256, ELASTIC, {"delta_max": 0.005}, {"h_contact": 0.03}),
    "sphere to 2 %": (SPHERE, ELASTIC, {"delta_max": 0.01}, {"tolerance": 0.02}),
    "sphere, yielding, to 5 %": (SPHERE, YIELDING, {"pressure_max": 2e-3}, {"tolerance": 0.05}),
    "sphere with few dofs": (SPHERE, ELASTIC, {"delta_max": 0.01}, {"tolerance": 0.01, "max_dofs": 6000}),
    "fractal to 5 %": (FRACTAL, ELASTIC, {"delta_max": 0.01}, {"tolerance": 0.05}),
    "fractal, yielding, to 10 %": (FRACTAL, YIELDING, {"delta_max": 0.01}, {"tolerance": 0.1}),
    "fractal, finite strain, to 10 %": (FRACTAL, FINITE, {"delta_max": 0.01}, {"tolerance": 0.1}),
    "self-affine, periodic, to 10 %": (AFFINE, ELASTIC, {"delta_max": 0.005}, {"tolerance": 0.1}, "periodic"),
    "map of 64 to 10 %": (64, ELASTIC, {"pressure_max": 1e-3}, {"tolerance": 0.1}),
    "map of 64, yielding, to 10 %": (64, YIELDING, {"force_max": 1e-3}, {"tolerance": 0.1}),
    "map of 128 to 10 %": (128, ELASTIC, {"delta_max": 0.008}, {"tolerance": 0.1}),
    "map of 128, yielding, to 10 %": (128, YIELDING, {"delta_max": 0.008}, {"tolerance": 0.1}),
    "map of 256 to 10 %": (256, ELASTIC, {"delta_max": 0.01}, {"tolerance": 0.1}),
}


def case_of(folder: Path, surface: Any, material: Any, load: Any, accuracy: Any, sides: str = "rollers") -> Case:
    """Case with five load steps."""
    if isinstance(nodes := surface, int):
        rough = SelfAffine(L=1.0, H=0.8, slope=0.03, lambda_roll=0.5, lambda_short=8 / nodes, periodic=False)
        surface = {"kind": "file", "path": str(folder / "map.npz")}
        np.savez(folder / "map.npz", z=rough.grid(nodes), L=1.0)
    given = {"accuracy" if "tolerance" in accuracy else "mesh": accuracy, "block": {"sides": sides}}
    given |= {"loading": {"steps": 5} | load, "output": {"figures": False, "report": False}}
    return Case.from_dict({"units": "other", "surface": surface, "material": material} | given)


def one(name: str) -> list[list[float]]:
    """Meshes, dofs of the last one, memory [bytes] and CPU seconds of a case, expected and found."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        case = case_of(Path(folder), *CASES[name])
        found = estimate(case)
        expected = [len(found.levels), found.dofs, found.memory, found.seconds]
        start = process_time()
        with suppress(ConvergenceError):
            asp.run(case, Path(folder) / "run")
        seconds = process_time() - start
        summary = json.loads((Path(folder) / "run/summary.json").read_text())
    meshes = len(summary["accuracy"]["levels"]) if "accuracy" in summary else 1
    memory = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return [expected, [meshes, summary["dofs"], memory, seconds]]


def main(names: list[str]) -> None:
    """Print the table of some cases, default all."""
    if names[:1] == ["--one"]:
        print(json.dumps(one(names[1])))
        return
    within = 0
    print("| case | meshes | dofs | MiB | CPU s | greatest ratio |\n|---|---|---|---|---|---|")
    for name in (chosen := names or list(CASES)):
        done = subprocess.run([sys.executable, __file__, "--one", name], stdout=subprocess.PIPE, check=True)
        expected, found = json.loads(done.stdout.splitlines()[-1])
        worst = max(max(a / b, b / a) for a, b in zip(expected[1:], found[1:], strict=True))
        within += worst <= 1.5
        expected[2], found[2] = expected[2] / 2**20, found[2] / 2**20
        cells = (f"{round(a, 1):g} / {round(b, 1):g}" for a, b in zip(expected, found, strict=True))
        print("| " + " | ".join([name, *cells, f"{worst:.2f}"]) + " |", flush=True)
    print(f"\nwithin a factor of 1.5: {within} of {len(chosen)}")


if __name__ == "__main__":
    main(sys.argv[1:])
