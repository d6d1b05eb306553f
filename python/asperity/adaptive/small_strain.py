"""What small strain changes in the force: both kinematics pressed on one coarse mesh, and the choice between them.

The difference of two forces on one mesh is known much better than the forces, because both have the same error of the
mesh. A coarse mesh has larger differences than a fine one (docs/accuracy.md); they are divided by the share of the
slopes that it sees. Where it shows nothing, finite strain is chosen, which is right in any case.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.adaptive.extrapolation import judged_rows, loading_force
from asperity.adaptive.guide import CELLS, PER_WAVE
from asperity.adaptive.mesh_plan import COARSER, GROWTH, MOST_MESHES, size_for_strain
from asperity.arrays import Floats
from asperity.curve import Curve
from asperity.errors import Interrupted, MeshError
from asperity.mesh.block import BlockMesh
from asperity.mesh.top import Top, heights_of_top
from asperity.model.material import AUTO
from asperity.model.problem import Problem
from asperity.model.settings import Formulation, MeshSize
from asperity.quasistatic.callbacks import Callbacks
from asperity.quasistatic.contact_result import PartialResult
from asperity.quasistatic.make import make_block
from asperity.quasistatic.solve_problem import estimate_approach, solve_problem
from asperity.runtime.parallel import on_root_bcast

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.surface import Surface

SHARE = 1.0 / 3.0  # of the tolerance that small strain may change
ONE_MESH = 0.01  # change of the force accepted without a tolerance
MOST_DOFS = 30_000  # of a coarse mesh, tried where coarser ones show nothing
DIGITS = 4  # of the per cent, so that ranks, which sum in another order, do not change the choice


@dataclass(frozen=True, eq=False)
class SmallStrain:
    """Difference of the force between small and finite strain on a coarse mesh.

    Attributes:
        kinematics: of the run, "small" or "finite", chosen or given
        limit: greatest difference with which small strain is chosen [per cent]
        branch: of each step compared (n,)
        delta: approach of each (n,) [length]
        percent: force in small strain over that in finite strain minus 1; on later branches than the first loading the
            difference over the greatest force (n,) [per cent]
        slope_seen: rms slope of the top of the coarse mesh over that of the surface, where the flat may reach it
        h: element size of the coarse mesh [length]
        dofs: of the coarse mesh
        reason: why the path was not compared to its end; empty where it was
    """

    kinematics: str
    limit: float
    branch: tuple[str, ...]
    delta: Floats
    percent: Floats
    slope_seen: float
    h: float
    dofs: int
    reason: str

    @property
    def greatest(self) -> float | None:
        """Estimate of the greatest difference, over the share of the slopes seen [per cent]; None where unknown."""
        if not len(self.percent):
            return None
        return round(float(np.abs(self.percent).max()) / self.slope_seen, DIGITS)

    @property
    def enough(self) -> bool:
        """Whether small strain is known to be accurate enough."""
        return not self.reason and self.greatest is not None and self.greatest <= self.limit

    def describe(self) -> str:
        """One line for the log."""
        run = f"kinematics = {self.kinematics}"
        if self.greatest is None:
            return f"{run}: small and finite strain could not be compared, {self.reason}"
        known = f"small strain changes the force by up to {self.greatest:.2g} %, the limit is {self.limit:.2g} %"
        return f"{run}: {known}" + (f"; {self.reason}" if self.reason else "")

    def to_dict(self) -> dict[str, Any]:
        """Section model.small_strain of summary.json."""
        return {
            "greatest_percent": self.greatest,
            "limit_percent": self.limit,
            "branch": list(self.branch),
            "delta": self.delta.tolist(),
            "percent": self.percent.tolist(),
            "slope_seen": self.slope_seen,
            "h": self.h,
            "dofs": self.dofs,
            "not_compared": self.reason,
        }


def choose_kinematics(
    problem: Problem, tolerance: float | None = None, comm: MPI.Comm | None = None, hooks: Callbacks | None = None
) -> tuple[Problem, SmallStrain]:
    """The problem with small or finite strain, and what small strain changes in its force; collective.

    Both are pressed on one coarse mesh along the load path. Of "auto", small strain is chosen where the difference of
    the force is below a third of the tolerance, ONE_MESH without one; another choice is kept.

    Args:
        problem: with any material.kinematics
        tolerance: relative, of the force
        comm: communicator; default all ranks
        hooks: stages, stop and checkpoint; the coarse runs have checkpoints of their own

    Raises:
        Interrupted: the run was stopped

    Examples:
        >>> from asperity.surface import Flat
        >>> rubber = asp.Material(E=1.0, nu=0.3, kinematics="auto")
        >>> size = asp.MeshSize(h_contact=0.5, h_max=1.0)
        >>> for delta in (0.001, 0.1):  # a block in uniaxial strain: ln(1 - e)/(1 - e) against -e
        ...     block = asp.Problem.of(Flat(L=1.0), rubber, delta_max=delta, steps=1, size=size)
        ...     chosen, found = choose_kinematics(block)
        ...     print(chosen.material.kinematics, round(found.greatest, 2))
        small 0.15
        finite 14.58
    """
    from mpi4py import MPI

    comm, hooks = MPI.COMM_WORLD if comm is None else comm, hooks or Callbacks()
    limit = 100.0 * (ONE_MESH if tolerance is None else SHARE * tolerance)
    found = None
    for found in islice(_comparisons(problem, tolerance, limit, comm, hooks), MOST_MESHES):
        if not found.reason or found.dofs * COARSER > MOST_DOFS:
            break
    assert found is not None
    kinematics = problem.material.kinematics
    if kinematics == AUTO:
        kinematics = comm.bcast("small" if found.enough else "finite", root=0)
    found = replace(found, kinematics=kinematics)
    hooks.stage(found.describe())
    return replace(problem, material=replace(problem.material, kinematics=kinematics)), found


def _comparisons(
    problem: Problem, tolerance: float | None, limit: float, comm: MPI.Comm, hooks: Callbacks
) -> Iterator[SmallStrain]:
    """Comparisons on meshes from coarse to fine."""
    surface, L = problem.surface, problem.surface.L
    depth = problem.load_path.delta_max or estimate_approach(_with(problem, "small"), comm)
    own = problem.size.h_contact
    h = size_for_strain(None if own is None else own / L, tolerance) * L
    while True:
        nothing = SmallStrain("", limit, (), np.empty(0), np.empty(0), 1.0, h, 0, "")
        try:
            block = make_block(comm, surface, problem.height, depth, MeshSize(h, GROWTH), problem.sides)
        except MeshError as error:
            yield replace(nothing, reason=str(error))
            h /= COARSER
            continue
        seen = on_root_bcast(comm, partial(slope_seen, block, surface, depth))
        dofs = comm.bcast(None if block is None else 3 * len(block.points), root=0)
        nothing = replace(nothing, slope_seen=seen, dofs=dofs)
        small, failed = _press(problem, "small", block, h, comm, hooks)
        reason = failed or small.unresolved() or untouched(small)
        if reason and not failed:
            yield replace(nothing, reason=reason)
        else:
            finite, stopped = _press(problem, "finite", block, h, comm, hooks)
            branch, delta, percent = differences(small, finite, problem.load_path.steps)
            reason = failed or stopped or ("" if branch else untouched(finite))
            yield replace(nothing, branch=branch, delta=delta, percent=percent, reason=reason)
        h /= COARSER


def _with(problem: Problem, kinematics: str) -> Problem:
    """The problem with exact contact, which both kinematics have, with its friction, and one of them."""
    material = replace(problem.material, kinematics=kinematics)
    return replace(problem, material=material, formulation=Formulation(friction=problem.formulation.friction))


def _press(
    problem: Problem, kinematics: str, block: BlockMesh | None, h: float, comm: MPI.Comm, hooks: Callbacks
) -> tuple[Curve, str]:
    """Curve on the coarse mesh, and why it ends early; empty where it does not; collective.

    Raises:
        Interrupted: the run was stopped
    """
    name = f"coarse mesh, {kinematics} strain"
    part = None if hooks.checkpoint is None else hooks.checkpoint.part(f"{kinematics}-{h / problem.surface.L:.6g}")
    own = Callbacks(
        lambda stage: hooks.stage(f"{name}: {stage}"), stop=hooks.stop, checkpoint=part, on_ready=hooks.on_ready
    )
    try:
        return solve_problem(_with(problem, kinematics), block=block, comm=comm, hooks=own, checked=False).curve, ""
    except PartialResult as error:
        if isinstance(error.__cause__, Interrupted):
            raise Interrupted(f"{name}: {error}") from None
        return error.result.curve, f"{name}: {error}"


def untouched(curve: Curve) -> str:
    """Reason why a curve shows nothing: the summit of a coarse mesh may lie below the last position of the flat."""
    return "the flat does not reach the coarse mesh" if curve.untouched() else ""


def differences(small: Curve, finite: Curve, steps: int) -> tuple[tuple[str, ...], Floats, Floats]:
    """Difference of the force in small strain from that in finite strain, at the steps of both.

    The first loading counts from the end of its first planned step on, relative to the force there; on later branches
    the force vanishes, and the difference is relative to the greatest force.

    Args:
        small, finite: curves on one mesh
        steps: planned ones of a loading

    Returns:
        branch (n,), approach (n,) [length] and difference (n,) [per cent]
    """
    loads, other = small.loading(), finite.loading()
    if not (loads.force > 0.0).any() or not (other.force > 0.0).any():
        return (), np.empty(0), np.empty(0)
    loads = loads.where(judged_rows(loads, steps) & (loads.delta <= other.delta[-1] * (1.0 + 1e-9)))
    shared = np.asarray(np.isclose(loads.delta[:, None], other.delta, rtol=1e-9, atol=0.0).any(axis=1))
    loads = loads.where(shared) if shared.any() else loads  # driven by a force, none is
    branches, deltas = [loads.branch], [loads.delta]
    percents = [100.0 * (loads.P_star / loading_force(other, loads.delta_star) - 1.0)]
    greatest = float(finite.force.max())
    for here, there in zip(small.legs()[1:], finite.legs()[1:], strict=False):
        order = np.argsort(there.delta)
        force = np.interp(here.delta, there.delta[order], there.force[order])
        branches.append(here.branch[1:])
        deltas.append(here.delta[1:])
        percents.append(np.asarray(100.0 * (here.force - force)[1:] / greatest, dtype=float))
    percent = np.asarray(np.round(np.concatenate(percents), DIGITS), dtype=float)
    return tuple(map(str, np.concatenate(branches))), np.concatenate(deltas), percent


def slope_seen(block: BlockMesh | None, surface: Surface, depth: float) -> float:
    """Rms slope of the top of a mesh over that of the surface, where the flat may reach it; at most 1.

    Args:
        block: mesh of the block
        surface: its top
        depth: greatest approach [length]
    """
    assert block is not None
    n = int(np.clip(PER_WAVE * surface.L / surface.feature_size, *CELLS))
    centres = (np.arange(n) + 0.5) * surface.L / n
    heights = surface.on_product(centres, centres) / surface.L
    reached = heights >= surface.maximum()[2] / surface.L - depth / surface.L
    if not reached.any():
        return 1.0
    whole, seen = (
        float(np.sqrt(np.mean(sum(slope[reached] ** 2 for slope in np.gradient(z, 1.0 / n)))))
        for z in (heights, heights_of_top(Top.of(block, surface), surface, n))
    )
    return 1.0 if whole == 0.0 else float(np.clip(seen / whole, 1e-3, 1.0))
