# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""All laws of a curve side by side: exponent, backbone curvature, stiffness and frequency at one preload."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from asperity.dynamics.law.choice import AFTER_YIELD, NAMES, Choice, law_named
from asperity.dynamics.law.history import History
from asperity.dynamics.law.law import Law
from asperity.dynamics.law.power import PowerLaw
from asperity.dynamics.law.table import TableLaw
from asperity.dynamics.law.tangent import TangentLaw
from asperity.dynamics.law.two_branches import TwoBranchLaw
from asperity.errors import AsperityError, InputError

WORDS = {
    "unload-reload": "unload-reload branch",
    "elastic": "elastic tangent",
    "table": "points of the loading",
    "paper": "power law of the loading (the paper's)",
}


@dataclass(frozen=True, eq=False)
class LawAtLoad:
    """One law of a curve at a preload.

    Attributes:
        name: of the law, see `law_from`.
        law: the law; None where the curve does not have it.
        n, kappa: local exponent and backbone curvature, NaN without a law.
        z_s: static approach (length).
        stiffness: k_n at the preload (force/length).
        frequency: of small vibration, sqrt(k_n/m)/(2 pi) (1/time); NaN without a mass.
        applies: whether the law describes small vibration about this preload. After yield the laws of the loading do
            not, unless there is no other, nor does an unloading from a force that the contact has not met.
        chosen: whether it is the law of the vibration.
        missing: why there is no law, or "".
        bar: error bar at the preload as a share: of the elastic stiffness for the law "elastic" where the curve has it,
            else of the force; NaN for a curve without one.
        bar_of: what the bar is of, "force" or "k_n_elastic".

    Examples:
        >>> delta = np.linspace(0.0, 1.0, 21)
        >>> result = asp.run_dynamics({"delta": delta, "force": delta**1.5}, units="SI", models=["exact"],
        ...                           omega=(0.9, 1.0), sweeps=False, bands=False)
        >>> row = result.laws.rows[0]
        >>> row.name, row.chosen, row.applies, f"{row.stiffness:.3f}"
        ('table', True, True, '1.191')
    """

    name: str
    law: Law | None
    n: float
    kappa: float
    z_s: float
    stiffness: float
    frequency: float
    applies: bool
    chosen: bool
    missing: str = ""
    bar: float = math.nan
    bar_of: str = "force"

    def sides(self) -> Iterator[Law]:
        """Yield the law at both ends of its error bar; the law itself without one."""
        if self.law is None:
            return
        if not self.bar > 0:
            yield self.law
            return
        scale = stiffened if self.bar_of == "k_n_elastic" else scaled
        yield from (scale(self.law, 1.0 + side) for side in (-self.bar, self.bar))

    def to_dict(self) -> dict[str, Any]:
        """Return the row as plain values, None where unknown."""
        values = {"n": self.n, "kappa": self.kappa, "z_s": self.z_s, "k_n": self.stiffness, "f": self.frequency}
        known = {name: value if math.isfinite(value) else None for name, value in values.items()}
        bar = {"bar": self.bar if math.isfinite(self.bar) else None, "bar_of": self.bar_of}
        return {
            "law": self.name, **known, **bar, "applies": self.applies, "chosen": self.chosen, "missing": self.missing
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class LawTable:
    """The laws of a curve at a preload, and their spread.

    Attributes:
        rows: one for each law, those without a law last.
        choice: the law of the vibration.
        bar: error bar of the force over the force at the preload; NaN for a curve without one.

    Examples:
        >>> delta = np.linspace(0.0, 1e-8, 21)
        >>> result = asp.run_dynamics({"delta": delta, "force": 2e9 * delta**1.5}, units="SI", models=["exact"],
        ...                           omega=(0.9, 1.0), sweeps=False, bands=False)
        >>> for row in result.laws.rows:
        ...     print(row.name, f"{row.n:.3f}", row.chosen, f"{row.stiffness:.4g}")
        table 1.500 True 2.381e+05
        paper 1.500 False 2.381e+05
        unload-reload nan False nan
        elastic nan False nan
        >>> f"{result.laws.spread:.1%}"
        '0.0%'
    """

    rows: tuple[LawAtLoad, ...]
    choice: Choice
    bar: float

    @property
    def chosen(self) -> LawAtLoad:
        """Row of the law of the vibration."""
        return next(row for row in self.rows if row.chosen)

    @property
    def spread(self) -> float:
        """Largest less smallest stiffness of the laws that apply, over that of the chosen one."""
        known = [row.stiffness for row in self.rows if row.applies]
        return (max(known) - min(known)) / self.chosen.stiffness

    def members(self) -> tuple[Law, ...]:
        """Laws whose extremes bound the results: the chosen one and the others that apply, at the ends of their bars.

        Empty where there is no error bar and no other law.
        """
        own = [law for law in self.chosen.sides() if law is not self.chosen.law]
        return (*own, *(law for row in self.rows if row.applies and not row.chosen for law in row.sides()))

    def describe_members(self) -> str:
        """Return in words what the members are made of."""
        bars = {
            f"error bar of the {row.bar_of}, {100 * row.bar:.2g} %" for row in self.rows if row.applies and row.bar > 0
        }
        parts = sorted(bars)
        others = [row.name for row in self.rows if row.applies and not row.chosen]
        parts += [f"spread of the laws {', '.join([self.choice.name, *others])}"] if others else []
        return " and ".join(parts)

    def to_dict(self) -> dict[str, Any]:
        """Return the section "laws" of thresholds.json."""
        choice = self.choice
        return {
            "chosen": choice.name,
            "reason": choice.reason,
            "yielded": choice.yielded,
            "reached": choice.reached,
            "yields_again_at_u": choice.yields_at,
            "spread_of_k_n": self.spread,
            "error_bar_of_the_force": self.bar if math.isfinite(self.bar) else None,
            "table": [row.to_dict() for row in self.rows],
        }

    def texts(self) -> Iterator[tuple[str, ...]]:
        """Yield the rows of the printed table: law, n, kappa, stiffness, frequency, remark."""
        for row in self.rows:
            if row.law is None:
                yield (WORDS[row.name], "-", "-", "-", "-", row.missing)
                continue
            other = (
                "after a greater load" if row.name == "unload-reload" else "of the first loading, not of a vibration"
            )
            remark = "chosen" if row.chosen else "" if row.applies else other
            hertz = f"{row.frequency:.5g}" if math.isfinite(row.frequency) else "-"
            yield (WORDS[row.name], f"{row.n:.4g}", f"{row.kappa:.3g}", f"{row.stiffness:.5g}", hertz, remark)


def tabulate(history: History, choice: Choice, mass: float | None = None, *, extrapolate: bool = False) -> LawTable:
    """Return all laws of a curve at the preload of a choice.

    Args:
        history: columns of the curve.
        choice: the law of the vibration.
        mass: of what vibrates (mass), None if unknown.
        extrapolate: whether the laws continue beyond their last point.
    """
    rows = []
    for name in NAMES:
        try:
            law = choice.law if name == choice.name else law_named(history, name, choice.load, extrapolate=extrapolate)
            rows.append(_row(name, law, choice, mass))
        except AsperityError as error:
            rows.append(_row(name, None, choice, mass, _short(error)))
    applies: tuple[str, ...] = NAMES
    if choice.yielded and choice.name in AFTER_YIELD:
        # an unloading from a greater force is of another history
        applies = AFTER_YIELD if choice.name == "unload-reload" or "unload" not in history.branch else ("elastic",)
    rows = [replace(row, applies=row.law is not None and row.name in applies) for row in rows]
    known = bool(np.isfinite(history.elastic_bar).any())
    for i, row in enumerate(rows):
        of_stiffness = row.name == "elastic" and known
        bar = history.bar_at(choice.load, elastic=of_stiffness)
        rows[i] = replace(row, bar=bar, bar_of="k_n_elastic" if of_stiffness else "force")
    rows.sort(key=lambda row: (row.law is None, not row.chosen))
    return LawTable(tuple(rows), choice, history.bar_at(choice.load))


def _row(name: str, law: Law | None, choice: Choice, mass: float | None, missing: str = "") -> LawAtLoad:
    if law is None:
        nan = math.nan
        return LawAtLoad(name, None, nan, nan, nan, nan, nan, applies=False, chosen=False, missing=missing)
    z = law.deflection(choice.load)
    stiffness = law.derivatives(z)[0]
    frequency = math.nan if mass is None else math.sqrt(stiffness / mass) / (2 * math.pi)
    chosen = name == choice.name
    return LawAtLoad(name, law, law.n_loc(z), law.kappa(z), z, stiffness, frequency, applies=chosen, chosen=chosen)


def _short(error: AsperityError) -> str:
    """Return the first clause of a message."""
    return str(error).split(":")[0].split(";")[0]


def stiffened(law: Law, factor: float) -> Law:
    """Return a law with the stiffness at each force multiplied by a factor, if that is what it is made of.

    Above the greatest force met, and where a law is made of forces, the force is multiplied.
    """
    match law:
        case TangentLaw():
            return replace(law, z=law.z / factor, k=law.k * factor, origin=0.0)
        case TwoBranchLaw():
            return TwoBranchLaw(stiffened(law.below, factor), law.above, law.reached)
    return scaled(law, factor)


def scaled(law: Law, factor: float) -> Law:
    """Return a law with its force multiplied by a factor.

    Raises:
        InputError: the law is of another kind than those of a curve.
    """
    if factor == 1.0:
        return law
    match law:
        case TangentLaw():
            return replace(law, F=law.F * factor, k=law.k * factor, origin=0.0)
        case TableLaw():
            return replace(law, F=law.F * factor, origin=0.0)
        case PowerLaw():
            return replace(law, K=law.K * factor, ci_K=None, ci_n=None)
        case TwoBranchLaw():
            below, above = scaled(law.below, factor), scaled(law.above, factor)
            return TwoBranchLaw(below, above, law.reached * factor)
    raise InputError(f"a law of the kind {type(law).__name__} cannot be scaled")
