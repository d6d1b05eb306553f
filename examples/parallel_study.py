# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The tangent modulus over an ensemble of surfaces; also:  mpirun -n 4 python3 examples/parallel_study.py"""

from __future__ import annotations

import tempfile

from mpi4py import MPI

from asperity.study import Study, StudyResults, run_study
from asperity.study.results import mean_interval

STUDY = {
    "title": "Tangent modulus",
    "base": {
        "surface": {"kind": "weierstrass-mandelbrot", "L": 1e-6, "D": 2.5, "G": 1.36e-11},
        "material": {"E": 200e9, "nu": 0.3, "yield_strength": 1e9},
        "mesh": {"h_contact": 0.3e-6, "h_max": 0.5e-6, "growth": 1.0},  # far too coarse for anything but an example
        "loading": {"delta_max": 0.02e-6, "steps": 5},
    },
    "grid": {"surface.seed": {"first": 0, "count": 2}, "material.tangent_modulus": [2e9, 50e9]},
}


def main() -> list[float]:
    """Run the study and return the mean exponent at each tangent modulus."""
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None)
    run_study(Study.from_dict(STUDY), folder, say=print)
    levels = StudyResults.read(folder).levels("study")
    means = [mean_interval(level.column("n")) for level in levels]
    if comm.rank == 0:
        for level, (mean, low, high) in zip(levels, means, strict=True):
            E_t = level.parameters["material.tangent_modulus"]
            print(f"E_t = {E_t:g} Pa: n = {mean:.3f} ({low:.3f} to {high:.3f})")
    return [mean for mean, _, _ in means]


if __name__ == "__main__":
    main()
