"""Contact with a rigid flat: exact (active set, with or without friction), penalty method, Nitsche's method."""

from __future__ import annotations

from asperity.contact.active_set import ActiveSet
from asperity.contact.contact_surface import Area
from asperity.contact.coulomb import Coulomb
from asperity.contact.interface import Contact
from asperity.contact.penalty_nitsche import PressureContact

__all__ = ["ActiveSet", "Area", "Contact", "Coulomb", "PressureContact"]
