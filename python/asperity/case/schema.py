"""The sections and keys of the case file: type, default, legal range, unit and meaning of each."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, Strict

from asperity.dynamics.settings import FORCING, OMEGA, DynamicsSettings
from asperity.model.load_path import greatest_force
from asperity.model.material import MODULI, POISSON_RATIOS, Material
from asperity.model.settings import (
    FACTORS,
    FASTEST_GROWTH,
    LEAST_DOFS,
    LOOSEST_RTOL,
    MOST_REFINEMENTS,
    NEWTON_STEPS,
    AccuracyTarget,
    Formulation,
    MeshSize,
    SolverOptions,
)
from asperity.slip.settings import LARGEST, SMALLEST, SlipSettings

if TYPE_CHECKING:
    from asperity.surface import Surface

Real = Annotated[float, Strict(), Field(allow_inf_nan=False)]
Whole = Annotated[int, Strict()]
Flag = Annotated[bool, Strict()]
Text = Annotated[str, Strict()]

LENGTH, FORCE, STRESS = "length", "force", "force/length^2"


def _key(doc: str, default: Any = ..., *, unit: str = "", shown: str = "", hint: str = "", **limits: Any) -> Any:
    """Declare a key: what it is, its default (`shown` when it follows from others), unit, hint."""
    extra: dict[str, Any] = {"unit": unit, "shown": shown, "hint": hint}
    return Field(default, description=doc, json_schema_extra=extra, **limits)


class Section(BaseModel):
    """A table of the case file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def parameters(self) -> dict[str, Any]:
        """Keys and values, those without a value left out."""
        return self.model_dump(exclude_none=True)


class _Patch(Section):
    L: Real = _key("side of the square patch", unit=LENGTH, ge=1e-20, le=1e20, hint="1e-6 is 1 um in SI")

    @cached_property
    def built(self) -> Surface:
        """The surface of these keys, made once: its spline and its summit take longer than its file."""
        from asperity.surface import Surface

        return Surface.from_spec(**self.parameters())


class WeierstrassMandelbrotSection(_Patch):
    """Fractal surface, modified two-variable Weierstrass-Mandelbrot function."""

    kind: Literal["weierstrass-mandelbrot"]
    D: Real = _key("fractal dimension", gt=2, lt=3, hint="2.4 is a usual value")
    G: Real = _key("fractal roughness", unit=LENGTH, gt=0, hint="1.36e-11 m is a usual value")
    M: Whole = _key("ridges run at the angles pi mu/M; M + 1 of them, or M with ridges = 1..M", 10, ge=1, le=1000)
    gamma: Real = _key("frequency ratio", 1.5, gt=1, le=100)
    f_max: Whole | None = _key("highest frequency index", None, shown="5, or from L_s", ge=0, le=100)
    L_s: Real | None = _key("shortest wavelength, sets f_max", None, unit=LENGTH, gt=0)
    seed: Whole = _key("seed of the random phases", 0, ge=0, lt=2**63)
    drawing: Literal["array", "nested"] = _key(
        "of the phases: all at once, or nested, where a larger f_max adds waves to the same surface", "array"
    )
    ridges: Literal["0..M", "1..M"] = _key("ridges in the sum", "0..M")


class SelfAffineSection(_Patch):
    """Self-affine surface, random waves with a power spectrum of Hurst exponent H and a roll-off."""

    kind: Literal["self-affine"]
    H: Real = _key("Hurst exponent", gt=0, le=1, hint="0.8 is a usual value")
    rms_height: Real | None = _key(
        "rms height with the waves shorter than lambda_short included (or rms_slope)", None, unit=LENGTH, gt=0
    )
    rms_slope: Real | None = _key("rms slope of the waves down to lambda_short (or rms_height)", None, gt=0, le=10)
    lambda_short: Real = _key("shortest wavelength", unit=LENGTH, gt=0, hint="0.05 L for a first run")
    lambda_roll: Real | None = _key("roll-off wavelength", None, shown="L", unit=LENGTH, gt=0)
    aspect: Real = _key("anisotropy: features are longer along x by this factor", 1.0, ge=0.0625, le=16)
    seed: Whole = _key("seed of the random phases", 0, ge=0, lt=2**63)
    periodic: Flag = _key("opposite edges agree; false: a window of a surface with the period 2 L", True)


