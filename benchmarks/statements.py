# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The five statements of the paper's abstract, tested on a finished study of cases/paper."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from asperity.case import Case
from asperity.curve import Curve
from asperity.study import StudyLevel, StudyResults
from asperity.study.interface import Block
from asperity.study.results import Row
from asperity.study.trend import CONDITIONS, FAILS, HOLDS, Condition, Trend, trend, verdict
from asperity.surface import Surface, WeierstrassMandelbrot


@dataclass(frozen=True)
class Finding:
    """A statement under one condition.

    Attributes:
        family: of the study.
        trend: the figure over the levels.
        holds: whether the statement does.
    """

    family: str
    trend: Trend
    holds: bool


@dataclass(frozen=True)
class Statement:
    """A statement of the abstract and what became of it.

    Attributes:
        name: T1 to T5.
        text: the statement.
        criterion: what the figures must show for it to pass.
        findings: one for each family and condition.
        verdict: of all of them.
        note: conditions found, in words with numbers.
    """

    name: str
    text: str
    criterion: str
    findings: tuple[Finding, ...]
    verdict: str
    note: str


class Exponents:
    """Exponents of the curves of a study under conditions; curves and cases are read once."""

    def __init__(self, results: StudyResults) -> None:
        self.results = results
        self._loaded = functools.cache(self._load)

    def _load(self, key: str) -> tuple[Curve, Case]:
        row = next(r for r in self.results.rows if r["case"] == key)
        return self.results.curve(row), self.results.case(row)

    def present(self, *names: str) -> list[str]:
        """Those of some families that the study has finished cases of."""
        return [f.name for f in self.results.families if f.name in names and self.results.family(f.name)]

    def of(self, row: Row, condition: Condition) -> float:
        """Exponent of a row."""
        curve, case = self._loaded(str(row["case"]))
        return condition.exponent(curve, **asdict(Block.of(case)))

    def trends(self, levels: Sequence[StudyLevel], conditions: Sequence[Condition] = CONDITIONS) -> list[Trend]:
        """Trend of the exponent under each condition."""
        return [trend(levels, functools.partial(self.of, condition=c), str(c)) for c in conditions]


def findings(
    exponents: Exponents, families: Sequence[str], holds: Callable[[Trend], bool], conditions: Sequence[Condition]
) -> tuple[Finding, ...]:
    """Test a statement about exponents in families under conditions.

    Families without cases are left out, and conditions that are void for a whole level: see `Block.void`.
    """
    out = []
    for name in families:
        for t in exponents.trends(exponents.results.levels(name), conditions):
            if len(t.values) and np.isfinite(t.values).any(axis=1).all():
                out.append(Finding(name, t, holds(t)))
    return tuple(out)


def count(found: Sequence[Finding]) -> str:
    """How many findings hold, in words."""
    return f"{sum(f.holds for f in found)} of {len(found)} conditions"


def local_laws(exponents: Exponents, family: str) -> str:
    """What the curves say about half the greatest load without a fitted power law, level by level."""
    levels = exponents.results.levels(family)

    def means(column: str, form: str) -> str:
        values = [level.column(column) for level in levels]
        return ", ".join(f"{np.nanmean(v):{form}}" for v in values if np.isfinite(v).any())

    hard = [v[np.isfinite(v)] for v in (level.column("kappa_loc") for level in levels)]
    shares = ", ".join(f"{np.mean(v > 0):.0%}" for v in hard if v.size)
    return (
        f"{family}, about half the greatest load: local exponent of the loading curve {means('n_loc', '.2f')}, with a "
        f"hardening backbone (κ > 0) in {shares} of the surfaces; of the unload-reload branch "
        f"{means('n_unload', '.2f')}."
    )


