"""Second-order tetrahedral mesh of a block whose top is the exact rough surface.

The block [0, L]^2 x [0, height] is meshed flat by gmsh, fine only where the surface is reached at the largest
deflection, and every node is then moved vertically, so that all top nodes, mid-edge nodes included, lie on the
surface. The vertical map z -> z (1 + f/height), f the height above the mean plane, keeps base and sides plane.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from math import hypot
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from asperity.arrays import Floats
from asperity.errors import AsperityError, MeshError
from asperity.mesh.block import BlockMesh
from asperity.mesh.tet10 import least_jacobians
from asperity.model.settings import H_MAX, ApproachMap
from asperity.runtime import compat
from asperity.surface.base import EDGE

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.surface import Surface

BASE, SIDE_X, SIDE_Y, TOP = 1, 2, 3, 4

FLAT = 1e-12  # difference of depths below which a surface counts as touched at once [L]
#: Exponent of the size in the depth, and least size over h_contact. A spot grows with the root of the depth; where it
#: is known what was touched when, more makes the errors of the steps of a rough surface alike (docs/accuracy.md).
GRADING, GUIDED = (0.5, 0.2), (0.75, 0.15)
NEIGHBOURS = 6  # corners and edges of a facet: a margin of an element around what was touched

MODEL = "asperity"  # name of the model in gmsh
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

T = TypeVar("T")


@dataclass(frozen=True)
class Reach:
    """What a coarse solution touched: it tells a fine mesh better than the geometry where to be fine.

    Attributes:
        xy: positions of the top nodes (N, 2) [length]
        touched_at: deflection that first touched each of them, inf for never (N,) [length]
    """

    xy: Floats
    touched_at: Floats

    def depth(self, x: Floats, y: Floats) -> Floats:
        """Deflection that touches each point, the least of its NEIGHBOURS nearest nodes [length]."""
        _, nearest = cKDTree(self.xy).query(np.stack([x.ravel(), y.ravel()], axis=1), k=NEIGHBOURS)
        return self.touched_at[nearest].min(axis=1).reshape(x.shape)


@dataclass(frozen=True)
class SizeField:
    """Element size around the part of a surface that a flat reaches.

    On the surface the size is h_contact (gap/delta_max)^p, gap being the depth below the summit: a
    contact spot that has just been touched is small, so the summit needs the finest elements, while what is touched
    last only has to be as fine as h_contact. It is kept between `h_min` and h_contact there and grows by `growth` per
    unit of distance elsewhere, up to h_max.

    All lengths are in units of L and free of the round-off of other units: gmsh makes another mesh of a size that
    differs in the last digit, and the curve of a case shall not depend on whether it is in metres or micrometres.

    Attributes:
        levels: sizes on the surface, ascending (K,) [L]
        distances: horizontal distance of each node of a regular grid from where a level applies, row along y,
            column along x (n, n, K) [L]
        window: x0, y0 and side of the square the grid covers; it holds all that is reached [L]
        growth: increase of size per unit of distance
        h_max: greatest size [L]
    """

    levels: Floats
    distances: Floats
    window: tuple[float, float, float]
    growth: float
    h_max: float

    @staticmethod
    def of(
        surface: Surface,
        delta_max: float,
        h_contact: float,
        h_min: float | None = None,
        growth: float = 0.25,
        h_max: float | None = None,
        reach: ApproachMap | None = None,
        grading: tuple[float, float] | None = None,
        levels: int = 8,
        grid: int = 257,
    ) -> SizeField:
        """Build the field for a flat that moves by `delta_max` from first touch.

        The sizes are given as lengths like those of the surface. With a `reach` the deflection that touched a point
        takes the place of its depth below the summit, which is only the least deflection that can touch it. The
        `grading` is the power p and the least size over h_contact: GRADING, or GUIDED with a reach.
        """
        L = surface.L
        delta_max, h_contact = _rounded(delta_max / L), _rounded(h_contact / L)
        x0, y0, side, gap = _reached_window(surface, delta_max, grid)
        if reach is not None:
            t = np.linspace(0.0, side, grid)
            gap = np.maximum(gap, reach.depth(*np.meshgrid((x0 + t) * L, (y0 + t) * L)) / L)
        at_once = float(gap.max() - gap.min()) <= FLAT  # there is no small spot
        power, least = grading or (GRADING if reach is None else GUIDED)
        if h_min is None:  # what a reach tells of the first spots ends with the first step of the guide
            h_min = h_contact * (1.0 if at_once else min(max(least, (float(gap.min()) / delta_max) ** power), 1.0))
        else:
            h_min = min(_rounded(h_min / L), h_contact)
        sizes = np.linspace(h_min ** (1.0 / power), h_contact ** (1.0 / power), levels) ** power
        spacing = side / (grid - 1)
        distances = np.empty((grid, grid, levels))
        for k, size in enumerate(sizes):
            reached = gap <= _just_above(max((size / h_contact) ** (1.0 / power) * delta_max, float(gap.min())))
            distances[:, :, k] = distance_transform_edt(~reached) * spacing
        greatest = H_MAX if h_max is None else _rounded(h_max / L)
        return SizeField(sizes, distances, (x0, y0, side), growth, greatest)

    def at(self, x: float, y: float, depth: float) -> float:
        """Size at a point `depth` below the mean plane of the top, all in units of L."""
        x0, y0, side = self.window
        inside_x = min(max(x, x0), x0 + side)
        inside_y = min(max(y, y0), y0 + side)
        scale = (self.distances.shape[0] - 1) / side
        d = self.distances[round((inside_y - y0) * scale), round((inside_x - x0) * scale)]
        d = d + hypot(x - inside_x, y - inside_y)
        size = float(np.min(self.levels + self.growth * np.sqrt(d * d + depth * depth)))
        return min(size, self.h_max)


def _reached_window(surface: Surface, delta_max: float, grid: int) -> tuple[float, float, float, Floats]:
    """Square (x0, y0, side) around all that lies less than delta_max below the summit, and gaps on its grid.

    The square shrinks until what is reached spans a good part of it, so that a small spot is resolved too. All
    lengths are in units of L.
    """
    L, summit = surface.L, surface.maximum()[2]
    x0, y0, side = 0.0, 0.0, 1.0
    while True:
        t = np.linspace(0.0, side, grid)
        height = surface.height((x0 + t[None, :]) * L, (y0 + t[:, None]) * L)
        gap: Floats = np.asarray((summit - height) / L, dtype=np.float64)
        rows, columns = np.nonzero(gap <= _just_above(max(delta_max, float(gap.min()))))
        low = np.maximum(np.array([columns.min(), rows.min()]) - 2, 0)
        high = np.minimum(np.array([columns.max(), rows.max()]) + 2, grid - 1)
        width = int(np.max(high - low))
        if width > grid // 4:
            return x0, y0, side, gap
        spacing = side / (grid - 1)
        low = np.minimum(low, grid - 1 - width)
        x0, y0, side = x0 + low[0] * spacing, y0 + low[1] * spacing, width * spacing


def _rounded(value: float) -> float:
    """The value without the last digits, where the round-off of a change of units is."""
    return float(f"{value:.12g}")


def _just_above(limit: float) -> float:
    """A limit that values equal but for round-off do not exceed."""
    return limit * (1.0 + 1e-9) + 1e-15


def build_block(surface: Surface, height: float, size: Callable[[float, float, float], float]) -> BlockMesh:
    """Mesh the block under `surface` with gmsh; call it in one process.

    Args:
        surface: the top
        height: height of the mean plane above the base [length]
        size: element size at (x, y, depth below the top), all in units of L

    Raises:
        MeshError: a valley of the surface reaches the base
    """
    compat.require("gmsh", "python3-gmsh")
    L = surface.L
    x, y, _ = surface.maximum()
    points, tets = _flat_block(_rounded(height / L), size, (_on_edge(x / L), _on_edge(y / L)))
    points *= L
    x, y, z = points.T
    f = surface.height(x, y) - surface.mean()
    if np.min(f) <= -height:
        raise MeshError(
            f"block.height = {height:g} is less than the depth {-np.min(f):g} of the deepest valley below the mean "
            "plane: make the block higher or the surface smoother"
        )
    points[:, 2] = z * (1.0 + f / height)
    return BlockMesh(points, tets, L, height)


def _flat_block(
    height: float,
    size: Callable[[float, float, float], float],
    summit: tuple[float, float],
) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Second-order tetrahedra of a plain box with a node of the top at `summit`, where contact begins.

    All lengths are in units of L, where the tolerances of gmsh make sense.
    """
    import gmsh

    try:
        with _own_model(OPTIONS):
            box = gmsh.model.occ.addBox(0.0, 0.0, 0.0, 1.0, 1.0, height)
            point = gmsh.model.occ.addPoint(*summit, height)
            gmsh.model.occ.fragment([(3, box)], [(0, point)])
            gmsh.model.occ.synchronize()
            gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: size(x, y, height - z))
            gmsh.model.mesh.generate(3)
            gmsh.model.mesh.setOrder(2)
            tags, xyz, _ = gmsh.model.mesh.getNodes()
            _, _, connectivity = gmsh.model.mesh.getElements(3)
    except Exception as e:
        raise MeshError(f"gmsh could not mesh the block: {e}") from e
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    points = xyz.reshape(-1, 3).copy()
    for axis, end in enumerate((1.0, 1.0, height)):
        for plane in (0.0, end):
            points[np.abs(points[:, axis] - plane) < 1e-9, axis] = plane
    return points, number[connectivity[0].astype(np.int64)].reshape(-1, 10)


