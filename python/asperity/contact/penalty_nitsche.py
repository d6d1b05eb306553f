"""Contact by a pressure at quadrature points of the facets: the penalty method and Nitsche's method."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from asperity.arrays import Flags, Floats, Integers
from asperity.contact.contact_surface import FACET_DEGREE, ContactSurface, FacetRule
from asperity.contact.interface import Contact
from asperity.fem.history import History
from asperity.fem.kernels import compiled, law_of
from asperity.fem.solid import Solid
from asperity.mesh.element import DEGREE
from asperity.model.material import Material
from asperity.runtime.compiled import solver as _solver

ROUNDING = 1e-9  # of a part of the area next to a node
OUTWEIGHED = 2.0  # measured with Hertz: mean error of the area below 1 % with 10 and 100 E/h and Nitsche's method


class PressureContact(Contact):
    """The flat presses with P = <g d - k t>_+, g = factor M p^2/h, d the penetration, p the degree of the elements.

    t is the z component of the traction of the solid; P and t are per area projected on the flat. The virtual work is
    int P v_z. solver/facets.hpp holds the kernels.

    k = 0: penalty method. k = 1: Nitsche's method (Chouly, Hild & Renard, Math. Comp. 84 (2015) 1089, theta = 0),
    consistent. t has the stress of the linear function through those at the points of the cell, where its history is.

    The penalty method has M = E and h the diameter of the facet. Nitsche's has M = lambda + 2 mu, the stiffness along
    the normal, which is unbounded towards nu = 0.5 (Hansbo & Larson, Comput. Methods Appl. Mech. Engrg. 191
    (2002) 1895), and h = 3 |K|/|F| the height of the cell over the facet: t^2 is at most (lambda + 2 mu) sigma:eps, and
    the mean of the square of a linear stress over a facet at most 8/3 of that over the cell (Warburton & Hesthaven,
    ibid. 192 (2003) 2765), so full contact is coercive for gamma > 1/2 where cells are straight. Plastic flow only
    lowers the stiffness along the normal, so the elastic one is sufficient there too.

    Args:
        factor: dimensionless beta (penalty) or gamma (Nitsche)
        traction: k
    """

    def __init__(self, solid: Solid, surface: ContactSurface, factor: float, *, traction: bool) -> None:
        self._solid, self.surface = solid, surface
        self._rule = FacetRule(surface, FACET_DEGREE)
        self.symmetric, self.has_tangent = not traction, True
        if traction:
            lam, mu = solid.material.lame
            modulus, h = lam + 2.0 * mu, 3.0 * solid.kernels.volumes[surface.cells].sum(axis=1) / surface.area
        else:
            modulus, h = solid.material.E, surface.diameter
        rule, material = self._rule, solid.material if traction else Material(solid.material.E, solid.material.nu)
        stiffness = factor * modulus * DEGREE**2 / h
        numbers = solid.material.finite, stiffness, rule.height, traction, rule.cells, rule.of_cells
        self._law, self._elastic_law = (
            _solver.ContactLaw(law_of(material, flows), *numbers) for flows in (True, False)
        )
        self._has_history = traction and solid.material.plastic
        self.points = np.zeros(self._rule.weights.shape)  # pressure at the quadrature points (facets, points)
        self._pattern = _solver.BlockPattern(surface.cell_nodes, solid.sparsity.indptr, solid.sparsity.indices)
        self._z = np.inf

    def begin(self, z: float) -> None:
        self._z = z

    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]:
        u = self._solid.u.x.array.reshape(-1, 3)
        _solver.facet_pressure(self._rule.facets, self._law, self._z, u, compiled(self._below()), self.points)
        load = np.zeros((self._solid.nodes, 1))
        np.add.at(load[:, 0], self.surface.nodes, (self._rule.weights * self.points) @ self._rule.of_nodes)
        self._force = self._solid.scatter_reverse(load)[:, 0]
        out = force.copy()
        out[:, 2] += self._force
        return out, np.empty(0, dtype=np.int32), np.empty(0)

    def add_tangent(self) -> None:
        self._add_stiffness(self._law, self._below())

    def add_elastic_tangent(self) -> None:
        self._add_stiffness(self._elastic_law, self._below(trial=True))

    def _add_stiffness(self, law: _solver.ContactLaw, below: History) -> None:
        u, values = self._solid.u.x.array.reshape(-1, 3), self._solid.tangent.values()
        _solver.facet_stiffness(self._rule.facets, law, u, compiled(below), self.points, self._pattern, values)

    def _below(self, trial: bool = False) -> History:
        """History of the cells of the facets, where the traction depends on it."""
        kernels = self._solid.kernels
        if not self._has_history:
            return History.zeros(0, 0)
        history, cells = kernels.last if trial else kernels.history(), self.surface.cells
        return History(**{name: values[cells] for name, values in history.arrays().items()})

    def nodes(self) -> Integers:
        """Owned nodes that are touched, or where none is, in a contact of a few points, that bear most; collective."""
        owned, force, comm = self.surface.owned_nodes, self._force, self._solid.comm
        touched = self.touched_edges()[owned]
        if not comm.allreduce(int(touched.sum())):
            most = comm.allreduce(float(np.max(force[owned], initial=0.0)), op=MPI.MAX)
            touched = (force[owned] > 0.0) & (force[owned] >= 0.5 * most)
        return owned[touched]

    def nodal_force(self, force: Floats) -> Floats:
        return self._force.copy()

    def penetration_work(self) -> float:
        # at the points, where the law holds; the penetration of a node between them depends on the size of the facets
        uz = self._solid.u.x.array.reshape(-1, 3)[self.surface.nodes, 2]
        touched = self.points > 0.0
        depth = (self._rule.height + self._rule.at_points(uz) - self._z)[touched]
        return float(np.sum((self._rule.weights * self.points)[touched] * depth))

    def touched(self) -> tuple[Flags, Floats]:
        """As with exact contact; one within a few facets, without an edge node, is that of points under pressure."""
        touched, areas = super().touched()
        return (touched, areas) if areas.any() else (self.points > 0.0, self._rule.weights)

    def touched_edges(self) -> Flags:
        """Nodes whose force outweighs their gap: P a > 2 E g, P their mean pressure, a the root of their area.

        Pressures at points oscillate where the contact is stiff or the solid nearly incompressible. The force of a node
        does not; and of exact contact, whose gap is zero where there is a force, the nodes are the same. They are on
        edges; a corner is touched where more than half of what is next to it is. A half that rounding makes more or
        less, as other ranks add other parts first, is none.
        """
        solid, area = self._solid, self.surface.bearing_area()
        gap = self._z - self.surface.elevation(np.arange(solid.nodes))
        force = solid.ghosts.scatter_forward(self._force[:, None])[:, 0]
        pressed = (area > 0.0) & (force > 0.0)
        pressed[pressed] = force[pressed] > OUTWEIGHED * np.sqrt(area[pressed]) * gap[pressed]
        return np.asarray(pressed | (self.surface.pressure(area * pressed) > 0.5 + ROUNDING))
