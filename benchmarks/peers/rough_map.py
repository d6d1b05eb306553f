"""A rough map: asperity and CalculiX on the meshes that asperity makes, elastic.

    benchmarks/peers/install                          once: fetches CalculiX
    ./run python3 benchmarks/peers/rough_map.py       [-o FOLDER] [--limit CPU_SECONDS] [H ...]

A self-affine map of 256 x 256 heights, on a block of side and height 1, pressed in ten steps to 1.2 % of contact. H are
element sizes in the contact. Errors of the force are root mean squares over the steps, relative to the run with a
tolerance of 0.5 %. On several cores asperity has ranks and CalculiX threads; memory is that of the largest process.
Runs are kept as those of compare.py.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path

import asperity_model
import calculix
import numpy as np
import programs
import scene

import asperity as asp
from asperity.surface import SelfAffine

DEPTH = 0.0164  # 1.2 % of contact [L]
AT = DEPTH * np.arange(1, scene.STEPS + 1) / scene.STEPS
STEEL = asp.Material(scene.E, scene.NU)
SIZES = (0.04, 0.028)
CORES = 2
REFERENCE, TOLERANCES = 0.005, (0.02, 0.05)


def surface() -> SelfAffine:
    """The map with side 1."""
    return SelfAffine(L=1.0, H=0.8, slope=0.46, lambda_roll=0.25, lambda_short=5 / 256, seed=1)


def ours(by: str, value: float, ranks: int = 1) -> programs.Job:
    """A run of asperity in processes of its own."""

    def prepare(place: Path) -> programs.Start:
        out = place / "out.json"
        out.unlink(missing_ok=True)
        command = ["mpirun", "-n", str(ranks), sys.executable, __file__, "--model", by, str(value), str(out)]
        return programs.Start(command[3 * (ranks == 1) :], {}, programs.read_json(out))

    return programs.Job("asperity", "elastic map", f"{by} {value:g}{_on(ranks)}", prepare)


def _on(cores: int) -> str:
    """Addition to the name of a mesh where a run is on more than one core."""
    return "" if cores == 1 else f", {cores} cores"


def theirs(h: float, threads: int = 1) -> programs.Job:
    """CalculiX on the mesh that asperity makes for elements of size h."""

    def write(path: Path) -> int:
        return calculix.write_own(path, surface(), STEEL, DEPTH, scene.STEPS, h)

    name = f"C3D10, size {h:g}{_on(threads)}"
    return programs.calculix_deck("CalculiX, mesh of asperity", "elastic map", name, write, threads)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/peers"))
    parser.add_argument("--limit", type=float, default=1800.0, help="CPU seconds after which a run is ended")
    parser.add_argument("--model", nargs=3, help=argparse.SUPPRESS)
    parser.add_argument("sizes", nargs="*", type=float, default=SIZES)
    arguments = parser.parse_args()
    if arguments.model:
        warnings.simplefilter("ignore")
        by, value, target = arguments.model
        asperity_model.solve(surface(), STEEL, DEPTH, AT, by, float(value), scene.STEPS, Path(target))
        return
    print(f"Versions: {programs.versions()}\n")
    folder = arguments.output.absolute()
    force = np.array(ours("tolerance", REFERENCE).run(folder, arguments.limit).force)
    if len(force) < scene.STEPS:
        sys.exit(f"the reference has {len(force)} of {scene.STEPS} forces: raise --limit")
    print("| program | mesh | dofs | CPU s | clock s | MiB | rms error of the force % |\n" + "|---" * 7 + "|")
    jobs = [ours("tolerance", t) for t in (REFERENCE, *TOLERANCES)]
    jobs += [ours("size", h, cores) for cores in (1, CORES) for h in arguments.sizes]
    for job in jobs + [theirs(h, cores) for cores in (1, CORES) for h in arguments.sizes]:
        run = job.run(folder, arguments.limit)
        whole = len(run.force) == len(force)
        error = f"{100 * np.sqrt(np.mean((np.array(run.force) / force - 1.0) ** 2)):.2f}" if whole else ""
        spent = (
            f"{run.cpu:.3g}" if run.ended == "done" else f"> {run.cpu:.3g}, {run.ended} in step {len(run.force) + 1}"
        )
        cells = run.program, run.mesh, run.dofs, spent, f"{run.wall:.3g}", round(run.memory / 2**20), error
        print("| " + " | ".join(map(str, cells)) + " |", flush=True)


if __name__ == "__main__":
    main()
