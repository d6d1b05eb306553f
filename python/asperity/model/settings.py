"""Settings of a computation and their defaults: contact formulation, element sizes, solver, accuracy."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import Any

from asperity.arrays import Floats
from asperity.errors import InputError
from asperity.model.argument_checks import Judgement, check_kinds, refuse
from asperity.runtime.display import show

H_CONTACT, H_MAX = 0.04, 0.25  # element sizes of a mesh when none are given [L]
MOST_REFINEMENTS = 6  # of a mesh: each makes eight elements of one
WIDEST_JOINED = 0.2  # greatest size with periodic sides: elements are up to twice as wide, see `periodic.joined` [L]
METHODS = ("active-set", "penalty", "nitsche")  # of the contact
FACTORS = (0.01, 1e4)  # legal penalty and gamma; larger ones lose the balance of forces in rounding
LINEAR_SOLVERS = ("auto", "lu", "cg", "gamg")
KERNELS = ("compiled", "forms")  # of the elements
NEWTON_STEPS = (1, 1000)  # legal newton_max
LOOSEST_RTOL = 1e-2  # of the equations
FASTEST_GROWTH = 10.0  # of the size of the elements
LEAST_DOFS = 1000  # as a limit of the dofs
LEAST_PENALTY = 10.0  # factor below which the penalty leaves an error of first order (docs/accuracy.md)
LARGEST_FRICTION = 2.0  # Coulomb's coefficient; beyond it nearly all sticks, and the bounds do not settle
LEAST_GAMMA = 0.75  # from which Nitsche's method is coercive: 1/2 where cells are straight, 0.73 seen under rough tops


@dataclass(frozen=True)
class Formulation:
    """Contact formulation and its parameters, see docs/theory.md.

    Attributes:
        method: "active-set", "penalty" or "nitsche"
        penalty: factor of E p^2/h of the penalty method
        gamma: factor of (lambda + 2 mu) p^2/h of Nitsche's method
        friction: "none", or Coulomb's coefficient of a rigid flat, for the active set

    Raises:
        InputError: a value outside its range, or friction without the active set

    Examples:
        >>> asp.Formulation().method, asp.Formulation("nitsche").gamma
        ('active-set', 1.0)
        >>> asp.Formulation(friction=0.3).sticks
        True
    """

    method: str = "active-set"
    penalty: float = 10.0
    gamma: float = 1.0
    friction: str | float = "none"

    def __post_init__(self) -> None:
        check_kinds(self, "contact", method=METHODS)
        if self.method == "nitsche":
            refuse(gamma_too_small(self.gamma))
        check_kinds(self, "contact", penalty=FACTORS, gamma=FACTORS)
        refuse(wrong_friction(self.method, self.friction))

    def build(self, solid: Any, surface: Any) -> Any:
        """Contact of an own formulation, `asperity.contact.Contact`; None for the three that come along.

        Args:
            solid: `asperity.fem.solid.Solid`, in units of L and E
            surface: its top, `asperity.contact.contact_surface.ContactSurface`
        """

    @property
    def sticks(self) -> bool:
        """Whether points in contact may stick to the flat; the force then depends on the path, elastic or not."""
        return self.friction != "none"


def wrong_friction(method: str, friction: str | float) -> Judgement:
    """Reason why a friction is refused with a method of the contact."""
    known = friction == "none" if isinstance(friction, str) else 0.0 < friction <= LARGEST_FRICTION
    if not known:
        return "contact.friction", f"= {show(friction)} is not none or a coefficient in (0, {LARGEST_FRICTION:g}]"
    if friction == "none" or method == "active-set":
        return None
    return "contact.friction", (
        f'= {show(friction)} holds nodes, which contact.method = "{method}" does not: take '
        'contact.method = "active-set", or contact.friction = "none"'
    )


def penalty_too_soft(method: str, penalty: float) -> Judgement:
    """Reason why a formulation has no error bar: a penalty so soft that its error dominates."""
    if method != "penalty" or penalty >= LEAST_PENALTY:
        return None
    return "contact.penalty", (
        f"= {penalty:g} is too soft for accuracy.tolerance, whose error bars need {LEAST_PENALTY:g} or "
        'more: raise it, or take contact.method = "active-set"'
    )


def gamma_too_small(gamma: float) -> Judgement:
    """Reason why a factor of (lambda + 2 mu) p^2/h of Nitsche's method is refused: an indefinite tangent."""
    if gamma >= LEAST_GAMMA:
        return None
    return "contact.gamma", (
        f"= {gamma:g} is below {LEAST_GAMMA:g}, from which Nitsche's method is stable: "
        'raise it, leave it out, or take contact.method = "active-set"'
    )


