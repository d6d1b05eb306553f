"""Isotropic elasticity, J2 plasticity with linear hardening, and laws in UFL."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np

from asperity.arrays import Floats
from asperity.errors import InputError
from asperity.laws import definition as laws
from asperity.laws import shipped, shipped_law
from asperity.model.limits import check
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT
from asperity.runtime.display import short_repr, show

AUTO = "auto"  # kinematics that a run chooses, see adaptive.small_strain
KINEMATICS = ("small", "finite", AUTO)
MODULI = "[1e-20, 1e40]"  # legal E [force/length^2]
POISSON_RATIOS = "[-0.9, 0.495]"  # legal nu; above, area and pressure are off by more than 1.2 % (docs/theory.md)
YIELD_STRAINS = (1e-7, 1.0)  # legal yield strength over E; the second one excluded
SHARES = {"isotropic": 0.0, "kinematic": 1.0}  # of the hardening that are kinematic
WORKED = 0.2  # plastic strain of the strength that says which pressures in a cell relax, see `fem.kernels`
PAIRS = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # in products of tensors (..., 6): off-diagonal components count twice


@dataclass(frozen=True)
class Material:
    """Elastic, or elastic-plastic when a yield strength is given.

    Attributes:
        E: elastic modulus [force/length^2]
        nu: Poisson's ratio
        yield_strength: uniaxial yield stress [force/length^2]; None for an elastic material
        tangent_modulus: slope of the uniaxial curve beyond yield [force/length^2]; 0 is perfectly plastic
        hardening: "isotropic" (the yield surface grows), "kinematic" (it moves, after Prager), or the share in [0, 1]
            of the hardening that is kinematic
        kinematics: "small" strain, "finite": the same law in logarithmic strain, or "auto": see
            `adaptive.small_strain.choose_kinematics`
        law: in UFL, in place of those of the other attributes, see `of_law`

    Raises:
        InputError: a value is outside its range

    Examples:
        >>> steel = asp.Material(E=200e9, nu=0.3, yield_strength=1e9, tangent_modulus=20e9, hardening="kinematic")
        >>> steel.plastic, round(steel.reduced_modulus / 1e9, 3), round(steel.plastic_modulus / 1e9, 3)
        (True, 219.78, 22.222)
        >>> steel.kinematic_share
        1.0
    """

    E: float
    nu: float
    yield_strength: float | None = None
    tangent_modulus: float = 0.0
    hardening: str | float = "isotropic"
    kinematics: str = "small"
    law: laws.Law | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        check(self, "material", E=MODULI, nu=POISSON_RATIOS, kinematics=KINEMATICS)
        (low, high), strength, slope = YIELD_STRAINS, self.yield_strength, self.tangent_modulus
        if strength is not None and not low <= strength / self.E < high:
            raise InputError(
                f"material.yield_strength = {strength:g} with E = {self.E:g} means yield at a strain of "
                f"{strength / self.E:.2g}, legal are {low:g} to {high:g}; give both in the same unit (Pa), or leave it "
                "out for an elastic material"
            )
        if not 0.0 <= slope < self.E:
            raise InputError(
                f"material.tangent_modulus = {slope:g} must be below material.E = {self.E:g}; 0 is perfectly plastic"
            )
        share = SHARES.get(self.hardening, -1.0) if isinstance(self.hardening, str) else self.hardening
        if not 0 <= share <= 1:
            raise InputError(
                f'material.hardening = {show(self.hardening)} must be "isotropic", "kinematic", or the kinematic '
                "share in [0, 1]"
            )
        if self.law is not None and self.law.hyperelastic and not self.finite:
            raise InputError(
                f'material.kinematics = "{self.kinematics}" cannot go with {laws.KEY} = "{self.law.source}", an energy '
                'of the deformation gradient: take "finite", or leave it out'
            )
        if share > 0 and self.yield_strength is None:
            raise InputError(
                f"material.hardening = {show(self.hardening)} needs material.yield_strength: give one, or leave "
                "material.hardening out of an elastic material"
            )

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
    def has_run(self) -> bool:
        """Whether the file of a law, which is code, has been run; true without one."""
        return self.law is None or self.law.function is not None

    @property
    def integrator(self) -> str:
        """Integrator of a loading that suits the state: the midpoint rule where it is a strain."""
        if self.law is None or self.law.declared.state_is_strain:
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
        yields = {"yield_stress": np.inf, "hardening": 0.0, "kinematic_share": 0.0}
        if self.yield_strength is not None:
            yields |= {"yield_stress": self.yield_strength, "hardening": self.plastic_modulus}
            yields |= {"kinematic_share": self.kinematic_share}
        return {"lam": lam, "mu": mu, **yields}

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
