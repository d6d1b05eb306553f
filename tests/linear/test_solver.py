"""The end of the Krylov method."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import here, world

from asperity.fem.solid import Solid
from asperity.linear.solver import LinearSolver
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import TOP, distribute
from asperity.model.material import Material


@pytest.mark.mpi
@pytest.mark.parametrize("rtol", [3e-2, 1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("load", ["on the top", "everywhere"])
def test_predicted_energy_of_the_error_is_that_of_the_exact_solution(
    coarse: BlockMesh | None, load: str, rtol: float
) -> None:
    """CG ends where the energy norm of the error is below the tolerance times that of the solution, about."""
    comm = world()
    solid = Solid(*distribute(comm, coarse, 1.0), Material(1.0, 0.3))
    solid.assemble_tangent()
    r, y, exact = (solid.vector() for _ in range(3))
    force = np.zeros((solid.owned, 3))
    if load == "on the top":
        force[solid.nodes_on(TOP), 2] = -1.0
    else:
        force[:] = np.random.default_rng(comm.rank).normal(size=force.shape)
    r.array = force.ravel()
    r.array[solid.fixed] = 0.0
    assert LinearSolver(solid, "lu").solve(r, solid.fixed, np.empty(0), exact, 0.0)[1]
    solver = LinearSolver(solid, "cg")
    assert solver.solve(r, solid.fixed, np.empty(0), y, rtol)[1]

    def energy(x: np.ndarray) -> float:
        return float(comm.allreduce(x @ solver.product(x)))

    error = energy(y.array_r - exact.array_r)
    assert 0.3 < solver.left / error < 3.0
    assert error < (1.5 * rtol) ** 2 * energy(exact.array_r)


def test_a_load_of_zero_is_solved_at_once(coarse: BlockMesh) -> None:
    solid = Solid(*distribute(here(), coarse, 1.0), Material(1.0, 0.3))
    solid.assemble_tangent()
    r, y = solid.vector(), solid.vector()
    solver = LinearSolver(solid, "cg")
    assert solver.solve(r, solid.fixed, np.empty(0), y, 1e-2) == (0, True)
    assert solver.left == 0.0
    assert not y.array_r.any()
