"""The meshes of a run with a tolerance: sizes by a scale, dofs before there is a mesh, and the curves on them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from math import inf, log, prod
from operator import add
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from asperity.adaptive.limits import FIRST, GREATEST_STEP, LEAST_RATIO, LEAST_STEP, RATIO
from asperity.contact.contact_surface import gather_top
from asperity.errors import InputError
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField, size_field
from asperity.model.settings import H_MAX, MOST_GROWTH, AccuracyTarget, MeshSize
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.solve_problem import Callbacks, follow_rest, solve_problem
from asperity.runtime.parallel import on_root_bcast

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.adaptive.guide import Guide, Omission
    from asperity.mesh.block import BlockMesh, Top
    from asperity.model.problem import Problem

Size = Callable[[float, float, float], float]

DOFS_ORDER = 2.0  # dofs and time grow as scale^-2, for the contact alone is refined
GROWTH = 0.4  # growth of the element size around the contact at scale 1
# Nodes in a volume h^3 and on a part h^2 of the surface: within 13 % (rms, at most 23 %) of 29 meshes of 60 to 17,000
# nodes, whose growth is from 0.1 to 1.2
NODES, NODES_OF_SURFACE = 3.1, 7.9
# Error of the area of contact over the root of the integral of h^3 along the edges, each over the area, that of the
# half-space for the latter: 0.23 to 0.30 on 21 meshes and steps of caps and grooves that yield
OPEN = 0.27
LARGEST = 0.5 * H_MAX  # greatest edge of a box [L]: a larger one would miss small spots


def nodes_of(size: Size, height: float, most: float = inf, joined: bool = False) -> float:
    """Nodes of the block: integrals of 1/h^3 over it and of 1/h^2 over its surface, by boxes of at most 2 h.

    Args:
        size: h at (x, y, depth), in units of L
        height: of the block [L]
        most: value beyond which it is given up
        joined: whether opposite sides are, which have their nodes in common
    """
    solid = (1.0, 1.0, height)
    boxes: list[tuple[tuple[float, ...], tuple[float, ...]]] = [((0.5, 0.5, 0.5 * height), solid)]
    for k, edge in enumerate(solid):  # the faces have no thickness
        across = tuple(0.0 if i == k else e for i, e in enumerate(solid))
        ends = (0.0,) if joined and k < 2 else (0.0, edge)
        boxes += [(tuple(end if i == k else 0.5 * e for i, e in enumerate(solid)), across) for end in ends]
    total = 0.0
    while boxes and total <= most:
        centre, edges = boxes.pop()
        h = size(*centre)
        if max(edges) <= min(2.0 * h, LARGEST):
            along = [edge / h for edge in edges if edge]
            total += (NODES if len(along) == 3 else NODES_OF_SURFACE) * prod(along)
            continue
        halves = tuple(0.5 * edge for edge in edges)
        steps = product(*((-0.5 * half, 0.5 * half) if half else (0.0,) for half in halves))
        boxes += [(tuple(map(add, centre, step)), halves) for step in steps]
    return total


def dofs_of(field: SizeField, height: float, most: float = inf) -> int:
    """Dofs of a mesh of a block, whose height is in units of L; beyond `most` they are not counted."""
    return round(3 * nodes_of(field.at, height, most / 3, field.periodic))


class PlannedMesh(NamedTuple):
    """A mesh of a family: its scale, the greatest element size in the contact [length], its dofs."""

    scale: float
    h: float
    dofs: int


class MeshFamily:
    """Meshes by their scale, the element sizes over those of the guide; in one process.

    Growth and greatest size go with the root of the scale: the surroundings are refined with the contact, or they
    would keep an error that no refinement of the contact shows.

    Args:
        problem: what is pressed
        guide: half-space with all waves
        most: dofs that are allowed
        counted: whether meshes are counted by the size field and not made

    Attributes:
        block: the last mesh that was made
    """

    block: BlockMesh

    def __init__(self, problem: Problem, guide: Guide, most: float, counted: bool = False) -> None:
        self._problem, self._guide, self._most, self._counted = problem, guide, most, counted
        self._field: tuple[float, SizeField] | None = None  # the last one, for a mesh is counted before it is made

    def next(self, meshes: Sequence[PlannedMesh], finer: float | None = None) -> PlannedMesh:
        """The next mesh, or the finest that is allowed.

        Args:
            meshes: those so far; the first one leaves room for a second one
            finer: than the last one; None for the first two, which depend on no bar

        Raises:
            InputError: no error bar is possible with the dofs that are allowed
        """
        if meshes:
            last = meshes[-1]
            wanted = last.scale / finer if finer else min(FIRST, last.scale) / RATIO
            scale, dofs = self._finest(wanted, last.scale, self._most, room=True)
        else:  # the coarsest has its greatest size everywhere
            scale, dofs = self._finest(
                FIRST, H_MAX / float(self._guide.sizes.min()), self._most / LEAST_RATIO**DOFS_ORDER
            )
        small = f"a coarse mesh of this block has {dofs} dofs" if dofs > self._most else ""
        if len(meshes) == 1 and min(last.scale / scale, dofs / last.dofs) < LEAST_STEP:
            small = f"the force has no error bar: meshes of {last.dofs} and {dofs} dofs are nearly the same"
        if small:
            raise InputError(
                f"accuracy.max_dofs = {self._most:.10g} is too small, {small}: raise it, or choose the mesh by "
                "mesh.h_contact"
            )
        return PlannedMesh(scale, self.size(scale).h_contact or 0.0, dofs)

    def _finest(self, scale: float, coarsest: float, most: float, room: bool = False) -> tuple[float, int]:
        """Scale and dofs of the finest mesh that is no larger than allowed, or of the coarsest one tried.

        Args:
            scale, most: scale that is wanted, and dofs that are allowed
            coarsest: scale from which on no coarser one is tried
            room: whether the coarsest is no larger than allowed
        """
        passes = [(most, self.dofs)]
        if not self._counted:  # no mesh is made that is much too large
            passes = [(1.5 * most, self.dofs), (most, self.make)]
        for allowed, dofs_at in passes:
            dofs, order = dofs_at(scale, 4.0 * most), DOFS_ORDER
            if dofs > allowed and not room:  # the dofs of coarse meshes hardly fall: a search would try hundreds
                if (least := passes[-1][1](coarsest, inf)) > most:
                    return coarsest, least
                room = True
            while dofs > allowed and scale < coarsest:
                finer, before = scale, dofs
                scale = min(1.02 * scale * (dofs / allowed) ** (1.0 / order), coarsest)
                dofs = dofs_at(scale, 4.0 * most)
                if dofs < before:  # of a coarse mesh most elements are elsewhere than in the contact
                    order = min(max(log(before / dofs) / log(scale / finer), 1.0), DOFS_ORDER)
        return scale, dofs

    def limit(self, scale: float, dofs: int, finer: float) -> str:
        """Why no mesh must follow on one of so many dofs, so much finer or as fine as allowed; empty when one may."""
        if dofs * GREATEST_STEP**3 <= self._most:  # no mesh has more
            return ""
        here, least, more = (self.dofs(scale / step) for step in (1.0, LEAST_STEP, finer))
        if dofs * least <= self._most * here:
            return ""
        return f"the next mesh has about {dofs * more // here} dofs, accuracy.max_dofs = {self._most} allows no more"

    def size(self, scale: float) -> MeshSize:
        """Element sizes of a mesh; the greatest is H_MAX on the coarsest first mesh."""
        L, growth, part = self._problem.surface.L, min(GROWTH * scale**0.5, MOST_GROWTH), min(1.0, scale / FIRST)
        widest, most = H_MAX * part**0.5, H_MAX * part
        sizes = np.where(np.isfinite(self._guide.sizes), np.minimum(scale * self._guide.sizes, most), np.inf)
        h = float(sizes[np.isfinite(sizes)].max())
        return MeshSize(h * L, growth, widest * L, cells=sizes * L)

    def field(self, scale: float) -> SizeField:
        """Size field of a mesh."""
        if self._field is None or self._field[0] != scale:
            problem = self._problem
            field = size_field(problem.composite, self._guide.depth, self.size(scale), problem.sides)
            self._field = scale, field
        return self._field[1]

    def make(self, scale: float, most: float = inf) -> int:
        """Make the mesh of a scale, however large; its dofs, those of joined sides on both."""
        field, problem = self.field(scale), self._problem
        summit = problem.composite.maximum()[:2]
        self.block = build_block(problem.surface, problem.height, field.at, field.periodic, summit)
        return 3 * len(self.block.points)

    def dofs(self, scale: float, most: float = inf) -> int:
        """Dofs of a mesh by its size field; beyond so many they are not counted."""
        return dofs_of(self.field(scale), self._problem.height / self._problem.surface.L, most)

    def open_area(self, scale: float) -> float:
        """Greatest error of the area of contact over the area at three of the steps, before there is a mesh.

        It is that of `ContactSurface.area_of`: the edges cut facets of an area ~ h^2 at distances ~ h.
        """
        at, steps = self.field(scale).at, self._guide.edges()
        cut = ((length * sum(at(x, y, 0.0) ** 3 for x, y in places), area) for places, length, area in steps)
        return max((OPEN * squares**0.5 / area for squares, area in cut), default=0.0)

    def left_out(self, top: Top | None) -> Omission:
        """What the top of a mesh leaves out."""
        assert top is not None  # on rank 0
        return self._guide.left_out(top)


@dataclass(frozen=True)
class Level:
    """One computed curve: greatest element size in the contact [length], dofs, parts of each load step, seconds."""

    h: float
    dofs: int
    substeps: int
    seconds: float


class LevelSolver:
    """Presses one mesh after the other and keeps the account; collective.

    Args:
        problem: what to solve; its load path has the planned steps, its element sizes are not used
        guide: half-space with all waves, on rank 0, which makes the meshes
        goal: limits
        comm: communicator
        hooks: see `Callbacks`; each level has a checkpoint of its own

    Attributes:
        problem: see above
        meshes: in order
        levels: what was computed, in order
    """

    _family: MeshFamily  # on rank 0
    _rest: Callable[[ContactResult], ContactResult]  # of the load path of the last result

    def __init__(
        self, problem: Problem, guide: Guide | None, goal: AccuracyTarget, comm: MPI.Comm, hooks: Callbacks
    ) -> None:
        self.problem, self._comm, self._hooks = problem, comm, hooks
        self.meshes: list[PlannedMesh] = []
        self.levels: list[Level] = []
        if guide is not None:
            self._family = MeshFamily(problem, guide, goal.max_dofs)

    def refine(self, finer: float | None = None) -> None:
        """Make the next mesh; see `MeshFamily.next`."""
        self.meshes.append(on_root_bcast(self._comm, lambda: self._family.next(self.meshes, finer)))

    def press(self, substeps: int = 1) -> ContactResult:
        """First loading on the last mesh, each load step in so many parts; see `finish`."""
        start, mesh, comm, problem, hooks = perf_counter(), self.meshes[-1], self._comm, self.problem, self._hooks
        if hooks.checkpoint is not None:  # other limits than those of a run continued may give another size
            name = f"level-{len(self.levels) + 1}-{mesh.scale:.6g}-{substeps}"
            hooks = replace(hooks, checkpoint=hooks.checkpoint.part(name))
        parts = {1: "", 2: " with half the load steps"}.get(substeps, f" with 1/{substeps} of the load steps")
        level = f"mesh {len(self.meshes)}{parts}"
        hooks = replace(hooks, on_stage=lambda name: self._hooks.stage(f"{level}: {name}"))
        path = replace(problem.load_path, substeps=substeps)
        problem = replace(problem, load_path=path, size=replace(problem.size, h_contact=mesh.h))
        block = self._family.block if comm.rank == 0 else None
        first = problem.schedule.compared
        result = solve_problem(problem, block=block, comm=comm, hooks=hooks, checked=False, legs=first)
        self._rest = partial(follow_rest, problem, hooks=hooks)
        seconds = max(perf_counter() - start, float(result.curve.seconds.sum()))  # of a run continued too
        self.levels.append(Level(mesh.h, result.dofs, substeps, seconds))
        return self._level(result)

    def finish(self, result: ContactResult) -> ContactResult:
        """The last result of `press` with the rest of its load path, which no other mesh is compared along."""
        start, level = perf_counter(), self.levels[-1]
        result = self._rest(result)
        self.levels[-1] = replace(level, seconds=level.seconds + perf_counter() - start)
        return self._level(result)

    def _level(self, result: ContactResult) -> ContactResult:
        """Result with the gap from the mean plane of the surfaces.

        Facets that miss waves have another mean height than these; that of the summit is exact.
        """
        problem, top = self.problem, result.solver.contact_surface
        plane = problem.surface.L * top.mean(top.heights) - (problem.height + problem.rigid.mean())
        return replace(result, curve=replace(result.curve, mean_gap=result.curve.mean_gap + plane))

    def left_out(self, result: ContactResult) -> Omission:
        """What the top of the mesh of a result leaves out."""
        top = gather_top(result.solver.contact_surface, self.problem.height / self.problem.surface.L)
        return on_root_bcast(self._comm, lambda: self._family.left_out(top))

    def limit(self, finer: float = RATIO) -> str:
        """Why no mesh must follow; see `MeshFamily.limit`."""
        scale, dofs = self.meshes[-1].scale, self.levels[-1].dofs
        return on_root_bcast(self._comm, lambda: self._family.limit(scale, dofs, finer))
