"""An eighth of a thick hollow sphere under internal pressure, against the solution of Hill."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from asperity import reference
from asperity.arrays import Floats
from asperity.contact import ActiveSet
from asperity.contact.contact_surface import ContactSurface
from asperity.fem.solid import Solid
from asperity.mesh.distribute import distribute
from asperity.mesh.element import QUADRATURE_DEGREE
from asperity.model.material import Material
from asperity.verification.solids import CellRule, eighth_sphere, equilibrium, planes_of_symmetry
from asperity.verification.table import KINK, LOCAL, Row, VerificationLevel, on_meshes, rows_along

INNER, OUTER, PLASTIC = 0.5, 1.0, 0.75  # radii of the faces and of the plastic zone
E, NU, Y = 1.0, 0.3, 0.002  # stresses in E; any ratio does, as Hill's solution has small strain
STEPS = 4  # the stress of each point keeps its direction, so the load steps cause no error
SIZE = 0.17  # of the elements of the coarsest mesh, three over the thickness


@dataclass(frozen=True)
class _State:
    """Mean radial displacements of the faces, rms errors of the stresses over Y, integral of the plastic strain."""

    inner: float
    outer: float
    radial: float
    hoop: float
    flow: float


def pressurised_sphere(level: VerificationLevel) -> Iterator[Row]:
    """Elastic-plastic displacement, stress and plastic zone; Hill, Plasticity (1950), V.2, and with hardening."""
    for tangent in (0.0, 0.1):
        theory = reference.PressurisedSphere(INNER, OUTER, E, NU, Y, tangent)
        states = on_meshes(level, partial(_inflate, theory))
        for name, key, expected, order in (
            ("displacement of the inner face", "inner", theory.displacement(INNER, PLASTIC), KINK),
            ("displacement of the outer face", "outer", theory.displacement(OUTER, PLASTIC), KINK),
            ("rms error of the radial stress over Y", "radial", 0.0, LOCAL),
            ("rms error of the hoop stress over Y", "hoop", 0.0, LOCAL),
            ("plastic strain, integral over the volume", "flow", _flow(theory), KINK),
        ):
            yield from rows_along(
                "thick-sphere", [f"{name}, E_t = {tangent:g} E"], "Hill", [getattr(s, key) for s in states],
                float(expected), order=order,
            )  # fmt: skip


def _inflate(theory: reference.PressurisedSphere, refinement: float) -> _State:
    """Solve for the pressure at which the plastic zone has the radius PLASTIC."""
    from mpi4py import MPI

    mesh, tags = distribute(MPI.COMM_SELF, eighth_sphere(OUTER, INNER, lambda *_: SIZE / refinement), 1.0)
    solid = Solid(mesh, tags, Material(E, NU, Y, theory.E_t))
    solid.fixed = planes_of_symmetry(solid)
    top = ContactSurface(solid)
    load = theory.pressure(PLASTIC) * _unit_load(solid, top)
    u = np.zeros((solid.owned, 3))
    for k in range(STEPS):
        u = equilibrium(solid, ActiveSet(solid, top), load * (k + 1) / STEPS, np.inf, u)
    x = solid.points
    r = np.linalg.norm(x, axis=1)
    radial = np.einsum("ni,ni->n", u, x) / r
    rule = CellRule(solid, QUADRATURE_DEGREE)
    direction = rule.points / np.linalg.norm(rule.points, axis=2, keepdims=True)
    xx, yy, zz, xy, xz, yz = np.moveaxis(solid.kernels.stress(u), -1, 0)
    tensor = np.stack([np.stack(t, -1) for t in ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))], -2)
    normal = np.einsum("cqi,cqij,cqj->cq", direction, tensor, direction)
    hoop = 0.5 * (xx + yy + zz - normal)
    at = np.linalg.norm(rule.points, axis=2)

    def rms(difference: Floats) -> float:
        return float(np.sqrt(np.sum(rule.weights * difference**2) / np.sum(rule.weights)) / Y)

    return _State(
        float(radial[r < INNER + 1e-9].mean()),
        float(radial[r > OUTER - 1e-9].mean()),
        rms(normal - theory.radial_stress(at, PLASTIC)),
        rms(hoop - theory.hoop_stress(at, PLASTIC)),
        float(np.sum(rule.weights * solid.kernels.history().accumulated)),
    )


def _flow(theory: reference.PressurisedSphere) -> float:
    """Integral of the accumulated plastic strain over the eighth."""
    from scipy.integrate import quad

    return float(quad(lambda r: 0.5 * np.pi * r**2 * float(theory.plastic_strain(r, PLASTIC)), INNER, PLASTIC)[0])


def _unit_load(solid: Solid, top: ContactSurface) -> Floats:
    """Nodal forces of a unit pressure on the inner face (owned, 3), integrated over the curved facets."""
    import basix

    corners = top.nodes[:, :3]
    inner = np.linalg.norm(solid.points[corners[:, 0]], axis=1) < 0.5 * (INNER + OUTER)
    nodes = top.nodes[inner]
    points, weights = basix.make_quadrature(basix.CellType.triangle, 6)
    element = basix.create_element(basix.ElementFamily.P, basix.CellType.triangle, 2, basix.LagrangeVariant.gll_warped)
    shape, along, across = element.tabulate(1, points)[..., 0]
    x = solid.points[nodes]
    normal = np.cross(np.einsum("qa,fai->fqi", along, x), np.einsum("qa,fai->fqi", across, x))
    outward = np.sign(np.einsum("fqi,fai->fq", normal, x))[..., None]  # away from the centre
    out = np.zeros((solid.owned, 3))
    np.add.at(out, nodes, np.einsum("q,qa,fqi->fai", weights, shape, normal * outward))
    return out
