"""Degrees of freedom (dofs), memory and time of a case before it is run.

The size field of the mesh says how many nodes there will be. The rates, seconds and bytes of a dof, were fitted to runs
of 14,000 to 78,000 dofs on one core of a small shared machine; benchmarks/check.py compares cases with their runs.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import hypot
from time import process_time
from typing import TYPE_CHECKING, NamedTuple

from asperity.adaptive.extrapolation import FLOWING, of_limit
from asperity.adaptive.guide import Guide, approach_of_force, guide_of, planned_steps, small_strain
from asperity.adaptive.limits import (
    AREA_ORDER,
    LEAST_STEP,
    MARGIN,
    USUAL_ORDER,
    next_step,
    partner,
    shares,
)
from asperity.adaptive.load_step_error import MOST_SUBSTEPS, STEP_RULES, step_rule
from asperity.adaptive.meshes import MeshFamily, dofs_of
from asperity.errors import InputError
from asperity.mesh.block import BlockMesh
from asperity.mesh.size_field import size_field
from asperity.model.material import AUTO
from asperity.model.problem import Problem
from asperity.runtime.display import short_repr
from asperity.units import per_cent

if TYPE_CHECKING:
    from asperity.case import Case
    from asperity.surface import Surface

MOST_DOFS = 1e8  # that are counted
TYPICAL_BAR = 0.018  # relative, of a mesh of scale 1 and one RATIO times coarser at the worst step
#: Memory of a rank without a mesh, what the first has beside it, and a cell of its half-space [bytes].
BASE, ROOT, PER_CELL = 180e6, 120e6, 250.0


class Rates(NamedTuple):
    """Cost of a dof, measured on one core of the machine named in docs/install.md."""

    mesh: float  # seconds of meshing and set-up per dof
    step: float  # seconds of a load step per dof at 10,000 dofs
    growth: float  # exponent of the dofs in the seconds of a step
    per_dof: float  # memory per dof [bytes]
    finite: float  # time of a step in finite strain over that in small strain


ELASTIC = Rates(1.6e-5, 3.4e-6, 1.03, 1.02e3, 2.17)
PLASTIC = Rates(1.6e-5, 6.2e-6, 1.08, 1.39e3, 1.45)


@dataclass(frozen=True)
class MeshEstimate:
    """One mesh of a run."""

    h_contact: float  # element size where the surface is reached last [length]
    dofs: int
    steps: int  # load steps, those of unloadings too
    seconds: float  # of one core


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
    """

    levels: tuple[MeshEstimate, ...]
    of_ranks: tuple[float, ...]
    approach: float
    kinematics: str
    bar: float | None = None
    tolerance: float | None = None
    others: float = 0.0

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
    def dofs(self) -> int:
        """Dofs of the finest mesh."""
        return self.levels[-1].dofs

    @property
    def seconds(self) -> float:
        """Time of one core for everything."""
        return self.others + sum(level.seconds for level in self.levels)


