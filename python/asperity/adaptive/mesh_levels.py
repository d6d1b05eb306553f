"""The curves of a run with a tolerance, one mesh after the other, within limits of size and time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import log
from time import perf_counter
from typing import Any

from asperity.adaptive.mesh_plan import DOFS_ORDER, growth
from asperity.errors import InputError
from asperity.mesh.block import BlockMesh
from asperity.mesh.size_field import FirstContactMap
from asperity.model.material import Material
from asperity.quasistatic.solve_contact import (
    ContactResult,
    MeshSize,
    PartialResult,
    estimate_deflection,
    make_undistorted,
    solve_contact,
)
from asperity.quasistatic.stepping import Callback
from asperity.surface import Surface


@dataclass(frozen=True)
class Goal:
    """What is asked for.

    Attributes:
        tolerance: greatest error bar of the force along the first loading, relative to the force, in (0, 1)
        max_dofs: size no mesh may exceed
        max_seconds: time after which no finer level is started; None for no limit

    Raises:
        InputError: a value outside its range
    """

    tolerance: float
    max_dofs: int = 1_000_000
    max_seconds: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.tolerance < 1.0:
            raise InputError(
                f"accuracy.tolerance = {self.tolerance!r} must lie between 0 and 1, for example 0.01 for 1 %"
            )
        if self.max_dofs < 1000:
            raise InputError(f"accuracy.max_dofs = {self.max_dofs} must be at least 1000")
        if self.max_seconds is not None and not self.max_seconds > 0:
            raise InputError(f"accuracy.max_seconds = {self.max_seconds!r} must be positive")


@dataclass(frozen=True)
class Level:
    """One computed curve: element size [length], dofs, equal parts of each load step, seconds."""

    h: float
    dofs: int
    substeps: int
    seconds: float


class Runner:
    """Solves one level after the other and keeps the account; collective.

    Args:
        surface, material: as in `statics.solve_contact`
        max_dofs: size no mesh may exceed
        settings: other arguments of `statics.solve_contact`, the steps among them
        on_stage, on_step: progress call-backs

    Attributes:
        levels: what was computed, in order
    """

    def __init__(
        self,
        surface: Surface,
        material: Material,
        max_dofs: int,
        settings: dict[str, Any],
        on_stage: Callable[[str], None] | None,
        on_step: Callback | None,
    ) -> None:
        self._surface, self._material, self._max_dofs, self._settings = surface, material, max_dofs, settings
        self._on_stage, self._on_step = on_stage, on_step
        from mpi4py import MPI

        self._comm = settings.get("comm") or MPI.COMM_WORLD
        self._start = perf_counter()
        self._reach: FirstContactMap | None = None
        self._depth: float | None = settings["delta_max"]  # that meshes are made for [length]
        self._h_max: float | None = None  # of the elements away from the contact; smaller on a surface too steep for it
        self._made: tuple[float, BlockMesh | None] | None = None  # the last mesh and its size [length]
        self._guide: ContactResult | None = None  # until the first mesh that it guides
        self.levels: list[Level] = []

    def aim(self, guide: ContactResult) -> None:
        """Make the meshes from here on for what the guide touched."""
        L = self._surface.L
        xy, touched_at = guide.first_contact.gather(guide.solver)
        self._reach = FirstContactMap(xy * L, touched_at * L) if len(xy) else None  # on rank 0, where meshes are made
        self._depth = float(guide.curve.loading().delta[-1])
        self._made, self._guide = None, guide

    def _mesh(self, h: float) -> tuple[BlockMesh | None, float]:
        """Mesh of size h [length], or the finest that the greatest number of dofs allows, and its size; collective.

        Its largest elements are small enough not to be turned inside out by the slopes, if that is possible.

        Raises:
            InputError: not even the guide is allowed
            PartialResult: nothing else is
        """
        if self._made is not None and self._made[0] == h:  # once more, in other steps
            return self._made[1], h
        comm = self._comm
        height = self._settings.get("height") or self._surface.L
        if self._depth is None:
            force, settings = self._settings["force_max"], self._settings
            of_press = {k: settings[k] for k in ("sides", "formulation", "kernels", "options") if k in settings}
            self._depth = estimate_deflection(comm, self._surface, self._material, height, force, of_press)
        while True:
            size = MeshSize(h, growth(h / self._surface.L), self._h_max, self._reach)
            block, self._h_max = make_undistorted(comm, self._surface, height, self._depth, size)
            dofs = comm.bcast(None if block is None else 3 * len(block.points), root=0)
            if dofs <= self._max_dofs:
                self._made, self._guide = (h, block), None
                return block, h
            small = (
                f"accuracy.max_dofs = {self._max_dofs} is too small, a coarse mesh of this block has {dofs} dofs: "
                "raise it, or choose the mesh by mesh.h_contact"
            )
            if not self.levels:
                raise InputError(small)
            if self._guide is not None:
                raise PartialResult(f"the force has no error bar: {small}", self._guide)
            h *= 1.02 * (dofs / self._max_dofs) ** (1.0 / DOFS_ORDER)

    def __call__(self, h: float, substeps: int = 1) -> ContactResult:
        """Curve with elements of size h [L], or of the smallest allowed, and load steps in so many parts."""
        start = perf_counter()
        L = self._surface.L
        settings = self._settings
        block, h = self._mesh(h * L)
        if settings.get("checkpoint") is not None:  # other limits than those of a run continued may give another size
            level = settings["checkpoint"].part(f"level-{len(self.levels) + 1}-{h / L:.6g}-{substeps}")
            settings = settings | {"checkpoint": level}
        result = solve_contact(
            self._surface,
            self._material,
            substeps=substeps,
            size=MeshSize(h, growth=growth(h / L)),
            block=block,
            on_stage=self._announce(f"h = {h / L:.3g} L" + (f", {substeps} substeps" if substeps > 1 else "")),
            on_step=self._on_step,
            **settings,
        )
        seconds = max(perf_counter() - start, float(result.curve.seconds.sum()))  # of a run continued too
        self.levels.append(Level(h, result.dofs, substeps, seconds))
        return result

    def _announce(self, level: str) -> Callable[[str], None] | None:
        if self._on_stage is None:
            return None
        on_stage = self._on_stage
        return lambda name: on_stage(f"{level}: {name}")

    def growth_of_dofs(self) -> float:
        """Order of the dofs in 1/h, from the last two guided meshes; no less than the usual one."""
        before, last = self.levels[-2:]
        if len(self.levels) < 3 or not last.h < before.h:
            return DOFS_ORDER
        return max(DOFS_ORDER, log(last.dofs / before.dofs) / log(before.h / last.h))

    def limit(self, goal: Goal, size: float, finer: float, substeps: int) -> str:
        """Why the next level must not be computed; empty when it may; collective, by the clock of rank 0.

        Args:
            goal: with the limits
            size, finer: elements of the last level and of the next [L]
            substeps: of the next level
        """
        reason = self._limit(goal, size / finer, substeps)
        return str(self._comm.bcast(reason, root=0))

    def _limit(self, goal: Goal, refinement: float, substeps: int) -> str:
        last = self.levels[-1]
        order = self.growth_of_dofs()
        dofs = int(last.dofs * refinement**order)
        if dofs > goal.max_dofs:
            return f"the next mesh has about {dofs} dofs, accuracy.max_dofs = {goal.max_dofs} allows no more"
        elapsed = max(perf_counter() - self._start, sum(level.seconds for level in self.levels))
        needed = last.seconds * substeps / last.substeps * refinement ** (1.2 * order)
        if goal.max_seconds is not None and elapsed + needed > goal.max_seconds:
            return (
                f"the next mesh takes about {needed:.0f} s after the {elapsed:.0f} s so far, accuracy.max_seconds = "
                f"{goal.max_seconds:g} allows no more"
            )
        return ""
