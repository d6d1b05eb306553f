"""Callbacks of a load path, and what to keep of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypedDict

from asperity.curve import Curve
from asperity.fem.solid import Solid
from asperity.quasistatic.stepping import Callback
from asperity.quasistatic.stiffness import Stiffness

if TYPE_CHECKING:
    from asperity.quasistatic.checkpoint import Checkpoint


class CallbackArguments(TypedDict, total=False):
    """The attributes of `Callbacks` as arguments."""

    on_stage: Callable[[str], None] | None
    on_step: Callback | None
    stop: Callable[[], str] | None
    checkpoint: Checkpoint | None
    snapshots: int
    on_ready: Callable[[], None] | None
    stiffness: bool
    conductance: bool
    flow: bool
    on_curve: Callable[[Curve], None] | None


@dataclass(frozen=True)
class Callbacks:
    """Callbacks of a load path, and what to keep of it.

    Attributes:
        on_stage: called with the name of each stage
        on_step: called after each accepted step
        stop: polled after each step on all ranks; a non-empty string stops the run
        checkpoint: receives the state; one that holds a state is continued from
        snapshots: states of the top to keep per loading
        on_ready: called when mesh and solver are made, before anything is saved
        stiffness: whether to compute the columns k_n_elastic to k_t_interface
        conductance: with stiffness, whether to compute the column conductance too
        flow: whether to compute the columns transmissivity_x to hydraulic_aperture
        on_curve: with a tolerance, called with the curve with error bars that each mesh after the first gives
    """

    on_stage: Callable[[str], None] | None = None
    on_step: Callback | None = None
    stop: Callable[[], str] | None = None
    checkpoint: Checkpoint | None = None
    snapshots: int = 0
    on_ready: Callable[[], None] | None = None
    stiffness: bool = False
    conductance: bool = True
    flow: bool = False
    on_curve: Callable[[Curve], None] | None = None

    def probes(self, solid: Solid) -> tuple[Any, ...]:
        """Measurements of each accepted step that are requested, see `ContactSolver`; collective."""
        return (Stiffness(solid, self.conductance),) if self.stiffness else ()

    def stage(self, name: str) -> None:
        """Announce a stage."""
        if self.on_stage is not None:
            self.on_stage(name)
