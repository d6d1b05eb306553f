"""Newton's method as a user of PETSc sees it, and contact as stiff as the case file admits."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest
from conftest import ELASTIC, PLASTIC, here, make_block, make_contact_solver, world

from asperity.fem.tangent import Tangent
from asperity.linear.multigrid import PMultigrid
from asperity.mesh.block import BlockMesh
from asperity.model.load_path import Schedule
from asperity.model.material import Material
from asperity.model.settings import Formulation, MeshSize, SolverOptions
from asperity.quasistatic import newton
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.measures import Record
from asperity.quasistatic.stepping import follow
from asperity.surface import Sinusoid, Sphere, Surface

EXTEND = Path(__file__).parents[2] / "docs" / "extend.md"


def kind_of_coarse(solver: ContactSolver) -> str:
    multigrid = solver.newton.linear.multigrid
    assert multigrid is not None
    return type(multigrid._coarse).__name__


#: Options of PETSc, and what each does to a step, by its solver and its text.
OPTIONS: dict[str, Callable[[ContactSolver, str], bool]] = {
    "snes_monitor": lambda s, text: text.count("SNES Function norm") == s.counts.newton + 1,
    "snes_view": lambda s, text: all(word in text for word in ("type: cg", "PMultigrid", "TangentOperator")),
    "snes_linesearch_monitor": lambda s, text: text.count("Line search: length") == s.counts.newton,
    "snes_linesearch_type cp": lambda s, text: not s.counts.shortened,
    "ksp_monitor": lambda s, text: text.count("KSP Residual norm") == s.counts.krylov + s.counts.newton,
    "ksp_type minres": lambda s, text: s.newton.linear.ksp.getType() == "minres",
    "coarse_pc_type gamg": lambda s, text: kind_of_coarse(s) == "Distributed",
}


@pytest.fixture
def option(request: pytest.FixtureRequest) -> Iterator[str]:
    """An option in PETSc's database."""
    from petsc4py import PETSc

    name, _, value = f"asperity_{request.param}".partition(" ")
    options = PETSc.Options()
    before = options.getAll()
    options[name] = value or None
    yield request.param
    for key in set(options.getAll()) - set(before):
        options.delValue(key)
    if name in before:
        options[name] = before[name]


@pytest.mark.parametrize("option", OPTIONS, indirect=True)
def test_options_of_petsc(rough: Surface, coarse: BlockMesh, option: str, capfd: pytest.CaptureFixture[str]) -> None:
    """Each does what it says, and the force stays."""
    usual, solver = (
        make_contact_solver(here(), rough, coarse, PLASTIC, options=SolverOptions(linear=linear))
        for linear in ("lu", "cg")
    )
    usual.newton._tells = False
    for each in (usual, solver):
        capfd.readouterr()
        assert each.step(0.02).converged
    assert OPTIONS[option](solver, capfd.readouterr().out)
    assert solver.force == pytest.approx(usual.force, rel=1e-7)


def test_every_prefix_is_in_the_table() -> None:
    """Of the solver objects in the package."""
    text, package = EXTEND.read_text(encoding="utf-8"), Path(__file__).parents[2] / "python"
    found = {m for path in package.rglob("*.py") for m in re.findall(r'"(asperity_(?:[a-z]+_)?)"', path.read_text())}
    assert "asperity_coarse_" in found
    assert {name for name in found if f"| `{name}` |" not in text} == set()


@pytest.mark.mpi
def test_the_ksp_of_snes_solves_the_system_that_it_shows(rough: Surface, coarse: BlockMesh | None) -> None:
    """Its operator, on the right-hand side as moved, gives its solution: no search and no prescription hides in it."""
    solver = make_contact_solver(world(), rough, coarse, ELASTIC, options=SolverOptions(linear="cg"))
    linear, seen = solver.newton.linear, []
    assert solver.newton.snes.getKSP().handle == linear.ksp.handle

    def look(ksp: Any, iteration: int, norm: float) -> None:
        if iteration == 0:
            seen.append(ksp.getRhs().copy())

    linear.ksp.setMonitor(look)
    assert solver.step(0.02).converged
    system, rows = seen[-1], linear._rows
    x, image = (solver.solid.vector() for _ in range(2))
    linear.ksp.getSolution().copy(x)
    x.array[rows] = 0.0
    linear.operator.mult(x, image)
    image.axpy(-1.0, system)
    assert image.norm() < 1e-3 * system.norm()
    assert not system.array_r[rows].any()
    x.array = rows[0] if len(rows) else 0.0
    linear.operator.mult(x, image)
    assert (image.array_r[rows] == x.array_r[rows]).all()  # unit rows


