"""The contact of a run in other programs: CalculiX finds the curve."""

from __future__ import annotations

import csv
import re
import runpy
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import asperity as asp
from asperity.arrays import Array
from asperity.case import Case
from asperity.errors import InputError
from asperity.output.export import interface
from asperity.runtime.run_folder import EXPORTS

L, HEIGHT, E, NU = 1e-6, 1e-6, 200e9, 0.3
MODULUS = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
P0, Z0 = 1e9, 2e-8  # p = P0 (z/Z0)^2 of the interface
SUMMIT = 3e-8  # mean gap at first touch
RESIDUE = 8e-9  # approach of the mean planes after unloading


def pressure(z: Any) -> Any:
    """Of the interface, first loading."""
    return P0 * (np.asarray(z) / Z0) ** 2


def series(k: Any) -> Any:
    """Stiffness over area of an interface and the block below it."""
    return 1.0 / (1.0 / np.maximum(k, 1e-30) + HEIGHT / MODULUS)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A run whose interface is known: the flat's approach contains the compression of the block."""
    up, down = np.linspace(0.0, Z0, 21)[1:], np.linspace(Z0, RESIDUE, 13)[1:]
    z = np.append(up, down)
    p = np.append(pressure(up), P0 * ((down - RESIDUE) / (Z0 - RESIDUE)) ** 1.5)
    slope = np.append(2 * P0 * up / Z0**2, 1.5 * p[up.size :] / np.maximum(down - RESIDUE, 1e-30))
    elastic = np.append(1.25 * slope[: up.size], slope[up.size :])  # where the branch begins, and on it: its slope
    rows = [
        {
            "branch": "load" if i < up.size else "unload",
            "delta": z[i] + p[i] * HEIGHT / MODULUS, "force": p[i] * L**2,
            "mean_gap": SUMMIT - z[i], "max_plastic_strain": 0.01,
            "k_n": series(slope[i]) * L**2, "k_n_elastic": series(elastic[i]) * L**2,
            "k_n_interface": elastic[i] * L**2, "k_t_interface": 0.8 * slope[i] * L**2,
            "delta_star": z[i] / L, "P_star": p[i] / E,
        }
        for i in range(z.size)
    ]  # fmt: skip
    asp.Curve.from_rows(rows).write(tmp_path / "curve.csv")
    case = {
        "surface": {"kind": "sphere", "L": L, "radius": 1e-5}, "block": {"height": HEIGHT},
        "material": {"E": E, "nu": NU, "yield_strength": 1e9}, "loading": {"delta_max": 2e-8, "unload": True},
        "joint": {"nominal_area": 3e-4},
    }  # fmt: skip
    (tmp_path / "case.toml").write_text(Case.from_dict(case).to_toml(), encoding="utf-8")
    return tmp_path


def deck(path: Path) -> Array:
    """Lines of numbers of a table, (m, 2): pressure, overclosure."""
    lines = path.read_text(encoding="ascii").splitlines()
    start = lines.index("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR") + 1
    return np.array([[float(x) for x in line.split(",")] for line in lines[start:]])


def test_the_table_is_the_interface_without_the_block(folder: Path) -> None:
    table = interface(folder)
    np.testing.assert_allclose(table.pressure, pressure(table.approach), rtol=1e-6)
    np.testing.assert_allclose(table.slope, 2 * P0 * table.approach / Z0**2, rtol=1e-5)
    known = np.isfinite(table.k_n)
    assert known.sum() > 60
    np.testing.assert_allclose(table.k_n[known], table.slope[known], rtol=1e-2)
    np.testing.assert_allclose(table.k_n_elastic[known], 1.25 * table.k_n[known], rtol=1e-9)
    np.testing.assert_allclose(table.k_t[known], 0.8 * table.k_n[known], rtol=1e-9)


def test_the_branch_after_yield_is_that_of_the_preload(folder: Path) -> None:
    table = interface(folder, "unload-reload", load=0.5 * P0 * L**2)
    expected = P0 * (table.approach / (Z0 - RESIDUE)) ** 1.5
    np.testing.assert_allclose(table.pressure, expected, rtol=1e-3)


