"""Compiled kernels against the forms of UFL, differentiated automatically, on one and two ranks."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from conftest import make_contact_solver, world
from element_sample import difference, sample
from scipy.spatial.transform import Rotation

from asperity.arrays import Array
from asperity.fem.law_check import OneCell
from asperity.fem.solid import Solid
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import distribute
from asperity.model.material import Material
from asperity.model.settings import Formulation, SolverOptions
from asperity.surface import Surface

E, NU, Y, E_T = 1.0, 0.3, 0.005, 0.05
MIXED = Material(E, NU, Y, E_T, 0.4, kinematics="finite")
MATERIALS = {
    "elastic": Material(E, NU),
    "isotropic": Material(E, NU, Y, E_T),
    "kinematic": Material(E, NU, Y, E_T, "kinematic"),
    "mixed": Material(E, NU, Y, E_T, 0.4),
    "perfect": Material(E, NU, Y),
    "weak": Material(E, NU, 1e-6, E_T),  # whose relief exceeds the yield strength
    "finite": Material(E, NU, kinematics="finite"),
    "finite, mixed": MIXED,
}
TURN = Rotation.from_rotvec([0.6, -1.1, 0.4]).as_matrix()

#: Displacements, each over the history of those before it, and the part of the points that flows.
States = dict[str, tuple[Array, float | None]]


def smooth(points: Array, rng: np.random.Generator, finite: bool) -> States:
    """Smooth states and a small random one; at finite strain at last one that is turned."""
    squeeze = points @ np.diag([0.001, -0.0005, -0.01]) + 1e-3 * points[:, [1]] * points  # not uniform
    found: States = {
        "at rest": (0.0 * squeeze, 0.0),
        "elastic": (0.1 * squeeze, 0.0),
        "plastic": (squeeze, 1.0),
        "just beyond yield": ((1 + 1e-6) * squeeze, 1.0),
        "just unloading": ((1 - 1e-6) * squeeze, 0.0),
        "deep": (20 * squeeze, 1.0),
        "unloading": (0.99 * 20 * squeeze, 0.0),
        "reversed": (-20 * squeeze, 1.0),
        "random": (5e-4 * rng.normal(size=points.shape), None),
    }
    return found | ({"turned": ((points + 10 * squeeze) @ TURN.T - points, None)} if finite else {})


def random(points: Array, rng: np.random.Generator, finite: bool) -> States:
    """Random states; with the large ones every point flows."""
    small, large, other = (scale * rng.normal(size=points.shape) for scale in (1e-4, 3e-3, 3e-3))
    return {"random": (small, None), "large": (large, 1.0), "random over a history": (small + other, 1.0)}


@pytest.mark.parametrize(
    ("name", "states"),
    [pytest.param(n, smooth, marks=[pytest.mark.mpi] * n.endswith("mixed")) for n in MATERIALS if n != "weak"]
    # the quadrature that is the logarithm of a form is not exact for large random states
    + [(name, random) for name, material in MATERIALS.items() if not material.finite],
    ids=lambda value: getattr(value, "__name__", value),
)
def test_each_compiled_kernel_is_its_form(coarse: BlockMesh | None, name: str, states: Any) -> None:
    """Force, stress, history and both tangents along a history of states."""
    material = MATERIALS[name]
    mesh, tags = distribute(world(), coarse, 1.0)
    ours, theirs = (Solid(mesh, tags, material, forms=forms) for forms in (False, True))
    for at, (u, flowing) in states(ours.points, np.random.default_rng(ours.comm.rank), material.finite).items():
        found: list[Any] = []
        for solid in (ours, theirs):
            kernels, b = solid.kernels, np.zeros((solid.nodes, 3))
            kernels.add_internal_force(u, b)
            tangent, shifted, elastic = (np.empty(solid.sparsity.size) for _ in range(3))
            half = np.zeros(9 * len(solid.sparsity.upper[1]) + 1, dtype=np.float32)
            kernels.tangent(u, tangent)
            kernels.tangent(u, half)
            kernels.tangent(u, shifted, shift=0.1)
            points = kernels.plastic_points, kernels.inverted_points
            kernels.elastic_tangent(u, elastic)
            kernels.commit()
            stresses = kernels.stress(u), kernels.conjugate_stress(u)
            variables = kernels.history().arrays().values()
            found.append((points, half, b, tangent, shifted, elastic, *stresses, kernels.volumes, *variables))
        (points, half, *fields), (of_form, single, *by_form) = found
        assert points == of_form and difference(half, single) < 1e-6, at
        if flowing is not None:
            assert points == (flowing * material.plastic * ours.kernels.volumes.size, 0), at
        for a, b in zip(fields, by_form, strict=True):
            assert difference(a, b) < (1e-11 if material.finite else 4.4e-12), at


def stretches() -> dict[str, tuple[Array, float, float]]:
    """Deformation gradients and tolerances of force and tangent: equal stretches, and both sides of each limit.

    The kernel has a form up to |C - 1| = 0.03, one up to 0.36 and one beyond; the twin has one.
    """
    found = {}
    for apart in (0.0, 1e-8, 0.3):
        found[f"apart {apart:g}"] = TURN @ np.diag([0.84, 0.84 * (1 + apart), 0.84 * (1 - 0.3 * apart)]), 1e-12, 1e-11
    for name, shape in (("sheared", (-1.0, 0.6, 0.2)), ("compressed", (-1.0, 0.0, 0.0))):
        for size in (1e-4, 0.0299, 0.0301, 0.359, 0.361):
            direction = TURN @ np.diag(shape) @ TURN.T
            values, vectors = np.linalg.eigh(np.eye(3) + size * direction / np.linalg.norm(direction))
            # symmetric: a rotation would leave rounding errors in C - 1
            found[f"{name} {size:g}"] = vectors @ np.diag(np.sqrt(values)) @ vectors.T, 1e-13, 1e-12
    return found


@pytest.mark.parametrize(("F", "force", "tangent"), stretches().values(), ids=stretches())
def test_each_form_of_the_logarithm_is_the_twin(cube: BlockMesh, F: Array, force: float, tangent: float) -> None:
    a, b = (sample(cube, MIXED, forms=forms) for forms in (False, True))
    u = a.affine(F - np.eye(3))
    before = a.affine(0.05 * np.array([[0.0, 1.0, 0.5], [1.0, 0.0, -0.7], [0.5, -0.7, 0.0]]))  # of other axes
    history = [before] if force == 1e-12 else []
    assert difference(a.bring(history, u), b.bring(history, u)) < force
    assert difference(a.tangent(u).data, b.tangent(u).data) < tangent


def test_the_next_mesh_takes_the_compiled_forms_of_the_last_one(
    cube: BlockMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The name of a compiled form does not depend on the constants and variables that the process made before."""
    from ffcx.codegeneration import jit

    names: list[str] = []

    def noted(*what: Any, make: Any, **how: Any) -> Any:
        found = make(*what, **how)
        names.append(found[1].__name__)
        return found

    for kind in ("compile_forms", "compile_expressions"):
        monkeypatch.setattr(jit, kind, partial(noted, make=getattr(jit, kind)))
    for _ in range(2):
        one = sample(cube, MIXED, forms=True)
        one.bring([], one.affine(-0.01 * np.eye(3)))
        one.tangent(one.affine(-0.01 * np.eye(3)))
        OneCell(MIXED.in_ufl)
    first, second = np.split(np.array(names), 2)
    assert first.size > 5 and list(first) == list(second)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("elastic", "active-set"), ("isotropic", "penalty"), ("kinematic", "nitsche"), ("mixed", "active-set"),
        ("finite", "penalty"), ("finite, mixed", "nitsche"),
    ],
)  # fmt: skip
def test_forces_on_forms_are_those_of_compiled_kernels(
    rough: Surface, coarse: BlockMesh | None, name: str, method: str
) -> None:
    """Up and back, with about as many iterations."""
    forces, newton = [], []
    for kernels in ("compiled", "forms"):
        how: dict[str, Any] = {"formulation": Formulation(method), "options": SolverOptions(kernels=kernels)}
        solver = make_contact_solver(world(), rough, coarse, MATERIALS[name], **how)
        forces.append([solver.step(delta).converged * solver.force for delta in (0.004, 0.008, 0.012, 0.011, 0.01)])
        newton.append(solver.counts.newton)
        assert not solver.checks.violated
    assert min(forces[0]) > 0.0
    assert difference(forces[1], forces[0]) < 1e-8
    assert abs(newton[1] - newton[0]) <= 0.1 * newton[0]
