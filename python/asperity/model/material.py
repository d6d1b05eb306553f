"""Isotropic elasticity, J2 plasticity with linear hardening, and laws in UFL."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from math import inf
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, InstanceOf, PlainSerializer, WithJsonSchema

from asperity.arrays import Floats
from asperity.errors import InputError
from asperity.laws import definition as laws
from asperity.laws import from_file, shipped, shipped_law
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT
from asperity.runtime.declaration import STRESS, Choices, Positive, Real, Text, declared, key
from asperity.runtime.display import show

AUTO = "auto"  # kinematics that a run chooses, see adaptive.guide
YIELD_STRAINS = (1e-7, 1.0)  # legal yield strength over E; the second one excluded
SHARES = {"isotropic": 0.0, "kinematic": 1.0}  # of the hardening that are kinematic
WORKED = 0.2  # plastic strain of the strength that says which pressures in a cell relax, see `fem.kernels`
PAIRS = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # in products of tensors (..., 6): off-diagonal components count twice
CONDUCTIVITY = "power/(length temperature)"
#: Keys that a law in UFL takes where it has a parameter of that name.
SHARED = ("E", "nu", "yield_strength", "tangent_modulus")

Share = Annotated[Real, Field(ge=0, le=1)]
if TYPE_CHECKING:
    _Law = laws.Law | None
else:  # the text of a case file becomes a law
    _Law = InstanceOf[laws.Law] | Text | None


@declared("material")
class Material:
    """Isotropic solid, elastic or elastic-plastic (J2, linear hardening), or a law in UFL.

    Raises:
        InputError: a value is outside its range

    Examples:
        >>> steel = asp.Material(E=200e9, nu=0.3, yield_strength=1e9, tangent_modulus=20e9, hardening="kinematic")
        >>> steel.plastic, round(steel.reduced_modulus / 1e9, 3), round(steel.plastic_modulus / 1e9, 3)
        (True, 219.78, 22.222)
        >>> steel.kinematic_share
        1.0
    """

    E: Real = key("Young's modulus", STRESS, hint="200e9 Pa for steel", ge=1e-20, le=1e40)
    # above 0.495, area and pressure are off by more than 1.2 % (docs/theory.md)
    nu: Real = key("Poisson's ratio", hint="0.3 for steel, 0.495 for rubber", ge=-0.9, le=0.495)
    yield_strength: Positive | None = key(
        "yield strength", STRESS, default=None, shown="elastic", hint="leave it out for an elastic material"
    )
    tangent_modulus: Real = key(
        "slope of stress over strain after yield, below E; 0 is perfectly plastic", STRESS, default=0.0, ge=0
    )
    hardening: Annotated[str, Choices("isotropic", "kinematic")] | Share = key(
        "the yield surface grows (isotropic) or moves (kinematic), or the share of hardening that moves it",
        default="isotropic",
    )
    kinematics: Annotated[str, Choices("small", "finite", "auto")] | None = key(
        "strain: small, finite (the same law in logarithmic strain), or chosen by pressing a coarse mesh both ways",
        default=None,
        shown="small; finite where material.law is an energy",
    )
    law: Annotated[
        _Law, WithJsonSchema({"type": "string"}), PlainSerializer(lambda law: getattr(law, "source", law))
    ] = key(
        'law in UFL, one of asperity.laws, or "file.py:name": code, which runs with --allow-code (docs/extend.md)',
        default=None,
    )
    parameters: Annotated[dict[str, Real] | None, key("of the law, by name: a section [material.parameters]")] = field(
        default=None, hash=False
    )
    law_sha256: Text | None = key("of the file of the law, which is refused where it has another", default=None)
    density: Positive | None = key(
        "of the solid: for the inertia and the radiation that vibration has",
        "mass/length^3",
        default=None,
        hint="7800 kg/m^3 for steel",
    )
    conductivity: Positive | None = key(
        "of heat or current: with output.stiffness for the conductance of the joint per area",
        CONDUCTIVITY,
        default=None,
        hint="50 W/(m K) for steel",
    )
    conductivity_other: Positive | None = key(
        "of the other body, the mirror of this one", CONDUCTIVITY, default=None, shown="material.conductivity"
    )

    def __post_init__(self) -> None:
        if isinstance(self.law, str):
            self._take_law(self.law)
        elif self.law is None and (self.parameters is not None or self.law_sha256 is not None):
            raise InputError("material.parameters and material.law_sha256 need material.law, a law in UFL")
        if self.kinematics is None and self.has_run:
            energy = self.law is not None and self.law.hyperelastic
            object.__setattr__(self, "kinematics", "finite" if energy else "small")
        (low, high), strength, slope = YIELD_STRAINS, self.yield_strength, self.tangent_modulus
        if strength is not None and not low <= strength / self.E < high:
            raise InputError(
                f"material.yield_strength = {strength:g} with material.E = {self.E:g} means yield at a strain of "
                f"{strength / self.E:.2g}, legal are {low:g} to {high:g}; give both in the same unit (Pa), or leave it "
                "out for an elastic material"
            )
        if not slope < self.E:
            raise InputError(
                f"material.tangent_modulus = {slope:g} must be below material.E = {self.E:g}; 0 is perfectly plastic"
            )
        if self.law is not None and self.law.hyperelastic and not self.finite:
            raise InputError(
                f'material.kinematics = "{self.kinematics}" cannot go with {laws.KEY} = "{self.law.source}", an energy '
                'of the deformation gradient: take "finite", or leave it out'
            )
        if strength is None and self.law is None and (slope > 0 or self.kinematic_share > 0):
            name = "tangent_modulus" if slope > 0 else "hardening"
            raise InputError(
                f"material.{name} = {show(getattr(self, name))} needs material.yield_strength: give one, or leave "
                f"material.{name} out of an elastic material"
            )

    def _take_law(self, source: str) -> None:
        """Take the law of a key, which in a file is left unseen."""
        parameters = self.parameters or {}
        if ":" in source:
            law = laws.Law(None, tuple(parameters.items()), source, self.law_sha256 or "")
            object.__setattr__(self, "law", law)
            return
        if self.law_sha256 is not None:
            raise InputError('material.law_sha256 needs material.law = "file.py:name", a law in a file')
        self._take(shipped_law(source, parameters, self._offered))

    @property
    def _offered(self) -> dict[str, float]:
        """Values of the keys that a law may take as parameters of these names."""
        return {name: value for name in SHARED if (value := getattr(self, name))}

    def _take(self, law: laws.Law) -> None:
        """Take a law that has been run (InputError: it has other moduli, or has no such keys)."""
        made = Material.of_law(law, kinematics=self.kinematics)
        for name, default in (("yield_strength", None), ("tangent_modulus", 0.0), ("hardening", "isotropic")):
            value = getattr(self, name)
            if value not in (default, getattr(made, name)):
                raise InputError(f"material.{name} = {show(value)} cannot go with material.law, which has none")
        for name in ("E", "nu"):
            value, own = getattr(self, name), getattr(made, name)
            if abs(value - own) > 1e-6 * (made.E if name == "E" else 1.0):
                raise InputError(
                    f"material.{name} = {value:g} is not that of material.law at rest, {own:g}: leave it out"
                )
        for name in (*SHARED, "hardening", "kinematics", "law"):
            object.__setattr__(self, name, getattr(made, name))

    def run_law(self) -> Material:
        """The material with the law of its file, which is run, with all rights of the user.

        Raises:
            InputError: the file cannot be read, is another one or raises, or its law is refused
        """
        if self.has_run:
            return self
        assert self.law is not None
        law = from_file(self.law.source, self.law.digest, dict(self.law.parameters), self._offered)
        found = replace(self)
        found._take(law)
        return found

    @staticmethod
    def of_law(
        law: str | laws.Law | Callable[..., Any], *, kinematics: str | None = None, **parameters: float
    ) -> Material:
        """A material of a law in UFL, see docs/extend.md.

        Args:
            law: function `stress(strain, ...)`, `stress(strain, state, ...)` or `energy(F, ...)`; the name of one of
                `asperity.laws`; or a law with its parameters
            kinematics: None takes "finite" for an energy, else "small"; a law of a strain is then one of the
                logarithmic strain
            parameters: of the law; those by the names of attributes of this class have their ranges

        Raises:
            InputError: the law is refused, see `laws.law_of_function`, or does not say its E and nu

        Examples:
            >>> alloy = asp.Material.of_law(
            ...     asp.laws.voce, E=70e9, nu=0.33, yield_strength=2e8, saturation=1e8, rate=20.0
            ... )
            >>> alloy.plastic, round(alloy.E / 1e9, 6), alloy.kinematics
            (True, 70.0, 'small')
        """
        if isinstance(law, laws.Law):
            made = law
        else:
            made = shipped_law(law, parameters) if isinstance(law, str) else laws.law_of_function(law, parameters)
        E, nu, given = made.quantity("E"), made.quantity("nu"), dict(made.parameters)
        if E is None or nu is None:
            laws.refuse(made.source, "does not say E and nu at rest: declare @asp.law(E=..., nu=...)")
        kinematics = kinematics or ("finite" if made.hyperelastic else "small")
        slope, share = given.get("tangent_modulus", 0.0), given.get("kinematic_share", 0.0)
        return Material(E, nu, made.quantity("yield_strength"), slope, share, kinematics=kinematics, law=made)

    @property
    def plastic(self) -> bool:
        """Whether the material can yield, or its law has a state; so is taken of a law that has not been run."""
        return (not self.has_run or bool(self.law.state)) if self.law else self.yield_strength is not None

    @property
    def flows(self) -> bool:
        """Whether it counts a plastic strain, which not every state of a law is."""
        if self.law is None or not self.has_run:
            return self.plastic
        return not laws.USUAL.keys().isdisjoint(self.law.state)

    @property
    def source(self) -> str:
        """Where the law comes from, in words of a case; empty without one in UFL."""
        return self.law.source if self.law else ""

    @property
    def has_run(self) -> bool:
        """Whether the file of a law, which is code, has been run; true without one."""
        return self.law is None or self.law.function is not None

    @property
    def integrator(self) -> str:
        """Integrator of a loading that suits the state: the midpoint rule where it is a strain that takes no time."""
        if self.law is None or (self.law.declared.state_is_strain and not self.law.declared.time):
            return MIDPOINT
        return BACKWARD_EULER

    @property
    def symmetric(self) -> bool:
        """Whether the tangent is."""
        return self.law is None or self.law.symmetric

    @property
    def relaxes(self) -> bool:
        """Whether volumetric strain within a cell that flows can relax, see solver/relaxation.hpp."""
        return self.worked_strength < inf

    @property
    def worked_strength(self) -> float:
        """Strength at a plastic strain of WORKED, infinite where nothing can relax [force/length^2]."""
        if self.law is not None:
            strength = self.law.strength(WORKED)
            return inf if strength is None else max(strength / self.law.unit, self.yield_strength or 0.0)
        return inf if self.yield_strength is None else self.yield_strength + WORKED * self.plastic_modulus

    @property
    def in_ufl(self) -> laws.Law:
        """The law as a function in UFL."""
        if self.law is not None:
            return self.law
        if self.yield_strength is None:
            return laws.law_of_function(shipped.hooke, {"E": self.E, "nu": self.nu})
        names = ("E", "nu", "yield_strength", "tangent_modulus", "kinematic_share")
        return laws.law_of_function(shipped.j2, {name: getattr(self, name) for name in names})

    @property
    def finite(self) -> bool:
        """Whether strains and rotations may be large."""
        return self.kinematics == "finite"

    def check_decided(self) -> None:
        """Refuse a material whose law is code not run, or whose kinematics is "auto", not chosen yet (InputError)."""
        self.check_run()
        if self.kinematics == AUTO:
            raise InputError(
                'material.kinematics = "auto" is chosen by asp.run: in a script call asp.choose_kinematics first, or '
                'take "finite"'
            )

    def check_run(self) -> None:
        """Refuse a law in a file that has not been run (InputError)."""
        if self.law is not None and not self.has_run:
            laws.refuse(
                self.law.source,
                "is code, which runs with all your rights: read that file, then give --allow-code to asperity run (in "
                "Python allow_code=True)",
            )

    @property
    def linear(self) -> bool:
        """Whether stresses are proportional to displacements."""
        return not (self.plastic or self.finite or self.law)

    @property
    def reduced_modulus(self) -> float:
        """E' = E/(1 - nu^2), the composite modulus against a rigid flat [force/length^2]."""
        return self.E / (1.0 - self.nu**2)

    @property
    def confined_modulus(self) -> float:
        """M = lambda + 2 mu, the modulus of uniaxial strain [force/length^2]."""
        return self.E * (1.0 - self.nu) / ((1.0 + self.nu) * (1.0 - 2.0 * self.nu))

    def block_modulus(self, sides: str) -> float:
        """Mean pressure over strain of a uniformly compressed block [force/length^2]."""
        return self.E if sides == "free" else self.confined_modulus

    def yield_pressure(self, sides: str) -> float:
        """Mean pressure at which a uniformly compressed block yields [force/length^2]; infinite if it is elastic.

        By von Mises (Johnson, Contact Mechanics, 1985, eq. 6.1): in uniaxial stress with free sides, else in uniaxial
        strain, where under the pressure p the equivalent stress is p (1 - 2 nu)/(1 - nu).
        """
        if self.yield_strength is None:
            return inf
        return self.yield_strength * (1.0 if sides == "free" else (1.0 - self.nu) / (1.0 - 2.0 * self.nu))

    @property
    def lame(self) -> tuple[float, float]:
        """First Lame modulus and shear modulus [force/length^2]."""
        mu = 0.5 * self.E / (1.0 + self.nu)
        return 2.0 * mu * self.nu / (1.0 - 2.0 * self.nu), mu

    @property
    def kinematic_share(self) -> float:
        """Share of the hardening that is kinematic, in [0, 1]."""
        return SHARES[self.hardening] if isinstance(self.hardening, str) else self.hardening

    @property
    def plastic_modulus(self) -> float:
        """Plastic modulus H = E E_t/(E - E_t) [force/length^2]."""
        return self.E * self.tangent_modulus / (self.E - self.tangent_modulus)

    def scaled(self, stress: float) -> Material:
        """The same material with stresses in units of `stress` [force/length^2]."""
        strength = None if self.yield_strength is None else self.yield_strength / stress
        law = None if self.law is None else self.law.scaled(stress)
        slope = self.tangent_modulus / stress
        return replace(self, E=self.E / stress, yield_strength=strength, tangent_modulus=slope, law=law)

    @property
    def compiled(self) -> dict[str, float]:
        """Parameters of the law in solver/j2.hpp: moduli [force/length^2] and shares."""
        if self.law is not None:
            raise InputError(f'{laws.KEY} = "{self.law.source}" is in UFL, and this needs a compiled law')
        lam, mu = self.lame
        strength = inf if self.yield_strength is None else self.yield_strength
        hardens = {"hardening": self.plastic_modulus, "kinematic_share": self.kinematic_share}  # 0 without a strength
        return {"lam": lam, "mu": mu, "yield_stress": strength, **hardens}

    def elastic_energy(self, stress: Floats) -> Floats:
        """Elastic energy per volume of a stress (..., 6) [force/length^2]."""
        trace = stress[..., :3].sum(axis=-1)
        squared = np.einsum("...i,...i,i->...", stress, stress, PAIRS)
        energy: Floats = ((1.0 + self.nu) * squared - self.nu * trace**2) / (2.0 * self.E)
        return energy

    def back_stress(self, plastic_strain: Floats) -> Floats:
        """Centre of the yield surface after Prager, 2/3 beta H eps_p, both tensors (..., 6) [force/length^2]."""
        return 2.0 / 3.0 * self.kinematic_share * self.plastic_modulus * plastic_strain

    def hardening_energy(self, plastic_strain: Floats) -> Floats:
        """Energy per volume that the back stress stores, beta H eps_p:eps_p/3, of eps_p (..., 6) [force/length^2]."""
        energy: Floats = 0.5 * np.einsum("...i,...i,i->...", self.back_stress(plastic_strain), plastic_strain, PAIRS)
        return energy

    def dissipated_energy(self, accumulated: Floats) -> Floats:
        """Energy per volume dissipated, sigma_y a + (1 - beta) H a^2/2, a the accumulated strain [force/length^2]."""
        if self.yield_strength is None:
            return np.zeros_like(accumulated)
        isotropic = (1.0 - self.kinematic_share) * self.plastic_modulus
        return accumulated * (self.yield_strength + 0.5 * isotropic * accumulated)
