"""Slip for other programs: friction and stick slope of the decks."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from conftest import PLASTIC, here, make_contact_solver
from test_export import calculated, calculix, in_contact, two_bricks

import asperity as asp
from asperity.contact.friction import Coulomb
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField
from asperity.model.settings import Formulation
from asperity.runtime.run_folder import EXPORTS

E, NU, MU, K = 1e6, 0.3, 0.4, 20.0  # force K z^1.5 on a patch of side 2


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, z = tmp_path_factory.mktemp("run"), np.linspace(0.05, 1.0, 20)
    asp.Curve.from_rows([{"delta": d, "force": K * d**1.5} for d in z]).write(folder / "curve.csv")
    case = {"units": "other", "surface": {"kind": "flat", "L": 2.0}, "material": {"E": E, "nu": NU}}
    case |= {"loading": {"delta_max": 0.9}, "slip": {"friction": MU}}
    (folder / "case.toml").write_text(asp.Case.from_dict(case).to_toml())
    return folder


@pytest.mark.parametrize("to", EXPORTS)
def test_a_text_of_a_file_stays_in_a_comment(folder: Path, tmp_path: Path, to: str) -> None:
    """What summary.json says must not become code, or a line of a table or deck."""
    reasons = {"plain": "done"}
    for end in ("\n", "\r", "\v", "\x1c", "\x85", "\u2028", "\\", '"""', '\\"""', '""""', "\ud800"):
        reasons[repr(end)] = f'done{end}*NODE{end}1,2{end}raise SystemExit("code runs"){end}{"x" * 150}'
    rest, out = {}, Path(shutil.copytree(folder, tmp_path / "run"))
    for name, reason in reasons.items():
        (out / "summary.json").write_text(json.dumps({"exit_reason": reason}))
        lines = asp.export(out, to).read_text().splitlines()
        rest[name] = [line for line in lines if not line.startswith("#" if to == "csv" else "**")]
    assert [name for name, lines in rest.items() if lines != rest["plain"]] == []


def test_a_deck_has_friction_and_stick_slope(folder: Path) -> None:
    z = 0.5 ** (2 / 3)  # at half of the greatest force; the block is stiff
    stick = 1.5 * K * z**0.5 * (1 - NU) / (1 - NU / 2) / 4.0
    lines = asp.export(folder, "calculix").read_text().splitlines()
    coefficient, slope = (float(x) for x in lines[lines.index("*FRICTION") + 1].split(","))
    assert (coefficient, slope) == (MU, pytest.approx(stick, rel=1e-4))
    lines = asp.export(folder, "abaqus").read_text().splitlines()
    elastic = float(lines[-2].removeprefix("*FRICTION, ELASTIC SLIP="))
    assert lines[-1] == f"{MU:g}," and elastic == pytest.approx(MU * 0.5 * K / 4.0 / stick, rel=1e-4)


def test_the_stick_slope_is_without_the_block(folder: Path, tmp_path: Path) -> None:
    """Of a soft block its compliance h/(A M) is half of that of the curve."""
    soft, out = 20.0, Path(shutil.copytree(folder, tmp_path / "run"))
    text = (out / "case.toml").read_text().replace("E = 1000000.0", f"E = {soft}")
    (out / "case.toml").write_text(text)
    modulus = soft * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
    interface = 1.0 / (1.5 * K * 0.5 ** (1 / 3)) - 2.0 / (4.0 * modulus)
    lines = asp.export(out, "calculix").read_text().splitlines()
    stick = float(lines[lines.index("*FRICTION") + 1].split(",")[1])
    assert stick == pytest.approx((1 - NU) / (1 - NU / 2) / interface / 4.0, rel=1e-3)


@pytest.mark.skipif(not calculix(), reason="there is no CalculiX: benchmarks/peers/install unpacks ccx")
def test_calculix_drags_a_block_around_the_loop(folder: Path) -> None:
    """A stiff block pressed onto a wide plate to the preload, then dragged: stick slope, limit and energy of a loop."""
    asp.export(folder, "calculix")
    z, a, reach = 0.5 ** (2 / 3), 2.0, 0.4

    def corners(side: float, z: float) -> list[tuple[float, float, float]]:
        return [(x * side / 2, y * side / 2, z) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]

    nodes = [*corners(5 * a, -a), *corners(5 * a, 0.0), *corners(a, 0.01), *corners(a, a)]
    lines = [*two_bricks(nodes), "*NSET, NSET=PLATE, GENERATE", "1, 8", "*NSET, NSET=BLOCK, GENERATE", "9, 16"]
    lines += ["*AMPLITUDE, NAME=LOOP", "0., 0., 1., 1., 3., -1., 5., 1.", *in_contact("1e6")]
    lines += ["*BOUNDARY", "PLATE, 1, 3", "BLOCK, 2, 2"]
    lines += ["*STEP, INC=1000", "*STATIC", "0.1, 1.0, 1e-6, 0.1", "*BOUNDARY", f"BLOCK, 3, 3, {-z - 0.01:.9e}"]
    lines += ["BLOCK, 1, 1, 0.", "*END STEP", "*STEP, INC=1000", "*STATIC", "0.05, 5.0, 1e-6, 0.05"]
    lines += ["*BOUNDARY, AMPLITUDE=LOOP", f"BLOCK, 1, 1, {reach}"]
    lines += ["*NODE PRINT, NSET=BLOCK, TOTALS=ONLY", "RF", "*END STEP"]
    text = calculated(folder, "drag", lines)
    found = np.array([(float(t) - 1.0, float(f)) for t, f in re.findall(r"time\s+(\S+)\s+(\S+)", text)])
    t, force = found[found[:, 0] > -1e-9].T
    u = reach * np.interp(t, [0, 1, 3, 5], [0, 1, -1, 1])
    limit = MU * 0.5 * K
    stick = 1.5 * K * z**0.5 * (1 - NU) / (1 - NU / 2)
    expected, at = [], 0.0  # one slider
    for x in u:
        at = min(max(at, x - limit / stick), x + limit / stick)
        expected.append(stick * (x - at))
    np.testing.assert_allclose(force, expected, atol=0.01 * limit)


