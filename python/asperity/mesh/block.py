"""Nodes and tetrahedra of a block: in memory, in a file, and checked against a surface; the facets of its top."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from asperity.arrays import Flags, Floats, Indices
from asperity.errors import MeshError
from asperity.mesh.element import EDGES, NODES, ON_EDGES, at_inside, outer_faces, shares, triangles_at
from asperity.runtime.display import short_repr
from asperity.runtime.files import read_npz, write_npz

if TYPE_CHECKING:
    from asperity.surface import Surface


NEAR = 1e-9  # points closer than this coincide [L]


def heights_at(surface: Surface, x: Floats, y: Floats, width: Floats) -> Floats:
    """Heights of a surface at points (n,), each smoothed by a Gaussian of a width; exact where that is 0 [length]."""
    z = np.array(surface.height(x, y))
    blurred = width > 0.0
    z[blurred] = surface.smoothed(x[blurred], y[blurred], width[blurred])
    return z


@dataclass(frozen=True)
class BlockMesh:
    """Nodes and second-order tetrahedra of a block, in one process and before partitioning.

    Attributes:
        points: node coordinates (N, 3), base at z = 0, mean plane of the top at z = `height` [length]
        tets: node numbers of each element (M, 10) in the order of gmsh
        side: length L of the square base [length]
        height: height of the block [length]
        smoothing: standard deviation of the Gaussian that smooths the surface at each node, see `morph.lift` (N,)
            [length]; None where all heights are exact

    Examples:
        >>> from asperity.mesh.generate import build_block
        >>> from asperity.surface import Flat
        >>> build_block(Flat(L=2.0), 1.0, lambda x, y, depth: 1.0).save("block.npz")
        >>> block = BlockMesh.read("block.npz")
        >>> block.side, block.height, block.points.shape[1], block.tets.shape[1]
        (2.0, 1.0, 3, 10)
    """

    points: Floats
    tets: Indices
    side: float
    height: float
    smoothing: Floats | None = None

    __repr__ = short_repr

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Arrays of a mesh file by name."""
        arrays = {"points": self.points, "tets": self.tets}
        if self.smoothing is not None:
            arrays["smoothing"] = self.smoothing
        return {**arrays, "side": np.array(self.side), "height": np.array(self.height)}

    def heights(self, surface: Surface) -> Floats:
        """Height of the top above the base at x and y of each node (N,) [length]."""
        x, y, _ = self.points.T
        if self.smoothing is None:
            return np.asarray(self.height + surface.height(x, y) - surface.mean())
        return np.asarray(self.height + heights_at(surface, x, y, self.smoothing) - surface.mean())

    def on_top(self, surface: Surface) -> Flags:
        """Nodes on the top, whose heights follow a surface (N,)."""
        return np.asarray(np.abs(self.heights(surface) - self.points[:, 2]) < NEAR * self.side)

    @staticmethod
    def from_arrays(arrays: Mapping[str, npt.NDArray[Any]]) -> BlockMesh:
        """Build a mesh from the arrays of a mesh file.

        Raises:
            ValueError: an array is missing, or is not part of a mesh
        """
        for name, kind in (("points", np.float64), ("tets", np.int64), ("side", np.float64), ("height", np.float64)):
            if name not in arrays:
                raise ValueError(f"it has no {name}")
            if not np.can_cast(arrays[name].dtype, kind, "same_kind"):
                raise ValueError(f"its {name} are {arrays[name].dtype} instead of {kind.__name__}")
            if name in ("side", "height") and arrays[name].size != 1:
                raise ValueError(f"its {name} is {arrays[name].size} numbers instead of one")
        points, tets = arrays["points"].astype(np.float64), arrays["tets"].astype(np.int64)
        side, height = arrays["side"].item(), arrays["height"].item()
        if not (points.ndim == tets.ndim == 2 and points.shape[1] == 3 and tets.shape[1] == NODES and tets.size):
            raise ValueError(f"points {points.shape} and tets {tets.shape} should be (N, 3) and (M, {NODES})")
        if not (0 <= tets.min() and tets.max() < len(points)):
            raise ValueError(f"tets names the nodes {tets.min()} to {tets.max()} of {len(points)}")
        if not (np.all(np.isfinite(points)) and 0.0 < side < np.inf and 0.0 < height < np.inf):
            raise ValueError("points, side and height must be finite, side and height positive")
        if np.any(arrays.get("refinements", 0)):
            raise ValueError("it is to be refined, which this version does not")
        smoothing = arrays.get("smoothing")
        if smoothing is not None and not (
            smoothing.shape == (len(points),) and np.all((smoothing >= 0.0) & (smoothing < np.inf))
        ):
            raise ValueError(f"its smoothing should be {len(points)} lengths that are not negative")
        return BlockMesh(points, tets, float(side), float(height), smoothing)

    def save(self, path: str | Path) -> None:
        """Write a compressed .npz file; the suffix is added if it is missing."""
        path = Path(path)
        write_npz(path.with_name(path.name.removesuffix(".npz") + ".npz"), self.arrays().items(), compress=True)

    @staticmethod
    def read(path: str | Path) -> BlockMesh:
        """Read a file written by `save`.

        Raises:
            MeshError: the file is missing or contains something else
        """
        try:
            return BlockMesh.from_arrays(read_npz(path))
        except (OSError, ValueError) as e:
            reason = getattr(e, "strerror", None) or e
        raise MeshError(f"mesh.file: {path} is not a mesh written by asperity ({reason}); give one, or leave it out")

    def check(self, surface: Surface) -> None:
        """Check that the mesh was built for `surface` and fills the block.

        Raises:
            MeshError: side or heights differ, tetrahedra are missing or duplicated, or neighbours do not share nodes
        """
        if abs(self.side - surface.L) > NEAR * surface.L:
            raise MeshError(
                f"mesh.file: the mesh has the side {self.side:g}, the surface {surface.L:g}: use the mesh of this case"
            )
        x, y, z = self.points.T
        below = self.heights(surface) - z
        # both have the same mean, so any difference makes the mesh stick out somewhere
        above = -float(below.min())
        if above > NEAR * surface.L:
            raise MeshError(
                f"mesh.file: the top of the mesh is not this surface, it lies up to {above:.3g} above: use the mesh of "
                "this case or leave mesh.file out"
            )
        near = np.abs(np.stack([x, x - self.side, y, y - self.side, z, below])) < NEAR * surface.L
        faces = outer_faces(self.tets)
        inside = faces[~near[:, faces].all(axis=2).any(axis=0)]
        if len(inside):
            cx, cy, cz = self.points[inside[0]].mean(axis=0)
            raise MeshError(
                f"mesh.file: {len(inside)} faces inside the block do not belong to two tetrahedra, the first at "
                f"x = {cx:.4g}, y = {cy:.4g}, z = {cz:.4g}: some are missing, doubled, or do not meet face to face; "
                "mesh the case again"
            )
        a, b, c = np.moveaxis(self.points[faces[near[4, faces].all(axis=1), :3]], 1, 0)
        base = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / surface.L**2
        if abs(base - 1.0) > 1e-6:
            raise MeshError(f"mesh.file: the faces on the base cover {base:.6g} of it; mesh the case again")
        ends = np.sort(self.tets[:, EDGES[:ON_EDGES]].reshape(-1, 2), axis=1)
        edges = np.column_stack([ends, self.tets[:, 4:].ravel()])[np.lexsort(ends.T)]
        torn = (np.diff(edges, axis=0) != 0) @ np.array([2, 2, 1]) == 1
        if torn.any():
            i, j, _ = edges[np.flatnonzero(torn)[0]]
            raise MeshError(
                f"mesh.file: tetrahedra that share the edge from node {i} to {j} have different nodes on it; mesh the "
                "case again"
            )


