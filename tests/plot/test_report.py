"""The report: self-contained, complete, and safe for any input."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from conftest import call
from html_page import Page
from made_up_run import write_run

from asperity.plot import plot_run
from asperity.plot.report import write_report


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with vibration, whose figures are drawn."""
    from asperity.vibration import run_dynamics

    folder = write_run(tmp_path_factory.mktemp("drawn") / "run")
    run_dynamics(folder, out_dir=folder, model=["exact"], omega=(0.9, 0.95))
    plot_run(folder)
    return folder


@pytest.fixture
def folder(drawn: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(drawn, tmp_path / "run"))  # with the times of the files


def test_the_page_contains_law_outcome_input_and_run(folder: Path) -> None:
    page = Page(write_report(folder))
    for part in (
        "0.420 ± 4.8 % (misfit of the fit)", "1.550 ± 0.030 (misfit of the fit)",
        "403 µN ± 3 %", "30 nm", "yield_strength = 1000000000.0", "dolfinx 0.9.0", "18 accepted steps",
    ):  # fmt: skip
        assert part in page.text


def test_nothing_is_loaded_from_elsewhere(folder: Path) -> None:
    page = Page(write_report(folder))
    assert page.tags.count("img") == len(list((folder / "figures").glob("*.*"))) + 1 >= 6  # and the growing spots
    kinds = [link.partition(";base64,")[0] for link in page.links]
    assert set(kinds) == {"data:image/png", "data:image/svg+xml"}
    assert kinds.count("data:image/svg+xml") == len(list((folder / "figures").glob("*.svg"))) >= 3
    assert page.tags.count("script") == 1 and "link" not in page.tags
    assert "default-src 'none'" in (folder / "report.html").read_text(encoding="utf-8")


def test_text_from_the_input_is_escaped(folder: Path) -> None:
    evil = "<script>alert('x')</script>"
    folder = folder.rename(folder.with_name("<b>run"))
    summary = json.loads((folder / "summary.json").read_text())
    summary |= {"exit_reason": evil, evil: {evil: evil}}
    (folder / "summary.json").write_text(json.dumps(summary))
    page = Page(write_report(folder))
    assert page.tags.count("script") == 1 and "b" not in page.tags
    assert "<b>run" in page.text and evil in page.text


def test_a_partial_run_is_reported(folder: Path) -> None:
    (folder / "summary.json").write_text('{"exit_reason": "no convergence at step 3"}')
    (folder / "case.toml").unlink()
    page = Page(write_report(folder))
    assert "no convergence at step 3" in page.text and "Power law" not in page.text


def test_columns_that_a_curve_lacks_are_left_out(folder: Path) -> None:
    (folder / "curve.csv").write_text("delta,force\n1e-9,1e-6\n2e-9,3e-6\n")
    words = Page(write_report(folder)).text.partition("At the largest force")[2].partition("Figures")[0].split()
    assert "µN" in words and "nan" not in words and "spots" not in words


@pytest.mark.parametrize("met", [True, False])
def test_a_missed_tolerance_is_among_the_warnings(folder: Path, met: bool) -> None:
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    summary |= {"accuracy": {"met": met}, "exit_reason": "max_dofs = 30000 allows no more", "warnings": ["steep"]}
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    text = write_report(folder).read_text(encoding="utf-8")
    box = text.partition('<section class="warnings"')[2].partition("</section>")[0]
    assert "<li>steep</li>" in box
    assert ("<li>the tolerance is not met: max_dofs = 30000 allows no more</li>" in box) == (not met)


SIDES = {
    "free.csv": "u0,omega_ratio\n1\n", "response.csv": "Omega,u_max,F_hat\nx,y,z\n",
    "slip.csv": "amplitude,step\n0.1,0\n", "slip_loops.csv": "u,T\n0,0\n1,x\n",
    "curve.csv": "delta\n1\n",
    "thresholds.json": '{"exact": 3, "laws": [1], "numbers": "x", "load": [], "notes": 1}',
    "summary.json": '{"assumptions": [{"verdict": 1}], "fit": {"k": "x", "n": []}, "seconds": 3, "slip": 1}',
    "case.toml": '[surface]\nkind = "sinusoid"\n', "fields/top.npz": "",
}  # fmt: skip


@pytest.mark.usefixtures("blank_figures")
@pytest.mark.parametrize("name", SIDES)
def test_a_file_that_does_not_fit_is_refused_in_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """Read as a whole, but of other columns, types or shapes; a figure that does not need it is drawn."""
    if name == "fields/top.npz":
        np.savez(folder / name, pressure=np.ones((2, 3)), triangles=np.array("x"), points=np.ones(3))
    else:
        (folder / name).write_text(SIDES[name])
    code = call("report", folder)
    errors = capsys.readouterr().err.splitlines()
    assert (code, len(errors)) in ((0, 0), (2, 1)), errors
    assert code == 0 or errors[0].startswith("error: ")
    must = {"summary.json", "thresholds.json", "response.csv", "fields/top.npz"}
    assert code == 2 or name not in must | {"free.csv", "case.toml", "curve.csv", "slip_loops.csv"}