def elastic_softens(exponents: Exponents) -> Statement:
    """T1."""
    found = findings(exponents, ("D", "G", "similar"), lambda t: all(low > 1 for _, low, _ in t.means), CONDITIONS)
    singles = np.concatenate([f.trend.values.ravel() for f in found])
    singles = singles[np.isfinite(singles)]
    note = (
        f"Mean n above 1 with 95 % confidence in {count(found)}; single surfaces: {np.mean(singles > 1):.1%} of "
        f"{singles.size} fits have n > 1, the smallest n is {singles.min():.3f}."
    )
    return Statement(
        "T1", "A linear elastic surface softens.", "mean n > 1 (95 %) at every level", found,
        verdict(f.holds for f in found), note,
    )  # fmt: skip


def rougher_softens_more(exponents: Exponents) -> Statement:
    """T2: smaller D and larger G are rougher (T5)."""
    by_D = findings(exponents, ("D",), lambda t: t.falls, CONDITIONS)
    by_G = findings(exponents, ("G",), lambda t: t.rises, CONDITIONS)
    scaled = findings(exponents, ("similar",), lambda t: t.rises, CONDITIONS[:2])
    found = by_D + by_G + scaled
    note = (
        f"At one range of approach for all surfaces: D {count(by_D)}, G {count(by_G)}. With the range in proportion "
        f"to the heights: {count(scaled)}; "
    )
    if scaled:
        shift = float(np.nanmean(scaled[0].trend.values[-1] - scaled[0].trend.values[0]))
        note += f"there n changes by {shift:+.3f} from the smoothest to the roughest surface (linear fit). "
    opposite = [f for f in by_D if f.trend.rises] + [f for f in by_G if f.trend.falls]
    alone = sum("interface" in f.trend.condition for f in opposite)
    note += f"The opposite is found in {len(opposite)} conditions, {alone} of them of the interface alone."
    return Statement(
        "T2", "Softening increases with rougher topography.",
        "every step of n from a smoother to a rougher level upwards (95 %, same seeds)", found,
        verdict(f.holds for f in found), note,
    )  # fmt: skip


def modulus_softens_more(exponents: Exponents) -> Statement:
    """T3."""
    found = findings(exponents, ("E_t", "E_t_soft"), lambda t: t.rises, CONDITIONS)
    opposite = [f for f in found if f.trend.falls]
    parts = []
    for name in ("E_t", "E_t_soft"):
        own = [f for f in found if f.family == name]
        if own:
            first, last = own[0].trend.means[0], own[0].trend.means[-1]
            load = exponents.results.levels(name)
            block = [float(np.nanmean(level.column("block_load"))) for level in load]
            parts.append(
                f"{name}: {count(own)}, n {first[0]:.3f} to {last[0]:.3f} (linear fit, whole range), mean pressure "
                f"{min(block):.2g} to {max(block):.2g} times the yield pressure of the block"
            )
    note = "; ".join(parts) + f". The opposite (n falls at every step) is found in {len(opposite)} conditions. "
    note += " ".join(local_laws(exponents, name) for name in ("E_t", "E_t_soft") if exponents.results.levels(name))
    return Statement(
        "T3", "Softening increases with the tangent modulus.", "every step of n upwards (95 %, same seeds)", found,
        verdict(f.holds for f in found), note,
    )  # fmt: skip


def strength_hardens(exponents: Exponents) -> Statement:
    """T4, between rollers and with free sides."""
    found = findings(exponents, exponents.present("sigma_y", "sigma_y_free"), turns_hardening, CONDITIONS)
    parts = []
    for name in dict.fromkeys(f.family for f in found):
        own = [f for f in found if f.family == name]
        values = np.concatenate([f.trend.values.ravel() for f in own])
        values = values[np.isfinite(values)]
        below = [f.trend.condition for f in own if any(high < 1 for _, _, high in f.trend.means)]
        load = [np.nanmean(level.column("block_load")) for level in exponents.results.levels(name)[:-1]]
        parts.append(
            f"{name}: {count(own)}; n from the softest to the hardest solid, the last one elastic: "
            + ", ".join(f"{mean:.2f}" for mean, _, _ in own[0].trend.means)
            + f" (linear fit, whole range), at a mean pressure of {', '.join(f'{v:.2g}' for v in load)} times the "
            f"yield pressure of the block; {np.mean(values < 1):.1%} of {values.size} single fits have n < 1"
            + (f", and the mean is below 1 in: {'; '.join(below)}. " if below else ". ")
            + local_laws(exponents, name)
        )
    return Statement(
        "T4", "Above a certain yield strength the response changes from softening to hardening.",
        "a yield strength below which mean n > 1 and above which mean n < 1 (95 %)", found,
        verdict(f.holds for f in found), " ".join(parts),
    )  # fmt: skip


