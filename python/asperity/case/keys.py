"""The keys of the case file in words, for documentation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from asperity.case.case_file import Case
from asperity.case.tables import OF_KINDS, SECTIONS
from asperity.runtime.declaration import legal, properties
from asperity.runtime.display import show
from asperity.surface.base import surface_kinds

#: Kinds of surfaces of a case, in the order of the pages.
KINDS = ("weierstrass-mandelbrot", "self-affine", "sphere", "cone", "pyramid", "sinusoid", "flat", "file")


def input_reference() -> Iterator[tuple[str, str, str, str, str, str]]:
    """Rows (section, key, default, legal values, unit, meaning) of every key, for documentation."""
    places: dict[str, Any] = {"": Case} | {f"surface ({kind})": surface_kinds()[kind] for kind in KINDS} | SECTIONS
    for section in OF_KINDS:
        del places[section]
    for section, cls in places.items():
        for key, about in properties(cls).items():
            default = show(about["default"]) if "default" in about else "required"
            default = about["shown"] or ("none" if default == "None" else default)
            yield section, key, default, legal(about), about["unit"] or "-", about["description"]