def test_the_branch_has_the_elastic_stiffness_as_slope(folder: Path) -> None:
    """Three rows of an unloading in contact are enough where the stiffness is known."""
    curve = asp.Curve.read(folder / "curve.csv")
    few = [i for i in range(len(curve)) if curve.branch[i] == "load" or i in (22, 26, len(curve) - 1)]
    rows = [row for i, row in enumerate(curve.rows()) if i in few]
    asp.Curve.from_rows(rows).write(folder / "curve.csv")
    table = interface(folder, "unload-reload", load=0.5 * P0 * L**2)
    z = table.approach[table.pressure > 0.1 * P0]
    np.testing.assert_allclose(table.pressure[table.pressure > 0.1 * P0], P0 * (z / (Z0 - RESIDUE)) ** 1.5, rtol=2e-3)
    np.testing.assert_allclose(table.slope[-1], 1.25 * 2 * P0 / Z0, rtol=1e-9)


@pytest.mark.parametrize("program", ["calculix", "abaqus"])
def test_a_deck_begins_at_zero_and_rises(folder: Path, program: str) -> None:
    path = asp.export(folder, program)
    table = deck(path)
    assert path.name == EXPORTS[program] and (table[0] == 0).all()
    assert (np.diff(table, axis=0) > 0).all() and table.shape[1] == 2
    inside = table[1:, 1] <= Z0 * (1 + 1e-6)
    np.testing.assert_allclose(table[1:][inside, 0], pressure(table[1:][inside, 1]), rtol=1e-6)
    assert len(table) <= 40 or program == "abaqus"
    assert inside.sum() == len(table) - (2 if program == "calculix" else 1)
    head = path.read_text(encoding="ascii").split("*SURFACE INTERACTION")[0].splitlines()
    assert all(line.startswith("** ") and len(line) < 125 for line in head)
    assert any("Pa/m" in line for line in head) and any("k_t at" in line for line in head)


def test_stiffnesses_are_those_of_the_branch_of_the_law(folder: Path) -> None:
    """Also where a second unloading ends above the preload."""
    one = interface(folder, "unload-reload", load=0.3 * P0 * L**2)
    curve = asp.Curve.read(folder / "curve.csv")
    rows, top = list(curve.rows()), len(curve.loading()) - 1
    again = [
        dict(rows[top], branch="reload"),
        dict(rows[top + 1], branch="unload"),
        dict(rows[top + 2], branch="unload"),
    ]
    asp.Curve.from_rows([*rows, *(row | {"k_n_interface": 9.0} for row in again)]).write(folder / "curve.csv")
    two = interface(folder, "unload-reload", load=0.3 * P0 * L**2)
    for name in ("approach", "pressure", "k_n", "k_n_elastic", "k_t"):
        np.testing.assert_allclose(getattr(two, name), getattr(one, name), rtol=1e-12)


@pytest.mark.parametrize(("law", "kinds"), [("table", ["COMP", "LUNL"]), ("unload-reload", ["COMP"])])
def test_a_gasket_of_ansys_has_the_curve_and_the_slopes_of_its_unloading(
    folder: Path, law: str, kinds: list[str]
) -> None:
    lines = asp.export(folder, "ansys", law=law).read_text(encoding="ascii").splitlines()
    curves: dict[str, Any] = {}
    for line in (line for line in lines if line[0] != "!"):
        if line.startswith("TB,"):
            *key, count, kind = line.split(",")
            assert key == ["TB", "GASKET", "asperity", "1"]
            curves[kind] = (int(count), [])
        elif line.startswith("TBPT,,"):
            curves[kind][1].append([float(x) for x in line.split(",")[2:]])
        else:
            assert line.startswith("asperity = 1 ")
    assert list(curves) == kinds and all(count == len(rows) > 20 for count, rows in curves.values())
    z, p = np.array(curves["COMP"][1]).T
    assert (np.diff(z) > 0).all() and z[0] < 0.03 * z[-1]
    if law == "table":
        np.testing.assert_allclose(p, pressure(z), rtol=1e-3)
        closure, slope = np.array(curves["LUNL"][1]).T
        np.testing.assert_allclose(slope, 1.25 * 2 * P0 * closure / Z0**2, rtol=1e-2)
        assert closure[-1] == z[-1] == pytest.approx(Z0, rel=1e-6)
    else:
        np.testing.assert_allclose(p, P0 * (z / (Z0 - RESIDUE)) ** 1.5, rtol=3e-3)


def test_a_csv_file_holds_stiffness(folder: Path, tmp_path: Path) -> None:
    path = asp.export(folder, "csv", tmp_path / "other.csv")
    with path.open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert float(rows[-1]["pressure"]) == pytest.approx(P0, rel=1e-6) and rows[0]["k_t"] == ""
    assert float(rows[-1]["k_t"]) == pytest.approx(0.8 * 2 * P0 / Z0, rel=1e-6)


