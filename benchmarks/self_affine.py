# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Self-affine surfaces, elastic and elastic-plastic, against half-space solutions and the literature.

    python3 benchmarks/self_affine.py PART, one of area, kappa, ensemble, influence, challenge, plastic, stiffness,
        interface

Each part prints one Markdown table. `area`: area coefficient kappa = A h'/(P* A0) of the solid, of the
half-space of asperity and of Tamaas (where benchmarks/peers/install has fetched it) at the same forces. `kappa`: the
same with a tolerance of the area too, and on two of these surfaces made flatter. `ensemble`:
kappa of 20 half-spaces for each cut-off. `influence`:
what height of the block, Poisson's ratio and slope change. `challenge`: cases/challenge.toml, columns as of `area`.
`plastic`: mean pressure over the yield strength. `stiffness`: exponents of the stiffness over the force of 20
half-spaces. `interface`: stiffness of the solid and of the half-space.
benchmarks/pictures.py draws docs/pictures/self_affine.svg from the stored tables.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import warnings
from os import environ
from pathlib import Path

import numpy as np

import asperity as asp
from asperity.adaptive.solve_to_tolerance import AccurateResult, refine
from asperity.arrays import Floats
from asperity.curve import Curve
from asperity.quasistatic.hooks import Hooks
from asperity.reference import RoughHalfSpace, half_space_contact
from asperity.reference.halfspace import corrected_area
from asperity.surface import SelfAffine, Surface

ROOT = Path(__file__).resolve().parents[1]
H, ROLL, SLOPE = 0.8, 0.5, 0.05  # Hurst exponent, roll-off [L], rms slope
HEIGHT = 0.01  # rms height where the surface has no roll-off [L]
TOLERANCE, STEPS, SHOWN = 0.02, 6, 4  # of the force; load steps, and how many of the last are shown
AREA = 0.12  # greatest area fraction
OF_AREA = 0.035  # tolerance of the area in `kappa`
SURFACES = ((16, 1), (16, 2), (16, 3), (32, 1), (32, 2))  # L over the shortest wave, seed
FLATTER = SLOPE / 4, ((16, 2), (16, 3))  # rms slope of other surfaces in `kappa`, and which
CELLS = 16  # of the half-spaces per shortest wave; their bar is the change from half as many
CUTOFFS, LOADS = (16, 32, 64, 128), np.array([0.01, 0.02, 0.04])  # of the ensemble: L over the shortest wave, P*/h'
ENSEMBLE_CELLS = 8, 512  # per shortest wave, and no more than that per side: 4 per wave change kappa of L/64 by 1 %
MOST_DOFS = 1_000_000
INFLUENCE = (  # L over the shortest wave, height [L], Poisson's ratio, rms slope
    (16, 1.0, 0.0, SLOPE),
    (16, 0.5, 0.0, SLOPE),
    (16, 1.0, 0.45, SLOPE),
    (16, 1.0, 0.0, 0.2),
    (32, 1.0, 0.0, SLOPE),
)
YIELD, PLASTIC_SLOPE = (0.02, 0.01), 0.2  # yield strengths over E, without hardening
PLASTIC_AREA, FOR_PLASTIC = 0.06, 0.04  # greatest area fraction, by a half-space, and tolerance
SEEDS, WAVES = range(20), 64  # of the half-spaces whose stiffness is fitted: seeds, L over the shortest wave
EXPONENTS = (0.5, 0.8, 1.0)  # Hurst exponents
LIGHT = np.geomspace(0.004, 0.12, 6)  # forces P* over the rms height over L
GREATER = np.geomspace(0.004, 0.04, 4)  # forces P* over the rms slope


def surface_of(waves: int, seed: int, slope: float = SLOPE) -> SelfAffine:
    """The periodic surface of the comparison with L/waves as the shortest wave."""
    return SelfAffine(L=1.0, H=H, slope=slope, lambda_roll=ROLL, lambda_short=1.0 / waves, seed=seed)


def approach(surface: Surface, area: float, hardness: float = np.inf, height: float = 1.0, nu: float = 0.0) -> float:
    """Approach at which a half-space of 256 x 256 cells has an area of contact [L]."""
    layer = RoughHalfSpace(256, height, nu, "periodic", hardness)
    heights = layer.heights(surface)
    curve = layer.curve(heights, surface.maximum()[2] / surface.L, np.linspace(0.1, 3.0, 30) * heights.std())
    return float(np.interp(area, curve.area_fraction, curve.delta_star))


