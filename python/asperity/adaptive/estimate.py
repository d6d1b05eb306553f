# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Degrees of freedom (dofs), memory and time of a case before it is run.

The size field of the mesh says how many nodes there will be; how many seconds and bytes a dof costs was fitted to
runs of 14,000 to 78,000 dofs on one core of a small shared machine, to a factor of two.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import inf, log2
from typing import TYPE_CHECKING

import numpy as np

from asperity.adaptive.mesh_plan import (
    FIRST,
    FIRST_STEP,
    GUIDE,
    LEAST_STEP,
    STEP_ORDERS,
    STICK,
    cheapest_substeps,
    growth,
    meshes,
    planned_steps,
    size_for_strain,
    step_rule,
)
from asperity.adaptive.roughness import HARDNESS, is_rough
from asperity.errors import InputError
from asperity.mesh.block import BlockMesh
from asperity.mesh.resolution import SHARE, resolving_size
from asperity.mesh.size_field import GRADING, GUIDED, SizeField
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT, Schedule, greatest_force
from asperity.reference import RoughHalfSpace
from asperity.runtime.display import short_repr
from asperity.slope import SINGLE_CONTACT

if TYPE_CHECKING:
    from asperity.case import Case
    from asperity.surface import Surface

Size = Callable[[float, float, float], float]

# Nodes in a volume h^3: the first for equal elements, the second times mesh.growth, because a mesh cannot be graded as
# fast as a field may ask; from 15 meshes, within 15 %
NODES, NODES_OF_GROWTH = 4.5, 19.0

TYPICAL_BAR = 0.06  # relative, of the second mesh of a run driven by a tolerance
TYPICAL_STEP_BAR = {MIDPOINT: 0.005, STICK: 0.01, BACKWARD_EULER: 0.1}  # relative, of whole load steps
CELLS = 128  # along a side of the half-space that gives the approach of a force
PARTS = 24  # of its approaches, each a third beyond the one before
RESOLVED = 20  # cells in contact, from which on its force counts
LEFT_OUT = 1.0  # height of the waves that the last mesh leaves out, over the approach times the tolerance
MOST_DOFS = 1e8  # that are counted


@dataclass(frozen=True)
class Rates:
    """Cost of a dof, measured on one core of the machine named in docs/cluster.md.

    Attributes:
        mesh: seconds of meshing and set-up per dof.
        step: seconds of a load step per dof at 10,000 dofs.
        growth: exponent of the dofs in the seconds of a step.
        base: memory of a rank without a mesh [bytes].
        per_dof: memory per dof [bytes].
        finite: time of a step in finite strain over that in small strain.

    Examples:
        >>> PLASTIC.step > ELASTIC.step
        True
    """

    mesh: float
    step: float
    growth: float
    base: float
    per_dof: float
    finite: float


ELASTIC = Rates(3.6e-5, 6.6e-6, 1.03, 246e6, 1.02e3, 2.17)
PLASTIC = Rates(2.4e-5, 1.0e-5, 1.08, 245e6, 1.39e3, 1.45)


@dataclass(frozen=True)
class MeshEstimate:
    """One mesh of a run.

    Attributes:
        h_contact: element size where the surface is reached last [length].
        dofs: degrees of freedom.
        steps: load steps, those of unloadings too.
        seconds: of one core.

    Examples:
        >>> MeshEstimate(h_contact=4e-8, dofs=20_000, steps=10, seconds=8.0).dofs
        20000
    """

    h_contact: float
    dofs: int
    steps: int
    seconds: float