def test_what_cannot_be_exported_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match='to = "marc" is unknown'):
        asp.export(folder, "marc")
    with pytest.raises(InputError, match='law = "paper" is not for an export'):
        asp.export(folder, "csv", law="paper")
    (folder / "case.toml").unlink()
    with pytest.raises(InputError, match=r"holds no case.toml, which has the nominal area"):
        asp.export(folder, "csv")


def calculix() -> list[str]:
    """Command of CalculiX: installed, or unpacked by benchmarks/peers/install, as Debian 13 has no package; or none."""
    if found := shutil.which("ccx"):
        return [found]
    unpacked = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "peers" / "unpacked.py"))
    there = (unpacked["PEERS"] / "bookworm/usr/bin/ccx").is_file()
    return list(unpacked["inside"]("bookworm", "usr/bin/ccx")[0]) if there else []


def calculated(folder: Path, name: str, lines: list[str]) -> str:
    """What CalculiX prints of a deck, the contents of its .dat file."""
    (folder / f"{name}.inp").write_text("\n".join(lines) + "\n", encoding="ascii")
    done = subprocess.run([*calculix(), name], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:]
    return (folder / f"{name}.dat").read_text(encoding="ascii")


def two_bricks(nodes: list[tuple[float, float, float]]) -> list[str]:
    """Lines of a deck: LOW and HIGH, eight of the nodes each, with the surfaces SLOW and SHIGH where they meet."""
    lines = ["*NODE, NSET=ALL", *(f"{i}, {x:.9e}, {y:.9e}, {z:.9e}" for i, (x, y, z) in enumerate(nodes, 1))]
    for name, first, number in (("LOW", 1, 1), ("HIGH", 9, 2)):
        lines += [f"*ELEMENT, TYPE=C3D8, ELSET={name}", ", ".join(str(k) for k in [number, *range(first, first + 8)])]
    return [*lines, "*SURFACE, NAME=SLOW", "1, S2", "*SURFACE, NAME=SHIGH", "2, S1"]


def in_contact(modulus: str) -> list[str]:
    """Lines of a deck: both bricks stiff, in contact by the exported property."""
    return [
        *("*MATERIAL, NAME=STIFF", "*ELASTIC", f"{modulus}, 0.0"),
        *(f"*SOLID SECTION, ELSET={name}, MATERIAL=STIFF" for name in ("LOW", "HIGH")),
        f"*INCLUDE, INPUT={EXPORTS['calculix']}",
        *("*CONTACT PAIR, INTERACTION=ASPERITY, TYPE=NODE TO SURFACE", "SHIGH, SLOW"),
    ]


@pytest.mark.skipif(not calculix(), reason="there is no CalculiX: benchmarks/peers/install unpacks ccx")
def test_calculix_presses_a_plate_and_finds_the_curve(folder: Path) -> None:
    """A stiff cube is moved onto a stiff cube; the force over the area is the pressure at the overclosure."""
    asp.export(folder, "calculix")
    a, steps, gap = L, 10, 0.1 * Z0
    corners = [(0, 0), (a, 0), (a, a), (0, a)]
    nodes = [(x, y, z) for z in (-a, 0.0, gap, a + gap) for x, y in corners]
    lines = [*two_bricks(nodes), "*NSET, NSET=BASE, GENERATE", "1, 4", "*NSET, NSET=TOP, GENERATE", "13, 16"]
    lines += in_contact("1e15")
    lines += ["*BOUNDARY", "BASE, 1, 3", "ALL, 1, 2"]
    lines += ["*STEP, INC=1000", "*STATIC", f"{1 / steps}, 1.0, 1e-6, {1 / steps}"]
    lines += ["*BOUNDARY", f"TOP, 3, 3, {-1.2 * Z0 - gap:.9e}"]
    lines += ["*NODE PRINT, NSET=TOP, TOTALS=ONLY", "RF", "*END STEP"]
    text = calculated(folder, "model", lines)
    found = np.array([(float(t), -float(f)) for t, f in re.findall(r"time\s+(\S+)\s+(?:\S+\s+){2}(\S+)", text)])
    p = found[:, 1] / L**2
    z = found[:, 0] * (1.2 * Z0 + gap) - gap - 2 * a * p / 1e15  # without the compression of the cubes
    inside, beyond = (z > 0.1 * Z0) & (z < Z0), z > Z0
    assert inside.sum() >= 6 and beyond.any()
    np.testing.assert_allclose(p[inside], pressure(z[inside]), rtol=8e-3)
    np.testing.assert_allclose(p[beyond], P0 * (1 + 2 * (z[beyond] / Z0 - 1)), rtol=1e-3)  # the last slope
