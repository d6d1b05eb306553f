"""Contact with a rigid flat: exact (active set, with or without stick), penalty method, Nitsche's method."""

from __future__ import annotations

from asperity.contact.active_set import ActiveSet
from asperity.contact.contact_surface import Area
from asperity.contact.interface import Contact
from asperity.contact.penalty_nitsche import PressureContact
from asperity.contact.stick import Stick

__all__ = ["ActiveSet", "Area", "Contact", "PressureContact", "Stick"]
