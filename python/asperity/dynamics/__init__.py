"""Vibration of a mass on a contact, from the static law of its force over the approach.

`run_dynamics` does the whole analysis for a curve and writes the result files. NumPy and SciPy suffice.
"""

from __future__ import annotations

import importlib
from typing import Any

# module -> the public names that it defines; a module is loaded by its first use
_MODULES = {
    "dynamics.equation": "Restoring",
    "vibration.settings": "Setting DynamicsSettings",
    "vibration.joint": "Joint Numbers LawAtLoad",
    "vibration.law": "Law PowerLaw TaylorLaw CurveLaw",
    "vibration.damping": "LoopDamping",
    "vibration.source": "law_from unload_reload",
    "dynamics.motion": "Sweep Trajectory",
    "dynamics.branch": "Branch Solution",
    "dynamics.free": "FreeOrbit FreeVibration Thresholds",
    "dynamics.response": "FrequencyResponse",
    "dynamics.oscillator": "ContactOscillator",
    "vibration.run": "Dynamics run_dynamics",
}
_PUBLIC = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_PUBLIC[name]}", "asperity"), name)