@dataclass(frozen=True)
class Top:
    """Facets of the top of a block, in one process.

    Attributes:
        points: nodes (N, 3), in the plane and above the mean plane of the surface [L]
        faces: their numbers in each facet, ordered as in `element.FACES` (F, 6)
    """

    points: Floats
    faces: Indices

    __repr__ = short_repr


def heights_of_top(top: Top, surface: Surface, n: int, nodal: bool = False, tool: Surface | None = None) -> Floats:
    """Heights of the curved facets of the top, on the scale of the surface, at the centres of n x n cells.

    Args:
        tool: whose heights at the nodes are added, see `surface.composite`
        nodal: no point is higher than the nodes of its facet: the contact, which nodes meet, does not feel it

    Returns:
        Heights (n, n), index [iy, ix] [L]. They are those of `surface` at the nodes whose heights are exact.
    """
    faces, xy = top.faces, top.points[:, :2]
    centres = (np.arange(n) + 0.5) / n
    nodes = faces[triangles_at(centres, centres, xy, faces[:, :3]).ravel()]
    at = np.stack(np.meshgrid(centres, centres), axis=-1).reshape(-1, 2)
    inside = shares(at, *(xy[nodes[:, k]] for k in range(3)))
    z = top.points[:, 2] + surface.mean() / surface.L
    if tool is not None:
        z = z + tool.height(*(surface.L * xy.T)) / surface.L
    heights = at_inside(inside, z[nodes])
    return (np.minimum(heights, z[nodes].max(axis=1)) if nodal else heights).reshape(n, n)
