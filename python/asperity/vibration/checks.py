"""Names of the laws of a curve, and what arguments of the vibration must be."""

from __future__ import annotations

from asperity.model.dynamics import LAWS as LAWS
from asperity.model.limits import one_of as one_of
from asperity.model.limits import positive as positive
from asperity.model.limits import positives as positives
from asperity.model.limits import within as within

NAMES = LAWS[1:]
#: Rows in contact that show the curvature of an unloading, without and with the stiffness of each.
MIN_ROWS = (5, 3)
