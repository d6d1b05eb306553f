"""Error of the force from the element size: the last level against those before, and the next mesh that follows."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from math import inf, isfinite, nan
from typing import Any

import numpy as np

from asperity.adaptive.extrapolation import (
    Budget,
    Corrected,
    Pair,
    correct,
    judged_rows,
    relative,
    with_measures,
    without_omission,
)
from asperity.adaptive.given_forces import at_given_forces
from asperity.adaptive.load_step_error import LoadStepError
from asperity.adaptive.mesh_levels import Level, LevelSolver
from asperity.adaptive.mesh_plan import (
    AREA_ORDER,
    GREATEST_STEP,
    LEAST_STEP,
    MARGIN,
    MESH_ORDER,
    MOST_MESHES,
    partner,
    refinement,
)
from asperity.arrays import Flags, Floats
from asperity.curve import Curve
from asperity.model.settings import AccuracyTarget
from asperity.quasistatic.contact_result import ContactResult, refuse_wrong
from asperity.runtime.display import brief
from asperity.units import per_cent


@dataclass(frozen=True)
class AccurateResult:
    """A curve with error bars.

    Attributes:
        curve: rows of the finest mesh, force and P_star extrapolated, error_P_star filled in; as computed, and without
            it, when the force has no error bar
        raw: the same rows as computed
        budget: parts of the error bar, rows as in the curve, NaN where there is none
        levels: what was computed, in order
        contact: the result of the mesh of the curve, with its last state
        worst, worst_area: greatest relative bars of force and area that are judged, NaN without one
        met: whether the bar is within the tolerance along the first loading, and that of the area if requested
        reason: "done", or what stopped the refinement
    """

    curve: Curve
    raw: Curve
    budget: Budget
    levels: tuple[Level, ...]
    contact: ContactResult
    worst: float
    worst_area: float
    met: bool
    reason: str

    def __repr__(self) -> str:
        return f"AccurateResult({self.curve!r}, met={self.met}, worst={self.worst:.3g}, {brief(self.reason)})"

    def checked(self) -> AccurateResult:
        """This result, unless it violates a balance (CheckError).

        A mesh too coarse to be touched is none: the reason says so, and there is no bar.
        """
        if self.met or self.contact.checks.violated.keys() != {"touch"}:
            refuse_wrong(self.contact.checks, self)
        return self

    def roughness_share(self) -> float | None:
        """Greatest part of the bar that the waves left out take, over the force; None where no such part is judged."""
        judged = judged_rows(self.curve, len(self.curve.planned()))
        parts = relative(self.budget.roughness[judged], self.curve.P_star[judged])
        return float(np.max(parts)) if parts.size and np.isfinite(parts).all() and parts.any() else None

    def to_dict(self) -> dict[str, Any]:
        """Sections "accuracy" and "error_budget" of summary.json."""
        return {
            "accuracy": {
                "met": self.met,
                "worst_relative_bar": self.worst if isfinite(self.worst) else None,
                "worst_relative_bar_of_area": self.worst_area if isfinite(self.worst_area) else None,
                "levels": [asdict(level) for level in self.levels],
                "P_star_of_finest_mesh": self.raw.P_star.tolist(),
            },
            "error_budget": self.budget.to_dict() if isfinite(self.worst) else None,
        }


class MeshErrorEstimate:
    """Judges one level after the other; collective.

    Args:
        run: solver of levels
        goal: tolerance and limits
        steps: planned ones
        path: error of the load steps
    """

    def __init__(self, run: LevelSolver, goal: AccuracyTarget, steps: int, path: LoadStepError) -> None:
        self._run, self._goal, self._steps, self._path = run, goal, steps, path
        self._scales: list[float] = []
        self._meshes: list[Corrected] = []

    def add(self, result: ContactResult) -> Corrected:
        """Take up the result of the last level."""
        missed = self._run.left_out(result)
        curve = self._path.removed(result.curve, self._run.levels[-1].substeps)
        if not curve.untouched():
            curve = without_omission(curve, missed, self._run.compliance)
        self._scales.append(self._run.scales[-1])
        self._meshes.append(Corrected(curve, missed))
        return self._meshes[-1]

    def judge(self, result: ContactResult) -> tuple[AccurateResult, float | None]:
        """Judge the force by the result of the last level, after at least one before it.

        Returns:
            What is known so far, and how much finer the next mesh is; None where there is none, because the
            tolerances are met, or for the reason of the result
        """
        run, path = self._run, self._path
        fine, bar_of_steps = self.add(result), path.bar[run.levels[-1].substeps]
        judged, algebraic = judged_rows(result.curve, self._steps), result.checks.unsolved
        place = partner(self._scales)
        coarse, ratio = self._meshes[place], self._scales[place] / self._scales[-1]
        unresolved = fine.doubt() or coarse.doubt() or path.unknown
        if ratio < 0.999 * LEAST_STEP:
            unresolved = unresolved or "two meshes are nearly the same"
        if not unresolved:
            at = fine.curve.loading().delta_star
            seen = (np.interp(at, run.delta_star, part) for part in (run.singular, run.flowing))
            pair = Pair(fine, coarse, ratio, *seen)
            curve, budget = correct(pair, judged, bar_of_steps, algebraic)
            curve = with_measures(curve, pair, budget, run.compliance)
            unresolved = curve.unresolved()
            if run.force_max is not None:  # it is the corrected curve that reaches it
                curve, budget = at_given_forces(curve, budget, result.curve, run.compliance, run.force_max)
        if unresolved:
            # by a single node the force grows with its size, and the difference of two meshes is no error
            curve = replace(result.curve, error_P_star=np.full(len(result.curve), nan))
            budget, known, limit = Budget.unknown(len(curve)), f"the force has no error bar, {unresolved}", ""
            finer, worst, worst_area = GREATEST_STEP, nan, nan
        else:
            worst, worst_area, finer, limit = self._judged(curve, budget, judged, algebraic)
            known = self._known(worst, worst_area)
        levels = tuple(run.levels)
        found = AccurateResult(
            curve, result.curve, budget, levels, result, worst, worst_area, not known, known or "done"
        )
        if not known:
            return found, None
        limit = limit or self._limit(finer)
        if limit and run.misses_waves(self._goal.tolerance):
            limit += "; waves shorter than the elements limit it too: cut them off (asperity check tries cut-offs)"
        return (replace(found, reason=f"{known}: {limit}"), None) if limit else (found, finer)

    def _judged(self, curve: Curve, budget: Budget, judged: Flags, algebraic: float) -> tuple[float, float, float, str]:
        """Of a curve with error bars the greatest ones of force and area, the next mesh, and why none would do."""
        goal = self._goal
        at, P = curve.delta_star[judged], curve.P_star[judged]
        area: Floats = relative(curve.error_area_fraction[judged], curve.area_fraction[judged])
        area = np.where(np.isnan(area), inf, area)
        worst, worst_area = (float(np.max(bars)) for bars in (relative(curve.error_P_star[judged], P), area))
        of_steps = self._path.bar[self._path.substeps](at)
        left = np.sqrt(
            np.maximum((goal.tolerance - algebraic) ** 2 - of_steps**2, ((1.0 - MARGIN) * goal.tolerance) ** 2)
        )
        excesses = relative(np.hypot(budget.mesh, budget.roughness)[judged], P) / left
        excess, place = float(np.max(excesses)), at[np.argmax(excesses)]
        if goal.area_tolerance is not None:  # as a bar that falls with the order of the force
            excess = max(excess, (worst_area / goal.area_tolerance) ** (MESH_ORDER / AREA_ORDER))
        finer = refinement(self._scales, excess, float(np.interp(place, self._run.delta_star, self._run.singular)))
        limit = "" if worst <= goal.tolerance else self._unreachable(algebraic, float(of_steps.max()))
        return worst, worst_area, finer, limit

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

    def _limit(self, finer: float) -> str:
        """Why there is no next mesh; empty where there may be one."""
        if len(self._meshes) == MOST_MESHES:
            return f"a run takes {MOST_MESHES} meshes at most"
        return self._run.limit(self._goal, finer, self._path.substeps)

    def _unreachable(self, algebraic: float, of_steps: float) -> str:
        """Why no mesh meets the tolerance with these relative bars of equations and load steps; empty when one may."""
        if algebraic + of_steps <= MARGIN * self._goal.tolerance:
            return ""
        if algebraic > of_steps:
            return f"{algebraic:.2g} is left by the equations, lower solver.rtol or raise accuracy.tolerance"
        return self._path.limit or "what is left comes from the load steps, raise loading.steps"
