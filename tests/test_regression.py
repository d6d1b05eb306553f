"""Stored curves: what a change of the code must not change, and how curves are stored."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import call

from asperity.case import Case
from asperity.curve import Curve
from asperity.job.run_case import run
from asperity.output.comparison import compare_curves

CURVES = Path(__file__).parent / "curves"


@pytest.mark.parametrize("file", sorted(CURVES.glob("*.csv")), ids=lambda path: path.stem)
def test_a_stored_curve_is_computed_again(file: Path) -> None:
    stored = Curve.read(file)
    assert {"case", "command", "mesh", "seed", "steps", "tolerances", "versions"} <= set(stored.header)
    curve = run(Case.load(file.with_suffix(".toml"))).curve
    assert [str(difference) for difference in compare_curves(curve, stored)] == []


def test_storing_a_curve(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case, out, file = tmp_path / "case.toml", tmp_path / "out", tmp_path / "kept.csv"
    text = (CURVES / "elastic.toml").read_text(encoding="utf-8")
    case.write_text(text.replace("../..", str(CURVES.parent.parent)).replace("steps = 6", "steps = 3"))
    assert call("run", case, "-o", out) == 0
    assert call("compare", out, file, "--store", "--rtol", "force=1e-7") == 0
    header = Curve.read(file).header
    assert header["case"] == Case.load(case).hash() and header["tolerances"]["force"] == 1e-7
    assert header["tolerances"]["max_pressure"] == 1e-3
    assert header["mesh"]["file"].endswith("fractal.npz") and header["mesh"]["cells"] == 861
    assert call("compare", out, file) == 0
    assert call("compare", out, CURVES / "elastic.csv") == 1
    assert "rows" in capsys.readouterr().out
    assert call("compare", out, file, "--store", "--rtol", "forces=1e-7") == 2
    assert call("compare", out, file, "--store", "--rtol", "force") == 2
    (out / "case.toml").write_text((out / "case.toml").read_text().replace("nu = 0.3", "nu = 0.31"))
    assert call("compare", out, file, "--store") == 2
    assert "is not the case of the run" in capsys.readouterr().err
