"""Checkpoints: what continues from one is what never stopped; what cannot be continued from is refused."""

from __future__ import annotations

import dataclasses
import io
import json
import shutil
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ELASTIC, PLASTIC, files, here, stored_fields, world

from asperity.adaptive.solve_contact import solve_contact
from asperity.case import Case
from asperity.case.case_file import identity, refuse_another
from asperity.contact import Coulomb
from asperity.curve import STIFFNESSES
from asperity.errors import CheckpointError, Interrupted, ResolutionWarning
from asperity.mesh.block import BlockMesh
from asperity.mesh.generate import build_block
from asperity.model.material import Material
from asperity.model.settings import Formulation, MeshSize
from asperity.quasistatic.checkpoint import FORMAT, Checkpoint
from asperity.quasistatic.contact_result import ContactResult, PartialResult
from asperity.runtime import compat
from asperity.runtime.files import remove_asides
from asperity.runtime.run_folder import MESH, STATE
from asperity.surface import Surface

CASE = {
    "surface": {"kind": "flat", "L": 1.0},
    "material": {"E": 1.0, "nu": 0.3},
    "loading": {"delta_max": 0.02},
    "units": "other",
}


def npz_of(arrays: dict[str, Any]) -> bytes:
    """Content of a file of arrays."""
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def stop_after(times: int) -> Callable[[], str]:
    """Polled by `solve_contact` at the beginning of a path and after each step; lets it continue so many times."""
    left = iter(range(times, -1, -1))
    return lambda: "" if next(left) else "the test"


def in_pieces(
    surface: Surface, material: Material, folder: Path, stops: tuple[int, ...], **settings: Any
) -> ContactResult:
    """A run that stops after some of its steps and continues from its checkpoint each time."""
    for steps in stops:
        with pytest.raises(PartialResult, match="stopped by the test") as stopped:
            checkpoint = Checkpoint(folder, {}, world())
            solve_contact(surface, material, stop=stop_after(steps), checkpoint=checkpoint, **settings)
        assert isinstance(stopped.value.__cause__, Interrupted)
    return solve_contact(surface, material, checkpoint=Checkpoint(folder, {}, world()), **settings)


def assert_same(one: ContactResult, two: ContactResult, rtol: float) -> None:
    """Curves, counts and checks agree; to the last bit where one process does the same sums."""
    exact = world().size == 1
    assert len(one.curve) == len(two.curve)
    for name in ("delta", "force", "max_pressure", "area_fraction", "max_plastic_strain"):
        a, b = getattr(one.curve, name), getattr(two.curve, name)
        if exact:
            np.testing.assert_array_equal(a, b)
        np.testing.assert_allclose(a, b, rtol=rtol, atol=rtol * np.abs(a).max())
    if exact:
        assert one.counts == two.counts
        assert one.checks == two.checks
    assert not two.checks.violated


def test_a_resumed_run_warns_of_the_waves_that_its_mesh_misses(tmp_path: Path) -> None:
    """The mesh comes from the checkpoint then, and misses them as before."""
    waves = Surface.from_spec(kind="sinusoid", L=1.0, amplitude=5e-4, wavelength=0.1)
    settings = {"delta_max": 0.002, "steps": 2, "size": MeshSize(0.3, h_max=0.5)}
    with pytest.warns(ResolutionWarning, match="waves shorter") as warned:
        in_pieces(waves, ELASTIC, tmp_path / "checkpoint", (1,), **settings)
    assert sum("waves shorter" in str(warning.message) for warning in warned) == 2


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("material", "formulation", "settings"),
    [
        (
            dataclasses.replace(PLASTIC, hardening=0.5, kinematics="finite"),
            Formulation("nitsche"),
            {"steps": 1, "integrator": "midpoint"},
        ),
        (ELASTIC, Formulation("penalty"), {"unload_steps": 2, "cycles": 2}),
        (
            PLASTIC,
            Formulation(),
            {
                "delta_max": None,
                "force_max": 1e-3,
                "unload_steps": 2,
                "unload_to": 0.8,
                "cycles": 2,
                "stops": (4, 1, 1, 1),
            },
        ),
        (PLASTIC, Formulation(friction=0.3), {"steps": 1, "integrator": "midpoint", "unload_steps": 1}),
    ],
)
def test_a_run_in_pieces_gives_the_same_curve(
    wave: Surface,
    coarse_wave: BlockMesh | None,
    shared_path: Path,
    material: Material,
    formulation: Formulation,
    settings: dict[str, Any],
) -> None:
    settings = {
        "delta_max": 0.02,
        "steps": 2,
        "integrator": "backward-euler",
        "block": coarse_wave,
        "formulation": formulation,
        "snapshots": 2,
        "stiffness": True,
        **settings,
    }
    stops = settings.pop("stops", (1, 0))
    straight = solve_contact(wave, material, **settings)
    pieces = in_pieces(wave, material, shared_path / "checkpoint", stops, **settings)
    # on several ranks, contributions are added in the order of their arrival: then to the tolerance of the equations
    assert_same(straight, pieces, 1e-10 if world().size == 1 else 1e-8)
    same = 1e-10 if world().size == 1 else 1e-4
    for name in (*STIFFNESSES, "conductance", "mean_gap", "spots"):
        np.testing.assert_allclose(getattr(pieces.curve, name), getattr(straight.curve, name), rtol=same, err_msg=name)
    one, two = (stored_fields(r, shared_path / f"{i}.vtkhdf") for i, r in enumerate((straight, pieces)))
    assert [(s.step, s.branch) for s in straight.snapshots] == [(s.step, s.branch) for s in pieces.snapshots]
    if one is not None and two is not None:
        assert len(one["displacement"]) and ("plastic strain" in one) == material.plastic
        for name, atol in (("pressure", 1e-9), ("displacement", 1e-11), ("plastic strain", 1e-11), ("stress", 1e-9)):
            np.testing.assert_allclose(one.get(name, []), two.get(name, []), atol=atol, err_msg=name)


