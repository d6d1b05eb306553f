"""The five statements of the paper's abstract, tested on a finished study of cases/paper."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from interface import FULL, Block
from trend import CONDITIONS, Condition, Trend, trend, verdict

from asperity.case import Case
from asperity.curve import Curve
from asperity.study import StudyLevel, StudyResults
from asperity.study.results import Row
from asperity.surface import Surface, WeierstrassMandelbrot

SURFACE, YIELDS, CLOSED = "surface alone", "block yields", "contact nearly full"
LEAST = 3  # surfaces of a condition
FEWEST = 5  # single fits or steps of a sign test: 2^-5 = 3 %
SMALL = 0.005  # change of n that mesh and load steps make between levels
WHOLE = CONDITIONS[0]  # least squares on linear scales over the whole range: the condition whose means are shown


@dataclass(frozen=True)
class Finding:
    """A statement in a family of cases under one condition.

    Attributes:
        family: of the study.
        factors: sides, height, hardening and kinematics, in words.
        regime: what carries the load at the end of the range, in words.
        trend: the figure over the levels.
        holds: whether the statement does, with 95 % confidence.
        refuted: whether it does not, with 95 % confidence; neither where the seeds are too few to tell.
        opposite: whether its opposite holds at every level.
    """

    family: str
    factors: str
    regime: str
    trend: Trend
    holds: bool
    refuted: bool
    opposite: bool = False


@dataclass(frozen=True)
class Statement:
    """A statement of the abstract and what became of it.

    Attributes:
        name: T1 to T5.
        text: the statement.
        criterion: what the figures must show for it to hold.
        findings: one for each family and condition.
    """

    name: str
    text: str
    criterion: str
    findings: tuple[Finding, ...]

    @property
    def groups(self) -> dict[tuple[str, str], list[Finding]]:
        """Findings by regime and sides."""
        found: dict[tuple[str, str], list[Finding]] = {}
        for finding in self.findings:
            found.setdefault((finding.regime, finding.factors.split(", ")[0]), []).append(finding)
        return found


def verdict_of(found: Sequence[Finding]) -> str:
    """Verdict of the findings that are decided, "open" unless more than half are."""
    if all(f.opposite for f in found):
        return "the opposite holds"
    decided = [f.holds for f in found if f.holds or f.refuted]
    return verdict(decided) if len(decided) > 0.5 * len(found) else "open"


class Exponents:
    """Exponents of the curves of a study under conditions; curves and cases are read once."""

    def __init__(self, results: StudyResults) -> None:
        self.results = results
        self._loaded = functools.cache(self._load)

    def _load(self, key: str) -> tuple[Curve, Case]:
        row = next(r for r in self.results.rows if r["case"] == key)
        return self.results.curve(row), self.results.case(row)

    def present(self, names: Iterable[str]) -> list[str]:
        """Those of some families that the study has finished cases of."""
        known = [f.name for f in self.results.families]
        return [name for name in names if name in known and self.results.family(name)]

    def of(self, row: Row, condition: Condition) -> float:
        """Exponent of a row."""
        curve, case = self._loaded(str(row["case"]))
        return condition.exponent(curve, Block.of(case))

    def trends(self, levels: Sequence[StudyLevel]) -> list[Trend]:
        """Trend of the exponent under each condition."""
        return [trend(levels, functools.partial(self.of, condition=c), str(c)) for c in CONDITIONS]

    def factors(self, name: str) -> str:
        """Sides and what else a family has that the base case has not."""
        case = self.results.case(self.results.family(name)[0])
        words = [f"{case.block.sides} sides" if case.block.sides == "free" else case.block.sides]
        height = case.block.height / case.surface.L
        words += [] if abs(height - 1) < 1e-9 else [f"height {height:g} L"]
        words += [f"{case.material.hardening} hardening"] if case.material.hardening else []
        words += [f"{case.material.kinematics} strain"] if case.material.kinematics else []
        return ", ".join(words)


def regime(levels: Sequence[StudyLevel]) -> str:
    """What carries the load at the end of the range: the surface alone, unless a level is beyond a limit in the mean.

    The block yields where its mean pressure exceeds the yield pressure; contact is nearly full above FULL of the patch.
    """
    words = []
    for column, limit, word in (("block_load", 1.0, YIELDS), ("area_fraction", FULL, CLOSED)):
        values = (level.column(column) for level in levels)
        if any(np.isfinite(v).any() and np.nanmean(v) >= limit for v in values):
            words.append(word)
    return ", ".join(words) or SURFACE


def findings(
    exponents: Exponents,
    families: Iterable[str],
    holds: Callable[[Trend], bool],
    refuted: Callable[[Trend], bool],
    opposite: Callable[[Trend], bool] = lambda _: False,
) -> tuple[Finding, ...]:
    """Test a statement about exponents in families under all conditions.

    Families without cases are left out, and conditions that are void for most surfaces: see `Block.void`.

    Raises:
        ValueError: a summit lies on an edge.
    """
    out = []
    for name in exponents.present(families):
        levels = exponents.results.levels(name)
        if any(row["summit_on_edge"] for level in levels for row in level.rows):
            raise ValueError(f"a summit lies on an edge in {name}: such cases say nothing of the surface")
        for t in exponents.trends(levels):
            if len(t.values) and t.seeds >= LEAST:
                about = exponents.factors(name), regime(levels)
                out.append(Finding(name, *about, t, holds(t), refuted(t), opposite(t)))
    return tuple(out)


def with_variants(*names: str) -> list[str]:
    """Families and those that differ from them in one factor."""
    return [name + tail for name in names for tail in ("", "_free", "_low", "_high", "_kinematic", "_finite")]


def elastic_softens(exponents: Exponents) -> Statement:
    """T1."""
    names = [*with_variants("D"), "G", "D_light", "similar"]
    found = findings(
        exponents,
        names,
        always_softens,
        lambda t: any(high < 1 for *_, high in t.means),
    )
    return Statement("T1", "A linear elastic surface softens.", "mean n > 1 (95 %) at every level", found)


def rougher_softens_more(exponents: Exponents) -> Statement:
    """T2: smaller D and larger G are rougher (T5)."""
    by_D = findings(exponents, [*with_variants("D"), "D_light"], falls, steps_up, rises)
    by_G = findings(exponents, ("G", "similar"), rises, steps_down, falls)
    return Statement(
        "T2", "Softening increases with rougher topography.",
        "every step of n from a smoother to a rougher level upwards (95 %, same seeds)", by_D + by_G,
    )  # fmt: skip


def modulus_softens_more(exponents: Exponents) -> Statement:
    """T3."""
    names = ["E_t", *with_variants("E_t_free"), "E_t_light", "E_t_light_free"]
    return Statement(
        "T3", "Softening increases with the tangent modulus.", "every step of n upwards (95 %, same seeds)",
        findings(exponents, names, rises, steps_down, falls),
    )  # fmt: skip


def strength_hardens(exponents: Exponents) -> Statement:
    """T4."""
    names = ["sigma_y", *with_variants("sigma_y_free"), "sigma_y_light", "sigma_y_light_free"]
    return Statement(
        "T4", "Above a certain yield strength the response changes from softening to hardening.",
        "n > 1 at a yield strength and n < 1 at a greater one (95 %)",
        findings(exponents, names, turns_hardening, always_softens),
    )  # fmt: skip


def always_softens(t: Trend) -> bool:
    """Whether n > 1 at every level: on the mean with 95 % confidence, or in all of at least FEWEST fits."""
    known = t.values[np.isfinite(t.values)]
    return all(low > 1 for _, low, _ in t.means) or bool(known.size >= FEWEST and (known > 1).all())


def rises(t: Trend) -> bool:
    """Whether n rises in every step: on the mean with 95 % confidence, or in all of at least FEWEST single steps.

    The second is a sign test: as many steps of random sign agree with a probability of 3 %. Mean steps below SMALL do
    not count.
    """
    steps = np.diff(t.values, axis=0)
    known = steps[np.isfinite(steps)]
    agree = bool(known.size >= FEWEST and (known > 0).all())
    return (agree or t.rises) and all(mean > SMALL for mean, _, _ in t.steps)


def falls(t: Trend) -> bool:
    """Whether n falls in every step, see `rises`."""
    return rises(Trend(t.condition, -t.values))


def steps_up(t: Trend) -> bool:
    """Whether some step rises with 95 % confidence, or all do."""
    return any(low > SMALL for _, low, _ in t.steps) or rises(t)


def steps_down(t: Trend) -> bool:
    """Whether some step falls with 95 % confidence, or all do."""
    return steps_up(Trend(t.condition, -t.values))


def turns_hardening(t: Trend) -> bool:
    """Whether n > 1 at some level and n < 1 at a later one."""
    soft = [low > 1 for _, low, _ in t.means]
    hard = [high < 1 for _, _, high in t.means]
    return any(soft[i] and any(hard[i + 1 :]) for i in range(len(soft)))


def turning(t: Trend) -> str:
    """Share of the single surfaces with n > 1 at some level and n < 1 at a later one, in words."""
    turned = [
        any(one > 1 and (own[i + 1 :] < 1).any() for i, one in enumerate(own))
        for own in (column[np.isfinite(column)] for column in t.values.T)
    ]
    return f"{sum(turned)} of {len(turned)} surfaces turn"


def smoother_surfaces(seeds: int = 20) -> tuple[Statement, list[float]]:
    """T5, on the surfaces alone, and the slope over height of the surfaces by rising D, times L."""
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
        Finding(name, "surfaces", "without contact", t, getattr(t, way), not getattr(t, way))
        for name, data, way in (("D", by_D, "falls"), ("G", by_G, "rises"))
        for t in (Trend("rms height", data[0]), Trend("rms slope", data[1]))
    )
    statement = Statement(
        "T5", "Low G and high D signify a smoother surface.",
        "rms height and rms slope fall with D and rise with G at every step (95 %, same seeds)", found,
    )  # fmt: skip
    return statement, [mean for mean, _, _ in Trend("dense", by_D[2]).means]


def all_statements(results: StudyResults) -> tuple[Statement, ...]:
    """The five statements in order; those without cases in the study are left out."""
    exponents = Exponents(results)
    tests = (elastic_softens, rougher_softens_more, modulus_softens_more, strength_hardens)
    made = (*(test(exponents) for test in tests), smoother_surfaces()[0])
    return tuple(statement for statement in made if statement.findings)
