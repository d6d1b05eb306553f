"""Bars of solids that yield against another discretisation: quadrilaterals in a plane, and around an axis.

    python3 benchmarks/yielding.py [CASE]...

Grooves and a paraboloid are pressed to 5 % and released. Their truth is plane strain, or a cylinder of the area of the
patch, with quadrilaterals of second order, four points in each, on a mesh of its own, and backward Euler in N and 2 N
steps, extrapolated: elements, mesh, rule and dimension are others, and the laws are forms written here. The truth is
unsure by a fifth of its last extrapolation and 0.2 %, the cylinder by 0.3 %; not counted is what a mesh of 160 instead
of 96 quadrilaterals changes in the force of the hard grooves, 0.2 to 0.6 %. The ridges have 223 columns of elements, as
fine in their spots as 400 and 800 equal ones. Prints one line a case: steps inside the
bars of the force of loading and unloading, greatest errors and bars, error of the approach left, dofs, CPU seconds.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from time import process_time

import basix.ufl
import dolfinx
import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.fem.petsc import assemble_matrix, assemble_vector
from mpi4py import MPI
from petsc4py import PETSc
from scipy.interpolate import PchipInterpolator

import asperity as asp
from asperity.arrays import Floats
from asperity.surface import HeightMap, Sphere, Surface

STEPS, PARTS = 5, 5  # of the runs, and of each step of the coarser truth
TOLERANCE, UNSURE, UNSURE_AXIS = 0.05, 0.002, 0.003
RADIUS = np.pi**-0.5  # of the cylinder
GAUSS = {"quadrature_degree": 3}


def grooves(slope: float) -> Surface:
    """A rough profile, the same at all y."""
    rng, x = np.random.default_rng(7), np.linspace(0.0, 1.0, 257)
    z = sum(k**-1.4 * np.cos(2.0 * np.pi * (k * x + rng.random())) for k in range(1, 8))
    return HeightMap.of(np.tile(slope * z / np.sqrt(np.mean(np.gradient(z, x) ** 2)), (257, 1)), 1.0)


def ridges(radii: tuple[float, float]) -> Surface:
    """Two ridges of one height along y, with these radii at their summits."""
    x, height = np.linspace(0.0, 1.0, 513), 0.01
    z = sum(height * np.exp(-((x - at) ** 2) / (2.0 * height * r)) for at, r in zip((0.3, 0.78), radii, strict=True))
    return HeightMap.of(np.tile(z, (513, 1)), 1.0)


def cap(radius: float) -> Surface:
    """A paraboloid in the middle."""
    return asp.Surface.from_spec("sphere", L=1.0, radius=radius, centre=(0.5, 0.5), shape="paraboloid")


SOFT, HARD = (2e-3, 1e-3), (3e-3, 0.1)  # yield strength and tangent modulus over E
#: Surface, around an axis, approach, material
CASES: dict[str, tuple[Surface, bool, float, asp.Material]] = {
    "cap soft": (cap(6.0), True, 4e-3, asp.Material(1.0, 0.3, *SOFT)),
    "cap hard kinematic": (cap(6.0), True, 4e-3, asp.Material(1.0, 0.3, *HARD, hardening="kinematic")),
    "cap finite": (cap(2.0), True, 8e-3, asp.Material(1.0, 0.3, 4e-3, 0.02, kinematics="finite")),
    "cap soft finite": (cap(3.0), True, 6e-3, asp.Material(1.0, 0.3, *SOFT, kinematics="finite")),
    "grooves soft": (grooves(0.03), False, 2e-3, asp.Material(1.0, 0.3, *SOFT)),
    "grooves hard kinematic": (grooves(0.03), False, 2e-3, asp.Material(1.0, 0.3, *HARD, hardening="kinematic")),
    "grooves finite": (grooves(0.1), False, 8e-3, asp.Material(1.0, 0.3, 4e-3, 0.02, kinematics="finite")),
    "ridges": (ridges((2.0, 0.08)), False, 2e-3, asp.Material(1.0, 0.45, 2e-3, 0.02)),
}
# Places, half-widths and sizes of elements of spots of different widths; other profiles have 96 elements
SPOTS = {"ridges": ((0.3, 0.11, 2.5e-3), (0.78, 0.03, 1.25e-3))}


def graded(sizes: Floats, length: float) -> Floats:
    """Coordinates from 0 to a length with elements of these sizes, the last of which goes on."""
    ends = np.append(0.0, np.cumsum(sizes))
    return np.asarray(ends[: np.searchsorted(ends, length) + 1] * length / ends[np.searchsorted(ends, length)])


def around(spots: Sequence[tuple[float, float, float]], scale: float) -> Floats:
    """Coordinates from 0 to 1 with small elements in the spots, see SPOTS, which grow around them."""
    x = [0.0]
    while x[-1] < 1.0:
        sizes = (h + 0.12 * max(0.0, abs(x[-1] - at) - half) for at, half, h in spots)
        x.append(x[-1] + scale * min(0.02, *sizes))
    return np.array(x) / x[-1]


def quadrilaterals(x: Floats, z: Floats) -> mesh.Mesh:
    """Mesh of a grid."""
    points = np.stack(np.meshgrid(x, z), axis=-1).reshape(-1, 2)
    i, j = np.meshgrid(np.arange(len(x) - 1), np.arange(len(z) - 1))
    first = (j * len(x) + i).ravel()
    cells = np.stack([first, first + 1, first + len(x), first + len(x) + 1], axis=-1).astype(np.int64)
    return mesh.create_mesh(MPI.COMM_SELF, cells, points, basix.ufl.element("Q", "quadrilateral", 1, shape=(2,)))


def logarithm(C: ufl.core.expr.Expr) -> ufl.core.expr.Expr:
    """Half the logarithm of a symmetric 2 x 2 tensor."""
    m, d, c = (C[0, 0] + C[1, 1]) / 2, (C[0, 0] - C[1, 1]) / 2, C[0, 1]
    q = (d * d + c * c) / m**2
    x = ufl.sqrt(ufl.max_value(q, 0.01))
    series = sum(q**k / (2 * k + 1) for k in range(6))
    part = ufl.conditional(ufl.lt(q, 0.01), series, ufl.ln((1 + x) / (1 - x)) / (2 * x)) / m
    return ufl.ln(m * m * (1 - q)) / 4 * ufl.Identity(2) + part / 2 * ufl.as_matrix([[d, c], [c, -d]])


class Plane:
    """A solid in plane strain or around an axis, J2 with linear hardening; its top is pressed by a flat."""

    def __init__(self, x: Floats, surface: Surface, axis: bool, law: asp.Material) -> None:
        h = float(np.diff(x).min())
        z = 1.0 - graded(np.minimum(h * np.r_[np.ones(4), 1.25 ** np.arange(1, 60)], 0.08), 1.0)[::-1]
        domain = quadrilaterals(x, z)
        profile = surface.height(*((0.5 + domain.geometry.x[:, 0], 0.5) if axis else (domain.geometry.x[:, 0], 0.5)))
        domain.geometry.x[:, 1] *= 1.0 + profile - surface.mean()
        V = fem.functionspace(domain, ("Lagrange", 2, (2,)))
        at, side = V.tabulate_dof_coordinates(), float(x[-1])
        edges = [(lambda p: np.isclose(p[0], 0.0), 0), (lambda p: np.isclose(p[0], side), 0)]
        edges += [(lambda p: np.isclose(p[1], 0.0), 0), (lambda p: np.isclose(p[1], 0.0), 1)]
        found = [2 * fem.locate_dofs_geometrical(V, where) + k for where, k in edges]
        self.fixed = np.unique(np.concatenate(found)).astype(np.int32)
        domain.topology.create_connectivity(1, 2)
        outer = mesh.exterior_facet_indices(domain.topology)
        middle = mesh.compute_midpoints(domain, 1, outer)
        top = outer[(middle[:, 1] > 0.5) & (middle[:, 0] > 1e-9) & (middle[:, 0] < side - 1e-9)]
        nodes = fem.locate_dofs_topological(V, 1, top)
        nodes = nodes[np.argsort(at[nodes, 0])]
        self.top, self.height, self.axis = (2 * nodes + 1).astype(np.int32), at[nodes, 1], axis
        self.u, v, du = fem.Function(V), ufl.TestFunction(V), ufl.TrialFunction(V)
        five = basix.ufl.quadrature_element("quadrilateral", value_shape=(5,), degree=3)
        self.h = fem.Function(fem.functionspace(domain, five))  # plastic strain rr, zz, rz, tt, accumulated
        r = ufl.SpatialCoordinate(domain)[0]
        G, hoop = ufl.grad(self.u), self.u[0] / r if axis else 0 * self.u[0]
        if law.finite:
            F = ufl.Identity(2) + G
            flat, hoop = logarithm(F.T * F), ufl.ln(1 + hoop)
        else:
            flat = ufl.sym(G)
        strain = ufl.as_matrix([[flat[0, 0], flat[0, 1], 0], [flat[1, 0], flat[1, 1], 0], [0, 0, hoop]])
        stress, after = self._j2(strain, law)
        around = 2 * np.pi * r if axis else 1.0
        work = around * ufl.inner(stress, ufl.derivative(strain, self.u, v)) * ufl.dx(domain, metadata=GAUSS)
        self.residual, self.tangent = fem.form(work), fem.form(ufl.derivative(work, self.u, du))
        self.after, self.domain = fem.Expression(after, five.custom_quadrature()[0]), domain
        self.held = self.top[:0]

    def _j2(self, strain: ufl.core.expr.Expr, law: asp.Material) -> tuple[ufl.core.expr.Expr, ufl.core.expr.Expr]:
        """Stress and new history: Simo & Hughes, Computational Inelasticity (1998), box 3.2."""
        h, (lam, mu), H = self.h, law.lame, law.plastic_modulus
        plastic = ufl.as_matrix([[h[0], h[2], 0], [h[2], h[1], 0], [0, 0, h[3]]])
        back = 2 / 3 * law.kinematic_share * H
        s = 2 * mu * ufl.dev(strain - plastic) - back * plastic
        size = law.yield_strength + (1 - law.kinematic_share) * H * h[4]
        q = ufl.sqrt(ufl.max_value(1.5 * ufl.inner(s, s), size**2))
        flow = (q - size) / (3 * mu + H)
        new = plastic + 1.5 * flow / q * s
        elastic = strain - new
        after = ufl.as_vector([new[0, 0], new[1, 1], new[0, 1], new[2, 2], h[4] + flow])
        return lam * ufl.tr(elastic) * ufl.Identity(3) + 2 * mu * elastic, after

    def step(self, flat: float) -> float:
        """Force under a flat at a height."""
        u, left = self.u.x.array, 0.0
        for _ in range(200):
            r = assemble_vector(self.residual).array
            depth = self.height + u[self.top] - flat
            held = np.isin(self.top, self.held)
            if left < 1e-7:  # what touches changes where the equations are nearly solved
                active = np.where(held, -r[self.top] > 0.0, depth > 1e-14)
                if self.axis:  # a pressure has no nodal force there
                    active[0] = active[1]
                if left and left < 1e-11 and np.array_equal(active, held):
                    break
                held, self.held = active, self.top[active]
            rows = np.concatenate([self.fixed, self.held])
            b = -r
            b[self.fixed], b[self.held] = 0.0, -depth[held]
            left = float(np.abs(b).max()) + 1e-300
            K = assemble_matrix(self.tangent)
            K.assemble()
            wrong = K.createVecRight()
            wrong.array[:] = 0.0
            wrong.array[self.held] = b[self.held]
            right = K.createVecLeft()
            right.array[:] = b
            K.zeroRowsColumns(rows, 1.0, wrong, right)
            ksp = PETSc.KSP().create(MPI.COMM_SELF)
            ksp.setOperators(K)
            ksp.setType("preonly")
            ksp.getPC().setType("lu")
            ksp.getPC().setFactorSolverType("mumps")
            ksp.solve(right, wrong)
            change, part = wrong.array.copy(), 1.0
            slope = float(b @ change)
            u += change
            while not b[self.held].any() and part > 0.02:  # the work of a step is convex
                after = -assemble_vector(self.residual).array
                after[rows] = 0.0
                if abs(now := float(after @ change)) <= 0.6 * abs(slope) + 1e-20:
                    break
                new = part * max(0.2, slope / (slope - now)) if now < 0.0 else 0.0
                if not new:
                    break
                u += (new - part) * change
                part = new
            for one in (ksp, K, wrong, right):
                one.destroy()
        else:
            raise RuntimeError("Newton's method does not converge")
        force = -float(assemble_vector(self.residual).array[self.held].sum())
        cells = np.arange(self.domain.topology.index_map(2).size_local, dtype=np.int32)
        dofs = self.h.function_space.dofmap.list[cells]
        self.h.x.array.reshape(-1, 5)[dofs] = self.after.eval(self.domain, cells).reshape(*dofs.shape, 5)
        return force

    def move(self, start: float, end: float, parts: int = 1) -> float:
        """Force after a step, which is halved where Newton's method fails."""
        kept = [self.u.x.array.copy(), self.h.x.array.copy(), self.held]
        try:
            return self.step(end)
        except RuntimeError:
            if parts > 8:
                raise
        self.u.x.array[:], self.h.x.array[:], self.held = kept
        self.move(start, 0.5 * (start + end), 2 * parts)
        return self.move(0.5 * (start + end), end, 2 * parts)

    def press(self, summit: float, depth: float, steps: int) -> tuple[Floats, Floats]:
        """Approaches and forces of a loading in equal steps and of its unloading until the flat lifts off."""
        at, force = [0.0], [0.0]
        for k in range(1, steps + 1):
            at.append(depth * k / steps)
            force.append(self.move(summit - at[-2], summit - at[-1]))
        while force[-1] > 0.0:
            at.append(at[-1] - 0.5 * depth / steps)
            force.append(self.move(summit - at[-2], summit - at[-1]))
        return np.array(at), np.array(force)


