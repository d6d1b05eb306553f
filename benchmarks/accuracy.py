"""Error bars on classes of surfaces: are the errors inside, how much larger are the bars, and what does a run cost?

    python3 benchmarks/accuracy.py [CLASS]... [elastic] [yielding] [--seed N] [--tolerance X]

Every surface is pressed to a tolerance in ten steps. The truth of an elastic solid is the boundary-element solution of
the layer on two grids, extrapolated (slopes are small, for it knows none). That of a solid that yields is the limit of
two finer meshes, whose elements go with the root of the approach at which they are touched, in twice as many load
steps. An error may exceed its bar by the uncertainty of the truth: of the elastic area its change of 0.1 to 4 % from
one grid to the other, for a third grid of 1280 changes it by 0.1 to 0.4 % (self-affine and ground, seed 6). Prints one
line a run: steps inside the bar, median bar over median error, the same for the contact area, meshes, dofs of the last
one, and CPU seconds of the run over those of its last mesh. The constants were chosen on seeds 6 to 8, 21 and
22, elastic, and on smooth, honed and dimples of seeds 9 and 21, yielding.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from time import process_time

import numpy as np

import asperity as asp
from asperity.adaptive.family import dofs_of
from asperity.adaptive.mesh_plan import extrapolate
from asperity.arrays import Floats
from asperity.mesh.size_field import SizeField
from asperity.model.settings import MEAN, MeshSize
from asperity.reference import RoughHalfSpace, half_space_contact
from asperity.reference.halfspace import HARDNESS
from asperity.surface import HeightMap, SelfAffine, Surface

STEPS = 10
YIELD = 0.004
ELASTIC, YIELDING = asp.Material(1.0, 0.3), asp.Material(1.0, 0.3, YIELD, 0.05)
# Per side of the boundary elements. Five or ten do not divide them: all edges of a pitch would fall on cells alike
CELLS = 324, 648
FINER, RATIO = 3.0, 1.5  # dofs of the finest mesh of a truth over those of the run, and sizes of the other over its own
GROWTH = 0.3  # of its elements
UNSURE = 0.0015  # relative, of the elastic truth
UNSURE_PART = 0.3  # of the last extrapolation of the other one: an order between 1.6 and 2.4 instead of 2
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


#: Surface of a seed, and greatest approach [L]
CLASSES: dict[str, tuple[Callable[[int], Surface], float]] = {
    "smooth": (smooth, 0.0028),
    "self-affine": (lambda seed: noise(seed, 0.016, 0.03), 0.0022),
    "turned": (turned, 7e-4),
    "ground": (ground, 7e-4),
    "honed": (honed, 3e-4),
    "dimples": (dimples, 3e-4),
    "grating": (grating, 1e-3),
}


def elastic_truth(surface: Surface, at: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """P* and contact fraction at ascending approaches [L], relative uncertainty of P*, and that of the fraction."""
    found = []
    for n in CELLS:
        start, rows = None, []
        for d in at:
            state = half_space_contact(surface, n, delta_star=float(d), height=1.0, tolerance=1e-6, start=start)
            start = state.pressure
            rows.append((state.P_star, state.area_fraction))
        found.append(np.array(rows).T)
    (P_coarse, A_coarse), (P, A) = found
    return extrapolate(P_coarse, P, 2.0, 2.0)[0], A, np.full(len(at), UNSURE), np.abs(A - A_coarse)


def yielding_truth(surface: Surface, at: Floats, dofs: int) -> tuple[Floats, Floats, Floats, Floats]:
    """The same of a solid that yields; `dofs` are those of the run."""
    depth, n = float(at[-1]), 384
    layer = RoughHalfSpace(n, 1.0, YIELDING.nu, hardness=HARDNESS * YIELD / YIELDING.reduced_modulus)
    touched_at = layer.curve(layer.heights(surface), surface.maximum()[2], at).touched_at
    cells = np.sqrt(touched_at / depth)  # half-widths of spots grow like this
    size, P = 0.01, []
    for _ in range(4):
        size *= (dofs_of(SizeField.on_cells(size * cells, GROWTH), 0, 1.0) / (FINER * dofs)) ** 0.5
    for h in (RATIO * size, size):
        mesh = MeshSize(h, GROWTH, cells=h * cells)
        fine = asp.solve_contact(surface, YIELDING, delta_max=depth, steps=2 * STEPS, size=mesh, dilatation=MEAN)
        loading = fine.curve.loading()
        P.append(np.interp(at, loading.delta_star, loading.P_star))
        area, unsure = (
            np.interp(at, loading.delta_star, column) for column in (loading.area_fraction, loading.error_area_fraction)
        )
    limit, error = extrapolate(P[0], P[1], RATIO, 2.0)
    return limit, area, UNSURE_PART * np.abs(error / limit), unsure


def judge(name: str, seed: int, material: asp.Material, tolerance: float) -> None:
    """Run one surface to a tolerance and print its line."""
    make, depth = CLASSES[name]
    surface, at = make(seed), depth * np.arange(1, STEPS + 1) / STEPS
    start = process_time()
    run = asp.solve_to_tolerance(surface, material, asp.AccuracyTarget(tolerance), delta_max=depth, steps=STEPS)
    seconds = process_time() - start
    share = run.levels[-1].seconds / sum(level.seconds for level in run.levels)
    loading = run.curve.loading()
    P, bar, A, area_bar = (
        np.interp(at, loading.delta_star, column)
        for column in (loading.P_star, loading.error_P_star, loading.area_fraction, loading.error_area_fraction)
    )
    if material.plastic:
        exact, area, unsure, area_unsure = yielding_truth(surface, at, run.levels[-1].dofs)
    else:
        exact, area, unsure, area_unsure = elastic_truth(surface, at)
    error, off = np.abs(P / exact - 1.0), np.abs(A - area)
    cells = (
        name, "yielding" if material.plastic else "elastic", seed, f"{100 * tolerance:g} %",
        f"{np.sum(error <= bar / exact + unsure)}/{STEPS}", f"{np.median(bar / exact) / np.median(error):.1f}",
        f"{100 * np.max(error):.1f} %", f"{100 * run.worst:.1f} %", f"{np.sum(off <= area_bar + area_unsure)}/{STEPS}",
        f"{np.median(area_bar) / np.median(off):.1f}", len({level.dofs for level in run.levels}),
        run.levels[-1].dofs, f"{seconds:.0f}", f"{1.0 / share:.1f}",
    )  # fmt: skip
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*", choices=[*CLASSES, "elastic", "yielding", []])
    parser.add_argument("--seed", type=int, nargs="*", default=[8, 9])
    parser.add_argument("--tolerance", type=float, nargs="*", default=[0.05])
    options = parser.parse_args()
    materials = {"elastic": ELASTIC, "yielding": YIELDING}
    chosen = [name for name in options.names if name in materials] or list(materials)
    head = (
        "class, material, seed, tolerance, inside, bar/error, greatest error, greatest bar, area inside, "
        "area bar/error, meshes, dofs, CPU s, levels/last"
    ).split(", ")
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head))
    for material in chosen:
        for name in [name for name in options.names if name in CLASSES] or CLASSES:
            for seed in options.seed:
                for tolerance in options.tolerance:
                    judge(name, seed, materials[material], tolerance)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
