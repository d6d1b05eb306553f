"""The exponent of the law of force over approach over the tangent modulus, one surface and one mesh for all."""

from __future__ import annotations

import asperity as asp


def main() -> list[float]:
    """Return the exponents, the softest material first."""
    surface = asp.Surface.from_spec(kind="self-affine", L=1e-6, H=0.8, rms_slope=0.06, lambda_short=0.4e-6, seed=1)
    size = asp.MeshSize(h_contact=0.12e-6, growth=0.6)
    block, exponents = None, []
    for E_t in (2e9, 20e9, 100e9):
        steel = asp.Material(E=200e9, nu=0.3, yield_strength=1e9, tangent_modulus=E_t)
        result = asp.solve_contact(surface, steel, delta_max=12e-9, steps=5, size=size, block=block)
        block = result.block  # the next material takes the same mesh
        fit = result.curve.fit()
        yielded = result.curve.plastic_fraction[-1]
        print(f"E_t = {E_t:.3g} Pa: P* = {fit.k:.3f} (delta/L)^{fit.n:.3f}, {yielded:.1%} of the volume yielded")
        exponents.append(fit.n)
    return exponents


if __name__ == "__main__":
    main()
