"""The keys of the case file in words, for commands, messages and documentation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, get_args

from pydantic import BaseModel

from asperity.case.schema import Input
from asperity.case.section import Section
from asperity.case.surfaces import SURFACES
from asperity.runtime.display import show


def input_reference() -> Iterator[tuple[str, str, str, str, str, str]]:
    """Rows (section, key, default, legal values, unit, meaning) of every key, for documentation."""
    for name in Input.model_fields:
        for model in sections(name):
            section = name + (f" ({kind_of(model)})" if name == "surface" else "")
            for key, about in properties(model).items():
                if key != "kind":
                    default = show(about["default"]) if "default" in about else "required"
                    default = "none" if default == "None" else default
                    unit = about["unit"] or "-"
                    default = about["shown"] or default
                    yield section, key, default, legal(about), unit, about["description"]


def sections(name: str) -> tuple[type[Section], ...]:
    """Models a section may have; none for a name that is no section."""
    if name == "surface":
        return SURFACES
    info = Input.model_fields.get(name)
    found = [info.annotation, *get_args(info.annotation)] if info else []
    return tuple(m for m in found if isinstance(m, type) and issubclass(m, Section))


def kind_of(model: type[BaseModel]) -> str:
    """Value of `kind` that selects a surface model."""
    return str(properties(model)["kind"]["const"])


def properties(model: type[BaseModel]) -> dict[str, dict[str, Any]]:
    """JSON schema of each key of a section."""
    schema: dict[str, dict[str, Any]] = model.model_json_schema()["properties"]
    return schema


def legal(about: dict[str, Any]) -> str:
    """Legal values in words, from a key's JSON schema: choices or an interval."""
    if "anyOf" in about:  # of several kinds, or nothing
        return " or ".join(legal(kind) for kind in about["anyOf"] if kind.get("type") != "null")
    if "const" in about:
        return show(about["const"])
    if "enum" in about:
        return ", ".join(show(choice) for choice in about["enum"])
    if about.get("type") == "array":
        count = f"{about['minItems']} values " if about.get("minItems", -1) == about.get("maxItems") else "values "
        return f"a list of {count}from {legal(about.get('items') or about['prefixItems'][0])}"
    if about.get("type") in ("number", "integer"):
        low, high = about.get("minimum", -math.inf), about.get("maximum", math.inf)
        low, high = about.get("exclusiveMinimum", low), about.get("exclusiveMaximum", high)
        left = "[" if "minimum" in about else "("
        return f"{left}{low:g}, {high:g}{']' if 'maximum' in about else ')'}"
    return {"boolean": "true, false", "string": "text", "object": "a table of numbers"}[about["type"]]
