# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Unloading of a flattened sphere: residual approach and law of the unloading against a published fit.

    ./run python3 benchmarks/unloading.py

A hemisphere (sigma_y/E = 0.005, nu = 0.3) on planes of symmetry is flattened to w times the approach at the onset of
yield and released. Etsion, Kligerman & Kadin, Int. J. Solids Struct. 42 (2005) 3716, fitted finite elements of a sphere
with linear hardening (`asperity.reference.unloaded_sphere`). Prints for each material and w the residual approach over
the greatest one; that of the fit; that of the fit of Jackson, Chusoipin & Green, J. Tribol. 127 (2005) 484, for a
sphere without hardening; that of an elastic unloading of a paraboloid with the force and the radius of contact computed
(Johnson, Contact Mechanics (1985), 6.4); the exponent of the unloading branch and that of the fit; and the greatest
difference of the whole branch from the fit, over the greatest force.
"""

from __future__ import annotations

from math import hypot

import numpy as np

import asperity as asp
from asperity.curve import Curve
from asperity.model.load_path import MIDPOINT, Schedule
from asperity.reference import reduced_modulus, residual_of_perfect_sphere, unloaded_sphere
from asperity.verification.flattening import NU, ONSET, flatten
from asperity.verification.solids import eighth_sphere

DEPTHS = (2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
LAWS = {
    "E_t = 0": ({}, DEPTHS),
    "E_t = 0.02 E": ({"tangent_modulus": 0.02}, DEPTHS),
    "the same, kinematic": ({"tangent_modulus": 0.02, "hardening": "kinematic"}, DEPTHS[2::3]),
    "the same, finite strain": ({"tangent_modulus": 0.02, "kinematics": "finite"}, DEPTHS[2::3]),
}
STEPS = 20
FINE = 0.16  # size of elements in the contact over the radius of Hertz theory at yield times sqrt(w)


def released(material: asp.Material, w: float, fine: float) -> Curve:
    """Loading to w and unloading of an eighth of a sphere; R = E = 1."""
    a = float(np.sqrt(w * ONSET))

    def size(x: float, y: float, z: float) -> float:
        return min(fine * a + 0.3 * max(hypot(x, y, z - 1.0) - 1.6 * a, 0.0), 0.3)

    path = Schedule(delta_max=w * ONSET, steps=STEPS, unload_steps=STEPS, integrator=MIDPOINT)
    return flatten(eighth_sphere(1.0, 0.0, size), material, path)[1]


def row(name: str, w: float, curve: Curve) -> None:
    """Print one row of the table."""
    load, unload = curve.where(curve.branch == "load"), curve.where(curve.branch == "unload")
    top, force, residual = load.delta[-1], load.force[-1], unload.delta[-1]
    ratio, exponent = unloaded_sphere(w)
    radius = float(np.sqrt(4.0 * load.area_fraction[-1] / np.pi))
    hertz = 1.0 - 3.0 * 4.0 * force / (4.0 * reduced_modulus(1.0, NU) * radius * top)
    part, share = (unload.delta - residual) / (top - residual), unload.force / force
    inside = share > 0.02
    found = float(np.sum(np.log(share[inside]) * np.log(part[inside])) / np.sum(np.log(part[inside]) ** 2))
    fit = np.maximum((unload.delta - ratio * top) / (top - ratio * top), 0.0) ** exponent
    worst = 100.0 * float(np.abs(share - fit).max())
    values = (residual / top, float(ratio), float(residual_of_perfect_sphere(w)), hertz, found, float(exponent))
    print(f"| {name} | {w:g} | " + " | ".join(f"{v:.3f}" for v in values) + f" | {worst:.1f} |", flush=True)


def main() -> None:
    """Print the table."""
    header = ("material", "w", "residual", "of the fit", "Jackson", "Hertz", "exponent", "of the fit", "difference %")
    print("| " + " | ".join(header) + " |\n" + "|---" * len(header) + "|")
    for name, (law, depths) in LAWS.items():
        for w in depths:
            row(name, w, released(asp.Material(1.0, NU, 0.005, **law), w, FINE))
    row("E_t = 0.02 E, finer mesh", 10.0, released(asp.Material(1.0, NU, 0.005, 0.02), 10.0, FINE / 2.0**0.5))


if __name__ == "__main__":
    main()
