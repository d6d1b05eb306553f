"""Print what the element does where a solid flows, or hardly changes its volume; docs/theory.md, docs/accuracy.md.

    ./run python3 benchmarks/element.py      # two minutes

The force on a spot of few elements, and the loss of unloading and loading again, with and without the relaxation of
solver/relaxation.hpp; area and greatest pressure of a wave in the force that brings 46 % of full contact, over nu; what
the relaxation takes from a wave of the pressure on a face in full contact that flows, at four loads.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from mpi4py import MPI

import asperity as asp
from asperity.fem import kernels
from asperity.mesh.block import BlockMesh
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField
from asperity.quasistatic.make import make_contact_solver

NONE = (np.inf, np.inf)
BALL = asp.Surface.from_spec("sphere", L=1.0, radius=1.0, shape="paraboloid")
DEPTH = 0.003  # of the ball
WAVE, AMPLITUDE = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=1e-3, dims=1), 1e-3


@contextmanager
def relaxation(of: tuple[float, float]) -> Iterator[None]:
    """The stresses S and T over the yield strength in a with-block."""
    usual, kernels.RELAXATION = kernels.RELAXATION, of
    try:
        yield
    finally:
        kernels.RELAXATION = usual


def even(h: float, growth: float) -> BlockMesh | None:
    """Block under the ball with elements of one size all over its contact."""
    x = np.linspace(-0.5, 0.5, 257)
    away = np.maximum(np.hypot(x, x[:, None]) - np.sqrt(2.0 * DEPTH), 0.0)
    return build_block(BALL, 1.0, SizeField(np.array([h]), away[:, :, None], (0.0, 0.0, 1.0), growth, 0.25).at)


def spot() -> None:
    """Force on a spot of few elements over that of the usual element on a mesh of half the size."""
    soft = asp.Material(1.0, 0.3, 0.002)

    def force(h: float, growth: float) -> float:
        return float(asp.solve_contact(BALL, soft, block=even(h, growth), delta_max=DEPTH, steps=3).curve.P_star[-1])

    with relaxation(NONE):
        fine = force(0.028, 0.125)
    for of in (NONE, kernels.RELAXATION):
        with relaxation(of):
            print(f"| spot of few elements, S, T = {of} | {100 * (force(0.06, 0.25) / fine - 1):.1f} % |", flush=True)


def cycle() -> None:
    """Dissipation of unloading by a quarter of the approach and loading again over that of the first loading."""
    rough = asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5, seed=0)
    problem = asp.Problem.of(rough, asp.Material(1.0, 0.3, 0.005, 0.2), delta_max=0.02)
    block = build_block(rough, 1.0, SizeField.of(rough, 0.03, 0.2, growth=0.5, h_max=0.5).at)
    down = [0.019, 0.018, 0.017, 0.016, 0.015]
    for of in (NONE, kernels.RELAXATION):
        with relaxation(of):
            solver, lost = make_contact_solver(MPI.COMM_SELF, problem, block), []
            for path in ([0.005, 0.01, 0.015, 0.02], *[[*down, *down[-2::-1], 0.02]] * 3):
                if not all(solver.step(delta).converged for delta in path):
                    raise RuntimeError("no convergence")
                lost.append(solver.checks.dissipated)
        shares = ", ".join(f"{100 * loss / lost[0]:.3f}" for loss in np.diff(lost))
        print(f"| cycles, S, T = {of} | {shares} % |", flush=True)


def waves() -> None:
    """Area and greatest pressure by Westergaard, J. Appl. Mech. 6 (1939) 49."""
    for nu in (0.3, 0.45, 0.49, 0.495):
        solid = asp.Material(1.0, nu)
        full = np.pi * solid.reduced_modulus * AMPLITUDE
        size = asp.MeshSize(h_contact=0.1)
        curve = asp.solve_contact(WAVE, solid, force_max=0.46 * full, steps=5, size=size).curve
        share = curve.force[-1] / full
        area = 2.0 / np.pi * np.arcsin(np.sqrt(share))
        of_area, of_peak = curve.area_fraction[-1] / area, curve.max_pressure[-1] / (2.0 * full * np.sqrt(share))
        print(f"| wave, nu = {nu} | area {100 * (of_area - 1):+.1f} %, peak {100 * (of_peak - 1):+.1f} % |", flush=True)


def pressures() -> None:
    """Change of the pressure of a wave, and of its approach, by the relaxation, on few elements in a wave."""
    wave = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=5e-4, dims=1)
    soft = asp.Material(1.0, 0.3, 0.002, 0.02)
    for n in (2, 4, 8):
        size, changes = asp.MeshSize(1.0 / n, growth=10.0, h_max=1.0 / n), []
        for load in (0.005, 0.006, 0.008, 0.01):
            found = []
            for of in (NONE, kernels.RELAXATION):
                with relaxation(of):
                    force = load * soft.reduced_modulus
                    last = asp.solve_contact(wave, soft, force_max=force, steps=6, size=size).curve
                found.append((last.max_pressure[-1] - last.mean_pressure[-1], last.delta[-1]))
            changes.append(np.divide(found[1], found[0]) - 1.0)
        (low, high), approach = (
            (100.0 * f(np.array(changes)[:, 0]) for f in (np.min, np.max)),
            np.max(np.abs(changes), 0)[1],
        )
        print(
            f"| pressure, {n} elements in a wave | {low:+.1f} to {high:+.1f} %, approach {100 * approach:.3f} % |",
            flush=True,
        )


if __name__ == "__main__":
    print("| scene | deviation |\n| --- | --- |")
    for table in (spot, cycle, waves, pressures):
        table()
