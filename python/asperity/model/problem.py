"""A contact problem: all that determines the force over the approach, as plain immutable data."""

from __future__ import annotations

from dataclasses import field, fields, replace
from functools import cached_property
from typing import Annotated, Any, TypedDict, Unpack

import numpy as np
from pydantic import Field, InstanceOf

from asperity.errors import CaseWarning, InputError, ResolutionWarning, warn
from asperity.model.limits import check_force
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT, Schedule
from asperity.model.material import Material
from asperity.model.settings import (
    H_CONTACT,
    H_MAX,
    HEIGHT,
    SIDES,
    WIDEST_JOINED,
    Formulation,
    MeshSize,
    SolverOptions,
)
from asperity.runtime.declaration import Real, argument, check_shares, declared, unknown
from asperity.surface import Flat, Surface, composite
from asperity.surface.shapes import Indenter

SAME = 1e-9  # relative difference of the sides of surface and tool
SAMPLES = 257  # heights along each side by which a load is judged
_FALLS = 0.01  # slope across an edge next to the summit that makes a ridge, over the rms slope
_NEAR_FREE = 0.1  # distance of a summit from a free side that is near, over the shortest wavelength


class ProblemArguments(TypedDict, total=False):
    """A problem as flat arguments: what `Problem.of` and `solve_contact` take besides surface and material.

    One of delta_max, force_max and pressure_max must be given; None is the same as leaving an argument out.

    Attributes:
        delta_max: greatest approach from first touch [length]
        force_max: greatest force instead [force]
        pressure_max: greatest nominal pressure instead, the force over L^2 [force/length^2]
        steps, unload, unload_steps, unload_to, cycles, duration, hold, hold_steps, integrator, substeps: see `Schedule`
        height: mean height of the block [length]; default L
        sides, size, formulation, options, tool: see `Problem`
    """

    delta_max: float | None
    force_max: float | None
    pressure_max: float | None
    steps: int
    unload: bool
    unload_steps: int
    unload_to: float
    cycles: int
    duration: float
    hold: float
    hold_steps: int
    integrator: str
    substeps: int
    height: float | None
    sides: str
    size: MeshSize | None
    formulation: Formulation | None
    options: SolverOptions | None
    tool: Surface | None


