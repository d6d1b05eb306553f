# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Run the paper's studies and write docs/paper.md, its figures and its tables.

    ./run mpirun -n 2 python3 benchmarks/paper.py out/paper

What the folder holds already is not repeated.
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpi4py import MPI
from statements import Statement, all_statements, passing
from tables import csv_text, versions

from asperity.case.schema import WeierstrassMandelbrotSection
from asperity.dynamics import ContactOscillator, PowerLaw
from asperity.plot import style
from asperity.plot.vibration import amplitude_frequency
from asperity.reference.tables import ROUGH_ELASTIC_FITS
from asperity.study import Study, StudyLevel, StudyResults, run_study
from asperity.study.figures import colours, draw_column, draw_curves, label_of
from asperity.study.trend import CONDITIONS

ROOT = Path(__file__).parent.parent
COMMAND = "./run mpirun -n 2 python3 benchmarks/paper.py out/paper"
ZETA, FORCING, OMEGA = 0.01, (0.01, 0.03), (0.6, 1.2)
FAMILY_FORCING = 0.015
SCALE = {
    "material.yield_strength": (1e9, " GPa"), "material.tangent_modulus": (1e9, " GPa"), "surface.G": (1.0, " m"),
    "loading.delta_max": (1e-9, " nm"), "mesh.h_contact": (1e-6, " L"),
}  # fmt: skip
Table = list[tuple[str, ...]]
FAMILIES = {"D": ("surface.D",), "G": ("surface.G",), "similar": ("surface.G",), "E_t": ("material.tangent_modulus",),
            "E_t_soft": ("material.tangent_modulus",), "sigma_y": ("material.yield_strength",),
            "sigma_y_free": ("material.yield_strength",)}  # fmt: skip


