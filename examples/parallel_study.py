"""The tangent modulus over an ensemble of surfaces; also:  mpirun -n 4 python3 examples/parallel_study.py"""

from __future__ import annotations

import tempfile

import numpy as np
from mpi4py import MPI
from scipy.stats import ttest_1samp

from asperity.study import Study, read_table, run_study

STUDY = {
    "base": {
        "surface": {"kind": "self-affine", "L": 1e-6, "H": 0.8, "rms_slope": 0.06, "lambda_short": 0.5e-6},
        "material": {"E": 200e9, "nu": 0.3, "yield_strength": 1e9},
        "block": {"sides": "periodic"},
        "mesh": {"h_contact": 0.18e-6, "h_max": 0.2e-6, "growth": 1.0},
        "loading": {"delta_max": 12e-9, "steps": 5},
    },
    "grid": {"surface.seed": {"first": 0, "count": 3}, "material.tangent_modulus": [2e9, 50e9]},
}


def main() -> tuple[float, float, float]:
    """Run the study; mean and interval of the load with the stiff tangent modulus over that with the soft one."""
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None)
    run_study(Study.from_dict(STUDY), folder, say=print)
    rows = read_table(folder)
    soft, stiff = (
        np.array([row["P_star_max"] for row in rows if row["material.tangent_modulus"] == E_t]) for E_t in (2e9, 50e9)
    )
    ratios = stiff / soft  # surface by surface: loads scatter far more than their ratios
    mean, (low, high) = float(ratios.mean()), ttest_1samp(ratios, 1.0).confidence_interval()
    if comm.rank == 0:
        print(f"E_t = 2 GPa: P* = {soft.round(5)}, E_t = 50 GPa: P* = {stiff.round(5)}")
        print(f"ratio {mean:.3f} ({low:.3f} to {high:.3f})")
    return mean, low, high


if __name__ == "__main__":
    main()
