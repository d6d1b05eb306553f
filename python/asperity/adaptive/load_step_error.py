"""Error of the force from the load steps, and the number of parts that the tolerance takes.

Plastic flow and stick make the force depend on the load steps.

The first mesh measures it: it depends little on the mesh, and corrects the forces of all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from asperity.adaptive.extrapolation import Along, along, judged_rows, loading_force, scaled, steady
from asperity.adaptive.mesh_levels import LevelSolver
from asperity.adaptive.mesh_plan import (
    GREATEST_STEP,
    PATH_TRANSFER,
    STEP_ORDERS,
    STICK,
    enough_substeps,
    extrapolate,
)
from asperity.arrays import Floats
from asperity.curve import Curve
from asperity.model.settings import AccuracyTarget
from asperity.quasistatic.contact_result import ContactResult

# With other steps other nodes are touched first, so that the order of stick is seen as low as this between two runs,
# and a correction may even have the wrong sign: the error by this order adds to its bar
LEAST_ORDERS = {STICK: 0.5}


@dataclass(frozen=True)
class LoadStepError:
    """Error of the force from the load steps, relative, by the number of parts of each.

    Attributes:
        correction: error of the force
        bar: error left after the correction
        substeps: parts chosen for the finer meshes
        limit: why not more of them, if the tolerance takes more
        unknown: why there is no such error, empty where it is known
    """

    correction: dict[int, Along]
    bar: dict[int, Along]
    substeps: int
    limit: str
    unknown: str = ""

    @classmethod
    def none(cls, unknown: str = "") -> LoadStepError:
        """That of an elastic solid without friction, which has none; or why it is not known."""
        zero: dict[int, Along] = {1: np.zeros_like}
        return cls(zero, zero, 1, "", unknown)

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
    coarse, fine = (forces[k] for k in sorted(forces)[-2:])
    limit, _ = extrapolate(coarse, fine, 2.0, STEP_ORDERS[rule])
    errors = {k: values / limit - 1.0 for k, values in forces.items()}
    bars = {k: PATH_TRANSFER[rule] * steady(error) for k, error in errors.items()}
    if rule in LEAST_ORDERS:
        left = steady(extrapolate(coarse, fine, 2.0, LEAST_ORDERS[rule])[1] / limit)
        bars = {k: bar + left for k, bar in bars.items()}
    return errors, bars


def choose_substeps(
    run: LevelSolver, steps: int, rule: str, goal: AccuracyTarget
) -> tuple[ContactResult, LoadStepError]:
    """Solve on the first mesh for the error of the load steps, and choose the parts of each for the finer ones.

    It is loaded in steps of 1, 2, 4 ... parts, and the limit extrapolated from the last two runs. What is found
    corrects other meshes as well; a part of the correction, which need not carry over and is itself only known to
    leading order, is the bar.

    Args:
        steps: planned ones
        rule: see `mesh_plan.step_rule`

    Returns:
        the result with the most parts, at least two, and the error; no more parts are chosen than these. If the
        greatest number of dofs allows no mesh that is touched, the result of the last one without an error
    """
    result = run(1.0)
    while result.curve.untouched() and not run.limit(goal, GREATEST_STEP, 2):
        result = run(GREATEST_STEP)  # heights smoothed for large elements may lie below the flat
    if result.curve.untouched():
        return result, LoadStepError.none("no mesh that measures its load steps is touched")
    # a coarse mesh of a rough surface is touched late: a row without a force has no error of its own
    judged = judged_rows(result.curve, steps)
    at = result.curve.delta_star[judged & (result.curve.P_star > 0.0)]
    P, n = {1: loading_force(result.curve, at)}, 1
    while True:
        n *= 2
        del result
        result = run(substeps=n)
        P[n] = loading_force(result.curve, at)
        errors, bars = step_errors(P, rule)
        chosen = enough_substeps(bars, goal.tolerance, STEP_ORDERS[rule])
        stopped = run.limit(goal, substeps=2 * n) if chosen > n else ""
        if stopped or chosen <= n:
            correction, bar = ({k: along(at, v) for k, v in of.items()} for of in (errors, bars))
            return result, LoadStepError(correction, bar, min(chosen, n), stopped)
