"""Tools against closed forms and other programs: python3 benchmarks/indentation.py [row ...] prints a figure a row.

Rows: hertz, cone, sphere, layer, gel, composite, plastic, modulus, shape.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np

import asperity as asp
from asperity.output.indentation import indentation_of
from asperity.reference.halfspace import added_to_spot, half_space_contact
from asperity.surface import Cone, Flat, Pyramid, SelfAffine, Sphere, Surface

ELASTIC = asp.Material(E=1.0, nu=0.3)
CORNER, HEIGHT = (0.0, 0.0), 3.0  # a quarter of a contact, on a high block
LATTICE = 3.9003  # sum of 1/r over a square lattice of unit period, less its mean
#: Depth over R and force over E R^2 of a sphere in finite strain, by benchmarks/axisymmetric.py 0.04.
REVOLVED = ((0.28, 0.231875), (0.29, 0.244591), (0.3, 0.257452))


def _quarter(tool: Surface, delta: float, a: float, finite: bool = False) -> tuple[float, float, float]:
    """Whole force, approach on a half-space and area of a quarter."""
    solid, size = replace(ELASTIC, kinematics="finite" if finite else "small"), asp.MeshSize(a / 10, h_max=0.5)
    curve = asp.solve_contact(
        Flat(L=1.0), solid, tool=tool, delta_max=delta, steps=6 if finite else 1, height=HEIGHT, size=size
    ).curve
    unit = added_to_spot(a, CORNER, HEIGHT, ELASTIC.nu, "rollers")
    return (
        4.0 * curve.force[-1],
        delta - curve.force[-1] / ELASTIC.reduced_modulus * unit,
        4.0 * curve.area_fraction[-1],
    )


def hertz() -> str:
    """Force and area of a sphere on a plane, by Hertz."""
    force, delta, area = _quarter(Sphere(L=1.0, radius=10.0, centre=CORNER, shape="paraboloid"), 2.5e-4, 0.05)
    exact = asp.reference.Hertz(10.0, ELASTIC.reduced_modulus)
    return (
        f"force {force / exact.force(delta) - 1:+.2%} of Hertz (1 % wanted), area "
        f"{area / (np.pi * exact.radius(delta) ** 2) - 1:+.2%} (3 %)"
    )


def cone() -> str:
    """Force of a shallow cone, by Sneddon."""
    slope, a = 0.05, 0.1
    tool = Cone(L=1.0, half_angle=float(np.degrees(np.arctan(1 / slope))), centre=CORNER)
    force, delta, _ = _quarter(tool, 0.5 * np.pi * a * slope, a)
    exact = 2 / np.pi * ELASTIC.reduced_modulus * delta**2 / slope
    return f"force {force / exact - 1:+.2%} of Sneddon (2 % wanted)"


def sphere() -> str:
    """Sphere to a depth of 0.3 radii in finite strain, by axisymmetric elements."""
    R = 0.2
    force, depth, _ = _quarter(Sphere(L=1.0, radius=R, centre=CORNER), 0.3 * R, 0.51 * R, finite=True)
    exact = np.exp(np.interp(np.log(depth / R), *np.log(REVOLVED).T))
    return f"force {force / R**2 / exact - 1:+.2%} of axisymmetric elements (2 % wanted)"


def layer() -> str:
    """Paraboloid on a bonded block, 2 x 2 x 1, sides free."""
    solid, tool = asp.Material(E=10.0, nu=0.3), Sphere(L=2.0, radius=0.5, shape="paraboloid")
    found = asp.solve_contact(
        Flat(L=2.0), solid, tool=tool, delta_max=0.02, steps=5, height=1.0, sides="free", tolerance=0.01
    )
    return (
        f"force {found.curve.force[-1]:.5f} +- {found.curve.bar('P_star', -1):.2%} (0.0321 of another program; a "
        "half-space 0.0293)"
    )


def gel() -> str:
    """Sphere on a layer of nu = 0.49, bonded."""
    solid, tool = asp.Material(E=350.0, nu=0.49), Sphere(L=40.0, radius=17.0, centre=CORNER)
    found = asp.solve_contact(Flat(L=40.0), solid, tool=tool, delta_max=0.4, steps=5, height=8.0, tolerance=0.02)
    half_space = asp.reference.half_space_contact(tool, 256, delta_star=0.01, height=8.0, nu=0.49)
    spectral = 4 * half_space.P_star * solid.reduced_modulus * 40.0**2
    return (
        f"force {4 * found.curve.force[-1]:.1f} +- {found.curve.bar('P_star', -1):.2%} (972 by the series of "
        f"Dimitriadis et al., Biophys. J. 82 (2002) 2798; {spectral:.1f} by this layer in Fourier's series)"
    )


def composite() -> str:
    """Rough tool on a plane, and rough solid under the flat, rms slope 0.05."""
    rough = SelfAffine(L=1.0, H=0.8, lambda_short=0.2, slope=0.05, seed=2)
    one, two = (
        asp.solve_contact(solid, ELASTIC, tool=tool, delta_max=0.008, steps=5, tolerance=0.03).curve
        for solid, tool in ((rough, None), (Flat(L=1.0), rough))
    )
    apart = np.abs(two.P_star - one.P_star) / (one.error_P_star + two.error_P_star)
    return f"forces differ by {two.force[-1] / one.force[-1] - 1:+.2%}, at most {apart.max():.2f} of both bars together"


def plastic() -> str:
    """Hardness of a perfectly plastic solid under a cone of 70.3 degrees, E over yield strength 1000."""
    solid, tool = asp.Material(E=1.0, nu=0.3, yield_strength=1e-3), Cone(L=1.0, half_angle=70.3, centre=CORNER)
    curve = asp.solve_contact(
        Flat(L=1.0), solid, tool=tool, delta_max=0.03, steps=6, size=asp.MeshSize(h_contact=0.02, growth=0.25)
    ).curve
    deep = curve.delta >= 0.0099
    square = curve.force[deep] / curve.delta[deep] ** 2
    return (
        f"small strain: hardness {curve.mean_pressure[-1] / 1e-3:.2f} of the yield strength (2.6 to 3.1), force over "
        f"depth^2 within {np.ptp(square) / square.mean() / 2:.1%} over a factor of 3 (2 %)"
    )


def modulus() -> str:
    """Modulus of an elastic sphere by Oliver and Pharr."""
    problem = asp.Problem.of(
        Flat(L=1.0), ELASTIC, tool=Sphere(L=1.0, radius=2.0, shape="paraboloid"), delta_max=0.015, steps=3,
        unload_steps=8, size=asp.MeshSize(h_contact=0.03), height=2.0,
    )  # fmt: skip
    found = indentation_of(problem, asp.solve_contact(problem).curve)
    assert found is not None
    bar = found.error_modulus / found.modulus
    return f"E' {found.modulus / ELASTIC.reduced_modulus - 1:+.2%} of its value (2 % wanted), bar {bar:.2%}"


def shape() -> str:
    """Factor beta of shallow tips on an elastic half-space, where force ~ depth^2 and the stiffness is 2 F/delta."""
    found = []
    for name, tool in {
        "cone": Cone(L=1.0, half_angle=89.0),
        "three faces": Pyramid(L=1.0, faces=3, angle=89.0),
        "four faces": Pyramid(L=1.0, faces=4, angle=89.0),
    }.items():
        one = half_space_contact(tool, 640, P_star=1e-4, tolerance=1e-6)
        delta = one.delta_star + LATTICE / np.pi * 1e-4  # of a spot without images in the sides
        found.append(f"{name} {np.sqrt(np.pi / one.area_fraction) * 1e-4 / delta:.3f}")
    return f"beta {', '.join(found)} (1 for the cone)"


ROWS: dict[str, Callable[[], str]] = {
    f.__name__: f for f in (hertz, cone, sphere, layer, gel, composite, plastic, modulus, shape)
}

if __name__ == "__main__":
    warnings.simplefilter("ignore")
    for name in sys.argv[1:] or ROWS:
        since = perf_counter()
        print(f"{name:10} {ROWS[name]()} [{perf_counter() - since:.0f} s]", flush=True)
