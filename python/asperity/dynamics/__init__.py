"""Vibration of a mass on a contact, from the static law of its force over the approach.

`run_dynamics` does the whole analysis for a curve and writes the result files. NumPy and SciPy suffice.
"""

from __future__ import annotations

import importlib
from typing import Any

# module -> the public names that it defines; a module is loaded by its first use
_MODULES = {
    "equation": "Restoring",
    "settings": "Setting DynamicsSettings",
    "joint": "Joint",
    "law.law": "Law",
    "law.damping": "LoopDamping",
    "law.power": "PowerLaw",
    "law.table": "TableLaw",
    "law.taylor": "TaylorLaw",
    "law_of_curve": "law_from unload_reload",
    "laws": "LawAtLoad LawTable",
    "sweep": "Sweep",
    "motion": "Trajectory",
    "branch": "Branch Event Solution",
    "free": "FreeOrbit FreeVibration",
    "response": "FrequencyResponse",
    "thresholds": "Thresholds",
    "oscillator": "ContactOscillator",
    "run": "Dynamics run_dynamics",
    "intervals": "Band Uncertainty response_band uncertainty",
}
_PUBLIC = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_PUBLIC[name]}"), name)
