"""A flat that slides on the solid under a constant load: Cattaneo and Mindlin, limits, energy, Masing, ranks, yield."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import ELASTIC, PLASTIC, here, world
from scipy.integrate import trapezoid

from asperity.adaptive.solve_contact import solve_contact
from asperity.errors import InputError, Interrupted
from asperity.mesh.block import BlockMesh
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField
from asperity.model.material import Material
from asperity.model.settings import Formulation, MeshSize
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.make import make_contact_solver
from asperity.quasistatic.slip_paths import Sliding, slip_paths
from asperity.quasistatic.stiffness import Stiffness
from asperity.slip import SlipSettings
from asperity.slip.law import SlipPath
from asperity.surface import Flat, Surface

NU, MU = 0.3, 0.4


def pressed(
    surface: Surface, block: BlockMesh, material: Material = ELASTIC, delta: float = 0.02, **how: Any
) -> ContactSolver:
    solver = make_contact_solver(here(), surface, block, material, **how)
    for part in (0.5, 1.0):
        assert solver.step(part * delta).converged
    return solver


# --- closed forms ---------------------------------------------------------------------------------------------


def mindlin(cap: Surface, h: float) -> list[tuple[float, float]]:
    """Errors of force (over mu P) and energy (relative) at two amplitudes, of a sphere with a spot of radius 0.004 L.

    The compliance of the block is subtracted: what slips is the displacement beyond that of the stiffness at rest.
    """
    size = MeshSize(h_contact=h, growth=0.4, h_max=0.3)
    solver = solve_contact(cap, ELASTIC, delta_max=0.004**2 / 10.0, steps=2, size=size, comm=here()).solver
    sliding, load = Sliding(solver, MU), 4.0 * solver.force
    rest = sliding.k_rest
    a = (0.75 * load * 10.0 * (1 - NU**2)) ** (1 / 3)
    limit, G = MU * load, 0.5 / (1 + NU)
    c = 3 * limit * (2 - NU) / (16 * G * a)
    assert rest == pytest.approx(2 * G * a / (2 - NU), rel=0.01)  # of a quarter, Mindlin 1949
    found = []
    for amplitude in (0.4, 0.8):
        sliding.reset()
        path = sliding.path(amplitude, 2)
        t = path.force / (0.25 * limit)
        slipped = c * (1 - (1 - t) ** (2 / 3) - 2 * t / 3)
        tangent = 1.0 / (1.0 / rest + 8 * c / (3 * limit) * ((1 - t) ** (-1 / 3) - 1))
        force = (path.displacement - path.force / rest - slipped) * tangent / (0.25 * limit)
        energy = 1.2 * limit * c * (1 - (1 - t) ** (5 / 3) - 5 * t / 6 * (1 + (1 - t) ** (2 / 3)))
        found.append((abs(force), abs(path.energy / energy - 1.0)))
        assert path.share == pytest.approx(1 - (1 - t) ** (2 / 3), abs=0.04)  # stick radius a (1 - t)^(1/3)
    return found


def test_cattaneo_and_mindlin(cap: Surface) -> None:
    coarse, fine = mindlin(cap, 8e-4), mindlin(cap, 4e-4)
    assert max(force for force, _ in coarse + fine) < 0.003
    assert max(energy for _, energy in fine) < 0.02
    assert fine[0][1] < 0.5 * coarse[0][1]


@pytest.fixture(scope="module")
def slab() -> ContactSolver:
    size = MeshSize(h_contact=0.5, h_max=0.5)
    return solve_contact(Flat(L=1.0), ELASTIC, delta_max=0.01, steps=1, size=size, comm=here()).solver


def test_a_slab_in_full_contact_shears_and_then_slides(slab: ContactSolver) -> None:
    """Uniform pressure and shear: all slips at once, at mu P exactly, and nothing before."""
    G, sliding = 0.5 / (1 + NU), Sliding(slab, MU)
    assert sliding.k_rest == pytest.approx(G, rel=1e-6)
    far = 1.0 / G * sliding.limit
    for move, force in ((0.5, 0.5), (0.999, 0.999), (1.5, 1.0), (20.0, 1.0)):
        assert sliding.solve(move * far).converged
        assert sliding.solved_force() == pytest.approx(force * sliding.limit, rel=1e-6)
    assert slip_paths(slab, SlipSettings(MU, (0.9,), slab.force, steps=1))[0].energy == pytest.approx(
        0.0, abs=1e-12 * sliding.limit
    )


def test_the_stiffness_at_rest_is_that_of_the_stuck_contact(slab: ContactSolver) -> None:
    assert slab.solve(0.01).converged
    stuck = Stiffness(slab.solid)(slab)["k_t"]
    assert Sliding(slab, MU).k_rest == pytest.approx(stuck, rel=1e-4)


@pytest.mark.parametrize("amplitude", [0.05, 0.0005])
def test_slopes_soften_a_spot_in_shear(amplitude: float) -> None:
    """Without lateral contraction a half-space is as stiff in shear as along the normal; on a slope a spot is softer.

    The loss is proportional to the slope of the spot, about its mean pressure over E', and inside the bar.
    """
    surface = Surface.from_spec("sinusoid", L=1.0, amplitude=amplitude, dims=2)
    block = build_block(surface, 1.0, SizeField.of(surface, 0.04, 0.1, growth=0.6, h_max=0.5).at)
    solver = pressed(surface, block, Material(1.0, 0.0), delta=0.4 * amplitude)
    normal, shear = Stiffness(solver.solid)(solver)["k_n_elastic"], Sliding(solver, MU).k_rest
    softer = (1.0 / shear - 2.0) / (1.0 / normal - 1.0) - 1.0
    pressure = solver.force / solver.contact_surface.area_of(*solver.contact.touched()).value
    assert 1.5 * pressure < softer < 4.0 * pressure


# --- balances and symmetry ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def elastic(wave: Surface, wave_block: BlockMesh) -> ContactSolver:
    return pressed(wave, wave_block)


@pytest.fixture(scope="module")
def wave_block(wave: Surface) -> BlockMesh:
    return build_block(wave, 1.0, SizeField.of(wave, 0.02, 0.08, growth=0.6, h_max=0.5).at)


@pytest.fixture(scope="module")
def fine_path(elastic: ContactSolver) -> SlipPath:
    return slip_paths(elastic, SlipSettings(MU, (0.7,), elastic.force, steps=6))[0]


def test_the_work_around_a_loop_is_dissipated(elastic: ContactSolver, fine_path: SlipPath) -> None:
    assert work_around(fine_path) == pytest.approx(fine_path.energy, rel=0.02)
    assert np.all(np.diff(fine_path.dissipated) >= 0.0)
    assert np.all(np.abs(fine_path.T) <= MU * elastic.force)


def test_the_loop_is_masings(fine_path: SlipPath) -> None:
    top, bottom = fine_path.end(0), fine_path.end(1)
    assert fine_path.u[-1] == pytest.approx(fine_path.u[top], rel=3e-3)
    assert fine_path.u[bottom] == pytest.approx(-fine_path.u[top], rel=3e-3)
    half = np.interp(0.5 * (fine_path.T[top] - fine_path.T[top:bottom]), fine_path.T[: top + 1], fine_path.u[: top + 1])
    at = 0.5 * (fine_path.u[top] - fine_path.u[top:bottom])
    np.testing.assert_allclose(at, half, atol=0.01 * fine_path.u[top])


# --- yield, unloading, state ----------------------------------------------------------------------------------


def test_a_yielded_solid_slips_from_its_state_and_keeps_it(wave: Surface, wave_block: BlockMesh) -> None:
    solver = pressed(wave, wave_block, PLASTIC, delta=0.03)
    force, before = solver.force, solver.state().displacement.copy()
    history = solver.solid.kernels.history().copy()
    for part in (1.0, 0.5):
        path = slip_paths(solver, SlipSettings(MU, (0.6,), part * force, steps=4))[0]
        assert np.all(np.diff(path.dissipated) >= 0.0)
        assert path.force == pytest.approx(0.6 * MU * part * force, rel=3e-3)
        assert work_around(path) == pytest.approx(path.energy, rel=0.01)
        assert path.energy == pytest.approx(4.0 * path.dissipated[path.end(0)], rel=0.02)  # Masing
    np.testing.assert_array_equal(solver.state().displacement, before)
    np.testing.assert_array_equal(solver.solid.kernels.history().plastic_strain, history.plastic_strain)
    assert solver.step(0.031).converged


def work_around(path: SlipPath) -> float:
    """Work of the tangential force around the loop; its chords in steps of one and of two, extrapolated."""
    start = path.end(0)
    coarse, fine = (trapezoid(path.T[start::step], path.u[start::step]) for step in (2, 1))
    return float(4.0 * fine - coarse) / 3.0


@pytest.mark.parametrize(("sides", "kinematics"), [("free", "small"), ("periodic", "finite"), ("free", "finite")])
def test_loops_of_other_sides_and_finite_strain(wave: Surface, sides: str, kinematics: str) -> None:
    """Motion aslant: balance of energy, loss in each step, reversal; a Masing loop loses four times the first way."""
    size = SizeField.of(wave, 0.1, 0.2, growth=0.6, h_max=0.25 if sides == "periodic" else 0.5)
    block = build_block(wave, 1.0, size.at, periodic=sides == "periodic")
    solver = pressed(wave, block, replace(ELASTIC, kinematics=kinematics), delta=0.03, sides=sides)
    path = slip_paths(solver, SlipSettings(MU, (0.6,), solver.force, steps=3, direction=30.0))[0]
    top, bottom = path.end(0), path.end(1)
    assert work_around(path) == pytest.approx(path.energy, rel=0.01)
    assert np.all(np.diff(path.dissipated) >= 0.0)
    assert path.u[bottom] == pytest.approx(-path.u[top], rel=3e-3)
    assert path.u[-1] == pytest.approx(path.u[top], rel=3e-3)
    assert path.energy == pytest.approx(4.0 * path.dissipated[top], rel=0.02)


def test_a_solid_that_flows_settles_to_the_loop_with_its_plastic_strain_held(
    wave: Surface, wave_block: BlockMesh
) -> None:
    """At the greatest load each loop makes the solid flow less: the energy of friction falls to the held one's."""
    solver = pressed(wave, wave_block, PLASTIC, delta=0.03)
    solver.solid.kernels.restore(solver.history.copy())
    sliding = Sliding(solver, MU)
    loops = [sliding.path(0.6, 1) for _ in range(4)]
    sliding.reset()
    with solver.solid.kernels.holding():
        held = sliding.path(0.6, 1)
    excess = np.array([loop.energy / held.energy - 1.0 for loop in loops])
    assert excess[0] > 0.2
    assert np.all(np.diff(excess) < 0.0)
    assert abs(excess[-1]) < 0.2 * excess[0]
    assert loops[-1].k_secant == pytest.approx(held.k_secant, rel=0.01)