def truth(name: str, scale: float = 1.0) -> tuple[tuple[PchipInterpolator, PchipInterpolator, float], ...]:
    """Force over E' L^2 of loading and unloading, of the approach, and the approach left, in N and in 2 N steps."""
    surface, axis, depth, law = CASES[name]
    if isinstance(surface, Sphere):
        contact = (2.0 * depth * surface.radius) ** 0.5
        sizes = scale * contact / 20 * np.r_[np.ones(int(26 / scale)), 1.2 ** np.arange(1, 60)]
        x = graded(np.minimum(sizes, 0.08), RADIUS)
    elif name in SPOTS:
        x = around(SPOTS[name], scale)
    else:
        x = np.asarray(np.linspace(0.0, 1.0, round(96 / scale) + 1))
    summit, found = 1.0 + surface.maximum()[2] - surface.mean(), []
    for steps in (PARTS * STEPS, 2 * PARTS * STEPS):
        at, load = Plane(x, surface, axis, law).press(summit, depth, steps)
        force = np.asarray(load / law.reduced_modulus, dtype=float)
        back = slice(None, steps - 1, -1)
        down = PchipInterpolator(at[back][1:], force[back][1:], extrapolate=True)
        # the last two states with a force, which ends like a power of 3/2
        (d2, d1), (p2, p1) = at[-3:-1], force[-3:-1] ** (2.0 / 3.0)
        left = d1 - p1 * (d2 - d1) / (p2 - p1)
        found.append((PchipInterpolator(at[: steps + 1], force[: steps + 1]), down, left))
    return tuple(found)


