"""Degrees of freedom (dofs), memory and time of a case before it is run.

The size field of the mesh says how many nodes there will be. The rates, seconds and bytes of a dof, were fitted to runs
of 14,000 to 78,000 dofs on one core of a small shared machine; benchmarks/check.py compares cases with their runs.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from math import log2
from typing import TYPE_CHECKING

import numpy as np

from asperity.adaptive.family import MeshFamily, dofs_of
from asperity.adaptive.guide import PASSES, Guide, approach_of_force
from asperity.adaptive.mesh_plan import (
    DOFS_ORDER,
    GREATEST_STEP,
    LEAST_STEP,
    MESH_ORDER,
    MOST_MESHES,
    PATH_TRANSFER,
    RATIO,
    STEP_ORDERS,
    enough_substeps,
    expected_bar,
    first_scale,
    planned_steps,
    step_rule,
)
from asperity.adaptive.small_strain import judge
from asperity.errors import InputError
from asperity.mesh.block import BlockMesh
from asperity.mesh.size_field import size_field
from asperity.model.material import AUTO
from asperity.model.problem import Problem
from asperity.model.settings import MeshSize
from asperity.runtime.display import short_repr

if TYPE_CHECKING:
    from asperity.case import Case
    from asperity.case.schema import AccuracySection
    from asperity.surface import Surface

MOST_DOFS = 1e8  # that are counted
START = 1.3  # seconds of a run besides meshes and steps: libraries, results
HALF_SPACE = 4e-7  # seconds of a half-space with the surface, or with the top of a mesh, per cell and approach
#: Memory of a rank without a mesh, what the first has beside it, and a cell of its half-space [bytes].
BASE, ROOT, PER_CELL = 180e6, 120e6, 250.0


@dataclass(frozen=True)
class MeshEstimate:
    """One mesh of a run.

    Attributes:
        h_contact: element size where the surface is reached last [length]
        dofs: degrees of freedom
        steps: load steps, those of unloadings too
        seconds: of one core
    """

    h_contact: float
    dofs: int
    steps: int
    seconds: float


@dataclass(frozen=True)
class Rates:
    """Cost of a dof, measured on one core of the machine named in docs/cluster.md.

    Attributes:
        mesh: seconds of meshing and set-up per dof
        step: seconds of a load step per dof at 10,000 dofs
        growth: exponent of the dofs in the seconds of a step
        per_dof: memory per dof [bytes]
        finite: time of a step in finite strain over that in small strain
    """

    mesh: float
    step: float
    growth: float
    per_dof: float
    finite: float

    def of(self, h: float, dofs: int, steps: int, finite: bool) -> MeshEstimate:
        """A mesh of a run, in finite strain or in small strain."""
        step = self.step * (self.finite if finite else 1.0)
        seconds = self.mesh * dofs + steps * step * dofs * (dofs / 1e4) ** (self.growth - 1.0)
        return MeshEstimate(h, dofs, steps, seconds)


ELASTIC = Rates(1.6e-5, 3.4e-6, 1.03, 1.02e3, 2.17)
PLASTIC = Rates(1.6e-5, 6.2e-6, 1.08, 1.39e3, 1.45)


@dataclass(frozen=True)
class Estimate:
    """Estimated cost of a case.

    Attributes:
        levels: the meshes, the last one the finest
        of_ranks: memory of each rank, of which the first makes meshes and half-spaces [bytes]
        approach: greatest one, where the load path gives a force that of a half-space [length]
        kinematics: of the run
        bar: relative error bar of the force expected of the last mesh, None without a tolerance
        tolerance: relative, of the force; None without one
        others: time of one core for all that is no mesh [s]
        max_dofs: accuracy.max_dofs
    """

    levels: tuple[MeshEstimate, ...]
    of_ranks: tuple[float, ...]
    approach: float
    kinematics: str
    bar: float | None = None
    tolerance: float | None = None
    others: float = 0.0
    max_dofs: int | None = None

    __repr__ = short_repr

    @property
    def memory(self) -> float:
        """Of all ranks [bytes]."""
        return sum(self.of_ranks)

    @property
    def enough(self) -> bool:
        """Whether the meshes end where the tolerance is expected to be met, not before, at accuracy.max_dofs."""
        return self.bar is None or self.tolerance is None or self.bar <= self.tolerance

    @property
    def least_bar(self) -> float | None:
        """Relative error bar that a mesh of `max_dofs` is expected to give."""
        if self.bar is None or self.max_dofs is None:
            return None
        return self.bar * min(self.dofs / self.max_dofs, 1.0) ** (MESH_ORDER / DOFS_ORDER)

    @property
    def dofs(self) -> int:
        """Dofs of the finest mesh."""
        return self.levels[-1].dofs

    @property
    def seconds(self) -> float:
        """Time of one core for everything."""
        return self.others + sum(level.seconds for level in self.levels)


def estimate(case: Case, ranks: int = 1, surface: Surface | None = None, passes: int = PASSES) -> Estimate:
    """Estimate the cost of a case, without meshing or solving it.

    The approach of a load path that gives a force is that of a half-space, see `approach_of_force`.
    With `accuracy.tolerance` the meshes are those a run plans:
    the half-space that guides it is solved here too.

    Args:
        case: the input
        ranks: that share the work
        surface: in place of that of the case
        passes: see `Guide`

    Raises:
        InputError: the case has more than MOST_DOFS, or a run would refuse it for its accuracy.max_dofs

    Examples:
        >>> case = asp.Case.from_dict({
        ...     "surface": {"kind": "sphere", "L": 1e-6, "radius": 1e-5}, "material": {"E": 200e9, "nu": 0.3},
        ...     "loading": {"delta_max": 1e-9},
        ... })

        >>> found = estimate(case, ranks=2)
        >>> len(found.levels), 10_000 < found.dofs < 30_000
        (1, True)
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what the run warns of too
        problem = case.problem(surface)
        path, tolerance = problem.load_path, case.accuracy.tolerance
        delta = path.delta_max or approach_of_force(problem)
        problem = replace(problem, load_path=replace(path, delta_max=delta, force_max=None))
        kinematics = problem.material.kinematics
        if kinematics == AUTO:
            kinematics = judge(problem, tolerance).kinematics
    bar, others, cells = None, START, 0
    if tolerance is None:
        file = case.mesh.file
        dofs = _dofs(problem, problem.size) if file is None else 3 * BlockMesh.read(file).counts()[0]
        if dofs > MOST_DOFS:
            raise InputError(f"the mesh has more than {MOST_DOFS:g} dofs: raise mesh.h_contact")
        plan = [(case.mesh.h_contact, dofs, _steps(problem))]
    else:
        plan, bar, cells, approaches = _plan(problem, case.accuracy, passes)
        others += HALF_SPACE * cells * approaches
    rates, finite = _rates(case), kinematics == "finite"
    levels = tuple(rates.of(h, dofs, steps, finite) for h, dofs, steps in plan)
    share = BASE + rates.per_dof * levels[-1].dofs / ranks
    first = share + ROOT + PER_CELL * cells
    most = None if tolerance is None else case.accuracy.max_dofs
    return Estimate(levels, (first, *[share] * (ranks - 1)), delta, kinematics, bar, tolerance, others, most)


