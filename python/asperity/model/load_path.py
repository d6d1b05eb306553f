"""Load path: loading and unloading legs, and where their planned steps end."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from asperity.errors import InputError
from asperity.runtime.declaration import (
    FORCE,
    LENGTH,
    SCRIPT,
    STRESS,
    Choices,
    Flag,
    Positive,
    Real,
    Whole,
    declared,
    key,
)
from asperity.runtime.display import show

BACKWARD_EULER, MIDPOINT = "backward-euler", "midpoint"
DRIVERS = ("delta_max", "force_max", "pressure_max")  # keys of which one is given
TIME, HOLD_STEPS = "s", 10  # unit of time, and steps of a hold where they are not given
FIRST_PIECES = (4, 4, 3, 2, 2, 2)  # into which the midpoint rule and stick divide the first planned steps


@declared("loading")
class Schedule:
    """Motion of the flat, or its force.

    Attributes:
        substeps: equal parts that each step of a loading is divided into
        sticks: whether the points in contact stick, which divides the first steps too
    """

    delta_max: Real | None = key(
        "greatest approach from first touch (or force_max or pressure_max)",
        LENGTH,
        default=None,
        hint="about 0.03 L",
        share=(1e-7, 1e3),
    )
    force_max: Positive | None = key("greatest normal force, found to 1e-6 (or delta_max)", FORCE, default=None)
    pressure_max: Positive | None = key(
        "greatest nominal pressure, the force over L^2 (or delta_max)", STRESS, default=None
    )
    steps: Whole = key("least number of load steps", default=10, ge=1, le=100_000)
    unload: Flag = key(
        "unload after loading; false: not, whatever unload_steps is", default=None, shown="true where unload_steps > 0"
    )
    cycles: Whole = key("number of loadings, each followed by an unloading", default=1, ge=1, le=1000)
    unload_steps: Whole = key(
        "steps of an unloading", default=None, shown="steps // 2 with unload = true, otherwise 0", ge=0, le=100_000
    )
    unload_to: Real = key(
        "force at which an unloading ends, over that at its beginning; 0 lifts the flat off", default=0.0, ge=0, lt=1
    )
    duration: Positive | None = key(
        "of each loading and each unloading, for a material.law with time: the flat moves at a constant rate to "
        "delta_max, otherwise the force changes at a constant rate",
        TIME,
        default=None,
    )
    hold: Positive | None = key(
        "time after each loading in which the flat stays, with force_max or pressure_max the force", TIME, default=None
    )
    hold_steps: Whole | None = key(
        "steps of a hold, the first ones short: step k ends at (k/hold_steps)^2 of it",
        default=None,
        shown=f"{HOLD_STEPS} with hold, otherwise 0",
        ge=0,
        le=100_000,
    )
    integrator: Annotated[str, Choices("midpoint", "backward-euler")] | None = key(
        "of plasticity along a loading: second or first order in the step",
        default=None,
        shown="midpoint; backward-euler where material.law does not declare that its state is a strain",
    )
    substeps: Annotated[Whole, *SCRIPT, Field(ge=1, le=1000)] = 1
    sticks: Annotated[Flag, *SCRIPT] = False

    def __post_init__(self) -> None:
        given = [f"loading.{name}" for name in DRIVERS if getattr(self, name) is not None]
        if not given:
            raise InputError(
                "loading.delta_max, loading.force_max and loading.pressure_max are all missing; give exactly one, or "
                "in a case the preload of a joint, whose overload then is the greatest load"
            )
        if len(given) > 1:
            raise InputError(
                f"{' and '.join(given)} are {'both' if len(given) == 2 else 'all'} given; give exactly one"
            )
        steps = self.unload_steps
        if self.unload and steps == 0:
            raise InputError(
                "loading.unload_steps = 0 is no unloading, and loading.unload = true: leave one of them out"
            )
        if steps is None:
            steps = max(self.steps // 2, 1) if self.unload else 0
        elif self.unload is False:
            steps = 0
        if self.hold is not None and self.duration is None:
            raise InputError(f"loading.hold = {show(self.hold)} needs loading.duration, the time of a loading [s]")
        if self.hold_steps is not None and (self.hold is None) == (self.hold_steps > 0):
            raise InputError(
                f"loading.hold_steps = {self.hold_steps} "
                + ("needs loading.hold, its time [s]" if self.hold is None else "is no hold: leave out loading.hold")
            )
        held = self.hold_steps or (HOLD_STEPS if self.hold else 0)
        for name, value in (("unload", steps > 0), ("unload_steps", steps), ("hold_steps", held)):
            object.__setattr__(self, name, value)
        for name, idle in (("cycles", 1), ("unload_to", 0.0)):
            if (value := getattr(self, name)) > idle and not self.unload_steps:
                raise InputError(f"loading.{name} = {show(value)} needs an unloading; set loading.unload = true")

    @property
    def driver(self) -> str:
        """Key of the greatest load: "delta_max", "force_max" or "pressure_max"."""
        return next(key for key in DRIVERS if getattr(self, key) is not None)

    def stops(self, branch: str = "load") -> list[float]:
        """Ends of the steps of a leg, as fractions of it; the planned steps are among them.

        The midpoint rule starts with half a step. Its first steps and those of stick are divided: the error goes with a
        power of the step over the approach. Creep and relaxation slow down: the steps of a hold grow.
        """
        if branch in ("hold", "unload"):
            n = self.substeps * ((self.hold_steps if branch == "hold" else self.unload_steps) or 0)
            return [(k / n) ** (2 if branch == "hold" else 1) for k in range(1, n + 1)]
        midpoint = self.integrator == MIDPOINT
        divided = FIRST_PIECES if midpoint or self.sticks else ()
        stops: list[float] = []
        for k in range(self.steps):
            pieces = self.substeps * (divided[k] if k < len(divided) else 1)
            stops += [(k + j / pieces) / self.steps for j in range(1, pieces + 1)]
        return [0.5 * stops[0], *stops] if midpoint else stops

    @property
    def legs(self) -> list[tuple[str, int]]:
        """Branch and planned steps of each loading, hold and unloading, in order."""
        legs = []
        for cycle in range(self.cycles):
            legs.append(("reload" if cycle else "load", self.steps))
            if self.hold_steps:
                legs.append(("hold", self.hold_steps))
            if self.unload_steps:
                legs.append(("unload", self.unload_steps))
        return legs

    @property
    def compared(self) -> int:
        """First legs, along which meshes are compared: the first loading and its hold."""
        return 1 + bool(self.hold_steps)

    def seconds(self, branch: str) -> float:
        """Time that a leg takes [s]; zero where it takes none."""
        return (self.hold if branch == "hold" else self.duration) or 0.0
