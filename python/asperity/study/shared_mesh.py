"""Meshes that cases of a study have in common."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from asperity.errors import AsperityError
from asperity.runtime.parallel import on_root

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.case import Case
    from asperity.study.definition import Entry

MESHES = "meshes"  # folder of the meshes that cases share


def shares_mesh(case: Case) -> bool:
    """Whether the mesh of a case depends only on its surface, block, element sizes and greatest approach."""
    return case.accuracy.tolerance is None and case.mesh.file is None and case.loading.delta_max is not None


def mesh_key(case: Case) -> str:
    """Name of the mesh of a case; cases with the same name can share it."""
    data = case.content()
    parts = [data["surface"], data["block"]["height"], data["mesh"], data["loading"].get("delta_max")]
    if case.block.sides == "periodic":  # opposite sides of its mesh fit
        parts.append(case.block.sides)
    if not shares_mesh(case):
        parts.append(case.hash())
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def meshes_first(entries: Sequence[Entry], numbers: Iterable[int]) -> list[int]:
    """Case numbers, one of each mesh before the others: groups of ranks make the meshes at the same time."""
    first: dict[str, int] = {}
    later = [i for i in numbers if first.setdefault(mesh_key(entries[i].case), i) != i]
    return [*first.values(), *later]


def shared_mesh(case: Case, folder: Path, comm: MPI.Comm) -> Path | AsperityError:
    """File of the mesh of a case, built if missing, or the error of building it; collective."""
    from asperity.quasistatic.make import make_block

    path = (folder / MESHES / f"{mesh_key(case)}.npz").absolute()
    if comm.bcast(path.is_file() if comm.rank == 0 else None):
        return path
    delta = case.loading.delta_max
    assert delta is not None

    def save() -> None:
        assert block is not None
        path.parent.mkdir(parents=True, exist_ok=True)
        block.save(path)

    try:
        block = make_block(comm, case.build_surface(), case.block.height, delta, case.mesh.size, case.block.sides)
        on_root(comm, save)
    except AsperityError as error:
        return error
    return path
