# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Omit cases of a study whose first contact is on an edge of the patch, or replace their seeds."""

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
MOST_DRAWS = 1000  # seeds tried as the replacement of one


def without_edge_summits(cases: Sequence[Case], rule: Rule, where: str) -> tuple[list[Case | None], dict[int, Any]]:
    """Replace the cases whose first contact is on an edge of the patch, see `case.validation.doubt_of_edge`.

    Levels are compared seed by seed. A seed that is unusable for one surface of the study is therefore replaced in all
    its cases, by the next seed that no case has and that is usable for all of them.

    Args:
        cases: cases of the study.
        rule: "redraw" replaces such seeds, "skip" omits them, "keep" keeps them.
        where: name of the study in messages.

    Returns:
        The replacement of each case, None for omitted ones; and the replacement of each unusable seed, None for
        omitted ones.

    Raises:
        InputError: no case is left, a surface has no seed to replace, or none of MOST_DRAWS seeds is usable.
    """
    if rule == "keep":
        return list(cases), {}
    known: dict[tuple[str, str], bool] = {}

    def touches_edge(case: Case) -> bool:
        key = (case.surface.model_dump_json(), case.block.sides)
        if key not in known:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", SurfaceWarning)  # the run of the case issues it
                known[key] = bool(doubt_of_edge(case.block.sides, case.build_surface()))
        return known[key]

    seeds = [getattr(case.surface, "seed", None) for case in cases]
    fresh = itertools.count(max((seed for seed in seeds if seed is not None), default=0) + 1)
    chosen: dict[int, int | None] = {}
    for seed in dict.fromkeys(seed for seed in seeds if seed is not None):
        group = [case for case, of in zip(cases, seeds, strict=True) if of == seed]
        if not any(map(touches_edge, group)):
            continue
        tried = itertools.islice(fresh, MOST_DRAWS)
        good = (new for new in tried if not any(touches_edge(_with_seed(case, new)) for case in group))
        chosen[seed] = next(good, None) if rule == "redraw" else None
        if rule == "redraw" and chosen[seed] is None:
            raise InputError(
                f'{where}: edge_summits = "redraw": none of {MOST_DRAWS} seeds has its first contact inside the patch; '
                "use a larger surface.f_max, because with few waves the longest ones put the summit on an edge"
            )
    out: list[Case | None] = []
    for case, seed in zip(cases, seeds, strict=True):
        if seed is None and touches_edge(case):
            if rule == "redraw":
                raise InputError(
                    f'{where}: edge_summits = "redraw", but a surface of kind {case.surface.kind} has no seed and its '
                    'first contact is on an edge; use "skip" or "keep"'
                )
            out.append(None)
        elif seed in chosen:
            new = chosen[seed]
            out.append(None if new is None else _with_seed(case, new))
        else:
            out.append(case)
    if not any(out):
        raise InputError(f'{where}: edge_summits = "skip" leaves no case; use "redraw" or other seeds')
    return out, chosen


def describe_replaced(chosen: Mapping[int, int | None]) -> str:
    """Describe the replacement of seeds for a message; empty for none."""
    if not chosen:
        return ""
    words = ", ".join(f"{seed} omitted" if new is None else f"{seed} replaced by {new}" for seed, new in chosen.items())
    return f"seeds whose first contact is on an edge of the patch: {words}"


def _with_seed(case: Case, seed: int) -> Case:
    return case.model_copy(update={"surface": case.surface.model_copy(update={"seed": seed})})
