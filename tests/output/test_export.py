"""The contact of a run in other programs: CalculiX finds the curve."""

from __future__ import annotations

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
from asperity.reference import Westergaard
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
    np.testing.assert_allclose(table.k_n, 2 * P0 * table.approach / Z0**2, rtol=1e-5)


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
    np.testing.assert_allclose(table.k_n[-1], 1.25 * 2 * P0 / Z0, rtol=1e-9)


def read(path: Path, program: str) -> Array:
    """Approach and pressure of the points of a file (m, 2), with the zero that each program adds."""
    if program == "csv":
        found = np.genfromtxt(path, delimiter=",", comments="#", skip_header=0)[1:, :2]
    else:
        found = deck(path)[1:-1, ::-1]  # the last row continues the law
    return np.vstack([[0.0, 0.0], found])


@pytest.mark.parametrize("law", ["table", "unload-reload"])
@pytest.mark.parametrize("program", EXPORTS)
def test_linear_reading_is_within_one_per_cent(folder: Path, program: str, law: str) -> None:
    """Of the law of the run, wherever its points are; the header names the greatest error."""
    path = asp.export(folder, program, law=law)
    known, head = read(path, program), re.findall(r"^(?:\*\*|#) .*", path.read_text(encoding="ascii"), re.MULTILINE)
    assert path.name == EXPORTS[program] and (np.diff(known, axis=0) > 0).all()
    assert any("Pa/m" in line for line in head) and max(map(len, head)) < 125
    assert program == "csv" or len(known) <= 40
    if law == "table":
        exact, z = pressure, np.geomspace(0.05 * Z0, Z0, 997)
    else:
        exact, z = lambda z: P0 * (z / (Z0 - RESIDUE)) ** 1.5, np.geomspace(0.05, 1.0, 997) * (Z0 - RESIDUE)
    off = np.interp(z, *known.T) / exact(z) - 1.0
    assert -3e-3 < off.min() and off.max() < 1.05e-2
    said = re.search(r"off the law by up to ([0-9.]+) %", " ".join(path.read_text().split()))
    assert said is not None and 0.9 * off.max() < float(said[1]) / 100 <= 0.01


def write_full_contact(folder: Path, n: int, bar: float) -> tuple[Array, Array]:
    """A wave pressed up to full contact, Westergaard's solution, in series with its block; approach and pressure."""
    wave = Westergaard(A=0.005 * L, lam=L, E_prime=E / (1 - NU**2))
    p = wave.full_pressure * np.linspace(0, 1, n + 1)[1:]
    z = wave.approach(p)
    compression = p * HEIGHT / MODULUS
    rows = [
        {"delta": z[i] + compression[i], "force": p[i] * L**2, "mean_gap": wave.A - z[i],
         "error_mean_gap": bar * compression[i], "k_n": 1.0, "error_k_n": 0.05, "max_plastic_strain": 0.0}
        for i in range(n)
    ]  # fmt: skip
    asp.Curve.from_rows(rows).write(folder / "curve.csv")
    case = {"surface": {"kind": "sinusoid", "L": L, "amplitude": 0.005 * L}, "block": {"height": HEIGHT}}
    case |= {"material": {"E": E, "nu": NU}, "loading": {"delta_max": 2e-8}}
    (folder / "case.toml").write_text(Case.from_dict(case).to_toml(), encoding="utf-8")
    return z, p


def test_the_law_up_to_full_contact_is_read_within_one_per_cent(tmp_path: Path) -> None:
    """Where the pressure rises ever more steeply; points between those of the curve too."""
    write_full_contact(tmp_path, 60, 0.0)
    wave = Westergaard(A=0.005 * L, lam=L, E_prime=E / (1 - NU**2))
    p = np.linspace(0.05, 0.97, 200) * wave.full_pressure
    read_at = np.interp(wave.approach(p), *read(asp.export(tmp_path, "abaqus"), "abaqus").T)
    np.testing.assert_allclose(read_at, p, rtol=0.015)


def test_near_full_contact_the_law_ends_where_the_gap_is_within_its_error(tmp_path: Path) -> None:
    """The gap is a small difference of approach and compression: noise of its bar makes it rise, and even negative."""
    bar = 1e-3
    z, p = write_full_contact(tmp_path, 60, bar)
    curve = asp.Curve.read(tmp_path / "curve.csv")
    noise = np.random.default_rng(3).uniform(-1, 1, len(curve)) * curve.error_mean_gap
    disturbed = curve.mean_gap + noise
    assert disturbed.min() < 0.0 and np.diff(disturbed).max() > 0.0
    asp.Curve.from_rows([row | {"mean_gap": gap} for row, gap in zip(curve.rows(), disturbed, strict=True)]).write(
        tmp_path / "curve.csv"
    )
    path = asp.export(tmp_path, "abaqus")
    found = read(path, "abaqus")
    assert (np.diff(found, axis=0) > 0).all()
    end = found[-1, 1]
    assert 0.5 * p[-1] < end < p[-1] and "the table ends" in " ".join(path.read_text().replace("**", "").split())
    found = found[found[:, 1] >= p[0]]
    assert np.abs(found[:, 0] - np.interp(found[:, 1], p, z)).max() < 3 * curve.error_mean_gap.max()


def test_the_law_ends_where_the_gap_is_no_greater_than_its_error(tmp_path: Path) -> None:
    z, p = write_full_contact(tmp_path, 60, 1e-2)
    gap, error = 0.005 * L - z, 1e-2 * p * HEIGHT / MODULUS
    end = p[gap > error][-1]
    assert 0.5 * p[-1] < end < p[-2]
    assert read(asp.export(tmp_path, "abaqus"), "abaqus")[-1, 1] == pytest.approx(end, rel=1e-6)


def test_few_points_have_the_least_error_that_so_many_allow(folder: Path) -> None:
    """Of p ~ z^2 a chord from z to r z is off by (sqrt r - 1/sqrt r)^2/4 at the most, the same for each."""
    table, error = interface(folder).points(10, 50.0)
    ratio = (table.approach[-1] / table.approach[0]) ** (1 / 9)
    assert table.approach.size == 10
    assert error == pytest.approx((ratio**0.5 - ratio**-0.5) ** 2 / 4.0, rel=0.1)


def test_beyond_the_law_calculix_continues_its_slope(folder: Path) -> None:
    (end, z), (far, beyond) = deck(asp.export(folder, "calculix"))[-2:]
    assert far == pytest.approx(10.0 * P0) and end == pytest.approx(P0)
    assert (far - end) / (beyond - z) == pytest.approx(2 * P0 / Z0, rel=1e-5)


def test_the_preload_of_a_joint_is_that_of_its_nominal_area(folder: Path) -> None:
    case = Case.load(folder / "case.toml").to_dict()
    case["joint"] |= {"preload": 3e4}
    (folder / "case.toml").write_text(Case.from_dict(case | {"slip": {"friction": 0.3}}).to_toml(), encoding="utf-8")
    assert "at the nominal pressure 1e+08:" in asp.export(folder, "abaqus").read_text()


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
    np.testing.assert_allclose(p[inside], pressure(z[inside]), rtol=1.2e-2)
    np.testing.assert_allclose(p[beyond], P0 * (1 + 2 * (z[beyond] / Z0 - 1)), rtol=1e-3)  # the last slope
