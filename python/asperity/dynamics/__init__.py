"""Vibration of a mass on a contact, from the static law of its force over the approach.

`run_dynamics` does the whole analysis for a curve and writes the result files. NumPy and SciPy suffice.
"""

from __future__ import annotations

import importlib
from typing import Any

# public name -> module that defines it; a module is loaded by its first use
_PUBLIC = {
    "Restoring": "equation",
    "Setting": "settings",
    "Joint": "joint",
    "Law": "law.law",
    "LoopDamping": "law.damping",
    "PowerLaw": "law.power",
    "TableLaw": "law.table",
    "TaylorLaw": "law.taylor",
    "law_from": "law_of_curve",
    "unload_reload": "law_of_curve",
    "LawAtLoad": "laws",
    "LawTable": "laws",
    "Sweep": "sweep",
    "Trajectory": "motion",
    "Branch": "branch",
    "Event": "branch",
    "Solution": "branch",
    "FreeOrbit": "free",
    "FreeVibration": "free",
    "FrequencyResponse": "response",
    "Thresholds": "thresholds",
    "ContactOscillator": "oscillator",
    "Dynamics": "run",
    "run_dynamics": "run",
    "DynamicsSettings": "settings",
    "Band": "intervals",
    "Uncertainty": "intervals",
    "response_band": "intervals",
    "uncertainty": "intervals",
}

__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_PUBLIC[name]}"), name)
