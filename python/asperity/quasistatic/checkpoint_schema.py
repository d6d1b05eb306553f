# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Types, shapes and consistency of the numbers and arrays of a saved state; each check names the first fault."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import groupby
from typing import Any, Literal, get_type_hints

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError, create_model

from asperity.curve import COLUMNS, OPTIONAL
from asperity.quasistatic.balance import Checks
from asperity.quasistatic.contact_solver import Counts
from asperity.quasistatic.stepping import Position
from asperity.runtime.display import show
from asperity.runtime.shares import Share


class _Table(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)


def _table(keys: Mapping[str, Any], optional: Collection[str] = ()) -> Any:
    """Keys with their types; those of `optional` may be missing."""
    fields: dict[str, Any] = {name: (kind, None if name in optional else ...) for name, kind in keys.items()}
    return create_model("Table", __base__=_Table, **fields)


_BRANCH = Literal["load", "unload", "reload"]
_OF_ROW = dict.fromkeys(COLUMNS, float) | dict.fromkeys(("step", "newton", "krylov", "spots"), int)
_ROW = _table(_OF_ROW | {"branch": _BRANCH}, OPTIONAL)
_SNAPSHOT = _table({"step": int, "branch": _BRANCH, "delta": float, "digest": str})
_PRESS = _table(
    {
        "delta": float,
        "force": float,
        "before": float | None,
        "led": bool,
        "counts": _table(get_type_hints(Counts)),
        "checks": _table(get_type_hints(Checks)),
    }
)
_STATE = _table(
    {
        "format": int,
        "version": str,
        "identity": dict[str, Any],
        "mesh": str,
        "position": _table(get_type_hints(Position)),
        "press": _PRESS,
        "rows": list[_ROW],  # type: ignore[valid-type]
        "snapshots": list[_SNAPSHOT],  # type: ignore[valid-type]
        "seconds": dict[str, float],
        "calls": dict[str, int],
    }
)


def wrong_number(text: bytes, meta: Mapping[str, Any]) -> str:
    """Name the first number that is missing, has the wrong type or contradicts the others; empty for a sound state.

    Args:
        text: JSON of the numbers
        meta: the same numbers, parsed
    """
    try:
        _STATE.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(map(str, first["loc"])) or "meta"
        if first["type"] == "missing":
            return f"{name} is missing"
        if first["type"] == "extra_forbidden":
            return f"{name} is unknown"
        return f"{name} = {show(first['input'])} is not legal"
    at, press, rows = meta["position"], meta["press"], meta["rows"]
    legs = [len(list(group)) for _, group in groupby(row["branch"] for row in rows)]
    begun = at["start"] is not None
    fits = {
        "rows": [row["step"] for row in rows] == list(range(1, len(rows) + 1)),
        "press.counts.steps": press["counts"]["steps"] == len(rows),
        "press.delta": press["delta"] == (rows[-1]["delta_star"] if rows else 0.0),
        "position.leg": 0 <= at["leg"] == len(legs) - begun,
        "position.target": at["target"] >= 0,
        "position.step": not begun or (at["step"] > 0.0 and at["planned"] > 0.0),
        "snapshots": all(1 <= snapshot["step"] <= len(rows) for snapshot in meta["snapshots"]),
    }
    if begun and rows and rows[-1]["branch"] != "unload":
        fits["position.target"] &= at["target"] <= legs[-1] + 1  # one more than the steps of the leg at most
    return next((f"{name} contradicts the other numbers" for name, well in fits.items() if not well), "")


def wrong_array(arrays: Mapping[str, Share], fresh: Mapping[str, Share], nodes: int, cells: int) -> str:
    """Name the first array that is missing, or has a wrong type, shape or value; empty for a sound state; collective.

    Args:
        arrays: saved arrays; "NAME.at" holds the numbers of the nodes, cells or facets of the rows of NAME
        fresh: arrays that a run would save before its first step; rows in these must be among the saved ones
        nodes, cells: of the mesh
    """
    for name in sorted(arrays.keys() ^ fresh.keys()):
        return f"{name} is {'missing' if name in fresh else 'unknown'}"
    for name, there in fresh.items():
        here, shape = arrays[name], there.shape
        if name.endswith(".at"):
            shape = (here.total,)
        elif f"{name}.at" in fresh:
            shape = (arrays[f"{name}.at"].total, *shape[1:])
        if (here.values.dtype, here.shape) != (there.values.dtype, shape):
            return f"{name} is {here.values.dtype} {here.shape} instead of {there.values.dtype} {shape}"
        if not _everywhere(here, bool(np.all(np.isfinite(here.values)))):
            return f"{name} is not finite"
        if not name.endswith(".at"):
            continue
        rising = _rising(here, nodes if name.startswith(("touched_at", "held")) else cells)
        same = here.total == there.total and np.array_equal(here.values, there.values)
        if not _everywhere(here, same if there.total else rising):
            return f"{name} are other numbers than those of the mesh"
    return ""


def _rising(array: Share, count: int) -> bool:
    """Whether the numbers of this rank ascend from the last one of the ranks before, and stay below `count`."""
    greatest = array.comm.allgather(int(array.values.max(initial=-1)))
    before = max(greatest[: array.comm.rank], default=-1)
    return bool(np.all(np.diff(array.values, prepend=before, append=count) > 0))


def _everywhere(array: Share, here: bool) -> bool:
    from mpi4py import MPI

    return bool(array.comm.allreduce(here, MPI.LAND))
