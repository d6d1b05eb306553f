"""The block under the surface: exact top, tags, volumes, sizes, refusals, files, ranks."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import here, make_block, make_contact_solver, top_of, world
from scipy.spatial import Delaunay

from asperity.arrays import Indices
from asperity.errors import MeshError
from asperity.fem.solid import Solid
from asperity.mesh.block import BlockMesh, heights_of_top
from asperity.mesh.distribute import check_distortion, distribute
from asperity.mesh.element import outer_faces, shares, triangles_at
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField
from asperity.model.material import Material
from asperity.model.settings import MeshSize
from asperity.runtime.parallel import on_root
from asperity.surface import Flat, Sinusoid, Sphere, Surface, WeierstrassMandelbrot

Array = npt.NDArray[Any]


def uniform(surface: Surface, size: float, height: float = 1.0) -> BlockMesh:
    return build_block(surface, height, lambda x, y, depth: size)


def solid_of(comm: Any, block: BlockMesh | None, material: Material | None = None) -> Solid:
    return Solid(*distribute(comm, block, 1.0), material or Material(1.0, 0.3))


def top_facets(block: BlockMesh) -> Indices:
    """Outer faces on no plane side or base; nodes as in FACES (K, nodes of a face)."""
    faces = outer_faces(block.tets)
    x = block.points[faces[:, :3]]
    on_plane = (
        np.abs(np.stack([x[..., 0], x[..., 0] - block.side, x[..., 1], x[..., 1] - block.side, x[..., 2]])) < 1e-9
    )
    return faces[~on_plane.all(axis=2).any(axis=0)]


# --- geometry -------------------------------------------------------------------------------------------------


def test_the_summit_is_a_node(rough: Surface, coarse: BlockMesh) -> None:
    x, y, z = rough.maximum()
    summit = np.array([x, y, z + coarse.height - rough.mean()])
    assert np.linalg.norm(coarse.points - summit, axis=1).min() < 1e-8  # it is placed to eight digits
    assert coarse.points[:, 2].max() == pytest.approx(summit[2], abs=1e-14)


def test_every_top_node_lies_on_the_surface(rough: Surface, coarse: BlockMesh) -> None:
    """Mid-edge nodes too, and no other nodes."""
    facets = top_facets(coarse)
    nodes = np.unique(facets)
    x, y, z = coarse.points.T
    expected = coarse.height + rough.height(x, y) - rough.mean()
    np.testing.assert_allclose(z[nodes], expected[nodes], rtol=0, atol=1e-14)
    below = np.setdiff1d(np.arange(len(z)), nodes)
    assert np.all(z[below] < expected[below] - 1e-3)
    edges = facets[:, 3:]
    corners = facets[:, [[0, 1], [1, 2], [2, 0]]]
    plane = coarse.points[edges, :2] - coarse.points[corners, :2].mean(axis=2)
    np.testing.assert_allclose(plane, 0, atol=1e-14)  # straight from above, curved only in height
    sag = z[edges] - z[corners].mean(axis=2)
    assert np.abs(sag).max() > 1e-3


@pytest.mark.parametrize("centre", [(0.0, 0.37), (0.61, 1.0), (1.0, 0.0), (0.0004, 0.3), (0.5, 0.9997)])
def test_a_summit_on_the_edge_of_the_patch_is_a_node(centre: tuple[float, float]) -> None:
    """Otherwise the sag of an edge would delay the first contact."""
    surface = Sphere(L=1.0, radius=2.0, centre=centre, shape="paraboloid")
    block = build_block(surface, 1.0, SizeField.of(surface, 0.01, 0.1, h_max=0.5).at)
    lost = block.height - surface.mean() - block.points[:, 2].max()
    assert 0 <= lost < 1e-5 * 0.01


def test_curved_volume_converges(wave: Surface) -> None:
    """Quadratic interpolation of the surface: third order at least."""

    def error(size: float) -> float:
        return abs(solid_of(here(), uniform(wave, size)).kernels.volumes.sum() - 1.0)

    errors = [error(size) for size in (0.4, 0.2, 0.1)]
    assert errors[0] / errors[2] > 4.0**3
    assert errors[2] < 1e-5


@pytest.mark.parametrize("kind", ["wave", "fractal"])
def test_units_do_not_matter(kind: str) -> None:
    """gmsh generates a different mesh if a size differs in the last digit."""

    def block(L: float) -> BlockMesh:
        surface: Surface = Sinusoid(L=L, amplitude=0.05 * L, dims=2)
        if kind == "fractal":
            surface = WeierstrassMandelbrot(L=L, D=2.4, G=1.36e-5 * L, seed=1)
        found = make_block(here(), surface, L, 0.02 * L, MeshSize(0.2 * L, h_max=0.6 * L))
        assert found is not None
        return found

    one = block(1.0)
    for unit in (1e-6, 2.54):
        other = block(unit)
        np.testing.assert_array_equal(other.tets, one.tets)
        np.testing.assert_allclose(other.points / unit, one.points, rtol=0, atol=1e-14)


def test_a_quadratic_top_is_exact() -> None:
    """The nodes of a flat block moved onto a quadratic, with the facets straight in x and y."""
    block = build_block(Flat(L=2.0), 3.0, lambda x, y, z: 0.3)
    x, y, z = block.points.T

    def f(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 0.01 * (x**2 - 0.5 * x * y + 0.2 * y**2 - y)

    class Quadratic(Flat):
        def height(self, x, y):
            return f(np.asarray(x), np.asarray(y))

        def mean(self) -> float:
            return 0.0

    points = np.column_stack([x, y, z + f(x, y) * (z / 3.0)])
    n = 37
    c = (np.arange(n) + 0.5) * 2.0 / n
    found = heights_of_top(top_of(replace(block, points=points), Quadratic(L=2.0)), Quadratic(L=2.0), n)
    np.testing.assert_allclose(found, f(c[None, :], c[:, None]) / 2.0, atol=1e-13)


def test_points_of_a_grid_find_the_triangle_that_holds_them() -> None:
    """Triangles of very unlike sizes; lines of the grid pass through nodes, edges lie on them, a part is outside."""
    rng = np.random.default_rng(3)
    x, y = np.arange(-4, 41) / 40.0, np.arange(41) / 40.0
    nodes = np.stack(np.meshgrid(x[4::8], y[::8]), axis=-1).reshape(-1, 2)
    points = np.concatenate([rng.random((400, 2)) ** 3, nodes])
    corners = Delaunay(points)
    found = triangles_at(x, y, points, corners.simplices)
    at = np.stack(np.meshgrid(x, y), axis=-1)
    inside = np.all((at >= points.min(axis=0)) & (at <= points.max(axis=0)), axis=-1)
    assert np.array_equal(found >= 0, inside) and 0 < np.count_nonzero(~inside) < inside.sum()
    of = points[corners.simplices[found[inside]]]
    assert shares(at[inside], *of.swapaxes(0, 1)).min() > -1e-9


# --- sizes ----------------------------------------------------------------------------------------------------


def test_size_field_is_fine_at_the_summit_and_grows_away() -> None:
    surface = Sphere(L=1.0, radius=5.0, shape="paraboloid")
    delta, h, growth, h_max = 0.004, 0.05, 0.4, 0.3  # reached up to r = 0.2
    field = SizeField.of(surface, delta, h, growth=growth, h_max=h_max)
    assert field.at(0.5, 0.5, 0.0) == pytest.approx(0.2 * h, rel=0.05)
    for r in (0.08, 0.14, 0.19):
        size = h * np.sqrt((r * r / 10) / delta)
        assert size * 0.9 < field.at(0.5 + r, 0.5, 0.0) < 1.25 * size
    assert field.at(0.5 + 0.19, 0.5, 0.0) == pytest.approx(h, rel=0.15)
    for depth in (0.05, 0.1, 0.3):
        assert field.at(0.5, 0.5, depth) == pytest.approx(min(0.2 * h + growth * depth, h_max), rel=0.05)
    assert field.at(0.0, 0.0, 0.0) == pytest.approx(h + growth * (0.5 * 2**0.5 - 0.2), rel=0.05)
    assert field.at(0.5, 0.5, 1.0) == h_max


def test_a_tiny_contact_is_resolved() -> None:
    """The grid of the field shrinks to the points that touch, here a hundred-thousandth of the area."""
    surface = Sphere(L=1.0, radius=100.0, centre=(0.3, 0.6), shape="paraboloid")
    field = SizeField.of(surface, 2e-8, 5e-4, growth=0.4)  # reached up to r = 2e-3
    assert field.at(0.3, 0.6, 0.0) == pytest.approx(1e-4, rel=0.01)
    assert field.at(0.3019, 0.6, 0.0) == pytest.approx(5e-4, rel=0.2)
    assert field.at(0.35, 0.6, 0.0) == pytest.approx(5e-4 + 0.4 * 0.048, rel=0.05)


# --- refusals -------------------------------------------------------------------------------------------------


def test_a_valley_below_the_base_is_refused() -> None:
    surface = Sphere(L=1.0, radius=0.5, centre=(0.0, 0.0), shape="paraboloid")  # mean -2/3, lowest -2
    with pytest.raises(MeshError, match=r"block\.height = 1 is less than the depth 1\.33333 .* valley"):
        uniform(surface, 0.4)


def turned(block: BlockMesh) -> BlockMesh:
    """Return the block with a corner inside it moved far across its elements."""
    points = block.points.copy()
    inner = [n for n in block.tets[:, 0] if np.all((0.2 < points[n]) & (points[n] < 0.8))]
    points[inner[0], 0] += 0.5
    return replace(block, points=points)


def test_an_element_turned_inside_out_is_refused() -> None:
    mesh, _ = distribute(here(), turned(uniform(Flat(L=1.0), 0.2)), 1.0)
    with pytest.raises(MeshError, match=r"mesh\.file: at x = .* size 0\.\d+ is turned inside out"):
        check_distortion(mesh, Flat(L=1.0))


@pytest.mark.mpi
def test_refusals_reach_every_rank() -> None:
    deep = Sphere(L=1.0, radius=0.5, centre=(0.0, 0.0), shape="paraboloid")
    with pytest.raises(MeshError, match="valley"):
        make_block(world(), deep, 1.0, 0.1, MeshSize(0.4, h_max=0.5))
    block = turned(uniform(Flat(L=1.0), 0.2)) if world().rank == 0 else None
    with pytest.raises(MeshError, match="turned inside out"):
        make_contact_solver(world(), Flat(L=1.0), block, Material(1.0, 0.3))


@pytest.mark.parametrize("change", ["missing", "doubled", "torn face", "torn edge", "sunk edge", "two blocks"])
def test_a_mesh_that_does_not_fill_its_block_is_refused(rough: Surface, coarse: BlockMesh, change: str) -> None:
    """A hole inside would be treated as a part of the top that has not touched yet."""
    tets, points = coarse.tets.copy(), coarse.points
    if change == "missing":
        tets = np.delete(tets, len(tets) // 2, axis=0)
    elif change == "doubled":
        tets = np.concatenate([tets, tets[-1:]])
    elif change == "sunk edge":
        points = points.copy()
        x, y, z = points.T
        top = np.flatnonzero(np.abs(z - coarse.height - rough.height(x, y) + rough.mean()) < 1e-9)
        points[np.intersect1d(tets[:, 4:], top)[0], 2] -= 1e-3
    elif change == "two blocks":
        tets, points = np.concatenate([tets, tets + len(points)]), np.concatenate([points, points])
    else:
        cell, node = len(tets) // 2, 0 if change == "torn face" else 4
        points = np.concatenate([points, points[tets[cell, node]][None]])
        tets[cell, node] = len(points) - 1
    wanted = {"torn edge": "different nodes", "two blocks": "cover 2 of it"}.get(
        change, "faces inside the block .* two"
    )
    with pytest.raises(MeshError, match=wanted):
        make_contact_solver(here(), rough, replace(coarse, tets=tets, points=points), Material(1.0, 0.3))


# --- files and ranks ------------------------------------------------------------------------------------------


DEFECTS: list[Any] = [
    None, b"", b"PK nonsense", pickle.dumps([1]), 3000,
    *({"points": points} for points in (np.zeros((3, 3)), np.zeros((3, 2)), np.array([["a"]]), np.array([None]))),
    {"tets": np.zeros((1, 10))}, {"side": np.ones(2)}, {"side": np.array(np.nan)}, {"height": None},
    {"refinements": np.array(1)}, {"smoothing": np.array([-1.0])}, {"smoothing": np.inf},
]  # fmt: skip


@pytest.mark.parametrize("defect", DEFECTS, ids=range(len(DEFECTS)))
def test_files_that_are_not_a_mesh_are_refused(coarse: BlockMesh, tmp_path: Path, defect: Any) -> None:
    """Missing, of another kind, cut off; or each for one array, without which the mesh is read."""
    path = tmp_path / "block.npz"
    arrays: dict[str, Any] = coarse.arrays() | {"smoothing": np.zeros(len(coarse.points))}
    if defect is not None:
        np.savez(path, **arrays)
        assert BlockMesh.read(path).smoothing is not None
    if isinstance(defect, bytes):
        path.write_bytes(defect)
    elif isinstance(defect, int):
        path.write_bytes(path.read_bytes()[:defect])
    elif defect is not None:
        (name, values), *_ = defect.items()
        if np.isscalar(values):
            arrays[name][-1], values = values, arrays[name]
        np.savez(path, **{n: v for n, v in (arrays | {name: values}).items() if v is not None})
    with pytest.raises(MeshError, match=r"mesh\.file: .*block\.npz is not a mesh written by asperity \(.+\)") as caught:
        BlockMesh.read(path)
    assert "\n" not in str(caught.value)


@pytest.mark.mpi
def test_the_ranks_have_the_same_cells_each_time() -> None:
    """A partition that depends on threads would change the last digits of a result from run to run."""
    comm = world()
    block = on_root(comm, lambda: uniform(Flat(L=1.0), 0.1))
    first, *others = (distribute(comm, block, 1.0)[0].topology.original_cell_index for _ in range(8))
    assert comm.allreduce(len(first)) >= len(first) > 0
    for numbers in others:
        np.testing.assert_array_equal(numbers, first)


# --- the session of gmsh --------------------------------------------------------------------------------------


def test_an_own_session_of_gmsh_ends_and_that_of_the_caller_is_left_alone(
    wave: Surface, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its own ends where gmsh fails, too; while another is open no block is made."""
    import gmsh

    def fail(order: int) -> None:
        raise RuntimeError("sabotage")

    with monkeypatch.context() as patch:
        patch.setattr(gmsh.model.mesh, "setOrder", fail)
        with pytest.raises(MeshError, match="gmsh could not mesh the block: sabotage"):
            uniform(wave, 0.5)
    assert not gmsh.isInitialized()
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.model.add("mine")
        with pytest.raises(MeshError, match=r"end it before by gmsh\.finalize\(\)"):
            uniform(wave, 0.5)
        assert gmsh.model.getCurrent() == "mine"
    finally:
        gmsh.finalize()
    assert len(uniform(wave, 0.5).tets) and not gmsh.isInitialized()
