"""Relaxation of the volumetric strain within cells that flow: its potential, its tangent, forces that are held, energy,
orders, a spot as small as an element."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from element_sample import Sample, difference, sample
from scipy.optimize import minimize

import asperity as asp
from asperity.arrays import Flags
from asperity.errors import CheckError
from asperity.fem.history import extrapolate
from asperity.fem.kernels import relaxation_of
from asperity.mesh.block import BlockMesh
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT
from asperity.model.material import PAIRS, Material
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.stepping import midpoint_lead
from asperity.surface import Surface

Array = npt.NDArray[np.float64]

E, NU, Y = 1.0, 0.3, 0.005
STEEL = Material(E, NU, Y, 0.05)
STRETCHED = Material(E, NU, Y, 0.05, kinematics="finite")
KINDS = pytest.mark.parametrize("material", [STEEL, STRETCHED], ids=["small", "finite"])


def noise(it: Sample, scale: float, seed: int = 0) -> Array:
    return scale * np.random.default_rng(seed).normal(size=(it.solid.nodes, 3))


def flowed(it: Sample, u: Array) -> Flags:
    """Bring a solid to a displacement and commit it; whether a cell has flowed (cells,)."""
    it.bring([u], u)
    return np.asarray(np.any(it.kernels.history().accumulated > 0.0, axis=1))


def test_a_step_of_a_cell_minimises_its_potential(coarse: BlockMesh) -> None:
    """Plastic and permanent volumetric strains are those of a general minimiser, from a state that has flowed."""
    it = sample(coarse, STEEL)
    u0 = noise(it, 5e-4)
    it.bring([u0], u0)
    before = it.kernels.history().copy()
    u = u0 + noise(it, 3e-4, seed=1)
    it.force(u)
    it.kernels.commit()
    after, volumes = it.kernels.history(), it.kernels.volumes
    strain = sample(coarse, Material(1.0, 0.0)).kernels.stress(u)  # without lateral contraction
    lam, mu = STEEL.lame
    bulk, hardening, (spent, threshold) = lam + 2.0 / 3.0 * mu, STEEL.plastic_modulus, relaxation_of(STEEL)
    trace = strain[..., :3].sum(axis=-1)
    trial = 2.0 * mu * (strain - before.plastic_strain)
    trial[..., :3] -= 2.0 / 3.0 * mu * trace[..., None]
    q = np.sqrt(1.5 * np.sum(trial**2 * PAIRS, axis=-1))
    tried = 0
    for c in np.flatnonzero(np.any(after.accumulated > before.accumulated, axis=1))[:12]:
        w = volumes[c] / volumes[c].sum()
        own = trace[c] - before.dilatation[c]
        own -= w @ own
        size = Y + hardening * before.accumulated[c]

        def potential(x: Array, c: int = c, w: Array = w, own: Array = own, size: Array = size) -> float:
            gamma, de = Y * x[:4], np.append(Y * x[4:], -(w[:3] @ (Y * x[4:])) / w[3])  # de without a mean
            elastic = (q[c] - 3.0 * mu * gamma) ** 2 / (6.0 * mu) + size * gamma + 0.5 * hardening * gamma**2
            flow = max(float(w @ gamma), 1e-14)
            relaxed = 0.5 * spent * (w @ de**2) / flow + threshold * np.sqrt(w @ de**2)
            return float((w @ elastic + 0.5 * bulk * (w @ (own - de) ** 2) + relaxed) / Y**2)

        found = minimize(
            potential, np.r_[np.full(4, 0.1), np.full(3, 0.01)], method="L-BFGS-B",
            bounds=[(0, None)] * 4 + [(None, None)] * 3,
            options={"maxiter": 5000, "maxfun": 100000, "ftol": 1e-15, "gtol": 1e-9},
        )  # fmt: skip
        gamma, de = after.accumulated[c] - before.accumulated[c], after.dilatation[c] - before.dilatation[c]
        ours = potential(np.r_[gamma, de[:3]] / Y)
        assert ours <= found.fun + 1e-9 * abs(found.fun)
        np.testing.assert_allclose(gamma / Y, found.x[:4], rtol=0, atol=2e-3)
        assert abs(w @ de) < 1e-15
        tried += 1
    assert tried == 12


def test_below_yield_the_solid_is_the_elastic_one(coarse: BlockMesh) -> None:
    it, elastic = sample(coarse, STEEL), sample(coarse, Material(E, NU))
    u = noise(it, 1e-5)
    assert difference(it.force(u), elastic.force(u)) < 1e-13
    assert it.kernels.plastic_points == 0
    assert difference(it.tangent(u).data, elastic.tangent(u).data) < 1e-13


@KINDS
def test_tangent_is_the_derivative_of_the_force(coarse: BlockMesh, material: Material) -> None:
    it = sample(coarse, material)
    cells = flowed(it, noise(it, 2e-4))
    assert 0.2 < np.mean(cells) < 1.0
    for scale in (1e-3, 3e-3):
        u = noise(it, 2e-4) + noise(it, scale, seed=1)
        it.force(u)
        K = it.tangent(u)
        assert difference(K.data, K.T.tocsr().sorted_indices().data) < 1e-12
        du, step = noise(it, scale, seed=2), 1e-5
        slope = (it.force(u + step * du) - it.force(u - step * du)) / (2.0 * step)
        assert difference(K @ du.ravel(), slope.ravel()) < 1e-6


def test_stiffness_of_small_vibration_is_the_elastic_one(coarse: BlockMesh) -> None:
    it = sample(coarse, STEEL)
    flowed(it, noise(it, 1e-2))
    u = 0.999 * noise(it, 1e-2)
    it.force(u)
    held = np.empty(it.solid.sparsity.size)
    it.kernels.elastic_tangent(u, held)
    assert difference(held, sample(coarse, Material(E, NU)).tangent(u).data) < 1e-13


@KINDS
def test_only_the_deviation_from_the_mean_relaxes(coarse: BlockMesh, material: Material) -> None:
    """The mean pressure of a cell is that of its mean volumetric strain, logarithmic in finite strain."""
    it, point = (sample(coarse, material, pointwise=p) for p in (False, True))
    u = noise(it, 1e-3)
    for each in (it, point):
        flowed(each, u)
    volumes = it.kernels.volumes
    ours, usual = (each.kernels.conjugate_stress(u)[..., :3].mean(axis=-1) for each in (it, point))
    means = [np.sum(p * volumes, axis=1) / volumes.sum(axis=1) for p in (ours, usual)]
    assert difference(*means) < 1e-10
    deviations = [np.sqrt(np.sum((p - m[:, None]) ** 2 * volumes)) for p, m in zip((ours, usual), means, strict=True)]
    assert deviations[0] < 0.5 * deviations[1]


@KINDS
def test_the_midpoint_rule_keeps_its_order(coarse: BlockMesh, material: Material) -> None:
    """Force and history at the end of a smooth path of displacements, with steps that halve."""

    def end(steps: int, rule: str) -> Array:
        it = sample(coarse, material)
        first, second = noise(it, 1e-3), noise(it, 1e-3, seed=1)
        at: float | None = None
        for k in range(1, steps + 1):
            t = k / steps
            force = it.force(t * first + t**2 * second)
            before = it.kernels.history().copy()
            it.kernels.commit()
            after = (k + 1) / steps if k < steps and rule == MIDPOINT else None
            part, at = midpoint_lead(at, t, after)
            it.kernels.restore(extrapolate(before, it.kernels.history().copy(), part))
        return force

    changes = {}
    for rule in (MIDPOINT, BACKWARD_EULER):
        ends = [end(steps, rule) for steps in (8, 16, 32)]
        changes[rule] = np.array([np.linalg.norm(b - a) for a, b in itertools.pairwise(ends)])
    # the cosine of the extrapolation makes the former a little less than 4, with and without relaxation
    ratios = {rule: change[0] / change[1] for rule, change in changes.items()}
    assert ratios[MIDPOINT] > 2.6 and ratios[BACKWARD_EULER] < 2.2
    assert np.all(changes[MIDPOINT] < 0.2 * changes[BACKWARD_EULER])


# --- the solver ---------------------------------------------------------------------------------------------------

SPHERE = Surface.from_spec("sphere", L=1.0, radius=1.0)
SOFT = Material(E, NU, 0.002)


def even(h: float, growth: float = 0.25) -> BlockMesh:
    """Block with elements of the same size all over the contact at an approach of 0.003."""
    x = np.linspace(-0.5, 0.5, 257)
    away = np.maximum(np.hypot(x, x[:, None]) - np.sqrt(0.006), 0.0)
    return build_block(SPHERE, 1.0, SizeField(np.array([h]), away[:, :, None], (0.0, 0.0, 1.0), growth, 0.25).at)


def pressed(block: BlockMesh, material: Material = SOFT, **settings: Any) -> ContactResult:
    return asp.solve_contact(SPHERE, material, block=block, **{"delta_max": 0.003, "steps": 3} | settings)


@pytest.fixture(scope="module")
def spot() -> BlockMesh:
    return even(0.06)


@pytest.fixture(scope="module")
def fine() -> BlockMesh:
    return even(0.028, growth=0.125)


@pytest.mark.parametrize(
    ("method", "kinematics"),
    [("active-set", "small"), ("active-set", "finite"), ("penalty", "small"), ("nitsche", "finite")],
)
def test_a_force_that_is_held_stays(spot: BlockMesh, method: str, kinematics: str) -> None:
    """At the end of the loading, and at three steps of the unloading."""
    material = Material(E, NU, 0.002, kinematics=kinematics)
    solver = pressed(spot, material, formulation=asp.Formulation(method)).solver
    for delta in np.linspace(1.0, 0.97, 4) * solver.delta:
        solver.step(delta)
        force = solver.force
        for _ in range(2):
            assert solver.step(delta).converged
            assert solver.force == pytest.approx(force, rel=1e-10)


@pytest.mark.parametrize(
    ("friction", "locks", "left"), [("none", 0.08, 0.03), pytest.param(0.3, 0.07, 0.035, marks=pytest.mark.slow)]
)
def test_a_spot_as_small_as_an_element_does_not_lock(
    spot: BlockMesh, fine: BlockMesh, friction: str | float, locks: float, left: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sphere pressed in far beyond yield: the limit is that of the usual elements on much finer meshes.

    With friction these are CalculiX's, see tests/output/test_export_slip.py; they still lock there, by 2 %, so half of
    the locking is left.
    """
    formulation = asp.Formulation(friction=friction)
    free = pressed(spot, formulation=formulation).curve.P_star[-1]
    monkeypatch.setattr("asperity.fem.kernels.RELAXATION", (np.inf, np.inf))
    locked, limit = (pressed(block, formulation=formulation).curve.P_star[-1] for block in (spot, fine))
    assert locked > (1.0 + locks) * limit
    assert abs(free / limit - 1.0) < left