def main() -> None:
    """Run the study, on all ranks, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of the study")
    parser.add_argument("--study", type=Path, default=ROOT / "cases/paper/study.toml", help="study file")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs", help="folder of the page")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    run_study(Study.load(arguments.study), arguments.folder, say=lambda line: print(line, flush=True))
    if MPI.COMM_WORLD.rank == 0:
        write(StudyResults.read(arguments.folder), arguments.docs)


def write(results: StudyResults, docs: Path) -> None:
    """Write the page and its figures into the folder of the documentation."""
    pictures = docs / "paper"
    for folder in (pictures, docs / "tables"):
        folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures(results):
        style.save(figure, pictures / f"{name}.png")
    found = all_statements(results)
    (docs / "paper.md").write_text(page(results, found), encoding="utf-8")
    made = {"paper_fits": fits(results), "paper_conditions": conditions(found), "paper_unloading": physical(results)}
    for name, rows in made.items():
        (docs / "tables" / f"{name}.csv").write_text(csv_text(COMMAND, versions(), rows), encoding="utf-8")
    for statement in found:
        print(f"{statement.name}  {statement.verdict}: {statement.note}")
    print(f"written {docs / 'paper.md'}")


def labels(name: str, levels: Sequence[StudyLevel]) -> list[str]:
    """Legend of a family, by its leading key alone."""
    return [label_of({k: v for k, v in level.parameters.items() if k in FAMILIES[name]}, SCALE) for level in levels]


def short(name: str, levels: Sequence[StudyLevel]) -> list[str]:
    """Ticks of a family: the value of its leading key."""
    return [text.split(" = ")[-1].removesuffix(" GPa").removesuffix(" m") for text in labels(name, levels)]


# --------------------------------------------------------------------------------------- figures


def figures(results: StudyResults) -> Iterable[tuple[str, Figure]]:
    """Name and figure of every picture of the page."""
    yield "curves", curve_families(results)
    yield "exponents", exponent_families(results)
    yield "frequency", frequencies(results)
    yield "response", base_response(results)
    yield "response_families", response_families(results)
    yield "physical", physical_law(results)


@style.styled
def curve_families(results: StudyResults) -> Figure:
    """Force against approach over D, G, E_t and sigma_y."""
    figure, axes = style.figure(style.DOUBLE, 6.2, columns=2, rows=2)
    for axis, name in zip(axes, ("D", "G", "E_t", "sigma_y"), strict=True):
        levels = results.levels(name)
        draw_curves(axis, results, levels, labels(name, levels))
        axis.xaxis.set_major_locator(MaxNLocator(5))
        axis.legend(loc="upper left")
    style.titles(axes, [""] * len(axes))
    return figure


@style.styled
def exponent_families(results: StudyResults) -> Figure:
    """n by level, linear and logarithmic fit, every seed."""
    figure, axes = style.figure(style.DOUBLE, 8.4, columns=2, rows=4)
    names = ("D", "G", "similar", "sigma_y", "E_t", "E_t_soft", "sigma_y_free")
    axis_names = {
        "D": "$D$", "G": "$G$ (m)", "similar": "$G$ (m), range in proportion to the heights",
        "sigma_y": "$\\sigma_y$ (GPa), $E_t$ = 20 GPa", "E_t": "$E_t$ (GPa), $\\sigma_y$ = 1 GPa",
        "E_t_soft": "$E_t$ (GPa), $\\sigma_y$ = 0.4 GPa",
        "sigma_y_free": "$\\sigma_y$ (GPa), $E_t$ = 20 GPa, free sides",
    }  # fmt: skip
    for axis, name in zip(axes, names, strict=False):
        levels = results.levels(name)
        ticks = short(name, levels)
        draw_column(axis, levels, ticks, "n", style.BLUE, "linear fit", -0.15)
        draw_column(axis, levels, ticks, "n_log", style.VERMILION, "logarithmic fit", 0.15, "s")
        axis.axhline(1.0, color=style.GREY, lw=0.8)
        axis.set_xlabel(axis_names[name])
        axis.set_ylabel("exponent $n$")
    handles, texts = axes[0].get_legend_handles_labels()
    axes[-1].axis("off")
    axes[-1].legend(handles, texts, loc="center")
    style.titles(axes[:-1], [""] * len(names))
    return figure


def mean_law(level: StudyLevel, shift: float = 0.0) -> PowerLaw:
    """Power law with the mean exponent of a level, moved by `shift` standard deviations."""
    n = level.column("n")
    n = n[np.isfinite(n)]
    return PowerLaw(float(n.mean() + shift * (n.std(ddof=1) if n.size > 1 else 0.0)))


@style.styled
def frequencies(results: StudyResults) -> Figure:
    """Natural frequency against amplitude of the mean law of each level; band: one standard deviation of n."""
    figure, axes = style.figure(style.DOUBLE, 6.2, columns=2, rows=2)
    for axis, name in zip(axes, ("D", "G", "E_t", "sigma_y"), strict=True):
        levels = results.levels(name)
        for level, text, colour in zip(levels, labels(name, levels), colours(len(levels)), strict=True):
            middle = ContactOscillator(mean_law(level))
            limit = middle.u_max
            u = np.linspace(0.02, limit, 40)
            axis.plot(u, middle.free(u).omega_ratio, color=colour, label=text)
            edges = [ContactOscillator(mean_law(level, s)).free(u).omega_ratio for s in (-1.0, 1.0)]
            axis.fill_between(u, *edges, color=colour, alpha=0.15, lw=0)
            taylor = middle.taylor().free(u)
            physical = np.array(taylor.valid)
            axis.plot(taylor.u0[physical], taylor.omega_ratio[physical], "--", color=colour, lw=1.0)
            axis.plot(limit, middle.free(limit).omega_ratio, "o", color=colour, ms=4)
        axis.plot([], [], "--", color=style.GREY, label="Taylor")
        axis.plot([], [], "o", color=style.GREY, ms=4, ls="", label="contact lost")
        axis.set_xlabel("amplitude $u_0$")
        axis.set_ylabel("$\\omega/\\omega_s$")
        axis.set_xlim(left=0)
        axis.legend(loc="lower left", fontsize=7)
        style.grid(axis)
    style.titles(axes, [""] * len(axes))
    return figure


def base_response(results: StudyResults) -> Figure:
    """Exact and Taylor response of the mean elastic law of the base surface, continuation and sweeps."""
    exact = ContactOscillator(mean_law(base_level(results)), zeta=ZETA)
    oscillators = (exact, exact.taylor())
    responses = [o.response(f, OMEGA) for o in oscillators for f in FORCING]
    sweeps = [s for o in oscillators for s in o.sweep(FORCING, OMEGA, points=61)]
    return amplitude_frequency(responses, sweeps)


def base_level(results: StudyResults) -> StudyLevel:
    """The elastic level of the base surface, D = 2.4."""
    return next(level for level in results.levels("D") if level.parameters.get("surface.D") == 2.4)


@style.styled
def response_families(results: StudyResults) -> Figure:
    """Response of the mean law of each level: exact, its unstable part dotted white, and Taylor (thin)."""
    figure, axes = style.figure(style.DOUBLE, 6.2, columns=2, rows=2)
    for axis, name in zip(axes, ("D", "G", "E_t", "sigma_y"), strict=True):
        levels = results.levels(name)
        for level, text, colour in zip(levels, labels(name, levels), colours(len(levels)), strict=True):
            exact = ContactOscillator(mean_law(level), zeta=ZETA)
            branch = exact.response(FAMILY_FORCING, OMEGA, subharmonics=False).lines()[0]
            axis.plot(branch.Omega, branch.u_max, color=colour, label=f"{text}, $n$ = {exact.restoring.n_loc:.2f}")
            unstable = np.where(np.asarray(branch.stable, bool), np.nan, branch.u_max)
            axis.plot(branch.Omega, unstable, color="white", lw=0.8, ls=(0, (1, 2)))
            branch = exact.taylor().response(FAMILY_FORCING, OMEGA, subharmonics=False).lines()[0]
            axis.plot(branch.Omega, branch.u_max, "--", color=style.BLACK, lw=0.5)
        axis.plot([], [], "--", color=style.BLACK, lw=0.5, label="Taylor")
        axis.set_xlim(0.75, 1.1)
        axis.set_ylim(0, 1.05)  # room for the legend
        axis.set_xlabel("frequency $\\Omega$")
        axis.set_ylabel("$u_{max}$")
        axis.legend(loc="upper left", fontsize=6.5)
        style.grid(axis)
    style.titles(axes, [""] * len(axes))
    return figure


@style.styled
def physical_law(results: StudyResults) -> Figure:
    """The paper's law (loading curve) and the unload-reload law about the same preload."""
    figure, axes = style.figure(style.DOUBLE, 3.0, columns=3)
    names = {"sigma_y": "$\\sigma_y$ (GPa)", "E_t": "$E_t$ (GPa), $\\sigma_y$ = 1 GPa",
             "E_t_soft": "$E_t$ (GPa), $\\sigma_y$ = 0.4 GPa"}  # fmt: skip
    for axis, (name, text) in zip(axes, names.items(), strict=True):
        levels = [v for v in results.levels(name) if np.isfinite(v.column("n_unload")).any()]
        ticks = short(name, levels)
        draw_column(axis, levels, ticks, "n_loc", style.BLUE, "loading curve", -0.15)
        draw_column(axis, levels, ticks, "n_unload", style.GREEN, "unload-reload", 0.15, "s")
        axis.axhline(1.0, color=style.GREY, lw=0.8)
        axis.set_xlabel(text)
        axis.set_ylabel("local exponent at half load")
    axes[0].legend(loc="best")
    style.titles(axes, [""] * len(axes))
    return figure


