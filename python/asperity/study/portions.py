# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Which cases of a study a job and its groups of ranks take: parts, and portions with one mesh."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from asperity.errors import InputError
from asperity.study.definition import Entry
from asperity.study.shared_mesh import mesh_key

PORTIONS = 4  # portions per group, approximately: with fewer, groups become idle; with more, meshes are built twice


def part(entries: Sequence[Entry], number: int, parts: int) -> list[int]:
    """Case numbers of a part of a study; all parts together are the study.

    Cases with the same mesh are next to each other, so that few parts build the same mesh. The parts differ by one case
    at most, and depend on the study only, not on what is finished.

    Args:
        entries: of the study
        number: of the part, from 1
        parts: number of all parts; those beyond the number of cases are empty

    Raises:
        InputError: there is no part of that number

    Examples:
        >>> from asperity.study.portions import part
        >>> part([], 1, 2)
        []
    """
    if not 1 <= number <= parts:
        raise InputError(
            f"--only {number}/{parts} is no part: the first is 1/{max(parts, 1)}, the last {parts}/{parts}"
        )
    ordered = [i for batch in _by_mesh(entries, range(len(entries))) for i in batch]
    first, last = ((n * len(ordered)) // parts for n in (number - 1, number))
    return ordered[first:last]


def portions(entries: Sequence[Entry], todo: Sequence[int], groups: int) -> list[list[int]]:
    """Divide case numbers into portions with one mesh each, small enough to keep all groups busy to the end."""
    size = max(1, -(-len(todo) // (PORTIONS * groups))) if groups > 1 else len(todo)
    return [batch[i : i + size] for batch in _by_mesh(entries, todo) for i in range(0, len(batch), size)]


def _by_mesh(entries: Sequence[Entry], numbers: Iterable[int]) -> list[list[int]]:
    """Case numbers in groups with the same mesh."""
    batches: dict[str, list[int]] = {}
    for i in numbers:
        batches.setdefault(mesh_key(entries[i].case), []).append(i)
    return list(batches.values())
