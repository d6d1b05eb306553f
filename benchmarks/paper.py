"""Run the paper's studies, write the figures of docs/paper.md, and print its tables and numbers.

    ./run mpirun -n 2 python3 benchmarks/paper.py out/paper

What the folder holds already is not repeated.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from families import colours, draw_column, draw_curves
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpi4py import MPI
from statements import WHOLE, Finding, Statement, all_statements, smoother_surfaces, turning, verdict_of

from asperity.case.surfaces import WeierstrassMandelbrotSection
from asperity.dynamics import ContactOscillator, PowerLaw
from asperity.plot import style
from asperity.plot.vibration import amplitude_frequency
from asperity.study import Study, StudyLevel, StudyResults, run_study

ROOT = Path(__file__).parent.parent
CUBIC = (2.0, 2.6, 3.0, 3.3, 3.4, 3.6)  # exponents
ZETA, FORCING, OMEGA = 0.01, (0.01, 0.03), (0.6, 1.2)
FAMILY_FORCING = 0.015
#: (D, G in m) -> (mean, standard deviation) of the exponent n of the whole block over surfaces of seeds 0 to 5;
#: h_b = L, delta*_max = 0.02, elastic, nu = 0.3, linear norm. The choice of the points changes n by a few hundredths.
ROUGH_ELASTIC_FITS = {
    (2.4, 1e-13): (1.36, 0.04),
    (2.4, 1e-12): (1.79, 0.10),
    (2.4, 1.36e-11): (2.14, 0.17),
    (2.5, 1.36e-11): (1.77, 0.09),
    (2.6, 1.36e-11): (1.31, 0.03),
}
Table = list[tuple[str, ...]]
#: family, or how its name begins -> leading key, its symbol, factor and unit
KEYS = {
    "D": ("surface.D", "$D$", 1.0, ""),
    "G": ("surface.G", "$G$", 1.0, " m"),
    "similar": ("surface.G", "$G$", 1.0, " m"),
    "E_t": ("material.tangent_modulus", "$E_t$", 1e9, " GPa"),
    "sigma_y": ("material.yield_strength", "$\\sigma_y$", 1e9, " GPa"),
}
CURVES = ("D", "G", "E_t_free", "sigma_y")  # families of the figures


def main() -> None:
    """Run the studies, on all ranks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of the study")
    parser.add_argument("--study", type=Path, default=ROOT / "cases/paper/study.toml", help="study file")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs", help="folder of the page")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    run_study(Study.load(arguments.study), arguments.folder / "study", say=lambda line: print(line, flush=True))
    if MPI.COMM_WORLD.rank == 0:
        write(StudyResults.read(arguments.folder / "study"), arguments.docs)


def write(results: StudyResults, docs: Path) -> None:
    """Write the figures of the page into the folder of the documentation, and print its tables and numbers."""
    pictures = docs / "paper"
    pictures.mkdir(parents=True, exist_ok=True)
    for name, figure in figures(results):
        style.save(figure, pictures / f"{name}.png")
    found = all_statements(results)
    stored = [table(rows[0], rows[1:]) for rows in (fits(results), conditions(found), physical(results))]
    print(*stored, *numbers(results, found), sep="\n\n")


def labels(name: str, levels: Sequence[StudyLevel]) -> list[str]:
    """Legend of a family, by its leading key alone: that of the longest name in KEYS that its own begins with."""
    key, symbol, factor, unit = KEYS[max((k for k in KEYS if name == k or name.startswith(f"{k}_")), key=len)]
    values = [level.parameters.get(key) for level in levels]
    return ["elastic" if value is None else f"{symbol} = {value / factor:.4g}{unit}" for value in values]


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
    """Force against approach over D, G, E_t (free sides) and sigma_y (rollers)."""
    figure, axes = style.figure(style.DOUBLE, 6.2, columns=2, rows=2)
    for axis, name in zip(axes, CURVES, strict=True):
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
    axis_names = {
        "D": "$D$, elastic", "similar": "$G$ (m), range in proportion to the heights",
        "E_t": "$E_t$ (GPa), rollers", "E_t_free": "$E_t$ (GPa), free sides",
        "E_t_light": "$E_t$ (GPa), rollers, light load", "sigma_y_light": "$\\sigma_y$ (GPa), rollers, light load",
        "sigma_y": "$\\sigma_y$ (GPa), rollers", "sigma_y_free": "$\\sigma_y$ (GPa), free sides",
    }  # fmt: skip
    for axis, (name, text) in zip(axes, axis_names.items(), strict=True):
        levels = results.levels(name)
        ticks = short(name, levels)
        draw_column(axis, levels, ticks, "n", style.BLUE, "linear fit", -0.15)
        draw_column(axis, levels, ticks, "n_log", style.VERMILION, "logarithmic fit", 0.15, "s")
        axis.axhline(1.0, color=style.GREY, lw=0.8)
        axis.set_xlabel(text)
        axis.set_ylabel("exponent $n$")
    axes[0].legend(loc="upper right")
    style.titles(axes, [""] * len(axes))
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
    for axis, name in zip(axes, CURVES, strict=True):
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
    for axis, name in zip(axes, CURVES, strict=True):
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
        axis.set_ylabel("$u_{\\mathrm{max}}$")
        axis.legend(loc="upper left", fontsize=6.5)
        style.grid(axis)
    style.titles(axes, [""] * len(axes))
    return figure


