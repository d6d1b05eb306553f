# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""An elastic-plastic, periodic rough surface: asperity and Tamaas at the same mean pressures.

    benchmarks/peers/install                                 once: fetches Tamaas
    ./run python3 benchmarks/peers/periodic_plastic.py [-o FOLDER] [--limit CPU_SECONDS]

A self-affine surface (H = 0.8, roll-off L/2, shortest waves L/16, rms slope 0.05) is pressed by a rigid frictionless
flat; sigma_y = E/100, hardening 0.025 E of the yield strength with the plastic strain, small strains. asperity has a
block of height L with periodic sides, Tamaas a half-space whose plastic strains lie in layers near the surface. Both
are compared where their models agree: mean gap and area at the same mean pressure. The base and the mean compression
have no part in them. One thread, each run in a process of its own; seconds are CPU seconds of it, start-up included.

The error of the gap is given as that of the force at the same gap, by the slope of the reference, the finest run of
asperity. The area of Tamaas is the share of its points under pressure: the correction for the perimeter of the spots
that is known of elastic contacts (Yastrebov et al. 2017) is too large here. Prints a Markdown table; FOLDER keeps the
runs, and the command continues where it was stopped.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import programs
from scipy.interpolate import PchipInterpolator

import asperity as asp
from asperity.adaptive.solve_to_tolerance import refine
from asperity.arrays import Floats

WAVES, SEED, SLOPE = 16, 1, 0.05
E, NU, YIELD, HARDENING = 1.0, 0.3, 0.01, 0.025
STEEL = asp.Material(E, NU, YIELD, E * HARDENING / (E + HARDENING))
PRESSURES = np.linspace(0.25e-3, 1e-3, 4)  # mean ones [E]
TOLERANCES, REFERENCE = (0.1, 0.05, 0.02), 0.01
GRIDS, DEPTH = (32, 64, 128), 0.15  # points per side, a quarter as many layers to this depth [L]
STEPS, MOST_DOFS = 16, 1_000_000


def surface() -> asp.Surface:
    """The periodic surface of side 1."""
    return asp.Surface.from_spec(
        "self-affine", L=1.0, H=0.8, rms_slope=SLOPE, lambda_roll=0.5, lambda_short=1.0 / WAVES, seed=SEED,
        periodic=True,
    )  # fmt: skip


def solve(tolerance: str, target: str) -> None:
    """Run asperity and keep gap, area, their bars and that of the force, each (steps,), at PRESSURES."""
    problem = asp.Problem.of(surface(), STEEL, sides="periodic", steps=STEPS, pressure_max=1.1 * PRESSURES[-1])
    found = refine(problem, asp.AccuracyTarget(float(tolerance), max_dofs=MOST_DOFS))
    rows = found.curve.loading()
    x, wanted = np.log(rows.P_star * STEEL.reduced_modulus), np.log(PRESSURES)

    def at(column: Floats) -> Floats:
        return PchipInterpolator(x, column)(wanted)

    np.savez(
        target, gap=at(rows.mean_gap), area=np.exp(at(np.log(rows.area_fraction))),
        force_bar=at(rows.error_P_star / rows.P_star), area_bar=at(rows.error_area_fraction / rows.area_fraction),
        dofs=found.contact.dofs, slope=1.0 / PchipInterpolator(x, rows.mean_gap).derivative()(wanted),
    )  # fmt: skip


@dataclass(frozen=True)
class Found:
    """Result of a run: what it used, and its arrays; mean gap [L] and area fraction as far as it came (k,)."""

    usage: programs.Usage
    gap: Floats
    area: Floats
    arrays: dict[str, Floats]


def own(tolerance: float, folder: Path, limit: float) -> Found:
    """Run of asperity to a tolerance."""
    out = folder / f"asperity-{tolerance:g}"
    command = [sys.executable, __file__, "solve", str(tolerance), "out.npz"]
    usage, arrays = _run(command, {}, out, limit)
    return Found(usage, arrays.get("gap", np.zeros(0)), arrays.get("area", np.zeros(0)), arrays)


