"""Numbers and pictures of docs/verification.md: Hertzian vibration, stiffness of a rough joint, impact of a cap.

    ./run python3 benchmarks/experiments.py FOLDER [--pictures docs/experiments]

FOLDER keeps the computed runs (about four minutes); those that are there are not computed again.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import quad
from scipy.optimize import brentq

import asperity as asp
from asperity.plot import style
from asperity.reference import Hertz, kogut_etsion, reduced_modulus

E, NU, YIELD, TANGENT = 200e9, 0.3, 1e9, 2e9
L, R = 4e-6, 2e-6  # the greatest spot is a thirtieth of the side
E_PRIME = reduced_modulus(E, NU)
ONSET = 1.6 * YIELD  # greatest Hertzian pressure at first yield
DEPTHS = (1e-9, 2.5e-9, 6e-9)

JOINT: dict[str, Any] = {
    "surface": {
        "kind": "self-affine", "L": 100e-6, "H": 0.8, "rms_slope": 0.06, "lambda_roll": 50e-6, "lambda_short": 20e-6,
        "seed": 1,
    },
    "material": {"E": E, "nu": NU, "yield_strength": 1.5e9, "tangent_modulus": 10e9},
    "mesh": {"h_contact": 8e-6},
    "loading": {"delta_max": 0.7e-6, "steps": 20, "unload": True},
    "output": {"stiffness": True},
}  # fmt: skip


def cap(depth: float, plastic: bool) -> dict[str, Any]:
    """Case of a spherical cap pressed to a depth and withdrawn."""
    law = {"yield_strength": YIELD, "tangent_modulus": TANGENT} if plastic else {}
    return {
        "surface": {"kind": "sphere", "L": L, "radius": R},
        "material": {"E": E, "nu": NU, **law},
        "mesh": {"h_contact": 0.016e-6},
        "loading": {"delta_max": depth, "steps": 14, "unload": plastic},
    }


def run(case: dict[str, Any], folder: Path) -> asp.Curve:
    """Curve of a case, computed unless its folder has it."""
    if not (folder / "summary.json").is_file():
        asp.run(asp.Case.from_dict(case), folder, force=True)
    return asp.Curve.read(folder / "curve.csv")


# -- Hertzian contact under harmonic force -----------------------------------------------------------------------


def onset_by_energy(n: float) -> float:
    """F^/(2 zeta) at which the resonance of light damping begins to lose contact, by quadrature of the free orbit.

    The work of the force at phase resonance, pi a_1 F^, is the loss 2 zeta INT u'^2 over the orbit that touches u = -1.
    """
    top = (n + 1.0) ** (1.0 / n) - 1.0

    def potential(u: float) -> float:
        return ((1.0 + u) ** (n + 1.0) / (n + 1.0) - (1.0 + u)) / n

    energy = potential(top)
    middle, half = 0.5 * (top - 1.0), 0.5 * (top + 1.0)

    def speed(u: float) -> float:
        return math.sqrt(max(2.0 * (energy - potential(u)), 0.0))

    def over(angle: float) -> tuple[float, float]:
        u = middle + half * math.sin(angle)
        v = speed(u)
        return u, half * math.cos(angle) / v if v > 1e-12 else math.nan

    edge = 0.5 * math.pi - 1e-9
    quarter = quad(lambda a: over(a)[1], -edge, edge, epsrel=1e-10, limit=200)[0]  # half of the period
    loss = 2.0 * quad(lambda a: half * math.cos(a) * speed(middle + half * math.sin(a)), -edge, edge, epsrel=1e-10)[0]
    rate = math.pi / quarter

    @cache
    def time(angle: float) -> float:
        return float(quad(lambda a: over(a)[1], angle, edge, epsrel=1e-9, limit=200)[0])  # since the greatest u

    first = quad(lambda a: over(a)[0] * math.cos(rate * time(a)) * over(a)[1], -edge, edge, epsrel=1e-7, limit=100)[0]
    a1 = 2.0 * first / quarter
    return loss / (math.pi * abs(a1))


def threshold(kind: str, zeta: float, window: tuple[float, float], bracket: tuple[float, float]) -> float:
    """Smallest F^ at which the response of a Hertzian contact has an event of a kind, by bisection."""
    oscillator = asp.ContactOscillator(asp.PowerLaw(1.5), zeta=zeta)
    low, high = bracket
    while high / low > 1.001:
        middle = math.sqrt(low * high)
        found = oscillator.response(middle, window, tol=1e-4, subharmonics=False)[kind]
        low, high = (low, middle) if found else (middle, high)
    return math.sqrt(low * high)


def vibration(pictures: Path | None) -> None:
    """Onsets of contact loss and of the second subharmonic over the damping ratio."""
    loss = onset_by_energy(1.5)
    rows = []
    for zeta in (0.0025, 0.005, 0.01, 0.02):
        lost = threshold("grazing", zeta, (0.9, 1.05), (1.0 * zeta, 3.0 * zeta))
        doubled = threshold("period doubling", zeta, (1.7, 2.3), (15.0 * zeta, 35.0 * zeta))
        rows.append((zeta, 1.5 * lost, 3.0 * zeta * loss, 1.5 * doubled, 36.0 * zeta))
    print(f"Hertzian contact: F^/(2 zeta) at the onset of contact loss {loss:.5f} by the energy of the free orbit\n")
    print("| zeta | F/W, contact loss | 2 n zeta x that | F/W, second subharmonic | 36 zeta |\n|---|---|---|---|---|")
    for row in rows:
        print("| " + " | ".join(f"{x:.4g}" for x in row) + " |")
    if pictures:
        style.save(draw_vibration(rows), pictures / "vibration.png")


@style.styled
def draw_vibration(rows: Sequence[tuple[float, ...]]) -> Figure:
    """Response at rising force, and both onsets over the damping ratio."""
    figure, (left, right) = style.figure(style.DOUBLE, 3.4, columns=2)
    oscillator = asp.ContactOscillator(asp.PowerLaw(1.5), zeta=0.005)
    for forcing, colour in zip((0.002, 0.005, 0.00886, 0.015, 0.03), (style.GREY, style.SKY, style.BLUE, style.ORANGE,
                               style.VERMILION), strict=True):  # fmt: skip
        for line in oscillator.response(forcing, (0.75, 1.1)).lines():
            stable = np.where(line.stable, line.u_max, np.nan)
            left.plot(line.Omega, line.u_max, color=colour, lw=0.7, ls=":")
            left.plot(line.Omega, stable, color=colour, lw=1.2)
        left.plot([], [], color=colour, label=f"$F/W$ = {1.5 * forcing:.3g}")
    left.axhline(2.5 ** (2 / 3) - 1.0, color=style.BLACK, lw=0.7, ls="--")
    left.annotate("contact lost above", (0.76, 2.5 ** (2 / 3) - 0.97), fontsize=7)
    left.set_xlabel("frequency over $\\omega_s$")
    left.set_ylabel("largest displacement over $z_s$")
    left.set_ylim(bottom=0)
    left.legend(fontsize=7)
    zeta, *columns = (np.array(c) for c in zip(*rows, strict=True))
    for found, curve, colour, text in (
        (columns[0], columns[1], style.BLUE, "contact loss"),
        (columns[2], columns[3], style.VERMILION, "second subharmonic"),
    ):
        right.plot(zeta, curve, color=colour, label=f"{text}, light damping")
        right.plot(zeta, found, "o", color=colour, mfc="white", label=f"{text}, computed")
    style.logarithmic(right)
    right.set_xlabel("damping ratio $\\zeta$")
    right.set_ylabel("force over preload $F/W$ at the onset")
    right.legend(fontsize=7)
    style.grid(left, right)
    style.titles([left, right], ["response at rising force", "onsets"])
    return figure


# -- stiffness of a rough joint over pressure --------------------------------------------------------------------


def joint(folder: Path, pictures: Path | None) -> None:
    """Stiffness of the interface over the nominal pressure, in loading and unloading."""
    curve = run(JOINT, folder / "joint")
    case = asp.Case.from_dict(JOINT)
    area = case.surface.L**2
    p = curve.force / area / 1e6
    block = case.block.height / (area * case.material.solid.block_modulus(case.block.sides))
    with np.errstate(all="ignore"):
        static = 1.0 / (1.0 / curve.k_n - block) / area / 1e15  # GPa/um
    elastic, shear = curve.k_n_interface / area / 1e15, curve.k_t_interface / area / 1e15
    up, down = curve.branch == "load", curve.branch == "unload"
    touching = up & (p > 0.02 * p.max())
    light, late = touching & (p < 0.2 * p.max()), touching & (p > 0.2 * p.max())
    for name, k in {"k_n": elastic, "k_t": shear}.items():
        parts = ", ".join(f"p^{power(p, k, rows):.2f}" for rows in (touching, light, late))
        print(f"\nrough joint: {name} of small vibration, in loading, below a fifth of the load, above: {parts}")
    print("\n| p in MPa | k_n, loading | k_n, small vibration | the same, unloading | k_t/k_n |\n|---|---|---|---|---|")
    order = np.flatnonzero(down)[np.argsort(p[down])]
    for i in np.flatnonzero(touching)[:: max(1, touching.sum() // 7)]:
        back = np.interp(p[i], p[order], elastic[order])
        print(f"| {p[i]:.3g} | {static[i]:.3g} | {elastic[i]:.3g} | {back:.3g} | {shear[i] / elastic[i]:.3f} |")
    if pictures:
        style.save(draw_joint(p, static, elastic, shear, touching, down), pictures / "joint.png")


def power(p: Any, k: Any, rows: Any) -> float:
    """Exponent of a stiffness over pressure at some rows."""
    return float(np.polyfit(np.log(p[rows]), np.log(k[rows]), 1)[0])


@style.styled
def draw_joint(p: Any, static: Any, elastic: Any, shear: Any, up: Any, down: Any) -> Figure:
    """Stiffness per area over pressure, and the ratio of tangential and normal stiffness."""
    figure, (left, right) = style.figure(style.DOUBLE, 3.2, columns=2)
    left.plot(p[up], static[up], "s-", color=style.VERMILION, mfc="white", label="tangent of the loading (static)")
    left.plot(p[up], elastic[up], "o-", color=style.BLUE, label="small vibration, loading")
    left.plot(p[down], elastic[down], "v--", color=style.SKY, mfc="white", label="small vibration, unloading")
    left.plot(p[up], elastic[up][-1] * p[up] / p[up][-1], ":", color=style.GREY, label="proportional to the pressure")
    style.logarithmic(left)
    left.set_xlabel("nominal pressure (MPa)")
    left.set_ylabel("interface stiffness (GPa/µm)")
    left.set_xlim(p[up].min() / 1.2, 1.2 * p[up].max())
    left.set_ylim(static[up].min() / 1.5, 1.5 * elastic[down].max())
    left.legend(fontsize=7)
    right.plot(p[up], shear[up] / elastic[up], "o-", color=style.BLUE, label="loading")
    right.axhline(2 * (1 - NU) / (2 - NU), color=style.GREY, lw=0.8, ls="--", label="one spot, $2(1-\\nu)/(2-\\nu)$")
    right.set_xlabel("nominal pressure (MPa)")
    right.set_ylabel("$k_t/k_n$")
    right.legend(fontsize=7)
    style.grid(left, right)
    style.titles([left, right], ["stiffness of the interface", "tangential over normal stiffness"])
    return figure


# -- impact of a cap -----------------------------------------------------------------------------------------------


def thornton(work: float) -> float:
    """Coefficient of restitution of a cap whose Hertzian pressure is cut off at that of first yield.

    The model of Thornton: after yield the force rises with the slope pi R p_y, and the unloading is Hertzian with the
    contact radius reached and a larger radius of curvature, R_p F = R F_elastic.

    Args:
        work: energy of the impact (force * length).
    """
    first = R * (math.pi * ONSET / (2.0 * E_PRIME)) ** 2
    hertz = Hertz(R=R, E_prime=E_PRIME)
    start = float(hertz.force(first))
    slope = math.pi * R * ONSET

    def loading(d: float) -> float:
        more = d - first
        return 0.4 * start * first + start * more + 0.5 * slope * more**2

    if work <= 0.4 * start * first:
        return 1.0
    d = float(brentq(lambda x: loading(x) / work - 1.0, first, 1e4 * first, xtol=1e-9 * first))
    force, radius = start + slope * (d - first), math.sqrt(R * d)
    return math.sqrt(0.3 * force**2 / (radius * E_PRIME) / work)


def impact(folder: Path, pictures: Path | None) -> None:
    """Restitution and duration of impacts of a cap: from pressed curves, against closed forms."""
    hertz = Hertz(R=R, E_prime=E_PRIME)
    elastic_case = cap(DEPTHS[-1], plastic=False)
    curve = run(elastic_case, folder / "cap_elastic")
    law = asp.TableLaw(curve.delta, curve.force)  # of the whole block: a half-space deforms far below the spot too
    mass = 1e-15  # any: the ratio of durations does not depend on it
    work = float(law.potential(law.z[-1]))
    ratio = duration(law, float(law.z[-1]), mass) / hertz_duration(hertz, work, mass)
    print(f"\nelastic cap: force {float(curve.force[-1] / hertz.force(law.z[-1])):.4f} of Hertz at the greatest depth, "
          f"duration of the impact {ratio:.4f} of Hertz at the same energy\n")  # fmt: skip
    print("| depth over that of first yield | energy over that of first yield | e | Thornton | duration over Hertz |")
    print("|---|---|---|---|---|")
    first = R * (math.pi * ONSET / (2.0 * E_PRIME)) ** 2
    unit = 0.4 * float(hertz.force(first)) * first
    rows, pressed = [], []
    for depth in DEPTHS:
        case = cap(depth, plastic=True)
        curve = run(case, folder / f"cap_{depth:g}")
        z = curve.delta
        pressed.append((z, curve))
        up = asp.TableLaw(z[curve.branch == "load"], curve.force[curve.branch == "load"])
        down = asp.unload_reload({"delta": z, "force": curve.force, "branch": curve.branch})
        top = float(up.z[-1])
        work, back = float(up.potential(top)), float(down.potential(float(down.z[-1])))
        e = math.sqrt(back / work)
        lasting = 0.5 * (duration(up, top, mass) + duration(down, float(down.z[-1]), mass))
        rows.append((top / first, work / unit, e, thornton(work), lasting / hertz_duration(hertz, work, mass)))
        print("| " + " | ".join(f"{x:.3g}" for x in rows[-1]) + " |")
    critical = (math.pi * (0.454 + 0.41 * NU) * 2.8 * YIELD / (2.0 * E_PRIME)) ** 2 * R  # depth of Kogut and Etsion
    if pictures:
        style.save(draw_impact(rows, unit, pressed[-1], critical), pictures / "impact.png")
    kogut(pressed[-1], critical)


def kogut(pressed: tuple[Any, asp.Curve], critical: float) -> None:
    """Print force and stiffness of the cap over those of Kogut and Etsion."""
    z, curve = pressed
    up = curve.branch == "load"
    law = asp.TableLaw(z[up], curve.force[up])
    print("\n| depth over the critical one | force over Kogut-Etsion | stiffness over Kogut-Etsion |\n|---|---|---|")
    for w in (2.0, 4.0, 8.0):
        if w * critical < law.z[-1]:
            d = critical * w * np.array([0.98, 1.0, 1.02])
            force, fit = law.force(d), kogut_etsion(d, R, E, NU, YIELD)[0]
            print(f"| {w:g} | {force[1] / fit[1]:.3f} | {(force[2] - force[0]) / (fit[2] - fit[0]):.3f} |")


def duration(law: Any, top: float, mass: float) -> float:
    """Duration of an impact on a reversible law that reaches the approach `top`, by quadrature."""
    energy = float(law.potential(top))

    def integrand(angle: float) -> float:
        z = top * math.sin(angle)
        left = energy - float(law.potential(z))
        return top * math.cos(angle) / math.sqrt(2.0 * left / mass) if left > 0 else 0.0

    return 2.0 * float(quad(integrand, 0.0, 0.5 * math.pi - 1e-6, limit=400, epsrel=1e-6)[0])


def hertz_duration(hertz: Hertz, work: float, mass: float) -> float:
    """Duration of an elastic impact of a sphere, 2 z_m/v INT dx/sqrt(1 - x^(5/2)) = 2.9432 z_m/v."""
    K = float(hertz.force(1.0))
    top = (2.5 * work / K) ** 0.4
    share = math.gamma(0.4) / math.gamma(0.9) * math.sqrt(math.pi) / 2.5
    return 2.0 * share * top / math.sqrt(2.0 * work / mass)


@style.styled
def draw_impact(
    rows: Sequence[tuple[float, ...]], unit: float, pressed: tuple[Any, asp.Curve], critical: float
) -> Figure:
    """Restitution over the speed, and the force of the deepest cap with that of Kogut and Etsion."""
    figure, (left, right) = style.figure(style.DOUBLE, 3.2, columns=2)
    speed = np.geomspace(1.0, 50.0, 200)
    left.plot(speed, [thornton(v**2 * unit) for v in speed], color=style.BLUE, label="Thornton's model")
    left.plot(np.sqrt([r[1] for r in rows]), [r[2] for r in rows], "o", color=style.VERMILION, label="pressed cap")
    tail = speed[speed > 10]
    left.plot(tail, thornton(tail[0] ** 2 * unit) * (tail / tail[0]) ** -0.25, ":", color=style.GREY,
              label="power $-1/4$ of the speed")  # fmt: skip
    style.logarithmic(left)
    left.xaxis.set_major_formatter("{x:g}")
    left.set_ylim(0.4, 1.1)
    left.set_xlabel("impact speed over that of first yield")
    left.set_ylabel("coefficient of restitution")
    left.legend(fontsize=7)
    z, curve = pressed
    reference = Hertz(R=R, E_prime=E_PRIME)
    depth = np.linspace(0.01, 1.0, 200) * z.max()
    right.plot(1e9 * z, 1e6 * curve.force, ".-", color=style.VERMILION, label="pressed cap")
    right.plot(1e9 * depth, 1e6 * np.asarray(reference.force(depth)), "--", color=style.GREY, label="Hertz")
    inside = depth[depth > critical]
    right.plot(1e9 * inside, 1e6 * kogut_etsion(inside, R, E, NU, YIELD)[0], color=style.BLUE, label="Kogut and Etsion")
    right.set_ylim(0.0, 1.6e6 * curve.force.max())
    right.set_xlabel("approach of the cap (nm)")
    right.set_ylabel("force (µN)")
    right.legend(fontsize=7)
    style.grid(left, right)
    style.titles([left, right], ["restitution", "force of the cap"])
    return figure


def main() -> None:
    """Print the tables and draw the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="keeps the runs")
    parser.add_argument("--pictures", type=Path, help="folder of the pictures")
    options = parser.parse_args()
    vibration(options.pictures)
    joint(options.folder, options.pictures)
    impact(options.folder, options.pictures)


if __name__ == "__main__":
    main()