class SphereSection(_Patch):
    """Sphere pressed by the flat."""

    kind: Literal["sphere"]
    radius: Real = _key("radius of the sphere", unit=LENGTH, gt=0)
    centre: tuple[Real, Real] | None = _key(
        "position of the summit (x, y)", None, shown="middle of the patch", unit=LENGTH
    )
    shape: Literal["sphere", "paraboloid"] = _key("profile", "sphere")


class SinusoidSection(_Patch):
    """Wavy surface in one or two directions."""

    kind: Literal["sinusoid"]
    amplitude: Real = _key("half of peak to valley", unit=LENGTH, gt=0)
    wavelength: Real | None = _key("wavelength", None, shown="L", unit=LENGTH, gt=0)
    dims: Whole = _key("1: waves along x; 2: along x and y", 1, ge=1, le=2)
    centre: tuple[Real, Real] | None = _key(
        "position of a crest (x, y)", None, shown="middle of the patch", unit=LENGTH
    )


class FlatSection(_Patch):
    """Plane top."""

    kind: Literal["flat"]


class FileSection(_Patch):
    """Height map on a regular grid."""

    kind: Literal["file"]
    path: Text = _key("file .npz, .npy or .csv", hint="a path relative to the case file")


SURFACES = (
    WeierstrassMandelbrotSection,
    SelfAffineSection,
    SphereSection,
    SinusoidSection,
    FlatSection,
    FileSection,
)


class MaterialSection(Section):
    """Isotropic solid, elastic or elastic-plastic (J2, linear hardening)."""

    E: Real = _key("Young's modulus", unit=STRESS, ge=MODULI[0], le=MODULI[1], hint="200e9 Pa for steel")
    nu: Real = _key(
        "Poisson's ratio", ge=POISSON_RATIOS[0], le=POISSON_RATIOS[1], hint="0.3 for steel, 0.499 for rubber"
    )
    yield_strength: Real | None = _key(
        "yield strength", None, shown="elastic", unit=STRESS, gt=0,
        hint="leave it out for an elastic material",
    )  # fmt: skip
    tangent_modulus: Real | None = _key(
        "slope of stress over strain after yield, below E", None,
        shown="0, perfectly plastic", unit=STRESS, ge=0,
    )  # fmt: skip
    hardening: Literal["isotropic", "kinematic"] | Annotated[Real, Field(ge=0, le=1)] | None = _key(
        "the yield surface grows (isotropic) or moves (kinematic), or the share of hardening that moves it", None,
        shown="isotropic",
    )  # fmt: skip
    kinematics: Literal["small", "finite", "auto"] | None = _key(
        "strain: small, finite (the same law in logarithmic strain), or chosen by pressing a coarse mesh both ways",
        None, shown="small",
    )  # fmt: skip

    density: Real | None = _key(
        "of the solid: for the inertia and the radiation that vibration has", None,
        shown="none", unit="mass/length^3", gt=0, hint="7800 kg/m^3 for steel",
    )  # fmt: skip
    conductivity: Real | None = _key(
        "of heat or current: with output.conductance for the conductance of the joint per area", None,
        shown="none", unit="power/(length temperature)", gt=0, hint="50 W/(m K) for steel",
    )  # fmt: skip
    conductivity_other: Real | None = _key(
        "of the other body, the mirror of this one", None, shown="material.conductivity",
        unit="power/(length temperature)", gt=0,
    )  # fmt: skip

    @property
    def solid(self) -> Material:
        """The material, with its moduli; the contact does not depend on the density."""
        hardening = "isotropic" if self.hardening is None else self.hardening
        tangent_modulus, kinematics = self.tangent_modulus or 0.0, self.kinematics or "small"
        return Material(self.E, self.nu, self.yield_strength, tangent_modulus, hardening, kinematics)

    @property
    def E_prime(self) -> float:
        """Contact modulus against a rigid flat, E/(1 - nu^2) [force/length^2]."""
        return self.solid.reduced_modulus


