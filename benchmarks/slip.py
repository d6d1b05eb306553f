"""Micro-slip by a half-space with both components of traction, by the normal curve and by the solid, docs/accuracy.md.

    python3 benchmarks/slip.py law           Jaeger's law against the half-space, nu = 0, 0.3 and 0.45, ten surfaces,
                                             then the same with fewer rows of the curve
    python3 benchmarks/slip.py solid --h 25  solid and its curve against the half-space, elements of 0.025 L
    python3 benchmarks/slip.py solid --slope 0.005 0.1   the same on these rms slopes; a half-space has none
    python3 benchmarks/slip.py yielded       curve against solid after yield

Each prints a table.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from time import process_time

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import irfft2, rfft2
from scipy.interpolate import PchipInterpolator
from scipy.sparse.linalg import LinearOperator, cg
from slip_paths import Sliding, at_preload, solve_slip

import asperity as asp
from asperity.arrays import Floats
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.reference import HalfSpaceContact, half_space_contact
from asperity.slip import JointSlip, SlipSettings, slip_of_curve

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


SURFACES = maps(SLOPE) | {"sphere": asp.Surface.from_spec("sphere", L=1.0, radius=2.0, shape="paraboloid")}
OTHERS = {
    f"H {H:g}, seed {seed}, aspect {aspect:g}": asp.Surface.from_spec(
        "self-affine", L=1.0, H=H, rms_slope=0.05, lambda_roll=0.5, lambda_short=0.1, seed=seed, aspect=aspect
    )
    for H, seed, aspect in ((0.5, 11, 1), (0.8, 12, 1), (1, 13, 1), (0.8, 14, 6), (0.8, 14, 1 / 6), (0.7, 15, 16))
}
ROWS = (3, 5, 10, 20)  # of a curve
CURVE = ("branch", "delta", "force", "P_star", "area_fraction", "max_plastic_strain", "k_n_elastic", "k_t", "k_t_x")


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

    def stiffness(self) -> tuple[float, float]:
        """Normal and tangential stiffness along x of the contact without slip, over E' L, by conjugate gradients."""
        touched = self.pressure > 0.0

        def solved(components: int, displacement: Callable[[Floats], Floats]) -> float:
            def moved(q: Floats) -> Floats:
                traction = np.zeros((components, *touched.shape))
                traction[:, touched] = q.reshape(components, -1)
                return displacement(traction)[:, touched].ravel()

            size = components * np.count_nonzero(touched)
            ones = np.repeat([1.0, 0.0][:components], np.count_nonzero(touched))
            q, left = cg(LinearOperator((size, size), moved, dtype=float), ones, rtol=1e-8, maxiter=10000)
            assert left == 0
            return float(q @ ones) / touched.size

        n = touched.shape[0]
        k = np.hypot(np.fft.rfftfreq(n, 1 / n)[None, :], np.fft.fftfreq(n, 1 / n)[:, None])
        k[0, 0] = np.inf
        return solved(1, lambda p: irfft2(rfft2(p) / (np.pi * k), s=(n, n))), solved(2, self.displacement)

    def loop(self, move: float) -> tuple[float, float]:
        """Force over mu P at a displacement and energy of the loop between it and its opposite."""
        rest = np.zeros((2, *self.pressure.shape))
        q, slipped = self.step(move, rest, rest)
        _, back = self.step(-move, slipped, -q)
        loss = 2.0 * float(np.mean(self.bound * np.linalg.norm(back, axis=0)))
        return float(q[0].mean() / self.bound.mean()), loss


class Pressed:
    """A rough half-space pressed to a load: its curve with stiffnesses, and loops at the same forces; E' = L = 1.

    The rows are at about equal steps of the approach of a block of the height 1; the last one is at the load.
    """

    def __init__(self, surface: asp.Surface, n: int, nu: float, load: float = LOAD, rows: int = ROWS[-1]) -> None:
        def pressed(forces: Iterable[float], start: Floats | None = None) -> Iterator[HalfSpaceContact]:
            for force in forces:
                yield half_space_contact(surface, n, P_star=force, sides="periodic", start=start, tolerance=1e-12)

        coarse = list(pressed(load * np.geomspace(2e-3, 1.0, 12)))
        at = PchipInterpolator([c.delta_star + c.P_star for c in coarse], [c.P_star for c in coarse])
        end = coarse[-1].delta_star + load
        forces = [float(at(end * k / rows)) for k in range(1, rows)]
        contacts = [*pressed(forces, coarse[-1].pressure), coarse[-1]]
        self.space, self.nu, self.area = HalfSpace(coarse[-1].pressure, nu), nu, coarse[-1].area_fraction
        stiffness = np.array([HalfSpace(c.pressure, nu).stiffness() for c in contacts])
        self.columns = {
            "delta": np.array([c.delta_star for c in contacts]), "force": np.append(forces, load),
            "area_fraction": np.array([c.area_fraction for c in contacts]), "max_plastic_strain": np.zeros(rows),
            "k_n_elastic": stiffness[:, 0], "k_t": stiffness[:, 1], "k_t_x": stiffness[:, 1],
        }  # fmt: skip

    def slip(self, rows: int) -> JointSlip:
        """Slip by the curve of some of the rows."""
        count = self.columns["delta"].size
        some = np.unique(np.linspace(0, count, rows + 1).round().astype(int))[1:] - 1
        curve = {name: column[some] for name, column in self.columns.items()}
        settings = SlipSettings(MU, AMPLITUDES, float(curve["force"][-1]), steps=1)
        material = asp.Material(1.0 - self.nu**2, self.nu)
        return slip_of_curve(curve, settings, material, patch=1.0, height=1e-9, sides="periodic")

    @cached_property
    def loops(self) -> list[tuple[float, float]]:
        """Displacement and energy at each amplitude, by Newton steps from those of the curve."""
        law, found = self.slip(ROWS[-1]).law, []
        for t in AMPLITUDES:
            move = float(law.displacement(t))
            for _ in range(2):
                force, energy = self.space.loop(move)
                move += (t - force) * law.limit / float(law.k_tangent(t))
            found.append((move, energy * float(law.energy(t) / law.energy(min(force, 1.0)))))
        return found


