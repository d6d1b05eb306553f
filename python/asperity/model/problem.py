# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""A contact problem: all that determines the force over the approach, as plain immutable data."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, replace

from asperity.errors import InputError, ResolutionWarning
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT, Schedule, greatest_force
from asperity.model.material import Material
from asperity.model.settings import WIDEST_JOINED, Formulation, MeshSize, SolverOptions, wrong_dilatation
from asperity.runtime.display import short_repr
from asperity.surface import Surface

ONE_OF = "give exactly one of delta_max, force_max and pressure_max"


@dataclass(frozen=True, eq=False)
class Problem:
    """A block with a rough top, its material, the load path, and how it is discretised and solved.

    Example:
        >>> from asperity.surface import Flat
        >>> problem = Problem(Flat(L=2.0), Material(E=1.0, nu=0.3), Schedule(delta_max=0.01))
        >>> problem.height, problem.schedule.delta_max
        (2.0, 0.005)

    Attributes:
        surface: the top
        material: of the block
        load_path: approaches [length] and forces [force]; exactly one of delta_max and force_max
        block_height: mean height of the block [length]; None takes the side of the surface
        sides: "rollers" (no normal displacement), "free", or "periodic" (opposite sides joined)
        formulation: of the contact
        size: of the elements
        kernels: "compiled" or "ufl"
        dilatation: volumetric strain of the elements: "point", that of each quadrature point, or "mean", that of the
            cell once it has flowed, which does not lock where elements are as large as the spots (docs/contact.md);
            None takes that of the points, except where a run with a tolerance chooses
        options: of the solver

    Raises:
        InputError: not exactly one of delta_max and force_max, periodic sides of a surface that is not periodic, or
            mean volumetric strains with UFL kernels or Nitsche's method
    """

    surface: Surface
    material: Material
    load_path: Schedule
    block_height: float | None = None
    sides: str = "rollers"
    formulation: Formulation = field(default_factory=Formulation)
    size: MeshSize = field(default_factory=MeshSize)
    kernels: str = "compiled"
    dilatation: str | None = None
    options: SolverOptions = field(default_factory=SolverOptions)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if (self.load_path.delta_max is None) == (self.load_path.force_max is None):
            raise InputError(ONE_OF)
        if wrong := wrong_dilatation(self.dilatation, self.kernels, self.formulation.method):
            raise InputError(wrong)
        if self.sides == "periodic" and not self.surface.periodic:
            kind = self.surface.kind or type(self.surface).__name__
            raise InputError(
                f'block.sides = "periodic" needs a surface whose opposite edges agree, and this one ({kind}) does not: '
                'take block.sides = "rollers", or surface.kind = "self-affine" with surface.periodic = true'
            )

    @staticmethod
    def of(
        surface: Surface,
        material: Material,
        *,
        height: float | None = None,
        sides: str = "rollers",
        delta_max: float | None = None,
        force_max: float | None = None,
        pressure_max: float | None = None,
        steps: int = 10,
        unload_steps: int = 0,
        cycles: int = 1,
        integrator: str = MIDPOINT,
        substeps: int = 1,
        size: MeshSize | None = None,
        formulation: Formulation | None = None,
        kernels: str = "compiled",
        dilatation: str | None = None,
        options: SolverOptions | None = None,
    ) -> Problem:
        """Make a problem of flat arguments, as scripts write them.

        Args:
            surface: the rough top
            material: elastic or elastic-plastic
            height: mean height of the block [length]; default L
            sides: "rollers", "free" or "periodic"
            delta_max: greatest approach from first touch [length]
            force_max: greatest force instead [force]
            pressure_max: greatest nominal pressure instead, the force over L^2 [force/length^2]
            steps, unload_steps, cycles, integrator, substeps: see `load_path.Schedule`
            size: element sizes
            formulation: of the contact
            kernels: "compiled" or "ufl"
            dilatation: "point" or "mean"
            options: of the solver

        Warns (ResolutionWarning) of a greatest size that periodic sides do not allow.

        Raises:
            InputError: not exactly one of delta_max, force_max and pressure_max, or a step count outside its range
        """
        if (delta_max, force_max, pressure_max).count(None) != 2:
            raise InputError(ONE_OF)
        force_max = greatest_force(force_max, pressure_max, surface.L)
        if surface.rough and material.kinematics == "small":
            surface.check_small_slope()
        path = Schedule(delta_max, force_max, steps, unload_steps, cycles, integrator, substeps)
        if sides == "periodic" and size is not None and (size.h_max or 0.0) > WIDEST_JOINED * surface.L:
            warnings.warn(
                f"mesh.h_max = {size.h_max:g} is reduced to {WIDEST_JOINED * surface.L:g}: with block.sides = "
                '"periodic" elements must be narrower than half the side; give that, or leave mesh.h_max out',
                ResolutionWarning,
                stacklevel=2,
            )
        settings = formulation or Formulation(), size or MeshSize(), kernels, dilatation, options or SolverOptions()
        return Problem(surface, material, path, height, sides, *settings)

    @property
    def height(self) -> float:
        """Mean height of the block [length]."""
        return self.surface.L if self.block_height is None else self.block_height

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
