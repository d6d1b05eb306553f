"""Contact formulations: Hertz, Westergaard, complementarity, tangents, penalty against exact contact."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import ELASTIC, PLASTIC, here, make_contact_solver
from element_sample import cubes, matrix_of
from scipy.optimize import brentq

from asperity import reference as ref
from asperity.adaptive.solve_contact import solve_contact
from asperity.contact import Contact, make_contact
from asperity.contact.contact_surface import ContactSurface
from asperity.curve.curve import EDGE
from asperity.fem.solid import Solid
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import distribute
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField
from asperity.model.material import Material
from asperity.model.settings import Formulation, MeshSize, SolverOptions
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.surface import Sinusoid, Surface

Array = npt.NDArray[np.float64]

NU = 0.3
EXACT = Formulation()
PENALTY = Formulation("penalty", 10.0)
NITSCHE = Formulation("nitsche")
STRETCHED = replace(PLASTIC, kinematics="finite")
EACH = pytest.mark.parametrize("formulation", [EXACT, PENALTY, NITSCHE], ids=lambda f: f.method)


def press_of(
    block: BlockMesh, surface: Surface, formulation: Formulation, material: Material = ELASTIC
) -> ContactSolver:
    return make_contact_solver(here(), surface, block, material, formulation=formulation)


# --- closed forms ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def layer(cap: Surface) -> ref.HalfSpaceContact:
    """A half-space solver with the compliance of the layer."""
    return ref.half_space_contact(cap, 128, delta_star=1e-3, height=1.0, nu=NU)


@EACH
def test_sphere_on_a_layer(cap: Surface, layer: ref.HalfSpaceContact, formulation: Formulation) -> None:
    """A contact of a tenth of the patch: force and area, and area and pressure after Hertz that belong to the force."""
    size = MeshSize(0.025, growth=0.4)
    result = solve_contact(cap, ELASTIC, delta_max=1e-3, steps=1, size=size, formulation=formulation, comm=here())
    assert result.curve.P_star[-1] == pytest.approx(layer.P_star, rel=0.003)
    assert result.curve.area_fraction[-1] == pytest.approx(layer.area_fraction, rel=0.05)
    solver, hertz = result.solver, ref.Hertz(10.0, ELASTIC.reduced_modulus)
    delta = float(hertz.approach(4.0 * solver.force))
    radius, peak = float(hertz.radius(delta)), float(hertz.peak_pressure(delta))
    area = solver.contact_surface.area_of(*solver.contact.touched())
    assert abs(area.value - 0.25 * np.pi * radius**2) < area.error < 0.2 * area.value
    corners = np.unique(solver.contact_surface.nodes[:, :3])
    r = np.hypot(*solver.solid.points[corners, :2].T)
    inside = r < 0.8 * radius
    assert inside.sum() > 10
    assert np.abs(solver.pressure[corners] - hertz.pressure(r, delta))[inside].max() < 0.05 * peak


@EACH
def test_westergaard(formulation: Formulation) -> None:
    """In closed form at each approach; a mean gap, at the pressure of the step, is free of the compression."""
    amplitude, height = 0.002, 2.0
    surface = Sinusoid(L=1.0, amplitude=amplitude, wavelength=2.0, dims=1, centre=(0.0, 0.0))
    wave = ref.Westergaard(amplitude, 2.0, ref.reduced_modulus(1.0, NU))
    compliance = height / ref.block_modulus(1.0, NU)
    how: dict[str, Any] = {"height": height, "size": MeshSize(0.12, growth=0.5, h_max=0.5), "formulation": formulation}
    curve = solve_contact(surface, ELASTIC, delta_max=1.5 * amplitude, steps=3, comm=here(), **how).curve
    mean = [
        brentq(lambda p, d=d: float(wave.approach(p)) + compliance * p - d, 0, wave.full_pressure, xtol=1e-18)
        for d in curve.delta
    ]
    np.testing.assert_allclose(curve.force, mean, rtol=0.01)
    np.testing.assert_allclose(curve.area_fraction, wave.area_fraction(mean), atol=0.02)
    np.testing.assert_allclose(curve.mean_gap, wave.mean_gap(curve.force), atol=0.004 * amplitude)
    np.testing.assert_allclose(curve.mean_pressure, curve.force / curve.area_fraction)


def test_beyond_full_contact_a_wave_answers_as_a_flat_block() -> None:
    """Between rollers, M over its height."""
    wave, size = Sinusoid(L=1.0, amplitude=0.01, dims=2), MeshSize(0.12, growth=0.6, h_max=0.4)
    curve = solve_contact(wave, ELASTIC, delta_max=0.08, steps=6, size=size, comm=here()).curve
    assert curve.area_fraction.max() > 1.0 - 1e-9
    stiffness = np.diff(curve.force)[-1] / np.diff(curve.delta)[-1]
    assert stiffness == pytest.approx(ELASTIC.confined_modulus, rel=1e-3)


# --- properties -----------------------------------------------------------------------------------------------


def test_exact_contact_neither_pulls_nor_penetrates(rough: Surface, coarse: BlockMesh) -> None:
    """Complementarity at every node: a force only where the gap is closed."""
    solver = press_of(coarse, rough, EXACT, PLASTIC)
    for delta in (0.01, 0.02, 0.03, 0.028, 0.025):
        assert solver.step(delta).converged
        nodes = solver.contact_surface.owned_nodes
        gap, force = solver.gap()[nodes], solver.nodal_force
        assert gap.min() > -1e-10
        assert force.min() >= 0.0
        assert not force[np.setdiff1d(np.arange(len(force)), nodes)].any()
        assert np.abs(gap[force[nodes] > 0]).max() < 1e-10
        assert np.sum(force > 0) > 5
        pressure = solver.pressure
        # half of an edge force goes to either corner: no tension either
        assert pressure.min() >= 0.0


def test_penalty_converges_to_hard_contact(rough: Surface, coarse: BlockMesh) -> None:
    """A flat with harder and harder springs: the force grows, by less and less."""
    forces = []
    for formulation in (*(Formulation("penalty", beta) for beta in (0.1, 1.0, 10.0, 100.0)), EXACT):
        solver = press_of(coarse, rough, formulation)
        for delta in (0.01, 0.02, 0.03):
            assert solver.step(delta).converged
        forces.append(solver.force)
    steps = np.diff(forces[:-1])
    assert np.all(steps > 0) and np.all(steps[1:] / steps[:-1] < 0.3)
    # constraints at quadrature points and at nodes are not quite the same
    assert forces[-2] == pytest.approx(forces[-1], rel=0.005)


@pytest.mark.parametrize("formulation", [EXACT, NITSCHE], ids=lambda f: f.method)
def test_a_step_too_large_is_rolled_back(rough: Surface, coarse: BlockMesh, formulation: Formulation) -> None:
    """A solve that begins inside out fails before it touches anything, and the path goes on from there."""
    solver = press_of(coarse, rough, formulation, STRETCHED)
    assert solver.step(0.002).converged
    before = deepcopy((solver.solid.u.x.array, solver.force, *solver.solid.kernels.history().arrays().values()))
    bad = 5.0 * np.random.default_rng(7).normal(size=(solver.solid.owned, 3))
    stats = solver.newton.solve(bad, 1.0)
    assert not stats.converged and stats.newton == 0 and stats.reason.startswith("diverged_f")
    solver.roll_back()
    after = solver.solid.u.x.array, solver.force, *solver.solid.kernels.history().arrays().values()
    for was, now in zip(before, after, strict=True):
        np.testing.assert_array_equal(now, was)
    assert solver.step(0.004).converged


# --- tangents -------------------------------------------------------------------------------------------------


def contact_of(block: BlockMesh, formulation: Formulation, material: Material) -> tuple[Solid, Contact]:
    solid = Solid(*distribute(here(), block, 1.0), material)
    return solid, make_contact(formulation, solid, ContactSurface(solid))


def residual(solid: Solid, contact: Contact, u: Array) -> Array:
    solid.u.x.array[:] = u.ravel()
    return contact.residual(solid.internal_force().copy())[0].ravel()


@pytest.mark.parametrize(
    ("formulation", "material"),
    [(PENALTY, ELASTIC), (PENALTY, PLASTIC), (NITSCHE, ELASTIC), (NITSCHE, PLASTIC), (NITSCHE, STRETCHED)],
    ids=["penalty", "penalty plastic", "nitsche", "nitsche plastic", "nitsche finite"],
)
def test_tangent_is_the_derivative_of_the_residual(
    coarse: BlockMesh, formulation: Formulation, material: Material
) -> None:
    """By central differences, at a state with open, closed and half-closed facets over a plastic history."""
    solid, contact = contact_of(coarse, formulation, material)
    rng = np.random.default_rng(0)
    contact.begin(float(solid.points[:, 2].max()) - 0.03)
    squeeze = solid.points @ np.diag([0.001, 0.002, -0.015])
    residual(solid, contact, 0.7 * squeeze)
    solid.kernels.commit()
    u = squeeze + 1e-3 * rng.normal(size=squeeze.shape)
    residual(solid, contact, u)
    solid.tangent.assemble(contact.add_tangent)
    J = matrix_of(solid, solid.tangent.values())
    asymmetry = abs(J - J.T).max() / abs(J).max()
    assert (asymmetry < 1e-12) == contact.symmetric  # rounding leaves 1e-16, the other formulations 1e-2
    for _ in range(3):
        du = 1e-9 * rng.normal(size=u.shape)
        slope = residual(solid, contact, u + du) - residual(solid, contact, u - du)
        found = 2.0 * J @ du.ravel()
        assert np.abs(found - slope).max() < 1e-6 * np.abs(slope).max()


def test_a_flat_that_recedes_lets_go_of_nodes_one_set_after_the_other(rough: Surface, coarse: BlockMesh) -> None:
    """The first set of a step back is that in contact; at the new height of the flat nothing would be."""
    solver = press_of(coarse, rough, EXACT, PLASTIC)
    assert solver.step(0.01).converged
    contact, force, z = solver.contact, solver.newton.now.force, solver.summit - 0.009
    held = contact.nodes()
    assert len(held) > 5
    contact.begin(z)
    contact.residual(force)
    assert not len(contact.nodes())
    contact.begin(z)
    start = solver.state().displacement
    contact.expect(solver.summit - 0.01, start, start, 1.0)
    lacking = contact.residual(force)[2]
    np.testing.assert_array_equal(contact.nodes(), held)
    np.testing.assert_allclose(lacking, 0.001, rtol=1e-6)  # up to the flat
    contact.residual(force)  # the rule of every iteration that follows
    assert not len(contact.nodes())


def test_exact_contact_needs_no_more_newton_steps_on_a_finer_mesh(wave: Surface) -> None:
    """With exact linear solves; an inexact one adds one or two."""
    taken = []
    for h in (0.12, 0.06):
        block = build_block(wave, 1.0, SizeField.of(wave, 0.01, h, growth=0.6, h_max=0.5).at)
        solver = make_contact_solver(here(), wave, block, ELASTIC, options=SolverOptions("lu"))
        taken.append([solver.step(delta).newton for delta in (0.0025, 0.005, 0.0075, 0.01)])
    assert np.median(taken[1]) <= 4
    assert sum(taken[1]) <= sum(taken[0]) + 3


# --- areas ----------------------------------------------------------------------------------------------------


def test_pressure_and_area_are_those_after_deformation(rough: Surface, coarse: BlockMesh) -> None:
    """A top that is stretched and sheared bears a uniform pressure of one on its new area; so does its error."""
    F = np.array([[1.1, 0.2, 0.0], [-0.1, 0.9, 0.0], [0.3, -0.2, 0.8]])
    for material, ratio in ((replace(ELASTIC, kinematics="finite"), 1.1 * 0.9 + 0.1 * 0.2), (ELASTIC, 1.0)):
        solid = Solid(*distribute(here(), coarse, 1.0), material)
        surface = ContactSurface(solid)
        solid.set_displacement((solid.points @ (F - np.eye(3)).T).ravel())
        np.testing.assert_allclose(surface.area_ratio(), ratio, rtol=1e-12)
        corners = np.unique(surface.nodes[:, :3])
        np.testing.assert_allclose(surface.pressure(surface.bearing_area())[corners], 1.0 / ratio, rtol=1e-12)
        weights = np.repeat(surface.area[:, None] / 3.0, 3, axis=1)
        whole = surface.area_of(np.ones(weights.shape, dtype=bool), weights)
        assert (whole.value, whole.error) == (pytest.approx(ratio * surface.area.sum()), 0.0)
        # an unknown, uniform share of each facet that is cut, independently, and a part of them all
        cut = np.zeros(weights.shape, dtype=bool)
        cut[::2, 0] = True
        shares = np.random.default_rng(1).random((20_000, len(surface.area[::2])))
        deviation = np.std(shares @ (ratio * surface.area[::2]))
        found = surface.area_of(cut, weights)
        assert found.edge == pytest.approx(ratio * surface.area[::2].sum(), rel=1e-12)
        assert found.error == pytest.approx(np.hypot(2.0 * deviation, EDGE * found.edge), rel=0.02)


def test_the_mean_over_the_top_is_exact_for_a_square() -> None:
    """The mean of x^2 over the unit square is a third; facets of second order have it exactly."""
    surface = ContactSurface(Solid(*distribute(here(), cubes(2), 1.0), ELASTIC))
    assert surface.mean(surface.solid.points[:, 0] ** 2) == pytest.approx(1.0 / 3.0, rel=1e-12)
