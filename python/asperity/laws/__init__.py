"""Material laws in UFL: those that come along, and those of a file that a case names."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping
from functools import lru_cache
from types import ModuleType
from typing import Any

from asperity.laws import shipped
from asperity.laws.definition import Law, law, law_of_function, raising, refuse
from asperity.laws.shipped import hooke, j2, neo_hookean, voce, without_flow
from asperity.runtime.display import show
from asperity.runtime.files import MOST_TEXT, read_whole

__all__ = ["Law", "law", "law_of_function", "load", "without_flow"]
__all__ += ["hooke", "j2", "neo_hookean", "voce"]


def load(source: str, parameters: Mapping[str, Any], offered: Mapping[str, Any] | None = None) -> Law:
    """The law that a case names: one of `asperity.laws`, or a function of a file, "file.py:name", which is run.

    Raises:
        InputError: there is none, its file raises, or see `law_of_function`
    """
    path, colon, name = source.rpartition(":")
    if not colon:
        if source not in shipped.NAMES:
            refuse(source, f'is not one of {", ".join(shipped.NAMES)}, nor "file.py:name"')
        return law_of_function(getattr(shipped, source), parameters, source, offered=offered)
    try:
        content = read_whole(path, MOST_TEXT)
    except (OSError, ValueError) as error:
        refuse(source, f"cannot be read: {getattr(error, 'strerror', None) or error}")
    functions, digest = _run(path, content)
    if name not in functions:
        refuse(source, f"names no function of that file: it has no {show(name)}")
    return law_of_function(functions[name], parameters, source, digest, offered)


@lru_cache(maxsize=16)
def _run(path: str, content: bytes) -> tuple[dict[str, Any], str]:
    """Names that the file of a law defines, which is run once, and its SHA-256."""
    digest = hashlib.sha256(content).hexdigest()
    module = ModuleType(f"law_{digest[:12]}")
    module.__file__, sys.modules[module.__name__] = path, module  # where a class of the file looks its names up
    with raising(path, "raises when it is run"):
        exec(compile(content, path, "exec"), vars(module))
    return vars(module), digest
