"""The static law of a contact: of its curve, with its error bar, and with its damping; NumPy and SciPy suffice."""

from __future__ import annotations

#: Laws of a curve by name, those of a contact that has yielded first.
NAMES = ("unload-reload", "elastic", "table", "paper")
LAWS = ("auto", *NAMES)
#: Rows in contact that show the curvature of an unloading, without and with the stiffness of each.
MIN_ROWS = (5, 3)
