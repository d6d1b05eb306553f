"""A sphere against the closed form of Hertz."""

from __future__ import annotations

import numpy as np

import asperity as asp
from asperity.reference import Hertz

RADIUS, DELTA = 10e-3, 2.5e-9


def main() -> float:
    """Return the greatest relative difference of the force over the second half of the loading."""
    # a quarter of a sphere on a block that is large compared with the contact, (R delta)^(1/2) = 5 um
    steel = asp.Material(E=200e9, nu=0.3)
    surface = asp.Surface.from_spec(kind="sphere", L=1e-3, radius=RADIUS, centre=(0.0, 0.0), shape="paraboloid")
    size = asp.MeshSize(h_contact=2e-6, growth=0.6)
    curve = asp.solve_contact(surface, steel, delta_max=DELTA, steps=6, size=size).curve
    exact = Hertz(RADIUS, steel.reduced_modulus).force(curve.delta) / 4
    for delta, force, hertz in zip(curve.delta, curve.force, exact, strict=True):
        print(f"delta = {delta:.3g} m: {force:.4g} N, Hertz {hertz:.4g} N")
    half = curve.delta > 0.5 * DELTA
    return float(np.max(np.abs(curve.force / exact - 1)[half]))


if __name__ == "__main__":
    main()
