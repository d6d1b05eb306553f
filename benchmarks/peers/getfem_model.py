"""GetFEM: the scene on a structured mesh of isoparametric bricks, penalised contact; run by GetFEM's own Python.

    python3 getfem_model.py MESH.npz OUT.json

MESH holds the coordinates of the grid (see scene.grid) and the numbers of the scene. OUT gets the forces
after each load step.
"""

import json
import sys
from typing import Any

import getfem as gf
import numpy as np

PENALTY = 10.0  # stiffness of the contact, times E over the size of the elements
HELD = 1e6  # stiffness of base and sides, times E
BASE, SIDES, TOP = 1, 2, 3


def make_mesh(grid: Any, degree: int) -> Any:
    """Block of isoparametric bricks; the regions are marked while it is plane."""
    mesh = gf.Mesh("empty", 3)
    brick = gf.GeoTrans(f"GT_QK(3,{degree})")
    steps = np.arange(degree + 1.0)
    lattice = np.array([(i, j, k) for k in steps for j in steps for i in steps]).T
    for corner in np.ndindex(*((n - 1) // degree for n in grid.shape[:3])):
        mesh.add_convex(brick, lattice + degree * np.array(corner)[:, None])
    for region, directions in {
        BASE: [(0, 0, -1)],
        SIDES: [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)],
        TOP: [(0, 0, 1)],
    }.items():
        faces = [mesh.outer_faces_with_direction(list(map(float, d)), 0.01) for d in directions]
        mesh.set_region(region, np.hstack(faces))
    i, j, k = np.rint(mesh.pts()).astype(int)
    mesh.set_pts(grid[i, j, k].T)
    return mesh


def main(source: str, target: str) -> None:
    """ContactSolver the block step by step."""
    data = np.load(source)
    grid, plastic = data["grid"], bool(data["plastic"])
    E, nu, sigma_y, hardening = (float(data[name]) for name in ("E", "nu", "sigma_y", "hardening"))
    gf.util_trace_level(0)
    gf.util_warning_level(0)
    degree = int(data["degree"])
    mesh = make_mesh(grid, degree)
    n = (len(grid) - 1) // degree
    fem = gf.MeshFem(mesh, 3)
    fem.set_classical_fem(degree)
    mim = gf.MeshIm(mesh, 2 * degree)
    model = gf.Model("real")
    model.add_fem_variable("u", fem)
    model.add_initialized_data("lambda", E * nu / ((1 + nu) * (1 - 2 * nu)))
    model.add_initialized_data("mu", E / (2 * (1 + nu)))
    law = ("Prandtl Reuss linear hardening", 0, "u", "xi", "Epn", "alphan",
           "lambda", "mu", "sigma_y", "0", "hardening", "1", "timestep")  # fmt: skip
    if plastic:
        model.add_fem_data("Previous_u", fem)
        model.add_im_data("Epn", gf.MeshImData(mim, -1, [3, 3]))
        scalar = gf.MeshImData(mim, -1, 1)
        for name in ("xi", "Previous_xi", "alphan"):
            model.add_im_data(name, scalar)
        model.add_initialized_data("sigma_y", sigma_y)
        model.add_initialized_data("hardening", hardening)
        model.set_time_step(1.0)
        model.add_small_strain_elastoplasticity_brick(mim, *law)
    else:
        model.add_isotropic_linearized_elasticity_brick(mim, "u", "lambda", "mu")
    model.add_Dirichlet_condition_with_penalization(mim, "u", HELD * E, BASE)
    model.add_initialized_data("held", HELD * E)
    model.add_linear_term(mim, "held*(u.Normal)*(Test_u.Normal)", SIDES)
    heights = gf.MeshFem(mesh, 1)
    heights.set_classical_fem(degree)
    z = heights.basic_dof_nodes()[2]
    summit = float(grid[..., 2].max())
    model.add_initialized_fem_data("obstacle", heights, summit - z)
    model.add_initialized_data("r", PENALTY * E * n)
    model.add_penalized_contact_with_rigid_obstacle_brick(mim, "u", "obstacle", "r", TOP, 1)
    forces: list[float] = []
    for delta in data["path"]:
        model.set_variable("obstacle", summit - delta - z)
        iterations, converged = model.solve("max_res", 1e-9 * E, "max_iter", 60)
        if not converged:
            break
        if plastic:
            model.small_strain_elastoplasticity_next_iter(mim, *law)
        model.add_initialized_data("level", summit - delta) if not forces else model.set_variable(
            "level", summit - delta
        )
        forces.append(float(np.asarray(gf.asm_generic(mim, 0, "r*pos_part(u(3)+X(3)-level)", TOP, model))))
        print(delta, forces[-1], iterations, flush=True)
        with open(target, "w", encoding="ascii") as out:
            json.dump({"force": forces, "dofs": fem.nbdof()}, out)


if __name__ == "__main__":
    main(*sys.argv[1:])