def turns_hardening(t: Trend) -> bool:
    """Whether n > 1 up to some level of rising yield strength and n < 1 above it, the elastic level left out."""
    means = t.means[:-1]
    return any(
        all(low > 1 for _, low, _ in means[:i]) and all(high < 1 for _, _, high in means[i:])
        for i in range(1, len(means))
    )


def smoother_surfaces(seeds: int = 20) -> Statement:
    """T5, on the surfaces alone."""
    dimensions, roughnesses = (2.3, 2.4, 2.5, 2.6, 2.7), (1e-13, 1e-12, 1.36e-11, 1e-10)

    def surface(D: float, G: float, seed: int) -> Surface:
        return WeierstrassMandelbrot(L=1e-6, D=D, G=G, M=10, gamma=1.5, f_max=5, seed=seed)

    def table(levels: Sequence[tuple[float, float]]) -> np.ndarray:
        """Sq, rms slope and slope of the surface scaled to Sq = L, (3, levels, seeds)."""
        out = np.empty((3, len(levels), seeds))
        for i, (D, G) in enumerate(levels):
            for s in range(seeds):
                Sq, slope, _ = surface(D, G, s).exact_rms()  # type: ignore[attr-defined]
                out[:, i, s] = Sq, slope, slope * 1e-6 / Sq
        return out

    by_D, by_G = table([(D, 1.36e-11) for D in dimensions]), table([(2.4, G) for G in roughnesses])
    found = tuple(
        Finding(name, t, getattr(t, way))
        for name, data, way in (("D", by_D, "falls"), ("G", by_G, "rises"))
        for t in (Trend("rms height", data[0]), Trend("rms slope", data[1]))
    )
    dense = Trend("slope over height", by_D[2])
    means = [math.nan if not np.isfinite(m) else m for m, _, _ in dense.means]
    note = (
        f"{seeds} seeds, D 2.3 to 2.7 and G 1e-13 to 1e-10 m. At equal heights a larger D is the rougher one: its "
        f"slope over Sq/L rises from {means[0]:.1f} to {means[-1]:.1f} ('dense')."
    )
    return Statement(
        "T5", "Low G and high D signify a smoother surface.",
        "rms height and rms slope fall with D and rise with G at every step (95 %, same seeds)", found,
        verdict(f.holds for f in found), note,
    )  # fmt: skip


def all_statements(results: StudyResults) -> tuple[Statement, ...]:
    """The five statements in order; those without cases in the study are left out."""
    exponents = Exponents(results)
    names = {family.name for family in results.families if results.family(family.name)}
    tests: list[tuple[set[str], Callable[[Exponents], Statement]]] = [
        ({"D", "G", "similar"}, elastic_softens),
        ({"D", "G", "similar"}, rougher_softens_more),
        ({"E_t", "E_t_soft"}, modulus_softens_more),
        ({"sigma_y"}, strength_hardens),
    ]
    return (*(test(exponents) for needed, test in tests if needed <= names), smoother_surfaces())


def passing(statement: Statement) -> str:
    """Conditions under which a statement passes, for a page."""
    if statement.verdict == FAILS:
        return "none"
    if statement.verdict == HOLDS:
        return "all"
    return "; ".join(f"{f.family} ({f.trend.condition})" for f in statement.findings if f.holds)


__all__ = ["Exponents", "Finding", "Statement", "all_statements", "passing"]
