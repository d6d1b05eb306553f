"""The solver on forms of UFL beside the compiled kernels, on one and two ranks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import world
from scipy.spatial.transform import Rotation

from asperity.arrays import Array
from asperity.fem.solid import Solid
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import distribute
from asperity.model.material import Material
from asperity.model.settings import Formulation, SolverOptions
from asperity.quasistatic.make import make_contact_solver
from asperity.surface import Surface

E, NU, Y, E_T = 1.0, 0.3, 0.005, 0.05
MATERIALS = {
    "elastic": Material(E, NU),
    "isotropic": Material(E, NU, Y, E_T),
    "kinematic": Material(E, NU, Y, E_T, "kinematic"),
    "mixed": Material(E, NU, Y, E_T, 0.4),
    "finite": Material(E, NU, kinematics="finite"),
    "finite, mixed": Material(E, NU, Y, E_T, 0.4, kinematics="finite"),
}
TWINS = MATERIALS | {"perfect": Material(E, NU, Y)}
METHODS = ("active-set", "penalty", "nitsche")
RANDOM = TWINS | {"weak": Material(E, NU, 1e-6, E_T)}  # whose relief exceeds the yield strength
STEPS = (0.004, 0.008, 0.012, 0.011, 0.01)  # approaches, up and back [L]


def difference(a: Any, b: Any) -> float:
    return float(np.max(np.abs(a - b), initial=0.0) / np.max(np.abs(b), initial=1e-300))


#: Displacements, each over the history of those before it, and the part of the points that flows.
States = dict[str, tuple[Array, float | None]]


def states(points: Array, rng: np.random.Generator, finite: bool) -> States:
    """Smooth ones and a small random one; at finite strain at last one that is turned."""
    squeeze = points @ np.diag([0.001, -0.0005, -0.01]) + 1e-3 * points[:, [1]] * points  # not uniform
    turn = Rotation.from_rotvec([0.6, -1.1, 0.4]).as_matrix()
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
    return found | ({"turned": ((points + 10 * squeeze) @ turn.T - points, None)} if finite else {})


def random_states(points: Array, rng: np.random.Generator) -> States:
    """Random ones; with the large ones every point flows."""
    small, large, other = (scale * rng.normal(size=points.shape) for scale in (1e-4, 3e-3, 3e-3))
    return {"random": (small, None), "large": (large, 1.0), "random over a history": (small + other, 1.0)}


def compare(block: BlockMesh | None, material: Material, history_of: Callable[..., States]) -> None:
    """Force, stress, history and both tangents of kernels and forms along a history of states."""
    mesh, tags = distribute(world(), block, 1.0)
    ours, theirs = (Solid(mesh, tags, material, forms=forms) for forms in (False, True))
    for name, (u, flowing) in history_of(ours.points, np.random.default_rng(ours.comm.rank)).items():
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
        assert points == of_form and difference(half, single) < 1e-6, name
        if flowing is not None:
            assert points == (flowing * material.plastic * ours.kernels.volumes.size, 0), name
        for a, b in zip(fields, by_form, strict=True):
            assert difference(a, b) < (1e-11 if material.finite else 4.4e-12), name


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.mpi if n.endswith("mixed") else []) for n in TWINS])
def test_each_compiled_kernel_is_its_form(coarse: BlockMesh | None, name: str) -> None:
    """Those of the forms are differentiated automatically."""
    material = TWINS[name]
    compare(coarse, material, lambda points, rng: states(points, rng, material.finite))


@pytest.mark.parametrize("name", [name for name, material in RANDOM.items() if not material.finite])
def test_each_compiled_kernel_is_its_form_in_random_states(coarse: BlockMesh | None, name: str) -> None:
    """At small strain: the quadrature that is the logarithm of a form is not exact for the large ones."""
    compare(coarse, RANDOM[name], random_states)


@pytest.mark.parametrize(
    ("material", "method"),
    [  # all pairs on one rank; on two each material with one method, each method with two materials
        pytest.param(material, method, id=f"{name}-{method}", marks=[pytest.mark.mpi] if i % 3 == j else [])
        for i, (name, material) in enumerate(MATERIALS.items())
        for j, method in enumerate(METHODS)
    ],
)
def test_forces_on_forms_are_those_of_compiled_kernels(
    rough: Surface, coarse: BlockMesh | None, material: Material, method: str
) -> None:
    forces, newton = [], []
    for kernels in ("compiled", "forms"):
        options = SolverOptions(kernels=kernels)
        solver = make_contact_solver(world(), rough, coarse, material, formulation=Formulation(method), options=options)
        forces.append([solver.step(delta).converged * solver.force for delta in STEPS])
        newton.append(solver.counts.newton)
        assert not solver.checks.violated
    assert min(forces[0]) > 0.0
    assert difference(np.array(forces[1]), np.array(forces[0])) < 1e-8
    assert abs(newton[1] - newton[0]) <= 0.1 * newton[0]
