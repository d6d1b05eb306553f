"""Midpoint rule of plasticity: each step extrapolates the history, which makes the integration of second order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from asperity.arrays import Floats
from asperity.fem.history import History

GREATEST_LEAD = 2.0  # where a step is twice as long as the one before


def extrapolation(history: float | None, here: float, after: float | None) -> tuple[float, float | None]:
    """Part of a step's plastic flow by which to extrapolate the history, and the approach of the new history.

    The history is extrapolated half-way to the next solve, so that steps of any lengths add up to the trapezoidal
    rule. It is not extrapolated in the first and the last step of a loading, nor where a cut step is behind it.

    Args:
        history: approach of the committed history [L]; None at the beginning of a loading
        here: approach of the step [L]
        after: approach of the next one [L]; None after the last

    Returns:
        part of the flow, in [0, GREATEST_LEAD]; approach of the extrapolated history [L], None after the last step
    """
    if after is None:
        return 0.0, None
    if history is None:
        return 0.0, here
    done = here - history
    part = min(0.5 * (after - here) / done, GREATEST_LEAD) if done > 0.0 else 0.0
    return part, here + part * max(done, 0.0)


def extrapolate(before: History, after: History, extrapolation: float) -> History:
    """Extrapolate the plastic history beyond a step by a part of its flow; the arguments are unchanged.

    Where the plastic strain is large compared with that of yield, the midpoint rule does not damp: an error of the
    direction of flow changes sign with every step and persists, and its work accumulates. So the part is multiplied by
    the cosine of the angle between the flow and the plastic strain, which is one to second order where flow is steady.
    """
    strain = before.plastic_strain
    flow = after.plastic_strain - strain
    along = _inner(flow, strain)
    sizes = np.sqrt(_inner(flow, flow) * _inner(strain, strain))
    # a point that yields for the first time has no direction yet
    part = extrapolation * np.clip(np.divide(along, sizes, out=np.ones_like(along), where=sizes > 0.0), 0.0, 1.0)
    begin, end = before.arrays(), after.arrays()
    parts = {name: part.reshape(part.shape + (1,) * (end[name].ndim - part.ndim)) for name in end}
    return replace(after, **{name: end[name] + parts[name] * (end[name] - begin[name]) for name in end})


def _inner(a: Floats, b: Floats) -> Floats:
    """Inner products of symmetric tensors with components (..., 6)."""
    products: Floats = np.einsum("...i,...i->...", a[..., :3], b[..., :3])
    products += 2.0 * np.einsum("...i,...i->...", a[..., 3:], b[..., 3:])
    return products
