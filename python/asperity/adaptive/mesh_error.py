# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Error of the force from the element size: the last level against those before, and the next mesh that follows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, nan

import numpy as np

from asperity.adaptive.extrapolation import (
    Budget,
    correct,
    facet_bar,
    judged_rows,
    relative,
    with_area,
    with_measures,
    worst_area_error,
    worst_error,
)
from asperity.adaptive.load_step_error import LoadStepError
from asperity.adaptive.mesh_levels import LevelSolver
from asperity.adaptive.mesh_plan import (
    FIRST_STEP,
    LEAST_STEP,
    error_of,
    facet_share,
    partner,
    plan_next,
    safety_of,
    size_for_area,
    size_for_facets,
)
from asperity.adaptive.roughness import Omission, Roughness
from asperity.arrays import Floats
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
        size: of the elements of the next level [L]
        limit: why there is no next level; empty when there may be one
    """

    curve: Curve
    budget: Budget
    worst: float
    worst_area: float
    met: bool
    known: str
    size: float
    limit: str


class MeshErrorEstimate:
    """Judges one level after the other; collective.

    Args:
        run: solver of levels
        goal: tolerance and limits
        steps: planned ones
        guide: curve of the first level
        path: error of the load steps
        roughness: half-space with all waves, on rank 0; None of a smooth surface
    """

    def __init__(
        self,
        run: LevelSolver,
        goal: AccuracyTarget,
        steps: int,
        guide: Curve,
        path: LoadStepError,
        roughness: Roughness | None,
    ) -> None:
        self._run, self._goal, self._steps, self._path, self._roughness = run, goal, steps, path, roughness
        self._sizes, self._curves = [run.levels[0].h / run.side], [path.removed(guide, 1)]

    def judge(self, result: ContactResult) -> Judgement:
        """Judge the force of the last level.

        Args:
            result: of this level
        """
        run, goal, path, levels = self._run, self._goal, self._path, self._run.levels
        self._sizes.append(levels[-1].h / run.side)
        sizes, substeps = self._sizes, levels[-1].substeps
        curve = path.removed(result.curve, substeps)
        missed = self._left_out(result)
        if missed is not None:
            curve = with_area(curve, missed)
        place = partner(sizes)
        coarse = self._curves[place]
        self._curves.append(curve)
        ratio = sizes[place] / sizes[-1]
        # a mesh that misses waves is as rough a partner as the guide
        safety = safety_of(place == 0 or missed is not None)
        share = facet_share(missed is not None, run.plastic, run.dilatation)
        judged, algebraic = judged_rows(result.curve, self._steps), result.checks.unsolved
        unresolved = "no node is touched" if curve.untouched() or coarse.untouched() else path.unknown
        if not unresolved:
            curve, budget = correct(curve, coarse, ratio, safety, judged, path.bar[substeps], algebraic, missed, share)
            curve = with_measures(curve, coarse, ratio, safety, budget, run.compliance)
            unresolved = curve.unresolved() or coarse.unresolved()

        room = (goal.max_dofs / result.dofs) ** (1.0 / run.growth_of_dofs())
        if unresolved:
            # by a single node the force grows with its size, and the difference of two meshes is no error
            worst, area, wanted, limit = nan, nan, sizes[-1] / FIRST_STEP, ""
            known = f"the force has no error bar, {unresolved}"
            curve = replace(result.curve, error_P_star=np.full(len(curve), nan))
            budget = Budget.unknown(len(curve))
        else:
            worst, area = worst_error(curve, self._steps), worst_area_error(curve, self._steps)
            known = self._known(worst, area)
            at, P_star = curve.delta_star[judged], curve.P_star[judged]
            of_steps = path.bar[path.substeps].at(at)
            mesh = relative((budget.mesh + budget.roughness)[judged], P_star)
            left = np.maximum(goal.tolerance - algebraic - of_steps, 0.1 * goal.tolerance)  # for the mesh
            wanted = self._wanted(sizes, place, mesh, left)
            if missed is not None:
                facets = facet_bar(self._curves[-1], coarse, at, ratio, share)
                wanted = min(wanted, size_for_facets(sizes[-1], facets, left))
            limit = "" if worst <= goal.tolerance else self._limit(algebraic, float(of_steps.max()))
            if goal.area_tolerance is not None:
                for_area = size_for_area(sizes[-1], area, goal.area_tolerance)
                wanted = for_area if worst <= goal.tolerance else min(wanted, for_area)
        size = max(wanted, sizes[-1] / max(room, LEAST_STEP))
        if not known:
            return Judgement(curve, budget, worst, area, True, known, size, "")
        limit = limit or run.limit(goal, sizes[-1], wanted if room < LEAST_STEP else size, path.substeps)
        if limit and missed is not None:
            limit += "; waves shorter than the elements limit it too: cut them off (asperity check tries cut-offs)"
        return Judgement(curve, budget, worst, area, False, known, size, limit)

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

    def _left_out(self, result: ContactResult) -> Omission | None:
        """What the mesh leaves out of a rough surface; collective."""
        run = self._run
        if not run.comm.bcast(self._roughness is not None, root=0):
            return None
        top = gather_top(result.solver.contact_surface, run.height / run.side)

        def left_out() -> Omission | None:
            return None if self._roughness is None or top is None else self._roughness.left_out(top)

        return on_root_bcast(run.comm, left_out)

    def _wanted(self, sizes: list[float], place: int, mesh: Floats, left: Floats) -> float:
        """Element size [L] that meets the tolerance.

        Args:
            sizes: of the levels [L]
            place: of the level extrapolated from
            mesh: relative error bars of the mesh at the judged rows (n,)
            left: what the tolerance leaves for them there (n,)
        """
        error = error_of(float(np.max(mesh / left)), sizes[place] / sizes[-1], place == 0)
        return plan_next(sizes, error, 1.0)

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
