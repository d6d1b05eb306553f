"""A line of the ledger of a run: an assumption of the model, its value, its limit and the verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

FINE, DOUBTFUL = "fine", "doubtful"
RECORD = ("name", "value", "limit", "bound", "unit", "source", "verdict", "advice", "detail", "warned")


@dataclass(frozen=True)
class Assumption:
    """A line of the ledger.

    Attributes:
        name: of the assumption
        value: in this run [unit]
        limit: that the value must not exceed, or not fall below where `least` is set [unit]
        unit: of both, empty for a ratio
        source: of the limit
        advice: what to do where it is doubtful
        detail: what else is known
        least: whether the limit is a lower one
        warns: whether a run warns of its doubt, because it violates an assumption of its own model
        warned: whether a warning of the run has the same doubt, this one or one that came before

    Examples:
        >>> line = Assumption("approach over depth", 1.2, 1.0, "", "geometry", "a smaller load")
        >>> line.verdict, describe(line.to_dict())
        ('doubtful', 'approach over depth: 1.2, at most 1; a smaller load')
    """

    name: str
    value: float
    limit: float
    unit: str
    source: str
    advice: str
    detail: str = ""
    least: bool = False
    warns: bool = False
    warned: bool = False

    @property
    def verdict(self) -> str:
        """Whether the value is within the limit: "fine" or "doubtful"."""
        slack = 1e-9 * abs(self.limit)  # rounding differs between systems of units
        fine = self.value >= self.limit - slack if self.least else self.value <= self.limit + slack
        return FINE if fine else DOUBTFUL

    def to_dict(self) -> dict[str, Any]:
        """Record of summary.json."""
        found = asdict(self) | {
            "warned": self.warned or self.warns,
            "verdict": self.verdict,
            "bound": "least" if self.least else "most",
        }
        return {name: found[name] for name in RECORD}


def describe(record: Mapping[str, Any]) -> str:
    """A record of summary.json in one line for the terminal."""
    value, limit = (f"{record[name]:.3g} {record['unit']}".rstrip() for name in ("value", "limit"))
    return f"{record['name']}: {value}, at {record['bound']} {limit}; {record['advice']}"
