"""The one cut-off recommended for a case whose short waves no mesh resolves that it may have."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asperity.adaptive.estimate import Estimate, estimate
from asperity.adaptive.guide import PASSES
from asperity.adaptive.mesh_plan import MARGIN
from asperity.errors import InputError
from asperity.surface.cutoff import shortest_cutoff
from asperity.units import per_cent

if TYPE_CHECKING:
    from asperity.case import Case
    from asperity.surface import Surface


def filter_advice(case: Case, found: Estimate, surface: Surface) -> str:
    """Sentence on a surface that probably no mesh of the case resolves, with the cut-off to apply; empty for others."""
    if found.enough:
        return ""
    cutoff = recommended_cutoff(case, surface, found.approach)
    text = (
        f"a run would need more than the {case.accuracy.max_dofs} dofs of accuracy.max_dofs for the "
        f"{case.accuracy.tolerance:.2g} of accuracy.tolerance: raise one of them"
    )
    if cutoff is None:
        return f"{text}; a cut-off that helps would take more than a quarter of the rms height"
    return f"{text}, or cut off what is shorter than {cutoff:g} ({surface.cutoff_key})"


def note_on_steps(surface: Surface, approach: float) -> str:
    """Sentence on a map with steps or edges, between whose heights a spline would rise too far; empty for others."""
    rise = getattr(surface, "spline_rise", 0.0)
    if not rise:
        return ""
    return (
        "the map has steps or edges: its slopes are limited there, or the surface would rise above the highest height, "
        f"by {per_cent(rise / approach)} of the approach"
    )


def recommended_cutoff(case: Case, surface: Surface, approach: float) -> float | None:
    """Shortest cut-off with which the case is expected to meet its tolerance; see `cutoff.shortest_cutoff` [length]."""
    accuracy = case.accuracy.model_copy(update={"max_dofs": int(MARGIN * case.accuracy.max_dofs)})

    def accepts(filtered: Surface, delta: float) -> bool:
        loading = case.loading.model_copy(update={"delta_max": delta, "force_max": None, "pressure_max": None})
        changed = case.model_copy(update={"loading": loading, "accuracy": accuracy})
        try:  # a coarse half-space, which takes a tenth of the time, refuses most
            return all(estimate(changed, surface=filtered, passes=n).enough for n in range(1, PASSES + 1))
        except InputError:  # its first mesh is too large
            return False

    return shortest_cutoff(surface, approach, accepts)
