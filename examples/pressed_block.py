"""A wavy elastic-plastic block under a rigid flat, from the weak form up: dolfinx and petsc4py only.

J2 with isotropic hardening; contact is exact, a flat that no node passes, or by a penalty, which SNES solves. asperity
gives the same force on the same mesh to 1e-6 (tests/test_examples.py), and an error bar.
"""

import basix.ufl
import numpy as np
import scipy.optimize
import ufl
from dolfinx import fem, mesh
from dolfinx.fem.petsc import assemble_matrix, assemble_vector
from mpi4py import MPI
from petsc4py import PETSc

E, NU, YIELD, HARDENING = 1.0, 0.3, 0.005, 0.05  # stresses over E; the last is the slope over the plastic strain
PENALTY = 10.0  # of E p^2/h
CELLS, FACETS = {"quadrature_degree": 2}, {"quadrature_degree": 8}


def j2(strain, h):
    """Stress and new history: Simo & Hughes, Computational Inelasticity (1998), box 3.2."""
    lam, mu = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
    elastic = strain - ufl.as_matrix([[h[0], h[3], h[4]], [h[3], h[1], h[5]], [h[4], h[5], h[2]]])
    s, size = 2 * mu * ufl.dev(elastic), YIELD + HARDENING * h[6]
    q = ufl.sqrt(ufl.max_value(1.5 * ufl.inner(s, s), size**2))
    flow = (q - size) / (3 * mu + HARDENING)
    step = 1.5 * flow / q * s
    new = [h[i] + step[ij] for i, ij in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)])]
    return lam * ufl.tr(elastic) * ufl.Identity(3) + 2 * mu * (elastic - step), ufl.as_vector([*new, h[6] + flow])


