"""Arrays in equal blocks over the ranks: whoever gives the rows, the array is the one that NumPy assembles."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asperity.errors import OutputError
from asperity.quasistatic.checkpoint import read_arrays, scan, write_arrays
from asperity.runtime.distributed_array import (
    DistributedArray,
    look_up,
    look_up_some,
    pieces,
    places,
    share,
    share_some,
)
from asperity.runtime.files import read_npz


def world() -> Any:
    from mpi4py import MPI

    return MPI.COMM_WORLD


def rows_of(numbers: Any) -> Any:
    """A row of numbers for each number."""
    return np.sin(np.multiply.outer(1.0 + np.asarray(numbers), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))


def given_here(total: int, seed: int, comm: Any) -> Any:
    """Numbers of rows that this rank gives: each has one giver at least, many have several, rank 1 has few."""
    random = np.random.default_rng(seed)
    owner = random.integers(comm.size, size=total)
    owner[owner == 1] *= random.random(np.count_nonzero(owner == 1)) < 0.1
    ghosts = np.random.default_rng([seed, comm.rank]).random(total) < 0.2
    return np.random.default_rng([seed, comm.rank, 1]).permutation(np.flatnonzero((owner == comm.rank) | ghosts))


def whole(array: DistributedArray) -> Any:
    return np.concatenate([array.values[:0], *array.comm.allgather(array.values)])


@pytest.mark.mpi
@pytest.mark.parametrize("total", [0, 1, 2, 3, 5, 64, 1001])
def test_rows_of_any_rank_make_the_array(total: int) -> None:
    """Also fewer rows than ranks, and none."""
    comm = world()
    numbers = given_here(total, 1, comm)
    array = share(comm, numbers, rows_of(numbers), total)
    assert array.shape == (total, 2, 3) and len(array.values) <= -(-total // comm.size)
    np.testing.assert_array_equal(array.values, rows_of(array.numbers))
    np.testing.assert_array_equal(whole(array), rows_of(np.arange(total)))
    wanted = np.random.default_rng(comm.rank).integers(max(total, 1), size=3 * total * comm.rank)
    np.testing.assert_array_equal(look_up(array, wanted), rows_of(wanted))
    gathered = list(pieces(array))
    if comm.rank == 0:
        np.testing.assert_array_equal(np.concatenate([array.values[:0], *gathered]), rows_of(np.arange(total)))
        assert all(len(part) <= len(array.values) for part in gathered)
    else:
        assert not gathered


@pytest.mark.mpi
@pytest.mark.parametrize("total", [0, 1, 3, 200])
def test_some_rows_are_kept_with_their_numbers(total: int) -> None:
    comm = world()
    numbers = 7 * given_here(total, 2, comm) + 3
    at, rows = share_some(comm, numbers, rows_of(numbers))
    np.testing.assert_array_equal(whole(at), 7 * np.arange(total) + 3)
    np.testing.assert_array_equal(whole(rows), rows_of(7 * np.arange(total) + 3))
    wanted = np.random.default_rng(comm.rank).permutation(10 * total)[: 5 * total]
    expected = np.where((wanted % 7 == 3)[:, None, None] & (wanted[:, None, None] < 7 * total), rows_of(wanted), -1.0)
    np.testing.assert_array_equal(look_up_some(at, rows, wanted, -1.0), expected)


@pytest.mark.mpi
def test_places_and_rows_that_nobody_gives() -> None:
    """Places are those of the sorted numbers; what is missing is filled."""
    comm = world()
    numbers = np.random.default_rng(comm.rank).integers(10**12, size=50 * comm.rank + 1) // 10**9
    distinct = np.unique(np.concatenate(comm.allgather(numbers)))
    at, count = places(comm, numbers)
    assert count == len(distinct)
    np.testing.assert_array_equal(distinct[at], numbers)
    given = np.unique(np.concatenate(comm.allgather(at[::2])))
    array = share(comm, at[::2], np.ones(len(at[::2]), dtype=np.int64), count, fill=-1)
    np.testing.assert_array_equal(np.flatnonzero(whole(array) == 1), given)


@pytest.mark.mpi
def test_a_file_that_cannot_be_written_is_an_error_on_every_rank(
    shared_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After some of it was: no rank waits, the old file is there, and nothing else."""
    comm = world()
    numbers = np.arange(comm.rank, 50, comm.size)
    arrays = {name: share(comm, numbers, rows_of(numbers), 50) for name in "abc"}
    write_arrays(comm, shared_path / "state.npz", arrays)
    content = (shared_path / "state.npz").read_bytes()
    left = iter(range(2))

    def full(file: Any, data: Any) -> int:
        if next(left, None) is None:
            raise OSError(28, "No space left on device")
        return len(data)

    with monkeypatch.context() as patch:
        patch.setattr("zipfile._ZipWriteFile.write", full)
        with pytest.raises(OutputError, match=r"cannot write .*state\.npz: No space left on device"):
            write_arrays(comm, shared_path / "state.npz", arrays, "{}")
    comm.Barrier()
    assert [path.name for path in shared_path.iterdir()] == ["state.npz"]
    assert (shared_path / "state.npz").read_bytes() == content


def write_and_read_on(folder: Path, most: int) -> None:
    """Files written by each number of ranks are the same, and each number of ranks reads them; in a job of `most`."""
    comm = world()
    for writers in range(1, most + 1):
        path, group = folder / f"{writers}.npz", comm.Split(comm.rank < writers)
        if comm.rank < writers:
            few, many = given_here(2, writers, group), 2 * given_here(61, writers, group)
            arrays = {"few": share(group, few, rows_of(few), 2)}
            arrays["many.at"], arrays["many"] = share_some(group, many, rows_of(many))
            write_arrays(group, path, arrays, "text")
        comm.Barrier()
        for readers in range(1, most + 1):
            group = comm.Split(comm.rank < readers)
            if comm.rank < readers:
                found = read_arrays(group, path, group.bcast(scan(path)[1] if group.rank == 0 else None))
                np.testing.assert_array_equal(whole(found["few"]), rows_of([0, 1]))
                np.testing.assert_array_equal(whole(found["many"]), rows_of(2 * np.arange(61)))
                wanted = np.arange(group.rank, 125, 2)
                expected = np.where((wanted % 2 == 0) & (wanted < 122), rows_of(wanted).T, 0.0).T
                np.testing.assert_array_equal(look_up_some(found["many.at"], found["many"], wanted), expected)
    one, *others = (read_npz(folder / f"{writers}.npz") for writers in range(1, most + 1))
    assert set(one) == {"few", "many", "many.at", "meta"}
    np.testing.assert_array_equal(one["many"], rows_of(2 * np.arange(61)))
    for other in others:
        assert {name: array.tobytes() for name, array in other.items()} == {k: v.tobytes() for k, v in one.items()}


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="there is no mpirun")
def test_one_to_four_ranks_write_the_same_file_and_read_those_of_the_others(tmp_path: Path) -> None:
    from conftest import MPIRUN  # the ranks, which import this module, do not find it

    code = f"from test_distributed_array import *; write_and_read_on(Path({str(tmp_path)!r}), 4)"
    command = (*MPIRUN, "4", sys.executable, "-c", code)
    done = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert len(list(tmp_path.iterdir())) == 4
