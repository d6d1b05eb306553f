"""Types of arrays: each named once, for all packages."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Floats = npt.NDArray[np.float64]
Singles = npt.NDArray[np.float32]
Integers = npt.NDArray[np.int32]  # local numbers: nodes, dofs, cells of one rank
Flags = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int64]  # global numbers