@contextmanager
def _own_model(options: Mapping[str, float]) -> Iterator[None]:
    """A new model of gmsh under these options and no others; a session that the caller has open is left as it was.

    Its models, current model and options stay; what is not among `options` has its default meanwhile, so that the mesh
    does not depend on what the caller has set.
    """
    import gmsh

    if not gmsh.isInitialized():
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        try:
            for option, value in options.items():
                gmsh.option.setNumber(option, value)
            gmsh.model.add(MODEL)
            yield
        finally:
            gmsh.finalize()
        return
    current = gmsh.model.getCurrent()
    beside = {name: gmsh.option.getNumber(name) for name in ("General.Terminal", "General.AbortOnError")}
    with TemporaryDirectory(prefix="asperity-") as place:
        session = str(Path(place) / "session.opt")  # gmsh writes all that differs from its defaults
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.write(session)
        try:
            gmsh.option.restoreDefaults()
            for option, value in options.items():
                gmsh.option.setNumber(option, value)
            gmsh.model.add(MODEL)
            try:
                yield
            finally:
                gmsh.model.remove()
        finally:
            gmsh.model.setCurrent(current)
            gmsh.option.restoreDefaults()
            gmsh.merge(session)
            for option, value in beside.items():
                gmsh.option.setNumber(option, value)