def test_a_spot_that_hardens_is_not_too_soft(spot: BlockMesh, fine: BlockMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the initial strength it bears 4.7 % too little; towards E_t = E the element is the usual one."""
    solids = [Material(E, NU, 0.002, slope, hardening="kinematic") for slope in (0.1, 0.99)]
    ours = [pressed(spot, solid).curve.P_star[-1] for solid in solids]
    monkeypatch.setattr("asperity.fem.kernels.RELAXATION", (np.inf, np.inf))
    assert abs(ours[0] / pressed(fine, solids[0]).curve.P_star[-1] - 1.0) < 0.015
    assert ours[1] == pytest.approx(pressed(spot, solids[1]).curve.P_star[-1], rel=1e-3)


@pytest.mark.parametrize("method", ["active-set", "penalty"])
def test_the_energy_that_relaxes_is_dissipated(spot: BlockMesh, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Many small steps, whose energy bounds are narrow, from both sides."""
    steps: dict[str, Any] = {"steps": 24, "unload_steps": 2, "integrator": "backward-euler"}
    steps["formulation"] = asp.Formulation(method)
    checks = pressed(spot, **steps).checks
    assert not checks.violated and checks.energy_excess < 1e-8 and checks.least_dissipation > -1e-12 * checks.dissipated
    assert checks.relaxed > 1e-3 * checks.dissipated
    if method == "penalty":
        return
    right = asp.quasistatic.contact_solver.dissipation

    def forgotten(*arguments: Any) -> tuple[float, float, float]:
        work, _, decrease = right(*arguments)
        return work, 0.0, decrease

    monkeypatch.setattr("asperity.quasistatic.contact_solver.dissipation", forgotten)
    with pytest.raises(CheckError, match="work and energy of the step do not balance"):
        pressed(spot, **steps)
