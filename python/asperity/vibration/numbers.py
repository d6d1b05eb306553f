"""Numbers of the small vibration about a load, of a joint or of a patch, and the lines that print them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from asperity.units import plus_minus, quantity
from asperity.vibration.law import NOT_RESOLVED, Law, bar_of, bend


@dataclass(frozen=True)
class Numbers:
    """The numbers of a joint's small vibration, in the units of the curve; NaN where unknown.

    Attributes:
        stiffness: k_n at the preload, of the interface alone where the block of the model is known (force/length)
        mass, frequency: what vibrates (mass), and its natural frequency (1/time)
        approach: static approach z_s (length)
        damping: damping ratio
        n, kappa: local exponent and backbone curvature
        bars: of the stiffness over it, of n and of kappa
        block: compliance of the block of the model beside the joint (length/force), 0 where the stiffness contains it
        greatest: force that the contact has met (force)
    """

    stiffness: float
    mass: float
    frequency: float
    approach: float
    damping: float
    n: float = math.nan
    kappa: float = math.nan
    bars: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    block: float = 0.0
    greatest: float = math.nan

    @classmethod
    def of(cls, law: Law, load: float, mass: float, zeta: float, **more: Any) -> Numbers:
        """Numbers of a mass on a law under a load (force)."""
        z, k, n, kappa = map(float, law.at_load(load))
        _, of_k, of_n, of_kappa = map(float, bar_of(law, lambda side: side.at_load(load)))
        frequency = math.sqrt(k / mass) / (2.0 * math.pi)
        return cls(k, mass, frequency, z, zeta, n, kappa, (of_k / k, of_n, of_kappa), **more)

    @property
    def frequency_bar(self) -> float:
        """Error bar of the frequency (1/time), which is a root of the stiffness; NaN if unknown."""
        return 0.5 * self.bars[0] * self.frequency

    @property
    def softening(self) -> str:
        """ "softening", "hardening", "linear", or "curvature not resolved" where the bar of kappa holds 0."""
        bar = self.bars[2] if self.bars[2] > 0.0 else 0.0
        return bend(self.kappa - bar, self.kappa + bar)

    @property
    def with_block(self) -> float:
        """Stiffness of the interface and the block of the model in series (force/length)."""
        return self.stiffness / (1.0 + self.block * self.stiffness)

    def sentence(self, units: str | None) -> str:
        """Them as one line, with SI units if `units` is "SI"."""
        si, bar = units == "SI", self.bars[0]
        parts = [f"k_n = {quantity(self.stiffness, 'N/m' if si else '', 5, bar=bar)}"]
        if math.isfinite(self.mass):
            parts.append(f"m = {self.mass:.5g}{' kg' if si else ''}")
            parts.append(f"f = {quantity(self.frequency, 'Hz' if si else '', 5, bar=0.5 * bar)}")
        else:
            parts.append("m and f unknown (give joint.mass)")
        parts += [f"z_s = {quantity(self.approach, 'm' if si else '')}", f"zeta = {self.damping:.5g}"]
        parts += [resolved("n", self.n, self.bars[1]), resolved("kappa", self.kappa, self.bars[2])]
        return ", ".join(parts)

    def to_dict(self) -> dict[str, Any]:
        """Section "numbers" of thresholds.json, None where unknown; `k_n_bar` is over k_n."""
        values = {
            "k_n": self.stiffness, "m": self.mass, "f": self.frequency, "z_s": self.approach, "zeta": self.damping,
            "n": self.n, "kappa": self.kappa, "k_n_bar": self.bars[0], "f_bar": self.frequency_bar,
            "n_bar": self.bars[1], "kappa_bar": self.bars[2],
            "k_n_with_block": self.with_block if self.block else math.nan, "greatest_load": self.greatest,
        }  # fmt: skip
        known = {name: value if math.isfinite(value) else None for name, value in values.items()}
        return known | {"softening": self.softening}


def resolved(name: str, value: float, bar: float) -> str:
    """A value with its bar, or that it is not resolved where the bar is wider than the value."""
    if not math.isfinite(value):
        return f"{name} unknown"
    if bar > abs(value) > 0.0:
        return NOT_RESOLVED if name == "kappa" else f"{name} unresolved"
    return f"{name} = {plus_minus(value, bar)}"
