# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""What a mesh leaves out of a rough surface: its top against the whole surface, both pressed as half-spaces.

Elements larger than the shortest waves see these waves at their nodes only, and the spots under the flat are too large.
Two such meshes may agree by chance. A half-space with all waves is solved in seconds, and so is one with the heights of
the mesh. Their ratio shows what the mesh leaves out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from asperity.adaptive.mesh_plan import FIRST, GUIDE
from asperity.arrays import Floats
from asperity.mesh.resolution import ELEMENTS, SHARE, resolving_size, unresolved_height
from asperity.mesh.size_field import GridContactMap
from asperity.mesh.top import Top, heights_of_top
from asperity.model.problem import Problem
from asperity.reference import RoughCurve, RoughHalfSpace
from asperity.reference.rough_halfspace import HARDNESS, cells_per_side

if TYPE_CHECKING:
    from asperity.surface import Surface

CELLS = 128, 1000  # fewest and most per side
PER_WAVE = 4  # cells per shortest wave
NEGLIGIBLE = 0.004  # tolerance that the waves too short for that number of cells do not affect
MOST_STEPS = 10  # at which both curves are computed
FORCE_BAR = 0.5  # bar over the change of the force; stiff elements make up for a part (docs/accuracy.md)
AREA_BAR = 0.3  # bar over the change of the area, which is corrected
MOST = 10.0  # change beyond which nothing is known


@dataclass(frozen=True)
class Omission:
    """What the roughness left out by a mesh changes, at ascending approaches.

    Attributes:
        delta_star: approaches (k,) [L]
        force: force with all waves over that on the top of the mesh, minus 1 (k,)
        area: the same of the area of contact (k,)
    """

    delta_star: Floats
    force: Floats
    area: Floats

    def at(self, delta_star: Floats) -> tuple[Floats, Floats]:
        """Changes of force and area at other approaches."""
        return np.interp(delta_star, self.delta_star, self.force), np.interp(delta_star, self.delta_star, self.area)


def is_rough(surface: Surface, depth: float, tolerance: float) -> bool:
    """Whether the first guided mesh leaves out waves that matter to a tolerance of the force.

    Args:
        surface: top of the block
        depth: greatest approach [length]
        tolerance: relative error allowed for the force
    """
    return unresolved_height(surface, FIRST * GUIDE * surface.L, depth) > SHARE * tolerance


class Roughness:
    """Half-space with all waves of the surface of a problem, in one process.

    Args:
        problem: what is pressed
        depth: greatest approach [length]
        steps: planned load steps
        on_part: called with the part of a half-space that is done
    """

    def __init__(
        self, problem: Problem, depth: float, steps: int, on_part: Callable[[float], None] | None = None
    ) -> None:
        self._surface, material = problem.surface, problem.material
        L = self._surface.L
        # of a filtered map the pixels are shorter than the waves
        shortest = ELEMENTS * resolving_size(self._surface, depth, NEGLIGIBLE, L)
        n = cells_per_side(float(np.clip(PER_WAVE * L / max(self._surface.feature_size, shortest), *CELLS)))
        hardness = np.inf
        if material.yield_strength is not None:
            hardness = HARDNESS * material.yield_strength / material.reduced_modulus
        self._layer = RoughHalfSpace(n, problem.height / L, material.nu, problem.sides, hardness)
        self._on_part = on_part
        self._summit = self._surface.maximum()[2] / L
        self._delta_star = depth / L * np.linspace(1.0 / steps, 1.0, min(steps, MOST_STEPS))

    @cached_property
    def _whole(self) -> RoughCurve:
        return self._press(self._layer.heights(self._surface))

    def _press(self, heights: Floats) -> RoughCurve:
        return self._layer.curve(heights, self._summit, self._delta_star, on_part=self._on_part)

    def contact_map(self) -> GridContactMap:
        """Approach at which each point of the surface is touched first."""
        L = self._surface.L
        return GridContactMap(self._whole.touched_at * L, L, self._layer.sides == "periodic")

    def left_out(self, top: Top) -> Omission:
        """What the top of a mesh leaves out."""
        heights = heights_of_top(top, self._surface, self._layer.n)
        mesh = self._press(heights)
        return Omission(
            self._delta_star,
            _change(self._whole.P_star, mesh.P_star),
            _change(self._whole.area_fraction, mesh.area_fraction),
        )


def _change(whole: Floats, part: Floats) -> Floats:
    """Ratio of two curves minus 1, no more than MOST; 0 where both vanish."""
    ratio = np.divide(whole, part, out=np.where(whole > 0.0, np.inf, 1.0), where=part > 0.0)
    return np.minimum(ratio - 1.0, MOST)
