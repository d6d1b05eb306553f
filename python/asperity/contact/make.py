"""The contact of a formulation."""

from __future__ import annotations

from asperity.contact.active_set import ActiveSet
from asperity.contact.contact_surface import ContactSurface
from asperity.contact.coulomb import Coulomb
from asperity.contact.interface import Contact
from asperity.contact.penalty_nitsche import PressureContact
from asperity.fem.solid import Solid
from asperity.model.settings import Formulation


def make_contact(formulation: Formulation, solid: Solid, surface: ContactSurface) -> Contact:
    """Make the contact of a solid by a formulation: its own (`Formulation.build`), or one of this package."""
    own: Contact | None = formulation.build(solid, surface)
    if own is not None:
        return own
    if formulation.method == "active-set":
        if isinstance(formulation.friction, str):
            return ActiveSet(solid, surface)
        return Coulomb(solid, surface, formulation.friction)
    if formulation.method == "penalty":
        return PressureContact(solid, surface, formulation.penalty, traction=False)
    return PressureContact(solid, surface, formulation.gamma, traction=True)