# --------------------------------------------------------------------------------------- page


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def plain(text: str) -> str:
    """A label without mathematics, for a Markdown table."""
    return text.replace("$\\sigma_y$", "σ_y").replace("$\\delta_{max}$", "δ_max").replace("$", "")


def spread(level: StudyLevel, column: str, form: str = ".3f") -> str:
    """Mean and standard deviation of a column."""
    values = level.column(column)
    values = values[np.isfinite(values)]
    if not values.size:
        return "-"
    deviation = f" ({values.std(ddof=1):{form}})" if values.size > 1 else ""
    return f"{values.mean():{form}}{deviation}"


def fits(results: StudyResults) -> Table:
    """Table of k and n of every family."""
    rows: Table = []
    for name in FAMILIES:
        for level, text in zip(results.levels(name), labels(name, results.levels(name)), strict=True):
            reach = level.column("delta_star_max")
            rows.append((
                name, plain(text), f"{np.nanmean(reach):.3g}", spread(level, "k", ".3g"), spread(level, "n"),
                spread(level, "n_log"), spread(level, "n_interface"), f"{np.nanmean(level.column('r2')):.4f}",
                spread(level, "kappa"), spread(level, "omega_loss"), spread(level, "area_fraction", ".2f"),
                spread(level, "block_load", ".2f"),
            ))  # fmt: skip
    header = ("family", "level", "δ*max", "k", "n", "n, log fit", "n, interface", "R²", "κ", "ω_loss/ω_s", "A/A₀",
              "p / block yield")  # fmt: skip
    return [header, *rows]