def further_meshes(case: Case, found: Estimate) -> list[MeshEstimate]:
    """All meshes that a run with a tolerance can add to the planned ones, up to `accuracy.max_dofs`.

    They are MOST_MESHES in all, each as fine as may follow the one before.

    Args:
        case: with accuracy.tolerance
        found: its estimate
    """
    most, last = min(case.accuracy.max_dofs, int(MOST_DOFS)), found.levels[-1]
    levels: list[MeshEstimate] = []
    for k in range(1, MOST_MESHES - 1):
        h, dofs = last.h_contact / GREATEST_STEP**k, min(int(last.dofs * GREATEST_STEP ** (k * DOFS_ORDER)), most)
        levels.append(_rates(case).of(h, dofs, last.steps, found.kinematics == "finite"))
    return levels if last.dofs < most else []


def _rates(case: Case) -> Rates:
    return PLASTIC if case.material.plastic else ELASTIC


def _steps(problem: Problem, substeps: int = 1) -> int:
    """Load steps of a problem, those of its unloadings too, in so many equal parts of each step of a loading."""
    schedule = replace(problem.schedule, substeps=substeps)
    return sum(steps if branch == "unload" else len(schedule.stops()) for branch, steps in schedule.legs)


def _plan(
    problem: Problem, goal: AccuracySection, passes: int
) -> tuple[list[tuple[float, int, int]], float, int, float]:
    """Meshes that a run plans, see `mesh_levels.LevelSolver`.

    Returns:
        of each mesh the greatest size in the contact [length], dofs and load steps; the error bar expected of them; and
        cells of the half-space and how many approaches it is solved at, with the surface and the tops of the meshes
    """
    path, tolerance, most = problem.load_path, goal.tolerance, min(goal.max_dofs, MOST_DOFS)
    assert path.delta_max is not None and tolerance is not None
    planned = planned_steps(path.steps)
    problem = replace(problem, load_path=replace(path, steps=planned))
    guide = Guide(problem, path.delta_max, planned, passes=passes)
    family, scale = MeshFamily(problem, path.delta_max, guide), first_scale(tolerance)
    first, coarse = family.first(RATIO * scale, most)
    second, fine = family.within(min(scale, first / RATIO), first, most)
    if coarse > most:
        raise InputError(
            f"accuracy.max_dofs = {most:g} is too small, a coarse mesh of this block has about {coarse} dofs: raise "
            "it, or choose the mesh by mesh.h_contact"
        )
    if first < LEAST_STEP * second:
        raise InputError(
            f"accuracy.max_dofs = {most:g} is too small: the force would have no error bar, for meshes of about "
            f"{coarse} and {fine} dofs are nearly the same; raise it, or choose the mesh by mesh.h_contact"
        )
    parts, substeps = [1], 1
    if problem.path_dependent:
        rule = step_rule(problem)
        bars = {1: np.array([PATH_TRANSFER[rule] * planned ** -STEP_ORDERS[rule]])}
        substeps = enough_substeps(bars, tolerance, STEP_ORDERS[rule])
        parts = [2**k for k in range(max(int(log2(substeps)), 1) + 1)]  # the first mesh measures the error of the steps
    plan = [(family.h(first), coarse, _steps(problem, n)) for n in parts]
    plan.append((family.h(second), fine, _steps(problem, substeps)))
    return plan, expected_bar(second), guide.sizes.size, (passes + 1.0) * len(guide.delta_star)


def _dofs(problem: Problem, size: MeshSize) -> int:
    """Dofs of a mesh of given sizes, up to about MOST_DOFS."""
    depth = problem.load_path.delta_max
    assert depth is not None
    field = size_field(problem.surface, depth, size, problem.sides)
    return dofs_of(field, size.refinements, problem.height / problem.surface.L, MOST_DOFS)
