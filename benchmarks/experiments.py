"""Numbers of docs/verification.md: stiffness of a rough joint, impact of a cap.

    ./run python3 benchmarks/experiments.py FOLDER

FOLDER keeps the computed runs; those that are there are not computed again.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

import asperity as asp
from asperity.reference import Hertz, reduced_modulus

E, NU, YIELD, TANGENT = 200e9, 0.3, 1e9, 2e9
L, R = 4e-6, 2e-6  # the greatest spot is a thirtieth of the side
E_PRIME = reduced_modulus(E, NU)
ONSET = 1.6 * YIELD  # greatest Hertzian pressure at first yield
DEPTHS = (1e-9, 2.5e-9, 6e-9)

JOINT: dict[str, Any] = {
    "surface": {
        "kind": "self-affine", "L": 100e-6, "H": 0.8, "rms_slope": 0.06, "lambda_roll": 50e-6, "lambda_short": 20e-6,
        "seed": 1,
    },
    "material": {"E": E, "nu": NU, "yield_strength": 1.5e9, "tangent_modulus": 10e9},
    "mesh": {"h_contact": 8e-6},
    "loading": {"delta_max": 0.7e-6, "steps": 20, "unload": True},
    "output": {"stiffness": True},
}  # fmt: skip


def cap(depth: float, plastic: bool) -> dict[str, Any]:
    """Case of a spherical cap pressed to a depth and withdrawn."""
    law = {"yield_strength": YIELD, "tangent_modulus": TANGENT} if plastic else {}
    return {
        "surface": {"kind": "sphere", "L": L, "radius": R},
        "material": {"E": E, "nu": NU, **law},
        "mesh": {"h_contact": 0.016e-6},
        "loading": {"delta_max": depth, "steps": 14, "unload": plastic},
    }


def run(case: dict[str, Any], folder: Path) -> asp.Curve:
    """Curve of a case, computed unless its folder has it."""
    if not (folder / "summary.json").is_file():
        asp.run(asp.Case.from_dict(case), folder, force=True)
    return asp.Curve.read(folder / "curve.csv")


def joint(folder: Path) -> None:
    """Stiffness of the interface over the nominal pressure, in loading and unloading."""
    curve = run(JOINT, folder / "joint")
    case = asp.Case.from_dict(JOINT)
    area = case.surface.L**2
    p = curve.force / area / 1e6
    block = case.block.height / (area * case.material.solid.block_modulus(case.block.sides))
    with np.errstate(all="ignore"):
        static = 1.0 / (1.0 / curve.k_n - block) / area / 1e15  # GPa/um
    elastic, shear = curve.k_n_interface / area / 1e15, curve.k_t_interface / area / 1e15
    up, down = curve.branch == "load", curve.branch == "unload"
    touching = up & (p > 0.02 * p.max())
    light, late = touching & (p < 0.2 * p.max()), touching & (p > 0.2 * p.max())
    for name, k in {"k_n": elastic, "k_t": shear}.items():
        parts = (np.polyfit(np.log(p[rows]), np.log(k[rows]), 1)[0] for rows in (touching, light, late))
        print(f"\nrough joint: {name} of small vibration, in loading, below a fifth of the load, above: "
              + ", ".join(f"p^{part:.2f}" for part in parts))  # fmt: skip
    print("\n| p in MPa | k_n, loading | k_n, small vibration | the same, unloading | k_t/k_n |\n|---|---|---|---|---|")
    order = np.flatnonzero(down)[np.argsort(p[down])]
    for i in np.flatnonzero(touching)[:: max(1, touching.sum() // 7)]:
        back = np.interp(p[i], p[order], elastic[order])
        print(f"| {p[i]:.3g} | {static[i]:.3g} | {elastic[i]:.3g} | {back:.3g} | {shear[i] / elastic[i]:.3f} |")


def thornton(work: float) -> float:
    """Coefficient of restitution of a cap whose Hertzian pressure is cut off at that of first yield.

    The model of Thornton: after yield the force rises with the slope pi R p_y, and the unloading is Hertzian with the
    contact radius reached and a larger radius of curvature, R_p F = R F_elastic.

    Args:
        work: energy of the impact (force * length).
    """
    first = R * (math.pi * ONSET / (2.0 * E_PRIME)) ** 2
    hertz = Hertz(R=R, E_prime=E_PRIME)
    start = float(hertz.force(first))
    slope = math.pi * R * ONSET

    def loading(d: float) -> float:
        more = d - first
        return 0.4 * start * first + start * more + 0.5 * slope * more**2

    if work <= 0.4 * start * first:
        return 1.0
    d = float(brentq(lambda x: loading(x) / work - 1.0, first, 1e4 * first, xtol=1e-9 * first))
    force, radius = start + slope * (d - first), math.sqrt(R * d)
    return math.sqrt(0.3 * force**2 / (radius * E_PRIME) / work)


def impact(folder: Path) -> None:
    """Restitution and duration of impacts of a cap: from pressed curves, against closed forms."""
    hertz = Hertz(R=R, E_prime=E_PRIME)
    elastic_case = cap(DEPTHS[-1], plastic=False)
    curve = run(elastic_case, folder / "cap_elastic")
    law = asp.TableLaw(curve.delta, curve.force)  # of the whole block: a half-space deforms far below the spot too
    mass = 1e-15  # any: the ratio of durations does not depend on it
    work = float(law.potential(law.z[-1]))
    ratio = duration(law, float(law.z[-1]), mass) / hertz_duration(hertz, work, mass)
    print(f"\nelastic cap: force {float(curve.force[-1] / hertz.force(law.z[-1])):.4f} of Hertz at the greatest depth, "
          f"duration of the impact {ratio:.4f} of Hertz at the same energy\n")  # fmt: skip
    print("| depth over that of first yield | energy over that of first yield | e | Thornton | duration over Hertz |")
    print("|---|---|---|---|---|")
    first = R * (math.pi * ONSET / (2.0 * E_PRIME)) ** 2
    unit = 0.4 * float(hertz.force(first)) * first
    for depth in DEPTHS:
        curve = run(cap(depth, plastic=True), folder / f"cap_{depth:g}")
        loading = curve.branch == "load"
        up = asp.TableLaw(curve.delta[loading], curve.force[loading])
        down = asp.unload_reload({"delta": curve.delta, "force": curve.force, "branch": curve.branch})
        top, bottom = float(up.z[-1]), float(down.z[-1])
        work, back = float(up.potential(top)), float(down.potential(bottom))
        lasting = 0.5 * (duration(up, top, mass) + duration(down, bottom, mass)) / hertz_duration(hertz, work, mass)
        cells = top / first, work / unit, math.sqrt(back / work), thornton(work), lasting
        print("| " + " | ".join(f"{x:.3g}" for x in cells) + " |")


def duration(law: Any, top: float, mass: float) -> float:
    """Duration of an impact on a reversible law that reaches the approach `top`, by quadrature."""
    energy = float(law.potential(top))

    def integrand(angle: float) -> float:
        z = top * math.sin(angle)
        left = energy - float(law.potential(z))
        return top * math.cos(angle) / math.sqrt(2.0 * left / mass) if left > 0 else 0.0

    return 2.0 * float(quad(integrand, 0.0, 0.5 * math.pi - 1e-6, limit=400, epsrel=1e-6)[0])


def hertz_duration(hertz: Hertz, work: float, mass: float) -> float:
    """Duration of an elastic impact of a sphere, 2 z_m/v INT dx/sqrt(1 - x^(5/2)) = 2.9432 z_m/v."""
    K = float(hertz.force(1.0))
    top = (2.5 * work / K) ** 0.4
    share = math.gamma(0.4) / math.gamma(0.9) * math.sqrt(math.pi) / 2.5
    return 2.0 * share * top / math.sqrt(2.0 * work / mass)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="keeps the runs")
    options = parser.parse_args()
    joint(options.folder)
    impact(options.folder)
