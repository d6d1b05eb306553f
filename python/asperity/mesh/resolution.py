"""Whether the elements in the contact are small enough for the shortest waves of the surface.

A mesh whose elements are longer than waves takes the heights of its nodes from them at random. The force is then wrong
by an amount that two such meshes do not show, for both miss the same waves: no bar may be made of them. What waves too
short for the elements do to the force goes with their height over the approach (docs/accuracy.md has it measured).
"""

from __future__ import annotations

from math import inf, sqrt
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from asperity.surface import Surface

ELEMENTS = 1.5  # a wave needs: with fewer, two meshes do not tell its error
SHARE = 0.25  # part of the tolerance that heights left out may be of the approach
ONE_MESH = 0.05  # tolerance of a run on one mesh, for a warning
_CLOSE = 1.02  # two sizes that are one


def left_out(surface: Surface, h: float, delta: float) -> float:
    """Rms height, over the approach, of the waves too short for elements of a size.

    Args:
        surface: the top
        h: element size in the contact [length]
        delta: greatest approach [length]
    """
    return surface.short_waves(ELEMENTS * h, delta) / delta


def resolving_size(surface: Surface, delta: float, tolerance: float, largest: float) -> float:
    """Element size in the contact that leaves out no more than a tolerance of the force allows [length].

    Args:
        surface: the top
        delta: greatest approach [length]
        tolerance: relative, of the force
        largest: size up to which it matters [length]

    Returns:
        the size, found to 2 % from below; inf when `largest` will do
    """

    def enough(h: float) -> bool:
        return left_out(surface, h, delta) <= SHARE * tolerance

    if enough(largest):
        return inf
    low, high = min(surface.feature_size / (4.0 * ELEMENTS), 0.5 * largest), largest
    while high > _CLOSE * low:
        middle = sqrt(low * high)
        low, high = (middle, high) if enough(middle) else (low, middle)
    return low


def doubt_of_waves(surface: Surface, h: float, delta: float) -> str:
    """Why the force on one mesh is in doubt: waves too short for its elements; empty when there are none.

    Args:
        surface: the top
        h: element size in the contact [length]
        delta: greatest approach [length]
    """
    part = left_out(surface, h, delta)
    if part <= SHARE * ONE_MESH:
        return ""
    size = resolving_size(surface, delta, ONE_MESH, h)
    return (
        f"waves shorter than {ELEMENTS:g} elements of mesh.h_contact = {h:.3g} have an rms height of {part:.2g} of the "
        f"greatest approach, and the force may be off by about as much: {size:.2g} would resolve them, or {advice(h)}"
    )


def advice(h: float) -> str:
    """How to cut off what elements of size h [length] do not resolve, in words."""
    keys = "surface.f_max or surface.L_s, asperity measure --cutoff of a map"
    return f"cut off what is shorter than {ELEMENTS * h:.3g} ({keys})"
