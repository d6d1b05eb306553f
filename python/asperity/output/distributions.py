"""Distributions of the contact pressure and of the gap over the patch, at the load levels kept."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from asperity.arrays import Floats
from asperity.mesh.element import cross, face_functions, facet_quadrature
from asperity.output.fields import TopStates
from asperity.quasistatic.measures import TOUCHED
from asperity.runtime.files import write_csv

BINS = 50  # of equal width, from zero to the greatest value of the step
HEADER = ("step", "branch", "delta", "quantity", "low", "high", "share")


def write_distributions(path: Path, top: TopStates, side: float) -> None:
    """Write a CSV file with a row per bin, see `distributions`; rank 0 only."""
    rows = (
        (top.steps[k], top.branch[k], top.delta[k], quantity, low, high, share)
        for k, quantity, edges, shares in distributions(top, side)
        for low, high, share in zip(edges[:-1], edges[1:], shares, strict=True)
    )
    write_csv(path, HEADER, (dict(zip(HEADER, row, strict=True)) for row in rows))


def distributions(top: TopStates, side: float) -> Iterator[tuple[int, str, Floats, Floats]]:
    """Number, quantity, edges of the bins (BINS + 1,) and shares of the patch (BINS,) of each state and quantity.

    The quantity "pressure" [force/length^2] has the points in contact, "gap" [length] the others. The shares of the
    pressure add up to about the area fraction; the pressure of a facet that the edge of the contact cuts is spread over
    the facet. The order of the facets makes the shares independent of the number of ranks.
    """
    shape, weights = _facet_rule()
    a, b, c = np.moveaxis(top.points[top.faces[:, :3]], 1, 0)
    areas = np.abs(cross(b - a, c - a))
    shares = (areas[:, None] * weights / (areas.sum() * weights.sum())).ravel()
    for k in range(len(top.steps)):
        for quantity, least in (("pressure", 0.0), ("gap", TOUCHED * side)):
            values = (getattr(top, quantity)[k][top.faces] @ shape.T).ravel()
            counted = values > least
            edges = np.linspace(0.0, max(float(values.max()), least) or 1.0, BINS + 1)
            in_bins, _ = np.histogram(values[counted], edges, weights=shares[counted])
            yield k, quantity, np.asarray(edges, dtype=float), np.asarray(in_bins, dtype=float)


def _facet_rule() -> tuple[Floats, Floats]:
    """Shape functions of a facet (Q, nodes of a facet) and weights (Q,)."""
    points, weights = facet_quadrature(4, splits=2)
    return face_functions(np.column_stack([1.0 - points.sum(axis=1), points])), weights
