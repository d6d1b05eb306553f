"""Somebody's case names code: it runs by the user's word alone, and nothing beside the case runs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import CLEAN, call

import asperity as asp
from asperity import laws
from asperity.runtime.run_folder import CASE

#: The file of a law that leaves a line wherever it is run.
CODE = """import asperity as asp
with open({trace!r}, "a") as file:
    file.write("ran\\n")


@asp.law(symmetric=True)
def lin(strain, E, nu):
    return asp.laws.hooke(strain, E, nu)
"""
STRANGER = """surface = {{kind = "sphere", L = 1e-6, radius = 2e-6}}
material = {{law = {law!r}, E = 200e9, nu = 0.3}}
loading = {{delta_max = 5e-9, steps = 6}}
mesh = {{h_contact = 4e-7, h_max = 5e-7}}
"""


def test_a_law_in_a_file_runs_by_the_word_of_the_user_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trace, home = tmp_path / "trace", tmp_path / "home"
    home.mkdir()
    code = home / "mat.py"
    for place in (tmp_path / "mat.py", code):
        place.write_text(CODE.format(trace=str(trace)))
    case, out, again = home / "case.toml", home / "out", home / "again"

    def times(*arguments: str | Path) -> tuple[int, int, str]:
        """Exit code of a command, how often it ran the file, and its messages."""
        laws._run.cache_clear()
        before = len(trace.read_text()) if trace.exists() else 0
        found = call(*arguments)
        after = len(trace.read_text()) if trace.exists() else 0
        return found, (after - before) // len("ran\n"), " ".join(capsys.readouterr().err.split())

    for law in ("../mat.py", str(code), "mat.py"):
        case.write_text(STRANGER.format(law=f"{law}:lin"))
        ended, ran, said = times("check", case)
        assert (ended, ran) == (0, 0) and "is code and was not looked at" in said
        ended, ran, said = times("run", case, "-o", out)
        assert (ended, ran) == (2, 0) and said.count("is code, which runs with all your rights") == 1
        assert not out.exists()
    assert times("run", case, "-o", out, "--allow-code")[:2] == (0, 1)
    for command in (("report", out), ("export", out, "--to", "csv"), ("dynamics", out),
                    ("export", out, "--to", home / "block.inp"), ("check", out / CASE),
                    ("compare", out, home / "kept.csv", "--store"), ("compare", out, home / "kept.csv")):  # fmt: skip
        ended, ran, said = times(*command)
        assert (ended, ran) == (0, 0), said
    assert times("run", out / CASE, "-o", again)[:2] == (2, 0)
    assert times("run", case, "-o", out, "--resume")[:2] == (2, 0)
    assert times("run", case, "-o", out, "--resume", "--allow-code")[0] == 0
    code.unlink()  # the run of a case that came without it can still be read
    assert times("export", out, "--to", "csv")[:2] == (0, 0)
    assert times("run", out / CASE, "-o", again, "--allow-code")[:2] == (2, 0)


def test_a_script_runs_a_law_in_a_file_where_it_says_so(tmp_path: Path) -> None:
    trace, case = tmp_path / "trace", tmp_path / "case.toml"
    (tmp_path / "mat.py").write_text(CODE.format(trace=str(trace)))
    case.write_text(STRANGER.format(law="mat.py:lin"))
    with pytest.raises(asp.InputError, match="allow_code=True"):
        asp.run(case)
    with pytest.warns(asp.AsperityWarning, match="was not looked at"):
        problem = asp.Case.load(case).problem()
    with pytest.raises(asp.InputError, match="allow_code=True"):
        asp.solve_contact(problem)
    with pytest.raises(asp.InputError, match="is not one of hooke"):
        asp.Material.of_law(f"{tmp_path}/mat.py:lin", E=1.0, nu=0.3)
    assert not trace.exists()
    assert len(asp.run(case, allow_code=True).curve) == 6 and trace.read_text() == "ran\n"


def test_files_of_options_in_the_working_folder_are_left_alone(tmp_path: Path) -> None:
    """PETSc would write files by .petscrc, and dolfinx link libraries by its own."""
    (tmp_path / ".petscrc").write_text(f"-options_view ascii:{tmp_path}/written\n-log_view ascii:{tmp_path}/log\n")
    (tmp_path / "dolfinx_jit_options.json").write_text('{"cffi_libraries": ["strange"]}')
    (tmp_path / "case.toml").write_text(STRANGER.format(law="hooke"))
    command = [sys.executable, "-m", "asperity", "run", "case.toml", "-o", "out"]
    cache = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    done = subprocess.run(command, cwd=tmp_path, env=CLEAN | cache, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert {"written", "log"}.isdisjoint(os.listdir(tmp_path)) and "options_view" not in done.stderr