def errors_of(slip: JointSlip, truths: Iterable[tuple[float, float]]) -> Floats:
    """Relative error of displacement and energy of a curve at each amplitude (amplitudes, 2)."""
    return np.array([
        (row["u"] / u - 1.0, row["energy"] / W - 1.0)
        for row, (u, W) in zip(slip.loops(), truths, strict=True)
    ])  # fmt: skip


def law(n: int, ratios: tuple[float, ...]) -> None:
    """Errors of Jaeger's law with twenty rows on each surface, then of fewer rows over all of them."""
    print("| surface | nu | area | u at 0.1, 0.3, 0.6, 0.9 mu P, % | energy, % |\n|---|---|---|---|---|", flush=True)
    found: dict[int, list[Floats]] = {rows: [] for rows in ROWS}
    for (name, surface), nu in product((SURFACES | OTHERS).items(), ratios):
        pressed = Pressed(surface, n, nu)
        for rows, of_rows in found.items():
            of_rows.append(errors_of(pressed.slip(rows), pressed.loops))
        print(f"| {name} | {nu:g} | {pressed.area:.3f} | {columns(found[ROWS[-1]][-1])} |", flush=True)
    print("\n| rows | greatest error of u at 0.1, 0.3, 0.6, 0.9 mu P, % | energy, % |\n|---|---|---|", flush=True)
    for rows, of_rows in found.items():
        print(f"| {rows} | {columns(np.abs(np.array(of_rows)).max(axis=0))} |", flush=True)


def problem_of(name: str, part: float, nu: float, h: float) -> tuple[asp.Problem, asp.Material]:
    """Load path of a surface on elements h, slopes and load `part` times those of the half-space."""
    material = asp.Material(1.0, nu)
    problem = asp.Problem.of(
        maps(part * SLOPE)[name], material, sides="periodic", pressure_max=LOAD * part / (1.0 - nu**2), steps=8,
        size=asp.MeshSize(h_contact=h), formulation=asp.Formulation(method="active-set"),
    )  # fmt: skip
    return problem, material


def interface(loop: tuple[float, float, float], nu: float) -> tuple[float, float]:
    """Displacement without the block of the height 1, and energy, of displacement, force and energy of a loop.

    They are in units of E as those of E'.
    """
    u, force, energy = loop
    return u - force * 2.0 * (1.0 + nu), energy * (1.0 - nu**2)


