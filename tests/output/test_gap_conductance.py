"""Conductance of a joint per area: a round spot in closed form, the tables for other programs, the figure."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from test_export import calculated, calculix, in_contact, two_bricks

import asperity as asp
from asperity.output.results import Results
from asperity.plot import figures_of
from asperity.reference import cooper_mikic_yovanovich, mikic_elastic

L, K1, K2 = 1e-3, 50.0, 200.0


def write(folder: Path, **material: float) -> Path:
    """A run of a sphere that is elastic: spots of Hertz, C = 4 a, first pressed and then lifted off."""
    z = np.append(np.linspace(1e-7, 1e-6, 10), np.linspace(0.9e-6, 1e-7, 6))
    force, a = 200e9 / 0.91 * 4 / 3 * np.sqrt(1e-2) * z**1.5, np.sqrt(1e-2 * z)
    rows = [
        {
            "branch": "load" if i < 10 else "unload", "delta": z[i], "force": force[i], "conductance": 4 * a[i],
            "error_conductance": 0.02 * 4 * a[i], "delta_star": z[i] / L, "P_star": force[i] / L**2,
        }
        for i in range(z.size)
    ]  # fmt: skip
    asp.Curve.from_rows(rows).write(folder / "curve.csv")
    case = {"surface": {"kind": "sphere", "L": L, "radius": 1e-2}, "material": {"E": 200e9, "nu": 0.3, **material}}
    case |= {"loading": {"delta_max": 1e-6, "unload": True}, "output": {"stiffness": True}}
    (folder / "case.toml").write_text(asp.Case.from_dict(case).to_toml(), encoding="utf-8")
    return folder


def test_a_round_spot_between_two_half_spaces(tmp_path: Path) -> None:
    """Holm: 1/(4 k1 a) + 1/(4 k2 a) is the resistance of a round spot."""
    p, h, error = Results.read(write(tmp_path, conductivity=K1, conductivity_other=K2)).gap_conductance()
    a = np.cbrt(0.75 * p * L**2 * 1e-2 * 0.91 / 200e9)
    np.testing.assert_allclose(h * L**2, 1.0 / (1.0 / (4 * K1 * a) + 1.0 / (4 * K2 * a)), rtol=1e-9)
    np.testing.assert_allclose(error, 0.02 * h, rtol=1e-9)


@pytest.mark.parametrize(("law", "rows"), [("table", 10), ("unload-reload", 7)])
def test_like_bodies_have_twice_the_radius(tmp_path: Path, law: str, rows: int) -> None:
    h = 2 * K1 * 1e-4 / L**2
    assert Results.read(write(tmp_path, conductivity=K1)).gap_conductance()[1].max() == pytest.approx(h, rel=1e-9)
    lines = asp.export(tmp_path, "abaqus", law=law).read_text().splitlines()
    table = [line.split(",") for line in lines[lines.index("*GAP CONDUCTANCE, PRESSURE") + 1 :]]
    assert table[0] == ["0.", " 0."] and float(table[-1][0]) == pytest.approx(h, rel=1e-8)
    assert len(table) == rows + 1 and np.all(np.diff(np.array(table, float), axis=0) > 0)
    comments = [line for line in asp.export(tmp_path, "csv").read_text().splitlines() if line[0] != "#"]
    assert comments[0].endswith(",h") and float(comments[-1].split(",")[-1]) == pytest.approx(1e4, rel=1e-6)


def test_without_a_conductivity_there_is_none(tmp_path: Path) -> None:
    write(tmp_path)
    assert "GAP" not in asp.export(tmp_path, "calculix").read_text()
    assert "conductance" not in figures_of(Results.read(tmp_path))


def test_laws_of_rough_faces() -> None:
    """Both exponents are 0.95; elastic summits of a plasticity index of 1 conduct about as those that flow."""
    for law in (lambda p: cooper_mikic_yovanovich(p, 3e9), lambda p: mikic_elastic(p, 1e11, 0.1)):
        assert math.log(law(2e6) / law(1e6), 2) == pytest.approx(0.95, rel=1e-12)
    assert cooper_mikic_yovanovich(3e9, 3e9) == 1.25 and mikic_elastic(1e10, 2**0.5 * 1e11, 0.1) == 1.55


@pytest.mark.skipif(not calculix(), reason="there is no CalculiX: benchmarks/peers/install unpacks ccx")
def test_calculix_finds_the_heat_through_the_gap(tmp_path: Path) -> None:
    """A hot cube is pressed onto a cold one: cubes and gap in series, the gap with its conductance at the preload."""
    p, h, _ = Results.read(write(tmp_path, conductivity=K1)).gap_conductance()
    asp.export(tmp_path, "calculix", load=float(p[6]) * L**2)
    hot, k = 3.0, 20.0
    nodes = [(x, y, z) for z in (-L, 0.0, 0.0, L) for x, y in ((0, 0), (L, 0), (L, L), (0, L))]
    lines = [*two_bricks(nodes), "*NSET, NSET=BASE, GENERATE", "1, 4", "*NSET, NSET=TOP, GENERATE", "13, 16"]
    stiff, elastic, modulus, *contact = in_contact("1e15")
    lines += [stiff, elastic, modulus, "*CONDUCTIVITY", f"{k}", *contact]
    lines += ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "ALL, 0.", "*BOUNDARY", "BASE, 1, 3", "ALL, 1, 2"]
    lines += ["*STEP, INC=100", "*COUPLED TEMPERATURE-DISPLACEMENT, STEADY STATE", "0.25, 1.0, 1e-6, 0.25"]
    lines += ["*BOUNDARY", "BASE, 11, 11, 0.", f"TOP, 11, 11, {hot}", "TOP, 3, 3, -1e-6"]
    lines += ["*NODE PRINT, NSET=TOP, TOTALS=ONLY", "RFL", "*END STEP"]
    text = calculated(tmp_path, "heat", lines)
    heat = float(re.findall(r"total heat generation\D*time\s+\S+\s+(\S+)", text)[-1])
    assert heat == pytest.approx(hot * L**2 / (1.0 / h[6] + 2 * L / k), rel=1e-4)
