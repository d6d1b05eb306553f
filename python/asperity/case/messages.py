"""One clear sentence for each of pydantic's validation errors."""

from __future__ import annotations

import difflib
from typing import Any

from pydantic import BaseModel

from asperity.case.keys import kind_of, legal, properties, sections
from asperity.case.schema import Input
from asperity.case.surfaces import SURFACES
from asperity.runtime.display import show

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


def sentence(error: Any) -> tuple[str, str]:
    """Dotted key and the rest of the sentence for one entry of `ValidationError.errors()`."""
    location = error["loc"]
    # pydantic puts the kind of surface between section and key
    names = [location[0], *location[2:]] if location[0] == "surface" else list(location)
    names = [name for name in names if isinstance(name, str)][:2]  # further ones name the kinds of a union
    key = ".".join(names)
    owner = _owner(location)
    if error["type"] == "extra_forbidden":
        return key, _unknown(names, owner)
    if error["type"] in ("union_tag_not_found", "union_tag_invalid"):
        return "surface.kind", _kind(error["input"])
    if error["type"] == "missing" and owner is Input:
        return key, f"is missing; add a section [{key}]"
    about = {} if sections(names[-1]) else properties(owner)[names[-1]]
    advice = f", legal: {legal(about)}" if about else ""
    advice += f"; {about['hint']}" if about.get("hint") else ""
    if error["type"] == "missing" and isinstance(location[-1], str):
        return key, f"is missing: {about['description']}{advice}"
    problem = _PROBLEMS.get(error["type"], "is out of range")
    return key, f"= {show(error['input'])} {problem}{advice}"


def _owner(location: tuple[int | str, ...]) -> type[BaseModel]:
    """Model that the last name of an error's location belongs to."""
    if len(location) == 1 or location[0] not in Input.model_fields:
        return Input
    if location[0] == "surface":
        return next(model for model in SURFACES if kind_of(model) == location[1])
    return next(iter(sections(str(location[0]))), Input)


def _unknown(names: list[str], owner: type[BaseModel]) -> str:
    key, valid = names[-1], {name.lower(): name for name in owner.model_fields}
    place = f"[{names[0]}]" if len(names) > 1 else "the case file"
    if names[0] == "surface":
        place += f' of kind "{kind_of(owner)}"'
    near = difflib.get_close_matches(key.lower(), valid, n=1, cutoff=0.6)
    if near:
        return f'is not a key of {place}; did you mean "{valid[near[0]]}"?'
    for section in Input.model_fields:
        if section != names[0] and any(key in m.model_fields for m in sections(section)):
            return f"is not a key of {place}; it belongs in [{section}]"
    return f"is not a key of {place}; legal: {', '.join(valid.values())}"


def _kind(table: Any) -> str:
    kinds = [kind_of(model) for model in SURFACES]
    choices = "legal: " + ", ".join(show(kind) for kind in kinds)
    if "kind" not in table:
        return f"is missing; {choices}"
    value = table["kind"]
    near = difflib.get_close_matches(str(value).lower()[:50], kinds, n=1, cutoff=0.5)
    return f"= {show(value)} is unknown; " + (f'did you mean "{near[0]}"?' if near else choices)