@style.styled
def physical_law(results: StudyResults) -> Figure:
    """The paper's law (loading curve) and the unload-reload law about the same preload."""
    figure, axes = style.figure(style.DOUBLE, 3.0, columns=2)
    names = {"sigma_y": "$\\sigma_y$ (GPa), rollers", "E_t_free": "$E_t$ (GPa), free sides"}
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
    return text.replace("\\sigma_y", "σ_y").replace("$", "")


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
    for name in (f.name for f in results.families if not f.name.startswith("resolution")):
        for level, text in zip(results.levels(name), labels(name, results.levels(name)), strict=True):
            reach = level.column("delta_star_max")
            rows.append((
                name, plain(text), f"{np.nanmean(reach):.3g}", spread(level, "k", ".3g"), spread(level, "n"),
                spread(level, "n_log"), f"{np.nanmean(level.column('r2')):.4f}",
                spread(level, "kappa"), spread(level, "omega_loss"), spread(level, "area_fraction", ".2f"),
                spread(level, "block_load", ".2f"),
            ))  # fmt: skip
    header = ("family", "level", "δ*max", "k", "n", "n, log fit", "R²", "κ", "ω_loss/ω_s", "A/A₀",
              "p / block yield")  # fmt: skip
    return [header, *rows]


def conditions(found: Iterable[Statement]) -> Table:
    """Every finding of every statement."""
    rows: Table = []
    for statement in found:
        for f in statement.findings:
            digits = ".2f" if statement.name != "T5" else ".2e" if "height" in f.trend.condition else ".4f"
            up, down = f.trend.agreeing
            rows.append((
                statement.name, f.family, f.factors, f.regime, f.trend.condition, str(f.trend.seeds),
                means_of(f, digits), f"{up:.0%} / {down:.0%}", "yes" if f.holds else "no" if f.refuted else "open",
            ))  # fmt: skip
    header = ("", "family", "factors", "regime", "condition", "seeds", "means, level by level",
              "single steps up / down", "holds")  # fmt: skip
    return [header, *rows]


def means_of(finding: Finding, digits: str = ".2f") -> str:
    """Means of the levels."""
    return ", ".join(f"{mean:{digits}}" for mean, _, _ in finding.trend.means)


def verdicts(found: Iterable[Statement]) -> Table:
    """Verdict of each statement in each regime and for each kind of sides, with the numbers of its families."""
    rows: Table = []
    for statement in found:
        for (regime, sides), group in statement.groups.items():
            families = list(dict.fromkeys(f.family for f in group))
            shown = []
            for name in families:
                own = [f for f in group if f.family == name]
                other = own[0].factors.partition(", ")[2]
                whole = next((f for f in own if f.trend.condition == str(WHOLE)), None)
                means = "" if whole is None else means_of(whole)
                if whole is not None and statement.name == "T4":
                    means += f", {turning(whole.trend)}"
                yes, no = sum(f.holds for f in own), sum(f.refuted for f in own)
                holds = f"{yes}/{no}/{len(own) - yes - no}"
                shown.append(f"`{name}`{f' ({other})' if other else ''} {means} ({holds})".replace("  ", " "))
            rows.append((statement.name, f"{sides}, {regime}", f"**{verdict_of(group)}**", "; ".join(shown)))
    return rows


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
    for name in ("sigma_y", "E_t_free"):
        for level, text in zip(results.levels(name), labels(name, results.levels(name)), strict=True):
            if not np.isfinite(level.column("n_unload")).any():
                continue
            ratio = np.sqrt(level.column("slope_unload") / level.column("slope"))
            rows.append((
                name, plain(text), spread(level, "n_loc"), spread(level, "kappa_loc"), spread(level, "n_unload"),
                f"{np.nanmean(ratio):.2f} ({np.nanstd(ratio, ddof=1):.2f})",
            ))  # fmt: skip
    names = ("n_loc, loading", "κ, loading", "n_loc, unload", "ω_s unload / loading")
    return [("family", "level", *names), *rows]


