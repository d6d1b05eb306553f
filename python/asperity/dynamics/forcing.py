# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Setting of a forced result, and the legal frequencies and forcings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from asperity.dynamics.law.checks import positives, within
from asperity.errors import InputError

OMEGA = (0.01, 100.0)  # below, motion is quasi-static; above, the mass hardly moves
FORCING = (1e-9, 1e6)  # below, motion is linear in the forcing and lost in the round-off of the force
MIN_ZETA = 1e-4  # smallest damping ratio with which motion settles in 20000 periods


@dataclass(frozen=True)
class Setting:
    """Law, damping and forcing of a forced result.

    Attributes:
        model: "exact" or "taylor"
        law: description of the law
        n_loc: local exponent at the operating point
        zeta, damping: damping ratio and model
        F_hat: forcing F/(n_loc W), W the preload
        F_over_mg: forcing over the preload, n_loc F_hat (sigma in the Hertz literature)

    Examples:
        >>> print(asp.ContactOscillator(asp.PowerLaw(1.5)).setting(0.02).describe())
        exact: power law n = 1.5, K = 1, zeta = 0.01 (always), F^ = 0.02, F/W = 0.03
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
            f"F/W = {self.F_over_mg:g}"
        )


def frequencies(values: Any, name: str = "omega") -> tuple[float, ...]:
    """One Omega or several as a tuple; raise `InputError` unless all are legal."""
    return tuple(within(name, value, OMEGA) for value in positives(name, values))


def forcings(values: Any, name: str = "forcing") -> tuple[float, ...]:
    """One F^ or several as a tuple; raise `InputError` unless all are legal."""
    return tuple(within(name, value, FORCING) for value in positives(name, values))


def window(omega: Sequence[float], name: str = "omega") -> tuple[float, float]:
    """Lowest and highest Omega; raise `InputError` unless they are a legal window."""
    values = frequencies(omega, name)
    if len(values) != 2 or values[0] >= values[1]:
        raise InputError(f"{name} = {list(values)} is not legal: give two frequencies 0 < low < high")
    return values[0], values[1]
