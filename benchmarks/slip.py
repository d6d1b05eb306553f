# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Micro-slip by a half-space with both components of traction, by the normal curve and by the solid, docs/slip.md.

    python3 benchmarks/slip.py law           Jaeger's law against the half-space, nu = 0 and 0.3, four surfaces
    python3 benchmarks/slip.py others        the same on other surfaces, grooves along and across the motion, nu = 0.45
    python3 benchmarks/slip.py solid --h 25  solid and its curve against the half-space, elements of 0.025 L
    python3 benchmarks/slip.py solid --slope 0.005 0.1   the same on these rms slopes; a half-space has none

Each prints a table.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from itertools import product
from time import process_time

import numpy as np
from scipy.fft import irfft2, rfft2
from scipy.interpolate import CubicSpline

import asperity as asp
from asperity.arrays import Floats
from asperity.quasistatic.slip_paths import solve_slip
from asperity.reference import half_space_contact
from asperity.slip import SlipSettings, slip_of_curve
from asperity.slip.law import compliance_ratio

MU, AMPLITUDES, SLOPE = 0.4, (0.1, 0.3, 0.6, 0.9), 0.05
LOAD = 0.004  # pressure over E' at this rms slope; in a half-space both are proportional


def maps(slope: float) -> dict[str, asp.Surface]:
    """Three self-affine surfaces of an rms slope."""
    return {
        f"H {H:g}, seed {seed}": asp.Surface.from_spec(
            "self-affine", L=1.0, H=H, rms_slope=slope, lambda_roll=0.5, lambda_short=0.2, seed=seed, periodic=True
        )
        for H, seed in ((0.8, 1), (0.7, 2), (0.8, 3))
    }


SPHERE = {"sphere": asp.Surface.from_spec("sphere", L=1.0, radius=2.0, shape="paraboloid")}
SURFACES = maps(SLOPE) | SPHERE
#: Others. The bar of the energy was chosen after those with grooves were seen.
OTHERS = {
    f"H {H:g}, seed {seed}, aspect {aspect:g}": asp.Surface.from_spec(
        "self-affine", L=1.0, H=H, rms_slope=0.05, lambda_roll=0.5, lambda_short=0.1, seed=seed, aspect=aspect
    )
    for H, seed, aspect in ((0.5, 11, 1), (0.8, 12, 1), (1, 13, 1), (0.8, 14, 6), (0.8, 14, 1 / 6), (0.7, 15, 16))
}
FINE = np.unique(np.concatenate([np.linspace(0.0, t, 13) for t in AMPLITUDES]).round(9))


@dataclass(frozen=True)
class HalfSpace:
    """Periodic half-space under tangential tractions over E' (2, n, n), lengths over L; its mean does not move.

    A wave of the wave vector k moves by [I - nu k k^T/k^2] q/(G k), Cerruti's solution (Johnson, Contact Mechanics,
    1985, section 3.6), the motion along z, which is the same on like bodies, left out.
    """

    pressure: Floats
    nu: float

    @property
    def bound(self) -> Floats:
        return MU * self.pressure

    def displacement(self, q: Floats) -> Floats:
        n = self.pressure.shape[0]
        kx, ky = 2 * np.pi * np.fft.rfftfreq(n, 1 / n)[None, :], 2 * np.pi * np.fft.fftfreq(n, 1 / n)[:, None]
        k = np.hypot(kx, ky)
        k[0, 0] = np.inf
        x, y = (rfft2(part, workers=1) for part in q)
        along = self.nu * (kx * x + ky * y) / k**2
        factor = 2.0 / (1.0 - self.nu) / k  # E'/(G k)
        return np.stack([irfft2(factor * (a - c * along), s=(n, n)) for a, c in ((x, kx), (y, ky))])

    def step(self, move: float, slipped: Floats, start: Floats) -> tuple[Floats, Floats]:
        """Traction and slip after a move: FISTA with restarts on the complementary energy, |q| <= mu p."""
        size, bound = np.pi * (1.0 - self.nu), self.bound
        given = slipped + np.array([move, 0.0])[:, None, None]

        def admissible(q: Floats) -> Floats:
            return q * np.minimum(1.0, bound / np.maximum(np.linalg.norm(q, axis=0), 1e-300))

        q, ahead, t = start, start, 1.0
        for _ in range(20000):
            new = admissible(ahead - size * (self.displacement(ahead) - given))
            change = new - q
            if np.sum((ahead - new) * change) > 0.0:
                t = 1.0
            t, before = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * t * t)), t
            q, ahead = new, new + (before - 1.0) / t * change
            if np.linalg.norm(change) <= 1e-10 * np.linalg.norm(bound) and t > 3.0:
                break
        slip = np.where(bound > 0.0, self.displacement(q) - given, 0.0)
        return q, np.where(np.linalg.norm(q, axis=0) > (1 - 1e-9) * bound, slip, 0.0)

    def loop(self, move: float) -> tuple[float, float]:
        """Force over mu P at a displacement and energy of the loop between it and its opposite."""
        rest = np.zeros((2, *self.pressure.shape))
        q, slipped = self.step(move, rest, rest)
        _, back = self.step(-move, slipped, -q)
        loss = 2.0 * float(np.mean(self.bound * np.linalg.norm(back, axis=0)))
        return float(q[0].mean() / self.bound.mean()), loss


