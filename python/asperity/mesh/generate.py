"""Tetrahedral mesh of a block whose top is a rough surface.

gmsh meshes the block [0, L]^2 x [0, height] with a flat top; `lift` moves its nodes onto the surface.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from asperity.arrays import Floats
from asperity.errors import MeshError
from asperity.mesh.block import BlockMesh
from asperity.mesh.element import DEGREE, NODES
from asperity.mesh.morph import lift
from asperity.mesh.shared_nodes import same_nodes
from asperity.mesh.size_field import rounded
from asperity.runtime import compat
from asperity.surface.base import EDGE

if TYPE_CHECKING:
    from asperity.surface import Surface

OPTIONS = {
    "General.Terminal": 0,
    "General.NumThreads": 1,
    "General.AbortOnError": 2,  # an error becomes an exception
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.Algorithm": 6,  # frontal Delaunay
    "Mesh.Algorithm3D": 10,  # HXT
}


def build_block(
    surface: Surface,
    height: float,
    size: Callable[[float, float, float], float],
    periodic: bool = False,
    touch: tuple[float, float] | None = None,
) -> BlockMesh:
    """Mesh the block under `surface` with gmsh, in one process.

    Args:
        height: height of the mean plane above the base [length]
        size: element size at (x, y, depth below the top), all in units of L
        periodic: whether opposite sides have the same nodes and faces
        touch: place of the first contact, which gets a node [length]; default the summit

    Raises:
        MeshError: gmsh fails, or see `morph.lift`

    Examples:
        >>> wave = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.01)
        >>> block = build_block(wave, 0.5, lambda x, y, depth: 0.5)
        >>> print(f"{block.points[:, 2].max():.4f}")  # the crest, above the mean plane at 0.5
        0.5100
    """
    compat.require("gmsh", "python3-gmsh")
    L = surface.L
    x, y = surface.maximum()[:2] if touch is None else touch
    points, tets = _flat_block(rounded(height / L), size, (_summit_node(x / L), _summit_node(y / L)), periodic)
    points *= L
    points, smoothing = lift(points, tets, surface, height, same_nodes(points, L) if periodic else None)
    return BlockMesh(points, tets, L, height, smoothing if smoothing.any() else None)


def _flat_block(
    height: float, size: Callable[[float, float, float], float], summit: tuple[float, float], periodic: bool
) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Nodes (N, 3) and elements (M, NODES) of a box with a node of the top at `summit`, the first contact, all in L."""
    import gmsh

    try:
        with separate_model(OPTIONS):
            box = gmsh.model.occ.addBox(0.0, 0.0, 0.0, 1.0, 1.0, height)
            images = product(*((0.0, 1.0) if periodic and c in (0.0, 1.0) else (c,) for c in summit))
            nodes = [(0, gmsh.model.occ.addPoint(*image, height)) for image in images]
            gmsh.model.occ.fragment([(3, box)], nodes)
            gmsh.model.occ.synchronize()
            if periodic:
                _match_sides(height)
            gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: size(x, y, height - z))
            gmsh.model.mesh.generate(3)
            points, tets = nodes_and_elements()
    except Exception as e:
        raise MeshError(f"gmsh could not mesh the block: {e}") from e
    for axis, end in enumerate((1.0, 1.0, height)):
        for plane in (0.0, end):
            points[np.abs(points[:, axis] - plane) < 1e-9, axis] = plane
    return points, tets


def _match_sides(height: float) -> None:
    """Let gmsh copy the meshes of the sides x = 0 and y = 0 of the unit box to the opposite ones."""
    import gmsh

    for axis in (0, 1):
        sides = []
        for plane in (0.0, 1.0):
            low, high = np.zeros(3), np.array([1.0, 1.0, height])
            low[axis] = high[axis] = plane
            inside = (*(low - 1e-6), *(high + 1e-6))  # gmsh adds its tolerance of 1e-7 to each entity
            sides.append([tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*inside, dim=2)])
        shift = np.eye(4)
        shift[axis, 3] = 1.0
        gmsh.model.mesh.setPeriodic(2, sides[1], sides[0], shift.ravel().tolist())


def nodes_and_elements() -> tuple[Floats, npt.NDArray[np.int64]]:
    """Nodes (N, 3) of the tetrahedra of the current model of gmsh, and their numbers in each element (M, NODES)."""
    import gmsh

    gmsh.model.mesh.setOrder(DEGREE)
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    _, _, connectivity = gmsh.model.mesh.getElements(3)
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    return xyz.reshape(-1, 3).copy(), number[connectivity[0].astype(np.int64)].reshape(-1, NODES)


@contextmanager
def separate_model(options: Mapping[str, float]) -> Iterator[None]:
    """Context with a session of gmsh with these options.

    Raises:
        MeshError: the caller has one
    """
    import gmsh

    if gmsh.isInitialized():
        raise MeshError("a session of gmsh is open: end it before by gmsh.finalize()")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for name, value in options.items():
            gmsh.option.setNumber(name, value)
        yield
    finally:
        gmsh.finalize()


def _summit_node(c: float) -> float:
    """Coordinate of the node at a summit [L]: rounded to its accuracy, or on the edge of the patch if near."""
    return 0.0 if c < EDGE else 1.0 if c > 1.0 - EDGE else round(c, 8)
