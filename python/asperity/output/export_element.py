"""Text of a Python module with the contact as an element for other programs; it needs NumPy alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from asperity.arrays import Array
from asperity.runtime.display import comment

_MODULE = '''"""Contact of a rough surface: force and stiffness over the approach of the mean planes.

{about}

    from contact import Contact
    element = Contact(area=1e-4)
    force, stiffness = element(z)      # of any shape; zero where z <= 0

The force is a monotone piecewise cubic with a continuous derivative, zero with zero slope where contact is lost, linear
beyond the last point. It is elastic: it has no damping, and no slip along the surface.
"""

import numpy as np

AREA = {area!r}  # nominal area
Z = np.array({z})  # approach
P = np.array({p})  # nominal pressure
D = np.array({d})  # slope dP/dZ


class Contact:
    """Force of the contact over the approach of the mean planes.

    Args:
        area: nominal area.
    """

    def __init__(self, area=AREA):
        self.area = area

    def __call__(self, z):
        """Return force and stiffness dF/dz at approaches z, of the same shape."""
        z = np.asarray(z, dtype=float)
        i = np.clip(np.searchsorted(Z, z, side="right") - 1, 0, len(Z) - 2)
        h = Z[i + 1] - Z[i]
        t = np.clip((z - Z[i]) / h, 0.0, 1.0)
        rise = (P[i + 1] - P[i]) / h
        b, c = 3 * rise - 2 * D[i] - D[i + 1], D[i] + D[i + 1] - 2 * rise
        p = P[i] + h * t * (D[i] + t * (b + t * c))
        d = D[i] + t * (2 * b + 3 * t * c)
        beyond = np.maximum(z - Z[-1], 0.0)
        p = np.where(z > 0.0, p + D[-1] * beyond, 0.0)
        d = np.where(z > Z[-1], D[-1], np.where(z > 0.0, d, 0.0))
        return self.area * p, self.area * d

    def force(self, z):
        """Return the force at approaches z."""
        return self(z)[0]

    def stiffness(self, z):
        """Return the stiffness dF/dz at approaches z."""
        return self(z)[1]

    def approach(self, force):
        """Return the approach at a force, the static position under a preload, by bisection."""
        low, high = np.zeros(np.shape(force)), np.full(np.shape(force), Z[-1])
        high = high + np.maximum(np.asarray(force) / self.area - P[-1], 0.0) / D[-1]
        for _ in range(100):
            middle = 0.5 * (low + high)
            below = self.force(middle) < force
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return 0.5 * (low + high)
'''


def python_module(z: Array, p: Array, d: Array, area: float, about: Sequence[str]) -> str:
    """Source of the module.

    Args:
        z: approaches from 0, rising, shape (m,) [length]
        p: nominal pressures from 0, shape (m,) [force/length^2]
        d: slopes dp/dz of the monotone cubic [force/length^3], shape (m,)
        area: nominal area [length^2]
        about: lines of its docstring
    """

    def listed(values: Array) -> str:
        rows = [", ".join(repr(float(x)) for x in values[i : i + 4]) for i in range(0, values.size, 4)]
        return "[\n    " + ",\n    ".join(rows) + ",\n]"

    return _MODULE.format(
        about="\n".join(map(comment, about)), area=float(area), z=listed(z), p=listed(p), d=listed(np.asarray(d))
    )