@dataclass(frozen=True)
class MeshSize:
    """Element sizes of the block [length], see `mesh.size_field.SizeField`.

    Attributes:
        h_contact: where the surface is touched; None takes H_CONTACT of the side
        growth: of the size per unit of distance from there
        h_max: greatest size; None takes H_MAX of the side; WIDEST_JOINED of it at most with periodic sides
        cells: sizes at the cells of a regular grid on the patch, inf where none is wanted (n, n), index [iy, ix]; None
            takes h_contact, and less at the summit
        refinements: number n of times the ranks split each element of a mesh of 2^n times these sizes into eight, at
            most MOST_REFINEMENTS

    Raises:
        InputError: a value outside its range

    Examples:
        >>> size = asp.MeshSize(h_contact=0.02e-6, h_max=0.2e-6)
        >>> size.growth
        0.25
    """

    h_contact: float | None = None
    growth: float = 0.25
    h_max: float | None = None
    cells: Floats | None = field(default=None, compare=False)
    refinements: int = 0

    def __post_init__(self) -> None:
        if self.refinements not in range(MOST_REFINEMENTS + 1):
            raise InputError(
                f"mesh.refinements = {self.refinements!r} must be a whole number from 0 to {MOST_REFINEMENTS}: each "
                "makes eight elements of one"
            )
        check_kinds(self, "mesh")
        for name, most in (("h_contact", inf), ("growth", FASTEST_GROWTH), ("h_max", inf)):
            value = getattr(self, name)
            if value is not None and not 0.0 < value <= most:
                raise InputError(
                    f"mesh.{name} = {value!r} must be positive" + (f", at most {most:g}" if most < inf else "")
                )


@dataclass(frozen=True)
class SolverOptions:
    """How the equations of a step are solved.

    Attributes:
        linear: see `linear.solver.LinearSolver`
        rtol: residual force relative to the contact force at which a step has converged
        newton_max: Newton iterations after which a step is given up
        krylov_rtol: loosest relative tolerance of the linear solver; None takes 1e-2, 3e-2 where the solid is linear
            and the contact exact (benchmarks/linear.py), and 1e-3 for a nearly incompressible solid; in (0, 1)
        kernels: "compiled", or "forms" of UFL; None takes forms for a material with a law of its own

    Raises:
        InputError: a value outside its range

    Examples:
        >>> SolverOptions(linear="lu").newton_max
        30
    """

    linear: str = "auto"
    rtol: float = 1e-8
    newton_max: int = 30
    krylov_rtol: float | None = None
    kernels: str | None = None

    def __post_init__(self) -> None:
        check_kinds(self, "solver", linear=LINEAR_SOLVERS, newton_max=NEWTON_STEPS)
        if self.kernels not in (None, *KERNELS):
            raise InputError(f'solver.kernels = "{self.kernels}" is not one of {", ".join(KERNELS)}')
        if not 0.0 < self.rtol <= LOOSEST_RTOL:
            raise InputError(f"solver.rtol = {self.rtol!r} must lie in (0, {LOOSEST_RTOL:g}]")
        if self.krylov_rtol is not None and not 0.0 < self.krylov_rtol < 1.0:
            raise InputError(f"krylov_rtol = {self.krylov_rtol!r} must lie between 0 and 1, for example 1e-3")

    @property
    def forms(self) -> bool:
        """Whether the kernels are forms whatever the material is."""
        return self.kernels == "forms"


@dataclass(frozen=True)
class AccuracyTarget:
    """Tolerance of the force, and limits of what it may cost.

    Attributes:
        tolerance: greatest error bar of the force along the first loading, relative to the force, in (0, 1)
        max_dofs: size no mesh may exceed
        max_seconds: time after which no finer mesh is started; None for no limit
        area_tolerance: greatest error bar of the contact area as well, relative to the area, in (0, 1); None judges
            the force only

    Raises:
        InputError: a value outside its range

    Examples:
        >>> asp.AccuracyTarget(0.01, max_seconds=600.0).max_dofs
        1000000
    """

    tolerance: float
    max_dofs: int = 1_000_000
    max_seconds: float | None = None
    area_tolerance: float | None = None

    def __post_init__(self) -> None:
        check_kinds(self, "accuracy", max_dofs=(LEAST_DOFS, inf))
        for name in ("tolerance", "area_tolerance"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < 1.0:
                raise InputError(f"accuracy.{name} = {value!r} must lie between 0 and 1, for example 0.01 for 1 %")
        if self.max_seconds is not None and not self.max_seconds > 0:
            raise InputError(f"accuracy.max_seconds = {self.max_seconds!r} must be positive")
