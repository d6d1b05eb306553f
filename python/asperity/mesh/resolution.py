"""Check whether the elements in the contact are small enough for the shortest waves of the surface.

A mesh whose elements are longer than some waves samples these waves at random. The difference of two such meshes does
not show the resulting error of the force, because both miss the same waves, so it gives no error bar. The error is
proportional to the height of these waves over the approach (measured in docs/accuracy.md).
"""

from __future__ import annotations

from math import floor, inf, log10
from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Floats
from asperity.errors import MeshError, ResolutionWarning, warn
from asperity.mesh.element import face_functions, outer_faces

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


def lowered_height(block: BlockMesh, surface: Surface, delta: float, composite: Surface | None = None) -> float:
    """Rms change of height by smoothing (see `morph.lift`) of the nodes that the flat would meet, over the approach."""
    x, y, z = block.points[block.on_top(surface)].T
    off = np.asarray(surface.height(x, y)) - surface.mean() + block.height - z
    return _rms_of_met(off, composite or surface, (x, y), delta)


def unfollowed_height(block: BlockMesh, surface: Surface, delta: float, composite: Surface) -> float:
    """Rms change of height of the tool in the middle of the facets that it would meet, as their nodes have it.

    The change is over the approach; it is infinite for a tip between these points.
    """
    faces = outer_faces(block.tets)
    x, y = np.moveaxis(block.points[faces[block.on_top(surface)[faces].all(axis=1)], :2], 2, 0)  # of nodes
    at = face_functions(np.full((1, 3), 1.0 / 3.0))[0]
    middle = x @ at, y @ at
    tool = [composite.height(*where) - surface.height(*where) for where in (middle, (x, y))]
    return _rms_of_met(tool[0] - tool[1] @ at, composite, middle, delta)


def _rms_of_met(off: Floats, both: Surface, at: tuple[Floats, Floats], delta: float) -> float:
    """Rms value over the approach of heights at points (n,) that are met, infinite where there is none."""
    met = off[both.height(*at) >= both.maximum()[2] - delta]
    return float(np.sqrt(np.mean(met**2))) / delta if met.size else inf


def judge_mesh(block: BlockMesh, surface: Surface, h: float, delta: float, composite: Surface | None = None) -> None:
    """Warn of a mesh with elements of size h in the contact that is off its surface or a tool, or misses waves; rank 0.

    Args:
        composite: sum of the heights of surface and tool; default those of the surface

    Raises:
        MeshError: little of what the flat, or the tool, meets is left
    """
    lowered = lowered_height(block, surface, delta, composite)
    found = [(lowered, (
        f"the elements are too large for the slopes of the surface: heights that the flat meets had to be smoothed by "
        f"{lowered:.2g} of the greatest approach (rms): reduce mesh.h_contact, or filter the surface"
    ))]  # fmt: skip
    if composite is not None and composite is not surface:
        unfollowed = unfollowed_height(block, surface, delta, composite)
        found.append((unfollowed, (
            f"the tool is finer than the mesh: between the nodes that it meets its heights differ by {unfollowed:.2g} "
            "of the greatest approach (rms) from those that the nodes have: reduce mesh.h_contact, or press deeper"
        )))  # fmt: skip
    for off, sentence in found:
        if off > MOST_LOWERED:
            raise MeshError(sentence)
        if off > ONE_MESH:
            warn(sentence, ResolutionWarning)
    if doubt := doubt_of_waves(composite or surface, h, delta):
        warn(doubt, ResolutionWarning)