def solid(
    surface: SelfAffine,
    material: asp.Material,
    area: float,
    height: float = 1.0,
    steps: int = STEPS,
    tolerance: float = TOLERANCE,
    of_area: float | None = None,
) -> AccurateResult:
    """The solid pressed to an area of contact, to a tolerance of its force and perhaps of its area."""
    hardness = 3.0 * (material.yield_strength or np.inf) / material.reduced_modulus
    problem = asp.Problem.of(
        surface, material, height=height, sides="periodic", steps=steps,
        delta_max=approach(surface, area, hardness, height, material.nu),
    )  # fmt: skip
    return refine(problem, asp.AccuracyTarget(tolerance, MOST_DOFS, area_tolerance=of_area))


def bars(curve: Curve) -> tuple[Floats, Floats]:
    """Relative bars of force and area (steps,)."""
    return curve.error_P_star / curve.P_star, curve.error_area_fraction / curve.area_fraction


def areas_of_half_space(surface: Surface, n: int, P_star: Floats) -> Floats:
    """Area fractions of the half-space of asperity, n cells per side, at ascending forces (k,)."""
    areas, start = [], None
    for P in P_star:
        found = half_space_contact(surface, n, P_star=float(P), sides="periodic", tolerance=1e-6, start=start)
        start = found.pressure
        areas.append(found.area_fraction)
    return np.array(areas)


def areas_of_tamaas(surface: Surface, n: int, P_star: Floats) -> Floats:
    """Area fractions of Tamaas, n cells per side, corrected for the perimeter (k,); NaN where it is not installed."""
    sys.path.insert(0, str(ROOT / "benchmarks" / "peers"))
    import programs

    if "Tamaas" in programs.missing():
        return np.full(len(P_star), np.nan)
    command, environment = programs.inside("bookworm", "usr/bin/python3.11")
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "map.npz", Path(folder) / "out.npz"
        layer = RoughHalfSpace(n, 1.0, 0.0, "periodic")
        np.savez(source, heights=layer.heights(surface), P_star=P_star)
        script = str(ROOT / "benchmarks" / "peers" / "tamaas_area.py")
        subprocess.run(
            [*command, script, str(source), str(target)],
            check=True,
            env=environ | {"OMP_NUM_THREADS": "1"} | environment,
        )
        pressures = np.load(target)["pressures"]
    return np.array([corrected_area(p > 0.0, "periodic") for p in pressures])


