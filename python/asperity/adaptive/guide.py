"""A half-space with all waves of the surface: where meshes need small elements, and what their tops leave out.

The force on a mesh differs from the true one because its top is not the surface, and because its elements are stiff.
These errors may have opposite signs, and two meshes then agree by chance. A half-space tells them apart: pressed with
the top of the mesh instead of the surface, it shows the first one alone. A force corrected for it has one error of one
sign and one order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from asperity.arrays import Array, Floats
from asperity.curve.slope import SINGLE_CONTACT
from asperity.mesh.resolution import ELEMENTS, resolving_size
from asperity.mesh.top import Top, heights_of_top
from asperity.reference.elastic import first_yield
from asperity.reference.halfspace import HARDNESS, RoughHalfSpace, cells_per_side

if TYPE_CHECKING:
    from asperity.model.problem import Problem

CELLS = 128, 720  # fewest and most per side
PER_WAVE, PER_SIZE = 4.0, 1.5  # cells per shortest wave, and per element of scale 1
NEGLIGIBLE = 0.004  # tolerance that the waves too short for that number of cells do not affect
PASSES = 2  # of the half-space: the first shows how fine the second must be
MOST_STEPS = 10  # at which the half-space is pressed
EARLY = 0.25  # power of the approach in the sizes: the first spots are the least of a mesh and have its largest errors
SINGULAR = 1.0 + 1e-6  # pressure at the edge over the mean one: more than round-off, of a solid that flows it is 1
PARTS = 24  # approaches up to a given force, each a third beyond the one before
RESOLVED = 20  # cells in contact from which on an approach of them counts
MOST = 10.0  # change beyond which nothing is known


@dataclass(frozen=True)
class Omission:
    """What the top of a mesh changes, at ascending approaches.

    Attributes:
        delta_star: approaches (k,) [L]
        force: force on the surface over that on the top of the mesh, minus 1 (k,)
        area: the same of the area of contact (k,)
    """

    delta_star: Floats
    force: Floats
    area: Floats

    def at(self, delta_star: Floats) -> tuple[Floats, Floats]:
        """Changes of force and area at other approaches."""
        return np.interp(delta_star, self.delta_star, self.force), np.interp(delta_star, self.delta_star, self.area)


class Guide:
    """Half-space with all waves of the surface of a problem, in one process.

    Args:
        problem: what is pressed
        depth: greatest approach [length]
        steps: planned load steps
        on_part: called with the part of a half-space that is done
        passes: at most

    Attributes:
        delta_star: approaches at which it is pressed (k,) [L]
        sizes: of elements of scale 1 at the cells of a grid, inf where the surface is not touched (n, n) [L]
        singular: at each approach the part of the edges with a singular pressure (k,), see `singular_part`
        flowing: at each approach the part of the force under pressures with which a Hertzian spot yields (k,)
    """

    def __init__(
        self, problem: Problem, depth: float, steps: int, on_part: Callable[[float], None] | None = None,
        passes: int = PASSES,
    ) -> None:  # fmt: skip
        self._surface, L = problem.surface, problem.surface.L
        # of a filtered map the pixels are shorter than the waves
        shortest = ELEMENTS * resolving_size(self._surface, depth, NEGLIGIBLE, L)
        self._on_part = on_part
        self._summit = self._surface.maximum()[2] / L
        self.delta_star = depth / L * np.linspace(1.0 / steps, 1.0, min(steps, MOST_STEPS))
        cells = PER_WAVE * L / max(self._surface.feature_size, shortest)
        for _ in range(passes):
            n = cells_per_side(float(np.clip(cells, *CELLS)))
            self._layer = half_space(problem, n)
            self._press_surface()
            cells = PER_SIZE / float(self.sizes.min())
            if n >= min(cells, CELLS[1]):
                break

    def _press_surface(self) -> None:
        layer, steps = self._layer, self.delta_star
        heights = layer.heights(self._surface)
        self.sizes = np.full(heights.shape, inf)
        self._pressures: list[Array] = []
        force, area, singular, flowing = [], [], [], []
        first = first_yield(layer.nu)[0] / HARDNESS
        for k, p in enumerate(layer.pressures(heights, self._summit, steps)):
            force.append(float(p.mean()))
            area.append(layer.area(p))
            singular.append(singular_part(p))
            yields = p >= layer.hardness * first
            flowing.append(float(p[yields].sum() / p.sum()) if yields.any() else 0.0)
            self._pressures.append(p.astype(np.single))
            if not p.any():  # a spot between the centres of the cells
                x, y, _ = self._surface.maximum()
                row, column = (min(int(c / self._surface.L * layer.n), layer.n - 1) for c in (y, x))
                p[row, column] = 1.0
            self.sizes = np.minimum(self.sizes, (steps[k] / steps[-1]) ** EARLY * sizes_of_spots(p))
            if self._on_part is not None:
                self._on_part((k + 1) / len(steps))
        self._force, self._area = np.array(force), np.array(area)
        self.singular, self.flowing = np.array(singular), np.array(flowing)

    def left_out(self, top: Top) -> Omission:
        """What the top of a mesh leaves out; it changes little from step to step, and three of them are enough."""
        heights, at = heights_of_top(top, self._surface, self._layer.n, nodal=True), self.delta_star
        some = np.unique([0, len(at) // 2, len(at) - 1])
        starts = [self._pressures[k] for k in some]
        mesh = self._layer.curve(heights, self._summit, at[some], on_part=self._on_part, starts=starts)
        return Omission(
            at[some], _change(self._force[some], mesh.P_star), _change(self._area[some], mesh.area_fraction)
        )


def half_space(problem: Problem, cells: int) -> RoughHalfSpace:
    """Half-space of a problem with so many cells per side; its pressure is limited where the solid yields."""
    solid, hardness = problem.material, inf
    if solid.yield_strength is not None:
        hardness = HARDNESS * solid.yield_strength / solid.reduced_modulus
    return RoughHalfSpace(cells, problem.height / problem.surface.L, solid.nu, problem.sides, hardness)


def approach_of_force(problem: Problem) -> float:
    """Approach at the greatest force of a load path, of a half-space [length]."""
    surface, solid, height = problem.surface, problem.material, problem.height / problem.surface.L
    L, wanted = surface.L, problem.schedule.force_max
    assert wanted is not None
    layer = half_space(problem, CELLS[0])
    heights, summit = layer.heights(surface), surface.maximum()[2] / L
    # all of the surface in contact, and the block below compressed
    deepest = summit - float(heights.min()) + wanted * height * solid.reduced_modulus / solid.E
    P: list[float] = []
    delta: list[float] = []
    for d in deepest * 0.75 ** np.arange(PARTS - 1, -1, -1):
        state = layer.curve(heights, summit, [d], tolerance=1e-2)
        if state.area_fraction[0] * layer.n**2 >= RESOLVED:
            P.append(float(np.log(state.P_star[0])))
            delta.append(float(np.log(d)))
            if P[-1] >= np.log(wanted):
                break
    lighter = min(np.log(wanted) - P[0], 0.0) / SINGLE_CONTACT
    return L * float(np.exp(np.interp(np.log(wanted), P, delta) + lighter))


def sizes_of_spots(pressure: Floats) -> Floats:
    """Sizes with which the sum of F_i/F (h_i/a_i)^2 over the spots is 1, at the cells of a grid (n, n) [side].

    A spot of half-width a and force F_i adds F_i (h/a)^2 to the error of the force and A_i/h^2 elements to the mesh,
    A_i being its area. Of all sizes h with one error, h ~ (A_i a^2/F_i)^(1/4) has the fewest elements: a spot that
    carries little may be resolved less than one that carries much.

    Args:
        pressure: at the cells, not negative (n, n)

    Returns:
        Sizes, inf where there is no contact
    """
    n, touched = len(pressure), pressure > 0.0
    spot, count = ndimage.label(touched, np.ones((3, 3)))
    if count == 0:
        return np.full(pressure.shape, np.inf)
    inside = np.full(touched.shape, 0.5 * n) if touched.all() else ndimage.distance_transform_edt(touched)
    of = spot[touched] - 1
    half_width, area = np.zeros(count), np.bincount(of) / n**2
    np.maximum.at(half_width, of, inside[touched])  # ndimage.maximum sorts the whole grid
    half_width = np.clip(half_width - 0.5, 0.5, 0.5 * n) / n
    share = np.bincount(of, pressure[touched]) / pressure.sum()
    sizes = (area * half_width**2 / share) ** 0.25
    sizes /= np.sqrt(np.sum(share * (sizes / half_width) ** 2))
    return np.asarray(np.append(np.inf, sizes)[spot])


def singular_part(pressure: Floats) -> float:
    """Part of the edges of the spots where the pressure is higher than the mean one of the spot, by their forces.

    The pressure of a smooth top vanishes at the edge. Where a flat one ends in a sharp edge it is singular, and the
    error of the force is of first order in the element size.

    Args:
        pressure: at the cells, not negative (n, n)
    """
    touched = pressure > 0.0
    spot, count = ndimage.label(touched, np.ones((3, 3)))
    if count == 0:
        return 0.0
    edge = touched & ~ndimage.binary_erosion(touched, border_value=1)
    force, area = (np.bincount(spot[touched], w, count + 1) for w in (pressure[touched], None))
    mean = force / np.maximum(area, 1)
    edges = np.bincount(spot[edge], minlength=count + 1)
    high = np.bincount(spot[edge & (pressure > SINGULAR * mean[spot])], minlength=count + 1)
    return float(np.sum(force * high / np.maximum(edges, 1)) / force.sum())


def _change(whole: Floats, part: Floats) -> Floats:
    """Ratio of two curves minus 1, no more than MOST; 0 where both vanish."""
    ratio = np.divide(whole, part, out=np.where(whole > 0.0, np.inf, 1.0), where=part > 0.0)
    return np.minimum(ratio - 1.0, MOST)
