"""Where the flat first touches, with respect to the sides of the patch."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from asperity.model.problem import edge_of_summit
from asperity.surface import Sinusoid, Sphere, Surface


def test_a_summit_that_falls_away_from_an_edge_is_doubtful(tmp_path: Path) -> None:
    """A crest inside; half a sphere, symmetric about the edge, which free sides do not carry; a cut wave."""
    cut, beside = (Sphere(L=1.0, radius=2.0, centre=(0.0, y)) for y in (0.5, 0.3))
    x = np.linspace(0.0, 1.0, 65)
    np.savez(tmp_path / "cut.npz", z=0.01 * np.cos(np.pi * (x + 0.2)) + 0.0 * x[:, None], L=1.0)
    wave = Surface.from_spec("file", path=tmp_path / "cut.npz")
    for sides, surface, doubtful in (
        ("rollers", Sinusoid(L=1.0, amplitude=0.01), False), ("rollers", cut, False), ("rollers", beside, False),
        ("free", cut, True), ("rollers", wave, True),
    ):  # fmt: skip
        edge = edge_of_summit(sides, surface)
        assert edge is not None and bool(edge.doubt) == doubtful, (sides, surface)