def compare(about: str, waves: int, surface: SelfAffine, found: AccurateResult, shown: int = SHOWN) -> None:
    """Print area and kappa of the last steps beside those of the half-spaces at the same forces."""
    loading = found.curve.loading()
    rows = loading.where(loading.P_star >= loading.P_star[-shown])
    force_bar, area_bar = bars(rows)
    n = CELLS * waves
    slope = surface.rms_slope()
    own, coarse = (areas_of_half_space(surface, m, rows.P_star) for m in (n, n // 2))
    other = areas_of_tamaas(surface, n, rows.P_star)
    for i, P in enumerate(rows.P_star):
        kappa = slope / P
        values = (
            f"{P / slope:.4f}", f"{rows.area_fraction[i]:.4f}", f"{100 * force_bar[i]:.1f}", f"{100 * area_bar[i]:.1f}",
            f"{kappa * rows.area_fraction[i]:.3f}", f"{100 * (force_bar[i] + area_bar[i]):.1f}",
            f"{kappa * own[i]:.3f}", f"{100 * abs(coarse[i] / own[i] - 1):.1f}", f"{kappa * other[i]:.3f}",
        )  # fmt: skip
        print(f"| {about} | {' | '.join(values)} | {found.contact.dofs} |", flush=True)


COMPARED = (
    "P*/h'", "A/A0", "bar of P* %", "bar of A %", "kappa", "bar of kappa %", "kappa, half-space", "bar %",
    "kappa, Tamaas", "dofs",
)  # fmt: skip


def head(*columns: str) -> None:
    """Print the head of a Markdown table."""
    print(f"| {' | '.join(columns)} |\n" + "|---" * len(columns) + "|", flush=True)


def area() -> None:
    """Area coefficients on several surfaces."""
    head("L/shortest", "seed", *COMPARED)
    for waves, seed in SURFACES:
        surface = surface_of(waves, seed)
        found = solid(surface, asp.Material(1.0, 0.0), AREA)
        compare(f"{waves} | {seed}", waves, surface, found)


def kappa() -> None:
    """Area coefficients on the surfaces of `area`, and on two of them made flatter, with a tolerance of the area."""
    head("rms slope", "L/shortest", "seed", *COMPARED)
    for slope, surfaces in ((SLOPE, SURFACES), FLATTER):
        for waves, seed in surfaces:
            surface = surface_of(waves, seed, slope)
            found = solid(surface, asp.Material(1.0, 0.0), AREA, of_area=OF_AREA)
            compare(f"{slope} | {waves} | {seed}", waves, surface, found)


def ensemble() -> None:
    """Area coefficients of half-spaces, mean of many seeds, over the cut-off and the load."""
    head("L/shortest", "seeds", "P*/h'", "A/A0", "kappa", "standard error", "standard deviation")
    for waves in CUTOFFS:
        found = []
        for seed in SEEDS:
            surface = surface_of(waves, seed)
            n = min(ENSEMBLE_CELLS[0] * waves, ENSEMBLE_CELLS[1])
            found.append(areas_of_half_space(surface, n, SLOPE * LOADS))
        for i, load in enumerate(LOADS):
            areas = np.array(found)[:, i]
            spread = np.std(areas / load, ddof=1)
            values = f"{areas.mean():.4f} | {areas.mean() / load:.3f} | {spread / len(found) ** 0.5:.3f} | {spread:.3f}"
            print(f"| {waves} | {len(found)} | {load:.3f} | {values} |", flush=True)


def influence() -> None:
    """What height, Poisson's ratio, slope, and waves left out by the mesh change, over half-space and layer."""
    head(
        "L/shortest", "height/L", "nu", "rms slope", "P*/h'", "A over half-space", "bar %", "P* over layer",
        "bar of P* %", "A over A as computed",
    )  # fmt: skip
    for waves, height, nu, slope in INFLUENCE:
        surface = surface_of(waves, 1, slope)
        found = solid(surface, asp.Material(1.0, nu), AREA, height)
        row, raw = found.curve.loading(), found.raw.loading()
        force_bar, area_bar = (100 * bar[-1] for bar in bars(row))
        P, n = float(row.P_star[-1]), waves * CELLS
        own = areas_of_half_space(surface, n, row.P_star[-1:])[0]
        layer = half_space_contact(
            surface, n, delta_star=float(row.delta_star[-1]), height=height, nu=nu, sides="periodic", tolerance=1e-6
        )
        ratio = f"{row.area_fraction[-1] / own:.3f} | {force_bar + area_bar:.1f}"
        left_out = f"{row.area_fraction[-1] / raw.area_fraction[-1]:.4f}"
        about = f"{waves} | {height} | {nu} | {slope} | {P / slope:.4f}"
        print(f"| {about} | {ratio} | {P / layer.P_star:.3f} | {force_bar:.1f} | {left_out} |", flush=True)


def challenge() -> None:
    """The shipped case of the class of the contact-mechanics challenge."""
    head("case", *COMPARED)
    case = asp.Case.load(ROOT / "cases" / "challenge.toml")
    accuracy = case.to_dict()["accuracy"]
    problem = case.problem()
    target = asp.AccuracyTarget(accuracy["tolerance"], max_dofs=accuracy["max_dofs"])
    assert isinstance(problem.surface, SelfAffine)
    compare("challenge.toml", 64, problem.surface, refine(problem, target), shown=problem.load_path.steps)


def plastic() -> None:
    """Mean pressure over the yield strength along the load."""
    head("yield strength/E", "seed", "P*/h'", "A/A0", "mean pressure/yield strength", "bar %", "dofs")
    for strength in YIELD:
        for seed in (1, 2):
            surface = surface_of(16, seed, PLASTIC_SLOPE)
            found = solid(surface, asp.Material(1.0, 0.3, strength), PLASTIC_AREA, steps=8, tolerance=FOR_PLASTIC)
            rows = found.curve.loading()
            rows = rows.where(rows.P_star >= 0.04 * rows.P_star[-1])
            force_bar, area_bar = bars(rows)
            pressure = rows.P_star * asp.Material(1.0, 0.3).reduced_modulus / rows.area_fraction / strength
            for i, P in enumerate(rows.P_star):
                values = f"{P / PLASTIC_SLOPE:.5f} | {rows.area_fraction[i]:.4f} | {pressure[i]:.3f}"
                bar = f"{100 * (force_bar[i] + area_bar[i]):.1f}"
                print(f"| {strength} | {seed} | {values} | {bar} | {found.contact.dofs} |", flush=True)


def stiffness_of_half_space(surface: SelfAffine, n: int, P_star: Floats) -> Floats:
    """Stiffness dP*/d(delta*) of the interface at some forces (k,), by differences of 2 % of the force."""
    out, start = [], None
    for P in P_star:
        low, high = (
            half_space_contact(surface, n, P_star=float(f * P), sides="periodic", tolerance=1e-6, start=start)
            for f in (0.99, 1.01)
        )
        start = high.pressure
        out.append(0.02 * P / (high.delta_star - low.delta_star))
    return np.array(out)


def stiffness() -> None:
    """Exponents of the stiffness over the force: one contact region without roll-off, and many with one."""
    head("H", "roll-off/L", "P* over", "from", "to", "exponent", "standard deviation", "standard error", "1/(1+H)")
    for exponent in EXPONENTS:
        for roll, loads in ((1.0, LIGHT), (0.125, GREATER)):
            if roll < 1.0 and exponent != H:
                continue
            found = []
            for seed in SEEDS:
                surface = SelfAffine(
                    L=1.0, H=exponent, rms_height=HEIGHT, lambda_roll=roll, lambda_short=1.0 / WAVES, seed=seed
                )
                P = loads * (HEIGHT if roll == 1.0 else surface.rms_slope())
                k = stiffness_of_half_space(surface, 4 * WAVES, P)
                found.append(np.polyfit(np.log(P), np.log(k), 1)[0])
            mean, spread = np.mean(found), np.std(found, ddof=1)
            over = "rms height/L" if roll == 1.0 else "rms slope"
            values = f"{loads[0]:.3f} | {loads[-1]:.3f} | {mean:.3f} | {spread:.3f} | {spread / len(found) ** 0.5:.3f}"
            print(f"| {exponent} | {roll} | {over} | {values} | {1 / (1 + exponent):.3f} |", flush=True)


def interface() -> None:
    """Stiffness of the interface of the solid beside that of the half-space at the same forces."""
    head("seed", "P*/rms height", "k* of the interface", "bar %", "half-space", "change with half the cells %", "dofs")
    for seed in (0, 1):
        surface = SelfAffine(L=1.0, H=H, rms_height=HEIGHT, lambda_roll=1.0, lambda_short=1.0 / 16, seed=seed)
        problem = asp.Problem.of(
            surface, asp.Material(1.0, 0.0), height=2.0, sides="periodic", steps=STEPS,
            delta_max=approach(surface, 0.06, height=2.0),
        )  # fmt: skip
        found = refine(problem, asp.AccuracyTarget(TOLERANCE, max_dofs=MOST_DOFS), hooks=Hooks(stiffness=True))
        rows = found.curve.loading()
        own, coarse = (stiffness_of_half_space(surface, n, rows.P_star) for n in (256, 128))
        for i, P in enumerate(rows.P_star):
            k, bar = rows.k_n_interface[i], rows.error_k_n_interface[i]
            half = f"{own[i]:.4f} | {100 * abs(coarse[i] / own[i] - 1):.1f}"
            print(
                f"| {seed} | {P / HEIGHT:.4f} | {k:.4f} | {100 * bar / k:.1f} | {half} | {found.contact.dofs} |",
                flush=True,
            )


PARTS = {part.__name__: part for part in (area, kappa, ensemble, influence, challenge, plastic, stiffness, interface)}

if __name__ == "__main__":
    warnings.simplefilter("ignore")
    if len(sys.argv) != 2 or sys.argv[1] not in PARTS:
        sys.exit(__doc__)
    PARTS[sys.argv[1]]()
