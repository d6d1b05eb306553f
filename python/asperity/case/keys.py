"""The keys of the case file in words, for documentation and for `asperity init`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from asperity.case.case_file import Case
from asperity.case.tables import SECTIONS
from asperity.runtime.declaration import legal, properties
from asperity.runtime.display import show
from asperity.surface.base import surface_kinds


def sections(name: str) -> tuple[Any, ...]:
    """Classes that a section may have; none for a name that is no section."""
    if name == "surface":
        return tuple(surface_kinds()[kind] for kind in KINDS)
    return (SECTIONS[name],) if name in SECTIONS else ()


#: Kinds of surfaces of a case, in the order of the pages.
KINDS = ("weierstrass-mandelbrot", "self-affine", "sphere", "sinusoid", "flat", "file")


def input_reference() -> Iterator[tuple[str, str, str, str, str, str]]:
    """Rows (section, key, default, legal values, unit, meaning) of every key, for documentation."""
    places: list[tuple[str, Any]] = [("", Case)]
    for name in SECTIONS:
        places += [(f"{name} ({cls.kind})" if name == "surface" else name, cls) for cls in sections(name)]
    for section, cls in places:
        for key, about in properties(cls).items():
            default = show(about["default"]) if "default" in about else "required"
            default = about["shown"] or ("none" if default == "None" else default)
            yield section, key, default, legal(about), about["unit"] or "-", about["description"]
