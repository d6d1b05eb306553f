"""Meshes that the ranks refine: shapes, volumes, faces, heights, periodic sides, and the same mesh on any ranks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import ELASTIC, here, world

import asperity as asp
from asperity.adaptive.refine import refine
from asperity.adaptive.solve_contact import solve_contact
from asperity.contact.contact_surface import gather_top
from asperity.fem.solid import Solid
from asperity.mesh.distribute import distribute
from asperity.mesh.element import AT_CORNERS, DIAGONALS, EDGES
from asperity.mesh.generate import build_block
from asperity.mesh.morph import lift
from asperity.mesh.refine import split
from asperity.mesh.top import Top, heights_of_top
from asperity.model.material import Material
from asperity.model.settings import MeshSize
from asperity.quasistatic.checkpoint import Checkpoint
from asperity.quasistatic.contact_result import ContactResult, PartialResult
from asperity.quasistatic.make import make_block
from asperity.reference import half_space_contact
from asperity.runtime.parallel import on_root
from asperity.surface import Flat, SelfAffine, Sinusoid, Sphere, Surface

Array = npt.NDArray[Any]
FLAT = Flat(L=2.0)
WAVE = Sinusoid(L=2.0, amplitude=0.02, dims=2)
ROUGH = SelfAffine(L=2.0, H=0.8, slope=0.46, lambda_roll=1.0, lambda_short=0.1, seed=5)
SIZE = MeshSize(0.25, h_max=0.4)


def press(surface: Surface, refinements: int, comm: Any, sides: str = "rollers", **options: Any) -> ContactResult:
    options = {"delta_max": 0.01, "steps": 1, "size": replace(SIZE, refinements=refinements), **options}
    return solve_contact(surface, options.pop("material", ELASTIC), height=1.5, sides=sides, comm=comm, **options)


def nodes_of(corners: Array) -> Array:
    """Nodes of straight tetrahedra with these corners (M, 4, 3)."""
    ends = corners[:, EDGES]
    return np.concatenate([corners, ends.mean(axis=2)], axis=1)


def parts_of(x: Array) -> Array:
    return x[np.arange(len(x))[:, None, None], split(x)].reshape(-1, 4, 3)


def determinants(corners: Array) -> Array:
    return np.asarray(np.linalg.det(corners[:, 1:] - corners[:, :1]))


def quality(corners: Array) -> Array:
    """Volume over that of a regular tetrahedron with the same mean square of the edges (M,)."""
    edges = corners[:, [i for i, _ in EDGES]] - corners[:, [j for _, j in EDGES]]
    squares = (edges**2).sum(axis=2).mean(axis=1)
    return np.asarray(determinants(corners) * np.sqrt(2.0) / squares**1.5)


# --- the split ------------------------------------------------------------------------------------------------


def test_the_parts_fill_a_tetrahedron_and_have_its_orientation() -> None:
    """All diagonals: some of 200 random tetrahedra have each as the shortest."""
    corners = np.random.default_rng(2).random((200, 4, 3))
    turned = determinants(corners) < 0.0
    corners[turned] = corners[turned][:, [1, 0, 2, 3]]
    x = nodes_of(corners)
    parts = split(x)
    assert len(AT_CORNERS) == 4 and {tuple(p[4, :2]) for p in parts} == {ends for ends, _ in DIAGONALS}
    eighths = determinants(parts_of(x)).reshape(-1, 8)
    np.testing.assert_allclose(eighths, np.repeat(determinants(corners)[:, None] / 8.0, 8, axis=1), rtol=1e-12)
    lengths = np.stack([np.linalg.norm(x[:, i] - x[:, j], axis=1) for (i, j), _ in DIAGONALS])
    taken = np.linalg.norm(x[np.arange(200), parts[:, 4, 0]] - x[np.arange(200), parts[:, 4, 1]], axis=1)
    np.testing.assert_allclose(taken, lengths.min(axis=0), rtol=1e-12)


def test_repeated_splits_do_not_distort() -> None:
    """With the longest diagonal the quality of the regular tetrahedron would fall from split to split."""
    corners = np.array([[[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]])
    corners *= np.sign(determinants(corners))[:, None, None]
    assert quality(corners) == pytest.approx(1.0)
    least = []
    for _ in range(4):
        corners = parts_of(nodes_of(corners))
        least.append(quality(corners).min())
    assert least[0] > 0.7 and least[-1] == pytest.approx(least[0])


def test_the_counts_are_those_of_the_refined_mesh() -> None:
    alone = here()
    block = make_block(alone, Flat(L=1.0), 1.0, 0.01, MeshSize(0.3, h_max=0.3, refinements=2))
    assert block is not None
    solid = Solid(*distribute(alone, block, 1.0, surface=Flat(L=1.0)), ELASTIC)
    assert block.counts() == (solid.nodes, len(solid.cell_nodes)) == (solid.dofs // 3, 64 * len(block.tets))


# --- the mesh -------------------------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize(("refinements", "sides"), [(2, "rollers"), (1, "periodic")])
def test_the_refined_mesh_is_a_block_under_its_surface(refinements: int, sides: str) -> None:
    """As BlockMesh.check judges it: every inner face belongs to two elements, and the top lies on the surface."""
    comm = world()
    result = press(WAVE, refinements, comm, sides)
    whole, solid = result.whole_mesh(), result.solver.solid
    volume = comm.allreduce(solid.kernels.volumes.sum())
    area = comm.allreduce(result.solver.contact_surface.area.sum())
    assert volume == pytest.approx(0.75, rel=1e-4) and area == pytest.approx(1.0, rel=1e-12)
    top = gather_top(result.solver.contact_surface, 0.75)
    if whole is not None:
        assert top is not None
        whole.check(WAVE)
        np.testing.assert_allclose(
            heights_of_top(top, WAVE, 32), heights_of_top(Top.of(whole, WAVE), WAVE, 32), atol=1e-13
        )
        summit = np.array([*WAVE.maximum()[:2], 1.5 + WAVE.maximum()[2] - WAVE.mean()])
        assert np.linalg.norm(whole.points - summit, axis=1).min() < 1e-7


@pytest.mark.mpi
@pytest.mark.usefixtures("several_ranks")
@pytest.mark.parametrize("sides", ["rollers", "periodic"])
def test_the_mesh_and_its_numbers_do_not_depend_on_the_ranks(sides: str) -> None:
    """A surface whose steep slopes have to be smoothed: the widths pass from rank to rank."""
    size = MeshSize(0.4, h_max=0.4, refinements=2)
    one, all_ = (
        press(ROUGH, 2, comm, sides, block=make_block(comm, ROUGH, 1.5, 0.01, size, sides)).whole_mesh()
        for comm in (here(), world())
    )
    if all_ is not None:
        assert one is not None
        np.testing.assert_array_equal(one.tets, all_.tets)
        np.testing.assert_allclose(one.points, all_.points, rtol=0.0, atol=1e-12)


@pytest.mark.mpi
def test_the_heights_are_those_of_the_same_mesh_lifted_in_one_process() -> None:
    comm = world()
    block = on_root(comm, lambda: build_block(FLAT, 1.5, lambda *_: 0.4, refinements=1))
    flat, lifted = (press(surface, 1, comm, block=block).whole_mesh() for surface in (FLAT, ROUGH))
    if flat is not None:
        assert lifted is not None
        points, width = lift(flat.points, flat.tets, ROUGH, 1.5)
        assert width.any()
        np.testing.assert_array_equal(flat.tets, lifted.tets)
        np.testing.assert_allclose(lifted.points, points, rtol=0.0, atol=1e-12)


# --- runs -----------------------------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.usefixtures("several_ranks")
def test_the_curve_does_not_depend_on_the_ranks() -> None:
    one, all_ = (
        press(WAVE, 1, comm, "periodic", steps=2, unload_steps=1, material=Material(1.0, 0.3, 0.05, 0.1)).curve
        for comm in (here(), world())
    )
    np.testing.assert_allclose(all_.force, one.force, rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(all_.area_fraction, one.area_fraction, rtol=1e-6, atol=1e-12)


def test_the_force_is_that_of_layer_theory() -> None:
    """Hertz contact, whose size field grows quickly; gmsh's own mesh of these sizes is off by 0.2 %."""
    alone, sphere = here(), Sphere(L=1.0, radius=100.0, centre=(0.0, 0.0), shape="paraboloid")
    delta = 0.05**2 / sphere.radius
    exact = half_space_contact(sphere, 1024, delta_star=delta, height=1.0).P_star * ELASTIC.reduced_modulus
    size = MeshSize(0.04, refinements=1)
    result = solve_contact(sphere, ELASTIC, delta_max=delta, steps=2, size=size, comm=alone)
    assert abs(result.curve.force[-1] / exact - 1.0) < 0.006 and not result.checks.violated


