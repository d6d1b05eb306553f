"""Runs in existing folders: refused, continued or started again, whatever ended the run before."""

from __future__ import annotations

import errno
import fcntl
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from functools import cache, partial
from pathlib import Path
from stat import S_ISREG
from typing import Any

import pytest
from conftest import assert_same, call, files, leave_figures_blank, world
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import CaseWarning, CheckpointError, InputError, Interrupted
from asperity.job.run_case import run
from asperity.output.run_files import read_summary
from asperity.plot import CAPTIONS, plot_run
from asperity.runtime import parallel
from asperity.runtime.progress import Progress
from asperity.runtime.run_folder import PICTURES, PRODUCTS, holds_run, is_empty

pytestmark = pytest.mark.usefixtures("blank_figures")

# a plane: the whole run takes a third of a second
PLANE: dict[str, Any] = {
    "units": "other",
    "surface": {"kind": "flat", "L": 1.0},
    "material": {"E": 1.0, "nu": 0.3},
    "mesh": {"h_contact": 0.5, "h_max": 1.0, "growth": 1.0},
    "loading": {"delta_max": 0.02, "steps": 5},
    "contact": {"gamma": 3.0},  # not used, which is a warning
}
WAVE: dict[str, Any] = {"kind": "sinusoid", "L": 1.0, "amplitude": 0.01}


class Killed(BaseException):
    """Represents SIGKILL: the package does not handle it."""


def case_of(**sections: Mapping[str, Any] | str) -> Case:
    return Case.from_dict({**PLANE, **sections})


# --- run, kill, resume, run again -----------------------------------------------------------------------------

QUICK = {"forcing": [0.01], "model": ["exact"], "omega": [0.9, 0.95]}
#: Cases by name; those that begin alike have the same curve, and a run of one is continued as another.
CASES: dict[str, dict[str, Any]] = {
    "soft": {},
    "soft with vibration": {"dynamics": QUICK},
    "soft with pictures": {"output": {"figures": True, "report": True, "snapshots": 0}},
    "hard": {"material": {"E": 2.0, "nu": 0.3}},
    "precise": {"solver": {"rtol": 1e-10}},
}
MINE = ("notes.txt", "figures/mine.png", "fields/mine")
#: How a run ends before its time: killed while it writes or removes its file number n, stopped, without locks.
ENDS = ("", "", "write", "write", "remove", "stop", "no lock")


@cache
def straight(name: str) -> tuple[Curve, frozenset[str], list[str]]:
    """Curve, files and warnings of an uninterrupted run."""
    with tempfile.TemporaryDirectory() as folder:
        found = run(case_of(**CASES[name]), folder)
        return found.curve, frozenset(results(Path(folder))), list(found.summary["warnings"])


def results(folder: Path) -> set[str]:
    """Files in a folder, without a checkpoint, which keeps the snapshots of all that was requested."""
    return {name for name in files(folder) if not name.startswith("checkpoint/")}


@contextmanager
def ended(how: str, number: int) -> Iterator[None]:
    """End what is done in a with-block before its time, see ENDS."""
    sync, unlink, count = os.fsync, Path.unlink, itertools.count(1)

    def fsync(descriptor: int) -> None:
        size = os.fstat(descriptor).st_size
        if S_ISREG(os.fstat(descriptor).st_mode) and next(count) == number:
            os.truncate(f"/proc/self/fd/{descriptor}", size // 2)  # half of it is written
            raise Killed
        sync(descriptor)

    def remove(path: Path, missing_ok: bool = False) -> None:
        if path.exists() and next(count) == number:
            raise Killed
        unlink(path, missing_ok)

    def refuse(*_: Any) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))  # as of NFS without its daemon

    with pytest.MonkeyPatch.context() as patch:
        if how == "write":
            patch.setattr(os, "fsync", fsync)
        elif how == "remove":
            patch.setattr(Path, "unlink", remove)
        elif how == "stop":
            patch.setattr(parallel.StopRequest, "agreed", lambda _: "the test" if next(count) > number else "")
        elif how == "no lock":
            patch.setattr(fcntl, "flock", refuse)
        yield


