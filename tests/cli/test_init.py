"""`asperity init`: the case it writes is legal, complete, and runs."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from conftest import call

import asperity as asp
from asperity.adaptive.estimate import estimate
from asperity.case import Case
from asperity.case.case_file import input_reference
from asperity.cli.check import prepare
from asperity.cli.init import SURFACES, commented, starting_case

COMMENTED = re.compile(r"^# (\[\w+\]|\w+ = \S.*)$", re.MULTILINE)
ADVICE = re.compile(r"^# (\w+) = +#", re.MULTILINE)  # a key without a plain default


def init(*arguments: str | Path) -> int:
    return call("init", *arguments)


@pytest.mark.parametrize("kind", SURFACES)
def test_the_case_is_accepted_without_a_warning(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "new/case.toml"
    assert init(path, "--surface", kind) == 0
    case = Case.load(path)
    assert case.surface.kind == kind and case.material.plastic
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        prepare(case, case.problem(), estimate(case).approach)


@pytest.mark.parametrize("kind", SURFACES)
def test_the_commented_defaults_are_the_defaults(kind: str, tmp_path: Path) -> None:
    """Every key of the schema is in the file; setting those that are commented out changes nothing."""
    text = commented(starting_case(kind))
    keys: dict[str, set[str]] = {"surface": {"kind"}}
    for place, key, *_ in input_reference():
        if not place.startswith("surface") or f"({kind})" in place:
            keys.setdefault(place.partition(" ")[0], set()).add(key)
    found: dict[str, set[str]] = {}
    section = ""
    for line in text.splitlines():
        if header := re.match(r"(?:# )?\[(\w+)\]$", line):
            section = header[1]
        elif named := re.match(r"(?:# )?(\w+) = ", line):
            found.setdefault(section, set()).add(named[1])
    assert found == keys

    plain, full = tmp_path / "plain.toml", tmp_path / "full.toml"
    text, required = re.subn(r"^# (\w+ =) +(# .*; required)$", r"\1 0.3 \2", text, flags=re.MULTILINE)
    assert required == 1  # the friction of [slip]
    plain.write_text(re.sub(r"# \[(dynamics|joint|slip)\]", r"[\1]", text), encoding="utf-8")
    full.write_text(COMMENTED.sub(r"\1", ADVICE.sub(r"## \1", text)), encoding="utf-8")
    assert COMMENTED.search(text) and not COMMENTED.search(full.read_text())
    assert Case.load(full) == Case.load(plain)


def test_a_joint_is_in_the_numbers_of_the_user(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The load path reaches twice the pressure of the preload, and returns."""
    path = tmp_path / "joint.toml"
    assert init(path, "--joint", "1e-5", "250", "5") == 2  # from which stiffness does not follow
    assert "give their rms height and rms slope, as --Sq" in capsys.readouterr().err
    assert init(path, "--joint", "1e-5", "250", "5", "--Sq", "0.4e-6") == 2
    assert init(path, "--joint", "1e-5", "250", "5", "--Sq", "0.4e-6", "--slope", "0.1") == 0
    case = Case.load(path)
    statistics = case.surface.statistics()
    assert statistics.Sq == pytest.approx(0.4e-6, rel=0.01) and statistics.rms_slope == pytest.approx(0.1, rel=0.01)
    joint = case.joint
    assert joint is not None and (joint.nominal_area, joint.preload, joint.mass) == (1e-5, 250.0, 5.0)
    assert case.loading.pressure_max == pytest.approx(1.2 * 250 / 1e-5) and case.loading.unload
    assert case.output.report and case.output.figures and case.output.stiffness
    assert case.accuracy.tolerance == 0.05 and case.material.kinematics == "auto"
    assert init(tmp_path / "no.toml", "--joint", "1e-5", "-1", "5") == 2
    assert init(tmp_path / "no.toml", "--Sq", "-1", "--slope", "0.1") == 2


def test_examples_are_those_of_the_pages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert init("--example", "demo") == 0 and init("--example", "scan") == 0
    assert init("joint.toml", "--example", "joint") == 0
    demo = Path(asp.__file__).parent.parent.parent / "cases/demo.toml"
    assert Path("case.toml").read_text() == demo.read_text()
    assert init("tip.toml", "--example", "tip") == 0 and Case.load("tip.toml").tool is not None
    joint, given = Case.load("joint.toml"), tmp_path / "given.toml"
    assert init(given, "--joint", "1e-5", "250", "5", "--Sq", "0.4e-6", "--slope", "0.1") == 0
    assert joint == Case.load(given)
    advice = capsys.readouterr().out.splitlines()[1].partition("next: asperity ")[2].split()
    assert call(*advice, "-o", "out") == 0 and Path("out/case.toml").is_file()


def test_a_map_is_taken_from_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From where the case is, with the approach of a light load on it."""
    surface = asp.Surface.from_spec(kind="sinusoid", L=1e-4, amplitude=1e-6, dims=2)
    np.savez(tmp_path / "scan.npz", z=surface.grid(65), L=1e-4)
    monkeypatch.chdir(tmp_path)
    assert init("cases/mine.toml", "--from", "scan.npz") == 0
    case = Case.load("cases/mine.toml")
    heights = surface.grid(65)
    assert case.surface.kind == "file" and case.surface.L == pytest.approx(1e-4)
    assert case.loading.delta_max is not None
    assert 0.01 < np.mean(heights > heights.max() - case.loading.delta_max) < 0.1
    assert init("absent.toml", "--from", "absent.npz") == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [(), ("--surface", "self-affine"), ("--joint", "1e-4", "5000", "5", "--Sq", "0.4e-6", "--slope", "0.1")],
    ids=str,
)
def test_it_runs_as_written_in_about_a_minute(arguments: tuple[str, ...], tmp_path: Path) -> None:
    """On one rank: by its count of Newton iterations times dofs, of which a minute does about ten million."""
    path = tmp_path / "case.toml"
    assert init(path, *arguments) == 0
    subprocess.run([sys.executable, "-m", "asperity", "run", path, "-o", tmp_path / "out", "--quiet"], check=True)
    summary = json.loads((tmp_path / "out/summary.json").read_text())
    assert summary["newton"] * summary["dofs"] < 1e7
    assert (tmp_path / "out/report.html").is_file() and (tmp_path / "out/figures/curve.svg").is_file()


def test_a_file_is_never_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert init() == 0
    before = (tmp_path / "case.toml").read_bytes()
    assert init("--surface", "flat") == 2
    assert (tmp_path / "case.toml").read_bytes() == before
    assert init(tmp_path) == 2  # a folder