def test_a_run_with_a_tolerance_refines_its_meshes() -> None:
    alone = here()
    target = asp.AccuracyTarget(0.05, 200_000)
    path: dict[str, Any] = {"delta_max": 0.01, "steps": 2, "height": 1.5}
    plain, found = (
        refine(asp.Problem.of(WAVE, ELASTIC, size=MeshSize(refinements=n), **path), target, alone) for n in (0, 1)
    )
    assert found.met and found.contact.block is not None and found.contact.block.refinements == 1
    np.testing.assert_allclose(found.curve.force, plain.curve.force, rtol=0.05)


@pytest.mark.mpi
def test_a_run_is_resumed_on_other_ranks(shared_path: Path) -> None:
    """Stopped after the first step on all ranks, and continued by one of them alone."""
    alone, comm = here(), world()
    path: dict[str, Any] = {"steps": 3, "material": Material(1.0, 0.3, 0.05, 0.1), "snapshots": 1}
    straight = press(WAVE, 1, comm, **path)
    calls = iter(("", "the test"))
    with pytest.raises(PartialResult, match="stopped by the test"):
        press(WAVE, 1, comm, checkpoint=Checkpoint(shared_path, {}, comm), stop=lambda: next(calls), **path)
    if comm.rank == 0:
        continued = press(WAVE, 1, alone, checkpoint=Checkpoint(shared_path, {}, alone), **path)
        assert len(continued.curve) == len(straight.curve) and not continued.checks.violated
        np.testing.assert_allclose(continued.curve.force, straight.curve.force, rtol=1e-7)
