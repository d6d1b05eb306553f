"""Element sizes around the contact: the compiled field against a twin in Python."""

from __future__ import annotations

from math import hypot

import numpy as np
import pytest

from asperity.mesh.size_field import SizeField
from asperity.surface import Sphere


def size_at(field: SizeField, x: float, y: float, depth: float) -> float:
    x0, y0, side = field.window
    if field.periodic:  # the image next to the window
        x, y = (c - round(c - low - 0.5 * side) for c, low in ((x, x0), (y, y0)))
    inside_x = min(max(x, x0), x0 + side)
    inside_y = min(max(y, y0), y0 + side)
    scale = (field.distances.shape[0] - 1) / side
    d = field.distances[round((inside_y - y0) * scale), round((inside_x - x0) * scale)]
    d = d + hypot(x - inside_x, y - inside_y)
    farther = np.maximum(np.sqrt(d * d + depth * depth) - field.layer * field.sizes, 0.0)
    return min(float(np.min(field.sizes + field.growth * farther)), field.h_max)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("delta_max", [1e-4, 0.01])  # the window is a part of the patch, or all of it
def test_the_compiled_field_has_the_bits_of_its_twin(rough, delta_max, periodic):
    rng = np.random.default_rng(3)
    for surface in (rough, Sphere(L=1.0, radius=1.0)):
        field = SizeField.of(surface, delta_max, 0.04, periodic=periodic)
        points = rng.uniform(-0.02, 1.02, (2000, 3))
        nodes = points[:500]  # halfway between those of the grid, where the nearest one is a matter of rounding
        x0, y0, side = field.window
        nodes[:, :2] = [x0, y0] + side * (rng.integers(0, 256, (500, 2)) + 0.5) / 256
        sizes = [field.at(x, y, depth) for x, y, depth in points]
        assert sizes == [size_at(field, x, y, depth) for x, y, depth in points]
        assert max(sizes) > 2.0 * min(sizes)


def test_a_layer_of_the_size_that_cells_want_lies_below_them() -> None:
    """One element deep the size is that of the cells, from there on it grows."""
    sizes = np.full((64, 64), np.inf)
    sizes[28:36, 28:36] = 0.02
    field = SizeField.on_cells(sizes, growth=0.4)
    points = np.random.default_rng(3).uniform(0.0, 1.0, (2000, 3))
    assert [field.at(*point) for point in points] == [size_at(field, *point) for point in points]
    below = [field.at(0.5, 0.5, depth) for depth in (0.0, 0.02, 0.07)]
    np.testing.assert_allclose(below, [0.02, 0.02, 0.02 + 0.4 * 0.05], rtol=1e-12)