def test_what_is_refused(wave: Surface, wave_block: BlockMesh, elastic: ContactSolver) -> None:
    with pytest.raises(InputError, match=r"slip\.direction = 30"):
        slip_paths(elastic, SlipSettings(MU, (0.5,), elastic.force, direction=30.0))
    penalty = pressed(wave, wave_block, formulation=Formulation("penalty"))
    with pytest.raises(InputError, match=r"needs contact\.method"):
        slip_paths(penalty, SlipSettings(MU, (0.5,), penalty.force))
    with pytest.raises(Interrupted, match="by a signal"):
        slip_paths(elastic, SlipSettings(MU, (0.5,), elastic.force), lambda: "a signal")


@pytest.mark.mpi
@pytest.mark.usefixtures("several_ranks")
def test_ranks_find_the_same(wave: Surface) -> None:
    size, paths = MeshSize(h_contact=0.12, growth=0.6, h_max=0.4), []
    for comm in (here(), world()):
        solver = solve_contact(wave, PLASTIC, delta_max=0.02, steps=2, size=size, comm=comm).solver
        paths.append(slip_paths(solver, SlipSettings(MU, (0.6,), 0.7 * solver.force, steps=1))[0])
    alone, together = paths
    for name in ("u", "T", "dissipated", "slip_share"):
        values = getattr(alone, name)
        np.testing.assert_allclose(getattr(together, name), values, atol=1e-4 * np.abs(values).max())
