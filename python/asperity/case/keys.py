"""The keys of the case file in words: for commands and documentation, and a sentence for each validation error."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator
from typing import Any, get_args

from pydantic import BaseModel

from asperity.case.schema import Input
from asperity.case.surfaces import SURFACES, Section
from asperity.runtime.display import show

#: By pydantic's type of an error; others are of values out of range.
_PROBLEMS = {
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be a text in quotes",
    "tuple_type": "must be a list",
    "dict_type": "must be a table of numbers",
    "finite_number": "must be a finite number",
    "model_type": "must be a section of keys",
    "model_attributes_type": "must be a section of keys",
    "literal_error": "is not a choice",
    "missing": "is too short",
    "too_short": "is too short",
    "too_long": "is too long",
}


def input_reference() -> Iterator[tuple[str, str, str, str, str, str]]:
    """Rows (section, key, default, legal values, unit, meaning) of every key, for documentation."""
    for name in Input.model_fields:
        for model in sections(name):
            section = name + (f" ({kind_of(model)})" if name == "surface" else "")
            for key, about in properties(model).items():
                if key != "kind":
                    default = show(about["default"]) if "default" in about else "required"
                    default = about["shown"] or ("none" if default == "None" else default)
                    yield section, key, default, legal(about), about["unit"] or "-", about["description"]


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
    if "const" in about or "enum" in about:
        return ", ".join(show(choice) for choice in about.get("enum", [about.get("const")]))
    if about.get("type") == "array":
        count = f"{about['minItems']} values " if about.get("minItems", -1) == about.get("maxItems") else "values "
        return f"a list of {count}from {legal(about.get('items') or about['prefixItems'][0])}"
    if about.get("type") in ("number", "integer"):
        low, high = about.get("minimum", -math.inf), about.get("maximum", math.inf)
        low, high = about.get("exclusiveMinimum", low), about.get("exclusiveMaximum", high)
        left = "[" if "minimum" in about else "("
        return f"{left}{low:g}, {high:g}{']' if 'maximum' in about else ')'}"
    return {"boolean": "true, false", "string": "text", "object": "a table of numbers"}[about["type"]]


def sentence(error: Any) -> str:
    """Dotted key and what is wrong with it, for one entry of `ValidationError.errors()`."""
    location = error["loc"]
    # pydantic puts the kind of surface between section and key, and further ones name the kinds of a union
    names = [location[0], *location[2:]] if location[0] == "surface" else list(location)
    names = [name for name in names if isinstance(name, str)][:2]
    key = ".".join(names)
    key = key if key.isprintable() and len(key) < 80 else show(key)
    owner: type[BaseModel] = Input  # of the last name
    if len(location) > 1 and location[0] == "surface":
        owner = next(model for model in SURFACES if kind_of(model) == location[1])
    elif len(location) > 1:
        owner = next(iter(sections(str(location[0]))), Input)
    if error["type"] == "extra_forbidden":
        return f"{key} is not a key of {_place(names, owner)}"
    if error["type"] in ("union_tag_not_found", "union_tag_invalid"):
        kinds, value = [kind_of(model) for model in SURFACES], error["input"].get("kind")
        near = difflib.get_close_matches(str(value).lower()[:50], kinds, n=1, cutoff=0.5)
        advice = f'did you mean "{near[0]}"?' if near else f"legal: {', '.join(map(show, kinds))}"
        return f"surface.kind {'is missing' if value is None else f'= {show(value)} is unknown'}; {advice}"
    if error["type"] == "missing" and owner is Input:
        return f"{key} is missing; add a section [{key}]"
    about = {} if sections(names[-1]) else properties(owner)[names[-1]]
    advice = f", legal: {legal(about)}" if about else ""
    advice += f"; {about['hint']}" if about.get("hint") else ""
    if error["type"] == "missing" and isinstance(location[-1], str):
        return f"{key} is missing: {about['description']}{advice}"
    return f"{key} = {show(error['input'])} {_PROBLEMS.get(error['type'], 'is out of range')}{advice}"


def _place(names: list[str], owner: type[BaseModel]) -> str:
    """Where an unknown key is, and the key that was probably meant."""
    key, valid = names[-1], {name.lower(): name for name in owner.model_fields}
    place = f"[{names[0]}]" if len(names) > 1 else "the case file"
    if names[0] == "surface":
        place += f' of kind "{kind_of(owner)}"'
    near = difflib.get_close_matches(key.lower(), valid, n=1, cutoff=0.6)
    if near:
        return f'{place}; did you mean "{valid[near[0]]}"?'
    for section in Input.model_fields:
        if section != names[0] and any(key in m.model_fields for m in sections(section)):
            return f"{place}; it belongs in [{section}]"
    return f"{place}; legal: {', '.join(valid.values())}"
