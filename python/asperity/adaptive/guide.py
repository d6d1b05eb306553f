"""A half-space with all waves of the surface: where meshes need small elements, and what their tops leave out.

The force on a mesh differs from the true one because its top is not the surface, and because its elements are stiff.
These errors may have opposite signs, and two meshes then agree by chance. A half-space tells them apart: pressed with
the top of the mesh instead of the surface, it shows the first one alone. A force corrected for it has one error of one
sign and one order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage
from scipy.optimize import brentq

from asperity.arrays import Array, Floats
from asperity.curve.slope import SINGLE_CONTACT
from asperity.mesh.top import Top, heights_of_top
from asperity.reference.halfspace import HARDNESS, RoughHalfSpace, cells_per_side

if TYPE_CHECKING:
    from asperity.model.problem import Problem

CELLS = 128, 720  # fewest and most per side
PER_SIZE = 1.5  # cells per element of scale 1
REACH = 2  # steps to either side that support the bar of a step: two meshes agree by chance at one approach
EARLY = 0.25  # power of the approach in the sizes: the first spots are the least of a mesh and have its largest errors


@dataclass(frozen=True)
class Omission:
    """What a half-space shows of the top of a mesh, at ascending approaches.

    Attributes:
        delta_star: approaches (k,) [L]
        force: force on the surface over that on the top of the mesh, minus 1 (k,)
        area: the same of the area of contact (k,)
        singular: part of the edges of the spots of the surface with a singular pressure (k,), see `spots_of`
    """

    delta_star: Floats
    force: Floats
    area: Floats
    singular: Floats

    def at(self, delta_star: Floats) -> tuple[Floats, Floats, Floats]:
        """Changes of force and area, and the singular part, at other approaches."""
        of_force, of_area, singular = (
            np.interp(delta_star, self.delta_star, values) for values in (self.force, self.area, self.singular)
        )
        return of_force, of_area, singular


class Guide:
    """Half-space with all waves of the surface of a problem, in one process.

    Args:
        problem: what is pressed
        depth: greatest approach [length]
        steps: planned load steps
        on_part: called with the part of a half-space that is done
        passes: at most, of which each shows how fine the next must be

    Attributes:
        depth: greatest approach [length]
        delta_star: approaches at which it is pressed, those of the steps (k,) [L]
        force: mean pressures there over E' (k,)
        sizes: of elements of scale 1 at the cells of a grid, inf where the surface is not touched (n, n) [L]
        slope: rms slope of the spots in contact at the greatest approach, 0 of a summit between the centres of cells
        passes: that were made
    """

    def __init__(
        self, problem: Problem, depth: float, steps: int, on_part: Callable[[float], None] | None = None,
        passes: float = inf,
    ) -> None:  # fmt: skip
        self.depth, self._surface, self._on_part = depth, problem.surface, on_part
        L = problem.surface.L
        self._summit = problem.surface.maximum()[2] / L
        self.delta_star = depth / L * np.linspace(1.0 / steps, 1.0, steps)
        self.sizes: Floats
        self._layer: RoughHalfSpace
        self.passes, cells = 0, float(CELLS[0])
        while self.passes < passes and (not self.passes or self._layer.n < min(cells, CELLS[1])):
            self._layer = half_space(problem, cells_per_side(min(cells, CELLS[1])))
            self._press_surface()
            cells = PER_SIZE / float(self.sizes.min())
            self.passes += 1

    def _press_surface(self) -> None:
        layer, steps = self._layer, self.delta_star
        heights = layer.heights(self._surface)
        self.sizes = np.full(heights.shape, inf)
        self._some = sorted({0, len(steps) // 2, len(steps) - 1})
        self._pressures: list[Array] = []  # there
        columns = []
        for k, p in enumerate(layer.pressures(heights, self._summit, steps)):
            force, area, touched = float(p.mean()), layer.area(p), p > 0.0
            if k in self._some:
                self._pressures.append(p.astype(np.single))
            if not touched.any():  # a spot between the centres of the cells
                p[np.unravel_index(heights.argmax(), p.shape)] = 1.0
            sizes, singular = spots_of(p)
            columns.append((force, area, singular))
            self.sizes = np.minimum(self.sizes, (steps[k] / steps[-1]) ** EARLY * sizes)
            if self._on_part is not None:
                self._on_part((k + 1) / len(steps))
        self.force, self._area, self._singular = np.transpose(columns)
        square = sum(slope[touched] ** 2 for slope in np.gradient(heights, 1.0 / layer.n))
        self.slope = float(np.sqrt(np.mean(square))) if touched.any() else 0.0

    def left_out(self, top: Top) -> Omission:
        """What the top of a mesh leaves out; it changes little from step to step, and three of them are enough."""
        heights, some = heights_of_top(top, self._surface, self._layer.n, nodal=True), self._some
        at, steps = self.delta_star[some], self.delta_star
        mesh = self._layer.curve(heights, self._summit, at, on_part=self._on_part, starts=self._pressures)
        force = np.interp(steps, at, _change(self.force[some], mesh.P_star))
        area = np.interp(steps, at, _change(self._area[some], mesh.area_fraction))
        return Omission(steps, force, area, self._singular)


def planned_steps(steps: int) -> int:
    """Planned load steps of a run with a tolerance: the smallest multiple of those requested that gives a sound bar."""
    return steps * -(-(2 * REACH + 1) // steps)


def guide_of(problem: Problem, on_part: Callable[[float], None] | None = None, passes: float = inf) -> Guide:
    """Guide of a run with a tolerance, see `Guide`."""
    path = problem.load_path
    depth = path.delta_max or approach_of_force(problem)
    return Guide(problem, depth, planned_steps(path.steps), on_part, passes)


def half_space(problem: Problem, cells: int) -> RoughHalfSpace:
    """Half-space of a problem with so many cells per side; its pressure is limited where the solid yields."""
    solid, hardness = problem.material, inf
    if solid.yield_strength is not None:
        hardness = HARDNESS * solid.yield_strength / solid.reduced_modulus
    return RoughHalfSpace(cells, problem.height / problem.surface.L, solid.nu, problem.sides, hardness)


def approach_of_force(problem: Problem) -> float:
    """Approach at the greatest force of a load path, of a half-space [length]."""
    surface, solid, height = problem.surface, problem.material, problem.height / problem.surface.L
    wanted = problem.schedule.force_max
    assert wanted is not None
    layer = half_space(problem, CELLS[0])
    heights, summit = layer.heights(surface), surface.maximum()[2] / surface.L
    # all of the surface in contact, and the block below compressed
    deepest = summit - float(heights.min()) + wanted * height * solid.reduced_modulus / solid.E

    @cache
    def missing(delta_star: float) -> float:
        """What is missing of the force, in a power of it that a single contact makes straight."""
        found = layer.curve(heights, summit, [delta_star], tolerance=1e-2).P_star[0]
        return float(wanted ** (1.0 / SINGLE_CONTACT) - found ** (1.0 / SINGLE_CONTACT))

    lightest = 1e-6 * deepest
    if missing(lightest) <= 0.0 or missing(deepest) >= 0.0:
        return surface.L * (lightest if missing(lightest) <= 0.0 else deepest)
    return surface.L * float(brentq(missing, lightest, deepest, rtol=1e-2))


def spots_of(pressure: Floats) -> tuple[Floats, float]:
    """Sizes with which the sum of F_i/F (h_i/a_i)^2 over the spots is 1, and the part of their edges that is singular.

    A spot of half-width a and force F_i adds F_i (h/a)^2 to the error of the force and A_i/h^2 elements to the mesh,
    A_i being its area. Of all sizes h with one error, h ~ (A_i a^2/F_i)^(1/4) has the fewest elements: a spot that
    carries little may be resolved less than one that carries much.

    The pressure of a smooth top vanishes at the edge. Where a flat one ends in a sharp edge it is singular, higher than
    the mean one of the spot, and the error of the force is of first order in the element size.

    Args:
        pressure: at the cells, not negative (n, n)

    Returns:
        sizes at the cells, inf where there is no contact (n, n) [side], and the part of the edges, by the forces
    """
    n, touched = len(pressure), pressure > 0.0
    spot, count = ndimage.label(touched, np.ones((3, 3)))
    if count == 0:
        return np.full(pressure.shape, np.inf), 0.0
    inside = np.full(touched.shape, 0.5 * n) if touched.all() else ndimage.distance_transform_edt(touched)
    of, p = spot[touched] - 1, pressure[touched]
    half_width, cells, force = np.zeros(count), np.bincount(of), np.bincount(of, p)
    np.maximum.at(half_width, of, inside[touched])  # ndimage.maximum sorts the whole grid
    half_width = np.clip(half_width - 0.5, 0.5, 0.5 * n) / n
    share = force / force.sum()
    sizes = (cells / n**2 * half_width**2 / share) ** 0.25
    sizes /= np.sqrt(np.sum(share * (sizes / half_width) ** 2))
    edge = ~ndimage.binary_erosion(touched, border_value=1)[touched]
    # of a solid that flows all pressures are the mean one
    high = edge & (p > (force / cells * (1.0 + np.finfo(np.single).eps))[of])
    edges, singular = (np.bincount(of, each, count) for each in (edge, high))
    return np.append(np.inf, sizes)[spot], float(np.sum(share * singular / np.maximum(edges, 1.0)))


def _change(whole: Floats, part: Floats) -> Floats:
    """Ratio of two curves minus 1; 0 where the top of the mesh is not touched, whose mesh has no force either."""
    return np.divide(whole, part, out=np.ones(len(part)), where=part > 0.0) - 1.0
