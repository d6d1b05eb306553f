# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Vibration of a mass on a contact, from the static law of its force over the approach.

`run_dynamics` does the whole analysis for a curve and writes the result files. NumPy and SciPy suffice.

Examples:
    >>> oscillator = asp.ContactOscillator(asp.PowerLaw(1.5), zeta=0.01)
    >>> oscillator.free([0.1, 0.2]).omega_ratio.round(6)
    array([0.999575, 0.998259])
    >>> omega, u_max = oscillator.response(0.01, (0.9, 1.1), tol=1e-4).peak
    >>> print(f"{omega:.3f}, {u_max:.3f}")
    0.989, 0.483
"""

from asperity.dynamics.equation import Restoring
from asperity.dynamics.forcing import Setting
from asperity.dynamics.joint import Joint
from asperity.dynamics.law.law import Law
from asperity.dynamics.law.local_fit import LocalFit
from asperity.dynamics.law.loop_damping import LoopDamping
from asperity.dynamics.law.power import PowerLaw
from asperity.dynamics.law.table import TableLaw, unload_reload
from asperity.dynamics.law.tangent import TangentLaw
from asperity.dynamics.law.taylor import TaylorLaw
from asperity.dynamics.law.two_branches import TwoBranchLaw
from asperity.dynamics.laws import LawAtLoad, LawTable
from asperity.dynamics.motion.sweep import Attractor, Sweep
from asperity.dynamics.motion.trajectory import Trajectory
from asperity.dynamics.orbits.branch import Branch, Event, Solution
from asperity.dynamics.orbits.free import FreeOrbit, FreeVibration
from asperity.dynamics.orbits.response import FrequencyResponse
from asperity.dynamics.orbits.thresholds import Backbone, Thresholds
from asperity.dynamics.oscillator import ContactOscillator
from asperity.dynamics.results import Dynamics
from asperity.dynamics.run import law_from, run_dynamics
from asperity.dynamics.uncertainty import Band, Uncertainty, ensemble, response_band, uncertainty

__all__ = [
    "Attractor",
    "Backbone",
    "Band",
    "Branch",
    "ContactOscillator",
    "Dynamics",
    "Event",
    "FreeOrbit",
    "FreeVibration",
    "FrequencyResponse",
    "Joint",
    "Law",
    "LawAtLoad",
    "LawTable",
    "LocalFit",
    "LoopDamping",
    "PowerLaw",
    "Restoring",
    "Setting",
    "Solution",
    "Sweep",
    "TableLaw",
    "TangentLaw",
    "TaylorLaw",
    "Thresholds",
    "Trajectory",
    "TwoBranchLaw",
    "Uncertainty",
    "ensemble",
    "law_from",
    "response_band",
    "run_dynamics",
    "uncertainty",
    "unload_reload",
]
