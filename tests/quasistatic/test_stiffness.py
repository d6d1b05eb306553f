"""Stiffness and conductance: closed forms, slopes of the curve, all formulations, any number of ranks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import ELASTIC, PLASTIC, here, make_contact_solver, world

from asperity.adaptive.solve_contact import solve_contact
from asperity.curve import ELASTIC_STIFFNESSES, STIFFNESSES
from asperity.mesh.block import BlockMesh
from asperity.mesh.generate import build_block
from asperity.model.material import Material
from asperity.model.settings import Formulation, MeshSize, SolverOptions
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.stiffness import Stiffness, without_block
from asperity.reference import Hertz
from asperity.surface import Flat, Sphere, Surface

NU = 0.3
FORMULATIONS = [Formulation(), Formulation("penalty"), Formulation("nitsche")]
EACH = pytest.mark.parametrize("formulation", FORMULATIONS, ids=lambda f: f.method)
SOLVERS = pytest.mark.parametrize("linear", ["lu", "cg"])


@pytest.fixture
def press_of(rough: Surface, coarse: BlockMesh | None) -> Callable[..., ContactSolver]:
    def make(material: Material, formulation: Formulation | None = None, **options: Any) -> ContactSolver:
        settings = SolverOptions(**options)
        return make_contact_solver(world(), rough, coarse, material, formulation=formulation, options=settings)

    return make


@EACH
def test_paraboloid(cap: Surface, formulation: Formulation) -> None:
    """A quarter of a spot of radius a in a corner: Hertz, 2 E' a, Mindlin's ratio, Holm's 4 a.

    Small spots: the walls add half a per cent to the force.
    """
    a = 0.004 * np.sqrt([0.5, 1.0])
    curve = solve_contact(
        cap, ELASTIC, delta_max=a[-1] ** 2 / 10.0, steps=2, size=MeshSize(a[-1] / 8, growth=0.4, h_max=0.3),
        formulation=formulation, comm=here(), stiffness=True,
    ).curve  # fmt: skip
    E_prime = ELASTIC.reduced_modulus
    hertz = Hertz(10.0, E_prime)
    np.testing.assert_allclose(curve.force, hertz.force(curve.delta) / 4, rtol=0.01)
    np.testing.assert_allclose(np.sqrt(curve.area_fraction * 4 / np.pi), hertz.radius(curve.delta), rtol=0.03)
    np.testing.assert_allclose(curve.max_pressure, hertz.peak_pressure(curve.delta), rtol=0.02)
    np.testing.assert_allclose(4.0 * curve.k_n, 2.0 * E_prime * a, rtol=0.02)
    np.testing.assert_allclose(curve.k_n, 1.5 * curve.force / curve.delta, rtol=0.01)  # F grows as the power 3/2
    np.testing.assert_allclose(curve.k_n_elastic, curve.k_n, rtol=0.01)
    np.testing.assert_allclose(curve.k_t_interface / curve.k_n_interface, 2.0 * (1.0 - NU) / (2.0 - NU), rtol=0.03)
    np.testing.assert_allclose(4.0 * curve.conductance, 4.0 * a, rtol=0.02)


def test_ridges_are_softer_along_than_across() -> None:
    """Of a half-space: across them plane strain, as normally, and along them antiplane shear, 1/(1 - nu) as soft."""
    ridges = Surface.from_spec("sinusoid", L=1.0, amplitude=1e-3, wavelength=0.5, dims=1)
    curve = solve_contact(
        ridges, ELASTIC, sides="periodic", delta_max=6e-4, steps=2, size=MeshSize(0.045, growth=0.5, h_max=0.3),
        comm=here(), stiffness=True,
    ).curve  # fmt: skip
    along_x, along_y = (
        without_block(k, ELASTIC.lame[1]) for k in (curve.k_t_x[-1], 2.0 * curve.k_t[-1] - curve.k_t_x[-1])
    )
    assert along_x / curve.k_n_interface[-1] == pytest.approx(1.0, abs=0.03)
    assert along_y / curve.k_n_interface[-1] == pytest.approx(1.0 - NU, abs=0.03)


@SOLVERS
def test_a_flat_block_in_full_contact(linear: str) -> None:
    """Uniform compression and uniform shear: the rollers take no part in the shear, and no interface is left."""
    surface = Flat(L=1.0)
    block = build_block(surface, 0.5, lambda x, y, depth: 0.4)
    solver = make_contact_solver(here(), surface, block, ELASTIC, options=SolverOptions(linear=linear))
    solver.probes = (Stiffness(solver.solid),)
    assert solver.step(0.001).converged
    k_n, k_t = ELASTIC.confined_modulus / 0.5, ELASTIC.lame[1] / 0.5
    assert solver.probed == pytest.approx({"k_n_elastic": k_n, "k_t": k_t, "k_t_x": k_t}, rel=1e-4)


@EACH
@SOLVERS
def test_elastic_stiffness_is_the_slope_of_an_unloading(
    press_of: Callable[..., ContactSolver], formulation: Formulation, linear: str
) -> None:
    solver = press_of(PLASTIC, formulation, linear=linear, rtol=1e-10)
    for delta in (0.01, 0.02):
        assert solver.step(delta).converged
    delta, move = 0.03, 1e-7
    assert solver.solve(delta).converged
    force, found = solver.solved_force(), Stiffness(solver.solid)(solver)
    solver.commit(delta)
    assert solver.step(delta - move).converged
    # a few points flow on while the others unload, 68 cells here
    assert found["k_n_elastic"] == pytest.approx((force - solver.force) / move, rel=4e-3)
    height = solver.contact_surface.mean(solver.solid.points[:, 2])
    interface = without_block(found["k_n_elastic"], PLASTIC.confined_modulus / height)
    assert found["k_n_interface"] == pytest.approx(interface, rel=1e-12)


@pytest.mark.parametrize("formulation", [Formulation("penalty", penalty=100.0), Formulation("nitsche", gamma=100.0)])
def test_stiff_springs_have_the_stiffness_of_a_factorisation(
    press_of: Callable[..., ContactSolver], formulation: Formulation
) -> None:
    """The iteration starts from a rigid translation, whose energy is that of the springs, many times the result."""
    found = []
    for linear in ("lu", "cg"):
        solver = press_of(ELASTIC, formulation, linear=linear)
        solver.probes = (Stiffness(solver.solid),)
        assert solver.step(0.03).converged
        found.append(solver.probed)
    assert found[1] == pytest.approx(found[0], rel=1e-4)


@pytest.mark.parametrize("material", [ELASTIC, PLASTIC], ids=["elastic", "plastic"])
def test_stiffness_changes_no_bit_of_the_curve(rough: Surface, coarse: BlockMesh | None, material: Material) -> None:
    """And lies between the slopes of an elastic curve before and after each step; that of an unloading is elastic."""
    with_, without = (
        solve_contact(
            rough, material, block=coarse, comm=world(), delta_max=0.03, steps=5, unload_steps=2, stiffness=on,
            options=SolverOptions(linear="cg"),
        ).curve
        for on in (True, False)
    )  # fmt: skip
    for name in ("delta", "force", "area_fraction", "newton", "krylov"):
        np.testing.assert_array_equal(getattr(with_, name), getattr(without, name))
    assert all(np.isnan(getattr(without, name)).all() for name in ELASTIC_STIFFNESSES)
    np.testing.assert_array_equal(with_.k_n, without.k_n)
    load = with_.loading()
    assert all(np.isfinite(getattr(load, name)).all() for name in ELASTIC_STIFFNESSES)
    slopes = np.diff(load.force) / np.diff(load.delta)
    if material is ELASTIC:
        assert np.all((slopes[:-1] < load.k_n_elastic[1:-1]) & (load.k_n_elastic[1:-1] < slopes[1:]))
    else:
        first = with_.where(np.arange(len(load) - 1, len(load) + 1))  # the end of the loading and a step of unloading
        slope = np.diff(first.force)[0] / np.diff(first.delta)[0]
        assert first.k_n_elastic[1] < slope < first.k_n_elastic[0]
    assert [getattr(with_, name)[-1] for name in STIFFNESSES] == [0.0] * len(STIFFNESSES)  # lifted off


@pytest.mark.mpi
@pytest.mark.usefixtures("several_ranks")
@EACH
def test_ranks_agree(rough: Surface, coarse: BlockMesh | None, formulation: Formulation) -> None:
    curves = []
    for comm in (here(), world()):
        block = world().bcast(coarse) if comm.size == 1 else coarse
        result = solve_contact(
            rough, PLASTIC, block=block, comm=comm, delta_max=0.03, steps=3, formulation=formulation, stiffness=True,
            options=SolverOptions(linear="cg"),
        )  # fmt: skip
        curves.append(result.curve)
    for name in (*STIFFNESSES, "conductance"):
        one, all_ = (getattr(curve, name) for curve in curves)
        np.testing.assert_allclose(all_, one, rtol=1e-4)  # LEFT of the energy


@EACH
def test_first_touch(cap: Surface, formulation: Formulation) -> None:
    """A spot smaller than a facet; all values are there and positive."""
    curve = solve_contact(
        cap, ELASTIC, delta_max=2e-4, steps=2, size=MeshSize(0.1, growth=0.5), formulation=formulation, comm=here(),
        stiffness=True,
    ).curve  # fmt: skip
    for name in (*STIFFNESSES, "conductance"):
        assert 0.0 < getattr(curve, name)[0] < 1.0


def test_physical_units() -> None:
    """Stiffness in units of E L, conductance and gap in those of L."""
    side, E = 2e-6, 2e11
    unit, physical = (
        solve_contact(
            Sphere(L=L, radius=L, shape="paraboloid"), Material(E, NU), delta_max=0.01 * L, steps=2, comm=here(),
            size=MeshSize(0.1 * L, growth=0.5), stiffness=True,
        ).curve
        for L, E in ((1.0, 1.0), (side, E))
    )  # fmt: skip
    for name in STIFFNESSES:
        np.testing.assert_allclose(getattr(physical, name), getattr(unit, name) * E * side, rtol=1e-3)
    for name in ("conductance", "mean_gap"):
        np.testing.assert_allclose(getattr(physical, name), getattr(unit, name) * side, rtol=1e-6)


def test_interface_is_independent_of_the_height_of_the_block() -> None:
    """At the same force, where the block makes up a good part of the compliance and is as high as wide."""
    names = ("k_n", "k_n_interface", "k_t_interface", "conductance")
    sphere, found = Sphere(L=1.0, radius=10.0, shape="paraboloid"), []
    for height in (1.0, 2.0):
        curve = solve_contact(
            sphere, ELASTIC, height=height, delta_max=0.006 * height**0.5, steps=5, size=MeshSize(0.07, growth=0.5),
            comm=here(), stiffness=True,
        ).curve  # fmt: skip
        found.append([np.interp(2e-3, curve.force, getattr(curve, name)) for name in names])
    thin, thick = found
    assert thick[0] < 0.85 * thin[0]
    np.testing.assert_allclose(thick[1:], thin[1:], rtol=0.02)
