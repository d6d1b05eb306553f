"""Contact with a rigid flat or tool: exact (active set, with or without friction), penalty method, Nitsche's method."""

from __future__ import annotations

from asperity.contact.active_set import ActiveSet, OnTool
from asperity.contact.contact_surface import Area, ContactSurface
from asperity.contact.friction import Coulomb
from asperity.contact.interface import Contact
from asperity.contact.penalty_nitsche import PressureContact
from asperity.fem.solid import Solid
from asperity.model.settings import Formulation

__all__ = ["ActiveSet", "Area", "Contact", "Coulomb", "OnTool", "PressureContact", "make_contact"]


def make_contact(formulation: Formulation, solid: Solid, surface: ContactSurface) -> Contact:
    """Make the contact of a solid by a formulation: its own (`Formulation.build`), or one of this package."""
    own: Contact | None = formulation.build(solid, surface)
    if own is not None:
        return own
    if formulation.method != "active-set":
        traction = formulation.method == "nitsche"
        factor = formulation.gamma if traction else formulation.penalty
        return PressureContact(solid, surface, factor, traction=traction)
    if isinstance(formulation.friction, str):
        return (OnTool if surface.follows else ActiveSet)(solid, surface)
    return Coulomb(solid, surface, formulation.friction)
