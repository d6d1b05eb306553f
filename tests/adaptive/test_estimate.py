"""The estimate of a case against the run itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import here, make_block

import asperity as asp
from asperity.adaptive.estimate import BASE, estimate
from asperity.case import Case
from asperity.job.run_case import run
from asperity.mesh.shared_nodes import joined

ROOT = Path(__file__).parents[2]
QUICK = [
    "mesh.h_contact=0.15e-6",
    "loading.steps=3",
    "output.figures=false",
    "output.report=false",
    "dynamics.zeta=0.05",
]


def test_a_surface_rough_down_to_the_pixel_takes_more_than_it_may(tmp_path: Path) -> None:
    """As a scan with noise: the estimate follows its waves, and says that the tolerance will not be met."""
    noise = np.random.default_rng(0).normal(size=(128, 128))
    np.savez(tmp_path / "noise.npz", z=1e-3 * noise, L=1.0)
    case = {"units": "other", "surface": {"kind": "file", "path": str(tmp_path / "noise.npz")}}
    case |= {
        "material": {"E": 1.0, "nu": 0.3},
        "loading": {"delta_max": 2e-3},
        "accuracy": {"tolerance": 0.05, "max_dofs": 100_000},
    }
    found = estimate(Case.from_dict(case))
    assert not found.enough and found.bar is not None and found.bar > 0.05
    assert found.dofs <= 100_000 and found.levels[-1].h_contact < 0.05


def test_dofs_steps_and_memory_are_those_of_the_run() -> None:
    data = Case.load(ROOT / "cases/single.toml", QUICK).to_dict()
    del data["dynamics"]
    case = Case.from_dict(data)
    found = estimate(case)
    summary = run(case).summary
    assert found.dofs == pytest.approx(summary["dofs"], rel=0.25)
    assert found.kinematics == summary["model"]["kinematics"] == "finite"
    assert summary["steps"] - 3 <= found.levels[0].steps <= summary["steps"]  # lifting off may take some steps more
    # what pytest has loaded in addition counts for the run
    assert found.memory / 2**20 / summary["peak_memory_MiB"] < 2  # that peak is one of all tests before
    assert found.seconds > 0


@pytest.mark.parametrize(
    ("h", "growth", "load", "sides"),
    [
        (1.0, 0.25, 0.01, "rollers"),
        (0.25, 0.6, 0.01, "rollers"),
        (0.05, 0.6, 2e-3, "rollers"),
        (0.25, 0.6, 0.01, "periodic"),
    ],
)
def test_few_elements_have_most_of_their_nodes_on_the_surface(h: float, growth: float, load: float, sides: str) -> None:
    """With periodic sides elements are narrower than a fifth of the side."""
    surface = {"kind": "flat", "L": 1.0} if sides == "periodic" else {"kind": "sphere", "L": 1.0, "radius": 5.0}
    case = {"units": "other", "surface": surface, "material": {"E": 1.0, "nu": 0.3}, "block": {"sides": sides}}
    case |= {"mesh": {"h_contact": h, "growth": growth, "h_max": 1.0}, "loading": {"delta_max": load, "steps": 1}}
    given = Case.from_dict(case)
    block = make_block(here(), given.surface, 1.0, load, given.problem().size, sides)
    assert block is not None
    nodes, rel = (len(np.unique(joined(block))), 0.25) if sides == "periodic" else (len(block.points), 0.3)
    assert estimate(given).dofs == pytest.approx(3 * nodes, rel=rel)


def test_a_tolerance_makes_several_meshes() -> None:
    found = estimate(Case.load(ROOT / "cases/elastic.toml"), ranks=4)
    sizes = [level.dofs for level in found.levels]
    assert len(sizes) >= 3 and sizes == sorted(sizes) and len(found.of_ranks) == 4
    assert found.memory > 4 * BASE


def test_a_solid_that_yields_has_the_bar_of_its_light_loads() -> None:
    """They scatter with the area: the bar is more than three times that of two meshes of an elastic solid."""
    cap = {"kind": "sphere", "L": 1.0, "radius": 6.0, "shape": "paraboloid"}
    soft = {"E": 1.0, "nu": 0.3, "yield_strength": 2e-3, "tangent_modulus": 1e-3, "kinematics": "small"}
    data = {"surface": cap, "material": soft, "loading": {"delta_max": 4e-3, "steps": 5}, "units": "other"}
    case = Case.from_dict(data | {"accuracy": {"tolerance": 0.05, "max_dofs": 8000}})
    problem, goal = replace(case.problem(), size=asp.MeshSize()), asp.AccuracyTarget(0.05, max_dofs=8000)
    assert estimate(case).bar == pytest.approx(asp.solve_contact(problem, tolerance=goal).verdict.force, rel=0.35)


@pytest.mark.parametrize(("name", "h"), [("hertz", 0.001), ("self_affine", 0.08)])
def test_a_force_has_the_estimate_of_its_approach(name: str, h: float) -> None:
    """Pressed to a force, and to the approach at which it is reached on a coarse mesh."""
    file, quick = ROOT / f"cases/{name}.toml", ['material.kinematics="small"', "accuracy.tolerance="]
    data = Case.load(file, [*quick, "loading.steps=3"]).to_dict()
    data.pop("dynamics", None)
    L = data["surface"]["L"]
    data["mesh"] = {"h_contact": h * L}
    data["output"], data["loading"] = {}, {"delta_max": data["loading"]["delta_max"], "steps": 3}
    given = Case.from_dict(data, folder=file.parent)
    curve = asp.solve_contact(given.problem()).curve
    data["loading"] = {"force_max": float(curve.force[-1]), "steps": 3}
    found, known = estimate(Case.from_dict(data, folder=file.parent)), estimate(given)
    assert found.approach == pytest.approx(known.approach, rel=0.25)
    assert found.dofs == pytest.approx(known.dofs, rel=0.3)
