"""Conductance by Barber's identity, the column of the curve, against Laplace's equation in the undeformed block.

    python3 benchmarks/conductance.py [--seed N ...]

Self-affine surfaces of three rms slopes are pressed elastically on one mesh. At each step the potential is 1 at the
nodes in contact and 0 on the base, and the resistance of the block is taken out. Prints the least and the greatest
excess of the identity over all steps and seeds.
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

import asperity as asp
from asperity.arrays import Integers
from asperity.fem.kernels import ElementKernels
from asperity.fem.solid import Solid
from asperity.linear.petsc import GAMG, empty_matrix, set_defaults
from asperity.quasistatic.make import make_block, make_contact_solver
from asperity.quasistatic.stiffness import Stiffness, without_block
from asperity.runtime import compat

PREFIX = "asperity_conductance_"
SLOPES, STEPS, DEPTH = (0.02, 0.1, 0.2), 4, 1.2  # of the approach over the rms height at the end


def conductance(solid: Solid, nodes: Integers) -> float:
    """Conductance of the block from given nodes to the base over the conductivity [L]."""
    sparsity, cells = solid.sparsity, solid.cell_nodes
    x_nodes = compat.geometry_dofmap(solid.mesh)[: len(cells)]
    # the trace of each 3 x 3 block of an elastic solid is lambda + 4 mu times the Laplacian: 2 with E = 1, nu = 0
    elastic = ElementKernels(solid.mesh.geometry.x, x_nodes, cells, asp.Material(1.0, 0.0), sparsity)
    values = np.zeros(sparsity.size)
    elastic.elastic_tangent(np.zeros((solid.nodes, 3)), values)
    laplacian = 0.5 * values[sparsity.diagonals(np.arange(len(sparsity.indices)))].sum(axis=1)
    matrix = empty_matrix(solid.V.dofmap.index_map, 1, solid.comm)
    matrix.setValuesLocalCSR(sparsity.indptr, sparsity.indices, laplacian, PETSc.InsertMode.ADD)
    matrix.assemble()
    potential, right = matrix.createVecs()
    potential.array[nodes] = 1.0
    matrix.mult(potential, right)
    right.scale(-1.0)
    rows = np.union1d(solid.base, nodes).astype(np.int32)
    right.array[rows] = 0.0
    held, change = matrix.duplicate(copy=True), potential.duplicate()
    held.zeroRowsColumns(rows, diag=1.0)
    ksp = PETSc.KSP().create(solid.comm)
    ksp.setOptionsPrefix(PREFIX)
    ksp.setType("cg")
    ksp.setTolerances(rtol=1e-8)
    ksp.getPC().setType("gamg")
    set_defaults(PREFIX, GAMG)
    ksp.setFromOptions()
    ksp.setOperators(held)
    ksp.solve(right, change)
    potential.axpy(1.0, change)
    matrix.mult(potential, right)
    return float(potential.dot(right))


def excess(slope: float, nu: float, seed: int) -> list[float]:
    """Excess of the identity over Laplace's equation at the steps, in per cent."""
    surface = asp.Surface.from_spec(
        "self-affine", L=1.0, H=0.8, rms_slope=slope, lambda_roll=0.5, lambda_short=0.125, seed=seed
    )
    depth = DEPTH * surface.statistics().Sq
    problem = asp.Problem.of(surface, asp.Material(1.0, nu), delta_max=depth, size=asp.MeshSize(0.03))
    solver = make_contact_solver(MPI.COMM_SELF, problem, make_block(MPI.COMM_SELF, problem, depth))
    solid, found = solver.solid, []
    solver.probes = (Stiffness(solid),)
    for delta in depth * np.arange(1, STEPS + 1) / STEPS:
        assert solver.step(delta).converged
        laplace = without_block(conductance(solid, solver.contact.nodes()), 1.0)
        found.append(100.0 * (solver.probed["conductance"] / laplace - 1.0))
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, nargs="*", default=[1, 2, 3])
    options = parser.parse_args()
    print("| rms slope | Poisson's ratio | least excess, % | greatest excess, % |\n|" + 4 * " --- |")
    for nu in (0.3, 0.45):
        for slope in SLOPES:
            found = np.concatenate([excess(slope, nu, seed) for seed in options.seed])
            print(f"| {slope} | {nu} | {found.min():.1f} | {found.max():.1f} |", flush=True)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
