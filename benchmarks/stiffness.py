"""Stiffness columns against closed forms, docs/stiffness.md.

    python3 benchmarks/stiffness.py barber    stiffness against conductance over slope, block, Poisson's ratio, mesh
    python3 benchmarks/stiffness.py matrix    stiffness against six motions of a paraboloid, over that of a bonded disc

Each prints a table.
"""

from __future__ import annotations

import argparse
import warnings
from typing import Any

import numpy as np

import asperity as asp
from asperity.quasistatic.stiffness_matrix import stiffness_matrix

D = 2.4  # of cases/single.toml


def heads(*names: str) -> None:
    """Print the first lines of a table."""
    print("| " + " | ".join(names) + " |\n" + "|---" * len(names) + "|", flush=True)


def matrix() -> None:
    """Interface of a paraboloid in the middle of a block against closed forms of discs on a half-space.

    Mindlin (1949); Spence (1968); Borowicka (1943), without friction; Reissner & Sagoci (1944).
    """
    heads("a/L", "dofs", "along x, 8 G a/(2 - nu)", "normal, 4 G a ln(3 - 4 nu)/(1 - 2 nu)",
          "tilt, 8 G a^3/(3 (1 - nu))", "torsion, 16 G a^3/3", "greatest asymmetry")  # fmt: skip
    nu = 0.3
    G = 0.5 / (1.0 + nu)
    paraboloid = asp.Surface.from_spec("sphere", L=1.0, radius=10.0, shape="paraboloid")
    for wanted in (0.02, 0.01):
        size = asp.MeshSize(wanted / 8, growth=0.4, h_max=0.3)
        result = asp.solve_contact(paraboloid, asp.Material(1.0, nu), delta_max=wanted**2 / 10.0, steps=1, size=size)
        a = (7.5 * result.curve.force[-1] * (1.0 - nu**2)) ** (1.0 / 3.0)  # Hertz
        found = stiffness_matrix(result.solver)
        assert found is not None and found.interface is not None
        disc = (8 * G * a / (2 - nu), 4 * G * a * np.log(3 - 4 * nu) / (1 - 2 * nu), 8 * G * a**3 / (3 * (1 - nu)),
                16 * G * a**3 / 3)  # fmt: skip
        cells = (f"{found.interface[k, k] / k_disc:.3f}" for k, k_disc in zip((0, 2, 4, 5), disc, strict=True))
        scale = np.sqrt(found.whole.diagonal())
        skew = np.max(np.abs(found.whole - found.whole.T) / scale / scale[:, None])
        print(f"| {a:.4f} | {result.dofs} | {' | '.join(cells)} | {skew:.0e} |", flush=True)


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("part", choices=("barber", "matrix"))
    warnings.simplefilter("ignore")
    {"barber": barber, "matrix": matrix}[parser.parse_args().part]()


if __name__ == "__main__":
    main()
