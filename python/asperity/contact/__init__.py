"""Frictionless contact of the top with a rigid flat: exact (active set), penalty, Nitsche's method."""

from __future__ import annotations

from .active_set import ActiveSet
from .interface import Area, Contact
from .pressure import PressureContact

__all__ = ["ActiveSet", "Area", "Contact", "PressureContact"]
