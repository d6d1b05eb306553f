"""Python modules with the contact and the slip of a joint for other programs; they need NumPy alone."""

from __future__ import annotations

from collections.abc import Sequence

from asperity.arrays import Array
from asperity.runtime.display import comment
from asperity.slip import SlipLaw

SLIDERS = 20  # of an exported array
_LIGHTEST = 0.02  # force over the limit below which none of them slips

_CONTACT = '''"""Contact of a rough surface: force and stiffness over the approach of the mean planes.

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


_SLIDERS = '''"""Tangential force of a joint: sliders in parallel, which remember.

{about}

    from sliders import Sliders
    joint = Sliders(area=1e-4, pressure=1e6)
    force = joint(u)       # trial, at a displacement u
    joint.accept(u)        # the end of a step
"""

import numpy as np

FRICTION = {friction!r}
AREA, PRESSURE = {area!r}, {pressure!r}  # nominal
K = np.array({k})  # stiffness over the nominal area
F = np.array({f})  # force at which a slider slips, over friction times pressure


class Sliders:
    """Jenkins elements in parallel; `area` and `pressure` nominal. The stiffness is that of `PRESSURE`."""

    def __init__(self, area=AREA, pressure=PRESSURE):
        self.k, self.f = area * K, FRICTION * pressure * area * F
        self.at = np.zeros(len(K))  # position of each slider

    def _moved(self, u):
        return np.clip(self.at, u - self.f / self.k, u + self.f / self.k)

    def __call__(self, u):
        """Force at a displacement, monotonic since the last accepted one."""
        return float(self.k @ (u - self._moved(u)))

    def accept(self, u):
        """Keep the slip of a displacement."""
        self.at = self._moved(u)
'''


def contact_module(z: Array, p: Array, d: Array, area: float, about: Sequence[str]) -> str:
    """Source of the module with force and stiffness.

    Args:
        z, p, d: approaches from 0 [length], nominal pressures and slopes dp/dz of the monotone cubic, (m,) each
        area: nominal area [length^2]
        about: lines of its docstring
    """
    listed = {name: values.tolist() for name, values in (("z", z), ("p", p), ("d", d))}
    return _CONTACT.format(about="\n".join(map(comment, about)), area=float(area), **listed)


def sliders_module(law: SlipLaw, patch: float, area: float, about: Sequence[str]) -> str:
    """Source of the module with the tangential force, sliders in parallel.

    Args:
        law: of the patch
        patch, area: nominal areas of the patch and of the joint [length^2]
        about: lines of its docstring, after those of the slip
    """
    array, pressure = law.array(SLIDERS, _LIGHTEST), law.preload / patch
    known = (
        "slip of a rough joint, without the block",
        f"friction {law.friction:g}, nominal pressure {pressure:.6g}",
        f"stiffness at rest over the nominal area {law.k_tangent(0.0) / patch:.6g}",
    )
    return _SLIDERS.format(
        about="\n".join(map(comment, (*known, *about))), friction=law.friction, area=area, pressure=pressure,
        k=(array.k / patch).tolist(), f=(array.f / law.limit).tolist(),
    )  # fmt: skip