def theirs(n: int, folder: Path, limit: float) -> Found:
    """Run of Tamaas on n x n points."""
    t = np.arange(n) / n
    place = folder / f"tamaas-{n}"
    place.mkdir(parents=True, exist_ok=True)
    np.savez(
        place / "map.npz", heights=surface().height(*np.meshgrid(t, t, indexing="ij")), layers=n // 4, depth=DEPTH,
        E=E, nu=NU, sigma_y=YIELD, hardening=HARDENING, pressures=PRESSURES,
    )  # fmt: skip
    command, environment = programs.inside("bookworm", "usr/bin/python3.11")
    script = str(Path(__file__).with_name("tamaas_plastic.py"))
    usage, arrays = _run([*command, script, "map.npz", "out.npz"], environment, place, limit)
    area = np.mean(arrays.get("pressure", np.zeros((0, n, n))) > 0.0, axis=(1, 2))
    return Found(usage, arrays.get("gap", np.zeros(0)), area, arrays)


def _run(
    command: list[str], environment: dict[str, str], place: Path, limit: float
) -> tuple[programs.Usage, dict[str, Floats]]:
    """Run a command that writes out.npz in a folder; what an earlier call has kept there is read again."""
    kept, out = place / "usage.json", place / "out.npz"
    if not kept.exists():
        place.mkdir(parents=True, exist_ok=True)
        out.unlink(missing_ok=True)
        kept.write_text(json.dumps(asdict(programs.timed(command, environment, place, limit))), encoding="utf-8")
    usage = programs.Usage(**json.loads(kept.read_text(encoding="utf-8")))
    if not out.exists():
        return usage, {}
    with np.load(out) as arrays:
        return usage, dict(arrays)


def row(name: str, mesh: str, found: Found, exact: Found) -> None:
    """Print cost and errors of a run against the reference."""
    k = len(found.gap)
    force = 100.0 * (found.gap - exact.gap[:k]) * exact.arrays["slope"][:k]
    area = 100.0 * (found.area / exact.area[:k] - 1.0)
    seconds = f"{found.usage.cpu:.3g}"
    if k < len(PRESSURES):
        seconds = f"> {seconds}, {found.usage.ended} at {k} of {len(PRESSURES)} pressures"
    errors = [
        f"{np.sqrt(np.mean(off**2)):.2f} | {off[0]:+.2f} to {off[-1]:+.2f}" if k else " | " for off in (force, area)
    ]
    print(f"| {name} | {mesh} | {seconds} | {found.usage.memory / 2**20:.0f} | {' | '.join(errors)} |", flush=True)


def main() -> None:
    """Make the runs that are missing, print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/periodic_plastic"))
    parser.add_argument("--limit", type=float, default=1200.0, help="CPU seconds after which a run is ended")
    arguments = parser.parse_args()
    folder, limit = arguments.output.absolute(), arguments.limit
    exact = own(REFERENCE, folder, 10.0 * limit)
    bars = ", ".join(f"{100 * exact.arrays[name].max():.1f} %" for name in ("force_bar", "area_bar"))
    print(f"Reference: {int(exact.arrays['dofs'])} dofs, greatest bars of force and area {bars}\n")
    print("| program | mesh | CPU s | MiB | rms error of the force % | first to last | of the area % | first to last |")
    print("|---|---|---|---|---|---|---|---|")
    for tolerance in TOLERANCES:
        found = own(tolerance, folder, limit)
        row("asperity", f"tolerance {tolerance:g}, {int(found.arrays['dofs'])} dofs", found, exact)
    row("asperity", f"tolerance {REFERENCE:g}, {int(exact.arrays['dofs'])} dofs: the reference", exact, exact)
    if "Tamaas" in programs.missing():
        raise SystemExit(programs.missing()["Tamaas"])
    for n in GRIDS:
        row("Tamaas", f"{n} x {n} points, {n // 4} layers", theirs(n, folder, limit), exact)


if __name__ == "__main__":
    if sys.argv[1:2] == ["solve"]:
        solve(*sys.argv[2:])
    else:
        main()
