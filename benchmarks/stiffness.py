"""Stiffness columns against closed forms, docs/stiffness.md.

python3 benchmarks/stiffness.py     stiffness against conductance over slope, block, Poisson's ratio, mesh
"""

from __future__ import annotations

import warnings
from typing import Any

import asperity as asp

D = 2.4  # of cases/single.toml


def heads(*names: str) -> None:
    """Print the first lines of a table."""
    print("| " + " | ".join(names) + " |\n" + "|---" * len(names) + "|", flush=True)


def barber() -> None:
    """Stiffness of the interface over E' C/2, which is one on a half-space, with one thing changed at a time.

    The surface and the approach of cases/single.toml, elastic. Heights and approach scaled down together have the
    same contact and a smaller slope.
    """
    heads("slopes times", "height over L", "nu", "element size over L", "sides", "dofs", "area", "k_n_interface",
          "E' C/2", "deviation")  # fmt: skip
    standard: dict[str, Any] = {"scale": 1.0, "height": 1.0, "nu": 0.3, "h": 0.03, "sides": "rollers"}
    changes: list[dict[str, Any]] = [
        {}, {"scale": 0.5}, {"scale": 0.1}, {"scale": 0.01}, {"height": 2.0}, {"nu": 0.0}, {"nu": 0.45}, {"h": 0.06},
        {"h": 0.02}, {"sides": "free"}, {"scale": 0.01, "height": 2.0}, {"scale": 0.01, "nu": 0.0},
        {"scale": 0.01, "nu": 0.45}, {"scale": 0.01, "h": 0.06}, {"scale": 0.01, "sides": "free"},
    ]  # fmt: skip
    for change in changes:
        of = standard | change
        G = 1.36e-5 * of["scale"] ** (1.0 / (D - 2.0))  # heights go with G^(D - 2)
        surface = asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=D, G=G)
        solid = asp.Material(1.0, of["nu"])
        curve = asp.solve_contact(
            surface, solid, delta_max=0.012 * of["scale"], steps=3, height=of["height"], sides=of["sides"],
            size=asp.MeshSize(of["h"]), stiffness=True, conductance=True,
        )  # fmt: skip
        k, C = curve.curve.k_n_interface[-1], curve.curve.conductance[-1]
        expected = 0.5 * solid.reduced_modulus * C
        print(
            f"| {of['scale']:g} | {of['height']:g} | {of['nu']:g} | {of['h']:g} | {of['sides']} | {curve.dofs} | "
            f"{curve.curve.area_fraction[-1]:.4f} | {k:.4f} | {expected:.4f} | {k / expected - 1.0:+.1%} |",
            flush=True,
        )


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    barber()
