"""Vibration of a mass on a contact whose force is a table: measured, or computed elsewhere."""

from __future__ import annotations

import numpy as np

import asperity as asp


def main() -> tuple[float, float]:
    """Return the natural frequency at a large amplitude, over the small one's, and the resonance peak."""
    z = np.linspace(0.0, 2e-6, 41)  # approach (m)
    force = 4.0e9 * z**1.5 * (1 + 1.0e5 * z)  # (N): between a sphere and something stiffer
    law = asp.TableLaw(z, force)
    mass = asp.ContactOscillator(law, load=3.0, zeta=0.01)  # its weight (N)
    free = mass.free([0.05, 0.5])
    print(f"omega/omega_s = {free.omega_ratio[0]:.5f} at u = 0.05, {free.omega_ratio[1]:.5f} at u = 0.5")
    response = mass.response(0.02, (0.85, 1.1))
    omega, peak = response.peak
    print(f"F^ = 0.02: peak u = {peak:.4f} at Omega = {omega:.4f}")
    return float(free.omega_ratio[1]), float(peak)


if __name__ == "__main__":
    main()