class BlockSection(Section):
    """The solid below the surface."""

    height: Real = _key("height of the block", unit=LENGTH, shown="L", gt=0)
    sides: Literal["rollers", "free", "periodic"] = _key("side faces: no normal motion, free, or joined", "rollers")


class ContactSection(Section):
    """Contact formulation."""

    method: Literal["active-set", "penalty", "nitsche"] = _key("formulation", Formulation.method)
    penalty: Real = _key("factor of E p^2/h (penalty)", Formulation.penalty, ge=FACTORS[0], le=FACTORS[1])
    gamma: Real = _key("factor of (lambda + 2 mu) p^2/h (nitsche)", Formulation.gamma, ge=FACTORS[0], le=FACTORS[1])
    friction: Literal["none", "stick"] | None = _key(
        "points in contact slide freely, or stick where they are touched (active-set)", None, shown="none",
    )  # fmt: skip

    @property
    def formulation(self) -> Formulation:
        """The formulation, with its parameters."""
        return Formulation(self.method, self.penalty, self.gamma, self.friction or "none")


class MeshSection(Section):
    """Element sizes, or a saved mesh."""

    h_contact: Real = _key("size at the surface where it is reached last", shown="0.04 L", unit=LENGTH, gt=0)
    growth: Real = _key("increase of size per unit distance", MeshSize.growth, gt=0, le=FASTEST_GROWTH)
    h_max: Real | None = _key("largest size", None, shown="0.25 L, less where slopes need it", unit=LENGTH, gt=0)
    refinements: Whole = _key(
        "number n of times the ranks split each element of a mesh of 2^n times these sizes into eight", 0,
        ge=0, le=MOST_REFINEMENTS,
    )  # fmt: skip
    file: Text | None = _key("a saved mesh instead", None)


DRIVERS = ("delta_max", "force_max", "pressure_max")  # keys of LoadingSection, of which one is given


class LoadingSection(Section):
    """Motion of the flat, or its force."""

    delta_max: Real | None = _key(
        "greatest approach from first touch (or force_max or pressure_max)", None, unit=LENGTH, gt=0,
        hint="about 0.03 L",
    )  # fmt: skip
    force_max: Real | None = _key("greatest normal force (or delta_max)", None, unit=FORCE, gt=0)
    pressure_max: Real | None = _key("greatest nominal pressure, the force over L^2", None, unit=STRESS, gt=0)
    steps: Whole = _key("least number of load steps", 10, ge=1, le=100_000)
    unload: Flag = _key("unload after loading", False)
    cycles: Whole = _key("number of load(-unload) cycles", 1, ge=1, le=1000)
    unload_steps: Whole = _key("steps of an unloading", shown="steps // 2", ge=1, le=100_000)
    integrator: Literal["midpoint", "backward-euler"] = _key(
        "of plasticity along a loading: second or first order in the step", "midpoint"
    )

    @property
    def driver(self) -> str:
        """Key of the greatest load: "delta_max", "force_max" or "pressure_max"; the first one if several are given."""
        return next((key for key in DRIVERS if getattr(self, key) is not None), "")


class AccuracySection(Section):
    """Error control; without a tolerance one mesh of size h_contact is used."""

    tolerance: Real | None = _key(
        "relative error of the force", None, shown="one mesh", ge=1e-6, lt=1,
        hint="0.01 for one per cent",
    )  # fmt: skip
    area_tolerance: Real | None = _key(
        "relative error of the contact area as well", None, shown="not judged", ge=1e-6, lt=1,
        hint="0.05 for five per cent, with accuracy.tolerance",
    )  # fmt: skip
    max_dofs: Whole = _key("limit of the dofs", AccuracyTarget.max_dofs, ge=LEAST_DOFS)
    max_seconds: Real | None = _key("limit of time", None, shown="none", unit="s", gt=0)