@pytest.mark.slow
@pytest.mark.skipif(not calculix(), reason="there is no CalculiX: benchmarks/peers/install unpacks ccx")
@pytest.mark.parametrize(
    ("material", "steps", "increment"), [(asp.Material(1.0, 0.0), 4, 0.125), (PLASTIC, 8, 0.03125)]
)
def test_calculix_finds_the_forces_of_a_rigid_flat_with_friction(
    wave: asp.Surface,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    material: asp.Material,
    steps: int,
    increment: float,
) -> None:
    """Pressing, then a sideways motion at the same approach, on the same mesh; there contact and stick are springs.

    Its elements lock where they flow, so ours do not relax here.

    Where the solid yields, CalculiX loses 7 % of the normal force in the first increment of a sideways step, however
    short, and regains it in the next ones: there the increments are short.
    """  # fmt: skip
    mu, move = 0.4, 0.0075
    block = build_block(wave, 1.0, SizeField.of(wave, 0.02, 0.14, growth=0.6, h_max=0.5).at)
    monkeypatch.setattr("asperity.fem.kernels.relaxation_of", lambda _: (np.inf, np.inf))
    solver = make_contact_solver(here(), wave, block, material, sides="free", formulation=Formulation(friction=mu))
    for k in range(1, steps + 1):
        assert solver.step(0.02 * k / steps).converged
    contact, ours = solver.contact, [(solver.force, 0.0)]
    assert isinstance(contact, Coulomb)
    for k in range(1, steps + 1):
        contact.sliding.shift = np.array([move * k / steps, 0.0])
        assert solver.solve(solver.delta, solver.state().displacement).converged
        solver.commit(solver.delta)
        ours.append((solver.force, float(contact.sliding.traction[:, 0].sum())))
    assert not solver.checks.violated

    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks" / "peers"))
    import calculix as deck

    z = block.points[:, 2]
    top = np.abs(z - 1.0 - wave.height(*block.points[:, :2].T) + wave.mean()) < 1e-9
    cells, base = block.tets[:, deck.GMSH_TO_C3D10], {"BASE": (np.abs(z) < 1e-12, "1, 3")}
    stiffness = 50.0 / 0.14
    model = deck.Model(
        block.points, cells, "C3D10", deck.TET_FACES, top, base, material, 0.02, steps, steps, stiffness
    )  # fmt: skip
    deck.write(tmp_path / "model.inp", model)
    text = re.sub(r"\*TIME POINTS.*\n.*\n|, TIME POINTS=STEPS", "", (tmp_path / "model.inp").read_text("ascii"))
    text = text.replace(", SOLVER=ITERATIVE CHOLESKY", "").replace("RIGID, 1, 2\n", "RIGID, 2, 2\n")
    text = text.replace("RIGID, 3, 3, -0.02\n", "RIGID, 3, 3, -0.02\nRIGID, 1, 1, 0.\n")
    stick = 0.3 * stiffness * deck.STRESS
    text = text.replace("*CONTACT PAIR", f"*FRICTION\n{mu}, {stick:.6g}\n*CONTACT PAIR")
    text += f"*STEP, INC=1000\n*STATIC\n{increment}, 1.0, 1e-3, {increment}\n*BOUNDARY\nRIGID, 1, 1, {move}\n*END STEP"
    found = re.findall(r"time\s+(\S+)\s+(\S+)\s+\S+\s+(\S+)", calculated(tmp_path, "deck", text.splitlines()))
    theirs = {round(float(t), 6): (-float(z) / deck.STRESS, float(x) / deck.STRESS) for t, x, z in found}
    for k, (force, sideways) in list(enumerate(ours))[:: steps // 4]:
        normal, tangential = theirs[1.0 + k / steps]
        assert force == pytest.approx(normal, rel=0.02)
        assert sideways == pytest.approx(tangential, abs=0.02 * mu * normal)
