"""Settings of a computation: block, contact formulation, element sizes, solver, accuracy, files."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, Any

import numpy as np
from pydantic import Field, InstanceOf

from asperity.errors import InputError
from asperity.runtime.declaration import LENGTH, SCRIPT, Choices, Flag, Real, Text, Whole, argument, declared, key
from asperity.runtime.display import show

H_CONTACT, H_MAX = 0.04, 0.25  # element sizes of a mesh when none are given [L]
MOST_GROWTH = 10  # of the element size, per unit distance
WIDEST_JOINED = 0.2  # greatest size with periodic sides: elements are up to twice as wide, `shared_nodes.joined` [L]
LEAST_PENALTY = 10.0  # factor below which the penalty leaves an error of first order (docs/accuracy.md)
LEAST_GAMMA = 0.75  # from which Nitsche's method is coercive: 1/2 where cells are straight, 0.73 seen under rough tops

HEIGHT = key("height of the block", unit=LENGTH, shown="L", hint="about L", share=(1e-3, 1e2))
SIDES = (Choices("rollers", "free", "periodic"), key("side faces: no normal motion, free, or opposite ones joined"))
# with larger factors points in contact come and go in turn
Factor = Annotated[Real, Field(ge=0.01, le=100)]
# beyond this coefficient nearly all sticks, and the bounds do not settle
Friction = Annotated[Real, Field(gt=0, le=2)]
Error = Annotated[Real, Field(ge=1e-6, lt=1)]


@declared("block")
class Block:
    """The solid below the surface."""

    height: Annotated[Real, HEIGHT] = None  # type: ignore[assignment]
    sides: Annotated[str, *SIDES] = "rollers"


@declared("contact")
class Formulation:
    """Contact formulation, see docs/theory.md.

    Examples:
        >>> asp.Formulation().method, asp.Formulation("nitsche").gamma
        ('active-set', 1.0)
        >>> asp.Formulation(friction=0.3).sticks
        True
    """

    method: Annotated[str, Choices("active-set", "penalty", "nitsche")] = key("formulation", default="active-set")
    penalty: Factor = key("factor of E p^2/h (penalty)", default=10.0)
    gamma: Factor = key("factor of (lambda + 2 mu) p^2/h (nitsche)", default=1.0)
    friction: Annotated[str, Choices("none")] | Friction = key(
        "Coulomb's coefficient of the solid on the rigid flat (active-set)", default="none"
    )

    def __post_init__(self) -> None:
        if self.method == "nitsche" and not self.gamma >= LEAST_GAMMA:
            raise InputError(
                f"contact.gamma = {self.gamma:g} is below {LEAST_GAMMA:g}, from which Nitsche's method is stable: "
                'raise it, leave it out, or take contact.method = "active-set"'
            )
        if self.sticks and self.method != "active-set":
            raise InputError(
                f'contact.friction = {show(self.friction)} holds nodes, which contact.method = "{self.method}" does '
                'not: take contact.method = "active-set", or contact.friction = "none"'
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


@declared("mesh")
class MeshSize:
    """Element sizes of the block, see `mesh.size_field.SizeField`.

    Attributes:
        cells: sizes at the cells of a regular grid on the patch, inf where none is wanted (n, n), index [iy, ix]; None
            takes h_contact, and less at the summit [length]

    Examples:
        >>> size = asp.MeshSize(h_contact=0.02e-6, h_max=0.2e-6)
        >>> size.growth
        0.25
    """

    h_contact: Real | None = key(
        "size at the surface where it is reached last", LENGTH, default=None, shown="0.04 L", share=(1e-5, 1.0)
    )
    growth: Real = key("increase of size per unit distance", default=0.25, gt=0, le=MOST_GROWTH)
    h_max: Real | None = key(
        "largest size", LENGTH, default=None, shown="0.25 L, less where slopes need it", share=(1e-5, 1e3)
    )
    cells: Annotated[InstanceOf[np.ndarray] | None, *argument("an array of sizes (n, n)")] = field(
        default=None, compare=False
    )


@declared("mesh")
class Mesh(MeshSize):
    """Element sizes, or a saved mesh."""

    file: Text | None = key("a saved mesh instead", default=None)

    @property
    def size(self) -> MeshSize:
        """Element sizes of a mesh that is not saved."""
        return MeshSize(self.h_contact, self.growth, self.h_max)


@declared("solver")
class SolverOptions:
    """Solution of the equations of a step.

    Attributes:
        krylov_rtol: loosest relative tolerance of the linear solver; None takes 4e-2 (benchmarks/speed.py), in finite
            strain 1e-2, and 1e-3 for a nearly incompressible solid

    Examples:
        >>> SolverOptions(linear="lu").newton_max
        50
    """

    linear: Annotated[str, Choices("auto", "lu", "cg")] = key(
        "linear solver: direct, or CG with p-multigrid", default="auto"
    )
    rtol: Real = key("residual at convergence over the contact force", default=1e-8, gt=0, le=0.01)
    newton_max: Whole = key("Newton steps before cutback", default=50, ge=1, le=1000)
    krylov_rtol: Annotated[Real | None, *SCRIPT, Field(gt=0, lt=1)] = None
    kernels: Annotated[str, Choices("compiled", "forms")] | None = key(
        "of the elements: compiled, or forms of UFL",
        default=None,
        shown='"forms" with material.law, otherwise "compiled"',
    )

    @property
    def forms(self) -> bool:
        """Whether the kernels are forms whatever the material is."""
        return self.kernels == "forms"


@declared("accuracy")
class AccuracyTarget:
    """Error control; without a tolerance one mesh of size h_contact is used.

    Examples:
        >>> asp.AccuracyTarget(0.01).max_dofs
        1000000
    """

    # only a case may leave the tolerance out, see `adaptive.solve_contact`
    tolerance: Error = key(
        "error bar of the force over the force", default=None, shown="one mesh", hint="0.01 for one per cent"
    )
    max_dofs: Whole = key("limit of the dofs", default=1_000_000, ge=1000)
    area_tolerance: Error | None = key(
        "error bar of the contact area over the area as well",
        default=None,
        shown="not judged",
        hint="0.05 for five per cent, with accuracy.tolerance",
    )


@declared("output")
class Output:
    """Files in addition to the curve and the summary."""

    figures: Flag = key("figures/*.svg, and *.png of those with fields", default=False)
    fields: Flag = key("fields/ for ParaView", default=False)
    report: Flag = key("report.html", default=False)
    stiffness: Flag = key(
        "columns k_n_elastic to conductance (also with [slip]), for more time a load step",
        default=False,
    )
    flow: Flag = key("columns transmissivity_x, transmissivity_y and hydraulic_aperture of the gap", default=False)
    snapshots: Whole = key("load levels kept for pressure maps and fields", default=4, ge=0, le=1000)
    checkpoint: Whole = key("accepted steps from one checkpoint to the next, 0 for none", default=1, ge=0)
