"""Files are complete or absent: if a process is killed while it writes a file, the old content remains."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest
from conftest import call
from made_up_run import write_run

from asperity.plot import plot_run
from asperity.plot.report import write_report
from asperity.runtime.files import files_into, is_aside, read_npz, remove_asides, replacing
from asperity.surface.measured import HeightField
from asperity.vibration import Dynamics, PowerLaw, run_dynamics


class Killed(BaseException):
    """Represents SIGKILL: the package does not handle it."""


@cache
def vibration() -> Dynamics:
    return run_dynamics(PowerLaw(1.5, 1.0), preload=1e-3, zeta=0.05, model=("exact",), omega=(0.9, 1.1))


def dynamics(folder: Path) -> None:
    vibration().write(folder)


def patch(folder: Path) -> None:
    HeightField(np.arange(64.0).reshape(8, 8), 1.0, 1.0).save(folder / "patch.npz")


WRITERS: dict[Callable[[Path], None], set[str]] = {
    dynamics: {"free.csv", "response.csv", "thresholds.json"},
    patch: {"patch.npz"},
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
    for victim, write in (("figures/curve.svg", plot_run), ("report.html", write_report)):
        with pytest.MonkeyPatch.context() as monkeypatch, pytest.raises(Killed):
            monkeypatch.setattr(Path, "replace", killer(Path(victim).name))
            write(folder)
        assert not (folder / victim).exists()
        write(folder)
    assert (folder / "figures/curve.svg").read_bytes().rstrip().endswith(b"</svg>")


def test_two_processes_of_one_number_write_at_once(tmp_path: Path) -> None:
    """As in two sandboxes, where the numbers of processes repeat."""
    out = tmp_path / "out"
    with files_into(out) as first, files_into(out) as second, replacing(second / "text") as one:
        one.write(b"long")
        with replacing(second / "text") as other:
            other.write(b"a")
        (first / "number").write_text("1")
    assert {path.name: path.read_text() for path in out.iterdir()} == {"text": "long", "number": "1"}


@pytest.mark.parametrize("several", [False, True])
def test_content_is_on_the_disk_before_the_name_and_the_name_before_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, several: bool
) -> None:
    """Else a file may be empty after a power cut, or an old one come back."""
    events: list[tuple[str, int]] = []
    rename = Path.replace

    def sync(descriptor: int) -> None:
        events.append(("sync", os.fstat(descriptor).st_ino))

    def replace(path: Path, target: Path) -> Path:
        events.append(("rename", path.stat().st_ino))
        return rename(path, target)

    monkeypatch.setattr("os.fsync", sync)
    monkeypatch.setattr(Path, "replace", replace)
    out = tmp_path / "out"
    out.mkdir()
    names = ["a", "b"] if several else ["a"]
    if several:
        with files_into(out) as aside:
            for name in names:
                (aside / name).write_text(name)
    else:
        with replacing(out / "a") as file:
            file.write(b"a")
    for name in names:
        inode = (out / name).stat().st_ino
        assert events.index(("sync", inode)) < events.index(("rename", inode))
    assert events[-1] == ("sync", out.stat().st_ino)


def test_files_that_grow_when_they_are_read_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Arrays that unpack to gigabytes, a device without end, a sparse file, keys that take a time of their square."""
    with ZipFile(tmp_path / "bomb.npz", "w", ZIP_DEFLATED) as archive, archive.open("z.npy", "w") as member:
        np.lib.format.write_array_header_1_0(member, {"descr": "<f8", "fortran_order": False, "shape": (6000, 6000)})
        for _ in range(6000):
            member.write(bytes(8 * 6000))
    with (tmp_path / "sparse.npy").open("wb") as file:
        file.truncate(10**11)
    (tmp_path / "parts.toml").write_text("a" + ".a" * 20_000 + " = 1\n")
    (tmp_path / "inline.toml").write_text("x = [{ a" + ".a" * 20_000 + " = 1}]\n")
    start = time.process_time()
    for words in (
        "import-map bomb.npz", "init new.toml --from bomb.npz", "import-map sparse.npy --pixel 1e-6",
        "check parts.toml", "check inline.toml", "check /dev/zero", "run /dev/zero",
        "compare /dev/zero /dev/full", "dynamics /dev/zero", "import-map /dev/zero", "check bomb.npz",
    ):  # fmt: skip
        command, *rest = words.split()
        assert call(command, *(tmp_path / word if (tmp_path / word).exists() else word for word in rest)) == 2
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) == 1 and lines[0].startswith("error: "), lines
    assert time.process_time() - start < 12.0
    assert not (tmp_path / "new.toml").exists()
    # a map of one height is packed as much, but it is small
    np.savez_compressed(tmp_path / "flat.npz", z=np.ones((1000, 1000)))
    assert read_npz(tmp_path / "flat.npz")["z"].shape == (1000, 1000)
