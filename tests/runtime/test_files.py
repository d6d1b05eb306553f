"""Files are complete or absent: if a process is killed while it writes a file, the old content remains."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_run import write_run

from asperity.dynamics import Dynamics, PowerLaw, run_dynamics
from asperity.model.two_bodies import SumSurface
from asperity.plot import plot_run
from asperity.plot.report import write_report
from asperity.runtime.files import files_into, is_aside, read_npz, remove_asides, replacing
from asperity.study import Study
from asperity.study.results import write_table
from asperity.surface import Surface
from asperity.surface.measured import HeightField


class Killed(BaseException):
    """Represents SIGKILL: the package does not handle it."""


@cache
def vibration() -> Dynamics:
    return run_dynamics(PowerLaw(1.5, 1.0), preload=1e-3, zeta=0.05, model=("exact",), omega=(0.9, 1.1), sweeps=False)


def dynamics(folder: Path) -> None:
    vibration().write(folder)


def study(folder: Path) -> None:
    base = {"surface": {"kind": "flat", "L": 1.0}, "material": {"E": 1.0, "nu": 0.3}, "loading": {"delta_max": 0.02}}
    table = {"base": {**base, "units": "other"}, "grid": {"block.height": [1.0]}}
    write_table(Study.from_dict(table), folder)


def patch(folder: Path) -> None:
    HeightField(np.arange(64.0).reshape(8, 8), 1.0, 1.0).save(folder / "patch.npz")


def sum_of_two(folder: Path) -> None:
    plane = Surface.from_spec(kind="flat", L=1.0)
    SumSurface.of(plane, plane).save(folder / "sum.npz", 5)


WRITERS: dict[Callable[[Path], None], set[str]] = {
    dynamics: {"free.csv", "response.csv", "thresholds.json"},
    study: {"results.csv"},
    patch: {"patch.npz"},
    sum_of_two: {"sum.npz"},
}


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_a_file_is_whole_or_absent(tmp_path: Path, write: Callable[[Path], None]) -> None:
    """A process is killed before it moves the new file into place: each file in turn, with an old file and without."""
    out = tmp_path / "out"
    out.mkdir()
    write(out)
    names = {path.name for path in out.iterdir()}
    assert names >= WRITERS[write]
    whole = {name: (out / name).stat().st_size for name in names}
    for number, victim in enumerate([*sorted(WRITERS[write]), min(WRITERS[write])]):
        old = b"old" if number < len(WRITERS[write]) else None  # none for the last one
        for name in names:
            (out / name).unlink(missing_ok=True)
            if old is not None:
                (out / name).write_bytes(old)
        with pytest.MonkeyPatch.context() as monkeypatch, pytest.raises(Killed):
            monkeypatch.setattr(Path, "replace", killer(victim))
            write(out)
        assert (out / victim).exists() == (old is not None)
        assert old is None or (out / victim).read_bytes() == old
        for path in out.iterdir():
            assert is_aside(path.name) or path.read_bytes() == old or path.stat().st_size == whole[path.name]
        remove_asides(out)


def killer(victim: str) -> Callable[[Path, Path], Path]:
    """`Path.replace` of a process that is killed in the call."""
    rename = Path.replace

    def replace(path: Path, target: Path) -> Path:
        if Path(target).name == victim:
            raise Killed
        return rename(path, target)

    return replace


def test_a_report_and_its_pictures_are_whole_or_absent(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")

    def write() -> None:
        plot_run(folder, names=["curve"])
        write_report(folder)

    for victim in ("figures/curve.png", "figures/curve.svg", "report.html"):
        with pytest.MonkeyPatch.context() as monkeypatch, pytest.raises(Killed):
            monkeypatch.setattr(Path, "replace", killer(Path(victim).name))
            write()
        assert not (folder / victim).exists()
    write()
    assert (folder / "figures/curve.png").read_bytes()[-8:-4] == b"IEND"


def test_two_processes_of_one_number_write_at_once(tmp_path: Path) -> None:
    """As in two sandboxes, where the numbers of processes repeat."""
    out = tmp_path / "out"
    with files_into(out) as first, files_into(out) as second, replacing(second / "text") as one:
        one.write(b"long")
        with replacing(second / "text") as other:
            other.write(b"a")
        (first / "number").write_text("1")
    assert {path.name: path.read_text() for path in out.iterdir()} == {"text": "long", "number": "1"}


def test_a_saved_patch_reads_back(tmp_path: Path) -> None:
    z = np.random.default_rng(1).normal(size=(9, 9))
    path = HeightField(z, 0.125, 0.125).save(tmp_path / "patch")
    stored: dict[str, Any] = read_npz(path)
    assert path.name == "patch.npz" and float(stored["L"]) == 1.0
    np.testing.assert_array_equal(stored["z"], z)
