"""A half-space with all waves of the surface: where meshes need small elements, what tops leave out, which strain.

The force on a mesh differs from the true one because its top is not the surface, and because its elements are stiff.
These errors may have opposite signs, and two meshes then agree by chance. A half-space tells them apart: pressed with
the top of the mesh instead of the surface, it shows the first one alone. A force corrected for it has one error of one
sign and one order. The slope of the spots in contact tells what small strain changes in the force.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import ndimage
from scipy.special import ellipkm1

from asperity.arrays import Array, Flags, Floats
from asperity.curve.slope import SINGLE_CONTACT
from asperity.mesh.block import Top, heights_of_top
from asperity.mesh.resolution import ONE_MESH
from asperity.model.material import AUTO
from asperity.quasistatic.newton import illinois
from asperity.reference.halfspace import HARDNESS, SINGLE, RoughHalfSpace, cells_per_side
from asperity.runtime.parallel import on_root_bcast

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.model.problem import Problem

CELLS = 128, 720  # fewest and most per side
PER_SIZE = 2.3  # cells per element of a mesh of scale 1 with the same elements everywhere
REACH = 2  # steps to either side that support the bar of a step: two meshes agree by chance at one approach
CLOSE, TRIALS = 1e-3, 40  # relative, of a force whose approach is sought; and half-spaces that are pressed to find it
EARLY = 0.25  # power of the approach in the sizes: the first spots are the least of a mesh and have its largest errors
SHARE = 1.0 / 3.0  # of the tolerance that small strain may change, ONE_MESH without one
# Change over the rms slope of the spots, and over its square in a solid that yields: no scene of
# tests/adaptive/test_small_strain.py, pressed both ways, has more
ELASTIC, YIELDING = 0.11, 5.0


@dataclass(frozen=True)
class Omission:
    """What a half-space shows of the top of a mesh, at ascending approaches.

    Attributes:
        delta_star: approaches (k,) [L]
        force: force on the surface over that on the top of the mesh, minus 1 (k,)
        area: the same of the area of contact (k,)
        singular: part of the edges of the spots with a singular pressure, by their forces (k,), see `spots_of`
        sharp: the same by their lengths (k,)
    """

    delta_star: Floats
    force: Floats
    area: Floats
    singular: Floats
    sharp: Floats

    def at(self, delta_star: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Changes of force and area, and both singular parts, at other approaches."""
        columns = self.force, self.area, self.singular, self.sharp
        of_force, of_area, singular, sharp = (np.interp(delta_star, self.delta_star, values) for values in columns)
        return of_force, of_area, singular, sharp


