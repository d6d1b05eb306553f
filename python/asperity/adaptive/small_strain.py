"""What small strain changes in the force, by the slope of the spots in contact, and the choice between both strains.

A half-space at the greatest load shows the spots. The rule errs towards finite strain, which is right in any case.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.adaptive.guide import CELLS, PER_WAVE, approach_of_force, half_space
from asperity.model.material import AUTO
from asperity.model.problem import Problem
from asperity.reference.halfspace import cells_per_side
from asperity.runtime.parallel import on_root_bcast

if TYPE_CHECKING:
    from mpi4py import MPI

SHARE = 1.0 / 3.0  # of the tolerance that small strain may change
ONE_MESH = 0.01  # change of the force accepted without a tolerance
COMPRESSION = 1.5  # change over the strain of a block as a whole: ln(1 - e)/(1 - e) against -e
# Change over the rms slope of the spots, and over its square in a solid that yields: 13 scenes of slopes of 0.01 to
# 0.5, pressed both ways, have up to 0.11 where they are elastic, and up to 4.4 more of hardening E/20 and E/1000
ELASTIC, YIELDING = 0.11, 5.0


@dataclass(frozen=True)
class SmallStrain:
    """Estimate of what small strain changes in the force.

    Attributes:
        kinematics: chosen, "small" or "finite"
        slope: rms slope of the spots in contact under the greatest load
        percent: greatest change of the force [per cent]
        limit: greatest one with which small strain is chosen [per cent]
    """

    kinematics: str
    slope: float
    percent: float
    limit: float

    def describe(self) -> str:
        """One line for the log."""
        return (
            f"kinematics = {self.kinematics}: small strain changes the force by up to {self.percent:.2g} %, the limit "
            f"is {self.limit:.2g} %"
        )

    def to_dict(self) -> dict[str, Any]:
        """Section model.small_strain of summary.json."""
        return {"greatest_percent": self.percent, "limit_percent": self.limit, "slope": self.slope}


def choose_kinematics(
    problem: Problem, tolerance: float | None = None, comm: MPI.Comm | None = None
) -> tuple[Problem, SmallStrain | None]:
    """The problem with small or finite strain, and what small strain changes in its force; collective.

    Of kinematics = "auto", small strain is chosen where it changes the force by less than a third of the tolerance,
    ONE_MESH without one; another choice is kept, and nothing is estimated.

    Args:
        problem: with any material.kinematics
        tolerance: relative, of the force
        comm: communicator; default all ranks

    Examples:
        >>> from asperity.surface import Flat
        >>> rubber = asp.Material(E=1.0, nu=0.3, kinematics="auto")
        >>> for delta in (0.001, 0.1):
        ...     chosen, found = choose_kinematics(asp.Problem.of(Flat(L=1.0), rubber, delta_max=delta))
        ...     print(chosen.material.kinematics, round(found.percent, 2))
        small 0.15
        finite 15.0
    """
    from mpi4py import MPI

    if problem.material.kinematics != AUTO:
        return problem, None
    found = on_root_bcast(MPI.COMM_WORLD if comm is None else comm, lambda: judge(problem, tolerance))
    return replace(problem, material=replace(problem.material, kinematics=found.kinematics)), found


def judge(problem: Problem, tolerance: float | None) -> SmallStrain:
    """The choice of `choose_kinematics`, in one process."""
    limit = 100.0 * (ONE_MESH if tolerance is None else SHARE * tolerance)
    slope, change = change_of_force(problem)
    return SmallStrain("small" if 100.0 * change <= limit else "finite", slope, 100.0 * change, limit)


def change_of_force(problem: Problem) -> tuple[float, float]:
    """Rms slope of the spots in contact under the greatest load, and the relative change of the force; in one process.

    The summit of a spot between the centres of the cells has no slope.
    """
    surface, solid = problem.surface, problem.material
    L, depth = surface.L, problem.load_path.delta_max or approach_of_force(problem)
    n = cells_per_side(float(np.clip(PER_WAVE * L / surface.feature_size, *CELLS)))
    layer = half_space(problem, n)
    heights = layer.heights(surface)
    (pressure,) = layer.pressures(heights, surface.maximum()[2] / L, [depth / L])
    touched = pressure > 0.0
    square = sum(slope[touched] ** 2 for slope in np.gradient(heights, 1.0 / n))
    slope = float(np.sqrt(np.mean(square))) if touched.any() else 0.0
    load = float(pressure.mean()) * solid.reduced_modulus
    strain = load / solid.block_modulus(problem.sides)
    if load >= solid.yield_pressure(problem.sides):  # the block flows as a whole
        strain = depth / problem.height
    return slope, COMPRESSION * strain + ELASTIC * slope + (YIELDING * slope**2 if solid.plastic else 0.0)
