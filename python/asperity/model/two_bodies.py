"""Two rough bodies as one rough body under a rigid flat: E' and z1 + z2.

Two elastic half-spaces with small slopes and no friction deform at a point under a pressure p there in proportion to
1/E'_1 and 1/E'_2, so only the sum of the displacements and the sum of the heights matter (Johnson, Contact
Mechanics, 1985, section 4.1 and 13.3): the pressure, the contact area and the approach are those of one body of
modulus E' with the surface z1 + z2 under a rigid flat. Of two bodies of one metal that yields the one has half the
modulus and half the slope beyond yield, and the same strength: under the same stress it deforms twice as far.
docs/measured.md lists the limits.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.model.material import Material
from asperity.runtime.files import npz_bytes, replace_file
from asperity.surface import Surface


def equivalent_block(
    first: Material, second: Material, heights: tuple[float, float], *, sides: str = "rollers", nu: float = 0.3
) -> tuple[Material, float]:
    """Material and height [length] of the one block that represents two, as compliant under a uniform pressure.

    Args:
        first, second: the bodies; elastic, or of one metal that yields
        heights: of their blocks [length]
        sides: of all blocks, "rollers" or "free"
        nu: Poisson's ratio to give an elastic equivalent one; free to choose, because only E' enters the contact

    Raises:
        InputError: one yields and the other is of another metal, a body has finite strain, or a height is not positive

    Examples:
        >>> steel = asp.Material(E=200e9, nu=0.3)
        >>> material, height = equivalent_block(steel, steel, (1e-6, 1e-6))
        >>> round(material.E / 1e9, 6), round(height * 1e6, 6)
        (100.0, 1.0)
    """
    if not first.kinematics == second.kinematics == "small":
        raise InputError("two bodies have an equivalent single one in small strain only; leave material.kinematics out")
    if first.law is not None or second.law is not None:
        raise InputError("bodies with a law in UFL have no equivalent single one here; leave material.law out")
    yields = first.yield_strength is not None or second.yield_strength is not None
    if yields and first != second:
        raise InputError(
            "two bodies of which one yields have an equivalent single one only if they are of the same metal; with "
            "twice the yield strength in one of them its force is 2 to 6 % too small (docs/measured.md)"
        )
    if min(heights) <= 0:
        raise InputError(f"heights = {heights} must be positive lengths")
    if yields:
        material = replace(first, E=0.5 * first.E, tangent_modulus=0.5 * first.tangent_modulus)
    else:
        E_prime = 1.0 / (1.0 / first.reduced_modulus + 1.0 / second.reduced_modulus)
        material = Material(E_prime * (1 - nu**2), nu)
    compliance = sum(h / body.block_modulus(sides) for h, body in zip(heights, (first, second), strict=True))
    return material, compliance * material.block_modulus(sides)


@dataclass(frozen=True, eq=False, kw_only=True)
class SumSurface(Surface):
    """z1(x, y) + z2(L - x, y): two surfaces that face each other, each seen from its own outside.

    Attributes:
        L: side of the patch [length]; that of both
        first: the lower surface, heights upwards
        second: the upper surface as it lies on a table, heights upwards; turned over about the y direction to face
            the first

    Examples:
        >>> wave = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.01)
        >>> both = SumSurface.of(wave, wave)
        >>> round(float(both.height(0.5, 0.2) / wave.height(0.5, 0.2)), 6)
        2.0
    """

    L: float
    first: Surface
    second: Surface

    rough: ClassVar[bool] = True
    about: ClassVar[dict[str, int]] = {"bodies": 2}  # as `HeightMap.about` has it

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (np.isclose(self.first.L, self.L) and np.isclose(self.second.L, self.L)):
            sides = f"{self.first.L:g} and {self.second.L:g}"
            raise InputError(f"surfaces of sides {sides} have no sum on a side {self.L:g}: cut both to one side")

    @staticmethod
    def of(first: Surface, second: Surface) -> SumSurface:
        """Sum of two surfaces on patches of one side."""
        return SumSurface(L=first.L, first=first, second=second)

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return np.asarray(self.first.height(x, y) + self.second.height(self.L - np.asarray(x), y))

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        ax, ay = self.first.gradient(x, y)
        bx, by = self.second.gradient(self.L - np.asarray(x), y)
        return ax - bx, ay + by

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        axx, axy, ayy = self.first.hessian(x, y)
        bxx, bxy, byy = self.second.hessian(self.L - np.asarray(x), y)
        return axx + bxx, axy - bxy, ayy + byy

    def on_product(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> Array:
        turned = self.second.on_product((self.L - x)[::-1], y, dx, dy)[:, ::-1]
        return np.asarray(self.first.on_product(x, y, dx, dy) + (-1) ** dx * turned)

    def mean(self) -> float:
        return self.first.mean() + self.second.mean()

    def curvature_bound(self) -> float:
        return self.first.curvature_bound() + self.second.curvature_bound()

    @property
    def feature_size(self) -> float:
        """The smaller feature of the two [length]."""
        return min(self.first.feature_size, self.second.feature_size)

    @property
    def periodic(self) -> bool:
        """Whether both are."""
        return self.first.periodic and self.second.periodic

    def short_waves(self, wavelength: float, depth: float) -> float:
        return math.hypot(*(surface.short_waves(wavelength, depth) for surface in (self.first, self.second)))

    def smoothed(self, x: ArrayLike, y: ArrayLike, s: ArrayLike) -> Array:
        return np.asarray(self.first.smoothed(x, y, s) + self.second.smoothed(self.L - np.asarray(x), y, s))

    def save(self, path: str | Path, n: int = 513) -> Path:
        """Write heights on an n x n grid as .npz, for kind = "file" in a case; return the path."""
        path = Path(path).with_suffix(".npz")
        about = np.frombuffer(json.dumps(self.about).encode(), dtype=np.uint8)
        replace_file(path, npz_bytes({"z": self.grid(n), "L": np.array(self.L), "about": about}, compress=True))
        return path
