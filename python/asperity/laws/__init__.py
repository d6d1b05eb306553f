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
from asperity.laws.shipped import hooke, j2, maxwell, neo_hookean, perzyna, voce, without_flow
from asperity.runtime.display import show
from asperity.runtime.files import MOST_TEXT, read_whole

__all__ = ["Law", "from_file", "law", "law_of_function", "shipped_law", "without_flow"]
__all__ += ["hooke", "j2", "maxwell", "neo_hookean", "perzyna", "voce"]


def shipped_law(name: str, parameters: Mapping[str, Any], offered: Mapping[str, Any] | None = None) -> Law:
    """One of the laws that come along; see `law_of_function`."""
    if name not in shipped.LAWS:
        refuse(name, f'is not one of {", ".join(shipped.LAWS)}, nor "file.py:name" of a case')
    return law_of_function(shipped.LAWS[name], parameters, name, offered=offered)


def from_file(source: str, digest: str, parameters: Mapping[str, Any], offered: Mapping[str, Any]) -> Law:
    """The law "file.py:name" of a case: the file is run, with all rights of the user.

    Args:
        digest: SHA-256 that the file must have

    Raises:
        InputError: the file cannot be read, is another one or raises, has no such name, or see `law_of_function`
    """
    path, _, name = source.rpartition(":")
    try:
        content = read_whole(path, MOST_TEXT)
    except (OSError, ValueError) as error:
        refuse(source, f"cannot be read: {getattr(error, 'strerror', None) or error}")
    if hashlib.sha256(content).hexdigest() != digest:
        refuse(
            source,
            f"is of another content of its file than material.law_sha256 = {show(digest)}: leave that key out, or take "
            "the file as it was",
        )
    functions = _run(path, content)
    if name not in functions:
        refuse(source, f"names no function of that file: it has no {show(name)}")
    return law_of_function(functions[name], parameters, source, digest, offered)


@lru_cache(maxsize=16)
def _run(path: str, content: bytes) -> dict[str, Any]:
    """Names that the file of a law defines, which is run once."""
    module = ModuleType(f"law_{hashlib.sha256(content).hexdigest()[:12]}")
    module.__file__, sys.modules[module.__name__] = path, module  # where a class of the file looks its names up
    with raising(path, "raises when it is run"):
        exec(compile(content, path, "exec"), vars(module))
    return vars(module)
