"""Loading stiffness per area of a rough elastic joint against Persson's rule, docs/stiffness.md.

    ./run python3 benchmarks/persson.py

Persson, Phys. Rev. Lett. 99 (2007) 125502: under light load the stiffness of the interface per area is p/(gamma h_rms),
with the nominal pressure p, the rms height h_rms and gamma of 0.4 to 0.5. The bar of one patch is numerical, that of
the mean of five patches, by the half-space, is its standard error.
"""

from __future__ import annotations

from typing import Any

import asperity as asp

GAMMA, PRESSURE, AREA = 0.4, 50e6, 10e-6
CASE: dict[str, Any] = {
    "surface": {
        "kind": "self-affine", "L": 100e-6, "H": 0.8, "rms_height": 0.4e-6, "lambda_roll": 33e-6,
        "lambda_short": 12e-6, "seed": 1,
    },
    "material": {"E": 200e9, "nu": 0.3},
    "loading": {},
    "joint": {"nominal_area": AREA, "pressure": PRESSURE},
    "accuracy": {"tolerance": 0.02},
    "output": {"report": False, "figures": False, "stiffness": True},
}  # fmt: skip


def main() -> None:
    """Run the patch, print the table."""
    case = asp.Case.from_dict(CASE)
    summary = asp.run(case).summary
    numbers, patches = summary["joint"]["numbers"], summary["patches"]
    k, height = numbers["k_n"], case.surface.statistics().Sq
    share = k / numbers["k_n_with_block"]  # other patches change the stiffness with the block
    rule = PRESSURE / (GAMMA * height) * AREA
    rows = {
        "Persson's rule": (rule, None),
        "interface of this patch": (k, numbers["k_n_bar"]),
        "the same with its block": (numbers["k_n_with_block"], None),
        "interface, mean of five patches": (k * (1.0 + share * patches["change"]), share * patches["error"]),
    }
    print(f"rms height {1e6 * height:.3f} um; other patches of this roughness {100 * share * patches['bar']:.0f} %")
    print("| stiffness | GN/m | MPa/um | over the rule | bar |\n|---|---|---|---|---|")
    for name, (value, bar) in rows.items():
        of_bar = "" if bar is None else f"{100 * bar:.0f} %"
        print(f"| {name} | {1e-9 * value:.2f} | {1e-12 * value / AREA:.0f} | {value / rule:.2f} | {of_bar} |")


if __name__ == "__main__":
    main()