@dataclass(frozen=True)
class Estimate:
    """Estimated cost of a case.

    Attributes:
        levels: the meshes, the last one the finest.
        ranks: processes the memory is for.
        memory: of all ranks [bytes].
        approach: greatest one, where the load path gives a force that of a half-space [length].
        enough: whether the meshes end where the tolerance is expected to be met, not before, at accuracy.max_dofs.
        strain: the coarse mesh that compares small and finite strain, in both; empty where nothing is compared.

    Examples:
        >>> meshes = MeshEstimate(8e-8, 5_000, 10, 2.0), MeshEstimate(4e-8, 20_000, 10, 8.0)
        >>> found = Estimate(meshes, ranks=1, memory=3e8, approach=1e-8)
        >>> found.dofs, found.seconds
        (20000, 10.0)
    """

    levels: tuple[MeshEstimate, ...]
    ranks: int
    memory: float
    approach: float
    enough: bool = True
    strain: tuple[MeshEstimate, ...] = ()

    __repr__ = short_repr

    @property
    def dofs(self) -> int:
        """Dofs of the finest mesh."""
        return self.levels[-1].dofs

    @property
    def seconds(self) -> float:
        """Time of one core for everything."""
        return sum(level.seconds for level in self.strain + self.levels)


def estimate(case: Case, ranks: int = 1, surface: Surface | None = None) -> Estimate:
    """Estimate the cost of a case, without meshing or solving it.

    The approach of a load path that gives a force is that of a half-space, see `approach_of_force`.
    Of kinematics = "auto" the meshes are counted in small strain. With `accuracy.tolerance` they are those a run plans
    for a usual error of its first mesh, and finer ones where the waves that the last one leaves out take them.

    Args:
        case: the input
        ranks: that share the work
        surface: in place of that of the case

    Raises:
        InputError: the case has more than MOST_DOFS.

    Examples:
        >>> case = asp.Case.from_dict({
        ...     "surface": {"kind": "sphere", "L": 1e-6, "radius": 1e-5}, "material": {"E": 200e9, "nu": 0.3},
        ...     "loading": {"delta_max": 1e-9},
        ... })

        >>> found = estimate(case, ranks=2)
        >>> len(found.levels), 10_000 < found.dofs < 30_000
        (1, True)
    """
    surface = case.build_surface() if surface is None else surface
    rates = PLASTIC if case.material.yield_strength is not None else ELASTIC
    delta = case.loading.delta_max
    if delta is None:
        delta = approach_of_force(case, surface)
        given = {"delta_max": delta, "force_max": None, "pressure_max": None}
        case = case.model_copy(update={"loading": case.loading.model_copy(update=given)})
    levels: list[MeshEstimate] = []
    tolerance, plastic = case.accuracy.tolerance, case.material.yield_strength is not None
    flowing = plastic and tolerance is not None and is_rough(surface, delta, tolerance)
    enough, most = True, MOST_DOFS if case.accuracy.tolerance is None else min(case.accuracy.max_dofs, MOST_DOFS)
    for h, steps in _plan(case, surface):
        dofs = _given_dofs(case) or count_dofs(surface, case, h, most, flowing)
        if dofs > most:
            enough = False
            break
        levels.append(MeshEstimate(h, dofs, steps, _seconds(rates, dofs, steps, case.material.kinematics == "finite")))
    if not levels:
        key = "mesh.h_contact" if case.accuracy.tolerance is None else "accuracy.max_dofs"
        raise InputError(f"the first mesh has more than {most:g} dofs: raise {key}")
    memory = ranks * rates.base + rates.per_dof * levels[-1].dofs
    return Estimate(tuple(levels), ranks, memory, delta, enough, _strain(case, surface, rates))


def further_meshes(case: Case, found: Estimate, surface: Surface) -> list[MeshEstimate]:
    """All meshes that a run with a tolerance can add to the planned ones, up to `accuracy.max_dofs`.

    What is first touched late in the path shows only as it is pressed, and may take them. They follow one another in
    the smallest steps, which is the most that they can cost at the load steps planned; of kinematics = "auto" they are
    in finite strain.

    Args:
        case: with accuracy.tolerance
        found: its estimate
        surface: of the case
    """
    tolerance, most = case.accuracy.tolerance, min(case.accuracy.max_dofs, int(MOST_DOFS))
    assert tolerance is not None
    plastic, finite = case.material.yield_strength is not None, case.material.kinematics != "small"
    rates, last = PLASTIC if plastic else ELASTIC, found.levels[-1]
    loading = case.loading.model_copy(update={"delta_max": found.approach, "force_max": None, "pressure_max": None})
    case = case.model_copy(update={"loading": loading})
    flowing = plastic and is_rough(surface, found.approach, tolerance)
    levels: list[MeshEstimate] = []
    h, dofs = last.h_contact, last.dofs
    while dofs < most:
        h /= LEAST_STEP
        dofs = min(count_dofs(surface, case, h, most, flowing), most)
        levels.append(MeshEstimate(h, dofs, last.steps, _seconds(rates, dofs, last.steps, finite)))
    return levels


