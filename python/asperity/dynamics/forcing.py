"""What a forced result was computed for, and which frequencies and forcings are legal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from asperity.dynamics.law.law import positives, within
from asperity.errors import InputError

OMEGA = (0.01, 100.0)  # slower, the deflection follows the force; faster, the mass stays where it is
FORCING = (1e-9, 1e6)  # fainter motion is linear in the forcing, and lost in the round-off of the force
LIGHTEST = 1e-4  # damping ratio of motion that settles in 20000 periods


@dataclass(frozen=True)
class Setting:
    """What a forced result was computed for.

    Attributes:
        model: "exact" or "taylor".
        law: description of the law.
        n_loc: local exponent at the operating point.
        zeta, damping: damping ratio and model.
        F_hat: forcing F/(n_loc m g).
        F_over_mg: forcing over the preload, n_loc F_hat (the sigma of the Hertz literature).
    """

    model: str
    law: str
    n_loc: float
    zeta: float
    damping: str
    F_hat: float

    @property
    def F_over_mg(self) -> float:
        """Forcing amplitude over the preload."""
        return self.n_loc * self.F_hat

    def describe(self) -> str:
        """One line for titles and logs."""
        return (
            f"{self.model}: {self.law}, zeta = {self.zeta:g} ({self.damping}), F^ = {self.F_hat:g}, "
            f"F/(m g) = {self.F_over_mg:g}"
        )


def frequencies(values: Any) -> tuple[float, ...]:
    """Return one Omega or several, or raise `InputError` unless all are legal."""
    return tuple(within("omega", value, OMEGA) for value in positives("omega", values))


def forcings(values: Any) -> tuple[float, ...]:
    """Return one F^ or several, or raise `InputError` unless all are legal."""
    return tuple(within("forcing", value, FORCING) for value in positives("forcing", values))


def window(omega: Sequence[float]) -> tuple[float, float]:
    """Return lowest and highest Omega, or raise `InputError`."""
    values = frequencies(omega)
    if len(values) != 2 or values[0] >= values[1]:
        raise InputError(f"omega = {list(values)} is not legal: give two frequencies 0 < low < high")
    return values[0], values[1]
