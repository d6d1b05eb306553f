"""Error of the force from the element size: the last level against those before, and the next mesh that follows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, nan

import numpy as np

from asperity.adaptive.extrapolation import (
    Budget,
    correct,
    judged_rows,
    relative,
    with_measures,
    without_omission,
    worst_area_error,
    worst_error,
)
from asperity.adaptive.guide import Guide, Omission
from asperity.adaptive.load_step_error import LoadStepError
from asperity.adaptive.mesh_levels import LevelSolver
from asperity.adaptive.mesh_plan import GREATEST_STEP, LEAST_STEP, next_scale, partner, scale_for_area
from asperity.contact.contact_surface import gather_top
from asperity.curve import Curve
from asperity.model.settings import AccuracyTarget
from asperity.quasistatic.contact_result import ContactResult
from asperity.runtime.parallel import on_root_bcast
from asperity.units import per_cent


@dataclass(frozen=True)
class Judgement:
    """What the levels so far show.

    Attributes:
        curve: of the last level, extrapolated, with error bars; as computed and without them when it has none
        budget: parts of the error bars
        worst, worst_area: greatest relative bars of force and area that are judged, NaN without one
        met: whether they are within the tolerances
        known: how well the force is known, a clause
        scale: of the next level
        limit: why there is no next level; empty when there may be one
    """

    curve: Curve
    budget: Budget
    worst: float
    worst_area: float
    met: bool
    known: str
    scale: float
    limit: str


class MeshErrorEstimate:
    """Judges one level after the other; collective.

    Args:
        run: solver of levels
        goal: tolerance and limits
        steps: planned ones
        path: error of the load steps
        guide: half-space with all waves, on rank 0
    """

    def __init__(
        self, run: LevelSolver, goal: AccuracyTarget, steps: int, path: LoadStepError, guide: Guide | None
    ) -> None:
        self._run, self._goal, self._steps, self._path, self._guide = run, goal, steps, path, guide
        self._scales: list[float] = []
        self._curves: list[Curve] = []
        self._missed: list[Omission] = []

    def add(self, result: ContactResult) -> Curve:
        """Take up the result of the last level; its curve without what its top leaves out and the load steps do."""
        missed = self._left_out(result)
        curve = self._path.removed(result.curve, self._run.levels[-1].substeps)
        if not curve.untouched():
            curve = without_omission(curve, missed, self._run.compliance)
        self._scales.append(self._run.scales[-1])
        self._curves.append(curve)
        self._missed.append(missed)
        return curve

    def judge(self, result: ContactResult) -> Judgement:
        """Judge the force of the last level, after at least one before it.

        Args:
            result: of this level
        """
        run, goal, path = self._run, self._goal, self._path
        curve, scales, substeps = self.add(result), self._scales, run.levels[-1].substeps
        place = partner(scales)
        coarse = self._curves[place]
        ratio = scales[place] / scales[-1]
        judged, algebraic = judged_rows(result.curve, self._steps), result.checks.unsolved
        unresolved = "no node is touched" if curve.untouched() or coarse.untouched() else path.unknown
        if not unresolved:
            missed = self._missed[-1], self._missed[place]
            curve, budget = correct(curve, coarse, ratio, judged, path.bar[substeps], algebraic, missed)
            curve = with_measures(curve, coarse, ratio, budget, run.compliance)
            unresolved = curve.unresolved() or coarse.unresolved()

        room = (goal.max_dofs / result.dofs) ** (1.0 / run.growth_of_dofs())
        if unresolved:
            # by a single node the force grows with its size, and the difference of two meshes is no error
            worst, area, wanted, limit = nan, nan, scales[-1] / GREATEST_STEP, ""
            known = f"the force has no error bar, {unresolved}"
            curve = replace(result.curve, error_P_star=np.full(len(curve), nan))
            budget = Budget.unknown(len(curve))
        else:
            worst, area = worst_error(curve, self._steps), worst_area_error(curve, self._steps)
            known = self._known(worst, area)
            of_steps = path.bar[path.substeps].at(curve.delta_star[judged])
            mesh = relative(np.hypot(budget.mesh, budget.roughness)[judged], curve.P_star[judged])
            wanted_bar = max(goal.tolerance - algebraic, 0.0)
            left = np.sqrt(np.maximum(wanted_bar**2 - of_steps**2, (0.1 * goal.tolerance) ** 2))  # for the mesh
            wanted = next_scale(scales, float(np.max(mesh / left)))
            limit = "" if worst <= goal.tolerance else self._limit(algebraic, float(of_steps.max()))
            if goal.area_tolerance is not None:
                for_area = scale_for_area(scales[-1], area, goal.area_tolerance)
                wanted = for_area if worst <= goal.tolerance else min(wanted, for_area)
        scale = max(wanted, scales[-1] / max(room, LEAST_STEP))
        if not known:
            return Judgement(curve, budget, worst, area, True, known, scale, "")
        limit = limit or run.limit(goal, wanted if room < LEAST_STEP else scale, path.substeps)
        if limit and run.misses_waves(goal.tolerance):
            limit += "; waves shorter than the elements limit it too: cut them off (asperity check tries cut-offs)"
        return Judgement(curve, budget, worst, area, False, known, scale, limit)

    def _known(self, worst: float, area: float) -> str:
        """How well force or area are known, a clause; empty where both meet their tolerances."""
        goal = self._goal
        if worst == inf:
            return "the force has no error bar at every step, because the mesh is not touched at the first ones"
        if not worst <= goal.tolerance:
            return (
                f"the force is known to {per_cent(worst)}, not to the {per_cent(goal.tolerance)} of accuracy.tolerance"
            )
        if goal.area_tolerance is None or area <= goal.area_tolerance:
            return ""
        if area == inf:
            return "the contact area has no error bar at every step, because at the first ones it is a single node"
        return (
            f"the contact area is known to {per_cent(area)}, not to the {per_cent(goal.area_tolerance)} of "
            "accuracy.area_tolerance"
        )

    def _left_out(self, result: ContactResult) -> Omission:
        """What the top of a mesh leaves out; collective."""
        run = self._run
        top = gather_top(result.solver.contact_surface, run.height / run.side)

        def left_out() -> Omission:
            assert self._guide is not None and top is not None
            return self._guide.left_out(top)

        return on_root_bcast(run.comm, left_out)

    def _limit(self, algebraic: float, of_steps: float) -> str:
        """Why no mesh meets the tolerance; empty when one may.

        Args:
            algebraic, of_steps: relative error bars of the equations and of the load steps
        """
        if algebraic + of_steps <= 0.9 * self._goal.tolerance:
            return ""
        if algebraic > of_steps:
            return f"{algebraic:.2g} is left by the equations, lower solver.rtol or raise accuracy.tolerance"
        return self._path.limit or "what is left comes from the load steps, raise loading.steps"
