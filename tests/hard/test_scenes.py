"""The hard cases.

The quick ones are in the short suite; all of them: `./run pytest tests/hard/test_scenes.py -m "slow or not slow"`.
"""

from __future__ import annotations

import pytest
from scene_outcome import run_scene
from scenes import SCENES, Scene


@pytest.mark.parametrize("scene", [pytest.param(s, id=s.name, marks=[pytest.mark.slow] * (not s.fast)) for s in SCENES])
def test_a_hard_case_ends_as_it_should(scene: Scene) -> None:
    outcome = run_scene(scene)
    assert not outcome.faults
    if scene.ends == "done":
        checks = outcome.summary["checks"]
        assert checks["violated"] == {}
        limit = max(1e-6, float(scene.keys.get("solver.rtol", 0.0)))
        assert checks["force_balance"] < limit and checks["tension"] < limit
