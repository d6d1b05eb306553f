# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Damping models: where in the cycle the damper acts.

All are written ``2 zeta g(u) u'`` with ``g(0) = 1``, so zeta is the damping ratio of small motion:

    "always"         g = 1                     a dashpot to ground; limits every resonance
    "contact"        g = 1 in contact, else 0  acts only while the bodies touch
    "hunt-crossley"  g = F_s / W               proportional to the contact force (Hunt & Crossley 1975)
    `LoopDamping`    g = 1 + h(|u|)/zeta       in contact, else 0; h makes each amplitude lose what its loop loses
"""

from __future__ import annotations

from dataclasses import replace

from asperity.dynamics.law.loop_damping import LoopDamping
from asperity.errors import InputError

DAMPING = ("always", "contact", "hunt-crossley")
LOOPS = "loops"  # name of the damping of the loops that a run has computed
Damping = str | LoopDamping


def check_damping(damping: Damping, zeta: float) -> Damping:
    """`damping` for a damping ratio; raise `InputError` unless it is one of `DAMPING` or that of loops."""
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
    """Whether the damping is bounded where the mass flies most of the time: it may not limit a resonance."""
    return damping == "contact" or isinstance(damping, LoopDamping)


def in_flight(damping: Damping) -> bool:
    """Whether the damper also acts while contact is lost."""
    return damping == "always"
