"""Settings of a computation and their defaults: contact formulation, element sizes, solver, accuracy."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from asperity.arrays import Floats
from asperity.errors import InputError
from asperity.model.limits import bounds, check
from asperity.runtime.display import show

H_CONTACT, H_MAX = 0.04, 0.25  # element sizes of a mesh when none are given [L]
WIDEST_JOINED = 0.2  # greatest size with periodic sides: elements are up to twice as wide, `shared_nodes.joined` [L]
METHODS = ("active-set", "penalty", "nitsche")  # of the contact
FACTORS = "[0.01, 100]"  # legal penalty and gamma; with larger ones points in contact come and go in turn
LINEAR_SOLVERS = ("auto", "lu", "cg")
KERNELS = ("compiled", "forms")  # of the elements
NEWTON_STEPS = "[1, 1000]"  # legal newton_max
RTOL = "(0, 0.01]"  # of the equations
GROWTH = "(0, 10]"  # of the size of the elements
MAX_DOFS = "[1000, inf)"
LEAST_PENALTY = 10.0  # factor below which the penalty leaves an error of first order (docs/accuracy.md)
FRICTION = "(0, 2]"  # Coulomb's coefficient; beyond it nearly all sticks, and the bounds do not settle
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
        check(self, "contact", method=METHODS)
        if self.method == "nitsche" and not self.gamma >= LEAST_GAMMA:
            raise InputError(
                f"contact.gamma = {self.gamma:g} is below {LEAST_GAMMA:g}, from which Nitsche's method is stable: "
                'raise it, leave it out, or take contact.method = "active-set"'
            )
        check(self, "contact", penalty=FACTORS, gamma=FACTORS)
        mu, legal = self.friction, bounds(FRICTION)
        if mu != "none" and (isinstance(mu, str) or not legal["gt"] < mu <= legal["le"]):
            raise InputError(f"contact.friction = {show(mu)} is not none or a coefficient in {FRICTION}")
        if self.sticks and self.method != "active-set":
            raise InputError(
                f'contact.friction = {show(mu)} holds nodes, which contact.method = "{self.method}" does not: take '
                'contact.method = "active-set", or contact.friction = "none"'
            )

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

    def check_bar(self) -> None:
        """Refuse (InputError) a penalty so soft that its error dominates, which no error bar covers."""
        if self.method == "penalty" and self.penalty < LEAST_PENALTY:
            raise InputError(
                f"contact.penalty = {self.penalty:g} is too soft for accuracy.tolerance, whose error bars need "
                f'{LEAST_PENALTY:g} or more: raise it, or take contact.method = "active-set"'
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

    def __post_init__(self) -> None:
        check(self, "mesh", h_contact="(0, inf)", growth=GROWTH, h_max="(0, inf)")


@dataclass(frozen=True)
class SolverOptions:
    """How the equations of a step are solved.

    Attributes:
        linear: see `linear.solver.LinearSolver`
        rtol: residual force relative to the contact force at which a step has converged
        newton_max: Newton iterations after which a step is given up
        krylov_rtol: loosest relative tolerance of the linear solver; None takes 4e-2 (benchmarks/speed.py), in finite
            strain 1e-2, and 1e-3 for a nearly incompressible solid; in (0, 1)
        kernels: "compiled", or "forms" of UFL; None takes forms for a material with a law of its own

    Raises:
        InputError: a value outside its range

    Examples:
        >>> SolverOptions(linear="lu").newton_max
        50
    """

    linear: str = "auto"
    rtol: float = 1e-8
    newton_max: int = 50
    krylov_rtol: float | None = None
    kernels: str | None = None

    def __post_init__(self) -> None:
        words = {"linear": LINEAR_SOLVERS, "kernels": KERNELS}
        check(self, "solver", rtol=RTOL, newton_max=NEWTON_STEPS, krylov_rtol="(0, 1)", **words)

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
        area_tolerance: greatest error bar of the contact area as well, relative to the area, in (0, 1); None judges
            the force only

    Raises:
        InputError: a value outside its range

    Examples:
        >>> asp.AccuracyTarget(0.01).max_dofs
        1000000
    """

    tolerance: float
    max_dofs: int = 1_000_000
    area_tolerance: float | None = None

    def __post_init__(self) -> None:
        shares = {"tolerance": "(0, 1)", "area_tolerance": "(0, 1)"}
        check(self, "accuracy", max_dofs=MAX_DOFS, **shares)
