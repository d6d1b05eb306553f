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
    "force_law.law": "Law PowerLaw TaylorLaw",
    "force_law.damping": "LoopDamping",
    "force_law.table": "TableLaw",
    "force_law.choice": "law_from unload_reload",
    "force_law.laws": "LawAtLoad LawTable",
    "motion": "Sweep Trajectory",
    "branch": "Branch Solution",
    "free": "FreeOrbit FreeVibration Thresholds",
    "response": "FrequencyResponse",
    "oscillator": "ContactOscillator",
    "run": "Dynamics run_dynamics",
    "force_law.intervals": "Uncertainty",
}
_PUBLIC = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = _PUBLIC[name] if "." in _PUBLIC[name] else f"dynamics.{_PUBLIC[name]}"
    return getattr(importlib.import_module(f".{module}", "asperity"), name)
