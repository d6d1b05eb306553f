"""Error of the force from the load steps, and the number of parts that the tolerance takes.

Plastic flow and stick make the force depend on the load steps.

The first mesh measures it: it depends little on the mesh, and corrects the forces of all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import inf
from typing import Any

import numpy as np

from asperity.adaptive.extrapolation import judged_rows, loading_force, scaled, steady
from asperity.adaptive.mesh_levels import LevelSolver
from asperity.adaptive.mesh_plan import MARGIN, MOST_SUBSTEPS, RATIO, STEP_RULES, step_rule
from asperity.arrays import Floats
from asperity.curve import Curve
from asperity.quasistatic.contact_result import ContactResult

Along = Callable[[Floats], Any]  # a relative error along the loading, at approaches (n,)


@dataclass(frozen=True)
class LoadStepError:
    """Error of the force from the load steps, relative, by the number of parts of each.

    Attributes:
        correction: error of the force
        bar: error left after the correction
        substeps: parts chosen for the finer meshes
        unknown: why there is no such error, empty where it is known
    """

    correction: Mapping[int, Along]
    bar: Mapping[int, Along]
    substeps: int = 1
    unknown: str = ""

    @classmethod
    def none(cls, unknown: str = "") -> LoadStepError:
        """That of an elastic solid without friction, which has none; or why it is not known."""
        return cls({1: np.zeros_like}, {1: np.zeros_like}, unknown=unknown)

    def removed(self, curve: Curve, substeps: int) -> Curve:
        """A curve computed in so many parts of each step, corrected for the load steps; see `scaled`."""
        factor = 1.0 / (1.0 + self.correction[substeps](curve.delta_star))
        return scaled(curve, factor[curve.branch == "load"])


def step_errors(forces: Mapping[int, Floats], rule: str) -> tuple[dict[int, Floats], dict[int, Floats]]:
    """Error of forces from their load steps, relative, and the bar of what is left after its correction.

    Args:
        forces: along a path, by the number of parts of each step, the last two with twice as many (n,)
        rule: see `mesh_plan.step_rule`

    Returns:
        errors and bars by the number of parts (n,)
    """
    order, part = STEP_RULES[rule]
    coarse, fine = (forces[k] for k in sorted(forces)[-2:])
    limit = fine - (coarse - fine) / (2.0**order - 1.0)
    errors = {k: values / limit - 1.0 for k, values in forces.items()}
    return errors, {k: part * steady(error) for k, error in errors.items()}


def choose_substeps(run: LevelSolver, tolerance: float) -> tuple[ContactResult, LoadStepError]:
    """Solve on the first mesh for the error of the load steps, and choose the parts of each for the finer ones.

    It is loaded in steps of 1, 2, 4 ... parts, and the limit extrapolated from the last two runs. What is found
    corrects other meshes as well. Where by the order of the rule more than MOST_SUBSTEPS would be needed, or runs
    differ by chance, the parts with the least bar are chosen, and `refine` asks for more steps.

    Returns:
        the result with the most parts, at least two, and the error. If the greatest number of dofs allows no mesh that
        is touched, the result of the last one without an error
    """
    rule, result = step_rule(run.problem), run(1.0)
    while result.curve.untouched() and not run.limit(RATIO):
        result = run(RATIO)  # heights smoothed for large elements may lie below the flat
    if result.curve.untouched():
        return result, LoadStepError.none("no mesh that measures its load steps is touched")
    # a coarse mesh of a rough surface is touched late: a row without a force has no error of its own
    judged = judged_rows(result.curve, run.problem.load_path.steps)
    at = result.curve.delta_star[judged & (result.curve.P_star > 0.0)]
    P, n, before = {1: loading_force(result.curve, at)}, 1, inf
    while True:
        n *= 2
        del result
        result = run(substeps=n)
        P[n] = loading_force(result.curve, at)
        errors, bars = step_errors(P, rule)
        left = {k: float(np.max(bar)) for k, bar in bars.items()}
        enough = next((k for k in sorted(left) if left[k] < MARGIN * tolerance), 0)
        needed = n * (left[n] / (MARGIN * tolerance)) ** (1.0 / STEP_RULES[rule][0])
        if enough or left[n] >= before or needed > MOST_SUBSTEPS:
            correction, bar = ({k: partial(np.interp, xp=at, fp=v) for k, v in of.items()} for of in (errors, bars))
            return result, LoadStepError(correction, bar, enough or min(left, key=lambda k: left[k]))
        before = left[n]
