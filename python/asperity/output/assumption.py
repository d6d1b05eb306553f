"""A line of the ledger of a run: an assumption of the model, its value, its limit and the verdict."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

FINE, DOUBTFUL = "fine", "doubtful"


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
        warning: sentence for a run that violates an assumption of its own model
        warned: whether a warning of the run has the same doubt, that of `warning` or one that came before

    Examples:
        >>> line = Assumption("approach over depth", 1.2, 1.0, "", "geometry", "a smaller load")
        >>> line.verdict, line.describe()
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
    warning: str = ""
    warned: bool = False

    def __post_init__(self) -> None:
        if self.warning:
            object.__setattr__(self, "warned", True)

    @property
    def verdict(self) -> str:
        """Whether the value is within the limit: "fine" or "doubtful"."""
        fine = self.value >= self.limit if self.least else self.value <= self.limit
        return FINE if fine else DOUBTFUL

    def bound(self) -> str:
        """The limit in words."""
        return f"at {'least' if self.least else 'most'} {self.limit:.3g} {self.unit}".rstrip()

    def describe(self) -> str:
        """One line for the terminal."""
        value = f"{self.value:.3g} {self.unit}".rstrip()
        return f"{self.name}: {value}, {self.bound()}; {self.advice}"

    def to_dict(self) -> dict[str, Any]:
        """Record of summary.json."""
        return {
            "name": self.name,
            "value": self.value,
            "limit": self.limit,
            "bound": "least" if self.least else "most",
            "unit": self.unit,
            "source": self.source,
            "verdict": self.verdict,
            "advice": self.advice,
            "detail": self.detail,
            "warned": self.warned,
        }


def doubtful(records: Iterable[dict[str, Any]]) -> list[Assumption]:
    """The doubtful lines among the records of summary.json."""
    names = [name for name in Assumption.__dataclass_fields__ if name not in ("least", "warning")]
    return [
        Assumption(**{name: record[name] for name in names}, least=record["bound"] == "least")
        for record in records
        if record["verdict"] == DOUBTFUL
    ]
