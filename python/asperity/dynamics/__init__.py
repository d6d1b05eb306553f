"""Vibration of a mass on a contact, from its static force-deflection law.

    law = PowerLaw(1.5)
    oscillator = ContactOscillator(law, zeta=0.01)
    oscillator.free([0.1, 0.2]).omega_ratio
    oscillator.response(0.05).peak

NumPy and SciPy only. `run_dynamics` does all of it for a curve and writes the result files.
"""

from asperity.dynamics.free import FreeOrbit, FreeVibration
from asperity.dynamics.law import Law, PowerLaw, Restoring, TaylorLaw
from asperity.dynamics.oscillator import ContactOscillator
from asperity.dynamics.response import Branch, Event, FrequencyResponse, Setting, Solution
from asperity.dynamics.run import Dynamics, law_from, run_dynamics
from asperity.dynamics.shooting import Trajectory
from asperity.dynamics.sweep import Attractor, Sweep
from asperity.dynamics.table import TableLaw, unload_reload
from asperity.dynamics.thresholds import Backbone, Thresholds
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
