"""Blocks under surfaces that are rougher than their elements: sound elements, exact heights wherever possible."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asperity.errors import MeshError, ResolutionWarning
from asperity.mesh.block import NEAR, BlockMesh
from asperity.mesh.element import least_jacobians
from asperity.mesh.generate import build_block
from asperity.mesh.resolution import judge_mesh, lowered_height
from asperity.mesh.size_field import SizeField
from asperity.reference import RoughHalfSpace
from asperity.runtime import compat
from asperity.surface import HeightMap, SelfAffine, Sinusoid, Surface

STEEP = Sinusoid(L=1.0, amplitude=0.25, wavelength=0.25, dims=2)  # slopes up to 6


def uniform(surface: Surface, size: float) -> BlockMesh:
    return build_block(surface, 1.0, lambda x, y, depth: size)


def jacobians(block: BlockMesh) -> np.ndarray:
    """Return the least Jacobian determinant of each element, by the compiled kernel on a lattice of points."""
    return least_jacobians(block.points, block.tets[:, compat.gmsh_to_dolfinx(10)].astype(np.int32))


def lowered(block: BlockMesh, surface: Surface, delta: float = 0.05) -> float:
    """Change of the heights that a flat meets after an approach, over this."""
    return lowered_height(block, surface, delta)


def self_affine(**changes: Any) -> Surface:
    keys: dict[str, Any] = {"L": 1.0, "H": 0.8, "slope": 0.46, "lambda_roll": 0.3, "lambda_short": 0.02, "seed": 5}
    return SelfAffine(**{**keys, **changes})


@pytest.mark.parametrize("surface", [self_affine(), self_affine(lambda_short=0.004, H=0.5, slope=2.0)])
def test_elements_larger_than_the_roughness_stay_sound(surface: Surface) -> None:
    """Every top node lies on the surface smoothed by its own Gaussian; some of them on the surface itself."""
    block = uniform(surface, 0.1)
    assert block.smoothing is not None
    assert jacobians(block).min() > 0.0
    block.check(surface)
    below = block.heights(surface) - block.points[:, 2]
    top = below < NEAR
    assert below.min() > -NEAR and top.sum() > 100
    exact = top & (block.smoothing == 0.0)
    assert exact.any()
    x, y, z = block.points[exact].T
    np.testing.assert_allclose(z, 1.0 + surface.height(x, y) - surface.mean(), rtol=0.0, atol=1e-12)


def test_the_heights_of_a_wave_are_damped_in_closed_form() -> None:
    block = uniform(STEEP, 0.1)
    assert block.smoothing is not None
    top = block.heights(STEEP) - block.points[:, 2] < NEAR
    x, y, z = block.points[top].T
    k = 2.0 * np.pi / 0.25
    exact = STEEP.height(x, y) - STEEP.mean()
    np.testing.assert_allclose(z - 1.0, exact * np.exp(-((block.smoothing[top] * k) ** 2)), rtol=0.0, atol=1e-12)


def test_a_spike_that_no_element_can_follow_is_refused(tmp_path: Path) -> None:
    """The flat would meet the spike first, but the smoothed mesh has none."""
    z = 1e-3 * np.random.default_rng(3).standard_normal((33, 33))
    z[16, 16] = 0.3
    np.savez(tmp_path / "spike.npz", z=z, L=1.0)
    surface = HeightMap(path=tmp_path / "spike.npz")
    block = uniform(surface, 0.15)
    assert lowered(block, surface) > 0.5
    with pytest.raises(MeshError, match=r"mesh\.h_contact, or filter"):
        judge_mesh(block, surface, 0.1, 0.05)


def test_smoothing_stays_near_the_elements_that_need_it() -> None:
    """A width that falls too fast makes new bad elements at its edge, and spreads over the block as it grows."""
    surface = SelfAffine(L=1.0, H=0.8, slope=0.7, lambda_roll=0.3, lambda_short=0.05, seed=2)
    block = build_block(surface, 1.0, lambda x, y, depth: 0.012 + 0.4 * max(x - 0.3, depth, 0.0))
    assert block.smoothing is not None and jacobians(block).min() > 0.0
    width = block.smoothing
    assert width.max() < 0.1
    fine = width[(block.points[:, 2] > 0.9) & (block.points[:, 0] < 0.25)]
    assert (fine > 0.0).mean() < 0.5 and fine.max() < 3.0 * 0.012


def pressed(slope: float, seed: int) -> tuple[Surface, BlockMesh, float]:
    """A surface, its block with elements that resolve the summits and grow around them, and the approach."""
    delta = 0.02 * slope
    surface = self_affine(slope=slope, seed=seed, H=0.8, lambda_roll=0.25)
    layer = RoughHalfSpace(256, 1.0, 0.3)
    curve = layer.curve(layer.heights(surface), surface.maximum()[2], np.array([0.5, 1.0]) * delta)
    sizes = 0.015 * np.maximum(curve.touched_at / delta, 0.15)  # inf where nothing is touched
    field = SizeField.on_cells(sizes, growth=0.15)
    return surface, build_block(surface, 1.0, field.at), delta


def test_steep_summits_keep_their_heights() -> None:
    """The rest is far too steep."""
    surface, block, delta = pressed(1.0, 3)
    assert block.smoothing is not None and jacobians(block).min() > 0.0
    block.check(surface)
    gap = block.points[:, 2].max() - 1.0 - (surface.maximum()[2] - surface.mean())
    assert abs(gap) < 1e-3 * delta
    assert lowered(block, surface, delta) < 0.05


def test_summits_that_are_too_steep_are_told() -> None:
    """The highest one is lower by an eighth of the approach; for a sixth of the approach the mesh is refused."""
    surface, block, delta = pressed(1.5, 9)
    assert jacobians(block).min() > 0.0
    with pytest.warns(ResolutionWarning, match="smoothed"):
        judge_mesh(block, surface, 0.1, delta)
    with pytest.raises(MeshError, match=r"mesh\.h_contact, or filter"):
        judge_mesh(block, surface, 0.1, delta / 6.0)


def test_a_sheer_step_has_sound_elements(tmp_path: Path) -> None:
    """Two plateaus joined within a pixel: no element follows a slope of 12, and only its surroundings are smoothed."""
    z = np.repeat(np.clip((np.arange(128) - 63.0), 0.0, 1.0)[None] * 0.1, 128, axis=0)
    np.savez(tmp_path / "step.npz", z=z, L=1.0)
    surface = HeightMap(path=tmp_path / "step.npz")
    block = build_block(surface, 1.0, lambda x, y, depth: 0.06 + 0.3 * (depth + abs(x - 0.5)))
    assert block.smoothing is not None and jacobians(block).min() > 0.0
    x, _, height = block.points.T
    plateau = (x > 0.8) & (block.heights(surface) - height < NEAR)
    np.testing.assert_allclose(height[plateau], 1.1 - surface.mean(), atol=1e-3)
