"""Stiffness of a rough joint over the nominal pressure, to compare with experiments: numbers of docs/accuracy.md.

./run python3 benchmarks/experiments.py      # some seconds
"""

from __future__ import annotations

import warnings

import numpy as np

import asperity as asp

L = 100e-6
SURFACE = asp.Surface.from_spec(
    "self-affine", L=L, H=0.8, rms_slope=0.06, lambda_roll=50e-6, lambda_short=20e-6, seed=1
)  # fmt: skip
STEEL = asp.Material(200e9, 0.3, 1.5e9, 10e9)


def main() -> None:
    """Print exponents of the stiffness over the pressure, and a table of both in loading and unloading."""
    curve = asp.solve_contact(
        SURFACE, STEEL, delta_max=0.7e-6, steps=20, unload_steps=10, size=asp.MeshSize(8e-6), stiffness=True
    ).curve
    area = L**2
    p = curve.force / area / 1e6
    block = L / (area * STEEL.confined_modulus)
    with np.errstate(all="ignore"):
        static = 1.0 / (1.0 / curve.k_n - block) / area / 1e15  # GPa/um
    elastic, shear = curve.k_n_interface / area / 1e15, curve.k_t_interface / area / 1e15
    up, down = curve.branch == "load", curve.branch == "unload"
    touching = up & (p > 0.02 * p.max())
    light, late = touching & (p < 0.2 * p.max()), touching & (p > 0.2 * p.max())
    for name, k in {"k_n": elastic, "k_t": shear}.items():
        parts = (np.polyfit(np.log(p[rows]), np.log(k[rows]), 1)[0] for rows in (touching, light, late))
        print(f"{name} of small vibration, in loading, below a fifth of the load, above: "
              + ", ".join(f"p^{part:.2f}" for part in parts))  # fmt: skip
    print("\n| p in MPa | k_n, loading | k_n, small vibration | the same, unloading | k_t/k_n |\n|---|---|---|---|---|")
    order = np.flatnonzero(down)[np.argsort(p[down])]
    for i in np.flatnonzero(touching)[:: max(1, touching.sum() // 7)]:
        back = np.interp(p[i], p[order], elastic[order])
        print(f"| {p[i]:.3g} | {static[i]:.3g} | {elastic[i]:.3g} | {back:.3g} | {shear[i] / elastic[i]:.3f} |")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
