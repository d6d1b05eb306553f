"""Check whether the elements in the contact are small enough for the shortest waves of the surface.

A mesh whose elements are longer than some waves samples these waves at random. The difference of two such meshes does
not show the resulting error of the force, because both miss the same waves, so it gives no error bar. The error is
proportional to the height of these waves over the approach (measured in docs/accuracy.md).
"""

from __future__ import annotations

from math import floor, inf, log10
from typing import TYPE_CHECKING

import numpy as np

from asperity.errors import MeshError, ResolutionWarning, warn
from asperity.mesh.block import NEAR

if TYPE_CHECKING:
    from asperity.mesh.block import BlockMesh
    from asperity.surface import Surface

ELEMENTS = 1.5  # per wavelength: with fewer, the difference of two meshes does not show the error
SHARE = 0.25  # greatest height of unresolved waves, over the approach times the tolerance
ONE_MESH = 0.05  # error of the force accepted without a tolerance
MOST_LOWERED = 0.5  # change of height by smoothing, over the approach, beyond which the mesh is not of this surface
FINER, MOST_TRIED = 1.2, 40  # ratio and number of the sizes that are tried for one that would do


def unresolved_height(surface: Surface, h: float, delta: float) -> float:
    """Rms height of the waves too short for elements of size h, over the approach."""
    return surface.short_waves(ELEMENTS * h, delta) / delta


def doubt_of_waves(surface: Surface, h: float, delta: float) -> str:
    """Text of a warning that elements of size h do not resolve the shortest waves of the surface; empty if they do."""
    part, limit = unresolved_height(surface, h, delta), SHARE * ONE_MESH
    if part <= limit:
        return ""
    advice = []
    size = next(
        (s for s in h / FINER ** np.arange(1, MOST_TRIED) if unresolved_height(surface, s, delta) <= limit), None
    )
    if size is not None:
        digit = 10.0 ** (floor(log10(size)) - 1)
        size = floor(size / digit) * digit  # rounded down, so that it is another size and resolves them
        advice.append(f"{size:.2g} would resolve them")
    if surface.cutoff_key:
        advice.append(f"cut off short waves ({surface.cutoff_key})")
    return (
        f"waves shorter than {ELEMENTS:g} elements of mesh.h_contact = {h:.3g} have an rms height of {part:.2g} of the "
        f"greatest approach, and the force may be off by about as much{': ' if advice else ''}{', or '.join(advice)}"
    )


def lowered_height(block: BlockMesh, surface: Surface, delta: float) -> float:
    """Rms change of height by smoothing (see `morph.lift`) of the nodes that the flat would meet, over the approach."""
    x, y, z = block.points[np.abs(block.heights(surface) - block.points[:, 2]) < NEAR * surface.L].T
    exact = np.asarray(surface.height(x, y))
    met = exact >= surface.maximum()[2] - delta
    off = (exact - surface.mean() + block.height - z)[met]
    return float(np.sqrt(np.mean(off**2))) / delta if off.size else inf


def judge_mesh(block: BlockMesh, surface: Surface, h: float, delta: float) -> None:
    """Warn of a mesh with elements of size h in the contact that is off its surface, or misses waves; rank 0.

    Raises:
        MeshError: little of what the flat meets is left
    """
    off = lowered_height(block, surface, delta)
    text = (
        f"the elements are too large for the slopes of the surface: heights that the flat meets had to be smoothed by "
        f"{off:.2g} of the greatest approach (rms): reduce mesh.h_contact, or filter the surface"
    )
    if off > MOST_LOWERED:
        raise MeshError(text)
    for doubt in (text if off > ONE_MESH else "", doubt_of_waves(surface, h, delta)):
        if doubt:
            warn(doubt, ResolutionWarning)
