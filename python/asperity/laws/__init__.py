"""Material laws in UFL: what a law is, those that come along, and their response at a point."""

from __future__ import annotations

from asperity.laws.definition import Law, law, law_of_function
from asperity.laws.loading import load
from asperity.laws.shipped import (
    drucker_prager,
    hooke,
    j2,
    mooney_rivlin,
    neo_hookean,
    voce,
    without_flow,
)

__all__ = [
    "Law",
    "drucker_prager",
    "hooke",
    "j2",
    "law",
    "law_of_function",
    "load",
    "mooney_rivlin",
    "neo_hookean",
    "voce",
    "without_flow",
]