def conditions(found: Iterable[Statement]) -> Table:
    """Every finding of every statement."""
    rows: Table = []
    for statement in found:
        for f in statement.findings:
            digits = ".2f" if statement.name != "T5" else ".2e" if "height" in f.trend.condition else ".4f"
            means = ", ".join(f"{m:{digits}}" for m, _, _ in f.trend.means)
            up, down = f.trend.agreeing
            rows.append((
                statement.name, f.family, f.trend.condition, str(f.trend.seeds), means, f"{up:.0%} / {down:.0%}",
                "yes" if f.holds else "no",
            ))  # fmt: skip
    header = ("", "family", "condition", "seeds", "means, level by level", "single steps up / down", "holds")
    return [header, *rows]


def half_space(results: StudyResults) -> str:
    """Exponents of the elastic families next to those of an independent half-space solver."""
    rows = []
    for name in ("D", "G"):
        for level in results.levels(name):
            row = level.rows[0]
            case = results.case(row)
            assert isinstance(case.surface, WeierstrassMandelbrotSection)
            reference = ROUGH_ELASTIC_FITS.get((case.surface.D, case.surface.G))
            if reference is not None and abs(float(row["delta_star_max"]) - 0.02) < 1e-9:
                rows.append((f"D = {case.surface.D:g}, G = {case.surface.G:g} m", spread(level, "n"),
                             f"{reference[0]:.2f} ({reference[1]:.2f})"))  # fmt: skip
    return table(("surface", "n here", "n, half-space theory, six other seeds"), dict.fromkeys(rows))


def physical(results: StudyResults) -> Table:
    """The paper's law next to the unload-reload law."""
    rows: Table = []
    for name in ("sigma_y", "sigma_y_free", "E_t", "E_t_soft"):
        for level, text in zip(results.levels(name), labels(name, results.levels(name)), strict=True):
            if not np.isfinite(level.column("n_unload")).any():
                continue
            ratio = np.sqrt(level.column("slope_unload") / level.column("slope"))
            rows.append((
                name, plain(text), spread(level, "n_loc"), spread(level, "kappa_loc"), spread(level, "n_unload"),
                spread(level, "kappa_unload"), f"{np.nanmean(ratio):.2f} ({np.nanstd(ratio, ddof=1):.2f})",
            ))  # fmt: skip
    names = ("n_loc, loading", "κ, loading", "n_loc, unload", "κ, unload", "ω_s unload / loading")
    return [("family", "level", *names), *rows]


def resolution(results: StudyResults) -> str:
    """What mesh and steps change, seed 0."""
    rows = []
    for name in ("resolution_elastic", "resolution_plastic"):
        levels = results.levels(name)[::-1]  # the finest mesh last
        reference = levels[-1].rows[0] if levels else {}
        for level in levels:
            row = level.rows[0]
            change = float(row["P_star_max"]) / float(reference["P_star_max"]) - 1
            rows.append((
                name.split("_")[1], plain(label_of(level.parameters, SCALE)), f"{row['dofs']:.0f}", f"{row['n']:.4f}",
                f"{row['n_log']:.4f}", f"{row['P_star_max']:.6f}", f"{change:+.2%}",
            ))  # fmt: skip
    return table(("solid", "mesh and steps", "dofs", "n", "n, log fit", "P*max", "against the last line"), rows)


def failures(results: StudyResults) -> str:
    """Why cases failed, in brackets."""
    found = [
        f"seed {row['surface.seed']:.0f} of {row['families']}: {str(row['exit_reason']).partition(': ')[2]}"
        for row in results.rows
        if row["exit_reason"] != "done"
    ]
    return f" ({'; '.join(found)})" if found else ""


