# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""From a rough surface to its contact force and to the vibration of a mass on it.

Importing the package is light: dolfinx, gmsh and matplotlib are loaded by the stage that needs them.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "1.0.0rc1"

# public name -> module that defines it
_PUBLIC = {
    "AsperityError": "errors",
    "AsperityWarning": "errors",
    "CheckpointError": "errors",
    "CompatError": "errors",
    "ConvergenceError": "errors",
    "InputError": "errors",
    "MeshError": "errors",
    "RangeError": "errors",
    "Surface": "surface",
    "Curve": "curve",
    "PowerLawFit": "power_law",
    "fit_power_law": "power_law",
    "Case": "case",
    "ContactOscillator": "dynamics",
    "Joint": "dynamics",
    "PowerLaw": "dynamics",
    "TableLaw": "dynamics",
    "TaylorLaw": "dynamics",
    "response_band": "dynamics",
    "run_dynamics": "dynamics",
    "uncertainty": "dynamics",
    "unload_reload": "dynamics",
    "Transient": "transient",
    "Scheme": "transient",
    "run": "run_case",
    "export": "output.export",
    "Material": "model.material",
    "MeshSize": "model.settings",
    "Formulation": "model.settings",
    "SolverOptions": "model.settings",
    "solve_contact": "quasistatic.solve_contact",
    "solve_problem": "quasistatic.solve_contact",
    "Problem": "model.problem",
    "AccuracyTarget": "model.settings",
    "solve_to_tolerance": "adaptive.solve_to_tolerance",
    "choose_kinematics": "adaptive.small_strain",
    "reference": "",
}

__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if not _PUBLIC[name]:
        return importlib.import_module(f"{__name__}.{name}")
    return getattr(importlib.import_module(f"{__name__}.{_PUBLIC[name]}"), name)


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
