"""Law after yield: against 100 unloading steps on ten surfaces, and its stiffness against a finer mesh on three.

    python3 benchmarks/after_yield.py OUT [--size H]
    python3 benchmarks/after_yield.py OUT --tolerance 0.05

Exponent, backbone curvature, static approach, stiffness and the frequency at two amplitudes about half of the greatest
force with the default number of unloading steps, each as "value +- bar (reference)" with a star where the bars of both
do not overlap. With a tolerance of the force: k_n about four preloads with its bar, and that of k_n_elastic alone,
against k_n of a run to 0.3 of the tolerance, with a star where that is outside. Curves are kept in OUT. The last line
counts the stars.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

import numpy as np

import asperity as asp
from asperity.force_law.choice import choose
from asperity.force_law.columns import CurveColumns
from asperity.force_law.intervals import intervals
from asperity.force_law.laws import tabulate

SEEDS = (7, 3, 11, 0, 1, 2, 4, 5, 6, 8)
AMPLITUDES = (0.15, 0.4)  # release displacement over z_s
SHARES = (0.15, 0.3, 0.5, 0.8)  # of the greatest force, with a tolerance
NAMES = ("n", "kappa", "z_s in nm", "k_n in kN/m", *(f"f at u = {u:g}" for u in AMPLITUDES))


def curve_of(seed: int, unload_steps: int | None, mesh: dict[str, float], folder: Path) -> asp.Curve:
    """Return the curve of the surface of cases/single.toml with a seed, from OUT if it is there.

    `mesh` has the size of the elements or the tolerance of the force.
    """
    file = folder / f"{seed}_{unload_steps or 'default'}_{'_'.join(f'{value:g}' for value in mesh.values())}.csv"
    if not file.is_file():
        loading = {"delta_max": 8e-9, "steps": 10, "unload": True}
        case = asp.Case.from_dict({
            "surface": {
                "kind": "weierstrass-mandelbrot", "L": 1e-6, "D": 2.4, "G": 1.36e-11, "M": 10, "gamma": 1.5, "f_max": 5,
                "seed": seed,
            },
            "material": {"E": 200e9, "nu": 0.3, "yield_strength": 1e9, "tangent_modulus": 10e9, "kinematics": "small"},
            "accuracy" if "tolerance" in mesh else "mesh": mesh,
            "loading": loading | ({} if unload_steps is None else {"unload_steps": unload_steps}),
            "output": {"stiffness": True},
        })  # fmt: skip
        asp.run(case).curve.write(file)
    return asp.Curve.read(file)


def numbers(curve: asp.Curve) -> tuple[np.ndarray, np.ndarray]:
    """Return the values of `NAMES` about half of the greatest force, and their bars."""
    load = 0.5 * float(curve.force.max())
    law = asp.unload_reload(curve, load)

    def values(one: asp.TableLaw) -> np.ndarray:
        oscillator = asp.ContactOscillator(one, load=load, gravity=load)  # of unit mass
        r = oscillator.restoring
        f = oscillator.free(AMPLITUDES).omega_ratio * oscillator.omega_s / (2 * np.pi)
        return np.array([r.n_loc, r.kappa, 1e9 * r.z_s, 1e-3 * r.scale / r.z_s, *f])

    found = values(law)
    bar = np.sum([np.abs(values(one) - found) for one in law.thinned], axis=0)
    known = asp.uncertainty(asp.ContactOscillator(law, load=load))
    bar[:2] = known.n_loc.half, known.kappa.half
    return found, bar


def stiffness_bars(tolerance: float, folder: Path) -> None:
    """Print the table of a tolerance."""
    outside = 0
    print("seed | preload/greatest force | k_n in kN/m | of k_n_elastic alone | finer mesh")
    for seed in (7, 3, 11):
        coarse, fine = (
            CurveColumns.of(curve_of(seed, 10, {"tolerance": t}, folder)) for t in (tolerance, 0.3 * tolerance)
        )
        for share in SHARES:
            load = share * float(coarse.force.max())
            row, true = (tabulate(c, choose(c, "auto", load)).chosen for c in (coarse, fine))
            assert row.law is not None and row.known is not None
            found, alone = row.known.k_n, 1e-3 * intervals(row.law, load, row.sides()).k_n.half
            star = "" if found.low <= true.stiffness <= found.high else "*"
            outside += len(star)
            k, bar, reference = (1e-3 * x for x in (found.value, found.half, true.stiffness))
            print(f"{seed} | {share:g} | {k:.4g} +- {bar:.2g}{star} | +- {alone:.2g} | {reference:.4g}", flush=True)
    print(f"{outside} of {3 * len(SHARES)} outside")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--size", type=float, default=0.07e-6, help="of the elements at the surface, in m")
    parser.add_argument("--tolerance", type=float, help="of the force: k_n against a run to 0.3 of it")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("ignore")
    if options.tolerance:
        stiffness_bars(options.tolerance, options.out)
        return
    print("seed", *NAMES, sep=" | ")
    outside = 0
    for seed in SEEDS:
        few, bar = numbers(curve_of(seed, None, {"h_contact": options.size}, options.out))
        many, own = numbers(curve_of(seed, 100, {"h_contact": options.size}, options.out))
        beyond = np.abs(few - many) > bar + own
        outside += int(beyond.sum())
        cells = [
            f"{a:.4g} +- {b:.2g} ({c:.4g}){'*' if star else ''}"
            for a, b, c, star in zip(few, bar, many, beyond, strict=True)
        ]
        print(seed, *cells, sep=" | ", flush=True)
    print(f"{outside} of {len(SEEDS) * len(NAMES)} outside")


if __name__ == "__main__":
    main()