@pytest.mark.mpi
def test_a_column_that_begins_or_ends_inside_a_curve_is_refused(
    wave: Surface, coarse_wave: BlockMesh | None, shared_path: Path
) -> None:
    """Its other cells would be empty without a word; after the last step nothing can end."""
    settings: dict[str, Any] = {"delta_max": 0.02, "steps": 3, "block": coarse_wave}
    first = "k_n_elastic"

    def attempt(place: str, wanted: bool, **more: Any) -> Any:
        asked: dict[str, Any] = {"checkpoint": Checkpoint(shared_path / place, {}, world()), "stiffness": wanted}
        return solve_contact(wave, ELASTIC, **asked, **settings, **more)

    for place, before in (("without", False), ("with", True)):
        with pytest.raises(PartialResult):
            attempt(place, before, stop=stop_after(2))
        with pytest.raises(CheckpointError, match=f"2 steps saved: .* columns conductance, {first}.* would be empty"):
            attempt(place, not before)
        whole = getattr(attempt(place, before).curve, first)
        assert len(whole) == 3 and np.isfinite(whole).all() == before
    with pytest.raises(CheckpointError, match=f"3 steps saved: a part of the columns conductance, {first}"):
        attempt("without", True)
    assert len(attempt("with", False).curve) == 3


@pytest.mark.mpi
@pytest.mark.usefixtures("several_ranks")
@pytest.mark.parametrize("formulation", [Formulation("nitsche"), Formulation(friction=0.3)])
def test_a_run_goes_on_on_another_number_of_ranks(
    wave: Surface, coarse_wave: BlockMesh | None, shared_path: Path, formulation: Formulation
) -> None:
    settings: dict[str, Any] = {
        "delta_max": 0.02,
        "steps": 2,
        "integrator": "backward-euler",
        "unload_steps": 1,
        "formulation": formulation,
        "block": coarse_wave,
    }
    straight = solve_contact(wave, PLASTIC, **settings)
    if world().rank == 0:
        alone = here()
        with pytest.raises(PartialResult):
            checkpoint = Checkpoint(shared_path, {}, alone)
            solve_contact(wave, PLASTIC, stop=stop_after(1), checkpoint=checkpoint, comm=alone, **settings)
    world().Barrier()
    together = solve_contact(wave, PLASTIC, checkpoint=Checkpoint(shared_path, {}, world()), **settings)
    assert_same(straight, together, 1e-8)


@pytest.mark.mpi
@pytest.mark.usefixtures("several_ranks")
def test_nodes_on_joined_sides_stick_on_another_number_of_ranks(shared_path: Path) -> None:
    """They have a number on each side, and another rank may know them by another one."""
    settings: dict[str, Any] = {"delta_max": 0.01, "steps": 1, "sides": "periodic", "size": MeshSize(0.2, h_max=0.2)}
    settings["formulation"] = Formulation(friction=0.3)
    flat = Surface.from_spec("flat", L=1.0)
    compat.start()  # PETSc starts on all ranks at once

    def stuck(ranks: Any) -> int:
        result = solve_contact(flat, ELASTIC, checkpoint=Checkpoint(shared_path, {}, ranks), comm=ranks, **settings)
        contact = result.solver.contact
        assert isinstance(contact, Coulomb)
        return int(ranks.allreduce(np.isfinite(contact.held[:, 0]).sum()))

    alone = world().bcast(stuck(here()) if world().rank == 0 else None)
    assert stuck(world()) == alone > 20  # the path is at its end: these are the nodes restored


SAVED = identity(Case.from_dict(CASE))


