"""All laws of a curve side by side: exponent, backbone curvature, stiffness and frequency at one preload."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from asperity.errors import AsperityError
from asperity.force_law import NAMES
from asperity.force_law.choice import Choice, law_named
from asperity.force_law.columns import CurveColumns
from asperity.force_law.intervals import Uncertainty, intervals
from asperity.force_law.law import Law
from asperity.force_law.table import TableLaw
from asperity.units import plus_minus, quantity

_LEAST = 1e-3  # factor of the low side of a bar

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
        law, known: the law and its intervals at the preload; None where the curve does not have it
        applies: whether it may describe small vibration about this preload, which after yield the chosen one alone does
        chosen: whether it is the law of the vibration
        missing: why there is no law, or ""
        bar, bar_of: relative error bar at the preload, NaN if unknown, and its column, "k_n_elastic" or "force"
    """

    name: str
    law: Law | None = None
    known: Uncertainty | None = None
    applies: bool = False
    chosen: bool = False
    missing: str = ""
    bar: float = math.nan
    bar_of: str = "force"

    @property
    def stiffness(self) -> float:
        """Stiffness k_n at the preload (force/length), NaN without a law."""
        return math.nan if self.known is None else self.known.k_n.value

    @property
    def stiffness_bar(self) -> float:
        """Error bar of the stiffness over it; NaN if nothing bounds it."""
        return math.nan if self.known is None else self.known.k_n.half / self.stiffness or math.nan

    @property
    def frequency(self) -> float:
        """Frequency of small vibration (1/time), NaN without a mass."""
        return math.nan if self.known is None else self.known.omega_s.value / (2 * math.pi)

    def sides(self) -> tuple[Law, ...]:
        """Law at both ends of its error bar, none without a bar."""
        return _sides(self.law, self.bar, self.bar_of)

    def to_dict(self) -> dict[str, Any]:
        """Row as plain values, None where unknown; `*_bar` is half the width of an interval."""
        out: dict[str, float] = dict.fromkeys(("n", "kappa", "z_s", "k_n", "f"), math.nan)
        if self.known is not None:
            for key, name in (("n", "n_loc"), ("kappa", "kappa"), ("z_s", "z_s"), ("k_n", "k_n")):
                interval = getattr(self.known, name)
                out |= {key: interval.value, f"{key}_bar": interval.half}
            out |= {"f": self.frequency, "f_bar": 0.5 * self.stiffness_bar * self.frequency}
        known = {n: v if math.isfinite(v) else None for n, v in (out | {"bar": self.bar}).items()}
        rest = {name: getattr(self, name) for name in ("bar_of", "applies", "chosen", "missing")}
        return {"law": self.name, **known, **rest}


@dataclass(frozen=True, eq=False)
class LawTable:
    """The laws of a curve at a preload.

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

    def to_dict(self) -> dict[str, Any]:
        """Section "laws" of thresholds.json."""
        choice, bar = self.choice, self.chosen.stiffness_bar
        return {
            "chosen": choice.name,
            "reason": choice.reason,
            "doubt": choice.note,
            "yielded": choice.yielded,
            "error_bar_of_the_force": self.bar if math.isfinite(self.bar) else None,
            "error_bar_of_k_n": bar if math.isfinite(bar) else None,
            "table": [row.to_dict() for row in self.rows],
        }


def law_rows(laws: Mapping[str, Any], stiffness: str, frequency: str) -> list[tuple[str, ...]]:
    """Laws of thresholds.json as texts, in the units given: law, n, kappa, k_n, frequency, remark."""
    rows: list[tuple[str, ...]] = []
    for row in laws["table"]:
        words, other = WORDS[row["law"]]
        if row["k_n"] is None:
            rows.append((words, "–", "–", "–", "–", row["missing"]))
            continue
        bars = {name: row.get(f"{name}_bar") or math.nan for name in ("n", "kappa", "k_n", "f")}
        shown = [plus_minus(row[name], bars[name]) for name in ("n", "kappa")]
        for name, unit in (("k_n", stiffness), ("f", frequency)):
            shown.append("–" if row[name] is None else quantity(row[name], unit, 5, bar=bars[name] / row[name]))
        rows.append((words, *shown, "chosen" if row["chosen"] else "" if row["applies"] else other))
    return rows


def tabulate(columns: CurveColumns, choice: Choice, mass: float = math.nan) -> LawTable:
    """All laws of a curve at the preload of the chosen one, for a mass on them (NaN if unknown)."""
    rows = []
    for name in NAMES:
        try:
            rows.append(law_at_load(columns, choice, name, mass))
        except AsperityError as error:
            if name == choice.name:
                raise
            rows.append(LawAtLoad(name, missing=str(error).split(":")[0].split(";")[0]))
    rows.sort(key=lambda row: (row.law is None, not row.chosen))
    return LawTable(tuple(rows), choice, columns.bar_at(choice.load))


def law_at_load(columns: CurveColumns, choice: Choice, name: str, mass: float = math.nan) -> LawAtLoad:
    """One law of a curve at the preload of the chosen one, see `tabulate`; errors as of `law_named`."""
    load, chosen = choice.load, name == choice.name
    law = choice.law if chosen else law_named(columns, name, load)
    of_force, bar, bar_of = columns.bar_at(load), columns.bar_at(load, elastic=True), "k_n_elastic"
    if math.isnan(bar) or not (isinstance(law, TableLaw) and law.k is not None and not law.noise):
        bar, bar_of = of_force, "force"
    known = intervals(law, load, _sides(law, bar, bar_of), _words(bar_of, bar), mass)
    # the points of an unloading know its stiffness too, independently of that column
    if name == "unload-reload" and bar_of == "k_n_elastic" and isinstance(law, TableLaw):
        with suppress(AsperityError):
            points = law.without_slopes()
            if sides := _sides(points, of_force, "force"):
                known = known.within(intervals(points, load, sides, _words("force", of_force), mass))
    return LawAtLoad(name, law, known, chosen or not choice.yielded, chosen, "", bar, bar_of)


def _words(of: str, bar: float) -> str:
    return f"error bar of the {of}, {100 * bar:.2g} %"


def _sides(law: Law | None, bar: float, bar_of: str) -> tuple[Law, ...]:
    """Table at both ends of an error bar of the force, or of the stiffness of its points; none without a bar.

    A power law has none: nothing bounds how far it is from the curve at the preload.
    """
    if not (isinstance(law, TableLaw) and bar > 0):
        return ()
    factors = (max(1.0 - bar, _LEAST), 1.0 + bar)  # neither a force nor a stiffness is negative
    return tuple(law.scaled(1.0, f) if bar_of == "k_n_elastic" else law.scaled(f) for f in factors)
