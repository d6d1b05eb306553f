"""Slip of a measured surface in six windows, and their spread, docs/measured.md.

    python3 benchmarks/scan_slip.py FILE FOLDER     al3d-1.al3d, which SurfaceTopography reads

Imports and presses each window, with the joint and the slip of the page, and prints tables; FOLDER keeps the runs.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from experiments import run

from asperity.arrays import Array
from asperity.runtime.files import read_csv

CORNERS = tuple(product((2e-6, 45e-6), (2e-6, 44e-6, 86e-6)))  # of windows that do not overlap [m]
SIDE, CUTOFF = 40e-6, 8e-6  # of a window, and the shortest wave [m]
CASE: dict[str, Any] = {
    "material": {"E": 200e9, "nu": 0.3, "yield_strength": 1.5e9, "tangent_modulus": 10e9},
    "loading": {"pressure_max": 50e6, "steps": 8, "unload": True},
    "accuracy": {"tolerance": 0.1, "max_dofs": 60_000},
    "joint": {"nominal_area": 1e-5, "pressure": 25e6, "mass": 0.5},
    "slip": {"friction": 0.3},
}


def press(scan: Path, corner: tuple[float, float], folder: Path) -> dict[str, Any]:
    """Summary of the run of a window, with its loops as arrays under "loops"."""
    if not (folder / "patch.npz").is_file():
        numbers = [f"{x:g}" for x in (*corner, SIDE)] + ["--cutoff", f"{CUTOFF:g}"]
        command = [sys.executable, "-m", "asperity", "import-map", str(scan), "--window", *numbers, "-o", str(folder)]
        subprocess.run(command, check=True)
    run({"surface": {"kind": "file", "path": str(folder / "patch.npz")}} | CASE, folder / "out")
    summary = json.loads((folder / "out/summary.json").read_text(encoding="utf-8"))
    loops = read_csv(folder / "out/slip_loops.csv")
    return summary | {"loops": {name: np.array(column, dtype=float) for name, column in loops.items()}}


def spread(values: Array) -> str:
    """Mean of the windows, their range, and their standard deviation over the mean."""
    mean = float(values.mean())
    return f"{mean:.3g} | {values.min():.3g} to {values.max():.3g} | {100.0 * values.std(ddof=1) / mean:.0f}"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path, help="of the scan")
    parser.add_argument("folder", type=Path, help="keeps the runs")
    options = parser.parse_args()
    found = [press(options.file, corner, options.folder / f"w{k}") for k, corner in enumerate(CORNERS, 1)]
    k_t = np.array([each["slip"]["k_rest"] for each in found]) / SIDE**2 / 1e15
    print("\n| k_t before any slip, GPa/um | windows | spread, % |\n|---|---|---|\n| " + spread(k_t) + " |")
    print("\ndofs:", ", ".join(str(each["dofs"]) for each in found))
    print("\n| T/(mu P) | frequency, kHz | windows | spread, % | bar, % | zeta, % | windows | spread, % | bar, % |")
    print("|---" * 9 + "|")
    f, zeta = (np.array([[v[key] for v in each["slip"]["vibration"]] for each in found]) for key in ("f", "zeta"))
    loops = [each["loops"] for each in found]
    of_f = np.median([0.5 * loop["error_k_secant"] / loop["k_secant"] for loop in loops], axis=0)
    of_zeta = np.median([loop["error_eta"] / loop["eta"] for loop in loops], axis=0)
    for i, t in enumerate(loops[0]["amplitude"]):
        cells = f"{spread(f[:, i] / 1e3)} | {100 * of_f[i]:.0f} | {spread(100 * zeta[:, i])} | {100 * of_zeta[i]:.0f}"
        print(f"| {t:g} | {cells} |")


if __name__ == "__main__":
    main()
