"""Mean gap, mean pressure and contact spots against closed forms, on any number of ranks."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from conftest import ELASTIC, PLASTIC, here, make_block, make_contact_solver, world
from element_sample import sample
from scipy.linalg import logm

from asperity.adaptive.solve_contact import solve_contact
from asperity.fem.energies import equivalent_strain
from asperity.model.material import Material
from asperity.model.settings import Formulation, MeshSize
from asperity.output.fields import gather_top_states
from asperity.output.results import Raster
from asperity.quasistatic.measures import mean_stress, row
from asperity.surface import Flat, Sinusoid, Surface

NU = 0.3
#: Nitsche's method has the points of the penalty method.
EACH = pytest.mark.parametrize("formulation", [Formulation(), Formulation("penalty")], ids=lambda f: f.method)


@EACH
def test_spots_of_a_chequered_wave(formulation: Formulation) -> None:
    """Crests at the corners, in the middles of the edges and between: 13 in the patch, 4 of them whole; all ranks."""
    surface = Sinusoid(L=2.0, amplitude=0.02, wavelength=1.0, dims=2)
    curve = solve_contact(
        surface, ELASTIC, delta_max=0.012, steps=2, formulation=formulation, size=MeshSize(0.08, growth=0.6),
        comm=world(),
    ).curve  # fmt: skip
    assert curve.spots.tolist() == [13, 13]
    # of 16 half spots: five whole ones, four halves, four quarters make eight
    np.testing.assert_allclose(curve.largest_spot, 4.0 * curve.area_fraction / 8.0, rtol=0.05)


@EACH
def test_the_map_shows_the_spots_that_count(formulation: Formulation, monkeypatch: pytest.MonkeyPatch) -> None:
    """Patches of a fine map and their area; the angles in which two meet are too narrow for its squares."""
    from scipy import ndimage

    from asperity.surface import SelfAffine

    rough = SelfAffine(L=1.0, H=0.8, slope=0.05, lambda_roll=0.4, lambda_short=0.15, seed=3)
    result = solve_contact(
        rough, ELASTIC, delta_max=0.01, steps=3, snapshots=3, formulation=formulation, size=MeshSize(0.06),
        comm=here(),
    )  # fmt: skip
    curve, fields = result.curve, gather_top_states(result, 1.0, 1.0)
    assert fields is not None
    on_grid, shown = Raster(fields, n=1200), []
    for i in range(3):
        drawn = on_grid.touching(i)
        shown.append(ndimage.label(ndimage.binary_dilation(drawn, iterations=3))[1])
        if formulation.method == "active-set":
            assert drawn.mean() == pytest.approx(curve.area_fraction[i], rel=0.02, abs=1e-4)
    assert shown == curve.spots.tolist()
    assert curve.spots[-1] > 3 and np.array_equal(curve.spots > 0, curve.area_fraction > 0.0)


def test_nodes_at_corners_alone_are_no_spots() -> None:
    """An area of zero has none, however many nodes carry the force."""
    surface = Sinusoid(L=1.0, amplitude=0.02, wavelength=0.25, dims=2)
    curve = solve_contact(surface, ELASTIC, delta_max=1e-4, steps=1, size=MeshSize(0.125, h_max=0.3), comm=here()).curve
    assert curve.force[0] > 0.0
    assert (curve.spots[0] > 0) == (curve.area_fraction[0] > 0.0)


LAWS = pytest.mark.parametrize(
    "material",
    [
        Material(1.0, NU), Material(1.0, NU, kinematics="finite"), Material(1.0, NU, 0.01, 0.05),
        Material(1.0, NU, 0.01, 0.05, hardening=0.4),
    ],
)  # fmt: skip


@LAWS
@pytest.mark.parametrize("forms", [False, True])
def test_the_equivalent_strain_is_that_of_the_displacement(cube: Any, material: Material, forms: bool) -> None:
    """Uniform gradients with all nine components, the second one after a step that has yielded."""
    gradients = 0.03 * np.random.default_rng(4).normal(size=(2, 3, 3))
    one = sample(cube, material, forms)
    solver: Any = SimpleNamespace(solid=one.solid, history=one.kernels.history())
    for H in gradients:
        one.bring([], one.affine(H))
        one.kernels.commit()
        one.solid.u.x.array[:] = one.affine(H).ravel()
        solver.history = one.kernels.history()
        C = (np.eye(3) + H).T @ (np.eye(3) + H)
        e = 0.5 * logm(C) if material.finite else 0.5 * (H + H.T)
        e = e - np.trace(e) / 3.0 * np.eye(3)
        np.testing.assert_allclose(
            equivalent_strain(solver.solid, solver.history), np.sqrt(2.0 / 3.0 * np.sum(e * e)), rtol=1e-9
        )


def test_the_plastic_fraction_is_one_of_volume(rough: Surface, coarse: Any) -> None:
    solver = make_contact_solver(here(), rough, coarse, PLASTIC)
    assert solver.step(0.02).converged
    kernels, found = solver.solid.kernels, row(solver)["plastic_fraction"]
    flows = kernels.history().accumulated > 0.0
    assert found == pytest.approx(np.average(flows, weights=kernels.volumes)) != pytest.approx(flows.mean())


@pytest.mark.parametrize(("kinematics", "height"), [("small", 0.5), ("small", 2.0), ("finite", 2.0)])
@pytest.mark.parametrize(("strength", "tangent"), [(None, 0.0), (0.01, 0.2)], ids=["elastic", "plastic"])
def test_strain_and_fractions_of_a_flat_block(
    kinematics: Any, height: float, strength: float | None, tangent: float
) -> None:
    """Uniaxial strain e, or ln(1 - e): two thirds of it, plastic or not, in all of the block at once, of any height."""
    material = Material(1.0, NU, strength, tangent, kinematics=kinematics)
    found = solve_contact(
        Flat(L=1.0), material, height=height, delta_max=0.08 * height, steps=2, size=MeshSize(0.5, h_max=0.5),
        comm=here(),
    ).curve  # fmt: skip
    strain = found.delta / height
    expected = 2 / 3 * (strain if kinematics == "small" else -np.log1p(-strain))
    np.testing.assert_allclose(found.max_strain, expected, rtol=1e-6)
    np.testing.assert_allclose(found.strained_fraction, expected > 0.05)
    assert found.strained_fraction[0] == 0.0 and found.plastic_fraction[-1] == pytest.approx(
        float(strength is not None)
    )


def test_the_strained_fraction_of_a_contact_is_that_of_its_volume() -> None:
    """A higher block has the same strained spot: its part is as much smaller."""
    surface, fractions = Sinusoid(L=1.0, amplitude=0.05, dims=2), []
    for height in (0.5, 2.0):
        block = make_block(here(), surface, height, 0.03, MeshSize(0.06, growth=0.5))
        solver = make_contact_solver(here(), surface, block, ELASTIC)
        while solver.force < 0.02:
            assert solver.step(solver.delta + 0.005).converged
        strained = np.sum(solver.solid.kernels.volumes[equivalent_strain(solver.solid, solver.history) > 0.05])
        fractions.append(row(solver)["strained_fraction"])
        assert fractions[-1] * height == pytest.approx(float(strained), rel=1e-4)  # mean height of the facets
    assert 0.0 < fractions[1] < 0.5 * fractions[0]


@pytest.mark.parametrize("material", [ELASTIC, PLASTIC])
def test_the_mean_stress_of_the_cells_carries_the_force(rough: Surface, coarse: Any, material: Material) -> None:
    """Divergence theorem: the integral of the vertical stress is that of the force of the flat times its height."""
    solver = make_contact_solver(here(), rough, coarse, material)
    assert solver.step(0.02).converged
    stress, _ = mean_stress(solver, solver.solid.u.x.array.reshape(-1, 3))
    volumes = solver.solid.kernels.volumes.sum(axis=1)
    z = solver.solid.points[: solver.nodal_force.size, 2]
    assert stress[:, 2] @ volumes == pytest.approx(-float(solver.nodal_force @ z), rel=1e-5)
