"""Test whether a quantity rises or falls between the levels of a study, paired by seed, under several conditions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from interface import Block
from scipy.stats import ttest_1samp

from asperity.arrays import Array
from asperity.curve import Curve
from asperity.errors import InputError
from asperity.power_law import fit_power_law
from asperity.study.definition import ENSEMBLE
from asperity.study.results import Row, StudyLevel

HOLDS, CONDITIONAL, FAILS = "holds", "holds under conditions", "does not hold"


def mean_interval(values: Array) -> tuple[float, float, float]:
    """Mean of a sample (n,) with its 95 % interval: (mean, low, high); NaNs are ignored."""
    sample = values[np.isfinite(values)]
    if sample.size < 2:
        return float(sample.mean()) if sample.size else math.nan, -math.inf, math.inf
    low, high = ttest_1samp(sample, 0.0).confidence_interval()
    return float(sample.mean()), float(low), float(high)


@dataclass(frozen=True)
class Condition:
    """How an exponent is determined from a curve.

    Attributes:
        norm: of the fit, "linear" or "log".
        share: fraction of the range of approach that is used, from first contact.
        interface: whether to subtract the elastic compression of the block from the approach.
    """

    norm: Literal["linear", "log"] = "linear"
    share: float = 1.0
    interface: bool = False

    def __str__(self) -> str:
        """Return the condition as text for a table."""
        part = "whole range" if self.share == 1 else f"first {self.share:.0%} of the range"
        return f"{self.norm} fit, {part}" + (", interface alone" if self.interface else "")

    def exponent(self, curve: Curve, block: Block) -> float:
        """Exponent n of the planned points of the loading branch.

        It is NaN if fewer than three points are left, or if the interface alone is meaningless, see `Block.void`.
        """
        load = curve.planned()
        used = load.where(load.delta_star <= self.share * load.delta_star.max() * (1 + 1e-9))
        if self.interface and block.void(used):
            return math.nan
        delta = np.asarray(block.interface(used) if self.interface else used.delta_star)
        touched = (delta > 0) & (used.P_star > 0)
        try:
            return fit_power_law(delta[touched], used.P_star[touched], self.norm).n
        except InputError:
            return math.nan


#: The conditions under which each statement about an exponent is tested.
CONDITIONS = (
    Condition(),
    Condition("log"),
    Condition(share=0.5),
    Condition("log", share=0.5),
    Condition(interface=True),
    Condition("log", interface=True),
    Condition(share=0.5, interface=True),
    Condition("log", share=0.5, interface=True),
)


@dataclass(frozen=True)
class Trend:
    """A quantity over the levels of a family.

    Attributes:
        condition: as text.
        values: of each level and seed (levels, seeds), NaN where missing.

    """

    condition: str
    values: Array

    @property
    def means(self) -> tuple[tuple[float, float, float], ...]:
        """Mean of each level with its 95 % interval: (mean, low, high)."""
        return tuple(mean_interval(row) for row in self.values)

    @property
    def steps(self) -> tuple[tuple[float, float, float], ...]:
        """Mean change from each level to the next for equal seeds, with its 95 % interval: (mean, low, high)."""
        return tuple(mean_interval(step) for step in np.diff(self.values, axis=0))

    @property
    def seeds(self) -> int:
        """Smallest number of seeds in a step between levels, or in the level if there is only one."""
        rows = np.diff(self.values, axis=0) if len(self.values) > 1 else self.values
        return int(np.isfinite(rows).sum(axis=1).min())

    @property
    def rises(self) -> bool:
        """Whether the quantity rises in every step with 95 % confidence."""
        return len(self.values) > 1 and all(low > 0 for _, low, _ in self.steps)

    @property
    def falls(self) -> bool:
        """Whether the quantity falls in every step with 95 % confidence."""
        return len(self.values) > 1 and all(high < 0 for _, _, high in self.steps)

    @property
    def agreeing(self) -> tuple[float, float]:
        """Fractions of the steps of single seeds that rise, and that fall."""
        steps = np.diff(self.values, axis=0)
        steps = steps[np.isfinite(steps)]
        return (float((steps > 0).mean()), float((steps < 0).mean())) if steps.size else (math.nan, math.nan)


def trend(levels: Sequence[StudyLevel], quantity: Callable[[Row], float], condition: str) -> Trend:
    """Evaluate a quantity for each level and seed; it is NaN for seeds that are missing in a level."""
    seeds = sorted({row.get(ENSEMBLE) or 0 for level in levels for row in level.rows})
    values = np.full((len(levels), len(seeds)), np.nan)
    for i, level in enumerate(levels):
        for row in level.rows:
            values[i, seeds.index(row.get(ENSEMBLE) or 0)] = quantity(row)
    return Trend(condition, values)


def verdict(found: Iterable[bool]) -> str:
    """Return HOLDS (under all conditions), CONDITIONAL (under some) or FAILS (under none)."""
    answers = list(found)
    if not answers:
        raise InputError("a verdict needs at least one condition")
    return HOLDS if all(answers) else CONDITIONAL if any(answers) else FAILS
