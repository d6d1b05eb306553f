"""Periodic sides against closed forms, a half-space of the same period, translated surfaces and other ranks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ELASTIC, make_block, stored_fields, world

from asperity import reference
from asperity.adaptive.solve_contact import solve_contact
from asperity.contact.contact_surface import ContactSurface
from asperity.errors import InputError, MeshError, ResolutionWarning
from asperity.fem.solid import Solid, gather_nodes
from asperity.mesh.block import NEAR, BlockMesh
from asperity.mesh.distribute import SIDE_X, SIDE_Y, distribute
from asperity.mesh.generate import build_block
from asperity.mesh.shared_nodes import joined
from asperity.mesh.size_field import SizeField
from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.model.settings import MeshSize, SolverOptions
from asperity.runtime import compat
from asperity.surface import Flat, HeightMap, SelfAffine, Sinusoid, Sphere, Surface

FINITE = Material(E=1.0, nu=0.3, yield_strength=0.005, tangent_modulus=0.05, kinematics="finite")
COARSE = MeshSize(h_contact=0.12)
HERE: dict[str, Any] = dict(sides="periodic", delta_max=0.02, steps=2, size=COARSE)


def wave(x: float = 0.5, y: float = 0.5) -> Sinusoid:
    return Sinusoid(L=1.0, amplitude=0.02, wavelength=1.0, dims=2, centre=(x, y))


def block_of(surface: Surface, h: float = 0.12) -> BlockMesh | None:
    return make_block(world(), surface, 1.0, 0.02, MeshSize(h_contact=h), "periodic")


# -- the mesh --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("centre", [(0.0, 0.3), (1.0, 1.0)])
def test_opposite_sides_have_the_same_nodes(centre: tuple[float, float]) -> None:
    """Also where the first contact, which is a node, lies on a side or in a corner."""
    block = build_block(wave(*centre), 0.7, lambda x, y, depth: 0.15, periodic=True)
    block.check(wave(*centre))
    same = joined(block)
    moved = block.points - block.points[same]
    assert set(np.unique(np.abs(moved[:, :2]).round(9))) == {0.0, 1.0} and np.abs(moved[:, 2]).max() < 1e-12
    for axis in (0, 1):
        ends = [np.abs(block.points[:, axis] - plane) < NEAR for plane in (0.0, 1.0)]
        assert ends[0].sum() == ends[1].sum() and not np.any(ends[1][same])


@pytest.mark.mpi
def test_cells_keep_their_coordinates_and_share_dofs() -> None:
    """Volume and top as without joining; each dof of a joined node once; no facet is left on a side."""
    surface = wave(0.2, 0.9)
    block = block_of(surface)
    mesh, tags = distribute(world(), block, 1.0, periodic=True)
    solid = Solid(mesh, tags, ELASTIC, "periodic")
    assert world().allreduce(len(tags.find(SIDE_X)) + len(tags.find(SIDE_Y))) == 0
    plain = Solid(*distribute(world(), block, 1.0), ELASTIC, "free")
    for of in (lambda s: s.kernels.volumes.sum(), lambda s: ContactSurface(s).area.sum()):
        assert world().allreduce(of(solid)) == pytest.approx(world().allreduce(of(plain)), rel=1e-12)
    nodes = world().bcast(None if block is None else len(np.unique(joined(block))))
    assert solid.dofs == 3 * nodes < plain.dofs
    numbers = np.asarray(mesh.geometry.input_global_indices)
    points = world().bcast(None if block is None else block.points)
    np.testing.assert_array_equal(mesh.geometry.x, points[numbers])
    x = mesh.geometry.x[compat.geometry_dofmap(mesh)]
    off = solid.points[solid.V.dofmap.list] - x  # a dof is at the node of one side or of the other
    np.testing.assert_allclose(off, off.round(), atol=1e-12)
    heights = gather_nodes(solid, solid.points[:, 2])
    if heights is not None:
        np.testing.assert_allclose(heights, points[:, 2], atol=1e-12)


def test_meshes_that_do_not_fit_are_refused() -> None:
    plain = build_block(wave(), 1.0, lambda x, y, depth: 0.12 + 0.3 * abs(x - 0.3))
    with pytest.raises(MeshError, match=r"nodes or faces on the sides of the mesh have no partner"):
        solve_contact(wave(), ELASTIC, block=plain, **HERE)
    coarse = build_block(Flat(L=1.0), 1.0, lambda x, y, depth: 0.5, periodic=True)
    with pytest.raises(MeshError, match=r"must be narrower than half the side 1: reduce mesh.h_max"):
        joined(coarse)


def test_sizes_pass_through_the_sides() -> None:
    """A spot at a side makes the elements at the opposite side small too, and the sizes are those of a spot inside."""
    aside, inside = (SizeField.of(wave(x, 0.5), 0.005, 0.03, periodic=True) for x in (0.02, 0.5))
    for x in (0.0, 0.1, 0.5, 0.9, 0.98, 1.0):
        for y in (0.3, 0.5, 0.9):
            assert aside.at(x, y, 0.1) == pytest.approx(inside.at((x + 0.48) % 1.0, y, 0.1), rel=0.05)
    plain, joined_sides = (
        SizeField.of(wave(0.2, 0.5), 0.005, 0.03, periodic=p).at(0.9, 0.5, 0.0) for p in (False, True)
    )
    assert plain > 1.2 * joined_sides


def test_a_periodic_map_stays_periodic_on_elements_larger_than_its_waves(tmp_path: Path) -> None:
    """Its smoothed heights are those of the surface it was sampled from."""
    rough = SelfAffine(L=1.0, H=0.8, slope=1.0, lambda_short=0.1, seed=5)
    np.savez(tmp_path / "map.npz", z=rough.grid(257), L=1.0)
    surface = HeightMap(path=tmp_path / "map.npz")
    assert surface.periodic
    block = build_block(surface, 1.0, lambda x, y, depth: 0.15, periodic=True)
    joined(block)
    assert block.smoothing is not None and block.smoothing.any()
    np.testing.assert_allclose(block.heights(surface), block.heights(rough), atol=5e-3 * np.ptp(surface.heights))


def test_sides_that_do_not_fit_are_refused() -> None:
    """A surface of another class may say that it is periodic and not be so."""

    class Ramp(Flat):
        def height(self, x: Any, y: Any) -> Any:
            return 0.01 * np.asarray(x) + 0.0 * np.asarray(y)

    with pytest.raises(MeshError, match=r"heights at opposite sides of the mesh differ by 0\.01, because the surface"):
        build_block(Ramp(L=1.0), 1.0, lambda x, y, depth: 0.15, periodic=True)


def test_elements_too_wide_for_periodic_sides_are_reduced_with_a_warning() -> None:
    with pytest.warns(ResolutionWarning, match=r"mesh\.h_max = 0\.3 is reduced to 0\.2: with block\.sides"):
        Problem.of(Flat(L=1.0), ELASTIC, delta_max=0.01, sides="periodic", size=MeshSize(h_max=0.3))
    assert SizeField.of(Flat(L=1.0), 0.01, 0.1, h_max=0.3, periodic=True).h_max == 0.2


def test_surfaces_that_are_not_periodic_are_refused() -> None:
    for surface in (Sphere(L=1.0, radius=1.0), SelfAffine(L=1.0, H=0.8, slope=0.1, lambda_short=0.1, periodic=False)):
        with pytest.raises(InputError, match=r'block\.sides = "periodic" needs a surface whose opposite edges agree'):
            Problem.of(surface, ELASTIC, delta_max=0.01, sides="periodic")


# -- the solution ----------------------------------------------------------------------------------------------


@pytest.mark.mpi
def test_a_flat_block_is_in_uniaxial_strain() -> None:
    """Joined sides keep the mean lateral strain at zero."""
    result = solve_contact(Flat(L=1.0), ELASTIC, **HERE, height=0.7, options=SolverOptions(linear="lu"))
    np.testing.assert_allclose(result.curve.force, ELASTIC.confined_modulus * result.curve.delta / 0.7, rtol=1e-12)


def test_a_wave_cut_by_the_sides_against_westergaard() -> None:
    """Plane strain; the height of the block is twice the wavelength, so its top answers like a half-space."""
    theory = reference.Westergaard(0.01, 0.5, ELASTIC.reduced_modulus)
    mean = 0.3 * theory.full_pressure
    approach = float(theory.approach(mean)) + mean / ELASTIC.confined_modulus
    surface = Sinusoid(L=1.0, amplitude=0.01, wavelength=0.5, dims=1, centre=(0.03, 0.0))
    here = HERE | {"delta_max": approach, "steps": 1, "size": MeshSize(h_contact=0.08)}
    curve = solve_contact(surface, ELASTIC, **here).curve
    assert curve.force[-1] == pytest.approx(mean, rel=0.01)
    assert curve.area_fraction[-1] == pytest.approx(float(theory.area_fraction(mean)), rel=0.03)
    assert curve.spots[-1] == 2.0


def test_a_rough_surface_against_a_half_space_of_its_period() -> None:
    """Layer of the boundary element solution with Fourier series."""
    surface = SelfAffine(L=1.0, H=0.8, slope=0.08, lambda_roll=0.7, lambda_short=0.33, seed=2)
    delta = 0.5 * (surface.maximum()[2] - surface.mean())
    exact = reference.half_space_contact(surface, 256, delta_star=delta, height=1.0, nu=0.3, sides="periodic")
    here = HERE | {"size": MeshSize(h_contact=0.05), "delta_max": delta}
    result = solve_contact(surface, ELASTIC, **here)
    assert result.checks.violated == {} and result.curve.P_star[-1] == pytest.approx(exact.P_star, rel=0.01)
    mirrored = reference.half_space_contact(surface, 256, delta_star=delta, height=1.0, nu=0.3)
    assert abs(mirrored.P_star / exact.P_star - 1.0) > 0.02


@pytest.mark.mpi
def test_multigrid_solves_joined_systems() -> None:
    """As many iterations as between rollers, about, and the solution of a factorisation."""
    surface, here = wave(0.2, 0.9), HERE | {"steps": 1, "size": MeshSize(0.2, h_max=0.2)}
    found = {
        (sides, linear): solve_contact(
            surface, ELASTIC, **here | {"sides": sides}, options=SolverOptions(linear=linear)
        )
        for sides, linear in (("periodic", "cg"), ("periodic", "lu"), ("rollers", "cg"))
    }
    ours = found["periodic", "cg"]
    np.testing.assert_allclose(ours.curve.force, found["periodic", "lu"].curve.force, rtol=1e-7)
    assert ours.counts.krylov < 1.3 * found["rollers", "cg"].counts.krylov


@pytest.mark.mpi
def test_fields_are_the_same_on_both_sides(shared_path: Path) -> None:
    result = solve_contact(wave(0.05, 0.5), ELASTIC, **HERE, snapshots=1)
    found = stored_fields(result, shared_path / "fields.vtkhdf")
    if result.block is not None and found is not None:
        same = joined(result.block)
        for values in (found["displacement"], found["pressure"]):
            np.testing.assert_allclose(values, values[same], atol=1e-15)
        assert found["pressure"][same != np.arange(len(same))].max() > 0.0


def test_force_stiffness_and_conductance_do_not_depend_on_where_the_period_begins() -> None:
    found = [
        solve_contact(wave(*at), ELASTIC, **HERE | {"size": MeshSize(h_contact=0.08)}, stiffness=True).curve
        for at in ((0.5, 0.5), (0.23, 0.87))
    ]
    assert found[1].force[-1] == pytest.approx(found[0].force[-1], rel=0.01)
    for name in ("k_n_elastic", "k_t", "conductance"):
        first, second = (getattr(curve, name)[-1] for curve in found)
        assert second == pytest.approx(first, rel=0.02), name
