"""What the accuracy of the force costs on the demo surface: element size, load steps, tolerance.

    python3 benchmarks/accuracy.py mesh          order in the element size, elastic, 10 steps to 0.03 L
    python3 benchmarks/accuracy.py steps         order in the load step, elastic-plastic, one coarse mesh
    python3 benchmarks/accuracy.py tolerance     bars and errors of runs driven by a tolerance

Prints Markdown tables. Seconds are process seconds of this machine, all ranks' share on rank 0 only.
"""

from __future__ import annotations

import sys
import warnings
from time import process_time

import numpy as np

import asperity as asp
from asperity.accuracy import Goal, loading_force, solve_to_tolerance
from asperity.refinement import extrapolate

L, DELTA, STEPS = 1e-6, 0.03e-6, 10
AT = np.array([0.003 * k for k in range(1, 11)])
ELASTIC = asp.Material(200e9, 0.3)
PLASTIC = asp.Material(200e9, 0.3, 1e9, 10e9)


def surface(seed: int = 0) -> asp.Surface:
    """The surface of cases/demo.toml, or another seed of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=L, D=2.4, G=1.36e-11, seed=seed)


def row(*cells: object) -> None:
    """Print a row of a table."""
    print("| " + " | ".join(f"{c:.2f}" if isinstance(c, float) else str(c) for c in cells) + " |", flush=True)


def per_cent(value: np.ndarray, reference: np.ndarray) -> tuple[float, float]:
    """Root mean square and greatest relative difference over the path, in per cent."""
    e = 100.0 * (value / reference - 1.0)
    return float(np.sqrt(np.mean(e**2))), float(np.max(np.abs(e)))


def mesh() -> None:
    """Force against element size."""
    sizes = (0.08, 0.056, 0.04, 0.028, 0.02)
    forces, facts = [], []
    for h in sizes:
        start = process_time()
        result = asp.solve_contact(surface(), ELASTIC, delta_max=DELTA, steps=STEPS, size=asp.MeshSize(h * L))
        forces.append(loading_force(result.curve, AT))
        facts.append((result.dofs, result.counts.newton, result.counts.krylov, process_time() - start))
    limit, _ = extrapolate(forces[-2], forces[-1], sizes[-2] / sizes[-1], 1.8)
    row("h_contact/L", "dofs", "rms error %", "greatest %", "Newton", "Krylov", "CPU s")
    row(*["---"] * 7)
    for h, P, (dofs, newton, krylov, seconds) in zip(sizes, forces, facts, strict=True):
        row(f"{h:g}", dofs, *per_cent(P, limit), newton, krylov, seconds)
    errors = [per_cent(P, limit)[0] for P in forces[:-1]]
    order = np.polyfit(np.log(sizes[:-1]), np.log(errors), 1)[0]
    print(f"\norder of the rms error: {order:.2f}")
    print(f"default h = 0.04 L against h = 0.02 L: {per_cent(forces[2], forces[4])[1]:.2f} % at most")


def steps() -> None:
    """Force against the number of load steps."""
    size = asp.MeshSize(0.14 * L)
    found = {}
    for rule, counts in (("midpoint", (10, 20, 40)), ("backward-euler", (10, 20, 40))):
        for n in counts:
            result = asp.solve_contact(surface(), PLASTIC, delta_max=DELTA, steps=n, size=size, integrator=rule)
            found[rule, n] = loading_force(result.curve, AT), result.counts.newton
    limit, _ = extrapolate(found["midpoint", 20][0], found["midpoint", 40][0], 2.0, 2.0)
    row("rule", "steps", "rms error %", "greatest %", "Newton")
    row(*["---"] * 5)
    for (rule, n), (P, newton) in found.items():
        row(rule, n, *per_cent(P, limit), newton)
    other, _ = extrapolate(found["backward-euler", 20][0], found["backward-euler", 40][0], 2.0, 1.0)
    print(f"\nlimits of the two rules differ by {per_cent(other, limit)[1]:.2f} % at most")


def tolerance() -> None:
    """Bars of tolerance-driven runs against the errors they estimate."""
    row("material", "seed", "tolerance %", "met", "bar %", "true error %", "steps inside", "finest dofs", "CPU s")
    row(*["---"] * 9)
    for name, material, wanted in (("elastic", ELASTIC, (0.03, 0.01)), ("plastic", PLASTIC, (0.03,))):
        for seed in (1, 2, 3):
            reference = solve_to_tolerance(
                surface(seed), material, Goal(min(wanted) / 3.0), delta_max=DELTA, steps=STEPS
            )
            P = loading_force(reference.curve, AT)
            for goal in wanted:
                start = process_time()
                result = solve_to_tolerance(surface(seed), material, Goal(goal), delta_max=DELTA, steps=STEPS)
                seconds = process_time() - start
                branch = result.curve.loading()
                at = [int(np.argmin(np.abs(branch.delta_star - d))) for d in AT]
                error = np.abs(branch.P_star[at] / P - 1.0)
                bar = (branch.error_P_star / branch.P_star)[at]
                row(
                    name, seed, f"{100 * goal:g}", result.met, 100 * float(np.median(bar)),
                    100 * float(np.median(error)), f"{int(np.sum(error <= bar))}/{len(AT)}",
                    result.levels[-1].dofs, seconds,
                )  # fmt: skip


if __name__ == "__main__":
    jobs = {"mesh": mesh, "steps": steps, "tolerance": tolerance}
    for job in sys.argv[1:] or jobs:
        print(f"\n## {job}\n")
        jobs[job]()