def strains(results: StudyResults) -> str:
    """Least and greatest plastic strain that the elastic-plastic solids reach, seed 0."""
    families = ("E_t", "E_t_soft", "sigma_y", "sigma_y_free")
    rows = [row for name in families for row in results.family(name) if row["surface.seed"] == 0]
    found = [float(row["max_plastic_strain"]) for row in rows if row["material.yield_strength"] is not None]
    return f"{min(found):.2f} to {max(found):.2f}"


def software_of(results: StudyResults) -> dict[str, Any]:
    """Versions that ran the study."""
    path = results.folder / "cases" / str(results.rows[0]["case"]) / "summary.json"
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))["versions"]
    return found


def page(results: StudyResults, found: Sequence[Statement]) -> str:
    """Text of docs/paper.md."""
    verdicts = table(
        ("", "statement", "criterion", "verdict", "what was found"),
        [(s.name, s.text, s.criterion, f"**{s.verdict}**", s.note) for s in found],
    )
    under = "\n".join(f"- {s.name} passes under: {passing(s)}." for s in found)
    done = [row for row in results.rows if row["exit_reason"] == "done"]
    cost = sum(float(row["seconds"] or 0) for row in results.rows)
    shown = ("asperity", "dolfinx", "petsc4py")
    software = ", ".join(f"{k} {v}" for k, v in software_of(results).items() if k in shown)
    law = mean_law(base_level(results))
    oscillator = ContactOscillator(law, zeta=ZETA)
    limits = oscillator.thresholds(FORCING)
    peaks = ", ".join(f"{p['u_max']:.3f} at Ω = {p['Omega']:.3f}" for p in limits.peaks if p["u_max"] is not None)
    fields = {
        "title": results.title, "cases": len(results.rows), "done": len(done), "failed": len(results.rows) - len(done),
        "reasons": failures(results), "cost": f"{cost / 60:.0f}", "software": software,
        "verdicts": verdicts, "under": under,
        "half_space": half_space(results),
        "strains": strains(results),
        "resolution": resolution(results), "n": f"{law.n:.3f}", "u_loss": f"{limits.u_max or 0:.3f}",
        "omega_loss": f"{limits.omega_loss or 0:.4f}", "kappa": f"{limits.kappa:.4f}", "peaks": peaks,
        "onset": f"{limits.contact_loss or 0:.4f}", "hysteresis": f"{limits.hysteresis or 0:.2e}",
        "zeta": ZETA, "family_forcing": FAMILY_FORCING,
        "forcing": ", ".join(map(str, FORCING)), "over_weight": ", ".join(f"{law.n * f:.4f}" for f in FORCING),
        "ways": len(CONDITIONS), "seeds": max(s.findings[0].trend.seeds for s in found[:1]),
    }  # fmt: skip
    return TEMPLATE.format(**fields)


