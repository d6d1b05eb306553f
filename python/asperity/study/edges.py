"""Cases of a study whose flat first touches on an edge of the patch: left out, or drawn again with another seed."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from asperity.case.validation import doubt_of_edge
from asperity.errors import InputError
from asperity.surface import SurfaceWarning

if TYPE_CHECKING:
    from asperity.case import Case

Rule = Literal["keep", "redraw", "skip"]
RULES: tuple[Rule, ...] = ("keep", "redraw", "skip")
MOST_DRAWS = 1000  # seeds tried for one


def without_edge_summits(cases: Sequence[Case], rule: Rule, where: str) -> tuple[list[Case | None], dict[int, Any]]:
    """Replace the cases whose flat first touches on an edge of the patch, see `checks.doubt_of_edge`.

    A seed is judged with all cases that have it: levels are compared seed by seed, so a seed that is spoilt for one
    surface of the study is replaced in all of them, by the next one that no case has and that spoils none.

    Args:
        cases: of the study.
        rule: "redraw" or "skip" such cases, or "keep" them.
        where: name of the study in messages.

    Returns:
        the case in the place of each, None where it is left out; and by what each spoilt seed was replaced, None for
        nothing.

    Raises:
        InputError: nothing is left, there is no seed to draw again, or none of MOST_DRAWS will do.
    """
    if rule == "keep":
        return list(cases), {}
    known: dict[tuple[str, str], bool] = {}

    def spoilt(case: Case) -> bool:
        key = (case.surface.model_dump_json(), case.block.sides)
        if key not in known:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", SurfaceWarning)  # the run of the case tells
                known[key] = bool(doubt_of_edge(case.block.sides, case.build_surface()))
        return known[key]

    seeds = [getattr(case.surface, "seed", None) for case in cases]
    fresh = itertools.count(max((seed for seed in seeds if seed is not None), default=0) + 1)
    chosen: dict[int, int | None] = {}
    for seed in dict.fromkeys(seed for seed in seeds if seed is not None):
        group = [case for case, of in zip(cases, seeds, strict=True) if of == seed]
        if not any(map(spoilt, group)):
            continue
        tried = itertools.islice(fresh, MOST_DRAWS)
        good = (new for new in tried if not any(spoilt(_drawn(case, new)) for case in group))
        chosen[seed] = next(good, None) if rule == "redraw" else None
        if rule == "redraw" and chosen[seed] is None:
            raise InputError(
                f'{where}: edge_summits = "redraw": none of {MOST_DRAWS} seeds first touches inside the patch; '
                "take a larger surface.f_max, for the longest waves put the summit on an edge"
            )
    out: list[Case | None] = []
    for case, seed in zip(cases, seeds, strict=True):
        if seed is None and spoilt(case):
            if rule == "redraw":
                raise InputError(
                    f'{where}: edge_summits = "redraw", but a surface of kind {case.surface.kind} has no seed and '
                    'first touches on an edge; take "skip" or "keep"'
                )
            out.append(None)
        elif seed in chosen:
            new = chosen[seed]
            out.append(None if new is None else _drawn(case, new))
        else:
            out.append(case)
    if not any(out):
        raise InputError(f'{where}: edge_summits = "skip" leaves no case; take "redraw" or other seeds')
    return out, chosen


def told(chosen: Mapping[int, int | None]) -> str:
    """What became of the spoilt seeds, in words; empty for none."""
    if not chosen:
        return ""
    words = ", ".join(
        f"{seed} left out" if new is None else f"{seed} replaced by {new}" for seed, new in chosen.items()
    )
    return f"seeds whose flat first touches on an edge of the patch: {words}"


def _drawn(case: Case, seed: int) -> Case:
    return case.model_copy(update={"surface": case.surface.model_copy(update={"seed": seed})})
