"""Loops of the force about a preload: a confined column in closed form, energy, shakedown, ranks, the state after."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from conftest import PLASTIC, here, world
from j2_path import confined_stress
from scipy.optimize import brentq

from asperity.adaptive.solve_contact import solve_contact
from asperity.curve.loops import Loop, LoopTable
from asperity.errors import InputError, Interrupted
from asperity.mesh.block import BlockMesh
from asperity.model.material import Material
from asperity.model.settings import Formulation, MeshSize
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.force_loops import force_loops
from asperity.quasistatic.make import make_contact_solver
from asperity.surface import Flat, Surface

Y, TANGENT = 0.001, 0.05
DEPTH = 0.01


def loops_of_column(material: Material, preload: float, amplitude: float, count: int) -> Iterator[tuple[float, float]]:
    """Loss factor and amplitude of the strain of each loop of a column under uniaxial strain, in closed form."""
    share, path = material.kinematic_share, [DEPTH]

    def end(strains: list[float]) -> tuple[float, float]:
        """Stress at the end of a path, compression positive, and accumulated plastic strain."""
        stress, _, accumulated = confined_stress(strains, material.E, material.nu, Y, TANGENT, share)
        return float(stress[-1]), float(accumulated[-1])

    def to(stress: float) -> float:
        path.append(brentq(lambda strain: end([*path, strain])[0] - stress, -1.0, 1.0, xtol=1e-16))
        return path[-1]

    def dissipated() -> float:
        a = end(path)[1]
        return Y * a + 0.5 * (1.0 - share) * material.plastic_modulus * a**2

    to(preload)
    for _ in range(count):
        before = dissipated()
        deflection = 0.5 * (to(preload * (1.0 + amplitude)) - to(preload * (1.0 - amplitude)))
        to(preload)
        yield (dissipated() - before) / (np.pi * amplitude * preload * deflection), deflection


@pytest.mark.parametrize("hardening", ["isotropic", "kinematic", 0.5])
@pytest.mark.parametrize("amplitude", [0.05, 0.4, 0.6])
def test_a_confined_column(hardening: str | float, amplitude: float) -> None:
    """A flat block between rollers: radial paths, so that backward Euler is exact whatever the steps."""
    material = Material(1.0, 0.3, Y, TANGENT, hardening)
    solver = solve_contact(
        Flat(L=1.0), material, delta_max=DEPTH, steps=3, size=MeshSize(h_contact=1.0, h_max=1.0), comm=here()
    ).solver
    preload = 0.6 * solver.force
    loops = force_loops(solver, preload, [amplitude], cycles=3, steps=8)
    expected = list(loops_of_column(material, preload, amplitude, len(loops)))
    np.testing.assert_allclose([(loop.eta, loop.deflection) for loop in loops], expected, rtol=3e-3, atol=1e-6)
    # the trapezoidal rule misses the corners where plastic flow begins
    assert all(abs(loop.imbalance) < 0.01 for loop in loops)
    if hardening == "kinematic" and amplitude == 0.6:
        assert loops[-1].eta > 0.1
    if hardening == "isotropic" and amplitude < 0.5:
        assert loops[-1].eta < 1e-6


def press(
    surface: Surface, block: BlockMesh | None, comm: Any, formulation: Formulation | None = None
) -> ContactSolver:
    material = Material(1.0, 0.3, 0.005, 0.05, "kinematic")
    solver = make_contact_solver(comm, surface, block, material, formulation=formulation)
    for delta in (0.01, 0.02, 0.03):
        assert solver.step(delta).converged
    return solver


FORMULATIONS = [Formulation(), Formulation(friction=0.3), Formulation("nitsche")]


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=["active-set", "friction", "nitsche"])
def test_the_state_is_as_before(rough: Surface, coarse: BlockMesh | None, formulation: Formulation) -> None:
    """The next step is the same with and without loops before it, and energy is balanced in each loop."""
    forces = []
    for with_loops in (True, False):
        solver = press(rough, coarse, world(), formulation)
        if with_loops:
            loops = force_loops(solver, 0.5 * solver.force, [0.5], cycles=2, steps=2)
            assert [loop.loop for loop in loops] == [1, 2]
            assert formulation.sticks or abs(loops[-1].imbalance) < 5e-3
            assert loops[0].k > 0.0
        assert solver.step(0.031).converged
        forces.append((solver.force, solver.counts.steps, solver.checks.work))
    assert forces[0] == forces[1]


@pytest.mark.parametrize("asked", [1, 5], ids=["on the way to the preload", "in a loop"])
def test_a_request_to_stop(rough: Surface, coarse: BlockMesh | None, asked: int) -> None:
    """It ends the loops after the step, and the state is as before."""
    solver = press(rough, coarse, world())
    calls: list[float] = []

    def stop() -> str:
        calls.append(solver.delta)
        return "SIGTERM" if len(calls) == asked else ""

    with pytest.raises(Interrupted, match="stopped by SIGTERM in the loops; --resume computes them again"):
        force_loops(solver, 0.5 * solver.force, [0.5], cycles=2, steps=2, stop=stop)
    assert len(calls) == asked
    assert solver.delta == pytest.approx(0.03, rel=1e-12)
    assert calls[-1] < solver.delta
    other = press(rough, coarse, world())
    for one in (solver, other):
        assert one.step(0.031).converged
    assert solver.counts.steps == other.counts.steps
    found, expected = (np.array([one.force, one.checks.work]) for one in (solver, other))
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.mpi
@pytest.mark.usefixtures("several_ranks")
def test_ranks_agree(rough: Surface, coarse: BlockMesh | None) -> None:
    """One rank and all find the same loops, within the tolerance of the force at their ends."""
    found = []
    for comm in (here(), world()):
        block = world().bcast(coarse) if comm.size == 1 else coarse
        solver = press(rough, block, comm)
        found.append(force_loops(solver, solver.force, [0.5], cycles=2, steps=2))
    for one, all_ in zip(*found, strict=True):
        np.testing.assert_allclose((all_.eta, all_.deflection, all_.k), (one.eta, one.deflection, one.k), rtol=2e-3)


def test_the_preload_itself_yields_in_its_first_loop_only(rough: Surface, coarse: BlockMesh | None) -> None:
    """Isotropic hardening shakes down; the steps are fine enough for the energy of the steady loop."""
    solver = make_contact_solver(world(), rough, coarse, PLASTIC)
    for delta in (0.01, 0.02, 0.03):
        assert solver.step(delta).converged
    loops = force_loops(solver, solver.force, [0.3], cycles=4, steps=3)
    assert loops[0].eta > 0.5
    assert loops[-1].eta < 0.01 * loops[0].eta
    assert abs(loops[-1].imbalance) < 5e-3


def test_wrong_arguments(rough: Surface, coarse: BlockMesh | None) -> None:
    solver = make_contact_solver(world(), rough, coarse, Material(1.0, 0.3))
    wrong: tuple[tuple[float, list[float], dict[str, Any]], ...] = (
        (-1.0, [0.1], {}), (0.0, [0.1], {}), (1e-3, [1.5], {}), (1e-3, [0.0], {}), (1e-3, [0.1], {"cycles": 0}),
        (1e-3, [0.1], {"steps": 0}), (np.nan, [0.1], {}),
    )  # fmt: skip
    for preload, amplitudes, options in wrong:
        with pytest.raises(InputError):
            force_loops(solver, preload, amplitudes, **options)


def test_file(tmp_path: Any) -> None:
    """Written and read again, to the last bit; a damaged file is refused."""
    loop = Loop(0.1, 1, 2.0 / 3.0, 0.1, 0.3, 1e-3, 1e-4, 9e-4)
    table = LoopTable.scaled([loop], force=3.0, length=0.1)
    table.write(tmp_path / "loops.csv")
    assert LoopTable.read(tmp_path / "loops.csv") == table
    assert table.loops[0].eta == pytest.approx(loop.eta, rel=1e-14)
    assert table.loops[0].k == pytest.approx(30.0 * loop.k, rel=1e-14)
    for text in ("", "amplitude,loop\n", "amplitude,loop\n0.1,1\n"):
        (tmp_path / "bad.csv").write_text(text)
        with pytest.raises(InputError, match=r"bad\.csv"):
            LoopTable.read(tmp_path / "bad.csv")