@declared("", eq=False)
class Problem:
    """A block with a rough top, its material, the load path, and how it is discretised and solved.

    Examples:
        >>> from asperity.surface import Flat
        >>> problem = Problem(Flat(L=2.0), Material(E=1.0, nu=0.3), Schedule(delta_max=0.01))
        >>> problem.height, problem.schedule.delta_max
        (2.0, 0.005)

    Attributes:
        surface: the top
        material: of the block
        load_path: approaches [length] and forces [force]; a greatest pressure becomes a force, and an integrator that
            is not given that of `Material.integrator`
        block_height: mean height of the block [length]; None takes the side of the surface
        sides: "rollers" (no normal displacement), "free", or "periodic" (opposite sides joined)
        formulation: of the contact
        size: of the elements
        options: of the solver
        tool: the rigid body that is pressed on it, its heights towards the solid, on the same patch; None is the flat

    Raises:
        InputError: a value of another type or outside its range, periodic sides of surfaces that are not periodic, a
            law in UFL with settings that it cannot go with, or a tool with what is that of the flat alone
    """

    surface: Annotated[
        InstanceOf[Surface], *argument('a surface, for example asp.Surface.from_spec("sphere", L=1e-6, radius=1e-5)')
    ]
    material: Annotated[InstanceOf[Material], *argument("a material, for example asp.Material(E=200e9, nu=0.3)")]
    load_path: Annotated[InstanceOf[Schedule], *argument("a load path, for example Schedule(delta_max=0.03e-6)")]
    block_height: Annotated[Real | None, HEIGHT, Field(serialization_alias="block.height")] = None
    sides: Annotated[str, *SIDES, Field(serialization_alias="block.sides")] = "rollers"
    formulation: Annotated[
        InstanceOf[Formulation], *argument('a formulation, for example asp.Formulation("active-set")')
    ] = field(default_factory=Formulation)
    size: Annotated[InstanceOf[MeshSize], *argument("element sizes, for example asp.MeshSize(h_contact=0.04e-6)")] = (
        field(default_factory=MeshSize)
    )
    options: Annotated[InstanceOf[SolverOptions], *argument('options, for example asp.SolverOptions(linear="cg")')] = (
        field(default_factory=SolverOptions)
    )
    tool: Annotated[
        InstanceOf[Surface] | None, *argument('a surface, for example asp.Surface.from_spec("cone", L=1e-6, ...)')
    ] = None

    def __post_init__(self) -> None:
        L, path, modulus = self.surface.L, self.load_path, self.material.reduced_modulus
        Flat(L=L)  # refuses the side of a surface of the user that is not legal
        check_shares(self, L)
        check_lengths(L, self.height, path, self.size)
        check_force("pressure_max", path.pressure_max, modulus)
        force = path.force_max if path.pressure_max is None else path.pressure_max * L**2
        check_force("force_max", force, L**2 * modulus)
        path = replace(path, force_max=force, pressure_max=None, integrator=path.integrator or self.material.integrator)
        object.__setattr__(self, "load_path", path)
        object.__setattr__(self, "tool", Flat(L=L) if self.tool is None else self.tool)
        self._check_kernels()
        self._check_tool()
        if self.sides == "periodic" and not self.composite.periodic:
            one = self.rigid if self.surface.periodic else self.surface
            kind = one.kind or type(one).__name__
            raise InputError(
                f'block.sides = "periodic" needs a surface whose opposite edges agree, and this one ({kind}) does not: '
                'take block.sides = "rollers", surface.kind = "self-affine" with surface.periodic = true, or a whole '
                "period of a map (asperity import-map --level mean)"
            )

    def _check_kernels(self) -> None:
        """Refuse a law in UFL with settings that it cannot go with."""
        law, options, duration = self.material.law, self.options, self.load_path.duration
        timed = law is not None and law.declared.time
        if timed and duration is None:
            raise InputError(
                f'material.law = "{self.material.source}" takes time: give loading.duration, that of a loading [s]'
            )
        if duration is not None and not timed and self.material.has_run:
            raise InputError(
                f"loading.duration = {duration:g} needs a material.law with time: leave it out, or take "
                '"maxwell", "perzyna", or a law of yours with @asp.law(time=True)'
            )
        if law is None:
            return
        if options.kernels == "compiled":
            raise InputError(
                'solver.kernels = "compiled" cannot go with material.law, which runs on forms: leave it out'
            )
        if self.formulation.method == "nitsche":
            raise InputError(
                'contact.method = "nitsche" cannot go with material.law, since its tractions are of the compiled laws: '
                'take "active-set" or "penalty"'
            )
        if options.linear == "cg" and not self.material.symmetric:
            raise InputError(
                f'solver.linear = "cg" needs a symmetric tangent, and that of material.law = "{law.source}" is not: '
                'take "auto" or "lu"'
            )
        if law.state and self.load_path.integrator == MIDPOINT != self.material.integrator:
            raise InputError(
                f'loading.integrator = "midpoint" cannot go with material.law = "{law.source}", whose state the rule '
                "would extrapolate: leave it out, or without time declare @asp.law(..., state_is_strain=True) where "
                "the state is a sum of increments of strain"
            )

    def _check_tool(self) -> None:
        """Refuse a tool with what is that of the flat alone."""
        if self.flat:
            return
        if abs(self.rigid.L / self.surface.L - 1.0) > SAME:
            raise InputError(
                f"tool.L = {self.rigid.L:g} is not surface.L = {self.surface.L:g}: the heights of the tool are wanted "
                "on the whole patch and not beyond it, so leave tool.L out"
            )
        if self.formulation.sticks:
            raise InputError(
                f"contact.friction = {self.formulation.friction} is that of the flat, along whose plane a node slips: "
                'with [tool] set contact.friction = "none"'
            )
        if self.material.kinematics != "small" and self.formulation.method != "active-set":
            raise InputError(
                f'contact.method = "{self.formulation.method}" presses along z, and in finite strain [tool] presses '
                'along its normal: take "active-set", or material.kinematics = "small"'
            )

    def doubts(self) -> list[str]:
        """What is doubtful of the load: a flat that passes the lowest valley, or begins on an edge."""
        surface, delta = self.composite, self.load_path.delta_max
        depth = float(np.ptp(surface.grid(SAMPLES)))
        if depth <= 1e-12 * surface.L:
            return []
        found = [doubt_of_edge(self.sides, surface), doubt_of_tip(surface, self.rigid, delta or 0.0)]
        if delta is not None and delta > depth:
            found.append(
                f"loading.delta_max = {delta:g} is more than the surface's depth from peak to valley, {depth:.3g}: the "
                "compression of the whole block is a large part of the curve"
            )
        return list(filter(None, found))

    def warn_of_doubts(self) -> None:
        """Warn (CaseWarning) of a load that is doubtful, see `doubts`, and of other values that do not fit.

        Those are slopes beyond small strain (SurfaceWarning), and a greatest size that periodic sides do not allow
        (ResolutionWarning).
        """
        surface = self.composite
        if surface.rough and self.material.kinematics == "small":
            surface.check_small_slope()
        if self.sides == "periodic" and (self.size.h_max or 0.0) > WIDEST_JOINED * surface.L:
            warn(
                f"mesh.h_max = {self.size.h_max:g} is reduced to {WIDEST_JOINED * surface.L:g}: with block.sides = "
                '"periodic" elements must be narrower than half the side; give that, or leave mesh.h_max out',
                ResolutionWarning,
            )
        for text in self.doubts():
            warn(text, CaseWarning)

    @staticmethod
    def of(surface: Surface, material: Material, **given: Unpack[ProblemArguments]) -> Problem:
        """Make a problem of flat arguments, as scripts write them: see `ProblemArguments`.

        Warns as `warn_of_doubts`.

        Raises:
            InputError: a value of another type or outside its range
        """
        if strange := sorted(given.keys() - ProblemArguments.__annotations__.keys()):
            raise InputError(unknown(strange[0], "", ProblemArguments.__annotations__, place="these arguments"))
        told: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
        named = {field.name for field in fields(Schedule)} & told.keys()
        path = Schedule(**{name: told.pop(name) for name in named})
        problem = Problem(surface, material, path, told.pop("height", None), **told)
        problem.warn_of_doubts()
        return problem

    @property
    def height(self) -> float:
        """Mean height of the block [length]."""
        return self.surface.L if self.block_height is None else self.block_height

    @property
    def rigid(self) -> Surface:
        """The tool."""
        assert self.tool is not None
        return self.tool

    @property
    def flat(self) -> bool:
        """Whether the tool is a plane."""
        return isinstance(self.tool, Flat)

    @cached_property
    def composite(self) -> Surface:
        """Sum of the heights of surface and tool: where they meet, see `composite`."""
        return composite(self.surface, self.rigid)

    @property
    def path_dependent(self) -> bool:
        """Whether the force depends on the load steps, beyond the equations of each position of the flat."""
        return self.material.plastic or self.formulation.sticks

    @property
    def schedule(self) -> Schedule:
        """The load path in units of the solver: lengths in L, forces in A_0 E'.

        An elastic solid has no path to integrate; its steps are those of backward Euler.
        """
        L, path = self.surface.L, self.load_path
        return replace(
            path,
            delta_max=None if path.delta_max is None else path.delta_max / L,
            force_max=None if path.force_max is None else path.force_max / (L**2 * self.material.reduced_modulus),
            integrator=path.integrator if self.material.plastic else BACKWARD_EULER,
            sticks=self.formulation.sticks,
        )


