# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The bracket of friction: `run(..., bounds=True)`, its section in the summary and its line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asperity import solve_case
from asperity.case import Case
from asperity.cli import main
from asperity.curve import Curve
from asperity.errors import ConvergenceError, InputError
from asperity.output.friction_bounds import bounds_line, friction_bounds
from asperity.run_case import run

DATA: dict[str, Any] = {
    "units": "other",
    "surface": {"kind": "sinusoid", "L": 1.0, "amplitude": 0.05, "dims": 2},
    "material": {"E": 1.0, "nu": 0.0},
    "mesh": {"h_contact": 0.15, "h_max": 0.5, "growth": 0.5},
    "loading": {"delta_max": 0.02, "steps": 4},
}


def test_both_frictions_give_the_same_bracket(tmp_path: Path) -> None:
    """Stick is stiffer; whichever friction the case has, its own curve stays as it is."""
    out = {}
    for friction in ("none", "stick"):
        case = Case.from_dict(DATA | {"contact": {"friction": friction}})
        result = run(case, tmp_path / friction, bounds=True)
        np.testing.assert_array_equal(result.curve.force, run(case).curve.force)
        out[friction] = result.summary["friction_bounds"]
        assert json.loads((tmp_path / friction / "summary.json").read_text())["friction_bounds"] == out[friction]
        force = out[friction]["force"]
        assert force[friction][-1] == pytest.approx(result.curve.force[-1])
        assert 0.01 < out[friction]["at_greatest_load"]["force"] < bonded_punch_at_zero() - 1.0
    np.testing.assert_allclose(out["stick"]["force"]["none"], out["none"]["force"]["none"], rtol=1e-8)
    np.testing.assert_allclose(out["stick"]["force"]["stick"], out["none"]["force"]["stick"], rtol=0.015)  # other steps


def bonded_punch_at_zero() -> float:
    """Stiffness of a bonded punch over that of one without friction at nu = 0: more than any contact gains."""
    return float(np.log(3.0))


def test_a_finished_run_gets_its_bracket_later(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = tmp_path / "case.toml"
    case.write_text(Case.from_dict(DATA).to_toml(), encoding="utf-8")
    for options in ([], ["--resume", "--bounds"], ["--resume", "--bounds"]):
        with pytest.raises(SystemExit) as left:
            main(["run", str(case), "-o", str(tmp_path / "out"), *options])
        assert left.value.code == 0
    shown = capsys.readouterr().out
    assert shown.count("from no friction to stick, at the greatest load: force +") == 2
    assert shown.count("nothing is left to do") == 1
    again = run(Case.load(case), bounds=True).summary["friction_bounds"]
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["friction_bounds"] == again


def test_the_bracket_is_a_line_of_the_ledger_and_has_the_kinematics_of_the_run() -> None:
    material = DATA["material"] | {"kinematics": "auto"}
    summary = run(Case.from_dict(DATA | {"material": material}), bounds=True).summary
    (line,) = (line for line in summary["assumptions"] if line["name"].startswith("friction"))
    assert line["value"] == pytest.approx(100.0 * summary["friction_bounds"]["at_greatest_load"]["force"])
    assert (line["verdict"] == "doubtful") == (line["value"] > line["limit"] == 5.0)


def test_a_bracket_that_fails_is_the_reason_of_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The curve of the case is kept, and a continued run computes what is left."""
    case = Case.from_dict(DATA | {"output": {"report": True}})
    stopped = ConvergenceError("friction stick: no convergence")
    with monkeypatch.context() as patch:
        patch.setattr(solve_case, "solve_other_friction", lambda *_: (None, stopped))
        with pytest.raises(ConvergenceError, match="friction stick: no convergence"):
            run(case, tmp_path, bounds=True)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["exit_reason"] == str(stopped) and not summary["finished"] and (tmp_path / "report.html").is_file()
    np.testing.assert_array_equal(Curve.read(tmp_path / "curve.csv").force, run(case).curve.force)
    assert run(case, tmp_path, bounds=True, resume=True).summary["exit_reason"] == "done"


def test_a_contact_without_stick_is_refused() -> None:
    with pytest.raises(InputError, match=r'contact\.friction = "stick" holds nodes'):
        run(Case.from_dict(DATA | {"contact": {"method": "penalty"}}), bounds=True)


def test_curves_of_other_approaches_are_interpolated() -> None:
    def curve(deltas: list[float], factor: float) -> Curve:
        return Curve.from_rows([{"delta": d, "force": factor * d, "area_fraction": 0.1} for d in deltas])

    found = friction_bounds(curve([1.0, 2.0, 3.0], 1.0), curve([0.5, 1.5, 2.5, 3.5], 1.1))
    assert found["delta"] == [1.0, 2.0, 3.0]
    assert found["difference"]["force"] == pytest.approx([0.1] * 3)
    assert friction_bounds(curve([1.0], 1.0), curve([1.0], 1.1)) == {}
    empty = Curve.from_rows([{"delta": d, "force": 0.0, "area_fraction": 0.0} for d in (1.0, 2.0)])
    assert friction_bounds(empty, empty) == {}
    no_area = friction_bounds(curve([1.0, 2.0], 1.0), curve([1.0, 2.0], 1.0)) | {}
    assert bounds_line(no_area).endswith("force +0.0 %, area +0.0 %, stiffness +0.0 %")