class Folder(RuleBasedStateMachine):
    """A folder in which somebody runs cases, whose runs are killed, and who adds and damages files.

    The model: the case of the run in the folder, None without one; whether all of it is there, None where a kill leaves
    that open; whether it can be continued; whether it was killed while it replaced another run.
    """

    def __init__(self) -> None:
        super().__init__()
        self.patch = pytest.MonkeyPatch()
        leave_figures_blank(self.patch)
        self.place = Path(tempfile.mkdtemp())
        self.out = self.place / "out"
        self.case: str | None = None
        self.finished: bool | None = False
        self.saved, self.replaced = True, False
        self.mine: set[str] = set()

    def teardown(self) -> None:
        self.patch.undo()
        shutil.rmtree(self.place)

    @rule(name=st.sampled_from(sorted(CASES)), mode=st.sampled_from(("", "resume", "resume", "force")),
          how=st.sampled_from(ENDS), number=st.integers(1, 16))  # fmt: skip
    def run_case(self, name: str, mode: str, how: str, number: int) -> None:
        """Run a case, perhaps not to its end."""
        before, alike = files(self.out), (self.case or name).split()[0] == name.split()[0]
        expected = ""  # refusal
        if self.case is None:
            expected = "not empty and holds no run" if self.mine else ""
        elif mode == "":
            expected = "already holds a run"
        elif mode == "resume":
            expected = "" if alike and self.saved else "another case|no state to resume from"
        sure = not (self.replaced and mode == "resume")
        try:
            with ended(how, number):
                result = run(case_of(**CASES[name]), self.out, resume=mode == "resume", force=mode == "force")
        except InputError as error:
            expected = expected if sure else "another case|no state to resume from"
            assert expected and re.search(expected, str(error)), (expected, error)
            assert files(self.out) == before
            return
        except Killed:
            assert not (sure and expected) and (holds_run(self.out) or is_empty(self.out))
            self.replaced = (self.replaced or mode == "force") and not is_empty(self.out)
            self.case, self.finished, self.saved = None if is_empty(self.out) else name, None, True
            summary, case = read_summary(self.out), case_of(**CASES[name])
            if (
                summary.get("finished")
                and "case_hash" in summary
                and (self.out / "case.toml").read_text() == case.to_toml()
            ):
                assert summary["case_hash"] == case.hash()
            return
        except Interrupted as error:
            assert not (sure and expected) and "stopped by the test" in str(error)
            if files(self.out) != before:
                self.case, self.finished, self.saved, self.replaced = name, False, True, False
            return
        assert not (sure and expected)
        curve, written, warned = straight(name)
        assert_same(result.curve, curve)
        assert_same(Curve.read(self.out / "curve.csv"), curve)
        assert results(self.out) == written | self.mine
        summary = read_summary(self.out)
        assert summary["finished"] is True and summary["warnings"] == warned == result.summary["warnings"] != []
        again = mode == "resume" and self.finished and self.case == name
        assert self.finished is None or (result.contact is None) == again
        assert not again or files(self.out) == before
        self.case, self.finished, self.saved, self.replaced = name, True, True, False

    @rule(name=st.sampled_from(MINE))
    def add_a_file(self, name: str) -> None:
        """Somebody keeps a file among those of a run, or where no run is."""
        (self.out / name).parent.mkdir(parents=True, exist_ok=True)
        (self.out / name).write_text(name)
        self.mine.add(name)

    @precondition(lambda self: self.mine)
    @rule()
    def remove_my_files(self) -> None:
        for name in self.mine:
            (self.out / name).unlink()
            with suppress(OSError):
                (self.out / name).parent.rmdir()
        self.mine = set()

    @precondition(lambda self: self.case is not None and not self.replaced)
    @rule(name=st.sampled_from(("summary.json", "case.toml")), text=st.sampled_from(("[", '{"finished": true}', "")))
    def damage_a_file(self, name: str, text: str) -> None:
        """A summary of anything is written again; without its case only a checkpoint shows that there is a run."""
        states = [path.name for path in (self.out / "checkpoint").rglob("*.npz")]
        if name == "summary.json" or states:
            (self.out / name).write_text(text)
            self.finished = False
        if name == "case.toml" and states:
            self.saved = "state.npz" in states

    @invariant()
    def my_files_are_as_they_were(self) -> None:
        assert all((self.out / name).read_text() == name for name in self.mine)


@pytest.mark.parametrize("how", ["write", "remove"])
@pytest.mark.parametrize("mode", ["resume", "force"])
def test_after_a_kill_at_any_file_the_same_call_is_done(mode: str, how: str) -> None:
    """Of a run that is started, or that replaces another one among files of somebody else."""
    first = Folder()
    if mode == "force" or how == "remove":
        first.run_case("soft with pictures", "", "", 1)
        first.add_a_file("notes.txt")
    name = "hard" if mode == "force" else "soft"
    for number in itertools.count(1):
        folder = Folder()
        if first.case:
            shutil.copytree(first.out, folder.out)
            folder.case, folder.finished, folder.mine = first.case, True, first.mine
        folder.run_case(name, mode, how, number)
        whole = folder.finished and folder.case == name
        folder.run_case(name, mode, "", 1)
        folder.teardown()
        if whole:
            break
    first.teardown()
    assert number > 4


def test_a_folder_of_runs_behaves_as_its_model() -> None:
    chosen = settings(
        max_examples=20, stateful_step_count=10, deadline=None, derandomize=True, database=None,
        phases=[Phase.generate], suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    run_state_machine_as_test(Folder, settings=chosen)


# --- once, and in two processes ---


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
    tmp_path: Path, capsys: pytest.CaptureFixture[str], before: str
) -> None:
    """Others that would write there are refused, also with another case and --force; what reads only is not.

    A lock is that of an open file: calls in the same process are refused as those of another one.
    """
    out, other = tmp_path / "out", tmp_path / "other.toml"
    straight("soft")[0].write(tmp_path / "soft.csv")
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
        assert call("compare", out, tmp_path / "soft.csv") == 1

    run(case_of(), out, progress=Interfering(interfere), force=True)
    text = f"error: another process works in {out}; wait for its end, or take another folder"
    assert refused == [(2, text)] * 3
    assert_same(Curve.read(out / "curve.csv"), straight("soft")[0])
    assert results(out) == straight("soft")[1]
    assert in_another_process("run", other, "-o", out, "--force", "-q")[0] == 0  # the lock is gone with its run


@pytest.mark.parametrize("refused", [True, False])
def test_of_two_runs_that_start_in_a_missing_folder_one_is_refused(tmp_path: Path, refused: bool) -> None:
    """The second one begins while the first one makes its mesh; a first one that is then refused leaves nothing."""
    out = tmp_path / "new/out"

    def second() -> None:
        with pytest.raises(InputError, match="another process works in"):
            run(case_of(loading={"delta_max": 0.01, "steps": 1}), out)
        if refused:
            raise InputError("no mesh")

    class First(Interfering):
        def stage(self, name: str) -> None:
            self.step({}, 0.0)

    with pytest.raises(InputError, match="no mesh") if refused else nullcontext():
        run(case_of(), out, progress=First(second))
    assert not (tmp_path / "new").exists() if refused else results(out) == straight("soft")[1]


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


def test_the_list_names_every_picture_and_each_file_once() -> None:
    assert set(CAPTIONS) == set(PICTURES)
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
