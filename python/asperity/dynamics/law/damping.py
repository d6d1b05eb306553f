"""Damping models: where in the cycle the damper acts.

All are written ``2 zeta g(u) u'`` with ``g(0) = 1``, so zeta is the damping ratio of small motion:

    "always"         g = 1                    a dashpot to ground; closes every resonance
    "contact"        g = 1 in contact, else 0 acts only while the bodies touch
    "hunt-crossley"  g = F_s / W              proportional to the contact force (Hunt & Crossley 1975)

With ``G(u)``, the integral of g from 0, and ``w = u' + 2 zeta G(u)`` (Lienard's variable) the motion obeys
``u' = w - 2 zeta G(u), w' = F^ cos(Omega tau) - f(u)``, whose right-hand side stays continuous at contact
loss for every model.
"""

from __future__ import annotations

import numpy as np

from asperity.dynamics.law.law import Array
from asperity.dynamics.law.restoring import Restoring
from asperity.errors import InputError

DAMPING = ("always", "contact", "hunt-crossley")


def check_damping(damping: str) -> str:
    """Return `damping`, or raise `InputError` when it is not one of `DAMPING`."""
    if damping not in DAMPING:
        raise InputError(f'damping = "{damping}" is unknown: choose one of {", ".join(DAMPING)}')
    return damping


def rate(restoring: Restoring, damping: str, u: Array) -> Array:
    """Damping factor g(u)."""
    if damping == "always":
        return np.ones_like(u)
    if damping == "contact":
        return np.where(u > -1.0, 1.0, 0.0)
    return restoring.n_loc * restoring.pull(u)[0]


def primitive(restoring: Restoring, damping: str, u: Array) -> Array:
    """Integral G(u) of the damping factor from 0; constant in flight except for "always"."""
    if damping == "always":
        return u
    if damping == "contact":
        return np.maximum(u, -1.0)
    return restoring.n_loc * restoring.potential(u) + u


def in_flight(damping: str) -> bool:
    """Whether the damper also acts while contact is lost."""
    return damping == "always"
