# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""All laws of a curve side by side: exponent, backbone curvature, stiffness and frequency at one preload."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from asperity.dynamics.columns import CurveColumns
from asperity.dynamics.law.law import Law
from asperity.dynamics.law.power import PowerLaw
from asperity.dynamics.law.table import TableLaw
from asperity.dynamics.law_of_curve import AFTER_YIELD, Choice, law_named
from asperity.dynamics.settings import NAMES
from asperity.errors import AsperityError
from asperity.units import quantity

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
        bar: error bar at the preload as a share: of the elastic stiffness where the law is made of it and the curve has
            it, else of the force; NaN for a curve without one.
        bar_of: what the bar is of, "force" or "k_n_elastic".

    Examples:
        >>> delta = np.linspace(0.0, 1.0, 21)
        >>> result = asp.run_dynamics({"delta": delta, "force": delta**1.5}, units="SI", model="exact",
        ...                           omega=(0.9, 1.0), bands=False)
        >>> row = result.laws.rows[0]
        >>> row.name, row.chosen, row.applies, f"{row.stiffness:.3f}"
        ('table', True, True, '1.191')
    """

    name: str
    law: Law | None
    n: float = math.nan
    kappa: float = math.nan
    z_s: float = math.nan
    stiffness: float = math.nan
    frequency: float = math.nan
    applies: bool = False
    chosen: bool = False
    missing: str = ""
    bar: float = math.nan
    bar_of: str = "force"

    def sides(self) -> tuple[Law, ...]:
        """Return the law at both ends of its error bar; the law itself without one."""
        law, factors = self.law, (1.0 - self.bar, 1.0 + self.bar)
        if not self.bar > 0:
            return () if law is None else (law,)
        if isinstance(law, TableLaw) and self.bar_of == "k_n_elastic":
            return tuple(law.scaled(1.0, factor) for factor in factors)
        return tuple(law.scaled(factor) for factor in factors) if isinstance(law, (TableLaw, PowerLaw)) else ()

    def stiffness_bar(self, load: float) -> float:
        """Error bar of the stiffness at a load (force) over that stiffness, by the own bar; NaN if unknown."""
        return spread_about(self.stiffness, (law for law in self.sides() if law is not self.law), load)

    def to_dict(self) -> dict[str, Any]:
        """Return the row as plain values, None where unknown."""
        values = {"n": self.n, "kappa": self.kappa, "z_s": self.z_s, "k_n": self.stiffness, "f": self.frequency}
        known = {name: value if math.isfinite(value) else None for name, value in (values | {"bar": self.bar}).items()}
        last = {"bar_of": self.bar_of, "applies": self.applies, "chosen": self.chosen, "missing": self.missing}
        return {"law": self.name, **known, **last}


@dataclass(frozen=True, eq=False)
class LawTable:
    """The laws of a curve at a preload, and their spread.

    Attributes:
        rows: one for each law, those without a law last.
        choice: the law of the vibration.
        bar: error bar of the force over the force at the preload; NaN for a curve without one.

    Examples:
        >>> delta = np.linspace(0.0, 1e-8, 21)
        >>> result = asp.run_dynamics({"delta": delta, "force": 2e9 * delta**1.5}, units="SI", model="exact",
        ...                           omega=(0.9, 1.0), bands=False)
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

    @property
    def stiffness_bar(self) -> float:
        """Error bar of the stiffness over that of the chosen law, by its own bar and the other laws; NaN if unknown."""
        return spread_about(self.chosen.stiffness, self.members(), self.choice.load)

    def members(self) -> tuple[Law, ...]:
        """Laws whose extremes bound the results: the chosen one and the others that apply, at the ends of their bars.

        Empty where there is no error bar and no other law.
        """
        own = [law for law in self.chosen.sides() if law is not self.chosen.law]
        own += self.choice.bounds
        return (*own, *(law for row in self.rows if row.applies and not row.chosen for law in row.sides()))

    def describe_members(self) -> str:
        """Return in words what the members are made of."""
        bars = {
            f"error bar of the {row.bar_of}, {100 * row.bar:.2g} %" for row in self.rows if row.applies and row.bar > 0
        }
        parts = sorted(bars)
        parts += ["unknown branch of the overload"] if self.choice.bounds else []
        others = [row.name for row in self.rows if row.applies and not row.chosen]
        parts += [f"spread of the laws {', '.join([self.choice.name, *others])}"] if others else []
        return " and ".join(parts)

    def to_dict(self) -> dict[str, Any]:
        """Return the section "laws" of thresholds.json."""
        choice = self.choice
        return {
            "chosen": choice.name,
            "reason": choice.reason,
            "doubt": choice.note,
            "yielded": choice.yielded,
            "reached": choice.reached,
            "yields_again_at_u": choice.yields_at,
            "spread_of_k_n": self.spread,
            "error_bar_of_the_force": self.bar if math.isfinite(self.bar) else None,
            "error_bar_of_k_n": self.stiffness_bar if math.isfinite(self.stiffness_bar) else None,
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
            bar = row.stiffness_bar(self.choice.load)
            hertz = quantity(row.frequency, "", 5, bar=0.5 * bar) if math.isfinite(row.frequency) else "-"
            stiffness = quantity(row.stiffness, "", 5, bar=bar)
            yield (WORDS[row.name], f"{row.n:.4g}", f"{row.kappa:.3g}", stiffness, hertz, remark)


def tabulate(
    columns: CurveColumns, choice: Choice, mass: float | None = None, *, extrapolate: bool = False
) -> LawTable:
    """Return all laws of a curve at the preload of a choice.

    Args:
        columns: of the curve.
        choice: the law of the vibration.
        mass: of what vibrates (mass), None if unknown.
        extrapolate: whether the laws continue beyond their last point.
    """
    applies: tuple[str, ...] = NAMES
    if choice.yielded and choice.name in AFTER_YIELD:
        # an unloading from a greater force is of another history
        applies = AFTER_YIELD if choice.name == "unload-reload" or "unload" not in columns.branch else ("elastic",)
    rows = []
    for name in NAMES:
        chosen = name == choice.name
        try:
            law = choice.law if chosen else law_named(columns, name, choice.load, extrapolate=extrapolate)
            row = _row(name, law, choice.load, mass)
        except AsperityError as error:
            rows.append(LawAtLoad(name, None, missing=str(error).split(":")[0].split(";")[0]))
            continue
        of_stiffness = isinstance(law, TableLaw) and law.k is not None and not law.noise
        bar = columns.bar_at(choice.load, elastic=of_stiffness)
        if of_stiffness and math.isnan(bar):
            of_stiffness, bar = False, columns.bar_at(choice.load)
        bar_of = "k_n_elastic" if of_stiffness else "force"
        rows.append(replace(row, applies=name in applies, chosen=chosen, bar=bar, bar_of=bar_of))
    rows.sort(key=lambda row: (row.law is None, not row.chosen))
    return LawTable(tuple(rows), choice, columns.bar_at(choice.load))


def _row(name: str, law: Law, load: float, mass: float | None) -> LawAtLoad:
    z = law.deflection(load)
    k = law.derivatives(z)[0]
    frequency = math.nan if mass is None else math.sqrt(k / mass) / (2 * math.pi)
    return LawAtLoad(name, law, law.n_loc(z), law.kappa(z), z, k, frequency)


def spread_about(stiffness: float, laws: Iterable[Law], load: float) -> float:
    """Greatest relative difference of the stiffness of laws at a load [force] from a stiffness; NaN if unknown."""
    try:
        found = [law.derivatives(law.deflection(load))[0] for law in laws]
    except AsperityError:  # a law does not reach the load at the end of its bar
        return math.nan
    return max((abs(other / stiffness - 1.0) for other in found), default=math.nan)