def _on_edge(c: float) -> float:
    """Where a summit gets its node: to the digits it is known by, and on the edge of the patch if it is near."""
    return 0.0 if c < EDGE else 1.0 if c > 1.0 - EDGE else round(c, 8)


def on_root(comm: MPI.Comm, work: Callable[[], T]) -> T | None:
    """Run `work` on rank 0; the result stays there, an error is raised on every rank."""
    result, error = None, None
    if comm.rank == 0:
        try:
            result = work()
        except AsperityError as e:
            error = e
    error = comm.bcast(error, root=0)
    if error is not None:
        raise error
    return result


def distribute(comm: MPI.Comm, block: BlockMesh | None, scale: float) -> tuple[Any, Any]:
    """Partition a block over the ranks of `comm`.

    Args:
        comm: communicator
        block: the block on rank 0, ignored elsewhere
        scale: factor on the coordinates, 1/L for a block of unit side

    Returns:
        dolfinx mesh and facet tags (BASE, SIDE_X, SIDE_Y, TOP); collective
    """
    import basix.ufl
    import ufl

    compat.start()

    from dolfinx import mesh as dmesh

    element = basix.ufl.element("Lagrange", "tetrahedron", 2, shape=(3,))
    if comm.rank == 0:
        assert block is not None
        cells = block.tets[:, compat.gmsh_to_dolfinx(10)]
        points = block.points * scale
    else:
        cells, points = np.empty((0, 10), dtype=np.int64), np.empty((0, 3))
    mesh = dmesh.create_mesh(comm, cells=cells, x=points, e=ufl.Mesh(element))  # 0.10 changed their order
    return mesh, _tag_facets(mesh)


def _tag_facets(mesh: Any) -> Any:
    """Tag the outer facets by where their midpoints lie; side length is one."""
    from dolfinx import mesh as dmesh

    tdim = mesh.topology.dim
    mesh.topology.create_connectivity(tdim - 1, tdim)
    facets = dmesh.exterior_facet_indices(mesh.topology)
    mid = dmesh.compute_midpoints(mesh, tdim - 1, facets)
    values = np.full(len(facets), TOP, dtype=np.int32)
    for axis, tag in ((0, SIDE_X), (1, SIDE_Y)):
        values[(np.abs(mid[:, axis]) < 1e-9) | (np.abs(mid[:, axis] - 1.0) < 1e-9)] = tag
    values[np.abs(mid[:, 2]) < 1e-9] = BASE
    return dmesh.meshtags(mesh, tdim - 1, facets, values)


def is_distorted(comm: MPI.Comm, block: BlockMesh | None) -> bool:
    """Whether an element of the block on rank 0 is turned inside out; collective."""
    compat.start()

    def worst() -> float:
        assert block is not None
        cells = block.tets[:, compat.gmsh_to_dolfinx(10)].astype(np.int32)
        return float(least_jacobians(block.points, cells).min())

    return bool(comm.bcast(on_root(comm, worst), root=0) <= 0.0)


def check_distortion(mesh: Any, surface: Surface) -> None:
    """Refuse a mesh with an element turned inside out; collective.

    Raises:
        MeshError: names the steepest slope of the surface there and the size of the element
    """
    x, cells = mesh.geometry.x, compat.geometry_dofmap(mesh)
    worst: tuple[float, Any] = (np.inf, None)
    if len(cells):
        jacobians = least_jacobians(x, cells)
        c = int(np.argmin(jacobians))
        corners = x[cells[c, :4]]
        worst = (float(jacobians[c]), corners)
    jacobian, corners = min(mesh.comm.allgather(worst), key=lambda w: w[0])
    if jacobian > 0.0:
        return
    L = surface.L
    cx, cy, cz = corners.mean(axis=0) * L
    size = float(np.max(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1))) * L
    slope = float(np.hypot(*surface.gradient(np.array(cx), np.array(cy))))
    raise MeshError(
        f"the surface is too steep for its mesh: at x = {cx:.4g}, y = {cy:.4g}, z = {cz:.4g} an element of size "
        f"{size:.3g} is turned inside out (slope {slope:.3g}): reduce mesh.h_contact, mesh.h_max or the roughness, or "
        "mend mesh.file"
    )
