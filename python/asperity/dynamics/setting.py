"""What a forced result was computed for."""

from __future__ import annotations

from dataclasses import dataclass


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
