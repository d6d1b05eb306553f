"""The midpoint rule of plasticity: the history extrapolated beyond each step, so that steps add up to second order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from asperity.arrays import Floats
from asperity.fem.kernels import History

GREATEST_LEAD = 2.0  # where a step is twice as long as the one before


def lead(history: float | None, here: float, after: float | None) -> tuple[float, float | None]:
    """Part of a step's plastic flow by which to extrapolate the history, and the approach it then stands for.

    The history is extrapolated half-way to the next solve, so that steps of any lengths add up to the trapezoidal
    rule. Where no solve follows, where none went before, or where a cut step fell behind the history, it stays with the
    displacement.

    Args:
        history: approach that the committed history stands for [L]; None where it is at rest
        here: approach of the step [L]
        after: approach of the next one [L]; None after the last
    """
    if after is None:
        return 0.0, None
    if history is None:
        return 0.0, here
    done = here - history
    part = min(0.5 * (after - here) / done, GREATEST_LEAD) if done > 0.0 else 0.0
    return part, here + part * max(done, 0.0)


def extrapolate(before: History, after: History, lead: float) -> History:
    """Extrapolate the plastic history beyond the step.

    Where the plastic strain is large compared with that of yield, the midpoint rule does not damp: an error of the
    direction of flow changes its sign with every step and stays, and the work it does adds up. So the flow is
    extrapolated only by the cosine of the angle to the plastic strain it adds to, which is one to second order where
    flow is steady.

    Args:
        before, after: at the beginning and at the end of the step
        lead: part of the flow
    """
    strain = before.plastic_strain
    flow = after.plastic_strain - strain
    along = _inner(flow, strain)
    sizes = np.sqrt(_inner(flow, flow) * _inner(strain, strain))
    # a point that yields for the first time has no direction yet
    part = lead * np.clip(np.divide(along, sizes, out=np.ones_like(along), where=sizes > 0.0), 0.0, 1.0)
    begin, end = before.arrays(), after.arrays()
    parts = {name: part.reshape(part.shape + (1,) * (end[name].ndim - part.ndim)) for name in end}
    return replace(after, **{name: end[name] + parts[name] * (end[name] - begin[name]) for name in end})


def _inner(a: Floats, b: Floats) -> Floats:
    """Inner products of symmetric tensors with components (..., 6)."""
    products: Floats = np.einsum("...i,...i->...", a[..., :3], b[..., :3])
    products += 2.0 * np.einsum("...i,...i->...", a[..., 3:], b[..., 3:])
    return products
