"""From a scan to its Hurst exponent and to the contact of the patch itself.

The scan is made up here; HeightField.read("scan.sur") reads the files of instruments (pip install SurfaceTopography).
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

import asperity as asp
from asperity.surface import WeierstrassMandelbrot
from asperity.surface.measured import HeightField
from asperity.surface.self_affine_fit import fit_self_affine
from asperity.surface.statistics import psd


def made_up_scan() -> HeightField:
    """A tilted, bent fractal surface of 40 um with a hole in the data."""
    n, side = 161, 40e-6
    z = WeierstrassMandelbrot(L=side, D=2.4, G=1e-10, f_max=9, seed=7).grid(n)
    y, x = np.mgrid[0:n, 0:n] / n
    z += 2e-6 * x - 1e-6 * y + 0.5e-6 * x**2
    z[30:34, 90:97] = np.nan
    return HeightField(z, side / (n - 1), side / (n - 1))


def main() -> tuple[float, float]:
    """Return the Hurst exponent found and the greatest load P* of the patch."""
    scan = made_up_scan().filled().levelled("curvature")
    fit = fit_self_affine(psd(scan.z, len(scan.z) * scan.dx), shortest=4 * scan.dx)
    print(f"H = {fit.H:.2f} ± {fit.error_H:.2f}")
    with tempfile.TemporaryDirectory() as folder:
        patch = scan.filtered(8e-6).window(12e-6, 10e-6, 20e-6).save(Path(folder) / "patch.npz")
        surface = asp.Surface.from_spec(kind="file", path=patch)
    size = asp.MeshSize(h_contact=3e-6, growth=0.6)
    result = asp.solve_contact(surface, asp.Material(200e9, 0.3), delta_max=0.2e-6, steps=4, size=size)
    load = float(result.curve.P_star[-1])
    print(f"P* = {load:.4g} at delta* = {result.curve.delta_star[-1]:g}")
    return fit.H, load


if __name__ == "__main__":
    main()