Model = Literal["exact", "taylor"]
Frequency = Annotated[Real, Field(ge=OMEGA[0], le=OMEGA[1])]


class DynamicsSection(Section):
    """Vibration of a mass on the contact."""

    law: Literal["auto", "unload-reload", "elastic", "table", "paper"] = _key(
        "unloading branch, elastic tangent, points of the loading curve, or its power law; auto takes the first that "
        "the run has after yield, and the points of the loading before", DynamicsSettings.law,
    )  # fmt: skip
    preload: Real | None = _key(
        "static force, the weight of the mass", None, shown="half of the greatest force", unit=FORCE, gt=0
    )
    overload: Real | None = _key(
        "greatest force before the vibration; equal to the preload: the weight itself", None,
        shown="that of the unloading, else the preload", unit=FORCE, gt=0,
    )  # fmt: skip
    gravity: Real | None = _key(
        "gravity, for mass and omega_s alone", None, shown="9.80665; none with other units, nor mass and omega_s",
        unit="length/time^2", gt=0,
    )  # fmt: skip
    zeta: Real = _key("damping ratio", DynamicsSettings.zeta, ge=0, lt=1)
    damping: Literal["always", "contact", "hunt-crossley", "loops"] = _key(
        "when damping acts; loops adds that of [loops], in contact", DynamicsSettings.damping
    )
    forcing: tuple[Annotated[Real, Field(ge=FORCING[0], le=FORCING[1])], ...] = _key(
        "amplitudes F/(m omega_s^2 z_s)", DynamicsSettings.forcing, min_length=1, max_length=100
    )
    model: tuple[Model, ...] = _key(
        "restoring force: exact, its Taylor expansion", DynamicsSettings.model, min_length=1,
        max_length=2,
    )  # fmt: skip
    omega: tuple[Frequency, Frequency] = _key("range of excitation frequency over omega_s", DynamicsSettings.omega)
    sweeps: Flag = _key("also sweep up and down by time integration, as dots in the figure", DynamicsSettings.sweeps)


class JointSection(Section):
    """A joint whose faces are like the patch, for numbers in N, m, kg and Hz."""

    nominal_area: Real | None = _key("nominal area of the joint", None, shown="L^2", unit="length^2", gt=0)
    preload: Real | None = _key(
        "static force, of a bolt for example (or pressure)", None, shown="half of the greatest force", unit=FORCE, gt=0
    )
    pressure: Real | None = _key("static nominal pressure (or preload)", None, unit=STRESS, gt=0)
    mass: Real | None = _key("mass that vibrates (or frequency)", None, unit="mass", gt=0)
    frequency: Real | None = _key("frequency of small vibration, where that is known", None, unit="1/time", gt=0)
    gravity: Real | None = _key(
        "adds the weight of the mass to the preload", None, shown="none", unit="length/time^2", gt=0
    )
    damping: Real | None = _key("damping ratio", None, shown="dynamics.zeta", ge=0, lt=1)


class LoopsSection(Section):
    """Loops of the force about a preload after the load path: the damping of plastic flow."""

    amplitudes: tuple[Annotated[Real, Field(ge=1e-3, le=0.99)], ...] = _key(
        "amplitudes of the force over the preload", (0.1, 0.3, 0.6), min_length=1, max_length=100
    )
    preload: Real | None = _key(
        "mean force on the patch", None, shown="that of the vibration", unit=FORCE, gt=0
    )  # fmt: skip
    cycles: Whole = _key("greatest number of loops of an amplitude; fewer when two are alike", 4, ge=1, le=1000)
    steps: Whole = _key("steps of a quarter of a loop", 4, ge=1, le=1000)


