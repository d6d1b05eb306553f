"""Midpoint rule of plasticity: each step extrapolates the history, which makes the integration of second order."""

from __future__ import annotations

import numpy as np

from asperity.fem.history import History
from asperity.model.material import PAIRS

GREATEST_LEAD = 2.0  # where a step is twice as long as the one before


def extrapolation(history: float | None, here: float, after: float | None) -> tuple[float, float | None]:
    """Part of a step's plastic flow by which to extrapolate the history, and the approach of the new history [L].

    The history is extrapolated half-way to the next solve, so that steps of any lengths add up to the trapezoidal
    rule; not in the first and the last step of a loading, nor where a cut step is behind it. The approaches are those
    of the committed history, None at the beginning of a loading, of the step and of the next one, None after the last.
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
    along, flows, strains = (
        np.einsum("...i,...i,i->...", a, b, PAIRS) for a, b in ((flow, strain), (flow, flow), (strain, strain))
    )
    sizes = np.sqrt(flows * strains)
    # a point that yields for the first time has no direction yet
    part = extrapolation * np.clip(np.divide(along, sizes, out=np.ones_like(along), where=sizes > 0.0), 0.0, 1.0)
    begin, end = before.arrays(), after.arrays()
    parts = {name: part.reshape(part.shape + (1,) * (end[name].ndim - part.ndim)) for name in end}
    return History(**{name: end[name] + parts[name] * (end[name] - begin[name]) for name in end})
