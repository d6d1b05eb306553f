"""Runs in existing folders: refused, continued or started again; `asp.run` behaves like the command."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from stat import S_ISREG
from typing import Any

import numpy as np
import pytest
from conftest import call, files, world

from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import CaseWarning, CheckpointError, InputError
from asperity.job.run_case import run
from asperity.plot import CAPTIONS, plot_run
from asperity.runtime.files import replace_file
from asperity.runtime.progress import Progress
from asperity.runtime.run_folder import PICTURES, PRODUCTS, holds_run

pytestmark = pytest.mark.usefixtures("blank_figures")

# a plane: the whole run takes half a second
PLANE: dict[str, Any] = {
    "units": "other",
    "surface": {"kind": "flat", "L": 1.0},
    "material": {"E": 1.0, "nu": 0.3},
    "mesh": {"h_contact": 0.5, "h_max": 1.0, "growth": 1.0},
    "loading": {"delta_max": 0.02, "steps": 2},
}
WAVE: dict[str, Any] = {"kind": "sinusoid", "L": 1.0, "amplitude": 0.01}


class Killed(BaseException):
    """Represents SIGKILL: the package does not handle it."""


def case_of(**sections: Mapping[str, Any] | str) -> Case:
    return Case.from_dict({**PLANE, **sections})


def kill_at_removal(monkeypatch: pytest.MonkeyPatch, call: int) -> None:
    """Kill a process before it removes its file number `call`."""
    unlink, calls = Path.unlink, [0]

    def kill(path: Path, missing_ok: bool = False) -> None:
        calls[0] += path.exists()
        if calls[0] == call:
            raise Killed
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", kill)


def kill_at(monkeypatch: pytest.MonkeyPatch, call: int) -> list[int]:
    """Kill a process while it writes half of its file number `call`; returns the number of calls."""
    sync, calls = os.fsync, [0]

    def fsync(descriptor: int) -> None:
        calls[0] += S_ISREG(os.fstat(descriptor).st_mode)
        if calls[0] == call:
            raise Killed
        sync(descriptor)

    monkeypatch.setattr("os.fsync", fsync)
    return calls


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Curve, Path]:
    """An uninterrupted run."""
    folder = tmp_path_factory.mktemp("straight") / "out"
    return run(case_of(), folder).curve, folder


def assert_same(curve: Curve, other: Curve) -> None:
    for name in ("delta", "force", "area_fraction", "max_pressure"):
        np.testing.assert_array_equal(getattr(curve, name), getattr(other, name))


# --- resuming -------------------------------------------------------------------------------------------------


def begin(folder: Path) -> None:
    """Write the files of a run before its mesh."""
    folder.mkdir()
    replace_file(folder / "case.toml", case_of().to_toml().encode())


def case_only(folder: Path) -> None:
    begin(folder)


def mesh_only(folder: Path) -> None:
    begin(folder)
    (folder / "checkpoint").mkdir()
    (folder / "run.log").write_text("mesh\n")
    (folder / "checkpoint" / "mesh.npz").write_bytes(b"of a mesh that is made again")


def curve_without_checkpoint(folder: Path) -> None:
    begin(folder)
    Curve.from_rows([{"delta": 0.001, "force": 7.0}]).write(folder / "curve.csv")


def case_by_another_name(folder: Path) -> None:
    """The case was edited, but the checkpoint shows that the folder contains a run."""
    mesh_only(folder)
    (folder / "case.toml").write_text("# mine\n" + case_of().to_toml())


def nothing_but_an_empty_checkpoint(folder: Path) -> None:
    (folder / "checkpoint" / "level-1").mkdir(parents=True)
    (folder / ".case.toml.12.asperity").write_text("[surfa")


def half_a_state(folder: Path) -> None:
    mesh_only(folder)
    (folder / "checkpoint" / ".state.npz.12.asperity").write_bytes(b"PK")
    (folder / ".curve.csv.12.asperity").mkdir()


@pytest.mark.parametrize(
    "state", [Path.mkdir, nothing_but_an_empty_checkpoint, half_a_state, curve_without_checkpoint, case_by_another_name]
)
def test_resuming_starts_a_run_without_a_state(
    tmp_path: Path, straight: tuple[Curve, Path], state: Callable[[Path], None]
) -> None:
    """One command for a job that may have been killed at any time, or never started."""
    out = tmp_path / "out"
    state(out)
    result = run(case_of(), out, resume=True)
    assert result.contact is not None
    assert_same(result.curve, straight[0])
    assert_same(Curve.read(out / "curve.csv"), straight[0])
    assert set(files(out)) == set(files(straight[1]))


@pytest.mark.parametrize("state", [case_only, mesh_only, curve_without_checkpoint, case_by_another_name])
def test_resuming_refuses_the_run_of_another_case(tmp_path: Path, state: Callable[[Path], None]) -> None:
    out = tmp_path / "out"
    state(out)
    before = files(out)
    with pytest.raises(CheckpointError, match=r"case\.toml belongs to another case: material\.E = 1 there, 2 here"):
        run(case_of(material={"E": 2.0, "nu": 0.3}), out, resume=True)
    assert files(out) == before


@pytest.mark.parametrize("text", [None, "[surface"])
def test_resuming_refuses_a_folder_without_a_valid_case(tmp_path: Path, text: str | None) -> None:
    mesh_only(tmp_path / "out")
    (tmp_path / "out/case.toml").unlink()
    if text is not None:
        (tmp_path / "out/case.toml").write_text(text)
    before = files(tmp_path)
    with pytest.raises(CheckpointError, match=r"no state to resume from, and no case to start again: .*--force"):
        run(case_of(), tmp_path / "out", resume=True)
    assert files(tmp_path) == before
    run(case_of(), tmp_path / "out", force=True)


def test_after_a_kill_during_any_write_the_same_call_continues(
    tmp_path: Path, straight: tuple[Curve, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A call is killed at its first file, at its second, and so on, and then repeated; at last it has nothing to do."""
    number, finished = 0, False
    while not finished:
        number += 1
        out = tmp_path / str(number)
        with monkeypatch.context() as patch:
            calls = kill_at(patch, number)
            try:
                run(case_of(), out, resume=True)
                finished = True
            except Killed:
                assert any(path.name.endswith(".asperity") for path in out.rglob("*"))
        if not finished:
            result = run(case_of(), out, resume=True)
            assert_same(result.curve, straight[0])
        assert set(files(out)) == set(files(straight[1]))
    assert calls[0] == number - 1 > 8  # each file was interrupted
    before = files(out)
    assert run(case_of(), out, resume=True).contact is None
    assert files(out) == before


