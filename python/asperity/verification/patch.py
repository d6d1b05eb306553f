"""Uniform states of a flat block, which every mesh must reproduce to the tolerance of the solver."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from asperity import reference
from asperity.model.load_path import Schedule
from asperity.model.material import Material
from asperity.model.settings import METHODS, Formulation, MeshSize, SolverOptions
from asperity.quasistatic.make import make_block, make_contact_solver
from asperity.quasistatic.stepping import Record, follow
from asperity.surface import Flat
from asperity.verification.flattening import planes_of_symmetry
from asperity.verification.table import Row, solve_on_one_rank

SIZE = MeshSize(0.5, h_max=0.5)
ROUND_OFF = 10.0 * SolverOptions().rtol  # forces balance to rtol; a derived quantity may be less accurate


def patch() -> Iterator[Row]:
    """A flat block in full contact: stiffness and uniform pressure; Johnson, Contact Mechanics (1985), 1.3."""
    nu, delta = 0.3, 0.01
    material = Material(1.0, nu)
    for method in METHODS:
        for height in (1.0, 0.5):
            result = solve_on_one_rank(
                Flat(L=1.0), material, height=height, delta_max=delta, steps=1, size=SIZE,
                formulation=Formulation(method),
            )  # fmt: skip
            slope = result.curve.P_star[0] / result.curve.delta_star[0]
            # the penalty acts as a spring 4 beta E/h in series with the block
            penalty = Formulation(method).penalty * 4.0 / result.solver.contact_surface.diameter.max()
            soft = reference.block_modulus(1.0, nu) / height / penalty if method == "penalty" else 0.0
            yield Row(
                "patch", f"slope dP*/d(delta*), rollers, h_b = {height:g} L, {method}", "M/E' L/h_b",
                reference.patch_test_slope(nu, height), slope, ROUND_OFF, soft,
            )  # fmt: skip
        if method != "penalty":
            pressure = result.solver.pressure
            corners = pressure[np.unique(result.solver.contact_surface.nodes[:, :3])]
            spread = float(np.ptp(corners) / corners.mean())
            yield Row("patch", f"spread of the pressure, {method}", "uniform", 0.0, spread, ROUND_OFF)
    result = solve_on_one_rank(Flat(L=1.0), Material(1.0, 0.0), sides="free", delta_max=delta, steps=1, size=SIZE)
    slope = result.curve.P_star[0] / result.curve.delta_star[0]
    yield Row("patch", "slope, free sides, nu = 0", "E/E' L/h_b", 1.0, slope, ROUND_OFF)
    P, strain = _uniaxial(material, Schedule(delta_max=delta, steps=1))
    yield Row(
        "patch", "slope, free sides, sliding base", "E/E' L/h_b",
        reference.patch_test_slope(nu, 1.0, "free"), float(P[0] / strain[0]), ROUND_OFF,
    )  # fmt: skip


def _uniaxial(material: Material, schedule: Schedule) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """P* and axial strain of a flat block with free sides and a sliding base, each (n,)."""
    from mpi4py import MPI

    comm, surface = MPI.COMM_SELF, Flat(L=1.0)
    block = make_block(comm, surface, 1.0, 0.01, SIZE)
    it = make_contact_solver(comm, surface, block, material, sides="free")
    it.solid.fixed = planes_of_symmetry(it.solid)
    record = Record(1.0, material.E, material.reduced_modulus)
    follow(it, schedule, record)
    curve = record.curve()
    return curve.P_star, curve.delta_star
