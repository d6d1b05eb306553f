"""A flat block under the flat, against closed forms of a material point: formulations, materials, strains, sides."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import Any, Literal

import numpy as np
import pytest
from conftest import ELASTIC, PLASTIC, here, make_contact_solver, world
from j2_path import confined_stress, uniaxial_stress

from asperity import reference as ref
from asperity.arrays import Array
from asperity.mesh.generate import build_block
from asperity.model.load_path import MIDPOINT, Schedule
from asperity.model.material import Material
from asperity.model.settings import LEAST_GAMMA, Formulation, SolverOptions
from asperity.quasistatic import measures
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.measures import Record
from asperity.quasistatic.stepping import follow
from asperity.runtime.parallel import on_root
from asperity.surface import Flat

EXACT, NITSCHE, PENALTY = Formulation(), Formulation("nitsche"), Formulation("penalty")
STRETCHED, MIXED = (replace(m, kinematics="finite") for m in (ELASTIC, replace(PLASTIC, hardening=0.4)))
SHORT = [0.004, 0.012, 0.02, 0.0195, 0.021]
FAR = [0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.49]
Sides = Literal["rollers", "free"]


def press_of(
    formulation: Formulation, material: Material, sides: Sides = "rollers", height: float = 1.0, comm: Any = None
) -> ContactSolver:
    """A block of four facets on the top, or of more where its height is not its side."""
    comm, size = comm or world(), 1.0 if height == 1.0 else 0.6
    block = on_root(comm, lambda: build_block(Flat(L=1.0), height, lambda x, y, depth: size))
    exact = SolverOptions(linear="lu")  # to rounding
    options: dict[str, Any] = {"sides": sides, "formulation": formulation, "options": exact}
    return make_contact_solver(comm, Flat(L=1.0), block, material, **options)


def stresses(material: Material, sides: Sides, strain: Array) -> tuple[Array, Array, Array]:
    """Axial and lateral stress over the undeformed area, and plastic strain, along axial strains (n,).

    Between free sides Poisson's ratio is 0 here, for the base is clamped in its plane too.
    """
    law = material.yield_strength or inf, material.tangent_modulus, material.kinematic_share
    stretch = 1.0 + material.finite * strain
    if material.finite:
        strain = np.log(stretch)
    if sides == "free":
        axial, accumulated = uniaxial_stress(strain, material.E, *law)
        return axial, 0.0 * axial, accumulated
    axial, lateral, accumulated = confined_stress(strain, material.E, material.nu, *law)
    return axial / stretch, lateral / stretch, accumulated


def row(formulation: Formulation, material: Material, path: list[float], sides: str = "rollers", height: float = 1.0):
    """A case of the table; its name."""
    strength = "plastic" if material.plastic else "elastic"
    factor = formulation.penalty if formulation.method == "penalty" else formulation.gamma
    name = f"{formulation.method} {factor or ''} {strength} {material.kinematics} {sides} {height:g}"
    marks = [pytest.mark.mpi] if material in (STRETCHED, MIXED) or height != 1.0 else []
    return pytest.param(formulation, material, path, sides, height, id=name, marks=marks)


@pytest.mark.parametrize(
    ("formulation", "material", "path", "sides", "height"),
    [
        *(row(EXACT, ELASTIC, [0.01], "rollers", height) for height in (1.0, 0.4, 2.5)),
        *(row(EXACT, Material(1.0, 0.0), [0.01], "free", height) for height in (1.0, 0.4, 2.5)),
        *(row(replace(PENALTY, penalty=penalty), ELASTIC, [0.01]) for penalty in (0.1, 10.0, 100.0)),
        *(row(replace(NITSCHE, gamma=gamma), ELASTIC, [0.01]) for gamma in (LEAST_GAMMA, 1.0, 10.0, 100.0)),
        *(row(formulation, PLASTIC, SHORT) for formulation in (EXACT, NITSCHE)),
        *(row(EXACT, replace(PLASTIC, hardening=hardening), SHORT) for hardening in (0.4, "kinematic")),
        *(row(formulation, material, FAR) for formulation in (EXACT, NITSCHE) for material in (STRETCHED, MIXED)),
        row(EXACT, replace(PLASTIC, kinematics="finite"), FAR),
        row(EXACT, STRETCHED, [0.8]),
    ],
)
def test_patch_test(formulation: Formulation, material: Material, path: list[float], sides: Sides, height: float):
    """Force, uniform pressure, stress and flow of each step; a penalty is a spring in series with the block.

    Its stiffness is penalty times p^2/h with p = 2 and h the longest side of a facet.
    """
    solver, delta = press_of(formulation, material, sides, height), np.array(path)
    rate = 0.0 if formulation.method != "penalty" else 1.0 / (4.0 * formulation.penalty)
    shares = 1.0 / (1.0 + rate * ref.block_modulus(1.0, material.nu, sides) / height)  # of the approach: the block's
    axial, lateral, accumulated = stresses(material, sides, -shares * delta / height)
    linear = formulation.method == "active-set" and not material.plastic and not material.finite
    for depth, force, side, flow in zip(delta, -axial, lateral, accumulated, strict=True):
        assert solver.step(float(depth)).converged
        assert solver.force == pytest.approx(force, rel=1e-12 if linear else 1e-9)
        assert measures.row(solver)["max_plastic_strain"] == pytest.approx(flow, rel=1e-8, abs=1e-14)
        stress = solver.solid.kernels.stress(solver.solid.u.x.array.reshape(-1, 3))
        uniform = np.array([side, side, -force, 0.0, 0.0, 0.0]) * np.ones_like(stress)
        np.testing.assert_allclose(stress, uniform, rtol=0, atol=1e-9 * force)
    top = solver.contact_surface.nodes
    np.testing.assert_allclose(solver.pressure[top[:, :3]], force, rtol=1e-9)
    np.testing.assert_allclose(solver.gap()[top], -rate * force, rtol=0, atol=1e-10 if material.finite else 1e-12)
    assert measures.row(solver)["area_fraction"] == pytest.approx(1.0, rel=1e-12)
    assert solver.checks.force_balance < 1e-10 and solver.checks.energy_excess == 0.0
    assert rate or solver.checks.violated == {}


@pytest.mark.parametrize("E_t", [0.05, 0.0])
def test_midpoint_rows_contain_the_flow_at_their_approach(E_t: float) -> None:
    """The history is extrapolated beyond each step, the row is not."""
    material = replace(PLASTIC, tangent_modulus=E_t)
    record = Record(1.0, 1.0, material.reduced_modulus)
    path = Schedule(delta_max=0.03, steps=6, integrator=MIDPOINT)
    follow(press_of(EXACT, material, height=0.8, comm=here()), path, record)
    curve = record.curve()
    stress, _, flow = stresses(material, "rollers", -curve.delta / 0.8)
    np.testing.assert_allclose(curve.force, -stress, rtol=1e-9)
    np.testing.assert_allclose(curve.max_plastic_strain, flow, rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(curve.plastic_fraction, np.where(flow > 0.0, 1.0, 0.0))
