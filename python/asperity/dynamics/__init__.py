"""Vibration of a mass on a contact, from its static force-deflection law.

    law = PowerLaw(1.5)
    oscillator = ContactOscillator(law, zeta=0.01)
    oscillator.free([0.1, 0.2]).omega_ratio
    oscillator.response(0.05).peak

NumPy and SciPy only. `run_dynamics` does all of it for a curve and writes the result files.
"""

from asperity.dynamics.branch import Branch, Event, Solution
from asperity.dynamics.free import FreeOrbit, FreeVibration
from asperity.dynamics.law import Law, PowerLaw, TaylorLaw
from asperity.dynamics.local_fit import LocalFit
from asperity.dynamics.oscillator import ContactOscillator
from asperity.dynamics.response import FrequencyResponse
from asperity.dynamics.restoring import Restoring
from asperity.dynamics.run import Dynamics, law_from, run_dynamics
from asperity.dynamics.setting import Setting
from asperity.dynamics.sweep import Attractor, Sweep
from asperity.dynamics.table import TableLaw, unload_reload
from asperity.dynamics.thresholds import Backbone, Thresholds
from asperity.dynamics.trajectory import Trajectory
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
    "Law",
    "LocalFit",
    "PowerLaw",
    "Restoring",
    "Setting",
    "Solution",
    "Sweep",
    "TableLaw",
    "TaylorLaw",
    "Thresholds",
    "Trajectory",
    "Uncertainty",
    "ensemble",
    "law_from",
    "response_band",
    "run_dynamics",
    "uncertainty",
    "unload_reload",
]
