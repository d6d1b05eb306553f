"""The command line: exit codes, messages, what is written and what is left alone."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from conftest import CLEAN, MPIRUN, call, files
from made_up_run import write_run

from asperity.cli import COMMANDS
from asperity.errors import ConvergenceError
from asperity.plot import CAPTIONS
from asperity.runtime.progress import ProgressLine

ROOT = Path(__file__).parents[2]
DEMO, TO_TOLERANCE = (str(ROOT / f"cases/{name}.toml") for name in ("single", "elastic"))
Cli = Callable[..., tuple[int, str, str]]
PLANE = """units = "other"
surface = {kind = "flat", L = 1.0}
material = {E = 1.0, nu = 0.3}
mesh = {h_contact = 0.5, h_max = 1.0}
loading = {delta_max = 0.01, steps = 1}
"""


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str]) -> Cli:
    """Call the command line; return exit code, stdout and stderr."""

    def with_output(*arguments: str | Path) -> tuple[int, str, str]:
        code = call(*arguments)
        out, err = capsys.readouterr()
        assert "Traceback" not in err
        return code, out, err

    return with_output


def test_force_removes_what_a_run_wrote_and_leaves_what_others_put_there(cli: Cli, tmp_path: Path) -> None:
    case, out, fresh = tmp_path / "case.toml", write_run(tmp_path / "out"), tmp_path / "new/folder"
    case.write_text(PLANE)
    (out / "checkpoint").mkdir()
    (out / "checkpoint/mesh.npz").write_text("")
    (out / "figures").mkdir()
    theirs = ["figures/thesis.png", "fields/notes.txt", "notes"]
    for name in [*theirs, *(f"figures/{name}.png" for name in CAPTIONS)]:
        (out / name).write_text("")
    (out / "case.toml").write_text(Path(DEMO).read_text())  # edited; the checkpoint shows that there is a run
    for folder, option in ((out, "--force"), (fresh, "--resume")):
        code, shown, _ = cli("run", case, "-o", folder, option, "--set", "loading.steps=3")
        assert code == 0 and "with k = 1.225, n = 1 (misfit of the fit)" in shown
    assert set(files(out)) == {*theirs, *files(fresh)}


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (("run", "none.toml"), "none.toml"),
        (("run", DEMO, "--set", "material.nu=0.7"), "[-0.9, 0.495]"),
        (("run", DEMO, "--set", "loading.delta_max=2e-6"), "exceeds the block"),
        (("check", DEMO, "--set", "surface.D=3.5"), "(2, 3)"),
        (("run",), "CASE.toml"),
        (("run", DEMO, "--resumee"), "--resume"),
        *((("run", DEMO, "--ranks", number), "give auto, or a number from 1") for number in ("0", "two")),
        *(((command, DEMO, "-o", name), "the name is empty") for command in ("run", "check") for name in ("", " ")),
        (("import-map", DEMO, "-o", ""), "the name is empty"),
        (("dynamics", "-o", " "), "the name is empty"),
        (("report", "nowhere"), "nowhere"),
        (("plot", "out"), "there is no command 'plot'"),
        (("report", str(ROOT / "tests")), "curve.csv"),
        (("export", "."), "--to"),
        (("export", ".", "--to", "block.step"), "a file of a mesh (.inp, .msh"),
        (("export", DEMO, "--to", "abaqus"), "needs the folder of a run"),
        (("export", ".", "--to", "b.inp", "--set", "surface.seed=1"), "--set is for a case file"),
        (("export", DEMO, "--to", "b.inp", "--law", "table"), "not for the mesh"),
        (("compare", DEMO, "gone.csv"), "--store writes it"),
        (("compare", DEMO, "kept.csv", "--store"), "no folder of a run"),
        (("check", DEMO, "a\nb\x1b[31m"), "a b?[31m"),
        (("compare", DEMO, str(ROOT / "cases/quick.toml")), "as a curve"),
        (("compare", DEMO, DEMO), "the same curve"),
        (("rn", "case.toml"), "there is no command 'rn' (did you mean \"run\"?)"),
        (("dynamics",), "--power-law"),
        (("dynamics", "--power-law", "1.5", "--set", "dynamics.omega=[1.3, 0.5]"), "low < high"),
        (("dynamics", "--power-law", "1.5", "--set", "joint=3"), "joint = 3 must be a section"),
        (("dynamics", "nowhere.csv"), "nowhere.csv"),
        (("dynamics", "--power-law", "1.5", "--set", "dynamics.forcing=3K"), "'3K' is no number with the unit N"),
        (("dynamics", "--power-law", "1.5", "--set", "dynamics.zetta=1"), 'did you mean "zeta"'),
        (("dynamics", "--power-law", "1.5", "--set", "surface.L=1"), "keys of [dynamics], [joint] and [slip]"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], part: str
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, err = cli(*arguments)
    errors = [line for line in err.splitlines() if not line.startswith("warning: ")]
    assert code == 2 and len(errors) == 1
    assert errors[0].startswith("error: ") and part in errors[0]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", COMMANDS)
def test_help_fits_a_screen(cli: Cli, command: str) -> None:
    """24 lines of 80 columns."""
    code, out, _ = cli(command, "--help")
    lines = out.splitlines()
    assert code == 0 and len(lines) <= 24 and max(map(len, lines)) <= 80


@pytest.mark.parametrize(
    ("failure", "code", "part"),
    [
        (ConvergenceError("no convergence at step 7"), 3, "step 7"),
        (MemoryError(), 3, "memory"),
        (ModuleNotFoundError("no", name="dolfinx"), 4, "dolfinx"),
        (OSError(28, "No space left on device", "curve.csv"), 4, "curve.csv: No space left"),
        (KeyboardInterrupt(), 130, "stopped"),
        (KeyError("of\na file"), 70, "internal error at test_cli.py:"),
        (RecursionError("deep"), 70, "RecursionError: deep; please report it"),
        (ModuleNotFoundError("no", name="asperity.lost"), 70, "ModuleNotFoundError"),
    ],
)
def test_failures_have_their_exit_codes(
    cli: Cli, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, failure: BaseException, code: int, part: str,
) -> None:  # fmt: skip
    def fail(*_: Any, **__: Any) -> None:
        raise failure

    monkeypatch.setattr("asperity.job.run_case.run", fail)
    left, _, err = cli("run", DEMO, "-o", tmp_path / "out")
    assert left == code and part in err.splitlines()[-1]
    assert [line for line in err.splitlines() if line and not line.startswith("warning: ")] == err.splitlines()[-1:]


@pytest.mark.parametrize(
    ("environment", "words", "code"),
    [
        ({"HOME": None, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}, ("-v",), 0),
        ({"HOME": ""}, ("--ranks", "2"), 0),
        ({"PYTHONWARNINGS": "error"}, ("--set", "contact.penalty=20.0"), 0),  # which a run warns of
        ({}, ("--set", b"material.E=\xff1"), 2),
        ({}, ("-o", b"\xff"), 2),
    ],
    ids=str,
)
def test_an_odd_environment_or_argument_is_no_error_or_one_line(
    tmp_path: Path, environment: dict[str, str | None], words: tuple[str | bytes, ...], code: int
) -> None:
    """Also where Python would make an error of a warning, or MPI end without a home."""
    path = tmp_path / "case.toml"
    path.write_text(PLANE)
    changed = {name: value for name, value in ({**CLEAN} | environment).items() if value is not None}
    command: list[Any] = [sys.executable, "-m", "asperity", "run", path, *words]
    done = subprocess.run(command, cwd=tmp_path, env=changed, capture_output=True, timeout=120)
    errors = done.stderr.decode().splitlines()
    assert done.returncode == code, errors
    rest = [line for line in errors if not line.startswith("warning: ")]
    assert len(rest) == (code != 0) and all(line.startswith("error: ") for line in rest)
    assert (tmp_path / "out").exists() == (code == 0)
    assert (b" step 1, branch load, " in done.stdout) == ("-v" in words)  # the lines of the log


@pytest.mark.parametrize(
    ("command", "code"),
    [
        ("run case.toml -v | true", 0),  # the run goes on
        ("run case.toml > /dev/full", 0),
        ("run case.toml >&- 2>&-", 0),
        ("check case.toml | true", 141),  # not 1, which compared curves have that differ
        ("check case.toml > /dev/full", 4),
    ],
)
def test_output_that_nobody_reads(tmp_path: Path, command: str, code: int) -> None:
    (tmp_path / "case.toml").write_text(PLANE)
    shell = ["bash", "-o", "pipefail", "-c", f"{sys.executable} -m asperity {command}"]
    assert subprocess.run(shell, cwd=tmp_path, env=CLEAN, timeout=120).returncode == code
    if command.startswith("run"):
        summary = json.loads((tmp_path / "out/case/summary.json").read_text())
        assert summary["finished"] and summary["steps"] == 1


@pytest.mark.parametrize(
    ("code", "later"),
    [
        ("asperity.cli", ("numpy", "matplotlib", "pydantic", "dolfinx", "mpi4py", "rich")),
        (f"asperity as a, asperity.adaptive.estimate as e; e.estimate(a.Case.load({TO_TOLERANCE!r}))",
         ("gmsh", "dolfinx", "petsc4py")),
        # the vibration would take more time than everything else before the first stage of a run
        (f"asperity; asperity.run; asperity.Case.load({DEMO!r})",
         ("asperity.vibration.oscillator", "scipy.stats", "scipy.optimize", "matplotlib", "gmsh", "dolfinx")),
    ],
)  # fmt: skip
def test_what_is_not_needed_is_not_imported(code: str, later: tuple[str, ...]) -> None:
    code = f"import sys, {code}; print([m for m in {later!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def parallel(code: str) -> subprocess.CompletedProcess[str]:
    """Run Python code on two ranks, started afresh."""
    command = [*MPIRUN, "2", sys.executable, "-c", code]
    return subprocess.run(command, capture_output=True, text=True, timeout=100)


def test_one_failed_rank_ends_a_job_that_waits_for_it() -> None:
    done = parallel(
        "import sys; from asperity.runtime import parallel; parallel.PATIENCE = 0.5; job = parallel.Ranks()\n"
        "from mpi4py import MPI\n"
        "if MPI.COMM_WORLD.rank == 1: sys.exit(job.leave(3, 'lost at step 4'))\n"
        "MPI.COMM_WORLD.Barrier()"
    )
    assert done.returncode == 3 and "lost at step 4 (rank 1" in done.stderr


@pytest.mark.parametrize("live", [True, False])
def test_a_mesh_has_one_line(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, live: bool) -> None:
    """The time left is that of the steps so far: six in a minute leave 2 m 10 for thirteen. A file has no live line."""
    monkeypatch.setattr("asperity.runtime.progress.on_terminal", lambda *_: live)
    lines, now = ProgressLine(), [0.0]
    monkeypatch.setattr(lines._display, "get_time", lambda: now[0])
    for level in ("mesh 1", "mesh 2"):
        lines.stage(f"{level}: set-up")
        lines.stage(f"{level}: load path")
        for i in range(1, 21):
            now[0] += 10.0
            lines.step({"step": i}, i / 20)
            if i == 7:
                lines._display.refresh()
    lines.done()
    shown = capsys.readouterr().out
    kept = [line.rpartition("\x1b[2K")[2] for line in shown.splitlines() if " steps" in line]
    assert [line[11:] for line in kept] == ["mesh 1: load path: 20 steps", "mesh 2: load path: 20 steps"]
    assert ("mesh 2: step 7 of 20, 2 m 10 left" in shown) == live
    assert live or (len(shown.splitlines()) == 2 and "\x1b" not in shown)


def sets(*changes: str) -> list[str]:
    """Options that set keys."""
    return [word for change in changes for word in ("--set", change)]


def test_dynamics_of_a_run(cli: Cli, tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    before = sorted(folder.iterdir())
    quick = sets("dynamics.model=exact", "dynamics.omega=[0.9, 1.1]")
    code, out, _ = cli("dynamics", folder, *quick)
    assert code == 0 and "unload-reload branch" in out and "taylor" not in out
    assert "with gravity = 9.80665" in out and "note: mass" not in out and "zeta = 0.01 (always)" in out
    _, out, _ = cli("dynamics", folder, *quick, "--set", "dynamics.gravity=1.62")
    assert "with gravity = 1.62" in out
    code, out, _ = cli(
        "dynamics", folder, *quick, *sets("joint.nominal_area=1e-4", "joint.pressure=2e8", "joint.mass=0.5")
    )
    assert code == 0 and "unload-reload branch" in out
    (numbers,) = (line for line in out.splitlines() if line.startswith("k_n = "))
    assert all(part in numbers for part in ("N/m", "m = 0.5 kg", "Hz", "z_s = ", "zeta = 0.01"))
    code, _, err = cli("dynamics", folder, *quick, *sets("joint.preload=1", "joint.pressure=2e8"))
    assert code == 2 and "joint.preload and joint.pressure are both given" in err
    assert sorted(folder.iterdir()) == before


def test_tangential_dynamics_of_a_run(cli: Cli, tmp_path: Path) -> None:
    slip = {"slip": {"friction": 0.3}, "joint": {"nominal_area": 1e-6, "mass": 0.1}}
    folder = write_run(tmp_path / "run", **slip)
    options = ("--direction", "tangential", "--json", "-o", tmp_path / "out")
    code, out, _ = cli("dynamics", folder, *sets("dynamics.forcing=0.05"), *options)
    found = json.loads(out)
    peak, rows = found["peaks"][0], found["vibration"]
    assert code == 0 and [row["amplitude"] for row in rows] == [0.1, 0.3, 0.6, 0.9]
    assert all(a["f"] > b["f"] and a["zeta"] < b["zeta"] for a, b in pairwise(rows))
    assert rows[-1]["f"] < peak["f"] < rows[0]["f"]
    # twice the joint with twice the mass vibrates alike
    twice = sets("joint.nominal_area=2e-6", "joint.mass=0.2", "dynamics.forcing=0.05")
    _, out, _ = cli("dynamics", folder, *twice, "--json", *options[:2])
    assert json.loads(out)["peaks"][0] == pytest.approx(peak)
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"slip_response.csv", "slip_response.svg"}
    given = (*sets("slip.preload=3e-7"), "--json", *options[:2])
    slip["slip"]["preload"] = 1e-7
    other = write_run(tmp_path / "light", **slip)
    light, heavy = (json.loads(cli("dynamics", run, *given)[1]) for run in (other, folder))
    assert light["loops"] == heavy["loops"] != json.loads(cli("dynamics", other, *given[2:])[1])["loops"]
    code, _, err = cli("dynamics", folder, *options[:2], *sets("dynamics.omega=[0.9, 1.1]"))
    assert code == 2 and "--set dynamics.omega is for the normal direction" in err
    code, _, err = cli("dynamics", folder, *sets("slip.friction=0.2"))
    assert code == 2 and "--set slip.friction is for --direction tangential" in err
    code, _, err = cli("dynamics", folder, "--preload", "3")
    assert code == 2 and "write --set dynamics.preload=VALUE or --set joint.preload=VALUE or --set slip" in err
    assert cli("dynamics", write_run(tmp_path / "other"), *options[:2])[0] == 2


DOUBTED = """units = "other"
surface = {kind = "sphere", L = 1.0, radius = 0.6}
material = {E = 1.0, nu = 0.3}
mesh = {h_contact = 0.12, h_max = 0.5}
loading = {delta_max = 0.05, steps = 2}
"""


def test_each_doubt_of_a_run_is_printed_once(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(DOUBTED)
    code, out, err = cli("run", tmp_path / "case.toml", "-o", tmp_path / "out")
    assert code == 0 and (out + err).count("contact pressure") == 1 and "Doubtful" not in out
    assert "assumptions that were checked" in out and "\x1b" not in out
    _, out, _ = cli("run", tmp_path / "case.toml", "-o", tmp_path / "out", "--resume")
    assert out.count("contact pressure") == 1  # of a run that was finished before


def test_an_occupied_folder_is_refused_before_ranks_start(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(DOUBTED)
    (tmp_path / "out").mkdir()
    (tmp_path / "out/mine.txt").touch()
    code, out, err = cli("run", tmp_path / "case.toml", "-o", tmp_path / "out", "--ranks", "2")
    assert code == 2 and len(err.splitlines()) == 1 and "not empty and holds no run" in err and not out
    code, out, err = cli("run", tmp_path / "case.toml", "-o", tmp_path / "case.toml/out")
    assert code == 4 and len(err.splitlines()) == 1 and "case.toml/out: Not a directory" in err and not out


def test_dynamics_of_a_power_law(cli: Cli, tmp_path: Path) -> None:
    options = (*sets("dynamics.omega=[0.9, 1.1]", "dynamics.forcing=0.005"), "-o", tmp_path / "out")
    code, out, err = cli("dynamics", "--power-law", "1.5", *options)
    assert (code, err) == (0, "")
    assert "0.84202" in out and "F/W = 0.0075" in out  # u_max = 2.5^(2/3) - 1
    assert "note: mass and omega_s assume a law in SI units, gravity = 9.80665" in out
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names >= {"free.csv", "response.csv", "thresholds.json"}