def test_a_run_killed_while_adding_figures_is_not_finished(tmp_path: Path) -> None:
    """A finished run that continues is not finished until it ends again."""
    run(case_of(), tmp_path)
    more = case_of(output={"figures": True})
    with pytest.MonkeyPatch.context() as patch:
        kill_at(patch, 3)  # after summary.json and case.toml
        with pytest.raises(Killed):
            run(more, tmp_path, resume=True)
    assert not (tmp_path / "figures").exists()
    assert run(more, tmp_path, resume=True).contact is not None
    assert (tmp_path / "figures/curve.svg").is_file()
    assert json.loads((tmp_path / "summary.json").read_text())["finished"] is True


def test_a_run_that_continues_without_a_part_keeps_no_files_of_it(tmp_path: Path) -> None:
    """Vibration, fields, figures and the report, one after the other; the curve and what others wrote stay."""
    quick = {"forcing": [0.01], "model": ["exact"], "omega": [0.9, 0.95]}
    everything = {"fields": True, "figures": True, "report": True}
    steps: dict[str, Any] = {"loading": {"delta_max": 0.02, "steps": 5}}
    run(case_of(**steps, dynamics=quick, output=everything), tmp_path)
    assert {"free.csv", "figures/frequency.svg", "report.html"} <= {*files(tmp_path)}
    (tmp_path / "figures/mine.png").touch()
    for name in ("band.csv", "fields/view.py"):  # of a run of 1.0.0
        (tmp_path / name).touch()

    run(case_of(**steps, output=everything), tmp_path, resume=True)
    left = {*files(tmp_path)}
    assert not left & {
        "free.csv",
        "response.csv",
        "band.csv",
        "thresholds.json",
        "fields/view.py",
        "figures/frequency.svg",
    }
    assert {"report.html", "figures/curve.svg", "fields/contact.vtkhdf"} <= left

    run(case_of(**steps, output={"fields": False, "report": False, "figures": True}), tmp_path, resume=True)
    left = {*files(tmp_path)}
    assert not left & {"report.html", "fields/contact.vtkhdf"} and "figures/curve.svg" in left
    run(case_of(**steps), tmp_path, resume=True)
    assert [path.name for path in (tmp_path / "figures").iterdir()] == ["mine.png"]
    assert "curve.csv" in files(tmp_path)