def check_lengths(side: float, height: float, path: Schedule, size: MeshSize) -> None:
    """Refuse (InputError) an approach and element sizes that no contact of a side has [length]."""
    for thing in (path, size):
        check_shares(thing, side)
    delta_max = path.delta_max
    h, most = size.h_contact or H_CONTACT * side, size.h_max or H_MAX * side
    if h > most:
        more = "" if size.h_max else ", its default: give that as well"
        raise InputError(f"mesh.h_contact = {h:g} exceeds mesh.h_max = {most:g}{more}")
    if delta_max is not None and delta_max >= height:
        raise InputError(
            f"loading.delta_max = {delta_max:g} exceeds the block: block.height = {height:g}; about 0.03 L is usual"
        )


def doubt_of_tip(surface: Surface, tool: Surface, delta: float) -> str:
    """That a tip meets the sides of the patch at an approach [length], in a sentence; empty where it does not."""
    if not isinstance(tool, Indenter):
        return ""
    x, y, z = surface.maximum()
    along = np.linspace(0.0, surface.L, SAMPLES)
    ends = (0.0, surface.L)
    sides = [(end, along) for end in ends if end != x] + [(along, end) for end in ends if end != y]
    if all(float(np.max(surface.height(*side))) < z - delta for side in sides):
        return ""
    return (
        "the tool reaches a side of the patch, beyond which there is no more solid: press less deep, or give a larger "
        "surface.L"
    )


def doubt_of_edge(sides: str, surface: Surface) -> str:
    """How an edge of the patch spoils the first contact, in a sentence; empty where it does not.

    Rollers mirror the surface: where it falls away from the edge that the summit lies on, a ridge arises, sharper than
    any summit. Beyond a free side no solid carries a summit that is near. A periodic surface has no edge.
    """
    if sides == "periodic":
        return ""
    other = "take another surface.seed, or another window of a map"
    if sides == "free":
        if not (near := surface.edges_of_summit(_NEAR_FREE * surface.feature_size)):
            return ""
        return (
            f"the flat first touches the surface at the free side {' and '.join(near)} of the patch, beyond which no "
            f"solid carries the summit: light loads meet a softer contact than inside; {other}"
        )
    least = _FALLS * surface.rms_slope()
    falls = {edge: slope for edge, slope in surface.edges_of_summit().items() if slope > least > 0.0}
    if not falls:
        return ""
    return (
        f"the flat first touches the surface on the edge {' and '.join(falls)} of the patch, where it slopes by "
        f"{max(falls.values()):.2g}: mirrored by the rollers it has a sharp ridge there, and the exponent at light "
        f"loads is that of the ridge; {other}"
    )
