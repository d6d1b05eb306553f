"""Error bars on classes of elastic surfaces: are the errors inside, how much larger are the bars, what does a run cost?

    python3 benchmarks/accuracy.py [CLASS]... [--seed N] [--tolerance X]

Every surface is pressed to a tolerance in six steps. The truth is the boundary-element solution of the layer on two
grids, extrapolated; it knows no slopes, and heights and approach are a tenth of those of a real surface. An error may
exceed its bar by the uncertainty of the truth: of the force half of what the extrapolation changes, of the area its
change from one grid to the other, of the slope k_n 1 %. Prints one line a run: steps inside the bars of force, mean
gap, area and k_n, median bar over median error of the force, greatest error and bar, meshes, dofs of the last one, CPU
seconds of the run, and its time over that of its last mesh.

The constants were chosen on smooth, self-affine, turned, ground, honed, dimples, grating, pillars, terraces, ridges,
spot, late, short and inclusions with the seeds 6 to 8, 11, 21, 22 and 41 to 44.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from time import perf_counter, process_time

import numpy as np

import asperity as asp
from asperity.adaptive.mesh_plan import extrapolate
from asperity.arrays import Floats
from asperity.reference import RoughHalfSpace
from asperity.surface import HeightMap, SelfAffine, Sphere, Surface

STEPS = 6
FLAT = 0.1  # heights and approaches over those of the classes
AROUND = 0.015  # of an approach, to either side, over which the slope k_n is the difference of the truth
ELASTIC = asp.Material(1.0, 0.3)
# Per side of the boundary elements. Five or ten do not divide them: all edges of a pitch would fall on cells alike
CELLS = 216, 432
UNSURE, UNSURE_SLOPE = 0.0005, 0.01  # relative, least of the truth, and that of its slope
NODES = 513  # per side of the maps


def grid() -> tuple[Floats, Floats]:
    """Nodes of a map (NODES, NODES)."""
    x, y = np.meshgrid(*2 * [np.linspace(0.0, 1.0, NODES)])
    return x, y


def noise(seed: int, slope: float, short: float, roll: float = 0.4, H: float = 0.8) -> SelfAffine:
    """Self-affine surface."""
    return SelfAffine(L=1.0, H=H, slope=slope, lambda_roll=roll, lambda_short=short, seed=seed)


def smooth(seed: int) -> Surface:
    """A single paraboloid off the middle; a fractal with few waves for even seeds."""
    if seed % 2:
        return asp.Surface.from_spec("sphere", L=1.0, radius=8.0 + seed, centre=(0.3, 0.4), shape="paraboloid")
    fractal = asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5, seed=seed)
    return HeightMap.of(0.1 * fractal.grid(NODES), 1.0)


def turned(seed: int) -> Surface:
    """Grooves of a feed of a tenth of the side, and noise."""
    x, _ = grid()
    return HeightMap.of(1.6e-4 * np.cos(20.0 * np.pi * x + seed) + noise(seed, 0.007, 0.028).grid(NODES), 1.0)


def ground(seed: int) -> Surface:
    """Waves twenty times longer along x than along y."""
    n = 2 * (NODES - 1)
    kx, ky = np.meshgrid(*2 * [np.fft.fftfreq(n, 1.0 / n)])
    q = np.hypot(ky, 20.0 * kx)
    amplitude = np.where((q > 0.0) & (q <= 67.0), np.maximum(q, 5.0) ** -1.8, 0.0)
    phases = 2j * np.pi * np.random.default_rng(seed).random((n, n))
    z = np.fft.ifft2(amplitude * np.exp(phases)).real[:NODES, :NODES]
    slopes = np.gradient(z, 1.0 / (NODES - 1))
    return HeightMap.of(0.013 / np.sqrt(sum(np.mean(s**2) for s in slopes)) * z, 1.0)


def honed(seed: int) -> Surface:
    """Nine grooves in each of two directions, in a plateau with noise."""
    (x, y), rng = grid(), np.random.default_rng(seed)
    z = noise(seed, 0.0033, 0.04).grid(NODES)
    for angle in (0.5, -0.5):
        across = (x - 0.5) * np.sin(angle) + (y - 0.5) * np.cos(angle)
        for _ in range(9):
            place, width = rng.uniform(-0.7, 0.7), rng.uniform(0.012, 0.025)
            z = z - 6e-4 * rng.uniform(0.3, 1.0) * np.exp(-(((across - place) / width) ** 2))
    return HeightMap.of(z, 1.0)


def dimples(seed: int) -> Surface:
    """Six round dimples in a plateau with noise."""
    (x, y), rng = grid(), np.random.default_rng(seed)
    z = noise(seed, 0.0033, 0.08).grid(NODES)
    for cx, cy in rng.uniform(0.1, 0.9, (6, 2)):
        r = np.hypot(x - cx, y - cy) / 0.1
        z = z - 1e-3 * np.where(r < 1.0, (1.0 - r**2) ** 2, 0.0)
    return HeightMap.of(z, 1.0)


def grating(seed: int) -> Surface:
    """Five ridges with blunt tops."""
    x, _ = grid()
    return HeightMap.of(6e-4 * np.tanh(2.0 * np.cos(10.0 * np.pi * x + 0.7 * seed)), 1.0)


def turn(angle: float) -> Floats:
    """Distance of the nodes from a line through the middle."""
    x, y = grid()
    return np.asarray((x - 0.5) * np.cos(angle) + (y - 0.5) * np.sin(angle))


def step(distance: Floats, width: float) -> Floats:
    """From 0 to 1 over a width."""
    return np.asarray(0.5 * (1.0 + np.tanh(distance / width)))


def pillars(seed: int) -> Surface:
    """Seven flat tops with sharp edges, of different heights."""
    (x, y), rng = grid(), np.random.default_rng(seed)
    z = np.full_like(x, -1e-3)
    for cx, cy in rng.uniform(0.12, 0.88, (7, 2)):
        height = 1e-3 + rng.uniform(-3e-4, 0.0)
        z = np.maximum(z, height * step(rng.uniform(0.04, 0.09) - np.hypot(x - cx, y - cy), 0.004) - 1e-3)
    return HeightMap.of(z, 1.0)


def terraces(seed: int) -> Surface:
    """Self-affine noise in steps, with noise on them."""
    q = noise(seed, 0.008, 0.1, roll=0.6).grid(NODES) / 3e-4
    whole = np.floor(q)
    return HeightMap.of(3e-4 * (whole + step(q - whole - 0.5, 0.04)) + noise(seed + 99, 0.0015, 0.06).grid(NODES), 1.0)


def ridges(seed: int) -> Surface:
    """Sharp ridges with flat tops at an angle to the sides, with noise."""
    rng = np.random.default_rng(seed)
    rise = np.abs((turn(rng.uniform(0.2, 1.3)) * rng.uniform(4.0, 7.0) + rng.uniform()) % 1.0 - 0.5) * 2.0
    return HeightMap.of(6e-4 * np.minimum(1.0 - rise, 0.7) + noise(seed, 0.002, 0.05).grid(NODES), 1.0)


def spot(seed: int) -> Surface:
    """A single small spot."""
    x, y = map(float, np.random.default_rng(seed).uniform(0.25, 0.75, 2))
    return asp.Surface.from_spec("sphere", L=1.0, radius=12.0, centre=(x, y), shape="paraboloid")


def late(seed: int) -> Surface:
    """A round spot, and a square plateau with sharp edges that is touched late."""
    (x, y), rng = grid(), np.random.default_rng(seed)
    a, b = rng.uniform(0.2, 0.4), rng.uniform(0.6, 0.8)
    plateau = 8e-4 * step(0.12 - np.maximum(np.abs(x - b), np.abs(y - b)), 0.006) - 1.2e-3
    return HeightMap.of(np.maximum(-0.03 * ((x - a) ** 2 + (y - a) ** 2), plateau), 1.0)


def inclusions(seed: int) -> Surface:
    """Ten small steep grains on a wavy face."""
    (x, y), rng = grid(), np.random.default_rng(seed)
    z = noise(seed, 0.004, 0.15, roll=0.5).grid(NODES)
    for cx, cy in rng.uniform(0.1, 0.9, (10, 2)):
        width = rng.uniform(0.006, 0.015)
        z = z + rng.uniform(1e-4, 4e-4) * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / width**2)
    return HeightMap.of(z, 1.0)


def angled(seed: int) -> Surface:
    """Grooves at an angle to the sides, and noise."""
    waves = 1.6e-4 * np.cos(14.0 * np.pi * turn(0.37 + 0.5 * seed))
    return HeightMap.of(waves + noise(seed, 0.006, 0.05).grid(NODES), 1.0)


def eggs(seed: int) -> Surface:
    """Waves in two directions at an angle to the sides."""
    a = 0.3 + seed
    return HeightMap.of(
        2e-4 * np.cos(12.0 * np.pi * turn(a) + seed) * np.cos(10.0 * np.pi * turn(a + 0.5 * np.pi)), 1.0
    )


def cone(seed: int) -> Surface:
    """A tip, under which the pressure is infinite."""
    (x, y), (a, b) = grid(), np.random.default_rng(seed).uniform(0.3, 0.7, 2)
    return HeightMap.of(-0.02 * np.hypot(x - a, y - b), 1.0)


def ring(seed: int) -> Surface:
    """A wavy torus."""
    (x, y), (a, b) = grid(), np.random.default_rng(seed).uniform(0.4, 0.6, 2)
    waves = 1e-5 * np.cos(3.0 * np.arctan2(y - b, x - a))
    return HeightMap.of(-0.05 * (np.hypot(x - a, y - b) - 0.25) ** 2 + waves, 1.0)


def plateau(seed: int) -> Surface:
    """A square with sharp edges at an angle to the sides, touched as a whole."""
    angle = 0.4 + seed
    across = np.maximum(np.abs(turn(angle)), np.abs(turn(angle + 0.5 * np.pi)))
    return HeightMap.of(1e-3 * step(0.2 - across, 0.004) - 1e-3, 1.0)


def needles(seed: int) -> Surface:
    """Spots that are long and narrow, in all directions."""
    (x, y), rng = grid(), np.random.default_rng(seed)
    z = np.full_like(x, -1.0)
    for _ in range(25):
        (cx, cy), angle, length = rng.uniform(0.05, 0.95, 2), rng.uniform(0.0, np.pi), rng.uniform(3.0, 12.0)
        along, across = (
            (x - cx) * np.sin(angle) - (y - cy) * np.cos(angle), (x - cx) * np.cos(angle) + (y - cy) * np.sin(angle)
        )  # fmt: skip
        z = np.maximum(z, rng.uniform(-3e-4, 0.0) - 0.4 * (across**2 + (along / length) ** 2))
    return HeightMap.of(z, 1.0)


#: Surface of a seed, and greatest approach [L]
CLASSES: dict[str, tuple[Callable[[int], Surface], float]] = {
    "smooth": (smooth, 0.0028),
    "self-affine": (lambda seed: noise(seed, 0.016, 0.03), 0.0022),
    "turned": (turned, 7e-4),
    "ground": (ground, 7e-4),
    "honed": (honed, 3e-4),
    "dimples": (dimples, 3e-4),
    "grating": (grating, 1e-3),
    "pillars": (pillars, 6e-4),
    "terraces": (terraces, 5e-4),
    "ridges": (ridges, 3e-4),
    "spot": (spot, 1e-4),
    "late": (late, 9e-4),
    "short": (lambda seed: noise(seed, 0.01, 0.02, roll=0.3, H=0.6), 6e-4),
    "inclusions": (inclusions, 5e-4),
    "angled": (angled, 6e-4),
    "eggs": (eggs, 4e-4),
    "cone": (cone, 1e-3),
    "ring": (ring, 4e-4),
    "plateau": (plateau, 4e-4),
    "needles": (needles, 5e-4),
}


Truth = dict[str, tuple[Floats, Floats | float]]


def flattened(surface: Surface) -> Surface:
    """The same with less height."""
    if isinstance(surface, Sphere):
        return asp.Surface.from_spec(
            "sphere", L=1.0, radius=surface.radius / FLAT, centre=surface.centre, shape="paraboloid"
        )
    return HeightMap.of(FLAT * np.asarray(surface.grid(NODES)), 1.0)


def truth_of(surface: Surface, at: Floats) -> Truth:
    """P*, contact fraction, mean gap and dP*/d(delta*) at ascending approaches [L], each with its uncertainty."""
    found = []
    for n, around in zip(CELLS, (AROUND, 0.0), strict=True):
        layer = RoughHalfSpace(n, 1.0, ELASTIC.nu)
        all_ = np.unique(np.concatenate([(1.0 + d) * at for d in {-around, 0.0, around}]))
        found.append(layer.curve(layer.heights(surface), surface.maximum()[2], all_, tolerance=2e-6))
    coarse, fine = found
    here = np.searchsorted(coarse.delta_star, 0.9999 * at)
    before, after = coarse.P_star[here - 1], coarse.P_star[here + 1]
    P, error = extrapolate(coarse.P_star[here], fine.P_star, 2.0, 2.0)
    unsure = np.maximum(0.5 * np.abs(error), UNSURE * P)
    compliance = ELASTIC.reduced_modulus / ELASTIC.confined_modulus
    slope = (after - before) / (2.0 * AROUND * at)
    return {
        "P_star": (P, unsure),
        "area_fraction": (fine.area_fraction, np.abs(fine.area_fraction - coarse.area_fraction[here])),
        "mean_gap": (surface.maximum()[2] - surface.mean() - at + compliance * P, compliance * unsure),
        "k_n": (ELASTIC.reduced_modulus * slope, UNSURE_SLOPE * ELASTIC.reduced_modulus * slope),
    }


def judge(name: str, seed: int, tolerance: float) -> None:
    """Run one surface to a tolerance and print its line."""
    make, depth = CLASSES[name]
    surface, depth = flattened(make(seed)), FLAT * depth
    at = depth * np.arange(1, STEPS + 1) / STEPS
    start, clock = process_time(), perf_counter()
    run = asp.solve_contact(surface, ELASTIC, tolerance=asp.AccuracyTarget(tolerance), delta_max=depth, steps=STEPS)
    seconds, price = process_time() - start, (perf_counter() - clock) / run.levels[-1].seconds
    loading, truth, inside = run.curve.loading(), truth_of(surface, at), []
    for column, (exact, unsure) in truth.items():
        value, bar = (np.interp(at, loading.delta_star, getattr(loading, f"{e}{column}")) for e in ("", "error_"))
        inside.append(f"{np.sum(np.abs(value - exact) <= bar + unsure)}/{STEPS}")
    P = truth["P_star"][0]
    error, bar = (np.interp(at, loading.delta_star, v) / P for v in (loading.P_star, loading.error_P_star))
    error = np.abs(error - 1.0)
    cells = (
        name, seed, f"{100 * tolerance:g} %", *inside, f"{np.median(bar) / np.median(error):.1f}",
        f"{100 * np.max(error):.1f} %", f"{100 * run.worst:.1f} %", len({level.dofs for level in run.levels}),
        run.levels[-1].dofs, f"{seconds:.0f}", f"{price:.1f}",
    )  # fmt: skip
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*", choices=[*CLASSES, []])
    parser.add_argument("--seed", type=int, nargs="*", default=[72])
    parser.add_argument("--tolerance", type=float, nargs="*", default=[0.05])
    options = parser.parse_args()
    head = (
        "class, seed, tolerance, inside, gap inside, area inside, k_n inside, bar/error, greatest error, greatest bar, "
        "meshes, dofs, CPU s, over last mesh"
    ).split(", ")
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head))
    for name in options.names or CLASSES:
        for seed in options.seed:
            for tolerance in options.tolerance:
                judge(name, seed, tolerance)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
