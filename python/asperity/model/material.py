"""Isotropic elasticity and J2 plasticity with bilinear isotropic hardening."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from asperity.arrays import Floats
from asperity.errors import InputError

PAIRS = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # in products of tensors (..., 6): off-diagonal components count twice


@dataclass(frozen=True)
class Material:
    """Elastic, or elastic-plastic when a yield strength is given.

    Attributes:
        E: elastic modulus [force/length^2]
        nu: Poisson's ratio
        yield_strength: uniaxial yield stress [force/length^2]; None for an elastic material
        tangent_modulus: slope of the uniaxial curve beyond yield [force/length^2]; 0 is perfectly plastic

    Raises:
        InputError: a value is outside its range
    """

    E: float
    nu: float
    yield_strength: float | None = None
    tangent_modulus: float = 0.0

    def __post_init__(self) -> None:
        if not self.E > 0:
            raise InputError(f"material.E = {self.E!r} must be positive")
        if not -1 < self.nu < 0.5:
            raise InputError(f"material.nu = {self.nu!r} must lie between -1 and 0.5")
        if self.yield_strength is not None and not self.yield_strength > 0:
            raise InputError(f"material.yield_strength = {self.yield_strength!r} must be positive")
        if not 0 <= self.tangent_modulus < self.E:
            raise InputError(f"material.tangent_modulus = {self.tangent_modulus!r} must lie in [0, E), E = {self.E!r}")

    @property
    def plastic(self) -> bool:
        """Whether the material can yield."""
        return self.yield_strength is not None

    @property
    def reduced_modulus(self) -> float:
        """E' = E/(1 - nu^2), the composite modulus against a rigid flat [force/length^2]."""
        return self.E / (1.0 - self.nu**2)

    @property
    def confined_modulus(self) -> float:
        """M = lambda + 2 mu, the modulus of uniaxial strain [force/length^2]."""
        return self.E * (1.0 - self.nu) / ((1.0 + self.nu) * (1.0 - 2.0 * self.nu))

    def block_modulus(self, sides: str) -> float:
        """Mean pressure over strain of a uniformly compressed block [force/length^2].

        Args:
            sides: "rollers" (uniaxial strain) or "free" (uniaxial stress)
        """
        return self.confined_modulus if sides == "rollers" else self.E

    @property
    def lame(self) -> tuple[float, float]:
        """First Lame modulus and shear modulus [force/length^2]."""
        mu = 0.5 * self.E / (1.0 + self.nu)
        return 2.0 * mu * self.nu / (1.0 - 2.0 * self.nu), mu

    @property
    def hardening(self) -> float:
        """Plastic modulus H = E E_t/(E - E_t) [force/length^2]."""
        return self.E * self.tangent_modulus / (self.E - self.tangent_modulus)

    def scaled(self, stress: float) -> Material:
        """The same material with stresses in units of `stress` [force/length^2]."""
        strength = None if self.yield_strength is None else self.yield_strength / stress
        return Material(self.E / stress, self.nu, strength, self.tangent_modulus / stress)

    @property
    def law(self) -> tuple[str, dict[str, float]]:
        """Name of the law in solver/laws.hpp and its parameters [force/length^2]."""
        lam, mu = self.lame
        if self.yield_strength is None:
            return "Elastic", {"lam": lam, "mu": mu}
        return "J2", {"lam": lam, "mu": mu, "yield_stress": self.yield_strength, "hardening": self.hardening}

    def respond_ufl(self, strain: Any, plastic_strain: Any, alpha: Any, parameters: Any) -> tuple[Any, Any, Any]:
        """Response of the law to a strain, in UFL: the readable twin of the compiled one.

        Args:
            strain: total strain, tensor (3, 3)
            plastic_strain: committed plastic strain, tensor (3, 3), deviatoric
            alpha: committed accumulated plastic strain
            parameters: of the law by name, numbers or UFL constants

        Returns:
            stress, plastic strain and accumulated plastic strain at the end of the step
        """
        if self.plastic:
            return return_map_ufl(strain, plastic_strain, alpha, **parameters)
        return hooke_ufl(strain, **parameters), plastic_strain, alpha

    def elastic_energy(self, stress: Floats) -> Floats:
        """Elastic energy per volume of a stress (..., 6) [force/length^2]."""
        trace = stress[..., :3].sum(axis=-1)
        squared = np.einsum("...i,...i,i->...", stress, stress, PAIRS)
        energy: Floats = ((1.0 + self.nu) * squared - self.nu * trace**2) / (2.0 * self.E)
        return energy

    def dissipated_energy(self, accumulated: Floats) -> Floats:
        """Energy per volume dissipated by plastic flow, sigma_y a + H a^2/2 [force/length^2].

        Args:
            accumulated: accumulated plastic strain a
        """
        if self.yield_strength is None:
            return np.zeros_like(accumulated)
        return accumulated * (self.yield_strength + 0.5 * self.hardening * accumulated)


def hooke_ufl(strain: Any, lam: Any, mu: Any) -> Any:
    """Stress of linear isotropic elasticity, the readable twin of solver/elastic.hpp."""
    import ufl

    return lam * ufl.tr(strain) * ufl.Identity(3) + 2.0 * mu * strain


def return_map_ufl(
    strain: Any, plastic_strain: Any, alpha: Any, lam: Any, mu: Any, yield_stress: Any, hardening: Any
) -> tuple[Any, Any, Any]:
    """Radial return in closed form: the readable twin of solver/j2.hpp.

    Simo & Hughes, Computational Inelasticity (1998), box 3.2, with linear isotropic hardening, for which the
    consistency condition is linear in the plastic multiplier.

    Args:
        strain: total strain, UFL tensor (3, 3)
        plastic_strain: committed plastic strain, UFL tensor (3, 3), deviatoric
        alpha: committed accumulated plastic strain
        lam, mu: Lame moduli [force/length^2]
        yield_stress: initial yield stress [force/length^2]
        hardening: plastic modulus H [force/length^2]

    Returns:
        stress, plastic strain and accumulated plastic strain at the end of the step
    """
    import ufl

    bulk = lam + 2.0 * mu / 3.0
    s_trial = 2.0 * mu * (ufl.dev(strain) - plastic_strain)
    squared = 1.5 * ufl.inner(s_trial, s_trial)
    size = yield_stress + hardening * alpha
    yields = ufl.gt(squared, size * size)
    # the square root is only differentiated where it is far from zero
    q = ufl.sqrt(ufl.conditional(yields, squared, size * size))
    dgamma = (q - size) / (3.0 * mu + hardening)
    stress = bulk * ufl.tr(strain) * ufl.Identity(3) + (1.0 - 3.0 * mu * dgamma / q) * s_trial
    return stress, plastic_strain + 1.5 * dgamma / q * s_trial, alpha + dgamma
