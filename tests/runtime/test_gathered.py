"""Rows gathered on rank 0, whoever gives them, are the array that NumPy assembles; and those handed out again."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asperity.errors import OutputError
from asperity.quasistatic.checkpoint import read_rows, write_arrays
from asperity.runtime.files import read_npz
from asperity.runtime.parallel import gather, hand_out


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


@pytest.mark.mpi
@pytest.mark.parametrize("total", [0, 1, 2, 3, 64, 1001])
def test_rows_of_any_rank_are_gathered_and_handed_out(total: int) -> None:
    """Also fewer rows than ranks, and none; numbers that nobody gave are filled."""
    comm = world()
    numbers = 7 * given_here(total, 1, comm) + 3
    found = gather(comm, numbers, rows_of(numbers))
    assert (found is None) == (comm.rank > 0)
    if found is not None:
        np.testing.assert_array_equal(found[0], 7 * np.arange(total) + 3)
        np.testing.assert_array_equal(found[1], rows_of(7 * np.arange(total) + 3))
    wanted = np.random.default_rng(comm.rank).integers(10 * total + 1, size=5 * total * comm.rank + total)
    there = ((wanted % 7 == 3) & (wanted < 7 * total))[:, None, None]
    np.testing.assert_array_equal(hand_out(comm, found, wanted, -1.0), np.where(there, rows_of(wanted), -1.0))


@pytest.mark.mpi
def test_a_file_that_cannot_be_written_is_an_error_on_every_rank(
    shared_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After some of it was: no rank waits, the old file is there, and nothing else."""
    comm = world()
    numbers = np.arange(comm.rank, 50, comm.size)

    def fields() -> Iterator[Any]:
        for name in "abc":
            yield name, numbers, rows_of(numbers)

    write_arrays(comm, shared_path / "state.npz", fields())
    content = (shared_path / "state.npz").read_bytes()
    left = iter(range(2))

    def full(file: Any, data: Any) -> int:
        if next(left, None) is None:
            raise OSError(28, "No space left on device")
        return len(data)

    with monkeypatch.context() as patch:
        patch.setattr("zipfile._ZipWriteFile.write", full)
        with pytest.raises(OutputError, match=r"cannot write .*state\.npz: No space left on device"):
            write_arrays(comm, shared_path / "state.npz", fields(), "{}")
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
            write_arrays(group, path, iter([("few", few, rows_of(few)), ("many", many, rows_of(many))]), "text")
        comm.Barrier()
        for readers in range(1, most + 1):
            group = comm.Split(comm.rank < readers)
            if comm.rank < readers:
                arrays = read_npz(path) if group.rank == 0 else {}
                np.testing.assert_array_equal(read_rows(group, arrays, "few", np.array([1, 0])), rows_of([1, 0]))
                wanted = np.arange(group.rank, 125, 2)
                expected = np.where((wanted % 2 == 0) & (wanted < 122), rows_of(wanted).T, 0.0).T
                np.testing.assert_array_equal(read_rows(group, arrays, "many", wanted), expected)
    one, *others = (path.read_bytes() for path in sorted(folder.iterdir()))
    assert set(read_npz(folder / "1.npz")) == {"few", "many", "many.at", "meta"}
    assert len(others) == most - 1 and all(other == one for other in others)


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="there is no mpirun")
def test_one_to_four_ranks_write_the_same_file_and_read_those_of_the_others(tmp_path: Path) -> None:
    from conftest import MPIRUN  # the ranks, which import this module, do not find it

    code = f"from test_gathered import *; write_and_read_on(Path({str(tmp_path)!r}), 4)"
    command = (*MPIRUN, "4", sys.executable, "-c", code)
    done = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
