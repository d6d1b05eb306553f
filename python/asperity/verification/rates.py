"""Observed orders of convergence, for each formulation of contact."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi

import numpy as np

from asperity.arrays import Floats
from asperity.contact.contact_surface import ContactSurface
from asperity.contact.make import make_contact
from asperity.fem.solid import Solid
from asperity.mesh.distribute import distribute
from asperity.mesh.generate import build_block
from asperity.model.material import Material
from asperity.model.settings import Formulation
from asperity.surface import Flat
from asperity.verification.hertz import CONTACT, RADIUS, layer_force, press_sphere
from asperity.verification.solids import CellRule, equilibrium
from asperity.verification.table import RATIO, Row, VerificationLevel

NU = 0.3
LAM, MU = Material(1.0, NU).lame
WAVE, APPROACH = 0.01, 0.03  # size of the manufactured wave and of the uniform compression added to it [L]
EXACT = "active-set"
FORMULATIONS = {
    EXACT: Formulation(),
    "penalty": Formulation("penalty"),
    "nitsche": Formulation("nitsche"),
}


def rates(level: VerificationLevel) -> Iterator[Row]:
    """Orders in the element size: a manufactured smooth solution in full contact, and Hertz.

    For Hertz the whole mesh is refined with the contact; the error of the finest force is still far above the error of
    theory. The penalty method is not consistent: its penetration p h/(4 beta E) is of first order and finally dominates
    all errors. For Hertz this part is the difference of its force from that of exact contact on the same mesh.
    """
    smooth = 0.25 * RATIO ** -np.arange(1, 5)
    refinements = 0.5 * RATIO ** np.arange(1, 6)
    h_contact: Floats = np.asarray(1.0 / refinements, dtype=np.float64)
    hertz, _ = layer_force([CONTACT**2 / RADIUS], 1024)
    forces = {}
    for name in FORMULATIONS if level.full else (EXACT,):
        formulation = FORMULATIONS[name]
        size, L2, energy = np.array([manufactured(h, formulation) for h in smooth]).T
        forces[name] = np.array([press_sphere(k, formulation).curve.P_star[-1] for k in refinements])
        consistent = formulation.method != "penalty"
        yield _order(f"displacement in L2, smooth, {name}", 3.0 if consistent else 1.0, size, L2)
        yield _order(f"strain energy norm, smooth, {name}", 2.0 if consistent else 1.0, size, energy)
        if consistent:
            yield _order(f"force, Hertz, {name}", 2.0, h_contact, forces[name] / hertz - 1.0)
        else:
            difference = forces[name] / forces[EXACT] - 1.0
            yield _order(f"force, Hertz, {name} against {EXACT}", 1.0, h_contact, difference)


def _order(name: str, expected: float, sizes: Floats, errors: Floats) -> Row:
    """Order of the errors (n,) in the element sizes (n,), with the 95 % confidence interval of the fit as its bar."""
    from scipy.stats import linregress, t

    fit = linregress(np.log(sizes), np.log(np.abs(errors)))
    spread = float(t.ppf(0.975, len(sizes) - 2) * fit.stderr)
    return Row("rates", name, "at least", expected, float(fit.slope), spread, scale=1.0, at_least=True)


class Manufactured:
    """A smooth displacement that satisfies the boundary conditions of the block under a flat in full contact.

    u = w (sin pi x cos pi y f, cos pi x sin pi y f, cos pi x cos pi y g) - (0, 0, d z), f = z^2 (3 - 2 z) and
    g = z^2 (1 - z): clamped at z = 0, no normal displacement and no shear on the sides, and at z = 1 no shear and
    the uniform displacement -d under a pressure that is positive everywhere.
    """

    def displacement(self, x: Floats) -> Floats:
        """Displacement at points (..., 3): (..., 3) [L]."""
        (sx, sy), (cx, cy), z = _waves(x)
        f, g = z**2 * (3 - 2 * z), z**2 * (1 - z)
        return np.stack([WAVE * sx * cy * f, WAVE * cx * sy * f, WAVE * cx * cy * g - APPROACH * z], axis=-1)

    def gradient(self, x: Floats) -> Floats:
        """Gradient du_i/dx_j at points (..., 3): (..., 3, 3)."""
        (sx, sy), (cx, cy), z = _waves(x)
        f, df, g, dg = z**2 * (3 - 2 * z), 6 * z * (1 - z), z**2 * (1 - z), z * (2 - 3 * z)
        rows = (
            (pi * cx * cy * f, -pi * sx * sy * f, sx * cy * df),
            (-pi * sx * sy * f, pi * cx * cy * f, cx * sy * df),
            (-pi * sx * cy * g, -pi * cx * sy * g, cx * cy * dg),
        )
        out = WAVE * np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
        out[..., 2, 2] -= APPROACH
        return out

    def body_force(self, x: Floats) -> Floats:
        """Body force -div sigma at points (..., 3): (..., 3) [force/length^3]."""
        (sx, sy), (cx, cy), z = _waves(x)
        f, ddf, g, ddg = z**2 * (3 - 2 * z), 6 - 12 * z, z**2 * (1 - z), 2 - 6 * z
        dilatation = 2 * pi * f + z * (2 - 3 * z)
        slope = 2 * pi * 6 * z * (1 - z) + ddg
        along = -pi * (LAM + MU) * dilatation + MU * (ddf - 2 * pi**2 * f)
        return -WAVE * np.stack(
            [sx * cy * along, cx * sy * along, cx * cy * ((LAM + MU) * slope + MU * (ddg - 2 * pi**2 * g))], axis=-1
        )


def _waves(x: Floats) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats], Floats]:
    u, v, z = np.moveaxis(x, -1, 0)
    return (np.sin(pi * u), np.sin(pi * v)), (np.cos(pi * u), np.cos(pi * v)), z


def manufactured(h: float, formulation: Formulation) -> tuple[float, float, float]:
    """Mean element size [L], and relative errors of the displacement in L2 and of the strain in the energy norm."""
    from mpi4py import MPI

    exact = Manufactured()
    mesh, tags = distribute(MPI.COMM_SELF, build_block(Flat(L=1.0), 1.0, lambda *_: h), 1.0)
    solid = Solid(mesh, tags, Material(1.0, NU))
    top = ContactSurface(solid)
    rule = CellRule(solid, 6)
    load = np.zeros((solid.owned, 3))
    np.add.at(
        load, solid.cell_nodes, np.einsum("cq,qa,cqi->cai", rule.weights, rule.shape, exact.body_force(rule.points))
    )
    contact = make_contact(formulation, solid, top)
    u = equilibrium(solid, contact, load, 1.0 - APPROACH, np.zeros_like(load), rtol=1e-10)[solid.cell_nodes]
    found = np.einsum("qa,cai->cqi", rule.shape, u)
    strain = np.einsum("cqaj,cai->cqij", rule.gradients, u)

    def norms(displacement: Floats, gradient: Floats) -> Floats:
        e = 0.5 * (gradient + np.swapaxes(gradient, -1, -2))
        energy = LAM * np.trace(e, axis1=-2, axis2=-1) ** 2 + 2 * MU * np.sum(e**2, axis=(-1, -2))
        return np.sqrt([np.sum(rule.weights * np.sum(displacement**2, axis=-1)), np.sum(rule.weights * energy)])

    u_exact, du_exact = exact.displacement(rule.points), exact.gradient(rule.points)
    L2, energy = norms(found - u_exact, strain - du_exact) / norms(u_exact, du_exact)
    return float(np.cbrt(1.0 / len(u))), float(L2), float(energy)
