# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Slip for other programs: friction and stick slope of the decks, sliders with memory against Mindlin's loop."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import asperity as asp
from asperity.errors import InputError
from asperity.runtime.files import read_csv
from asperity.slip import SlipLaw
from asperity.slip.path import path_of_law

E, NU, MU, K = 1e6, 0.3, 0.4, 20.0  # force K z^1.5 on a patch of side 2


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, z = tmp_path_factory.mktemp("run"), np.linspace(0.05, 1.0, 20)
    asp.Curve.from_rows([{"delta": d, "force": K * d**1.5} for d in z]).write(folder / "curve.csv")
    case = {"units": "other", "surface": {"kind": "flat", "L": 2.0}, "material": {"E": E, "nu": NU}}
    case |= {"loading": {"delta_max": 0.9}, "slip": {"friction": MU}}
    (folder / "case.toml").write_text(asp.Case.from_dict(case).to_toml())
    return folder


def test_a_deck_has_friction_and_stick_slope(folder: Path) -> None:
    z = 0.5 ** (2 / 3)  # at half of the greatest force; the block is stiff
    stick = 1.5 * K * z**0.5 * (1 - NU) / (1 - NU / 2) / 4.0
    lines = asp.export(folder, "calculix").read_text().splitlines()
    coefficient, slope = (float(x) for x in lines[lines.index("*FRICTION") + 1].split(","))
    assert (coefficient, slope) == (MU, pytest.approx(stick, rel=1e-4))
    lines = asp.export(folder, "abaqus").read_text().splitlines()
    elastic = float(lines[-2].removeprefix("*FRICTION, ELASTIC SLIP="))
    assert lines[-1] == f"{MU:g}," and elastic == pytest.approx(MU * 0.5 * K / 4.0 / stick, rel=1e-4)


def test_sliders_follow_the_loop_of_mindlin(folder: Path) -> None:
    scope: dict[str, Any] = {}
    exec(asp.export(folder, "sliders-python").read_text(), scope)
    joint, law = scope["Sliders"](), SlipLaw(asp.PowerLaw(1.5, K), 0.5 * K, MU, NU)
    path = path_of_law(law, 0.8, steps=10)
    for u, force in zip(path.u, path.T, strict=True):
        assert joint(u) == pytest.approx(force, abs=0.02 * law.limit)
        joint.accept(u)
    rows = read_csv(asp.export(folder, "sliders"))
    assert sum(map(float, rows["f"])) == pytest.approx(1.0)
    assert 4.0 * sum(map(float, rows["k"])) == pytest.approx(law.k_tangent(0.0), rel=0.02)


def test_sliders_need_the_section(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "curve.csv").write_bytes((folder / "curve.csv").read_bytes())
    text = (folder / "case.toml").read_text()
    (tmp_path / "case.toml").write_text(text[: text.index("[slip]")] + text[text.index("[solver]") :])
    with pytest.raises(InputError, match=r"no section \[slip\]"):
        asp.export(tmp_path, "sliders")
    assert "*FRICTION" not in asp.export(tmp_path, "calculix").read_text()