class NormalCurve:
    """Approach over force of the half-space below a load, and slip by it (Jaeger)."""

    def __init__(self, surface: asp.Surface, n: int, nu: float, load: float = LOAD) -> None:
        contacts = [half_space_contact(surface, n, P_star=load, sides="periodic", tolerance=1e-12)]
        for t in FINE[1:]:
            start = contacts[-1].pressure
            contacts.append(
                half_space_contact(surface, n, P_star=load * (1 - t), sides="periodic", start=start, tolerance=1e-12)
            )
        self.pressure = contacts[0].pressure
        self.area = contacts[0].area_fraction
        self._closing = CubicSpline(FINE, contacts[0].delta_star - np.array([c.delta_star for c in contacts]))
        self._scale, self._limit = MU * compliance_ratio(nu), MU * load

    def move(self, t: float) -> float:
        return float(self._scale * self._closing(t))

    def energy(self, t: float) -> float:
        """8 times the integral of T du less 4 T u."""
        work = t * float(self._closing(t)) - float(self._closing.integrate(0.0, t))
        return self._limit * self._scale * (8.0 * work - 4.0 * t * float(self._closing(t)))

    def stiffness(self, t: float) -> float:
        """Of the first loading, T/(mu P) over displacement."""
        return 1.0 / (self._scale * float(self._closing(t, 1)))


def law(n: int, surfaces: dict[str, asp.Surface], ratios: tuple[float, ...]) -> None:
    """Errors of Jaeger's law: T at equal displacement over mu P, energy at equal T."""
    print("| surface | nu | area | T at 0.1, 0.3, 0.6, 0.9 mu P, % | energy, % |\n|---|---|---|---|---|", flush=True)
    for name, surface in surfaces.items():
        for nu in ratios:
            curve = NormalCurve(surface, n, nu)
            space, found = HalfSpace(curve.pressure, nu), []
            for t in AMPLITUDES:
                force, energy = space.loop(curve.move(t))
                found.append((force - t, curve.energy(force) / energy - 1.0))
            print(f"| {name} | {nu:g} | {curve.area:.3f} | {columns(found)} |", flush=True)


def solid(n: int, h: float, slopes: list[float]) -> None:
    """Differences of the solid and of the curve of its load path from the half-space at the same forces.

    CPU seconds are those of a loop with one step to its amplitude, and of the load path in at least eight steps. p is
    the mean pressure in contact.
    """
    print("| surface | slope | p/E' | nu | h/L | method | u at 0.1, 0.3, 0.6, 0.9 mu P, % | energy, % | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for slope, name in product(slopes, maps(SLOPE)):
        surface, load = maps(slope)[name], LOAD * slope / SLOPE
        for nu in (0.0, 0.3):
            normal = NormalCurve(surface, n, nu, load)
            reference = [at_force(HalfSpace(normal.pressure, nu), normal, t) for t in AMPLITUDES]
            material = asp.Material(1.0, nu)
            size = asp.MeshSize(h_contact=h)
            pressure = load / (1.0 - nu**2)
            begun = process_time()
            problem = asp.Problem.of(
                surface, material, sides="periodic", pressure_max=pressure, steps=8, size=size,
                formulation=asp.Formulation(method="active-set"),
            )  # fmt: skip
            result = asp.solve_problem(problem)
            pressed = process_time()
            settings = SlipSettings(MU, AMPLITUDES, float(result.curve.force[-1]), steps=1, method="solid")
            paths = solve_slip(problem, result, settings)
            times = pressed - begun, (process_time() - pressed) / len(paths)
            slip = slip_of_curve(
                result.curve, settings, material, patch=1.0, height=1.0, sides="periodic", computed=paths
            )
            for method, found, seconds in (("solid", slip.paths, times[1]), ("its curve", slip.by_curve, times[0])):
                errors = []
                for path, (move, energy) in zip(found, reference, strict=True):
                    interface = path.displacement - path.force * 2.0 * (1.0 + nu)
                    errors.append((interface / move - 1.0, path.energy * (1.0 - nu**2) / energy - 1.0))
                scene = f"{name} | {slope:g} | {load / normal.area:.2g} | {nu:g} | {h:g}"
                print(f"| {scene} | {method} | {columns(errors)} | {seconds:.0f} |", flush=True)


def at_force(space: HalfSpace, curve: NormalCurve, t: float) -> tuple[float, float]:
    """Displacement and energy at T/(mu P), by Newton steps from the displacement by the normal curve."""
    move = curve.move(t)
    for _ in range(2):
        force, energy = space.loop(move)
        move += (t - force) / curve.stiffness(t)
    return move, energy * (curve.energy(t) / curve.energy(force))


def columns(errors: list[tuple[float, float]]) -> str:
    return " | ".join(", ".join(f"{100 * x:+.2f}" for x in column) for column in zip(*errors, strict=True))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("law", "others", "solid"))
    parser.add_argument("--h", type=float, default=25.0, help="size of the elements [L/1000]")
    parser.add_argument("--slope", type=float, nargs="+", default=[SLOPE], help="rms slopes of the maps of solid")
    parser.add_argument("-n", type=int, default=192, help="cells per side of the half-space")
    options = parser.parse_args()
    if options.what == "law":
        law(options.n, SURFACES, (0.0, 0.3))
    elif options.what == "others":
        law(options.n, OTHERS, (0.3, 0.45))
    else:
        solid(options.n, 1e-3 * options.h, options.slope)
