"""Objects and values in one line, for a prompt and for messages."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

LONGEST = 60  # of the text of a part


def short_repr(thing: Any) -> str:
    """Dataclass in one line, without defaults: numbers to six digits, arrays by their shape, collections by their size.

    Classes take it as their `__repr__`.

    Examples:
        >>> from asperity.reference import Hertz
        >>> short_repr(Hertz(R=1.0 / 3.0, E_prime=2e11))
        'Hertz(R=0.333333, E_prime=2e+11)'
    """
    values = [(f, getattr(thing, f.name)) for f in fields(thing) if f.repr]
    plain = (bool, int, float, str, tuple, type(None))
    shown = (f"{f.name}={brief(v)}" for f, v in values if not (isinstance(v, plain) and v == f.default))
    return f"{type(thing).__name__}({', '.join(shown)})"


def brief(value: Any) -> str:
    """Value in a few words."""
    if isinstance(value, np.ndarray):
        return f"<{' x '.join(map(str, value.shape))}>"
    if isinstance(value, bool | np.bool_) or value is None:
        return str(value)
    if isinstance(value, int | np.integer):
        return show(int(value))
    if isinstance(value, float | np.floating):
        return f"{value:.6g}"
    if isinstance(value, str):
        return repr(value if len(value) <= LONGEST else value[: LONGEST - 1] + "…")
    short = f"{type(value).__name__}(…)"
    if is_dataclass(value):
        text = short_repr(value)
    elif isinstance(value, Mapping):
        text = "{" + ", ".join(f"{key!r}: {brief(item)}" for key, item in value.items()) + "}"
        short = f"<{len(value)} keys>"
    elif isinstance(value, Sequence | set | frozenset):
        text = "(" + ", ".join(map(brief, value)) + ("," if len(value) == 1 else "") + ")"
        short = f"<{len(value)}>"
    else:
        text = repr(value)
    return text if len(text) <= LONGEST and "\n" not in text else short


def show(value: Any) -> str:
    """A value as it would be in the file, shortened and free of control characters."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        text = json.dumps(value, ensure_ascii=not value.isprintable())
    elif isinstance(value, list | tuple):
        text = "[" + ", ".join(show(item) for item in value[:8]) + "]"
    elif isinstance(value, int | float | np.number):
        try:
            text = str(value) if isinstance(value, int) else f"{value:.9g}"
        except ValueError:  # integers of thousands of digits
            text = "a huge number"
    else:
        text = brief(value)
    return text if len(text) <= 80 else text[:77] + "..."


def comment(text: str) -> str:
    """A text for a comment of a generated file, of any kind: one line that does not end it."""
    line = "".join(c if c.isprintable() else " " for c in text)
    return line.replace("\\", "/").replace('"""', "'''")


def nearest(name: str, legal: Iterable[str]) -> str:
    """' (did you mean ...?)' with the closest legal name, or an empty string."""
    close = difflib.get_close_matches(str(name), list(legal), n=1)
    return f' (did you mean "{close[0]}"?)' if close else ""