def _strain(case: Case, surface: Surface, rates: Rates) -> tuple[MeshEstimate, ...]:
    """The runs on a coarse mesh that compare small and finite strain; see `small_strain.choose_kinematics`."""
    if case.material.kinematics == "small" and not case.output.small_strain:
        return ()
    L, loading = surface.L, case.loading
    h = size_for_strain(case.mesh.h_contact / L, case.accuracy.tolerance)
    dofs, steps = count_dofs(surface, case, h * L, MOST_DOFS, for_strain=True), _steps(case, loading.steps)
    return tuple(MeshEstimate(h * L, dofs, steps, _seconds(rates, dofs, steps, finite)) for finite in (False, True))


def _steps(case: Case, planned: int, substeps: int = 1) -> int:
    """Load steps of a case, those of its unloadings too.

    Args:
        case: the input
        planned: steps of the first loading
        substeps: equal parts of each
    """
    loading, plastic = case.loading, case.material.yield_strength is not None
    integrator, sticks = loading.integrator if plastic else BACKWARD_EULER, case.contact.formulation.sticks
    schedule = Schedule(delta_max=1.0, steps=planned, integrator=integrator, substeps=substeps, sticks=sticks)
    unloading = loading.unload_steps if loading.unload else 0
    return (len(schedule.stops()) + unloading) * loading.cycles


def approach_of_force(case: Case, surface: Surface) -> float:
    """Approach at the greatest force of a case, of the half-space that `adaptive.roughness` takes too [length].

    Args:
        case: whose load path gives a force or a pressure
        surface: of the case
    """
    L, solid, loading = surface.L, case.material.solid, case.loading
    force = greatest_force(loading.force_max, loading.pressure_max, L)
    assert force is not None
    wanted = force / (L**2 * solid.reduced_modulus)
    hardness = inf if solid.yield_strength is None else HARDNESS * solid.yield_strength / solid.reduced_modulus
    layer = RoughHalfSpace(CELLS, case.block.height / L, solid.nu, case.block.sides, hardness)
    heights, summit = layer.heights(surface), surface.maximum()[2] / L
    # all of the surface in contact, and the block below compressed
    deepest = summit - float(heights.min()) + wanted * case.block.height / L * solid.reduced_modulus / solid.E
    P: list[float] = []
    delta: list[float] = []
    for d in deepest * 0.75 ** np.arange(PARTS - 1, -1, -1):
        state = layer.curve(heights, summit, [d], tolerance=1e-2)
        if state.area_fraction[0] * CELLS**2 >= RESOLVED:
            P.append(float(np.log(state.P_star[0])))
            delta.append(float(np.log(d)))
            if P[-1] >= np.log(wanted):
                break
    lighter = min(np.log(wanted) - P[0], 0.0) / SINGLE_CONTACT
    return L * float(np.exp(np.interp(np.log(wanted), P, delta) + lighter))


