"""Laws that a case names: one that comes along, or a function in a file, which is run."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping
from functools import lru_cache
from types import ModuleType
from typing import Any

from asperity.laws import shipped
from asperity.laws.definition import Law, law_of_function, raising, refuse
from asperity.runtime.display import show
from asperity.runtime.files import MOST_TEXT, read_whole


def load(source: str, parameters: Mapping[str, Any], offered: Mapping[str, Any] | None = None) -> Law:
    """The law that a case names: one of `asperity.laws`, or "file.py:name".

    Raises:
        InputError: there is none, its file raises, or see `law_of_function`
    """
    path, colon, name = source.rpartition(":")
    if not colon:
        if source not in shipped.NAMES:
            refuse(source, f'is not one of {", ".join(shipped.NAMES)}, nor "file.py:name"')
        return law_of_function(getattr(shipped, source), parameters, source, offered=offered)
    functions, digest = _run(path, _read(path, source))
    if name not in functions:
        refuse(source, f"names no function of that file: it has no {show(name)}")
    return law_of_function(functions[name], parameters, source, digest, offered)


def _read(path: str, source: str) -> Any:
    """Content of the file of a law."""
    try:
        return read_whole(path, MOST_TEXT)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        return refuse(source, f"cannot be read: {reason}")


@lru_cache(maxsize=16)
def _run(path: str, content: bytes) -> tuple[dict[str, Any], str]:
    """Names that the file of a law defines, which is run, and its SHA-256."""
    digest = hashlib.sha256(content).hexdigest()
    module = ModuleType(f"law_{digest[:12]}")
    module.__file__, sys.modules[module.__name__] = path, module  # where a class of the file looks its names up
    with raising(path, "raises when it is run"):
        exec(compile(content, path, "exec"), vars(module))
    return vars(module), digest