@pytest.mark.parametrize("figures", [True, False])
def test_fields_requested_after_the_run_need_its_snapshots(tmp_path: Path, figures: bool) -> None:
    """A run with figures has kept them."""
    run(case_of(output={"figures": figures}), tmp_path)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", CaseWarning)
        result = run(case_of(output={"figures": figures, "fields": True}), tmp_path, resume=True)
    found = [str(w.message) for w in caught if "output.fields" in str(w.message)]
    assert (tmp_path / "fields/contact.vtkhdf").is_file() == figures == (not found)
    assert [text for text in result.summary["warnings"] if "output.fields" in text] == found


def test_a_finished_run_continues_with_more_cycles(tmp_path: Path) -> None:
    loading = {"delta_max": 0.02, "steps": 2, "unload": True, "integrator": "backward-euler"}
    solid = {"material": {"E": 1.0, "nu": 0.3, "yield_strength": 0.005}, "surface": WAVE}
    run(case_of(**solid, loading=loading), tmp_path / "one")
    twice = case_of(**solid, loading=loading | {"cycles": 2})
    assert_same(run(twice, tmp_path / "one", resume=True).curve, run(twice, tmp_path / "two").curve)


# --- two processes --------------------------------------------------------------------------------------------


class Interfering(Progress):
    """Calls a function once, at the first load step of a run."""

    def __init__(self, call: Callable[[], object]) -> None:
        self.call: Callable[[], object] | None = call

    def step(self, row: Mapping[str, Any], fraction_done: float) -> None:
        once, self.call = self.call, None
        if once is not None:
            once()


