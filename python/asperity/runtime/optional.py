# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Packages that only some functions need, imported where they are used."""

from __future__ import annotations

import importlib
from typing import Any

from asperity.errors import CompatError


def optional_module(name: str, extra: str) -> Any:
    """Imported package.

    Args:
        name: of the package
        extra: optional dependencies of asperity that contain it

    Raises:
        CompatError: it is not installed

    Examples:
        >>> optional_module("absent", "data")
        Traceback (most recent call last):
            ...
        asperity.errors.CompatError: this needs the package absent: ./run pip install absent, or asperity[data]
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise CompatError(f"this needs the package {name}: ./run pip install {name}, or asperity[{extra}]") from None
