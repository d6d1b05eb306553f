"""A rigid sphere on a half-space of finite strain by axisymmetric finite elements: python3 benchmarks/axisymmetric.py.

A model beside asperity: dolfinx in the plane (r, z), the elastic energy of the logarithmic strain, and the
sphere as a penalty energy. Their derivatives are forces and tangent. The cylinder is WIDE radii high and wide.
"""

from __future__ import annotations

import sys

import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from scipy.sparse.linalg import splu

WIDE = 400.0  # height and radius of the cylinder over the radius of the sphere
PENALTY = 30.0  # stiffness of the contact, times E over the size of the elements below it
GROWTH = 1.3  # of the elements from one to the next beyond the contact
CLOSE = 1e-6  # unbalanced force over that on the sphere


def cylinder(h: float, near: float) -> mesh.Mesh:
    """Rectangle of the plane (r, z) below z = 0, with elements of size h up to `near` from the axis and the top."""
    lines: list[float] = np.arange(0.0, near + h, h).tolist()
    while lines[-1] < WIDE:
        lines.append(lines[-1] + GROWTH * (lines[-1] - lines[-2]))
    n = len(lines) - 1
    domain = mesh.create_rectangle(MPI.COMM_SELF, [[0, -n], [n, 0]], [n, n], mesh.CellType.quadrilateral)
    x = domain.geometry.x
    x[:, :2] = np.sign(x[:, :2]) * np.interp(np.abs(x[:, :2]), np.arange(n + 1), lines)
    return domain


def forces(depth: float, steps: int, h: float, nu: float = 0.3) -> list[tuple[float, float]]:
    """Depth and force over E R^2 of each step of a sphere of radius 1, E = 1."""
    domain = cylinder(h, 1.2 * np.sqrt(2.0 * depth - depth**2))
    far = float(np.abs(domain.geometry.x).max())
    sides = {"axis": lambda x: x[0] < 1e-9, "base": lambda x: x[1] < 1e-9 - far, "top": lambda x: x[1] > -1e-9}
    facets = {name: mesh.locate_entities_boundary(domain, 1, where) for name, where in sides.items()}
    tags = mesh.meshtags(domain, 1, np.sort(facets["top"]), np.full(len(facets["top"]), 1, dtype=np.int32))
    V = fem.functionspace(domain, ("Lagrange", 2, (2,)))
    u, v, w, z = fem.Function(V), ufl.TestFunction(V), ufl.TrialFunction(V), fem.Constant(domain, 0.0)
    r = ufl.SpatialCoordinate(domain)[0]
    F, hoop = ufl.Identity(2) + ufl.grad(u), 1.0 + u[0] / r
    C, mu, lam = F.T * F, 0.5 / (1.0 + nu), nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    # logarithms of the two stretches in the plane: (s + d)/2 and (s - d)/2
    s, middle = 0.5 * ufl.ln(ufl.det(C)), 0.5 * ufl.tr(C)
    x = ufl.sqrt(0.25 * (C[0, 0] - C[1, 1]) ** 2 + C[0, 1] ** 2 + 1e-14) / middle
    d = 0.5 * ufl.ln((1.0 + x) / (1.0 - x))
    e = ufl.ln(hoop)
    stored = 0.5 * lam * (s + e) ** 2 + mu * (0.5 * (s**2 + d**2) + e**2)
    place = ufl.SpatialCoordinate(domain) + u
    sphere = ufl.sqrt(ufl.max_value(1.0 - place[0] ** 2, 0.01)) - 1.0
    depth_in = ufl.max_value(place[1] + sphere - z, 0.0)
    ds = ufl.Measure("ds", domain, subdomain_data=tags, metadata={"quadrature_degree": 12})
    k = PENALTY / h
    energy = 2.0 * np.pi * (stored * r * ufl.dx(metadata={"quadrature_degree": 5}) + 0.5 * k * depth_in**2 * r * ds(1))
    first = ufl.derivative(energy, u, v)
    whole, residual, tangent = fem.form(energy), fem.form(first), fem.form(ufl.derivative(first, u, w))
    force = fem.form(2.0 * np.pi * k * depth_in * r * ds(1))
    held = [
        fem.dirichletbc(0.0, fem.locate_dofs_topological(V.sub(i), 1, facets[name]), V.sub(i))
        for i, name in ((0, "axis"), (0, "base"), (1, "base"))
    ]
    out, free = [], np.ones(len(u.x.array), dtype=bool)
    for bc in held:
        free[bc.dof_indices()[0]] = False
    for n in range(1, steps + 1):
        z.value = -depth * n / steps
        for _ in range(100):
            b, load = fem.assemble_vector(residual).array[free], fem.assemble_scalar(force)
            if load > 0.0 and np.linalg.norm(b) < CLOSE * load:
                break
            A = fem.assemble_matrix(tangent).to_scipy().tocsr()[free][:, free]
            least, step = fem.assemble_scalar(whole), splu(A.tocsc()).solve(b)
            u.x.array[free] -= step
            while not fem.assemble_scalar(whole) < least * (1.0 + 1e-10):
                step *= 0.5
                u.x.array[free] += step
        else:
            raise RuntimeError(f"no convergence at the depth {-z.value:g}")
        out.append((-float(z.value), float(load)))
    return out


if __name__ == "__main__":
    for h in map(float, sys.argv[1:] or ("0.08", "0.04")):
        for depth, force in forces(0.3, round(2.4 / h), h):
            print(f"h {h:g}: depth {depth:.3f} R, force {force:.6f} E R^2")
