"""The compiled module of solver/, loaded after the libraries that it shares with dolfinx."""

from __future__ import annotations

from asperity.errors import CompatError
from asperity.runtime import compat

compat.load_libraries()
try:
    from asperity import _solver as solver
except ImportError as error:
    raise CompatError(f"the compiled module cannot be loaded ({error}): install asperity[solve] or use ./run") from None

__all__ = ["solver"]
