"""Isotropic elasticity and J2 plasticity with bilinear isotropic hardening."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from asperity.errors import InputError


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

    Examples:
        >>> steel = asp.Material(E=200e9, nu=0.3, yield_strength=1e9, tangent_modulus=20e9)
        >>> steel.plastic, round(steel.reduced_modulus / 1e9, 3), round(steel.hardening / 1e9, 3)
        (True, 219.78, 22.222)
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
    def parameters(self) -> tuple[float, float, float, float]:
        """(lambda, mu, yield stress, H) as the kernels take them; an elastic material never yields."""
        strength = float("inf") if self.yield_strength is None else self.yield_strength
        return (*self.lame, strength, self.hardening)


def return_map_ufl(
    strain: Any, plastic_strain: Any, alpha: Any, lam: Any, mu: Any, strength: Any, hardening: Any
) -> tuple[Any, Any, Any]:
    """Radial return in closed form: the readable twin of the compiled kernel.

    Simo & Hughes, Computational Inelasticity (1998), box 3.2, with linear isotropic hardening, for which the
    consistency condition is linear in the plastic multiplier.

    Args:
        strain: total strain, UFL tensor (3, 3)
        plastic_strain: committed plastic strain, UFL tensor (3, 3), deviatoric
        alpha: committed accumulated plastic strain
        lam, mu: Lame moduli [force/length^2]
        strength: initial yield stress [force/length^2]
        hardening: plastic modulus H [force/length^2]

    Returns:
        stress, plastic strain and accumulated plastic strain at the end of the step
    """
    import ufl

    bulk = lam + 2.0 * mu / 3.0
    s_trial = 2.0 * mu * (ufl.dev(strain) - plastic_strain)
    squared = 1.5 * ufl.inner(s_trial, s_trial)
    size = strength + hardening * alpha
    yields = ufl.gt(squared, size * size)
    # the square root is only differentiated where it is far from zero
    q = ufl.sqrt(ufl.conditional(yields, squared, size * size))
    dgamma = (q - size) / (3.0 * mu + hardening)
    stress = bulk * ufl.tr(strain) * ufl.Identity(3) + (1.0 - 3.0 * mu * dgamma / q) * s_trial
    return stress, plastic_strain + 1.5 * dgamma / q * s_trial, alpha + dgamma
