"""The programs: where they are, what they compute, how one run of each is started and read."""

from __future__ import annotations

import gzip
import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import calculix
import numpy as np
import scene
from unpacked import PEERS, inside

HERE = Path(__file__).parent
LIMIT = 900.0  # CPU seconds after which a run is ended


@dataclass(frozen=True)
class Run:
    """Result of a run.

    Attributes:
        program, mesh: which one
        dofs: displacement components, boundary conditions included
        cpu: seconds of the process, user and system, start-up included
        memory: its greatest resident memory [bytes]
        force: after each load step done [E L^2]
        ended: "done", "limit" (of CPU time), or "failed" with the exit code
        bar: greatest relative error bar of the force, of asperity with a tolerance
    """

    program: str
    mesh: str
    dofs: int
    cpu: float
    memory: int
    force: list[float]
    ended: str
    bar: float | None = None


@dataclass(frozen=True)
class Usage:
    """CPU seconds of a process, user and system, its memory [bytes], how it ended (see Run)."""

    cpu: float
    memory: int
    ended: str


def timed(command: list[str], environment: dict[str, str], place: Path, limit: float) -> Usage:
    """Run a command in a folder, with its output in the file `log` there."""
    # bytecode is kept, as it is for users
    variables = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": ""} | environment

    def limited() -> None:
        seconds = int(np.ceil(limit))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 10))

    with (place / "log").open("w", encoding="utf-8") as log:
        child = subprocess.Popen(command, cwd=place, env=variables, stdout=log, stderr=log, preexec_fn=limited)
        _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    ended = "done" if child.returncode == 0 else f"failed ({child.returncode})"
    if child.returncode == -signal.SIGXCPU:
        ended = "limit"
    return Usage(used.ru_utime + used.ru_stime, used.ru_maxrss * 1024, ended)


@dataclass(frozen=True)
class Start:
    """A prepared run: command line, environment, and how to read dofs, forces and perhaps the bar in the end."""

    command: list[str]
    environment: dict[str, str]
    read: Callable[[], dict[str, Any]]


@dataclass(frozen=True)
class Job:
    """One run to make; `prepare` writes the input to a folder, and is not part of its time."""

    program: str
    material: str
    mesh: str
    prepare: Callable[[Path], Start]

    def run(self, folder: Path) -> Run:
        """Run it in a process of its own, or read what an earlier call kept."""
        place = folder / "-".join([self.program, self.material, self.mesh]).replace(" ", "_")
        kept = place / "run.json"
        if kept.exists():
            return Run(**json.loads(kept.read_text(encoding="utf-8")))
        place.mkdir(parents=True, exist_ok=True)
        start = self.prepare(place)
        used = timed(start.command, start.environment, place, LIMIT)
        found: dict[str, Any] = {"dofs": 0, "force": []} | start.read()
        ended = "done" if len(found["force"]) == scene.STEPS else used.ended
        run = Run(self.program, self.mesh, cpu=used.cpu, memory=used.memory, ended=ended, **found)
        kept.write_text(json.dumps(asdict(run), indent=1) + "\n", encoding="utf-8")
        return run


def read_json(path: Path) -> Callable[[], dict[str, Any]]:
    """Read dofs and forces from a file; nothing where there is none."""
    return lambda: json.loads(path.read_text(encoding="ascii")) if path.exists() else {}


def asperity(material: str, by: str, value: float, steps: int = scene.STEPS) -> Job:
    """The default mesh of a size, or the tolerance."""

    def prepare(place: Path) -> Start:
        out = place / "out.json"
        command = [sys.executable, str(HERE / "scene.py"), material, by, str(value), str(steps), str(out)]
        return Start(command, {}, read_json(out))

    name = "asperity" if by == "size" else "asperity, by tolerance"
    return Job(name, material, f"{by} {value:g}{_in_steps(steps)}", prepare)


def _in_steps(steps: int) -> str:
    """Addition to the name of a mesh where the load steps are not those of the scene."""
    return "" if steps == scene.STEPS else f", {steps} steps"


def calculix_grid(material: str, n: int, steps: int = scene.STEPS) -> Job:
    """n x n columns of bricks."""
    return calculix_deck(
        "CalculiX", material, f"{n} x {n} hex{_in_steps(steps)}", lambda at: calculix.write_grid(at, material, n, steps)
    )


def calculix_own(material: str, h: float, steps: int = scene.STEPS) -> Job:
    """The mesh that asperity makes for elements of size h in the contact."""
    return calculix_deck(
        "CalculiX, mesh of asperity", material, f"C3D10, size {h:g}{_in_steps(steps)}",
        lambda at: calculix.write_own(at, scene.surface(), scene.MATERIALS[material], scene.DELTA, steps, h),
    )  # fmt: skip


def calculix_deck(program: str, material: str, mesh: str, write: Callable[[Path], int]) -> Job:
    """CalculiX with the deck that `write` makes, which returns its dofs."""

    def prepare(place: Path) -> Start:
        dofs = write(place / "model.inp")
        command, environment = inside("bookworm", "usr/bin/ccx")
        return Start(
            [*command, "model"], environment, lambda: {"dofs": dofs, "force": calculix.read(place / "model.dat")}
        )

    return Job(program, material, mesh, prepare)


def tamaas(n: int, exact: tuple[float, float]) -> Job:
    """n x n points, mirrored to 2 n x 2 n; forces are sought between half the least and twice the greatest one."""

    def prepare(place: Path) -> Start:
        top = scene.surface()
        t = (np.arange(n) + 0.5) / n
        heights = top.height(*np.meshgrid(t, t, indexing="ij")) - top.mean()
        np.savez(
            place / "mesh.npz", heights=heights, summit=top.maximum()[2] - top.mean(), E=scene.E, nu=scene.NU,
            path=scene.AT, forces=[0.5 * exact[0], 2.0 * exact[1]],
        )  # fmt: skip
        command, environment = inside("bookworm", "usr/bin/python3.11")
        out = place / "out.json"
        return Start([*command, str(HERE / "tamaas_model.py"), "mesh.npz", "out.json"], environment, read_json(out))

    return Job("Tamaas (half-space)", "elastic", f"{n} x {n} points", prepare)


def versions() -> str:
    """Versions of the other programs, as packaged; FileNotFoundError where CalculiX is missing."""
    document = PEERS / "bookworm/usr/share/doc/calculix-ccx/changelog.Debian.gz"
    with gzip.open(document, "rt", encoding="utf-8") as lines:
        calculix = f"CalculiX {lines.readline().partition('(')[2].partition(')')[0]}"
    tamaas = (f"Tamaas {wheel.stem.partition('-')[2]}" for wheel in PEERS.glob("pypi/tamaas-*.dist-info"))
    return ", ".join([calculix, *tamaas])


def cpu_name() -> str:
    """Name of the processor."""
    text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    return text.partition("model name")[2].partition(":")[2].partition("\n")[0].strip()