def estimate(case: Case, ranks: int = 1, surface: Surface | None = None) -> Estimate:
    """Estimate the cost of a case, without meshing or solving it.

    The approach of a load path that gives a force is that of a half-space, see `approach_of_force`.
    With `accuracy.tolerance` the meshes are those a run plans:
    the half-space that guides it is solved here too.

    Args:
        case: the input
        ranks: that share the work
        surface: in place of that of the case

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
    since, tolerance, file = process_time(), case.accuracy.tolerance, case.mesh.file
    rates = PLASTIC if case.material.plastic else ELASTIC
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what the run warns of too
        problem, bar, grid, guide = case.problem(surface), None, 0, None
        if tolerance is not None:
            guide = guide_of(problem)
            plan, bar = _plan(problem, guide, tolerance, case.accuracy.max_dofs)
            grid = guide.sizes.size
        path = problem.load_path
        depth = path.delta_max or (approach_of_force(problem) if guide is None else guide.depth)
        if guide is None:
            if file is None:
                field = size_field(problem.composite, depth, problem.size, problem.sides)
                dofs = dofs_of(field, problem.height / problem.surface.L, MOST_DOFS)
            else:
                dofs = 3 * len(BlockMesh.read(file).points)
            if dofs > MOST_DOFS:
                raise InputError(f"the mesh has more than {MOST_DOFS:g} dofs: raise mesh.h_contact, or mesh.growth")
            plan = [(case.mesh.h_contact, dofs, _steps(problem))]
        kinematics = problem.material.kinematics
        if kinematics == AUTO:
            kinematics = small_strain(problem, tolerance, guide).kinematics
    step = rates.step * (rates.finite if kinematics == "finite" else 1.0)
    levels = tuple(
        MeshEstimate(h, dofs, steps, dofs * (rates.mesh + steps * step * (dofs / 1e4) ** (rates.growth - 1.0)))
        for h, dofs, steps in plan
    )
    share = BASE + rates.per_dof * levels[-1].dofs / ranks
    first = share + ROOT + PER_CELL * grid
    others = 0.8 + process_time() - since  # libraries and results, and what a run does of this too
    return Estimate(levels, (first, *[share] * (ranks - 1)), depth, str(kinematics), bar, tolerance, others)


def _steps(problem: Problem, substeps: int = 1, legs: int | None = None) -> int:
    """Load steps of a problem, or of the first legs, in so many equal parts of each step of a loading.

    Where a solid yields those to a force are not divided at first: each counts twice, and the search for the end.
    """
    schedule = replace(problem.schedule, substeps=substeps)
    loading = len(schedule.stops())
    if problem.path_dependent and schedule.delta_max is None:
        loading = 2 * (schedule.steps * substeps + 1)
    return sum(steps if branch in ("hold", "unload") else loading for branch, steps in schedule.legs[:legs])


def _plan(
    problem: Problem, guide: Guide, tolerance: float, max_dofs: int
) -> tuple[list[tuple[float, int, int]], float]:
    """Meshes that a run plans: of each the greatest size in the contact [length], dofs, load steps; and their bar."""
    most, planned = min(max_dofs, MOST_DOFS), planned_steps(problem.load_path.steps)
    problem = replace(problem, load_path=replace(problem.load_path, steps=planned))
    family = MeshFamily(problem, guide, most, counted=True)
    meshes = [first := family.next([])]
    meshes.append(family.next(meshes))
    parts, substeps = [1], 1
    if problem.path_dependent:
        order, share = STEP_RULES[step_rule(problem)]
        while share * (planned * substeps) ** -order >= MARGIN * tolerance and substeps < MOST_SUBSTEPS:
            substeps *= 2
        parts = [2**k for k in range(max(substeps.bit_length(), 2))]  # the first mesh measures the error of the steps
    compared, plastic = problem.schedule.compared, problem.material.plastic  # all that meshes but the last one follow
    plan = [(first.h, first.dofs, _steps(problem, n, compared)) for n in parts]
    while True:
        scales = [mesh.scale for mesh in meshes]
        scale, h, dofs = meshes[-1]
        cut = FLOWING * family.open_area(scale) if plastic else 0.0
        bar = _bar(scales, cut)
        if bar > tolerance:
            meshes.append(family.next(meshes, next_step(partial(_bar, scales, cut), tolerance)))
        if bar <= tolerance or scale / meshes[-1].scale < 0.999 * LEAST_STEP:
            return [*plan, (h, dofs, _steps(problem, substeps))], bar
        plan.append((h, dofs, _steps(problem, substeps, compared)))


def _bar(scales: Sequence[float], cut: float, finer: float = 1.0) -> float:
    """Bar expected of a mesh so much finer than the last one, see `extrapolation.Pair.expected`.

    Args:
        cut: bar of the last one by facets that are cut at random
    """
    scale, chance = scales[-1] / finer, cut / finer**AREA_ORDER
    ratio = scales[partner([*scales, scale])] / scale
    weight, _ = shares(ratio)
    return hypot(TYPICAL_BAR * scale**USUAL_ORDER, float(of_limit(weight, chance, chance * ratio**AREA_ORDER)))


def filter_advice(case: Case, found: Estimate, surface: Surface) -> str:
    """Sentence on a surface that probably no mesh of the case resolves; empty for others."""
    if found.enough:
        return ""
    other = f", or cut off short waves ({surface.cutoff_key})" if surface.cutoff_key else ""
    return (
        f"a run would need more than the {case.accuracy.max_dofs} dofs of accuracy.max_dofs for the "
        f"{case.accuracy.tolerance:.2g} of accuracy.tolerance: raise one of them{other}"
    )


def note_on_steps(surface: Surface, approach: float) -> str:
    """Sentence on a map with steps or edges, between whose heights a spline would rise too far; empty for others."""
    rise = getattr(surface, "spline_rise", 0.0)
    if not rise:
        return ""
    return (
        "the map has steps or edges: its slopes are limited there, or the surface would rise above the highest height, "
        f"by {per_cent(rise / approach)} of the approach"
    )
