"""Run-time checks: silent on correct runs, loud on each kind of wrong one."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ELASTIC, PLASTIC, make_contact_solver, world

import asperity as asp
import asperity.quasistatic.contact_solver
from asperity.case import Case
from asperity.contact import ActiveSet
from asperity.errors import CheckError
from asperity.job.run_case import run
from asperity.mesh.block import BlockMesh
from asperity.model.load_path import Schedule
from asperity.model.material import Material
from asperity.model.settings import Formulation, MeshSize, SolverOptions
from asperity.quasistatic.balance import (
    COMPLIANT,
    EXACT,
    MIDPOINT_ENERGY,
    Checks,
    StepBalance,
    audit,
)
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.measures import Record
from asperity.quasistatic.newton import NewtonSolver
from asperity.quasistatic.stepping import follow
from asperity.surface import Surface

Break = Callable[[pytest.MonkeyPatch, ContactSolver], None]


def pressed(solver: ContactSolver, steps: int = 4, unload_steps: int = 0) -> ContactSolver:
    schedule = Schedule(0.02, steps=steps, unload_steps=unload_steps)
    follow(solver, schedule, Record(1.0, 1.0, 1.0))
    return solver


def make(
    surface: Surface, block: BlockMesh | None, method: str = "active-set", material: Any = PLASTIC
) -> ContactSolver:
    return make_contact_solver(world(), surface, block, material, formulation=Formulation(method))


MOVING, MIXED = (replace(PLASTIC, hardening=share) for share in ("kinematic", 0.4))


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("method", "material"),
    [("active-set", MIXED), ("active-set", PLASTIC), ("penalty", MOVING), ("nitsche", ELASTIC), ("nitsche", MIXED)],
)
def test_correct_runs_pass(wave: Surface, coarse_wave: BlockMesh | None, method: str, material: Any) -> None:
    checks = pressed(make(wave, coarse_wave, method, material), unload_steps=3).checks
    assert checks.violated == {}
    assert checks.energy_excess == 0.0
    assert checks.energy_ratio == pytest.approx(1.0, abs=0.1)
    assert (checks.dissipated > 0.0) == material.plastic


@pytest.mark.parametrize(("method", "material"), [("active-set", PLASTIC), ("penalty", ELASTIC)])
def test_the_residual_bounds_the_error_of_loose_equations(
    rough: Surface, coarse: BlockMesh | None, method: str, material: Material
) -> None:
    """Along the whole path, where an error stays in the plastic history; the balance of forces alone does not."""
    forces, bars = [], []
    for rtol in (1e-10, 1e-4, 1e-3, 1e-2):
        solver = make_contact_solver(
            world(), rough, coarse, material, formulation=Formulation(method), options=SolverOptions(rtol=rtol)
        )
        record = Record(1.0, 1.0, 1.0)
        follow(solver, Schedule(0.03, steps=5), record)
        forces.append(np.array([row["force"] for row in record.rows]))
        bars.append(solver.checks.unsolved)
    errors = [np.max(np.abs(force / forces[0] - 1.0)) for force in forces]
    assert np.all(np.array(errors[1:]) < bars[1:])
    assert bars[0] < 1e-8 and bars[1] < 0.01 and bars[3] < 0.2


def test_cycles_of_a_rough_contact(rough: Surface, coarse: BlockMesh | None) -> None:
    """The isotropic solid shakes down; the kinematic one keeps a loop whose area is what it dissipates in a cycle."""
    down = np.array([0.019, 0.018, 0.017, 0.016, 0.015])
    cycle = [*down, *down[-2::-1], 0.02]
    for hardening in ("isotropic", "kinematic"):
        material = Material(1.0, 0.3, 0.005, 0.2, hardening)
        solver = make(rough, coarse, material=material)
        for delta in (0.005, 0.01, 0.015, 0.02):
            assert solver.step(delta).converged
        dissipated, areas = [solver.checks.dissipated], []
        for _ in range(3):
            path = [(solver.delta, solver.force)]
            for delta in cycle:
                assert solver.step(float(delta)).converged
                path.append((solver.delta, solver.force))
            areas.append(float(np.trapezoid(*np.array(path).T[::-1])))
            dissipated.append(solver.checks.dissipated)
        lost = np.diff(dissipated)
        assert solver.checks.violated == {} and solver.checks.energy_excess == 0.0
        assert solver.checks.least_dissipation >= -1e-15 * solver.checks.dissipated  # rounding
        if hardening == "isotropic":
            assert lost[2] < 0.4 * lost[1] < 0.16 * lost[0]
            shaken_down = areas[2]
        else:
            assert np.ptp(lost[1:]) < 0.03 * lost[2]
            assert areas[2] == pytest.approx(lost[2], rel=0.2)  # trapezoidal rule
            assert areas[2] > 100.0 * abs(shaken_down)


def test_the_energy_ratio_tends_to_one(wave: Surface, coarse_wave: BlockMesh | None) -> None:
    """The trapezoidal rule for the work and the path of the force both converge with the steps."""
    ratios = [pressed(make(wave, coarse_wave, material=ELASTIC), n).checks.energy_ratio for n in (3, 6, 12)]
    errors = np.abs(np.array(ratios) - 1.0)
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2]
    assert errors[2] < 0.01


def too_much_force(patch: pytest.MonkeyPatch, solver: ContactSolver) -> None:
    right = ActiveSet.nodal_force
    patch.setattr(ActiveSet, "nodal_force", lambda self, force: 1.001 * right(self, force))


def pulling(patch: pytest.MonkeyPatch, solver: ContactSolver) -> None:
    right = ActiveSet.nodal_force

    def wrong(self: ActiveSet, force: Any) -> Any:
        out = right(self, force)
        edges = np.setdiff1d(np.unique(solver.contact_surface.nodes[:, 3:]), np.flatnonzero(out))
        out[edges[:4]] = -1e-5
        return out

    patch.setattr(ActiveSet, "nodal_force", wrong)


def too_high(patch: pytest.MonkeyPatch, solver: ContactSolver) -> None:
    right = ActiveSet.begin
    patch.setattr(ActiveSet, "begin", lambda self, z: right(self, z + 1e-5))


def forgetting(patch: pytest.MonkeyPatch, solver: ContactSolver) -> None:
    right = solver.solid.kernels.commit

    def wrong() -> None:
        right()
        for values in solver.solid.kernels.history().arrays().values():
            values *= 0.5

    patch.setattr(solver.solid.kernels, "commit", wrong)


def flowing_backwards(patch: pytest.MonkeyPatch, solver: ContactSolver) -> None:
    kernels = solver.solid.kernels
    right = kernels.commit

    def wrong() -> None:
        before = kernels.history().plastic_strain.copy()
        right()
        strain = kernels.history().plastic_strain
        strain[:] = before - 0.1 * (strain - before)

    patch.setattr(kernels, "commit", wrong)


def stopping_early(patch: pytest.MonkeyPatch, solver: ContactSolver) -> None:
    right = NewtonSolver._test

    def loose(self: NewtonSolver, it: int) -> Any:
        right(self, it)
        reasons = self.snes.ConvergedReason
        return reasons.CONVERGED_FNORM_RELATIVE if it >= 3 else reasons.ITERATING

    patch.setattr(NewtonSolver, "_test", loose)


def not_a_number(patch: pytest.MonkeyPatch, solver: ContactSolver) -> None:
    patch.setattr(
        solver.solid.kernels, "conjugate_stress", lambda *_: np.full((len(solver.solid.cell_nodes), 4, 6), np.nan)
    )


@pytest.mark.parametrize(
    ("wrong", "kind"),
    [
        (too_much_force, "force_balance"),
        (pulling, "tension"),
        (too_high, "penetration"),
        (forgetting, "plastic_strain"),
        (flowing_backwards, "dissipation"),
        (stopping_early, "force_balance"),
        (not_a_number, "finite"),
    ],
)
def test_wrong_runs_are_noticed(
    monkeypatch: pytest.MonkeyPatch, wave: Surface, coarse_wave: BlockMesh | None, wrong: Break, kind: str
) -> None:
    solver = make(wave, coarse_wave)
    wrong(monkeypatch, solver)
    pressed(solver)
    assert kind in solver.checks.violated
    assert "delta/L" in solver.checks.violated[kind]


def test_the_energy_of_a_compliant_contact_is_balanced_too(
    monkeypatch: pytest.MonkeyPatch, wave: Surface, coarse_wave: BlockMesh | None
) -> None:
    solver = make(wave, coarse_wave, "penalty")
    right = asperity.quasistatic.contact_solver.energies
    monkeypatch.setattr(
        "asperity.quasistatic.contact_solver.energies", lambda *args: tuple(1.05 * e for e in right(*args))
    )
    assert "energy" in pressed(solver, 20).checks.violated


def test_a_flat_that_touches_no_node_is_noticed(wave: Surface, coarse_wave: BlockMesh | None) -> None:
    """Here by a flat that starts too high; until something is touched a first step may be without force."""
    solver = make(wave, coarse_wave)
    solver.summit += 0.01
    follow(solver, Schedule(0.005, steps=2), Record(1.0, 1.0, 1.0))
    assert "no node is touched" in solver.checks.violated["touch"]
    follow(solver, Schedule(0.02, steps=2), Record(1.0, 1.0, 1.0))
    assert solver.checks.violated == {}


SMALL: dict[str, Any] = {
    "delta_max": 0.02, "steps": 2, "size": MeshSize(h_contact=0.2, h_max=0.5),
    "formulation": Formulation("penalty", penalty=0.01),
}  # fmt: skip


CASE: dict[str, Any] = {
    "units": "other", "surface": {"kind": "sinusoid", "L": 1.0, "amplitude": 0.05, "dims": 2},
    "material": {"E": 1.0, "nu": 0.3}, "mesh": {"h_contact": 0.2, "h_max": 0.5},
    "loading": {"delta_max": 0.02, "steps": 2}, "contact": {"method": "penalty", "penalty": 0.01},
}  # fmt: skip


@pytest.mark.parametrize("call", ["mesh", "tolerance", "case"])
def test_a_wrong_result_is_an_error(monkeypatch: pytest.MonkeyPatch, wave: Surface, tmp_path: Path, call: str) -> None:
    """Of every call that returns a curve, and of a run; the error carries what was found."""
    calls: dict[str, Callable[[], Any]] = {
        "mesh": lambda: asp.solve_contact(wave, ELASTIC, **SMALL),
        "tolerance": lambda: asp.solve_contact(wave, ELASTIC, tolerance=0.2, delta_max=0.02, steps=2),
        "case": lambda: run(Case.from_dict(CASE), tmp_path / "out"),
    }
    if call == "tolerance":
        right = asperity.quasistatic.contact_solver.audit

        def wrong(checks: Checks, step: StepBalance, **rest: Any) -> None:
            right(checks, replace(step, reaction=1.001 * step.reaction), **rest)

        monkeypatch.setattr("asperity.quasistatic.contact_solver.audit", wrong)
    with pytest.raises(CheckError, match="do not use it: the ") as caught:
        calls[call]()
    assert caught.value.exit_code == 3
    if call == "case":
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert summary["checks"]["violated"] and not summary["finished"]
    else:
        found: Any = caught.value.result
        assert found.curve.force[-1] > 0.0


def balance(**changes: float) -> StepBalance:
    """A first step in balance: force 1 at the approach 1, energy 1/2."""
    exact = dict.fromkeys((f.name for f in fields(StepBalance)), 0.0)
    exact |= {"delta": 1.0, "force": 1.0, "reaction": 1.0, "stored": 0.5, "pressure": 1.0, "work_high": 1.0}
    return StepBalance(**exact | changes)


@pytest.mark.parametrize(
    ("kind", "limit", "options", "change"),
    [
        ("energy", EXACT, {}, lambda x: {"stored": 1.0 + x}),  # over the energy, which is the upper bound
        ("energy", EXACT, {}, lambda x: {"stored": 1.2 + x, "tangential_high": 0.2}),
        ("energy", EXACT, {}, lambda x: {"stored": 0.5, "tangential_low": 0.5 + 0.5 * x}),
        ("energy", MIDPOINT_ENERGY, {"exact": False}, lambda x: {"stored": 1.0 + x}),
        ("energy", EXACT, {"compliant": True}, lambda x: {"stored": 1.0 + x}),
        ("energy", EXACT, {}, lambda x: {"stored": 0.5, "dissipated": 0.5 + x}),
        ("dissipation", EXACT, {}, lambda x: {"dissipation": -0.5 * x}),
        ("tension", EXACT, {}, lambda x: {"suction": x}),
        ("penetration", EXACT, {}, lambda x: {"penetration": x}),
        ("compliance", COMPLIANT, {"compliant": True}, lambda x: {"penetration_work": x}),
        (
            "compliance",
            COMPLIANT,
            {"compliant": True},
            lambda x: {"delta": 0.5, "force": 1.0, "penetration_work": 0.5 * x},
        ),
        ("plastic_strain", 1e-12, {}, lambda x: {"strain_decrease": x}),
        ("force_balance", 1e-8, {}, lambda x: {"reaction": 1.0 + x}),
    ],
)
def test_each_limit_is_where_it_is_said_to_be(
    kind: str, limit: float, options: dict[str, bool], change: Callable[[float], dict[str, float]]
) -> None:
    """Noticed at twice the limit, not at half of it; the limits are those of the documentation."""
    how: dict[str, Any] = {"compliant": False, "exact": True} | options
    for part in (0.5, 2.0):
        checks = Checks()
        audit(checks, balance(**change(part * limit)), bound=1e-8, rtol=1e-9, **how)
        assert set(checks.violated) == ({kind} if part > 1.0 else set())
    assert (EXACT, COMPLIANT, MIDPOINT_ENERGY) == (1e-6, 0.05, 0.05)