@pytest.mark.mpi
def test_a_preconditioner_that_cannot_be_made_is_rescued(
    rough: Surface, coarse: BlockMesh | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the solves after it use the preconditioner again."""
    solver = make_contact_solver(world(), rough, coarse, PLASTIC, options=SolverOptions(linear="cg"))
    with monkeypatch.context() as patch:
        patch.setattr(PMultigrid, "_update", lambda self: False)
        assert solver.step(0.01).converged
    assert solver.counts.direct == solver.counts.newton > 0 == solver.counts.krylov
    before = solver.counts.direct
    assert solver.step(0.015).converged
    assert solver.counts.direct == before and solver.counts.krylov > 0


SCENES: dict[str, tuple[Surface, MeshSize, float]] = {
    "rough": (
        Surface.from_spec(
            kind="self-affine", L=1.0, H=0.8, rms_slope=0.1, lambda_short=0.25, lambda_roll=0.5, seed=5, periodic=True
        ),
        MeshSize(0.12, growth=0.5),
        0.015,
    ),
    "sphere": (Sphere(L=1.0, radius=2.0), MeshSize(0.1, growth=0.5), 0.01),
    "wave": (Sinusoid(L=1.0, amplitude=0.02, dims=2), MeshSize(0.12, growth=0.5), 0.02),
}


@pytest.mark.parametrize(
    "material", [ELASTIC, pytest.param(PLASTIC, marks=pytest.mark.slow)], ids=["elastic", "plastic"]
)
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize(
    "formulation",
    [Formulation("penalty", penalty=100.0), Formulation("nitsche", gamma=100.0)],
    ids=lambda f: f.method,
)
def test_the_stiffest_legal_contact_converges(name: str, formulation: Formulation, material: Material) -> None:
    """Without a cut step, to a force next to that of a third of the factor."""
    surface, size, depth = SCENES[name]
    block = make_block(here(), surface, 1.0, depth, size)
    factors = {f: getattr(formulation, f) / 3.0 for f in ("penalty", "gamma")}
    force = []
    for each in (formulation, replace(formulation, **factors)):
        solver = make_contact_solver(here(), surface, block, material, formulation=each)
        record = Record(1.0, 1.0, material.reduced_modulus)
        follow(solver, Schedule(delta_max=depth, steps=1, unload_steps=1), record)
        force.append(record.curve().force.max())
        assert solver.counts.cutbacks == 0
    # the error of a penalty falls with its factor; Nitsche's method has none of the first order
    assert force[0] == pytest.approx(force[1], rel=3e-3 if formulation.method == "nitsche" else 0.01)


def test_steep_slopes_in_finite_strain_need_no_factorisation() -> None:
    """Where the tangent is indefinite, elastic stiffness is added: 99 of 214 systems were factorised, 4 steps cut."""
    surface = Surface.from_spec(
        kind="self-affine", L=1.0, H=0.8, rms_slope=1.0, lambda_short=0.25, lambda_roll=0.5, seed=5, periodic=True
    )
    material = Material(1.0, 0.3, 0.005, 0.02, kinematics="finite")
    block = make_block(here(), surface, 1.0, 0.2, MeshSize(0.12, growth=0.5))
    solver = make_contact_solver(here(), surface, block, material, options=SolverOptions(linear="cg"))
    shifted: list[float] = []
    write = solver.solid.tangent.assemble

    def noted(add: Any = None, shift: float = 0.0, secant: bool = False) -> None:
        shifted.append(shift)
        write(add, shift, secant)

    solver.solid.tangent.assemble = noted  # type: ignore[method-assign]
    follow(solver, Schedule(delta_max=0.2, steps=4), Record(1.0, 1.0, material.reduced_modulus))
    assert max(shifted) > 0.0
    assert solver.counts.direct == 0 and solver.counts.cutbacks <= 1
    assert solver.counts.shortened and json.loads(json.dumps(asdict(solver.counts))) == asdict(solver.counts)
    assert solver.counts.newton < 150


def test_a_large_step_without_hardening(monkeypatch: pytest.MonkeyPatch) -> None:
    """With tangents alone it takes 35 iterations or never ends; steps by the chords need not be shortened."""
    surface, solid = Sinusoid(L=1.0, amplitude=0.02, dims=2), Material(1.0, 0.3, 0.002)
    block = make_block(here(), surface, 1.0, 0.03, MeshSize(0.15, h_max=0.5))
    lengths: list[tuple[float, bool]] = []
    assemble, search = Tangent.assemble, newton.step_length
    chords = False

    def written(tangent: Tangent, add: Any = None, shift: float = 0.0, secant: bool = False) -> None:
        nonlocal chords
        chords = secant
        assemble(tangent, add, shift, secant)

    def noted(*of: Any) -> float:
        lengths.append((search(*of), chords))
        return lengths[-1][0]

    monkeypatch.setattr(Tangent, "assemble", written)
    monkeypatch.setattr(newton, "step_length", noted)
    for depth in (0.03, 0.03 * (1.0 + 1e-6)):
        found = make_contact_solver(here(), surface, block, solid).step(depth)
        assert found.converged and found.newton < 35 and found.direct == 0
    by_chords = [length for length, chord in lengths if chord]
    assert by_chords and min(by_chords) == 1.0 > min(lengths)[0]


def test_the_tangent_follows_a_step_by_the_chords() -> None:
    """The stiffness of Nitsche's tractions stays that of the tangent: one such step after the other never ended."""
    surface = Surface.from_spec(
        kind="self-affine", L=1.0, H=0.8, rms_slope=0.2, lambda_short=0.2, lambda_roll=0.6, seed=3, periodic=True
    )
    block = make_block(here(), surface, 1.0, 0.015, MeshSize(0.3, h_max=0.5))
    solid = Material(1.0, 0.3, 0.001, kinematics="finite")
    found = make_contact_solver(here(), surface, block, solid, formulation=Formulation("nitsche")).step(0.015)
    assert found.converged and found.newton < 25


@pytest.mark.parametrize("power", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("wall", [2.0, 0.7])
def test_the_step_length_of_a_rate_that_is_known(power: float, wall: float) -> None:
    """x^n - 0.4^n times a scale; beyond the wall the solid is turned inside out."""
    tried: list[float] = []

    def rate(x: float) -> float:
        tried.append(x)
        return float("inf") if x > wall else 3.0 * (x**power - 0.4**power)

    length = newton.step_length(rate, rate(0.0), moved=False)
    assert length == tried[-1] and abs(rate(length)) <= newton.SLOPE_DROP * 3.0 * 0.4**power
    assert newton.step_length(lambda x: 1.0 - x, 1.0, moved=False) == 1.0  # uphill
    assert newton.step_length(lambda x: -1.0, -1.0, moved=False) == 1.0  # no minimum before its end
    assert newton.step_length(lambda x: 11.0, -1.0, moved=True) == 1.0  # the flat moves the nodes


def test_the_root_finder_stops_at_a_solve_that_fails() -> None:
    """It gives the last point tried; the cubic is that of `brentq`."""
    root = newton.illinois(lambda x: x**3 - 0.2, (0.0, -0.2), (1.0, 0.8), 1e-12, 40)
    assert root == pytest.approx(0.2 ** (1 / 3), rel=1e-11)
    tried: list[float] = []
    last = newton.illinois(lambda x: tried.append(x) or float("nan"), (0.0, -1.0), (1.0, 1.0), 1e-9, 40)  # type: ignore[func-returns-value]
    assert tried == [last] == [0.5]
