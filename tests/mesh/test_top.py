"""Heights of the top facets against the surface, and against a polynomial that the facets hold exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from conftest import top_of

from asperity.mesh.generate import build_block
from asperity.mesh.top import heights_of_top
from asperity.surface import Flat


def test_a_quadratic_top_is_exact() -> None:
    """The nodes of a flat block moved onto a quadratic, with the facets straight in x and y."""
    block = build_block(Flat(L=2.0), 3.0, lambda x, y, z: 0.3)
    x, y, z = block.points.T

    def f(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 0.01 * (x**2 - 0.5 * x * y + 0.2 * y**2 - y)

    class Quadratic(Flat):
        def height(self, x, y):
            return f(np.asarray(x), np.asarray(y))

        def mean(self) -> float:
            return 0.0

    points = np.column_stack([x, y, z + f(x, y) * (z / 3.0)])
    n = 37
    c = (np.arange(n) + 0.5) * 2.0 / n
    found = heights_of_top(top_of(replace(block, points=points), Quadratic(L=2.0)), Quadratic(L=2.0), n)
    np.testing.assert_allclose(found, f(c[None, :], c[:, None]) / 2.0, atol=1e-13)