class Guide:
    """Half-space with all waves of the surface of a problem, in one process.

    Each step has a grid of its own, as fine as its spots take: the first ones are the smallest.

    Args:
        problem: what is pressed
        depth: greatest approach [length]
        steps: planned load steps

    Attributes:
        depth: greatest approach [length]
        delta_star: approaches at which it is pressed, those of the steps (k,) [L]
        force: mean pressures there over E' (k,)
        sizes: of elements of scale 1 at the cells of a grid, inf where the surface is not touched (n, n) [L]
        slope: rms slope of the spots in contact at the greatest approach, 0 of a summit between the centres of cells
    """

    def __init__(self, problem: Problem, depth: float, steps: int) -> None:
        self.depth, self._problem, L = depth, problem, problem.surface.L
        self._summit = problem.composite.maximum()[2] / L
        self.delta_star = depth / L * np.linspace(1.0 / steps, 1.0, steps)
        self.sizes = np.full((1, 1), inf)
        self._heights: dict[int, Floats] = {}  # by the cells per side
        self._pressed: dict[int, tuple[RoughHalfSpace, Array]] = {}  # at some steps
        columns, p = [], np.asarray(np.zeros((1, 1)))
        for k in range(steps):
            delta = float(self.delta_star[k])
            layer, p, sizes, *singular = self._press(delta, p)
            n = max(layer.n, len(self.sizes))
            early = (delta / self.delta_star[-1]) ** EARLY
            self.sizes = np.minimum(on_grid(self.sizes, n), early * on_grid(sizes, n))
            columns.append((float(p.mean()), layer.area(p), *singular))
            if k in (0, steps // 2, steps - 1):
                self._pressed[k] = layer, p.astype(np.single)
        self.force, self._area, *self._singular = np.transpose(columns)
        square, touched = sum(slope**2 for slope in np.gradient(self._heights[layer.n], 1.0 / layer.n)), p > 0.0
        self.slope = float(np.sqrt(np.mean(square[touched]))) if touched.any() else 0.0
        self._heights.clear()

    def _press(self, delta: float, p: Floats) -> tuple[RoughHalfSpace, Floats, Floats, float, float]:
        """Half-space and pressure at an approach, and what `spots_of` says of it.

        Args:
            delta: approach [L]
            p: pressure to begin with, on any grid
        """
        cells, n = float(CELLS[0]), 0
        while n < (wanted := min(cells, CELLS[1])):
            layer = half_space(self._problem, cells_per_side(wanted))
            n = layer.n
            if n not in self._heights:
                self._heights[n] = layer.heights(self._problem.composite)
            (p,) = layer.pressures(self._heights[n], self._summit, [delta], SINGLE, [on_grid(p, n)])
            spot = p
            if not p.any():  # a spot between the centres of the cells
                spot = np.zeros_like(p)
                spot[np.unravel_index(self._heights[n].argmax(), p.shape)] = 1.0
            sizes, even, singular, sharp = spots_of(spot, layer.hardness)
            cells = PER_SIZE / even
        return layer, p, sizes, singular, sharp

    def edges(self) -> list[tuple[Floats, float, float]]:
        """Edges of the spots at three steps: places (m, 2), the length of each and the area of the spots [L, L^2]."""
        found = []
        for k, (layer, p) in self._pressed.items():
            row, column = np.nonzero(edge_of(p > 0.0))
            if len(row):
                found.append(((np.stack([column, row], axis=-1) + 0.5) / layer.n, 1.0 / layer.n, self._area[k]))
        return found

    def left_out(self, top: Top) -> Omission:
        """What the top of a mesh leaves out; it changes little from step to step, and three of them are enough."""
        at, parts, heights = self.delta_star, [], {}
        for k, (layer, start) in self._pressed.items():
            if layer.n not in heights:
                heights[layer.n] = heights_of_top(
                    top, self._problem.surface, layer.n, nodal=True, tool=self._problem.rigid
                )
            (p,) = layer.pressures(heights[layer.n], self._summit, at[[k]], SINGLE, [start])
            parts.append((_change(self.force[k], float(p.mean())), _change(self._area[k], layer.area(p))))
        force, area = (np.interp(at, at[[*self._pressed]], part) for part in np.transpose(parts))
        return Omission(at, force, area, *self._singular)


def on_grid(values: Floats, n: int) -> Floats:
    """Values of cells at those of another grid (n, n), each of the cell that holds its centre."""
    near = ((np.arange(n) + 0.5) * len(values) / n).astype(int)
    return values[np.ix_(near, near)]


def planned_steps(steps: int) -> int:
    """Planned load steps of a run with a tolerance: the smallest multiple of those requested that gives a sound bar."""
    return steps * -(-(2 * REACH + 1) // steps)


def guide_of(problem: Problem) -> Guide:
    """Guide of a run with a tolerance, see `Guide`."""
    path = problem.load_path
    return Guide(problem, path.delta_max or approach_of_force(problem), planned_steps(path.steps))


def half_space(problem: Problem, cells: int) -> RoughHalfSpace:
    """Half-space of a problem with so many cells per side; its pressure is limited where the solid yields."""
    solid, hardness = problem.material, inf
    if solid.yield_strength is not None:
        hardness = HARDNESS * solid.yield_strength / solid.reduced_modulus
    return RoughHalfSpace(cells, problem.height / problem.surface.L, solid.nu, problem.sides, hardness)


def approach_of_force(problem: Problem) -> float:
    """Approach at the greatest force of a load path, of a half-space [length]."""
    surface, solid, height = problem.composite, problem.material, problem.height / problem.surface.L
    wanted = problem.schedule.force_max
    assert wanted is not None
    layer = half_space(problem, CELLS[0])
    heights, summit = layer.heights(surface), surface.maximum()[2] / surface.L
    # all of the surface in contact, and the block below compressed
    deepest = summit - float(heights.min()) + wanted * height * solid.reduced_modulus / solid.E

    def beyond(delta_star: float) -> float:
        """Force less the wanted one, in a power of it that a single contact makes straight."""
        found = layer.curve(heights, summit, [delta_star], tolerance=1e-2).P_star[0]
        return float((found / wanted) ** (1.0 / SINGLE_CONTACT) - 1.0)

    low, high = ((at, beyond(at)) for at in (1e-6 * deepest, deepest))
    if low[1] >= 0.0 or high[1] <= 0.0:
        return surface.L * (low if low[1] >= 0.0 else high)[0]
    return surface.L * illinois(beyond, low, high, CLOSE, TRIALS)


def edge_of(touched: Flags) -> Flags:
    """Cells at the edge of the contact (n, n); the border of the patch is none."""
    return np.asarray(touched & ~ndimage.binary_erosion(touched, border_value=1))


def spots_of(pressure: Floats, hardness: float = inf) -> tuple[Floats, float, float, float]:
    """Sizes with which the sum of w_i F_i/F (h_i/a_i)^2 over the spots is 1, and the part of edges that is singular.

    A spot of half-width a and force F_i adds w_i F_i (h/a)^2 to the error of the force, w_i being `own_part`, and
    A_i/h^2 elements to the mesh, A_i being its area. Of all sizes h with one error, h ~ (A_i a^2/(w_i F_i))^(1/4) has
    the fewest elements: a spot that carries little, and a long one, may be resolved less.

    The pressure of a smooth top vanishes at the edge. Where a flat one ends in a sharp edge it is singular, higher than
    the mean one of the spot, and the error of the force is of first order in the element size. Where the solid flows
    the pressure is the greatest one up to the edge of any top, and not singular.

    Args:
        pressure: at the cells, not negative (n, n)
        hardness: greatest pressure

    Returns:
        sizes at the cells, inf where there is no contact (n, n) [side], the same size everywhere that has this error
        [side], and the part of the edges, by the forces and by their lengths
    """
    n, touched = len(pressure), pressure > 0.0
    spot, count = ndimage.label(touched, np.ones((3, 3)))
    if count == 0:
        return np.full(pressure.shape, np.inf), inf, 0.0, 0.0
    inside = np.full(touched.shape, 0.5 * n) if touched.all() else ndimage.distance_transform_edt(touched)
    of, p = spot[touched] - 1, pressure[touched]
    half_width, cells, force = np.zeros(count), np.bincount(of), np.bincount(of, p)
    np.maximum.at(half_width, of, inside[touched])  # ndimage.maximum sorts the whole grid
    half_width = np.clip(half_width - 0.5, 0.5, 0.5 * n) / n
    share = force / force.sum()
    weight = share * own_part(touched, of, cells)
    sizes = (cells / n**2 * half_width**2 / weight) ** 0.25
    sizes /= np.sqrt(np.sum(weight * (sizes / half_width) ** 2))
    even = float(np.sum(weight / half_width**2) ** -0.5)
    edge = edge_of(touched)[touched]
    flows = p > hardness * (1.0 - 1e-6)  # which single precision rounds
    high = edge & (p > (force / cells)[of]) & ~flows
    edges, singular = (np.bincount(of, each, count) for each in (edge, high))
    part = float(np.sum(share * singular / np.maximum(edges, 1.0)))
    return np.append(np.inf, sizes)[spot], even, part, float(singular.sum() / max(edges.sum(), 1.0))


def own_part(touched: Flags, of: Array, cells: Array) -> Floats:
    """Part of the approach of each spot that is of a circle of its half-width: 1 of a round one, less of a long one.

    The rest is of the length alone, whatever the elements are. An elliptical contact has pi/(2 K), K being the complete
    elliptic integral of 1 - (a/b)^2 (Johnson, Contact Mechanics, 1985, section 4.2), and the second moments have a/b.

    Args:
        touched: cells in contact (n, n)
        of: number of the spot of each of them (m,)
        cells: number of cells of each spot (k,)
    """
    x, y = (np.asarray(where, dtype=float) for where in np.nonzero(touched))
    x, y = (where - (np.bincount(of, where) / cells)[of] for where in (x, y))
    xx, yy, xy = (
        np.bincount(of, product) / cells + cell for product, cell in ((x * x, 1 / 12), (y * y, 1 / 12), (x * y, 0.0))
    )
    mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    return np.asarray(0.5 * np.pi / ellipkm1((mean - half) / (mean + half)))


def _change(whole: float, part: float) -> float:
    """Ratio minus 1; 0 where the top of the mesh is not touched, whose mesh has no force either."""
    return whole / part - 1.0 if part > 0.0 else 0.0


@dataclass(frozen=True)
class SmallStrain:
    """Estimate of what small strain changes in the force.

    Attributes:
        kinematics: chosen, "small" or "finite"
        slope: rms slope of the spots in contact under the greatest load
        percent: greatest change of the force [per cent]
        limit: greatest one with which small strain is chosen [per cent]
    """

    kinematics: str
    slope: float
    percent: float
    limit: float

    def describe(self) -> str:
        """One line for the log."""
        return (
            f"kinematics = {self.kinematics}: small strain changes the force by up to {self.percent:.2g} %, the limit "
            f"is {self.limit:.2g} %"
        )

    def to_dict(self) -> dict[str, Any]:
        """Section model.small_strain of summary.json."""
        return {"greatest_percent": self.percent, "limit_percent": self.limit, "slope": self.slope}


def choose_kinematics(
    problem: Problem, tolerance: float | None = None, comm: MPI.Comm | None = None, guide: Guide | None = None
) -> tuple[Problem, SmallStrain | None]:
    """The problem with small or finite strain, and what small strain changes in its force; collective.

    Of kinematics = "auto", small strain is chosen where it changes the force by less than a third of the tolerance, 5 %
    without one; another choice is kept, and nothing is estimated.

    Args:
        problem: with any material.kinematics
        tolerance: relative, of the force
        comm: communicator; default all ranks
        guide: half-space of the problem on rank 0, where there is one

    Examples:
        >>> from asperity.surface import Flat
        >>> rubber = asp.Material(E=1.0, nu=0.3, kinematics="auto")
        >>> for delta in (0.001, 0.1):
        ...     chosen, found = choose_kinematics(asp.Problem.of(Flat(L=1.0), rubber, delta_max=delta))
        ...     print(chosen.material.kinematics, round(found.percent, 2))
        small 0.15
        finite 15.0
    """
    from mpi4py import MPI

    if problem.material.kinematics != AUTO:
        return problem, None
    found = on_root_bcast(MPI.COMM_WORLD if comm is None else comm, lambda: small_strain(problem, tolerance, guide))
    return replace(problem, material=replace(problem.material, kinematics=found.kinematics)), found


def small_strain(problem: Problem, tolerance: float | None, guide: Guide | None = None) -> SmallStrain:
    """The choice of `choose_kinematics`, in one process; it errs towards finite strain, which is right in any case."""
    solid = problem.material
    guide = guide or Guide(problem, problem.load_path.delta_max or approach_of_force(problem), steps=1)
    load, slope = float(guide.force[-1]) * solid.reduced_modulus, guide.slope
    strain = load / solid.block_modulus(problem.sides)
    if load >= solid.yield_pressure(problem.sides):  # the block flows as a whole
        strain = guide.depth / problem.height
    # of a block as a whole the stress is ln(1 - e)/(1 - e) for -e, to first order
    change = 1.5 * strain + ELASTIC * slope + (YIELDING * slope**2 if solid.plastic else 0.0)
    limit = SHARE * (ONE_MESH if tolerance is None else tolerance)
    return SmallStrain("small" if change <= limit else "finite", slope, 100.0 * change, 100.0 * limit)
