"""What small strain changes in the force, by the slope of the spots in contact, and the choice between both strains.

A half-space at the greatest load shows the spots. The rule errs towards finite strain, which is right in any case.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from asperity.adaptive.guide import Guide, approach_of_force
from asperity.mesh.resolution import ONE_MESH
from asperity.model.material import AUTO
from asperity.model.problem import Problem
from asperity.runtime.parallel import on_root_bcast

if TYPE_CHECKING:
    from mpi4py import MPI

SHARE = 1.0 / 3.0  # of the tolerance that small strain may change, ONE_MESH without one
# Change over the rms slope of the spots, and over its square in a solid that yields: no scene of
# tests/adaptive/test_small_strain.py, pressed both ways, has more
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
    problem: Problem, tolerance: float | None = None, comm: MPI.Comm | None = None, guide: Guide | None = None
) -> tuple[Problem, SmallStrain | None]:
    """The problem with small or finite strain, and what small strain changes in its force; collective.

    Of kinematics = "auto", small strain is chosen where it changes the force by less than a third of the tolerance, 5 %
    without one; another choice is kept, and nothing is estimated.

    Args:
        problem: with any material.kinematics
        tolerance: relative, of the force
        comm: communicator; default all ranks
        guide: half-space of the problem on rank 0, where there is one

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
    found = on_root_bcast(MPI.COMM_WORLD if comm is None else comm, lambda: judge(problem, tolerance, guide))
    return replace(problem, material=replace(problem.material, kinematics=found.kinematics)), found


def judge(problem: Problem, tolerance: float | None, guide: Guide | None = None) -> SmallStrain:
    """The choice of `choose_kinematics`, in one process."""
    solid = problem.material
    guide = guide or Guide(problem, problem.load_path.delta_max or approach_of_force(problem), steps=1)
    load, slope = float(guide.force[-1]) * solid.reduced_modulus, guide.slope
    strain = load / solid.block_modulus(problem.sides)
    if load >= solid.yield_pressure(problem.sides):  # the block flows as a whole
        strain = guide.depth / problem.height
    # of a block as a whole the stress is ln(1 - e)/(1 - e) for -e, to first order
    change = 1.5 * strain + ELASTIC * slope + (YIELDING * slope**2 if solid.plastic else 0.0)
    limit = SHARE * (ONE_MESH if tolerance is None else tolerance)
    return SmallStrain("small" if change <= limit else "finite", slope, 100.0 * change, 100.0 * limit)
