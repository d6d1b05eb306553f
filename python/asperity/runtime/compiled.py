"""The compiled module of solver/, loaded after the libraries that it shares with dolfinx."""

from __future__ import annotations

import importlib

from asperity.errors import CompatError
from asperity.runtime import compat

compat.load_libraries()
try:
    solver = importlib.import_module("asperity._solver")
except ImportError as error:
    raise CompatError(f"the compiled module cannot be loaded ({error}): install asperity[solve] or use ./run") from None

__all__ = ["solver"]
