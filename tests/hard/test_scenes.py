"""The hard cases, and the detection of wrong results.

The quick ones are in the short suite; all of them: `./run pytest tests/hard/test_scenes.py -m "slow or not slow"`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bad_inputs import SLIVER, with_slivers, with_turned_element
from scene_definition import Scene, Twin
from scene_outcome import run_scene
from scenes import SCENES

from asperity.mesh.generate import build_block
from asperity.surface import Sinusoid


@pytest.mark.parametrize(
    "scene",
    [pytest.param(s, id=s.name, marks=() if s.fast else pytest.mark.slow) for s in SCENES],
)
def test_a_hard_case_ends_as_it_should(scene: Scene) -> None:
    outcome = run_scene(scene)
    assert not outcome.faults
    if scene.ends == "done":
        checks = outcome.summary["checks"]
        assert checks["violated"] == {}
        limit = max(1e-6, float(scene.keys.get("solver.rtol", 0.0)))
        assert checks["force_balance"] < limit and checks["tension"] < limit


def test_names_are_unique_and_every_refusal_names_its_reason() -> None:
    assert len({scene.name for scene in SCENES}) == len(SCENES)
    assert all(scene.reason for scene in SCENES if scene.ends != "done")


def test_unexpected_results_are_faults() -> None:
    flat = next(scene for scene in SCENES if scene.name == "yield/whole-block")
    other = replace(flat, twin=Twin("softer", 1e-6, {"material.E": 100e9}))
    (fault,) = run_scene(other).faults
    assert fault.startswith("softer: ")
    stiffer = replace(flat, claim=lambda case, curve: (False, "stiffer"))
    assert run_scene(stiffer).faults == ("stiffer",)
    (fault,) = run_scene(replace(flat, ends="refused", reason="no", claim=None)).faults
    assert fault == "expected: refused no"


def test_a_run_that_stops_leaves_curve_and_checkpoint() -> None:
    scene = Scene(
        "starved",
        "one Newton iteration",
        {"solver.newton_max": 1, "mesh.h_contact": 0.3e-6},
        ends="stopped",
        reason="no convergence at delta/L",
    )
    outcome = run_scene(scene)
    assert outcome.faults == () and outcome.summary["cutbacks"] > 0


def test_slivers_are_flat_and_not_turned() -> None:
    from asperity.mesh.element import least_jacobians
    from asperity.runtime.compat import gmsh_to_dolfinx

    block = build_block(Sinusoid(L=1.0, amplitude=0.02, dims=2), 1.0, lambda x, y, depth: 0.2)
    cells = block.tets[:, gmsh_to_dolfinx(10)].astype(np.int32)
    before = least_jacobians(block.points, cells).min()
    after = least_jacobians(with_slivers(block, count=2).points, cells).min()
    assert 0.0 < after < 10.0 * SLIVER * before
    assert least_jacobians(with_turned_element(block).points, cells).min() < 0.0
