"""Vibration of a mass on a contact, from the static law of its force over the approach; NumPy and SciPy suffice.

`run_dynamics` does the whole analysis for a curve and writes the result files.
"""

from __future__ import annotations

import importlib
from typing import Any

# module -> the public names that it defines; a module is loaded by its first use
_MODULES = {
    "law": "Law PowerLaw TaylorLaw bar_of",
    "curve_law": "CurveLaw",
    "source": "law_from unload_reload",
    "settings": "Setting",
    "asperity.model.dynamics": "DynamicsSettings",
    "asperity.model.joint": "Joint",
    "numbers": "Numbers",
    "equation": "Restoring",
    "motion": "Trajectory",
    "free": "FreeOrbit FreeVibration Thresholds",
    "response": "FrequencyResponse",
    "oscillator": "ContactOscillator",
    "run": "Dynamics run_dynamics",
}
_PUBLIC = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = _PUBLIC[name]
    return getattr(importlib.import_module(module if "." in module else f"{__name__}.{module}"), name)
