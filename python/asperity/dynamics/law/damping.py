# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Damping models: where in the cycle the damper acts.

All are written ``2 zeta g(u) u'`` with ``g(0) = 1``, so zeta is the damping ratio of small motion:

    "always"         g = 1                     a dashpot to ground; limits every resonance
    "contact"        g = 1 in contact, else 0  acts only while the bodies touch
    "hunt-crossley"  g = F_s / W               proportional to the contact force (Hunt & Crossley 1975)

With ``G(u)``, the integral of g from 0, and Lienard's variable ``w = u' + 2 zeta G(u)``, the motion obeys
``u' = w - 2 zeta G(u), w' = F^ cos(Omega tau) - f(u)``. The right-hand side is continuous at contact loss for
every model.
"""

from __future__ import annotations

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.law.restoring import Restoring
from asperity.errors import InputError

DAMPING = ("always", "contact", "hunt-crossley")


def check_damping(damping: str) -> str:
    """Return `damping`; raise `InputError` unless it is one of `DAMPING`."""
    if damping not in DAMPING:
        raise InputError(f'damping = "{damping}" is unknown: choose one of {", ".join(DAMPING)}')
    return damping


def rate(restoring: Restoring, damping: str, u: Array) -> Array:
    """Return the damping factor g(u), same shape as `u`."""
    if damping == "always":
        return np.ones_like(u)
    if damping == "contact":
        return np.where(u > -1.0, 1.0, 0.0)
    return restoring.n_loc * restoring.pull(u)[0]


def primitive(restoring: Restoring, damping: str, u: Array) -> Array:
    """Return the integral G(u) of the damping factor from 0; constant in flight except for "always"."""
    if damping == "always":
        return u
    if damping == "contact":
        return np.maximum(u, -1.0)
    return restoring.n_loc * restoring.potential(u) + u


def in_flight(damping: str) -> bool:
    """Return whether the damper also acts while contact is lost."""
    return damping == "always"
