"""Micro-slip of a joint: tangential force, loops and damping by the normal curve, and the vibration with them."""

from __future__ import annotations

import importlib
from typing import Any

# public name -> module that defines it; a module is loaded by its first use
_PUBLIC = {
    "JointSlip": "joint_slip",
    "SlipLaw": "law",
    "SlipSettings": "asperity.model.slip",
    "slip_of_curve": "joint_slip",
    "tangential_response": "tangential",
}

__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = _PUBLIC[name]
    return getattr(importlib.import_module(module if "." in module else f"{__name__}.{module}"), name)
