"""Sliders in parallel, each a spring in series with a slider of Coulomb friction: a joint that remembers.

Jenkins elements (G. M. Jenkins, Br. J. Appl. Phys. 13 (1962) 30) in parallel are an Iwan law (W. D. Iwan, J. Appl.
Mech. 33 (1966) 893). They follow Masing's rules, and a harmonic motion of the amplitude a has the complex stiffness of
the describing function in closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.runtime.display import short_repr


@dataclass(frozen=True, eq=False)
class JenkinsArray:
    """Sliders in parallel.

    Attributes:
        k: stiffness of each (force/length), shape (n,)
        f: force at which each slips (force), shape (n,)

    Raises:
        InputError: they have other shapes, or a value is not positive

    Examples:
        One slider of stiffness 2 that slips at the force 1, moved to 1 and back to 0:

        >>> from asperity.slip import JenkinsArray
        >>> array = JenkinsArray([2.0], [1.0])
        >>> force, slipped = array.move(1.0, array.at_rest)
        >>> force, array.move(0.0, slipped)[0], array.energy(1.0).item()
        (1.0, -1.0, 2.0)
    """

    k: Array
    f: Array

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name in ("k", "f"):
            column = np.array(getattr(self, name), float)
            column.flags.writeable = False
            object.__setattr__(self, name, column)
        if self.k.ndim != 1 or self.k.shape != self.f.shape or not (np.all(self.k > 0) and np.all(self.f > 0)):
            raise InputError("sliders need a positive stiffness and a positive force each")

    @classmethod
    def through(cls, u: Array, force: Array) -> JenkinsArray:
        """Sliders whose first loading is straight between points, displacements (length) and forces (force) (n,).

        It goes from the origin to the last point, the limit. Points below the straight line between their neighbours
        are left out: no slider has a negative stiffness.
        """
        x, y, k = [0.0], [0.0], [np.inf]  # points kept, and the slope before each
        for row in np.column_stack([u, force]):
            at, to = float(row[0]), float(row[1])
            while (slope := (to - y[-1]) / (at - x[-1])) >= k[-1]:
                del x[-1], y[-1], k[-1]
            x.append(at)
            y.append(to)
            k.append(slope)
        alone = -np.diff([*k[1:], 0.0])
        return cls(alone, alone * np.array(x[1:]))

    @property
    def at_rest(self) -> Array:
        """State before any slip: the position of each slider (length), shape (n,)."""
        return np.zeros(self.k.shape)

    @property
    def limit(self) -> float:
        """Force at which all slip (force)."""
        return float(self.f.sum())

    @property
    def k_rest(self) -> float:
        """Stiffness before any slip (force/length)."""
        return float(self.k.sum())

    def move(self, u: float, state: Array) -> tuple[float, Array]:
        """Force and new state at a displacement (length), monotonic since the last state, `at_rest` first (n,)."""
        reach = self.f / self.k
        after = np.clip(state, u - reach, u + reach)
        return float(self.k @ (u - after)), after

    def follow(self, path: Sequence[float] | Array) -> Array:
        """Forces along displacements (n,) that start at rest (force), shape (n,)."""
        state, forces = self.at_rest, []
        for u in path:
            force, state = self.move(float(u), state)
            forces.append(force)
        return np.array(forces)

    def energy(self, a: ArrayLike) -> Array:
        """Energy of a closed loop between -a and a (force length), shape of `a`."""
        beyond = np.maximum(np.asarray(a, float)[..., None] - self.f / self.k, 0.0)
        return np.asarray(4.0 * beyond @ self.f)

    def complex_stiffness(self, a: ArrayLike) -> Array:
        """First harmonic of the force over a harmonic displacement of amplitudes a > 0 (force/length).

        The real part is in phase; the imaginary one is W/(pi a^2). An element that slips has
        k (theta - sin(2 theta)/2)/pi with cos(theta) = 1 - 2 f/(k a).
        """
        a = np.asarray(a, float)
        theta = np.arccos(1.0 - 2.0 * np.minimum(self.f / (self.k * a[..., None]), 1.0))
        real = (theta - 0.5 * np.sin(2.0 * theta)) @ self.k / np.pi
        return np.asarray(real + 1j * self.energy(a) / (np.pi * a**2))