def _plan(case: Case, surface: Surface) -> Iterator[tuple[float, int]]:
    """Size h_contact [length] and load steps of each mesh, one after the other."""
    loading, plastic = case.loading, case.material.yield_strength is not None
    integrator, sticks = loading.integrator if plastic else BACKWARD_EULER, case.contact.formulation.sticks
    wanted = case.accuracy.tolerance
    planned = loading.steps if wanted is None else planned_steps(loading.steps)
    steps = partial(_steps, case, planned)
    if wanted is None:
        yield case.mesh.h_contact, steps()
        return
    L = case.surface.L
    left, substeps = wanted, 1
    if plastic or sticks:
        rule = step_rule(plastic, sticks, integrator)
        whole, order = TYPICAL_STEP_BAR[rule], STEP_ORDERS[rule]
        substeps = cheapest_substeps({1: np.array([whole])}, np.array([TYPICAL_BAR]), left, order)
        left = max(left - whole * substeps**-order, 0.1 * left)
    delta = loading.delta_max
    assert delta is not None
    finest = resolving_size(surface, delta, wanted * LEFT_OUT / SHARE, FIRST * GUIDE * L) / L
    sizes = list(meshes(TYPICAL_BAR, left))
    while sizes[-1] > finest:  # the waves that the last mesh leaves out take finer ones
        sizes.append(max(finest, sizes[-1] / FIRST_STEP))
    for k, h in enumerate(sizes):
        if k == 1 and (plastic or sticks):  # which measures the error of the steps, in two parts at the least
            yield from ((h * L, steps(2**n)) for n in range(max(int(log2(substeps)), 1) + 1))
        else:
            yield h * L, steps(substeps if k else 1)


def _given_dofs(case: Case) -> int:
    return 0 if case.mesh.file is None else 3 * BlockMesh.read(case.mesh.file).counts()[0]


def count_dofs(
    surface: Surface,
    case: Case,
    h_contact: float,
    most: float = inf,
    flowing: bool = False,
    for_strain: bool = False,
) -> int:
    """Dofs of a mesh of a case.

    Args:
        surface: of the case
        case: the input
        h_contact: element size [length]
        most: number from which on they are not counted
        flowing: see `mesh_plan.growth`
        for_strain: whether it is the coarse mesh that compares small and finite strain
    """
    assert case.loading.delta_max is not None
    mesh, L = case.mesh, surface.L
    adaptive = case.accuracy.tolerance is not None
    guided = adaptive and h_contact < GUIDE * L
    rate, h_max = (growth(h_contact / L, flowing and guided), None) if adaptive else (mesh.growth, mesh.h_max)
    if for_strain:
        rate, h_max = growth(GUIDE), None
    grading = GUIDED if guided else GRADING
    field = SizeField.of(
        surface, case.loading.delta_max, h_contact, growth=rate, h_max=h_max, grading=grading,
        periodic=case.block.sides == "periodic",
    )  # fmt: skip
    refinements = 0 if for_strain else mesh.refinements
    field = field.coarser(refinements)
    nodes = 8**refinements * (NODES + NODES_OF_GROWTH * field.growth)
    return round(3 * nodes * integral(field.at, case.block.height / L, most / (3 * nodes)))


def integral(size: Size, height: float, most: float = inf) -> float:
    """Integral of 1/h^3 over the block, by cubes of at most 2 h.

    Args:
        size: h at (x, y, depth), in units of L
        height: of the block [L]
        most: value beyond which it is given up
    """
    total = 0.0
    layers = max(round(8 * height), 1)
    edges = (1 / 8, 1 / 8, height / layers)
    todo = [((i + 0.5) / 8, (j + 0.5) / 8, (k + 0.5) * edges[2], edges)
            for i in range(8) for j in range(8) for k in range(layers)]  # fmt: skip
    while todo and total <= most:
        x, y, z, (a, b, c) = todo.pop()
        h = size(x, y, z)
        if max(a, b, c) <= 2.0 * h:
            total += a * b * c / h**3
            continue
        todo += [(x + sx * a / 4, y + sy * b / 4, z + sz * c / 4, (a / 2, b / 2, c / 2))
                 for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]  # fmt: skip
    return total


def _seconds(rates: Rates, dofs: int, steps: int, finite: bool) -> float:
    step = rates.step * (rates.finite if finite else 1.0)
    return rates.mesh * dofs + steps * step * dofs * (dofs / 1e4) ** (rates.growth - 1.0)