TEMPLATE = """# The paper's studies

Jana, Mitra and Sahoo, *Dynamic contact interactions of fractal surfaces*, Appl. Surf. Sci. 392 (2017)
872-882, state in their abstract how surface and material change the vibration of a mass on a rough contact.
This page repeats their studies, each over an ensemble of surfaces, and tests each statement. It is written by
a script; every figure and number comes from

    ./run mpirun -n 2 python3 benchmarks/paper.py out/paper

which runs `cases/paper/study.toml`, as `asperity study` would, and repeats nothing that is there already.

The paper's own D, G, material and block are not given in the part of it that we have, so the values here are
ours: `cases/paper/base.toml`. The surface is Eq. (1) with L = 1 µm, M = 10, γ = 1.5, f_max = 5; the block is
as high as wide, fixed below, with sides that do not move outwards; the flat is rigid and frictionless;
the theory is that of small strains. E = 200 GPa, ν = 0.3; elastic-plastic solids harden bilinearly. P* =
P/(A₀E'), δ* = δ/L from first touch.

Study: {title}. {cases} cases, {failed} refused or failed{reasons}; {cost} minutes of wall time summed over the
cases, one on each rank ({software}). `cases/paper/full.toml` is the full grid, on finer meshes; it continues
where it was stopped.

## Verdicts

n is the exponent of P* = k (δ*)ⁿ. As a spring, the law softens when n > 1 and hardens when n < 1 (κ =
-(n-1)(2n+1)/48 is the curvature of its backbone). Each statement about n is tested under {ways} conditions:
least squares on linear and on logarithmic scales, over the whole range of approach and over its first half,
for the whole block and for the interface alone (the elastic compression of the block taken off; left out where the
block has yielded or contact is nearly full, A/A₀ > 0.9, for then it means nothing). The rule was
fixed beforehand: a statement *holds* when it passes under all conditions tested, *holds under conditions*
when under some, and *does not hold* when under none. The same seeds are compared from level to level ({seeds}
seeds).

{verdicts}

{under}

What n measures here. The surface alone stiffens under load (n well above 1: more summits come into contact),
the block below it is nearly linear (n = 1), and the two act in series. Over one range of approach a
smoother surface is flattened earlier, the block makes up more of the curve, and n falls towards 1: that is
the effect of roughness in T2. When the range is scaled with the heights, the whole elastic problem is similar
and n does not change with G.

## Force against approach

Mean over the seeds; the band is one standard deviation.

![Force against approach over D, G, tangent modulus and yield strength](paper/curves.png)

All families: [paper_fits.csv](tables/paper_fits.csv), mean (standard deviation over the seeds); k and n by least
squares on the linear scale, over (0, δ*max]. The last columns are the contact area and the mean pressure over that
at which the block as a whole yields, σ_y(1-ν)/(1-2ν) between rollers and σ_y with free sides, at the greatest approach:
above 1 the bulk has yielded, not only the asperities.

The exponents of the elastic families agree with an independent solver, boundary elements on a half-space with
the compliance of the block (`asperity.reference`), which shares no code with this one:

{half_space}

![Exponents of all families](paper/exponents.png)

## The statements, condition by condition

Every family, condition and mean: [paper_conditions.csv](tables/paper_conditions.csv).

## Vibration with the paper's law

The fitted loading curve as a reversible spring. For the base surface, elastic, n = {n}: κ = {kappa}; a free
release keeps contact up to u₀ = {u_loss}, where ω/ω_s = {omega_loss}. With ζ = {zeta} (damping always acting)
the resonance bends over (hysteresis) above F̂ = {hysteresis} and loses contact above F̂ = {onset}. F̂ = F/(n
m g); the forcings F̂ = {forcing} below are F/(m g) = {over_weight}, and give peaks u_max = {peaks}.

![Natural frequency against amplitude](paper/frequency.png)

Lines: exact law with the mean exponent of a level; band: one standard deviation of n; dashed: third-order
Taylor law, as far as it keeps contact.

![Frequency response, exact and Taylor](paper/response.png)

Solid: stable, dashed: unstable, by continuation; triangles: Runge-Kutta sweeps up and down, as in the paper.

![Frequency response of all families](paper/response_families.png)

Exact law with the mean exponent of a level at F̂ = {family_forcing} (dotted white where unstable) and its
Taylor law (thin).

## The physical law compared with the paper's

A plastic contact does not unload along its loading curve. Its vibration about a preload follows the
unload-reload branch, here from the greatest load, about half of it. n_loc = z F'/F there, with z counted from
where the branch separates; κ from a local cubic in logarithms; the last column compares the small-amplitude
frequencies at the same preload.

![Local exponents of the loading curve and of the unload-reload branch](paper/physical.png)

All families: [paper_unloading.csv](tables/paper_unloading.csv).

## What the meshes cost in accuracy

Seed 0. The meshes of the reduced grid are coarse: compare trends with the spread over the seeds, not single
digits.

{resolution}

## Limits

Small-strain theory where strains are not small: the base surface has an rms slope of 0.13, the block as a whole is
compressed by up to 5 %, and the accumulated plastic strain at the most strained point is {strains} from solid to
solid (seed 0). Frictionless. Only the seeds vary within a level. The confidence intervals are of the ensemble mean, and
hold nothing about the mesh error above. A verdict is about the values studied here, not about those of the
paper, which are unknown to us.
"""


if __name__ == "__main__":
    main()
