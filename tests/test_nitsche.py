"""Contact by pressure on facets: agreement of the variants, facet history, area and its error, two ranks; an oracle."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from asperity import reference as ref
from asperity.contact import PressureContact
from asperity.contact.contact_surface import FacetRule, Top
from asperity.errors import InputError
from asperity.fem.sparsity import assembled
from asperity.mesh.block import BlockMesh
from asperity.mesh.generate import SizeField, build_block
from asperity.model.material import Material
from asperity.quasistatic.solve_contact import Formulation, MeshSize, make_press, solve_contact
from asperity.surface import Flat, Surface

Array = npt.NDArray[np.float64]

ELASTIC = Material(1.0, 0.3)
PLASTIC = Material(1.0, 0.3, 0.005, 0.05)
EXACT = Formulation()
VARIANTS = [Formulation("nitsche", theta=theta) for theta in (0, 1, -1)]


def here() -> Any:
    from mpi4py import MPI

    return MPI.COMM_SELF


def test_rule_integrates_areas_and_heights(coarse: BlockMesh, rough: Surface) -> None:
    """Splitting a facet changes no integral of the second-order height."""
    top = make_press(here(), rough, coarse, ELASTIC).top
    integrals = []
    for degree, splits in ((2, 0), (4, 0), (3, 2)):
        rule = FacetRule(top, degree, splits)
        assert rule.weights.sum() == pytest.approx(1.0, rel=1e-13)
        assert (rule.weights > 0.0).all()
        integrals.append(float((rule.weights * rule.height).sum()))
    assert np.ptp(integrals) < 1e-13


def test_variants_agree_under_refinement(cap: Surface) -> None:
    """The force of each variant approaches that of exact contact faster than the first power of the size."""
    a, gaps = 0.05, []
    for size in (a / 2, a / 4):
        block = build_block(cap, 1.0, SizeField.of(cap, a**2 / 10.0, size, h_max=0.5).at)
        forces = []
        for formulation in (EXACT, *VARIANTS):
            press = make_press(here(), cap, block, ELASTIC, formulation=formulation)
            assert press.attempt(a**2 / 10.0).converged
            forces.append(press.force)
        gaps.append(np.max(np.abs(np.array(forces[1:]) / forces[0] - 1.0)))
    assert gaps[0] < 0.01
    assert gaps[1] < gaps[0] / 2.0


@pytest.mark.parametrize("formulation", [EXACT, VARIANTS[0]], ids=lambda f: f.method)
def test_area_and_pressure_of_hertz(cap: Surface, formulation: Formulation) -> None:
    """Those that belong to the force: area within its error, pressure smooth up to near the edge."""
    a = 0.05
    size = MeshSize(a / 4, growth=0.5, h_max=0.5)
    press = solve_contact(
        cap, ELASTIC, delta_max=a**2 / 10.0, steps=1, size=size, formulation=formulation, comm=here()
    ).press
    hertz = ref.Hertz(10.0, ELASTIC.reduced_modulus)
    delta = float(hertz.deflection(4.0 * press.force))
    radius, peak = float(hertz.radius(delta)), float(hertz.peak_pressure(delta))
    area = press.contact.area()
    assert abs(area.value - 0.25 * np.pi * radius**2) < area.error
    assert area.error < 0.2 * area.value
    pressure, _ = press.top_state()
    corners = np.unique(press.top.nodes[:, :3])
    r = np.hypot(*press.solid.points[corners, :2].T)
    inside = r < 0.8 * radius
    assert inside.sum() > 10
    deviation = pressure[corners][inside] - hertz.pressure(r[inside], delta)
    assert np.abs(deviation).max() < 0.05 * peak


def test_facets_carry_the_history_of_the_bulk() -> None:
    """Uniform compression beyond yield, partly unloaded: one plastic strain everywhere, at the facets too."""
    surface = Flat(L=1.0)
    block = build_block(surface, 1.0, lambda x, y, depth: 1.0)
    press = make_press(here(), surface, block, PLASTIC, formulation=VARIANTS[0])
    contact = press.contact
    assert isinstance(contact, PressureContact)
    for delta in (0.01, 0.02, 0.018, 0.025):
        assert press.attempt(delta).converged
        for facet, bulk in zip(contact.history(), press.solid.bulk.history(), strict=True):
            expected = bulk.reshape(-1, *bulk.shape[2:])[0]
            np.testing.assert_allclose(facet, np.broadcast_to(expected, facet.shape), atol=1e-12)
    assert contact.history()[1].min() > 0.0


def test_failed_attempt_leaves_the_history(rough: Surface, coarse: BlockMesh) -> None:
    """A trial writes no committed history, a step commits that of its facets."""
    press = make_press(here(), rough, coarse, PLASTIC, formulation=VARIANTS[0])
    contact = press.contact
    assert isinstance(contact, PressureContact)
    assert press.trial(0.01).converged
    assert not contact.history()[1].any()
    assert press.attempt(0.01).converged
    assert contact.history()[1].any()


def test_theta_needs_an_elastic_solid(rough: Surface, coarse: BlockMesh) -> None:
    with pytest.raises(InputError, match="elastic"):
        make_press(here(), rough, coarse, PLASTIC, formulation=VARIANTS[1])


def test_indefinite_system_is_a_failed_step(rough: Surface, coarse: BlockMesh) -> None:
    """The symmetric variant far below its trace constant does not converge, and the state is as before."""
    formulation = Formulation("nitsche", gamma=0.01, theta=1)
    press = make_press(here(), rough, coarse, ELASTIC, formulation=formulation)
    assert not press.attempt(0.01).converged
    assert not press.solid.u.x.array.any()
    assert press.force == 0.0


def test_active_set_solves_the_variational_inequality(wave: Surface, coarse_wave: BlockMesh) -> None:
    """PETSc's reduced-space semismooth Newton method on the nodal bounds gives the same displacement."""
    from petsc4py import PETSc

    press = make_press(here(), wave, coarse_wave, ELASTIC)
    assert press.attempt(0.012).converged
    expected = press.solid.u.x.array.copy()
    solid = make_press(here(), wave, coarse_wave, ELASTIC).solid
    solid.assemble_tangent()
    A = assembled(solid)
    A.zeroRowsColumns(solid.fixed, diag=1.0)
    upper, lower = A.createVecRight(), A.createVecRight()
    upper.set(PETSc.INFINITY)
    lower.set(PETSc.NINFINITY)
    nodes = Top(solid).owned_nodes
    upper.array[3 * nodes + 2] = press.summit - 0.012 - solid.points[nodes, 2]
    snes = PETSc.SNES().create(here())
    snes.setType("vinewtonrsls")
    snes.setFunction(lambda _, x, r: A.mult(x, r), A.createVecLeft())
    snes.setJacobian(lambda _, x, J, P: None, A)
    snes.setVariableBounds(lower, upper)
    snes.setTolerances(rtol=1e-12, atol=1e-13, stol=0.0, max_it=50)
    snes.getKSP().setType("preonly")
    snes.getKSP().getPC().setType("lu")
    x = A.createVecRight()
    snes.solve(None, x)
    assert snes.getConvergedReason() > 0
    np.testing.assert_allclose(x.array, expected, atol=1e-9)


@pytest.mark.mpi
@pytest.mark.parametrize("material", [ELASTIC, PLASTIC], ids=["elastic", "plastic"])
def test_same_curve_on_any_number_of_ranks(rough: Surface, coarse: BlockMesh | None, material: Material) -> None:
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    settings: dict[str, Any] = dict(delta_max=0.03, steps=3, formulation=VARIANTS[0])
    together = solve_contact(rough, material, block=coarse, comm=comm, **settings).curve
    if comm.rank == 0:
        alone = solve_contact(rough, material, block=coarse, comm=here(), **settings).curve
        np.testing.assert_allclose(together.force, alone.force, rtol=1e-8)
        np.testing.assert_allclose(together.area_fraction, alone.area_fraction, rtol=1e-8)
