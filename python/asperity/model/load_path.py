"""Load path: loading and unloading legs, and where their planned steps end."""

from __future__ import annotations

from dataclasses import dataclass

from asperity.model.limits import check

BACKWARD_EULER, MIDPOINT = "backward-euler", "midpoint"
INTEGRATORS = (MIDPOINT, BACKWARD_EULER)
FIRST_PIECES = (4, 4, 3, 2, 2, 2)  # into which the midpoint rule and stick divide the first planned steps


@dataclass(frozen=True)
class Schedule:
    """Load path; lengths in units of L, forces in units of A_0 E'.

    Attributes:
        delta_max: greatest approach, or None when `force_max` is given
        force_max: greatest force, found to 1e-6
        steps: planned steps of a loading
        unload_steps: planned steps of an unloading, 0 for none
        unload_to: force at the end of an unloading, found to 1e-6, over that at its beginning; 0 lifts the flat off
        cycles: loadings, each followed by an unloading; one when there is none
        integrator: of plasticity along a loading, "backward-euler" (first order) or "midpoint" (second)
        substeps: equal parts that each step of a loading is divided into
        sticks: whether the points in contact stick, which divides the first steps too
    """

    delta_max: float | None = None
    force_max: float | None = None
    steps: int = 10
    unload_steps: int = 0
    unload_to: float = 0.0
    cycles: int = 1
    integrator: str = BACKWARD_EULER
    substeps: int = 1
    sticks: bool = False

    def __post_init__(self) -> None:
        counts = dict.fromkeys(("steps", "cycles", "substeps"), "[1, inf)")
        check(
            self, "loading", integrator=INTEGRATORS, unload_steps="[0, inf)", unload_to="[0, 1)",
            delta_max="(0, inf)", force_max="(0, inf)", **counts,
        )  # fmt: skip

    def stops(self) -> list[float]:
        """Ends of the steps of a loading, as fractions of it; the planned steps are among them.

        The midpoint rule starts with half a step. Its first steps and those of stick are divided: the error goes with a
        power of the step over the approach.
        """
        midpoint = self.integrator == MIDPOINT
        divided = FIRST_PIECES if midpoint or self.sticks else ()
        stops: list[float] = []
        for k in range(self.steps):
            pieces = self.substeps * (divided[k] if k < len(divided) else 1)
            stops += [(k + j / pieces) / self.steps for j in range(1, pieces + 1)]
        return [0.5 * stops[0], *stops] if midpoint else stops

    @property
    def legs(self) -> list[tuple[str, int]]:
        """Branch and planned steps of each loading and unloading, in order."""
        legs = []
        for cycle in range(self.cycles if self.unload_steps else 1):
            legs.append(("reload" if cycle else "load", self.steps))
            if self.unload_steps:
                legs.append(("unload", self.unload_steps))
        return legs