class SlipSection(Section):
    """Micro-slip of the joint of two like bodies: tangential loops with Coulomb friction about a preload."""

    friction: Real = _key("Coulomb's coefficient mu", gt=0, le=10, hint="0.1 to 0.6 for dry metals")
    amplitudes: tuple[Annotated[Real, Field(ge=SMALLEST, le=LARGEST)], ...] = _key(
        "amplitudes of the tangential force over mu P", SlipSettings.amplitudes, min_length=1, max_length=100
    )
    preload: Real | None = _key(
        "normal force P on the patch", None, shown="that of the vibration", unit=FORCE, gt=0
    )  # fmt: skip
    method: Literal["curve", "solid"] = _key(
        "by the normal curve, without a solve; or a flat that moves on the solid (active-set, frictionless load path)",
        SlipSettings.method,
    )
    direction: Real = _key("of the motion, from x towards y, in degrees", SlipSettings.direction, ge=-360, le=360)
    steps: Whole = _key(
        "steps from rest to an amplitude; a loop has four times as many", SlipSettings.steps, ge=1, le=1000
    )


class SolverSection(Section):
    """Solution of the equations."""

    dilatation: Literal["point", "mean"] | None = _key(
        "volumetric strain of the elements, see docs/contact.md",
        None,
        shown='"mean" in runs with a tolerance where rough solids yield, otherwise "point"',
    )
    linear: Literal["auto", "lu", "cg", "gamg"] = _key(
        "linear solver: direct, CG with p-multigrid, or with algebraic multigrid", "auto"
    )
    newton_max: Whole = _key(
        "Newton steps before cutback", SolverOptions.newton_max, ge=NEWTON_STEPS[0], le=NEWTON_STEPS[1]
    )
    rtol: Real = _key("relative residual at convergence", SolverOptions.rtol, gt=0, le=LOOSEST_RTOL)


class OutputSection(Section):
    """Files in addition to the curve and the summary."""

    figures: Flag = _key("figures/*.png, and *.svg of those that consist of lines", False)
    fields: Flag = _key("fields/ for ParaView", False)
    report: Flag = _key("report.html", False)
    distributions: Flag = _key("fields/distributions.csv: shares of the patch by pressure and by gap", False)
    stiffness: Flag = _key(
        "columns k_n_elastic to k_t_interface, always with [slip]; load steps take a third to a half longer",
        False,
    )
    stiffness_matrix: Flag = _key(
        "stiffness against all six motions of the flat at the end of the load path, in summary.json; not of periodic "
        "sides",
        False,
    )
    conductance: Flag = _key("column conductance of the curve", False)
    small_strain: Flag = _key("what small strain changes in the force; always with finite or auto kinematics", False)
    snapshots: Whole = _key("load levels kept for pressure maps and distributions", 4, ge=0, le=1000)
    checkpoint: Whole = _key("accepted steps from one checkpoint to the next, 0 for none", 1, ge=0)


class Input(BaseModel):
    """All sections of a case file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    units: Literal["SI", "other"] = _key("'other' drops SI labels and checks", "SI")
    surface: Annotated[
        WeierstrassMandelbrotSection | SelfAffineSection | SphereSection | SinusoidSection | FlatSection | FileSection,
        Field(discriminator="kind"),
    ]
    material: MaterialSection
    block: BlockSection
    contact: ContactSection = ContactSection()
    mesh: MeshSection
    loading: LoadingSection
    accuracy: AccuracySection = AccuracySection()
    dynamics: DynamicsSection | None = None
    joint: JointSection | None = None
    loops: LoopsSection | None = None
    slip: SlipSection | None = None
    solver: SolverSection = SolverSection()
    output: OutputSection = OutputSection()

    @property
    def greatest_force(self) -> float | None:
        """Force at the end of the loading [force]; None when it is driven by the approach."""
        return greatest_force(self.loading.force_max, self.loading.pressure_max, self.surface.L)

    @property
    def has_stiffness(self) -> bool:
        """Whether load steps compute the elastic stiffnesses: requested, or the slip needs them."""
        return self.output.stiffness or self.slip is not None
