"""The sections and keys of the case file: type, default, legal range, unit and meaning of each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from asperity.case import surfaces
from asperity.case.surfaces import FORCE, LENGTH, STRESS, Flag, Real, Section, Text, Whole, key, optional
from asperity.errors import InputError
from asperity.laws import Law, from_file, shipped_law
from asperity.model import settings
from asperity.model.limits import bounds
from asperity.model.material import MODULI, POISSON_RATIOS, Material
from asperity.model.settings import AccuracyTarget, Formulation, MeshSize, SolverOptions
from asperity.runtime.display import show
from asperity.slip.settings import AMPLITUDES, SlipSettings
from asperity.vibration.joint import Joint
from asperity.vibration.settings import FORCING, OMEGA, ZETA, DynamicsSettings

CONDUCTIVITY, ACCELERATION = "power/(length temperature)", "length/time^2"
#: Keys that a law in UFL takes from [material] where it has a parameter of that name.
SHARED = ("E", "nu", "yield_strength", "tangent_modulus")


class MaterialSection(Section):
    """Isotropic solid, elastic or elastic-plastic (J2, linear hardening), or a law in UFL."""

    E: Real = key("Young's modulus", unit=STRESS, **bounds(MODULI), hint="200e9 Pa for steel")
    nu: Real = key("Poisson's ratio", hint="0.3 for steel, 0.495 for rubber", **bounds(POISSON_RATIOS))
    yield_strength: Real | None = optional("yield strength", STRESS, "elastic", "leave it out for an elastic material")
    tangent_modulus: Real | None = key(
        "slope of stress over strain after yield, below E", None, shown="0, perfectly plastic", unit=STRESS, ge=0
    )
    hardening: Literal["isotropic", "kinematic"] | Annotated[Real, Field(ge=0, le=1)] | None = key(
        "the yield surface grows (isotropic) or moves (kinematic), or the share of hardening that moves it", None,
        shown="isotropic",
    )  # fmt: skip
    kinematics: Literal["small", "finite", "auto"] | None = key(
        "strain: small, finite (the same law in logarithmic strain), or chosen by pressing a coarse mesh both ways",
        None, shown="small",
    )  # fmt: skip
    law: Text | None = key(
        'law in UFL, one of asperity.laws, or "file.py:name": code, which runs with --allow-code (docs/extend.md)', None
    )
    parameters: dict[str, Real] | None = key("of the law, by name: a section [material.parameters]", None)
    law_sha256: Text | None = key("of the file of the law, which is refused where it has another", None)
    density: Real | None = optional(
        "of the solid: for the inertia and the radiation that vibration has", "mass/length^3", "none",
        "7800 kg/m^3 for steel",
    )  # fmt: skip
    conductivity: Real | None = optional(
        "of heat or current: with output.stiffness for the conductance of the joint per area", CONDUCTIVITY, "none",
        "50 W/(m K) for steel",
    )  # fmt: skip
    conductivity_other: Real | None = optional(
        "of the other body, the mirror of this one", CONDUCTIVITY, "material.conductivity"
    )

    @property
    def solid(self) -> Material:
        """The material, with its moduli; the contact does not depend on the density."""
        if self.law is not None:
            return law_of_section(self.given())
        hardening = "isotropic" if self.hardening is None else self.hardening
        tangent_modulus, kinematics = self.tangent_modulus or 0.0, self.kinematics or "small"
        return Material(self.E, self.nu, self.yield_strength, tangent_modulus, hardening, kinematics)

    @property
    def plastic(self) -> bool:
        """Whether the solid can yield, or its law has a state."""
        return self.yield_strength is not None if self.law is None else self.solid.plastic

    @property
    def E_prime(self) -> float:
        """Contact modulus against a rigid flat, E/(1 - nu^2) [force/length^2]."""
        return self.solid.reduced_modulus


def law_of_section(table: Mapping[str, Any], allow_code: bool = False) -> Material:
    """The material of a section with a law; a law in a file, which is code, has its function only where allowed.

    Raises:
        InputError: the law is refused, or has no such keys, or other values of E and nu
    """
    source, parameters, kinematics = table["law"], table.get("parameters", {}), table.get("kinematics")
    offered, digest = {name: table[name] for name in SHARED if name in table}, table.get("law_sha256", "")
    if ":" not in source:
        made = shipped_law(source, parameters, offered)
    elif allow_code:
        made = from_file(source, digest, parameters, offered)
    else:
        unseen = Law(None, tuple(parameters.items()), source, digest)
        return Material(
            table["E"], table["nu"], table.get("yield_strength"), kinematics=kinematics or "small", law=unseen
        )
    solid = Material.of_law(made, kinematics=kinematics)
    for name in ("yield_strength", "tangent_modulus", "hardening"):
        has = solid.yield_strength is not None if name == "yield_strength" else name in dict(made.parameters)
        if name in table and not has:
            raise InputError(f"material.{name} = {show(table[name])} cannot go with material.law, which has none")
    for name, value in (("E", solid.E), ("nu", solid.nu)):
        if abs(table.get(name, value) - value) > 1e-6 * solid.E ** (name == "E"):
            raise InputError(
                f"material.{name} = {table[name]:g} is not that of material.law at rest, {value:g}: leave it out"
            )
    return solid


class BlockSection(Section):
    """The solid below the surface."""

    height: Real = key("height of the block", unit=LENGTH, shown="L", gt=0)
    sides: Literal["rollers", "free", "periodic"] = key("side faces: no normal motion, free, or joined", "rollers")


class ContactSection(Section):
    """Contact formulation."""

    method: Literal["active-set", "penalty", "nitsche"] = key("formulation", Formulation.method)
    penalty: Real = key("factor of E p^2/h (penalty)", Formulation.penalty, **bounds(settings.FACTORS))
    gamma: Real = key("factor of (lambda + 2 mu) p^2/h (nitsche)", Formulation.gamma, **bounds(settings.FACTORS))
    friction: Literal["none"] | Annotated[Real, Field(**bounds(settings.FRICTION))] | None = key(
        "Coulomb's coefficient of the solid on the rigid flat (active-set)", None, shown="none"
    )

    @property
    def formulation(self) -> Formulation:
        """The formulation, with its parameters."""
        return Formulation(self.method, self.penalty, self.gamma, self.friction or "none")


class MeshSection(Section):
    """Element sizes, or a saved mesh."""

    h_contact: Real = key("size at the surface where it is reached last", shown="0.04 L", unit=LENGTH, gt=0)
    growth: Real = key("increase of size per unit distance", MeshSize.growth, **bounds(settings.GROWTH))
    h_max: Real | None = optional("largest size", LENGTH, "0.25 L, less where slopes need it")
    file: Text | None = key("a saved mesh instead", None)

    @property
    def size(self) -> MeshSize:
        """Element sizes of a mesh that is not saved."""
        return MeshSize(self.h_contact, self.growth, self.h_max)


DRIVERS = ("delta_max", "force_max", "pressure_max")  # keys of LoadingSection, of which one is given


class LoadingSection(Section):
    """Motion of the flat, or its force."""

    delta_max: Real | None = optional(
        "greatest approach from first touch (or force_max or pressure_max)", LENGTH, hint="about 0.03 L"
    )
    force_max: Real | None = optional("greatest normal force (or delta_max)", FORCE)
    pressure_max: Real | None = optional("greatest nominal pressure, the force over L^2", STRESS)
    steps: Whole = key("least number of load steps", 10, ge=1, le=100_000)
    unload: Flag = key("unload after loading", False)
    cycles: Whole = key("number of load(-unload) cycles", 1, ge=1, le=1000)
    unload_steps: Whole = key("steps of an unloading", shown="steps // 2", ge=1, le=100_000)
    unload_to: Real = key("force at which an unloading ends, over that at its beginning", 0.0, ge=0, lt=1)
    integrator: Literal["midpoint", "backward-euler"] | None = key(
        "of plasticity along a loading: second or first order in the step", None,
        shown="midpoint; backward-euler where material.law does not declare that its state is a strain",
    )  # fmt: skip

    @property
    def driver(self) -> str:
        """Key of the greatest load: "delta_max", "force_max" or "pressure_max"; the first one if several are given."""
        return next((key for key in DRIVERS if getattr(self, key) is not None), "")


class AccuracySection(Section):
    """Error control; without a tolerance one mesh of size h_contact is used."""

    tolerance: Real | None = key(
        "relative error of the force", None, shown="one mesh", ge=1e-6, lt=1, hint="0.01 for one per cent"
    )
    area_tolerance: Real | None = key(
        "relative error of the contact area as well", None, shown="not judged", ge=1e-6, lt=1,
        hint="0.05 for five per cent, with accuracy.tolerance",
    )  # fmt: skip
    max_dofs: Whole = key("limit of the dofs", AccuracyTarget.max_dofs, **bounds(settings.MAX_DOFS))


Model = Literal["exact", "taylor"]
Frequency = Annotated[Real, Field(ge=OMEGA[0], le=OMEGA[1])] | Text
Amplitude = Annotated[Real, Field(ge=FORCING[0], le=FORCING[1])] | Text
Positive = Annotated[Real, Field(gt=0)]
Ratio = Annotated[Real, Field(ge=ZETA[0], le=ZETA[1])]


class DynamicsSection(Section):
    """Vibration of a mass on the contact."""

    law: Literal["auto", "unload-reload", "elastic", "table", "paper"] = key(
        "unloading branch, elastic tangent, points of the loading curve, or its power law; auto takes the first that "
        "the run has after yield, and the points of the loading before", DynamicsSettings.law,
    )  # fmt: skip
    preload: Real | None = optional("static force, the weight of the mass", FORCE, "half of the greatest force")
    gravity: Real | None = optional(
        "gravity, for mass and omega_s alone", ACCELERATION, "9.80665; none with other units, nor mass and omega_s"
    )
    zeta: Ratio | Annotated[tuple[Ratio, ...], Field(min_length=1, max_length=20)] = key(
        "damping ratio, or several for the responses", *DynamicsSettings.zeta
    )
    damping: Literal["always", "contact", "hunt-crossley"] = key("when damping acts", DynamicsSettings.damping)
    forcing: tuple[Amplitude, ...] = key(
        'amplitudes F/(m omega_s^2 z_s) of the force, or all in one unit: "5 N", or of the base "2 um" or "3 m/s^2"',
        DynamicsSettings.forcing, min_length=1, max_length=100,
    )  # fmt: skip
    model: tuple[Model, ...] = key(
        "restoring force: exact, its Taylor expansion", DynamicsSettings.model, min_length=1, max_length=2
    )
    omega: tuple[Frequency, Frequency] = key(
        'range of excitation frequency over omega_s, or as ["5 kHz", "9 kHz"]', DynamicsSettings.omega
    )
    simulate: tuple[Literal["harmonic", "step", "half-sine", "chirp"], ...] = key(
        "short motions from rest under the first forcing, which the figure motion shows", DynamicsSettings.simulate
    )
    pulse: Positive | None = key("length of the half-sine", None, shown="half a period of small vibration", unit="time")
    span: Positive = key("length of the short motions in periods of small vibration", DynamicsSettings.span)


class JointSection(Section):
    """A joint whose faces are like the patch, for numbers in N, m, kg and Hz."""

    nominal_area: Real | None = optional("nominal area of the joint", "length^2", "L^2")
    preload: Real | None = optional(
        "static force, of a bolt for example (or pressure)", FORCE, "half of the greatest force"
    )
    pressure: Real | None = optional("static nominal pressure (or preload)", STRESS)
    mass: Real | None = optional("mass that vibrates", "mass")
    overload: Real = key(
        "greatest force that the joint has met, over the preload: the greatest load where [loading] gives none",
        Joint.overload, ge=1.0, le=1e3,
    )  # fmt: skip


class SlipSection(Section):
    """Micro-slip of the joint of two like bodies: tangential loops with Coulomb friction about a preload."""

    friction: Real = key("Coulomb's coefficient mu", gt=0, le=10, hint="0.1 to 0.6 for dry metals")
    amplitudes: tuple[Annotated[Real, Field(**bounds(AMPLITUDES))], ...] = key(
        "amplitudes of the tangential force over mu P", SlipSettings.amplitudes, min_length=1, max_length=100
    )
    preload: Real | None = optional("normal force P on the patch", FORCE, "that of the vibration")
    direction: Literal["x", "y"] = key("of the motion", SlipSettings.direction)
    steps: Whole = key(
        "steps from rest to an amplitude; a loop has four times as many", SlipSettings.steps, ge=1, le=1000
    )


class SolverSection(Section):
    """Solution of the equations."""

    kernels: Literal["compiled", "forms"] | None = key(
        "of the elements: compiled, or forms of UFL", None, shown='"forms" with material.law, otherwise "compiled"'
    )
    linear: Literal["auto", "lu", "cg"] = key("linear solver: direct, or CG with p-multigrid", "auto")
    newton_max: Whole = key("Newton steps before cutback", SolverOptions.newton_max, **bounds(settings.NEWTON_STEPS))
    rtol: Real = key("relative residual at convergence", SolverOptions.rtol, **bounds(settings.RTOL))


class OutputSection(Section):
    """Files in addition to the curve and the summary."""

    figures: Flag = key("figures/*.svg, and *.png of those with fields", False)
    fields: Flag = key("fields/ for ParaView", False)
    report: Flag = key("report.html", False)
    stiffness: Flag = key(
        "columns k_n_elastic to k_t_interface (also with [slip]) and conductance, for more time a load step",
        False,
    )
    snapshots: Whole = key("load levels kept for pressure maps and fields", 4, ge=0, le=1000)
    checkpoint: Whole = key("accepted steps from one checkpoint to the next, 0 for none", 1, ge=0)


class Input(BaseModel):
    """All sections of a case file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    units: Literal["SI", "other"] = key("'other' drops SI labels and checks", "SI")
    surface: Annotated[surfaces.SurfaceSection, Field(discriminator="kind")]
    material: MaterialSection
    block: BlockSection
    contact: ContactSection = ContactSection()
    mesh: MeshSection
    loading: LoadingSection
    accuracy: AccuracySection = AccuracySection()
    dynamics: DynamicsSection | None = None
    joint: JointSection | None = None
    slip: SlipSection | None = None
    solver: SolverSection = SolverSection()
    output: OutputSection = OutputSection()

    @property
    def greatest_force(self) -> float | None:
        """Force at the end of the loading [force]; None when it is driven by the approach."""
        pressure = self.loading.pressure_max
        return self.loading.force_max if pressure is None else pressure * self.surface.L**2

    @property
    def has_stiffness(self) -> bool:
        """Whether load steps compute the elastic stiffnesses: requested, or the slip needs them."""
        return self.output.stiffness or self.slip is not None
