# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""All laws of a curve side by side: exponent, backbone curvature, stiffness and frequency at one preload."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from asperity.dynamics.columns import CurveColumns
from asperity.dynamics.intervals import Interval, ensemble, law_intervals
from asperity.dynamics.law.law import Law
from asperity.dynamics.law.power import PowerLaw
from asperity.dynamics.law.table import TableLaw
from asperity.dynamics.law_of_curve import Choice, law_named
from asperity.dynamics.settings import NAMES
from asperity.errors import AsperityError
from asperity.units import plus_minus, quantity

# name -> words, and a remark where it does not apply
WORDS = {
    "unload-reload": ("unload-reload branch", "after a greater load"),
    "elastic": ("elastic tangent", "before any greater load"),
    "table": ("points of the loading", "of the first loading, not of a vibration"),
    "paper": ("power law of the loading (the paper's)", "of the first loading, not of a vibration"),
}


@dataclass(frozen=True, eq=False)
class LawAtLoad:
    """One law of a curve at a preload.

    Attributes:
        name: of the law, see `law_from`
        law: the law; None where the curve does not have it
        known: its "n_loc", "kappa", "z_s" (length) and "k_n" (force/length), see `law_intervals`; empty without a law
        mass: of what vibrates (mass), NaN if unknown
        applies: whether the law describes small vibration about this preload. After yield only the chosen one does,
            unless it is one of the loading.
        chosen: whether it is the law of the vibration
        missing: why there is no law, or ""
        bar: error bar at the preload as a share: of the elastic stiffness where the law is made of it and the curve has
            it, else of the force; NaN for a curve without one
        bar_of: what the bar is of, "force" or "k_n_elastic"
    """

    name: str
    law: Law | None
    known: Mapping[str, Interval] = field(default_factory=dict)
    mass: float = math.nan
    applies: bool = False
    chosen: bool = False
    missing: str = ""
    bar: float = math.nan
    bar_of: str = "force"

    @property
    def stiffness(self) -> float:
        """Stiffness k_n at the preload (force/length)."""
        return self.known["k_n"].value

    @property
    def stiffness_bar(self) -> float:
        """Error bar of the stiffness over it, by error bar, other laws and points; NaN if nothing bounds it."""
        return self.known["k_n"].half / self.stiffness or math.nan

    @property
    def frequency(self) -> float:
        """Frequency of small vibration, sqrt(k_n/m)/(2 pi) (1/time); NaN without a mass."""
        return math.sqrt(self.stiffness / self.mass) / (2 * math.pi)

    def sides(self) -> tuple[Law, ...]:
        """Law at both ends of its error bar; without a bar the laws within the misfit of a fit, or none."""
        law, factors = self.law, (1.0 - self.bar, 1.0 + self.bar)
        if not self.bar > 0:
            return ensemble(law) if isinstance(law, PowerLaw) and law.ci_n and law.ci_K else ()
        if isinstance(law, TableLaw) and self.bar_of == "k_n_elastic":
            return tuple(law.scaled(1.0, factor) for factor in factors)
        return tuple(law.scaled(factor) for factor in factors) if isinstance(law, (TableLaw, PowerLaw)) else ()

    def to_dict(self) -> dict[str, Any]:
        """Row as plain values, None where unknown; `*_bar` is half the width of an interval."""
        out: dict[str, float] = dict.fromkeys(("n", "kappa", "z_s", "k_n", "f"), math.nan)
        for name, interval in self.known.items():
            key = name.removesuffix("_loc")
            out |= {key: interval.value, f"{key}_bar": interval.half}
        if self.known:
            out |= {"f": self.frequency, "f_bar": 0.5 * self.stiffness_bar * self.frequency}
        known = {n: v if math.isfinite(v) else None for n, v in (out | {"bar": self.bar}).items()}
        last = {"bar_of": self.bar_of, "applies": self.applies, "chosen": self.chosen, "missing": self.missing}
        return {"law": self.name, **known, **last}


