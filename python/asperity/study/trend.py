"""Does a figure rise or fall from level to level of a study? Paired over the seeds, under stated conditions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from asperity.curve import Curve
from asperity.errors import InputError
from asperity.power_law import fit_power_law, interface_deflection
from asperity.study.definition import ENSEMBLE
from asperity.study.results import Level, Row, mean_interval

Array = NDArray[Any]
HOLDS, CONDITIONAL, FAILS = "holds", "holds under conditions", "does not hold"


@dataclass(frozen=True)
class Condition:
    """How an exponent is taken from a curve.

    Attributes:
        norm: of the fit, "linear" or "log".
        share: part of the range of deflection that is used, from first touch.
        interface: take the elastic compression of the block off the deflection.
    """

    norm: Literal["linear", "log"] = "linear"
    share: float = 1.0
    interface: bool = False

    def __str__(self) -> str:
        """Words for a table."""
        part = "whole range" if self.share == 1 else f"first {self.share:.0%} of the range"
        return f"{self.norm} fit, {part}" + (", interface alone" if self.interface else "")

    def exponent(self, curve: Curve, *, side: float, height: float, modulus: float) -> float:
        """Exponent n of the loading branch; NaN when fewer than three points are left.

        Args:
            curve: of the case.
            side: L (length).
            height: of the block (length).
            modulus: of its uniform compression (force/length^2).
        """
        load = curve.loading()
        used = load.where(load.delta_star <= self.share * load.delta_star.max() * (1 + 1e-9))
        delta = used.delta_star
        if self.interface:
            gap = interface_deflection(used.delta, used.force, height=height, area=side**2, modulus=modulus)
            delta = gap / side
        there = (delta > 0) & (used.P_star > 0)
        try:
            return fit_power_law(delta[there], used.P_star[there], self.norm).n
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
    """A figure over the levels of a family.

    Attributes:
        condition: in words.
        values: per level and seed, (levels, seeds), NaN where missing.
    """

    condition: str
    values: Array

    @property
    def means(self) -> tuple[tuple[float, float, float], ...]:
        """Mean of each level with its 95 % interval."""
        return tuple(mean_interval(row) for row in self.values)

    @property
    def steps(self) -> tuple[tuple[float, float, float], ...]:
        """Mean change from each level to the next, the same seeds compared, with its 95 % interval."""
        return tuple(mean_interval(step) for step in np.diff(self.values, axis=0))

    @property
    def seeds(self) -> int:
        """Smallest number of seeds compared in a step, or in a level when there is one only."""
        rows = np.diff(self.values, axis=0) if len(self.values) > 1 else self.values
        return int(np.isfinite(rows).sum(axis=1).min())

    @property
    def rises(self) -> bool:
        """Whether every step is upwards with 95 % confidence."""
        return len(self.values) > 1 and all(low > 0 for _, low, _ in self.steps)

    @property
    def falls(self) -> bool:
        """Whether every step is downwards with 95 % confidence."""
        return len(self.values) > 1 and all(high < 0 for _, _, high in self.steps)

    @property
    def level(self) -> bool:
        """Whether no step differs from 0 with 95 % confidence."""
        return all(low <= 0 <= high for _, low, high in self.steps)

    @property
    def agreeing(self) -> tuple[float, float]:
        """Share of single steps of single seeds that go up, and that go down."""
        steps = np.diff(self.values, axis=0)
        steps = steps[np.isfinite(steps)]
        return (float((steps > 0).mean()), float((steps < 0).mean())) if steps.size else (math.nan, math.nan)


def trend(levels: Sequence[Level], figure: Callable[[Row], float], condition: str) -> Trend:
    """Evaluate `figure` for each level and seed; seeds that a level lacks are NaN there."""
    seeds = sorted({row.get(ENSEMBLE) or 0 for level in levels for row in level.rows})
    values = np.full((len(levels), len(seeds)), np.nan)
    for i, level in enumerate(levels):
        for row in level.rows:
            values[i, seeds.index(row.get(ENSEMBLE) or 0)] = figure(row)
    return Trend(condition, values)


def verdict(found: Iterable[bool]) -> str:
    """One of HOLDS (under all conditions), CONDITIONAL (some), FAILS (none)."""
    answers = list(found)
    if not answers:
        raise InputError("a verdict needs at least one condition")
    return HOLDS if all(answers) else CONDITIONAL if any(answers) else FAILS
