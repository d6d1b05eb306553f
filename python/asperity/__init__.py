"""From a rough surface to its contact force and to the vibration of a mass on it.

Importing the package is light: dolfinx, gmsh and matplotlib are loaded by the stage that needs them.
"""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path
from typing import Any

# module of each public name, as `__init__.pyi` lists them
_PUBLIC = {
    name: module
    for module, name in re.findall(
        r"^from (\S+) import (\w+) as", Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"), re.MULTILINE
    )
}

__all__ = sorted(set(_PUBLIC) - {"__version__"})


class _LibrariesFirst:
    """Finder that finds nothing, but loads the libraries of PyPI's wheels before dolfinx, which does not find them."""

    @staticmethod
    def find_spec(name: str, *_: Any) -> None:
        if name == "dolfinx":
            importlib.import_module("asperity.runtime.compat").load_libraries()


sys.meta_path.insert(0, _LibrariesFirst)  # type: ignore[arg-type]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = _PUBLIC[name]
    if module == __name__:
        return importlib.import_module(f"{module}.{name}")
    return getattr(importlib.import_module(module), name)


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