def in_another_process(*arguments: object) -> tuple[int, str]:
    """Exit code and last line of a command."""
    command = [sys.executable, "-m", "asperity", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    return done.returncode, (done.stderr.splitlines() or [""])[-1]


@pytest.mark.parametrize("before", ["nothing", "a run"])
def test_one_process_works_in_the_folder_of_a_run(
    tmp_path: Path, straight: tuple[Curve, Path], capsys: pytest.CaptureFixture[str], before: str
) -> None:
    """Others that would write there are refused, also with another case and --force; what reads only is not.

    A lock is that of an open file: calls in the same process are refused as those of another one.
    """
    out, other = tmp_path / "out", tmp_path / "other.toml"
    other.write_text(case_of(loading={"delta_max": 0.01, "steps": 1}).to_toml())
    if before == "a run":
        run(case_of(material={"E": 2.0, "nu": 0.3}), out)
    refused = []

    def interfere() -> None:
        refused.append(in_another_process("run", other, "-o", out, "--force", *(["--ranks", 2] * (before == "a run"))))
        for command in (
            ("run", other, "-o", out, "--force"), ("run", other, "-o", out, "--resume"),
        ):  # fmt: skip
            capsys.readouterr()
            refused.append((call(*command), capsys.readouterr().err.splitlines()[-1]))
        with pytest.raises(InputError, match="another process works in"):
            run(case_of(loading={"delta_max": 0.01, "steps": 1}), out, force=True)
        assert call("compare", out, straight[1]) == 1

    run(case_of(), out, progress=Interfering(interfere), force=True)
    text = f"error: another process works in {out}; wait for its end, or take another folder"
    assert refused == [(2, text)] * 3
    assert_same(Curve.read(out / "curve.csv"), straight[0])
    assert set(files(out)) == set(files(straight[1]))
    assert in_another_process("run", other, "-o", out, "--force", "-q")[0] == 0  # the lock is gone with its run


def test_of_two_runs_that_start_in_a_missing_folder_one_is_refused(
    tmp_path: Path, straight: tuple[Curve, Path]
) -> None:
    """Both have found it missing; the second makes its mesh while the first one runs, or has ended."""
    other = case_of(loading={"delta_max": 0.01, "steps": 1})
    for again in (False, True):
        out = tmp_path / str(again)

        class First(Interfering):
            def stage(self, name: str) -> None:
                once, self.call = self.call, None
                if once is not None:
                    once()

        with pytest.raises(InputError, match="another run has worked in"):
            run(other, out, progress=First(partial(run, case_of(), out)), resume=again)
        assert_same(Curve.read(out / "curve.csv"), straight[0])


def long_run(folder: Path) -> subprocess.Popen[bytes]:
    """Run of folder/case.toml in folder/out, of which some steps are done."""
    path, out = folder / "case.toml", folder / "out"
    path.write_text(case_of(mesh={"h_contact": 0.2}, loading={"delta_max": 0.02, "steps": 500}).to_toml())
    command: list[Any] = [sys.executable, "-m", "asperity", "run", path, "-o", out, "-q"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE)
    end = time.monotonic() + 60
    while not (out / "curve.csv").exists():
        assert time.monotonic() < end and process.poll() is None
        time.sleep(0.02)
    return process


def test_a_killed_run_leaves_no_lock(tmp_path: Path) -> None:
    path, out, process = tmp_path / "case.toml", tmp_path / "out", long_run(tmp_path)
    assert in_another_process("run", path, "-o", out, "--force")[0] == 2
    process.kill()
    process.wait()
    run(case_of(), out, force=True)


def test_a_signal_ends_a_run_in_order_where_nobody_reads_its_errors(tmp_path: Path) -> None:
    """As where its terminal has been closed; the note on the signal and the message of the end go nowhere."""
    process = long_run(tmp_path)
    assert process.stderr is not None
    process.stderr.close()
    process.terminate()
    assert process.wait(60) == 3
    summary = json.loads((tmp_path / "out/summary.json").read_text(encoding="utf-8"))
    assert summary["exit_reason"].startswith("stopped by SIGTERM after step")
    assert summary["steps"] == len(Curve.read(tmp_path / "out/curve.csv"))


@pytest.mark.parametrize("name", ["checkpoint", "checkpoint/level-1", "fields", "figures", "run.log", ".lock"])
def test_a_link_in_the_folder_of_a_run_is_not_followed(tmp_path: Path, name: str) -> None:
    """What it points to is as before; a link to the folder itself is what the user has given."""
    out, victim = tmp_path / "out", tmp_path / "victim"
    run(case_of(), victim)
    run(case_of(output={"figures": True}), out)
    link = out / name
    if link.is_dir() and name in PRODUCTS:
        shutil.rmtree(link)
    if name == "checkpoint":
        shutil.rmtree(link)
    link.unlink(missing_ok=True)
    link.symlink_to(victim / "checkpoint" if "." not in name else victim / "curve.csv")
    before = files(victim)
    for act in (
        partial(run, case_of(), out, force=True), partial(run, case_of(), out, resume=True), partial(plot_run, out),
    ):  # fmt: skip
        with pytest.raises(InputError, match="is a link, which a run does not follow"):
            act()
    assert files(victim) == before
    (tmp_path / "by-name").symlink_to(victim)
    run(case_of(), tmp_path / "by-name", force=True)


# --- folders --------------------------------------------------------------------------------------------------


def test_a_second_call_needs_resume_or_force(tmp_path: Path, straight: tuple[Curve, Path]) -> None:
    run(case_of(output={"fields": True}), tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    before = files(tmp_path)
    with pytest.raises(InputError, match=r"already holds a run.*resume = True and force = True"):
        run(case_of(), tmp_path)
    with pytest.raises(InputError, match="give one of them"):
        run(case_of(), tmp_path, resume=True, force=True)
    assert files(tmp_path) == before
    assert_same(run(case_of(), tmp_path, force=True).curve, straight[0])
    assert set(files(tmp_path)) == {*files(straight[1]), "notes.txt"}  # and no fields, which this case does not request


@pytest.mark.parametrize("options", [{}, {"resume": True}, {"force": True}])
def test_a_folder_without_a_run_is_unchanged(tmp_path: Path, options: dict[str, Any]) -> None:
    """Whatever its files are called, a case written by hand too."""
    with pytest.raises(InputError, match="is a file"):
        (tmp_path / "thesis.tex").write_text("mine")
        run(case_of(), tmp_path / "thesis.tex", **options)
    for name in ("report.html", "figures/thesis.png", "case.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("# mine\n" + case_of().to_toml())
        before = files(tmp_path)
        with pytest.raises(InputError, match="not empty and holds no run"):
            run(case_of(), tmp_path, **options)
        assert files(tmp_path) == before


def test_a_run_killed_while_it_is_replaced_can_be_replaced_again(tmp_path: Path) -> None:
    """Killed at every removal; the remaining files always count as a run."""
    number, finished = 0, False
    while not finished:
        number += 1
        out = tmp_path / str(number)
        run(case_of(), out)
        (out / "notes.txt").write_text("mine")
        with pytest.MonkeyPatch.context() as patch:
            kill_at_removal(patch, number)
            try:
                run(case_of(), out, force=True)
                finished = True
            except Killed:
                assert holds_run(out)
        if not finished:
            run(case_of(), out, force=True)
        assert (out / "notes.txt").exists()
    assert number > 5


def test_the_list_names_every_picture_and_each_file_once() -> None:
    assert set(CAPTIONS) == set(PICTURES) - {"plasticity", "scene", "slip_map"}  # of older versions
    assert len(set(PRODUCTS)) == len(PRODUCTS)


def test_warnings_about_a_case_are_those_of_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An unused key, and a modulus and a side that are not in Pa and m: each once, and in the summary."""
    case = case_of(contact={"penalty": 20.0}, units="SI")
    (tmp_path / "case.toml").write_text(case.to_toml(), encoding="utf-8")
    with pytest.warns(CaseWarning) as caught:
        run(case, tmp_path / "python")
    texts = [str(w.message) for w in caught]
    for text, part in zip(texts, ("E = 1 is taken as Pa", "L = 1 is taken as m", "= 20 is not used"), strict=True):
        assert part in text
    assert call("run", tmp_path / "case.toml", "-o", tmp_path / "command", "-q") == 0
    assert capsys.readouterr().err.splitlines() == [f"warning: {text}" for text in texts]
    for out in ("python", "command"):
        assert json.loads((tmp_path / out / "summary.json").read_text(encoding="utf-8"))["warnings"] == texts


# --- ranks ----------------------------------------------------------------------------------------------------


@pytest.mark.mpi
def test_all_ranks_raise_the_same_error(shared_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """For a case that only one rank cannot read, and for checks that only rank 0 makes."""
    comm = world()
    with monkeypatch.context() as patch:
        if comm.rank == comm.size - 1:
            patch.setattr("asperity.model.problem.Problem.doubts", lambda problem: refuse())
        with pytest.raises(InputError, match="not here"):
            run(case_of(), shared_path / "out", comm=comm)
    comm.Barrier()
    assert not (shared_path / "out").exists()
    comm.Barrier()
    run(case_of(), shared_path / "out", comm=comm)
    with pytest.raises(InputError, match="already holds a run"):
        run(case_of(), shared_path / "out", comm=comm)
    assert run(case_of(), shared_path / "out", resume=True, comm=comm).contact is None
    with pytest.raises(CheckpointError, match=r"material\.E"):
        run(case_of(material={"E": 2.0, "nu": 0.3}), shared_path / "out", resume=True, comm=comm)


def refuse() -> list[str]:
    raise InputError("not here")
