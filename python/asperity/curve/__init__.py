"""The curve of force over approach: its columns and file, its slopes and power law."""

from asperity.curve.curve import (
    BRANCHES,
    COLUMNS,
    DIMENSIONS,
    ELASTIC_STIFFNESSES,
    STIFFNESSES,
    UNRESOLVED,
    WITH_ERRORS,
    Curve,
)

__all__ = [
    "BRANCHES",
    "COLUMNS",
    "DIMENSIONS",
    "ELASTIC_STIFFNESSES",
    "STIFFNESSES",
    "UNRESOLVED",
    "WITH_ERRORS",
    "Curve",
]
