"""The folder of a run: the list of its files, and the rules for starting a run in an existing folder.

A run never overwrites files of other origin, nor follows links in its folder. A folder contains a run if it has a
checkpoint, or a `case.toml` that was generated. One run at a time works in it; plots and reports take no lock.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from asperity.errors import InputError
from asperity.runtime.files import is_aside, parse_toml, read_text

CASE, CURVE, SUMMARY, LOG = "case.toml", "curve.csv", "summary.json", "run.log"
FREE, RESPONSE, MOTION, THRESHOLDS = "free.csv", "response.csv", "motion.csv", "thresholds.json"
SLIP, SLIP_LOOPS = "slip.csv", "slip_loops.csv"
REPORT = "report.html"
FIELDS, FIGURES, CHECKPOINT = "fields", "figures", "checkpoint"  # folders
TOP, VTKHDF = "top.npz", "contact.vtkhdf"  # in fields
PICTURES = (
    "surface", "curve", "indentation", "area", "pressure", "stiffness", "frequency", "response", "receptance", "motion",
    "slip", "conductance", "leakage", "flow", "time",
)  # in figures # fmt: skip
FIELD_PICTURES = ("surface", "pressure", "flow")  # the others consist of lines and are in .svg too
#: Files of `asperity export` in the folder of a run, by program or kind of file.
EXPORTS = {"calculix": "contact_calculix.inp", "abaqus": "contact_abaqus.inp", "csv": "contact.csv"}
LOCK = ".lock"  # of the process that works in the folder
MESH, STATE, SNAPSHOT = "mesh.npz", "state.npz", "snapshot-{}.npz"  # in checkpoint and in the folders in it

#: All files and folders that a run writes, folders after their files; without those of the checkpoint.
PRODUCTS = (
    CURVE, SUMMARY, LOG, SLIP, SLIP_LOOPS, FREE, RESPONSE, MOTION, THRESHOLDS,
    REPORT, f"{FIELDS}/{TOP}", f"{FIELDS}/{VTKHDF}", FIELDS,
    *(f"{FIGURES}/{name}.png" for name in PICTURES),
    *(f"{FIGURES}/{name}.svg" for name in PICTURES if name not in FIELD_PICTURES), FIGURES,
    CASE,
)  # fmt: skip

#: What a run that continues writes again, from its curve and last state.
DERIVED = tuple(name for name in PRODUCTS if name not in (CURVE, SUMMARY, LOG, CASE))


def check(folder: Path, *, resume: bool = False, force: bool = False) -> None:
    """Refuse a folder with files that a new run would overwrite, unless it continues or replaces the run in it.

    A missing or empty folder is always accepted, and so is one in which a process was killed before it had completed
    its first file.

    Raises:
        InputError: the folder is a file, contains files but no run, a link where a run writes, or a run (without
            `resume` or `force`), or another process works in it
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; give a folder to -o")
    if is_empty(folder):
        return
    if not holds_run(folder):
        raise InputError(f"{folder} is not empty and holds no run; give another folder to -o")
    if not (resume or force):
        raise InputError(
            f"{folder} already holds a run; --resume continues it, --force replaces it, -o takes another folder "
            "(resume = True and force = True in Python)"
        )
    with suppress(OSError), working_in(folder):
        pass


def refuse_links(folder: Path) -> None:
    """Refuse (InputError) a folder with a link where a run writes."""
    places = [folder / name for name in (LOCK, LOG, FIELDS, FIGURES, CHECKPOINT)]
    for path in (*places, *(folder / CHECKPOINT).rglob("*")):
        if path.is_symlink():
            raise InputError(f"{path} is a link, which a run does not follow; remove it, or take another folder")


@contextmanager
def working_in(folder: Path) -> Iterator[None]:
    """Make and lock a folder; the system releases it, also where the process is killed. If empty then, it goes.

    Raises:
        InputError: another process works there, or this one already does, or a link is where a run writes
        OSError: the folder cannot be made, or written
    """
    refuse_links(folder)
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    file = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
    try:
        with suppress(OSError):  # a file system without locks
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                free = os.fstat(file).st_nlink > 0  # else a run that was refused has removed it
            except BlockingIOError:
                free = False
            if not free:
                raise InputError(f"another process works in {folder}; wait for its end, or take another folder")
        try:
            yield
        finally:
            if is_empty(folder):
                (folder / LOCK).unlink(missing_ok=True)
                with suppress(OSError):  # it contains temporary files
                    for path in made:
                        path.rmdir()
    finally:
        os.close(file)


def is_empty(folder: Path) -> bool:
    """Whether a folder is missing or contains only temporary files, a lock and a checkpoint folder without files."""
    if not folder.is_dir():
        return True
    left = [p for p in folder.iterdir() if not is_aside(p.name) and p.name != LOCK]
    inside = [p for p in (folder / CHECKPOINT).rglob("*") if not (p.is_dir() or is_aside(p.name))]
    return not inside and all(p.name == CHECKPOINT and p.is_dir() for p in left)


def holds_run(folder: Path) -> bool:
    """Whether a folder contains a run or the beginning of one."""
    import tomli_w

    if any(any((folder / CHECKPOINT).glob(f"**/{name}")) for name in (MESH, STATE, SNAPSHOT.format("*"))):
        return True
    try:
        text = read_text(folder / CASE)
        case = parse_toml(text)
    except (OSError, ValueError, RecursionError):
        return False
    return {"mesh", "solver", "output"} <= case.keys() and tomli_w.dumps(case) == text


def clear(folder: Path, names: Iterable[str] = PRODUCTS) -> None:
    """Remove the files of an earlier run, of PRODUCTS and in its order, and nothing else.

    The new run replaces the checkpoint and case.toml itself: without case.toml, a folder left by a kill would no longer
    count as a run.
    """
    for name in names:
        path = folder / name
        if path.is_dir():
            with suppress(OSError):  # it contains other files
                path.rmdir()
        elif name != CASE:
            path.unlink(missing_ok=True)