def judge(name: str) -> None:
    """Press a case to its tolerance and print its line."""
    surface, axis, depth, law = CASES[name]
    start = process_time()
    run = asp.solve_contact(surface, law, tolerance=TOLERANCE, delta_max=depth, steps=STEPS, unload_steps=5)
    seconds = process_time() - start
    (up, down, left), (up2, down2, left2) = truth(name)
    curve, at = run.curve, depth * np.arange(1, STEPS + 1) / STEPS
    loading, back = curve.loading(), curve.where((curve.branch == "unload") & (curve.P_star > 0.0))
    line = []
    for c, one, two, where in ((loading, up, up2, at), (back, down, down2, back.delta_star[::-1])):
        order = np.argsort(c.delta_star)
        P, bar = (np.interp(where, c.delta_star[order], v[order]) for v in (c.P_star, c.error_P_star))
        exact = 2.0 * two(where) - one(where)
        unsure = 0.2 * np.abs(two(where) - one(where)) + (UNSURE + UNSURE_AXIS * axis) * exact
        top = exact if c is loading else float(2.0 * up2(depth) - up(depth))
        error = (P - exact) / top
        line += [
            f"{np.sum(np.abs(P - exact) <= bar + unsure)}/{len(P)}",
            f"{100 * error[np.argmax(np.abs(error))]:+.1f} %",
        ]
        line += [f"{100 * np.max(bar / top):.1f} %"]
    exact = 2.0 * left2 - left
    line.append(f"{100 * (curve.delta_star[-1] / exact - 1.0):+.2f} %")
    print("| " + " | ".join([name, *line, f"{run.levels[-1].dofs}", f"{seconds:.0f}"]) + " |", flush=True)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    dolfinx.log.set_log_level(dolfinx.log.LogLevel.WARNING)
    head = (
        "case, inside, greatest error, bar, unloading inside, greatest error, bar, error of approach left, dofs, CPU s"
    )
    print("| " + " | ".join(head.split(", ")) + " |\n|" + " --- |" * 10)
    for name in sys.argv[1:] or CASES:
        judge(name)
