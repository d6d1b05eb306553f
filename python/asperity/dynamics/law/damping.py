# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Damping models: where in the cycle the damper acts.

All are written ``2 zeta g(u) u'`` with ``g(0) = 1``, so zeta is the damping ratio of small motion:

    "always"         g = 1                     a dashpot to ground; limits every resonance
    "contact"        g = 1 in contact, else 0  acts only while the bodies touch
    "hunt-crossley"  g = F_s / W               proportional to the contact force (Hunt & Crossley 1975)
    `LoopDamping`    g = 1 + h(|u|)/zeta       in contact, else 0; h makes each amplitude lose what its loop loses

With ``G(u)``, the integral of g from 0, and Lienard's variable ``w = u' + 2 zeta G(u)``, the motion obeys
``u' = w - 2 zeta G(u), w' = F^ cos(Omega tau) - f(u)``. The right-hand side is continuous at contact loss for
every model.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.law.loop_damping import LoopDamping
from asperity.dynamics.law.restoring import Restoring
from asperity.errors import InputError

DAMPING = ("always", "contact", "hunt-crossley")
LOOPS = "loops"  # name of the damping of the loops that a run has computed
Damping = str | LoopDamping


def check_damping(damping: Damping, zeta: float) -> Damping:
    """Return `damping` for a damping ratio; raise `InputError` unless it is one of `DAMPING` or that of loops."""
    if isinstance(damping, LoopDamping):
        if not zeta > 0.0:
            raise InputError(
                f"zeta = {zeta:g} with the damping of loops is not legal: give what the loops do not contain "
                "(micro-slip, radiation, the clamping), more than 0"
            )
        return replace(damping, background=zeta)
    if damping == LOOPS:
        raise InputError(
            'damping = "loops" needs loops.csv in the folder of the run: compute it with the section [loops]'
        )
    if damping not in DAMPING:
        raise InputError(f'damping = "{damping}" is unknown: choose one of {", ".join(DAMPING)}')
    return damping


def only_in_contact(damping: Damping) -> bool:
    """Return whether the damping is bounded where the mass flies most of the time: it may not limit a resonance."""
    return damping == "contact" or isinstance(damping, LoopDamping)


def rate(restoring: Restoring, damping: Damping, u: Array) -> Array:
    """Return the damping factor g(u), same shape as `u`."""
    if isinstance(damping, LoopDamping):
        added = damping.coefficient(restoring.z_s * np.abs(u)) / damping.background
        return np.where(u > -1.0, 1.0 + added, 0.0)
    if damping == "always":
        return np.ones_like(u)
    if damping == "contact":
        return np.where(u > -1.0, 1.0, 0.0)
    return restoring.n_loc * restoring.pull(u)[0]


def primitive(restoring: Restoring, damping: Damping, u: Array) -> Array:
    """Return the integral G(u) of the damping factor from 0; constant in flight except for "always"."""
    if isinstance(damping, LoopDamping):
        u = np.maximum(u, -1.0)
        added = damping.integral(restoring.z_s * np.abs(u)) / (restoring.z_s * damping.background)
        return np.asarray(u + np.sign(u) * added)
    if damping == "always":
        return u
    if damping == "contact":
        return np.maximum(u, -1.0)
    return restoring.n_loc * restoring.potential(u) + u


def in_flight(damping: Damping) -> bool:
    """Return whether the damper also acts while contact is lost."""
    return damping == "always"