class Block:
    """Displacement, history and forms on a mesh with its base at z = 0 and its sides at x, y = 0, 1."""

    def __init__(self, domain):
        self.domain = domain
        domain.topology.create_connectivity(2, 3)
        planes = [(2, 0.0), (0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0)]
        flat = [mesh.locate_entities_boundary(domain, 2, lambda x, p=p: np.isclose(x[p[0]], p[1])) for p in planes]
        top = np.setdiff1d(mesh.exterior_facet_indices(domain.topology), np.concatenate(flat))
        V = fem.functionspace(domain, ("Lagrange", 2, (3,)))
        self.owned, self.first = 3 * V.dofmap.index_map.size_local, 3 * V.dofmap.index_map.local_range[0]
        base, *sides = (fem.locate_dofs_topological(V, 2, facets) for facets in flat)
        rollers = [3 * nodes + axis for nodes, (axis, _) in zip(sides, planes[1:], strict=True)]
        fixed = np.unique(np.concatenate([*(3 * base + i for i in range(3)), *rollers]))
        touching = np.sort(3 * fem.locate_dofs_topological(V, 2, top) + 2)
        self.fixed, self.top = (dofs[dofs < self.owned].astype(np.int32) for dofs in (fixed, touching))
        self.height = V.tabulate_dof_coordinates()[self.top // 3, 2]

        self.u, v, du = fem.Function(V), ufl.TestFunction(V), ufl.TrialFunction(V)
        seven = basix.ufl.quadrature_element("tetrahedron", value_shape=(7,), degree=CELLS["quadrature_degree"])
        self.h = fem.Function(fem.functionspace(domain, seven))  # plastic strain, accumulated plastic strain
        stress, after = j2(ufl.sym(ufl.grad(self.u)), self.h)
        tags = mesh.meshtags(domain, 2, np.sort(top), np.ones(len(top), dtype=np.int32))
        ds = ufl.Measure("ds", domain, subdomain_data=tags, subdomain_id=1, metadata=FACETS)
        self.flat, self.stiffness = fem.Constant(domain, 0.0), fem.Function(fem.functionspace(domain, ("DG", 0)))
        depth = ufl.SpatialCoordinate(domain)[2] + self.u[2] - self.flat
        push = self.stiffness * ufl.max_value(depth, 0.0) * ufl.FacetNormal(domain)[2]
        work = ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx(domain, metadata=CELLS) + push * v[2] * ds
        self.force, self.residual, self.tangent = map(fem.form, (push * ds, work, ufl.derivative(work, self.u, du)))
        self.after = fem.Expression(after, seven.custom_quadrature()[0])

    def assemble(self):
        """Residual and tangent."""
        r = assemble_vector(self.residual)
        r.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        K = assemble_matrix(self.tangent)
        K.assemble()
        return r, K

    def take(self, values):
        self.u.x.array[: self.owned] = values
        self.u.x.scatter_forward()

    def step(self, flat, exactly):
        """Force under a flat at a height; the history at the end of a step is that at the beginning of the next."""
        force = self.press_exactly(flat) if exactly else self.press_by_penalty(flat)
        cells = np.arange(self.domain.topology.index_map(3).size_local, dtype=np.int32)
        dofs = self.h.function_space.dofmap.list[cells]
        self.h.x.array.reshape(-1, 7)[dofs] = self.after.eval(self.domain, cells).reshape(*dofs.shape, 7)
        return force

    def press(self, summit, approaches, exactly=True):
        """Forces at approaches from first touch."""
        return np.array([self.step(summit - delta, exactly) for delta in approaches])

    def press_exactly(self, flat):
        """The nodes that touch are an active set (Hintermueller, Ito & Kunisch 2002)."""
        held, before = self.top[:0], None
        while self.domain.comm.allreduce(int(not np.array_equal(held, before))):
            depth = self.height + self.u.x.array[self.top] - flat
            before, held = held, self.top[0.1 * depth - self.assemble()[0].array_r[self.top] > 0.0]
            self.solve(held, flat - self.height[np.isin(self.top, held)])
        return -self.domain.comm.allreduce(float(self.assemble()[0].array_r[held].sum()))

    def press_by_penalty(self, flat):
        """The flat is a stiff spring."""
        self.flat.value = flat
        self.solve(self.top[:0], [])
        return self.domain.comm.allreduce(fem.assemble_scalar(self.force))

    def solve(self, held, values):
        """Solve by SNES with the values of some dofs given; their rows say so."""
        rows, given = np.concatenate([self.fixed, held]), np.concatenate([np.zeros(len(self.fixed)), values])

        def residual(snes, x, b):
            self.take(x.array_r)
            b.array = self.assemble()[0].array_r
            b.array[rows] = x.array_r[rows] - given

        def tangent(snes, x, K, P):
            self.take(x.array_r)
            self.assemble()[1].copy(K)
            K.zeroRows(rows + np.int32(self.first), 1.0)

        r, K = self.assemble()
        K.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        snes, x = PETSc.SNES().create(self.domain.comm), r.duplicate()
        snes.setFunction(residual, r)
        snes.setJacobian(tangent, K)
        snes.getKSP().setType("preonly")
        snes.getKSP().getPC().setType("lu")
        snes.getKSP().getPC().setFactorSolverType("mumps")
        snes.setTolerances(rtol=0.0, atol=1e-12, max_it=50)
        snes.setErrorIfNotConverged(True)
        x.array = self.u.x.array[: self.owned]
        snes.solve(None, x)
        self.take(x.array_r)


def main(n=4):
    """Press a wave exactly and by penalty: exponent of the force, and the part that the penalty lacks."""
    domain = mesh.create_box(MPI.COMM_WORLD, [[0, 0, 0], [1, 1, 1]], [n, n, n])
    x, y, z = domain.geometry.x.T
    domain.geometry.x[:, 2] += z * 0.02 * (np.cos(2 * np.pi * x) + np.cos(2 * np.pi * y))
    approaches, soft = np.linspace(0.003, 0.03, 10), Block(domain)
    soft.stiffness.x.array[:] = PENALTY * E * 2**2 / (2**0.5 / n)
    exact, penalty = Block(domain).press(1.04, approaches), soft.press(1.04, approaches, exactly=False)
    fit = scipy.optimize.curve_fit(lambda d, k, m: np.log(k) + m * np.log(d), approaches, np.log(exact), p0=(1, 1.5))
    print(f"P/(E L^2) = {fit[0][0]:.3g} (delta/L)^{fit[0][1]:.3f}")
    return float(fit[0][1]), float(1.0 - penalty[-1] / exact[-1])


if __name__ == "__main__":
    main()
