"""Error of the force from the load steps, and the number of parts that the tolerance takes.

Plastic flow and stick make the force depend on the load steps. The first mesh measures the error: it depends little on
the mesh, and corrects the forces of all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf

import numpy as np

from asperity.adaptive.limits import MARGIN, RATIO, steady
from asperity.adaptive.loading import judged_rows, loading_force, scaled
from asperity.adaptive.meshes import LevelSolver
from asperity.arrays import Floats
from asperity.curve import Curve
from asperity.curve.slope import SINGLE_CONTACT
from asperity.laws import shipped
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT
from asperity.model.problem import Problem
from asperity.quasistatic.contact_result import ContactResult

STICK = "stick"  # where nodes are touched within a step (docs/theory.md)
# Order of the force in the load step, and bar over correction, which need not carry over to other meshes. Of the rule
# of first order much more is corrected. With other steps other nodes stick first, so that the order of stick is seen as
# low as 0.5 between two runs, and its correction may even have the wrong sign: 1 + (2^1.5 - 1)/(2^0.5 - 1)
STEP_RULES = {MIDPOINT: (2.0, 0.5), STICK: (1.5, 5.4), BACKWARD_EULER: (1.0, 1.0)}
MOST_SUBSTEPS = 32  # parts of a load step: each doubling is one more run of the first mesh
LEAST_ORDER = 0.5  # of the force in the load step, below which runs show no convergence


def none() -> dict[int, Floats]:
    """Errors of whole steps that have none."""
    return {1: np.zeros(1)}


@dataclass(frozen=True)
class LoadStepError:
    """Error of the force from the load steps, relative, by the number of parts of each; by default there is none.

    Attributes:
        substeps: parts chosen for the finer meshes
        at: approaches (k,) [L]
        errors: that are corrected there (k,)
        bars: of what is left after the correction (k,)
        unknown: why there is no such error, empty where it is known
    """

    substeps: int = 1
    at: Floats = field(default_factory=lambda: np.zeros(1))
    errors: Mapping[int, Floats] = field(default_factory=none)
    bars: Mapping[int, Floats] = field(default_factory=none)
    unknown: str = ""

    def removed(self, curve: Curve, substeps: int) -> Curve:
        """A curve computed in so many parts of each step, corrected for the load steps; see `scaled`."""
        factor = 1.0 / (1.0 + np.interp(curve.delta_star, self.at, self.errors[substeps]))
        return scaled(curve, factor[curve.branch == "load"])

    def left(self, delta_star: Floats, substeps: int) -> Floats:
        """Bar of such a curve at approaches (n,)."""
        return np.interp(delta_star, self.at, self.bars[substeps])


def step_rule(problem: Problem) -> str:
    """What the error of the load steps follows, a key of STEP_RULES: the rule of plasticity, or that of stick."""
    integrator, sticks = problem.load_path.integrator or BACKWARD_EULER, problem.formulation.sticks
    return STICK if sticks and not (problem.material.plastic and integrator == BACKWARD_EULER) else integrator


def measures_order(problem: Problem) -> bool:
    """Whether the order of the load steps is measured, in a third run, as for backward Euler and laws of the user.

    That of the midpoint rule is known for the laws that come along; the bar of stick holds for all orders.
    """
    law, rule = problem.material.law, step_rule(problem)
    return rule == BACKWARD_EULER or (
        rule == MIDPOINT and law is not None and law.function not in shipped.LAWS.values()
    )


def step_errors(
    forces: Mapping[int, Floats], rule: str, measured: bool = False
) -> tuple[dict[int, Floats], dict[int, Floats]]:
    """Error of forces from their load steps, relative, and the bar of what is left after its correction.

    The last two runs are corrected by the order of the rule. A third one measures the order: the bar holds the lower
    one too, down to LEAST_ORDER. Where two runs agree more than the order of the rule allows, they do so by chance, and
    the difference before counts.

    Args:
        forces: along a path, by the number of parts of each step, the last ones with twice as many each (n,)
        rule: see `step_rule`
        measured: whether the order is measured, of at least three runs

    Returns:
        errors and bars by the number of parts (n,)
    """
    order, part = STEP_RULES[rule]
    *earlier, coarse, fine = (forces[k] for k in sorted(forces))
    share = 1.0 / (2.0**order - 1.0)
    limit = np.maximum(fine - share * (coarse - fine), 0.1 * fine)  # of runs that differ by more nothing is known
    errors = {k: values / limit - 1.0 for k, values in forces.items()}
    bars = {k: part * steady(error) for k, error in errors.items()}
    if measured and earlier:
        before, last = steady((earlier[-1] - coarse) / limit), steady((coarse - fine) / limit)
        found = np.clip(np.log2(np.maximum(before, 1e-300) / np.maximum(last, 1e-300)), LEAST_ORDER, order)
        least = np.maximum(last, before / 2.0**order)
        left = np.maximum(part * share, 1.0 / (2.0**found - 1.0) - share) * least
        bars = {k: np.maximum(bar, left) for k, bar in bars.items()}
    return errors, bars


def held(curve: Curve, time: Floats) -> Floats:
    """P* at times of holds, at a given approach (m,): a force that is held is the less, the farther the flat creeps."""
    hold = curve.where(curve.branch == "hold")
    return np.interp(time, hold.time, hold.P_star / hold.delta_star**SINGLE_CONTACT) if time.size else time


def choose_substeps(run: LevelSolver, tolerance: float) -> tuple[ContactResult, LoadStepError]:
    """Solve on the first mesh for the error of the load steps, and choose the parts of each for the finer ones.

    The mesh is loaded in steps of 1, 2, 4 ... parts, and the limit extrapolated from the last runs. What is found
    corrects other meshes as well. Where by the order of the rule more than MOST_SUBSTEPS would be needed, or runs
    differ by chance, the parts with the least bar are chosen, and `refine` asks for more steps. A hold is corrected as
    the end of the loading before, whose bar covers the error that is left of the hold.

    Returns:
        the result with the most parts, at least two, and the error. If the greatest number of dofs allows no mesh that
        is touched, the result of the last one without an error
    """
    rule, measured = step_rule(run.problem), measures_order(run.problem)
    result = run.press()
    while result.curve.untouched() and not run.limit():
        run.refine(RATIO)  # heights smoothed for large elements may lie below the flat
        result = run.press()
    if result.curve.untouched():
        return result, LoadStepError(unknown="no mesh that measures its load steps is touched")
    # a coarse mesh of a rough surface is touched late: a row without a force has no error of its own
    judged = judged_rows(result.curve, run.problem.load_path.steps)
    at = result.curve.delta_star[judged & (result.curve.P_star > 0.0)]
    P, n, before = {1: loading_force(result.curve, at)}, 1, inf
    time = result.curve.time[result.curve.branch == "hold"]
    H = {1: held(result.curve, time)}
    while True:
        n *= 2
        del result
        result = run.press(n)
        P[n], H[n] = loading_force(result.curve, at), held(result.curve, time)
        if measured and n == 2:
            continue
        errors, bars = step_errors(P, rule, measured)
        if time.size:
            others, more = step_errors(H, rule, measured)
            for k, of_end in bars.items():
                of_end[-1] = max(of_end[-1], float(np.max(np.abs(others[k] - errors[k][-1]) + more[k])))
        left = {k: float(np.max(bar)) for k, bar in bars.items()}
        enough = next((k for k in sorted(left) if left[k] < MARGIN * tolerance), 0)
        needed = n * (left[n] / (MARGIN * tolerance)) ** (1.0 / STEP_RULES[rule][0])
        if enough or left[n] >= before or needed > MOST_SUBSTEPS:
            return result, LoadStepError(enough or min(left, key=lambda k: left[k]), at, errors, bars)
        before = left[n]
