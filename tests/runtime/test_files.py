"""Files are complete or absent: if a process is killed while it writes a file, the old content remains."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest
from conftest import call
from made_up_run import write_run

from asperity.output.results import Results
from asperity.plot import draw
from asperity.plot.report import write_report
from asperity.runtime.files import files_into, is_aside, read_npz, remove_asides, replacing
from asperity.surface.scans import HeightField
from asperity.vibration import PowerLaw, run_dynamics


class Killed(BaseException):
    """Represents SIGKILL: the package does not handle it."""


def dynamics(folder: Path) -> None:
    law = PowerLaw(1.5, 1.0)
    run_dynamics(law, preload=1e-3, zeta=0.05, model=("exact",), omega=(0.9, 1.1)).write(folder)


def patch(folder: Path) -> None:
    HeightField(np.arange(64.0).reshape(8, 8), 1.0, 1.0).save(folder / "patch.npz")


def figures(folder: Path) -> None:
    draw(Results.read(write_run(folder)), "curve")


@pytest.mark.parametrize(
    ("write", "names"),
    [
        (dynamics, ("free.csv", "response.csv", "thresholds.json")), (patch, ("patch.npz",)),
        (figures, ("figures/curve.svg",)), (lambda folder: write_report(write_run(folder)), ("report.html",)),
    ],
)  # fmt: skip
def test_a_file_is_whole_or_as_it_was(tmp_path: Path, write: Callable[[Path], object], names: tuple[str, ...]) -> None:
    """A process is killed before it moves the new file into place: each file in turn."""
    rename = Path.replace
    for number, name in enumerate(names):
        out = tmp_path / f"{number}"
        (out / name).parent.mkdir(parents=True)
        (out / name).write_bytes(b"old")

        def replace(path: Path, target: Path, name: str = name) -> Path:
            if target.name == Path(name).name:
                raise Killed
            return rename(path, target)

        with pytest.MonkeyPatch.context() as monkeypatch, pytest.raises(Killed):
            monkeypatch.setattr(Path, "replace", replace)
            write(out)
        assert (out / name).read_bytes() == b"old"
        remove_asides((out / name).parent)
        write(out)
        assert (out / name).stat().st_size > 3 and not [p for p in (out / name).parent.iterdir() if is_aside(p.name)]


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