@pytest.fixture(scope="module")
def first(wave: Surface, coarse_wave: BlockMesh | None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a checkpoint in the middle of an unloading, with every kind of array."""
    folder = tmp_path_factory.mktemp("saved")
    settings: dict[str, Any] = {"steps": 2, "unload_steps": 2, "formulation": Formulation("nitsche"), "snapshots": 2}
    with pytest.raises(PartialResult):
        checkpoint = Checkpoint(folder, SAVED, world())
        stop = stop_after(3)
        solve_contact(wave, PLASTIC, delta_max=0.02, block=coarse_wave, checkpoint=checkpoint, stop=stop, **settings)
    return folder


@pytest.fixture
def saved(first: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(first, tmp_path / "checkpoint"))


def flip(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


def without(name: str) -> Callable[[bytes], bytes]:
    """A state that lacks an array."""
    return lambda data: npz_of({k: v for k, v in np.load(io.BytesIO(data)).items() if k != name})


def other_mesh(data: bytes) -> bytes:
    return npz_of(build_block(Surface.from_spec("flat", L=1.0), 1.0, lambda x, y, depth: 1.0).arrays())


def of_format(number: int) -> Callable[[bytes], bytes]:
    """A state written by another version."""

    def change(data: bytes) -> bytes:
        arrays = dict(np.load(io.BytesIO(data)))
        meta = json.loads(arrays["meta"].tobytes()) | {"format": number, "version": "9.1"}
        return npz_of(arrays | {"meta": np.frombuffer(json.dumps(meta).encode(), dtype=np.uint8)})

    return change


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        (STATE, lambda data: data[: len(data) // 2], STATE),
        (STATE, flip, STATE),
        (STATE, lambda data: b"\x80\x04\x95not a checkpoint", STATE),
        (STATE, lambda data: npz_of({"u": np.zeros(3)}), STATE),
        (STATE, lambda data: npz_of({"meta": np.frombuffer(b"[1]", dtype=np.uint8)}), STATE),
        (STATE, without("displacement"), "does not belong to the state"),
        (STATE, without("previous"), "does not belong to the state"),
        (STATE, of_format(FORMAT - 1), r"written by asperity 9\.1"),
        (STATE, of_format(FORMAT + 1), r"written by asperity 9\.1"),
        (MESH, flip, MESH),
        (MESH, other_mesh, f"{MESH} does not belong to the state"),
    ],
)
def test_a_damaged_or_foreign_checkpoint_is_refused_and_left_alone(
    saved: Path, name: str, change: Callable[[bytes], bytes], message: str
) -> None:
    (saved / name).write_bytes(change((saved / name).read_bytes()))
    before = files(saved)
    with pytest.raises(CheckpointError, match=message):
        Checkpoint(saved, SAVED, world()).load()
    assert files(saved) == before


@pytest.mark.parametrize(
    ("section", "change", "free"),
    [
        ("output", {"figures": True}, True),
        ("solver", {"linear": "lu"}, True),
        ("solver", {"rtol": 1e-10}, False),
        ("solver", {"newton_max": 5}, False),
        ("dynamics", {"zeta": 0.1}, True),
        ("accuracy", {"max_dofs": 5000}, True),
        ("loading", {"delta_max": 0.02, "steps": 11}, False),
        ("loading", {"delta_max": 0.021}, False),
        ("contact", {"method": "penalty"}, False),
        ("mesh", {"growth": 0.5}, False),
        ("block", {"sides": "free"}, False),
    ],
)
def test_what_may_change_before_a_continuation(section: str, change: Any, free: bool) -> None:
    one = identity(Case.from_dict(CASE))
    two = identity(Case.from_dict({**CASE, section: change}))
    with nullcontext() if free else pytest.raises(CheckpointError, match="belongs to another case"):
        refuse_another(Path("state.npz"), one, two)


def test_clear_removes_only_checkpoints(saved: Path) -> None:
    (saved / "notes.npz").write_text("mine")
    for name in ("level-1", "level-2"):
        (saved / name).mkdir()
        (saved / name / STATE).write_text("old")
        (saved / name / f".{STATE}.12.asperity").write_text("half")
    (saved / "level-2" / "notes").write_text("mine")
    Checkpoint(saved, {}, world()).clear()
    left = sorted(str(path.relative_to(saved)) for path in saved.rglob("*"))
    assert left == ["level-2", "level-2/notes", "notes.npz"]


def test_what_a_killed_process_left_is_removed(tmp_path: Path) -> None:
    """And nothing else: a hidden file with a number at its end is somebody's."""
    theirs = ["state.npz", ".hidden", ".x.y", ".note.2024", ".git.2024.asperity.txt"]
    for name in (".state.npz.123.asperity", ".curve.csv.7.asperity", *theirs):
        (tmp_path / name).write_text("")
    (tmp_path / ".fields.55.asperity").mkdir()
    remove_asides(tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == set(theirs)