def resolution(results: StudyResults) -> tuple[str, float]:
    """What mesh and steps change, seed 0, and the greatest change of n on linear scales."""
    rows, most = [], 0.0
    for name in (f.name for f in results.families if f.name.startswith("resolution")):
        cases = [level.rows[0] for level in results.levels(name)]
        base = max(cases, key=lambda row: (row["mesh.h_contact"], -row["loading.steps"]))
        for row in (case for case in cases if case is not base):
            change = {c: float(row[c]) - float(base[c]) for c in ("n", "n_log")}
            force = float(row["P_star_max"]) / float(base["P_star_max"]) - 1
            most = max(most, abs(change["n"]))
            what = "twice the steps" if row["loading.steps"] != base["loading.steps"] else "half the element size"
            rows.append((
                name.split("_")[1], what, f"{base['dofs']:.0f} to {row['dofs']:.0f}", f"{base['n']:.3f}",
                f"{change['n']:+.3f}", f"{change['n_log']:+.3f}", f"{force:+.2%}",
            ))  # fmt: skip
    return table(("case", "change", "dofs", "n", "Δn", "Δn, log fit", "ΔP*max"), rows), most


def smallest_step(found: Iterable[Statement]) -> float:
    """Smallest mean step of n, fit on linear scales over the whole range, among the findings that hold of T2 and T3."""
    own = [f for s in found if s.name in ("T2", "T3") for f in s.findings]
    steps = [abs(m) for f in own if f.holds and f.trend.condition == str(WHOLE) for m, _, _ in f.trend.steps]
    return min(steps, default=float("nan"))


def numbers(results: StudyResults, found: Sequence[Statement]) -> Iterator[str]:
    """Tables and sentences with the numbers of docs/paper.md that are in none of its stored tables."""
    cost = sum(float(row["seconds"] or 0) for row in results.rows)
    failed = [f"seed {row['surface.seed']:.0f} of {row['families']}: {row['exit_reason']}"
              for row in results.rows if row["exit_reason"] != "done"]  # fmt: skip
    yield f"{len(results.rows)} cases, {len(failed)} failed; {cost / 60:.0f} minutes"
    yield from failed
    yield table(("", "the source says", "test"), [(s.name, s.text, s.criterion) for s in found])
    yield table(("", "sides, regime", "verdict", "families: n by level (yes/no/open)"), verdicts(found))
    dense = smoother_surfaces()[1]
    yield f"slope over Sq/L {dense[0]:.1f} to {dense[-1]:.1f}"
    yield table(("n", "Ω of the peak, power law", "Ω of the peak, cubic", "least u, cubic"), cubic())
    yield f"greatest n {max(float(row['n']) for row in results.rows if row['n']):.2f}"
    yield half_space(results)
    law = mean_law(base_level(results))
    limits = ContactOscillator(law, zeta=ZETA).thresholds(FORCING)
    peaks = ", ".join(f"{p['u_max']:.3f} at Ω = {p['Omega']:.3f}" for p in limits.peaks if p["u_max"] is not None)
    yield (
        f"n = {law.n:.3f}: κ = {limits.kappa:.4f}, u₀ = {limits.u_max or 0:.3f}, ω/ω_s = {limits.omega_loss or 0:.4f}, "
        f"hysteresis {limits.hysteresis or 0:.2e}, contact loss {limits.contact_loss or 0:.4f}, peaks {peaks}"
    )
    changes, most = resolution(results)
    yield changes
    yield f"mesh and steps change n by up to {most:.3f}, the smallest step of n is {smallest_step(found):.3f}"


def cubic() -> Iterator[tuple[str, ...]]:
    """Rows n, peak of the exact law, of the cubic one, and the least u on its branch at the peak."""
    for n in CUBIC:
        exact = ContactOscillator(PowerLaw(n), zeta=0.01)
        shown = []
        for oscillator in (exact, exact.taylor()):
            branch = oscillator.response(0.03, (0.3, 1.4), subharmonics=False).lines()[0]
            top = int(np.argmax(branch.u_max))
            shown += [f"{branch.Omega[top]:.3f}", f"{branch.u_min[top]:.2f}"]
        yield (f"{n:g}", shown[0], shown[2], shown[3])


if __name__ == "__main__":
    main()