@dataclass(frozen=True, eq=False)
class LawTable:
    """The laws of a curve at a preload, and their spread.

    Attributes:
        rows: one for each law, the chosen one first, those without a law last
        choice: the law of the vibration
        bar: error bar of the force over the force at the preload; NaN for a curve without one
    """

    rows: tuple[LawAtLoad, ...]
    choice: Choice
    bar: float

    @property
    def chosen(self) -> LawAtLoad:
        """Row of the law of the vibration."""
        return self.rows[0]

    @property
    def spread(self) -> float:
        """Largest less smallest stiffness of the laws that apply, over that of the chosen one."""
        known = [row.stiffness for row in self.rows if row.applies]
        return (max(known) - min(known)) / self.chosen.stiffness

    def members(self) -> tuple[Law, ...]:
        """Laws whose extremes bound the results: the chosen one and the others that apply, at the ends of their bars.

        Empty where there is no error bar and no other law.
        """
        own = self.chosen.sides() if self.chosen.bar > 0 else ()
        others = [row for row in self.rows if row.applies and not row.chosen and row.law is not None]
        sides = [law for row in others for law in (row.sides() if row.bar > 0 else (row.law,)) if law is not None]
        return (*own, *self.choice.bounds, *sides)

    def describe_members(self) -> str:
        """In words what the members are made of."""
        bars = {
            f"error bar of the {row.bar_of}, {100 * row.bar:.2g} %" for row in self.rows if row.applies and row.bar > 0
        }
        parts = sorted(bars)
        parts += ["unknown branch of the overload"] if self.choice.bounds else []
        others = [row.name for row in self.rows if row.applies and not row.chosen]
        parts += [f"spread of the laws {', '.join([self.choice.name, *others])}"] if others else []
        return " and ".join(parts)

    def to_dict(self) -> dict[str, Any]:
        """Section "laws" of thresholds.json."""
        choice, bar = self.choice, self.chosen.stiffness_bar
        return {
            "chosen": choice.name,
            "reason": choice.reason,
            "doubt": choice.note,
            "yielded": choice.yielded,
            "reached": choice.reached,
            "yields_again_at_u": choice.yields_at,
            "spread_of_k_n": self.spread,
            "error_bar_of_the_force": self.bar if math.isfinite(self.bar) else None,
            "error_bar_of_k_n": bar if math.isfinite(bar) else None,
            "table": [row.to_dict() for row in self.rows],
        }

    def texts(self) -> Iterator[tuple[str, ...]]:
        """Rows of the printed table: law, n, kappa, stiffness, frequency, remark."""
        for row in self.rows:
            words, other = WORDS[row.name]
            if row.law is None:
                yield (words, "-", "-", "-", "-", row.missing)
                continue
            remark = "chosen" if row.chosen else "" if row.applies else other
            n, kappa = (plus_minus(row.known[name].value, row.known[name].half) for name in ("n_loc", "kappa"))
            hertz = quantity(row.frequency, "", 5, bar=0.5 * row.stiffness_bar)
            stiffness = quantity(row.stiffness, "", 5, bar=row.stiffness_bar)
            yield (words, n, kappa, stiffness, hertz if math.isfinite(row.frequency) else "-", remark)


def tabulate(columns: CurveColumns, choice: Choice, mass: float = math.nan, *, extrapolate: bool = False) -> LawTable:
    """All laws of a curve at the preload of the chosen one; `extrapolate` continues them beyond their last point."""
    rows, load = [], choice.load
    for name in NAMES:
        chosen = name == choice.name
        try:
            law = choice.law if chosen else law_named(columns, name, load, extrapolate=extrapolate)
            row = LawAtLoad(name, law, law_intervals(law, load), mass, chosen=chosen)
        except AsperityError as error:
            rows.append(LawAtLoad(name, None, missing=str(error).split(":")[0].split(";")[0]))
            continue
        # after yield the other laws are of another history
        applies = chosen or not (choice.yielded and choice.name in ("unload-reload", "elastic"))
        bar, bar_of = columns.bar_at(load, elastic=True), "k_n_elastic"
        if math.isnan(bar) or not (isinstance(law, TableLaw) and law.k is not None and not law.noise):
            bar, bar_of = columns.bar_at(load), "force"
        rows.append(replace(row, applies=applies, bar=bar, bar_of=bar_of))
    rows.sort(key=lambda row: (row.law is None, not row.chosen))
    table = LawTable(tuple(rows), choice, columns.bar_at(load))
    return replace(table, rows=tuple(_bounded(row, load, table.members() if row.chosen else ()) for row in rows))


def _bounded(row: LawAtLoad, load: float, members: tuple[Law, ...]) -> LawAtLoad:
    """Row with intervals over laws, those of its own bar by default; NaN where one does not reach the load."""
    if row.law is None:
        return row
    try:
        return replace(row, known=law_intervals(row.law, load, members or row.sides()))
    except AsperityError:
        return replace(row, known={name: Interval(one.value, math.nan, math.nan) for name, one in row.known.items()})