def solid(n: int, h: float, slopes: list[float]) -> None:
    """Differences of the solid and of the curve of its load path from the half-space at the same forces.

    CPU seconds are those of a loop with one step to its amplitude, and of the load path in at least eight steps. p is
    the mean pressure in contact.
    """
    print("| surface | slope | p/E' | nu | h/L | method | u at 0.1, 0.3, 0.6, 0.9 mu P, % | energy, % | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name, nu in product(("H 0.8, seed 1", "H 0.8, seed 3"), (0.0, 0.3)):
        space = Pressed(maps(SLOPE)[name], n, nu)
        for slope in slopes:  # the half-space has all forces and displacements in proportion
            part, begun = slope / SLOPE, process_time()
            problem, material = problem_of(name, part, nu, h)
            result = asp.solve_contact(problem, stiffness=True)
            pressed = process_time()
            settings = SlipSettings(MU, AMPLITUDES, float(result.curve.force[-1]), steps=1)
            paths = solve_slip(problem, result, settings)
            times = pressed - begun, (process_time() - pressed) / len(paths)
            slip = slip_of_curve(result.curve, settings, material, patch=1.0, height=1.0, sides="periodic")
            of_solid = [(path.displacement, path.force, path.energy) for path in paths]
            of_curve = [(row["u"], row["T"], row["energy"]) for row in slip.loops()]
            for method, found, seconds in (("solid", of_solid, times[1]), ("its curve", of_curve, times[0])):
                errors = []
                for loop, (move, energy) in zip(found, space.loops, strict=True):
                    u, loss = interface(loop, nu)
                    errors.append((u / (part * move) - 1.0, loss / (part**2 * energy) - 1.0))
                scene = f"{name} | {slope:g} | {LOAD * part / space.area:.2g} | {nu:g} | {h:g}"
                print(f"| {scene} | {method} | {columns(errors)} | {seconds:.0f} |", flush=True)


YIELDED = {  # surface, yield strength over E, nu, share of kinematic hardening, rms slope
    "tuned on": [
        ("H 0.8, seed 1", 0.01, 0.3, 0.0, SLOPE), ("H 0.8, seed 1", 0.005, 0.3, 0.0, SLOPE),
        ("H 0.7, seed 2", 0.005, 0.3, 0.0, SLOPE), ("H 0.7, seed 2", 0.005, 0.0, 0.0, SLOPE),
    ],
    "others": [
        ("H 0.8, seed 3", 0.005, 0.3, 0.0, SLOPE), ("H 0.8, seed 3", 0.01, 0.45, 1.0, 0.1),
        ("H 0.8, seed 1", 0.005, 0.0, 1.0, 0.1), ("H 0.7, seed 2", 0.002, 0.3, 1.0, SLOPE),
    ],
}  # fmt: skip


def yielded(h: float) -> None:
    """Curve over the solid with its plastic strain held after an unloading, at the greatest load and at half of it.

    p is the mean pressure in contact at the preload. The last columns are the energy of the first, second and third
    loop at 0.6 mu P of a solid that flows on, over that of the solid with its plastic strain held.
    """
    print("| cases | surface | slope | Y/E | hardening | nu | preload | p/E' | u of the curve, % | ", end="")
    print("energy, % | loops that flow |", flush=True)
    print("|" + "---|" * 11, flush=True)
    for of, scenes in YIELDED.items():
        for name, strength, nu, kinematic, slope in scenes:
            surface, material = maps(slope)[name], asp.Material(1.0, nu, strength, 0.05, hardening=kinematic)
            problem = asp.Problem.of(
                surface, material, sides="periodic", delta_max=0.01 * slope / SLOPE, steps=8, unload_steps=10,
                size=asp.MeshSize(h_contact=h),
            )  # fmt: skip
            result = asp.solve_contact(problem, stiffness=True)
            curve = {name: getattr(result.curve, name) for name in CURVE}
            for part in (1.0, 0.5):
                preload = part * float(curve["force"].max())
                settings = SlipSettings(MU, AMPLITUDES, preload, steps=1)
                paths = solve_slip(problem, result, settings)
                slip = slip_of_curve(curve, settings, material, patch=1.0, height=1.0, sides="periodic")
                errors = errors_of(slip, [(path.displacement, path.energy) for path in paths])
                branch = np.flatnonzero(curve["branch"] == "unload")[::-1]
                area = float(np.interp(preload, curve["force"][branch], curve["area_fraction"][branch]))
                p = preload * (1 - nu**2) / area
                flow = ", ".join(f"{x / paths[2].energy:.2f}" for x in flowing(result.solver, settings, part))
                kind = "kinematic" if kinematic else "isotropic"
                print(f"| {of} | {name} | {slope:g} | {strength:g} | {kind} | {nu:g} | {part:g} | {p:.2g} | ", end="")
                print(f"{columns(errors)} | {flow} |", flush=True)


def flowing(solver: ContactSolver, settings: SlipSettings, part: float) -> list[float]:
    """Energies of three loops at 0.6 mu P of a solid that flows on, of one below the greatest load."""
    assert settings.preload is not None
    with at_preload(solver, settings.preload):
        sliding = Sliding(solver, settings.friction)
        return [sliding.loop(0.6).energy for _ in range(3 if part == 1.0 else 1)]


def columns(errors: ArrayLike) -> str:
    """Columns of an array, in per cent."""
    return " | ".join(", ".join(f"{100 * x:+.1f}" for x in column) for column in np.transpose(errors))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("law", "solid", "yielded"))
    parser.add_argument("--h", type=float, default=25.0, help="size of the elements [L/1000]")
    parser.add_argument("--slope", type=float, nargs="+", default=[SLOPE], help="rms slopes of the maps of solid")
    parser.add_argument("-n", type=int, default=192, help="cells per side of the half-space")
    options = parser.parse_args()
    if options.what == "law":
        law(options.n, (0.0, 0.3, 0.45))
    elif options.what == "yielded":
        yielded(1e-3 * options.h)
    else:
        solid(options.n, 1e-3 * options.h, options.slope)
