# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The result of a run in sentences."""

from __future__ import annotations

from pathlib import Path

import asperity as asp
from asperity.output.results import Results
from asperity.output.verdict import verdict

ROW = {"delta": 1e-9, "force": 2e-6, "P_star": 4e-5, "area_fraction": 0.01}


def sentences(**columns: float) -> list[str]:
    """Of a run in SI units that ends with a row of these columns, after a lighter step."""
    rows = [ROW | {"force": 1e-6}, ROW | columns]
    return verdict(Results(Path("out"), asp.Curve.from_rows(rows), case={"units": "SI"}))


def test_stiffness_of_the_largest_force_with_its_bar() -> None:
    said = sentences(k_n_elastic=2.5e3, error_k_n_elastic=25.0, k_t=2.0e3)
    assert "Its elastic stiffness there: normal 2.5 kN/m ± 1 % and tangential, without slip, 2 kN/m." in said


def test_no_stiffness_where_none_was_computed() -> None:
    assert not any("stiffness" in sentence for sentence in sentences())
