"""Inputs declared once: type, default, legal range, unit and sentence of each key, for scripts, case files and tables.

    @declared("block")
    class Block:
        height: Real = key("height of the block", LENGTH, gt=0)

makes a frozen dataclass whose constructor refuses an illegal value (`InputError`, one line). A field without `key` is
for scripts alone.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, TypeVar, dataclass_transform, get_type_hints

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field, Strict, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass
from pydantic.fields import FieldInfo
from pydantic.json_schema import SkipJsonSchema
from pydantic_core.core_schema import literal_schema

from asperity.errors import InputError
from asperity.runtime.display import brief, short_repr, show

Real = Annotated[float, Strict(), Field(allow_inf_nan=False)]
Positive = Annotated[float, Strict(), Field(gt=0, allow_inf_nan=False)]
Whole = Annotated[int, Strict()]
Flag = Annotated[bool, Strict()]
Text = Annotated[str, Strict()]
#: Metadata of a field that is no key of a case file.
SCRIPT = (SkipJsonSchema(), Field(exclude=True))
LENGTH, FORCE, STRESS = "length", "force", "force/length^2"

T = TypeVar("T")
_CONFIG = ConfigDict(extra="forbid", arbitrary_types_allowed=True)
_UNKNOWN = ("unexpected_keyword_argument", "unexpected_positional_argument", "multiple_argument_values")
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
    "literal_error": "is not a choice",
    "is_instance_of": "is of another type",
    "missing": "is too short",
    "too_short": "is too short",
    "too_long": "is too long",
}


def key(
    doc: str, unit: str = "", *, default: Any = ..., shown: str = "", hint: str = "",
    share: tuple[float, float] | None = None, **more: Any,
) -> Any:  # fmt: skip
    """Declare a key.

    Args:
        doc: what it is
        unit: kind of unit
        default: value where it is left out; required without one
        shown: its default in words, where it follows from other keys
        hint: usual values
        share: legal range over the side of the patch, see `check_shares`: wide enough for any sensible model, and
            narrow enough to notice that metres are mixed with micrometres
        more: legal range and more of `pydantic.Field`
    """
    if share is not None:
        more["gt"] = 0
    extra: dict[str, Any] = {"unit": unit, "shown": shown, "hint": hint, "share": share}
    return Field(default, description=doc, json_schema_extra=extra, **more)


def argument(legal: str) -> tuple[Any, ...]:
    """Metadata of an argument of scripts, with its legal values in words."""
    return SkipJsonSchema(), Field(exclude=True, json_schema_extra={"legal": legal})


class Choices:
    """Metadata of a text that is one of some words."""

    def __init__(self, *words: str) -> None:
        self.words = words

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return literal_schema(list(self.words))


def plain(value: Any) -> Any:
    """A value of a script as of a file: a number of NumPy as Python's, a path as its text."""
    if isinstance(value, np.generic) or (type(value) is np.ndarray and value.ndim == 0):
        return value.item()
    return str(value) if isinstance(value, Path) else value


def _several(value: Any) -> Any:
    return value if isinstance(value, Iterable) and not isinstance(value, str | Mapping) else (value,)


#: Metadata of a tuple for which one value may be given alone.
SEVERAL = BeforeValidator(_several)


@dataclass_transform(frozen_default=True, field_specifiers=(key, field))
def declared(section: str, *, eq: bool = True, kw_only: bool = False) -> Callable[[type[T]], type[T]]:
    """Make a class a frozen dataclass that checks its fields, as the section of a case file that has them as keys."""

    def make(cls: type[T]) -> type[T]:
        hints, annotations = get_type_hints(cls, include_extras=True), dict(cls.__annotations__)
        for name, info in [(name, value) for name, value in vars(cls).items() if isinstance(value, FieldInfo)]:
            # as metadata of the type, the attribute of the class is the default, also for a plain subclass
            annotations[name] = Annotated[hints[name], info]
            if info.is_required():
                delattr(cls, name)
            else:
                setattr(cls, name, info.default)
        cls.__annotations__ = annotations
        made: Any = dataclass(frozen=True, eq=eq, repr=False, kw_only=kw_only, config=_CONFIG)(cls)
        construct = made.__init__

        @wraps(construct)
        def init(self: T, /, *args: Any, **given: Any) -> None:
            try:
                construct(self, *map(plain, args), **{name: plain(value) for name, value in given.items()})
            except ValidationError as error:
                raise InputError(_sentence(error, made)) from None

        made.__init__, made.section = init, section
        made.__doc__ = "\n".join(
            [f"{cls.__doc__}", "", "Keys:", *(f"    {k}: {f.description}" for k, f in keys(made).items())]
        )
        if "__repr__" not in vars(cls):
            made.__repr__ = short_repr
        typed: type[T] = made
        return typed

    return make


def keys(cls: Any) -> dict[str, FieldInfo]:
    """Keys of a section, by the names that a case file has for them."""
    fields: dict[str, FieldInfo] = cls.__pydantic_fields__
    return {field.serialization_alias or name: field for name, field in fields.items() if field.description}


def to_table(thing: Any) -> dict[str, Any]:
    """Keys and values of an object as a case file has them; keys without a value are left out."""
    table: dict[str, Any] = thing.__pydantic_serializer__.to_python(
        thing, mode="json", by_alias=True, exclude_none=True, warnings=False
    )
    return table


def properties(cls: Any) -> dict[str, dict[str, Any]]:
    """JSON schema of each key of a section."""
    found: dict[str, dict[str, Any]] = TypeAdapter(cls).json_schema(mode="serialization").get("properties", {})
    return found


def legal(about: Mapping[str, Any]) -> str:
    """Legal values in words, from the JSON schema of a key: choices or an interval."""
    if about.get("share"):
        low, high = about["share"]
        return f"{'[' if low else '('}{low:g} L, {high:g} L]"
    if "anyOf" in about:  # of several kinds, or nothing
        return " or ".join(legal(kind) for kind in about["anyOf"] if kind.get("type") != "null")
    if "const" in about or "enum" in about:
        return ", ".join(show(choice) for choice in about.get("enum", [about.get("const")]))
    if about.get("type") == "array":
        fixed = about.get("minItems", -1) == about.get("maxItems")
        count = f"a list of {about['minItems']} values from" if fixed else "one or a list of"
        return f"{count} {legal(about.get('items') or about['prefixItems'][0])}"
    if about.get("type") in ("number", "integer"):
        low, high = about.get("minimum", -math.inf), about.get("maximum", math.inf)
        low, high = about.get("exclusiveMinimum", low), about.get("exclusiveMaximum", high)
        left = "[" if "minimum" in about else "("
        return f"{left}{low:g}, {high:g}{']' if 'maximum' in about else ')'}"
    return {"boolean": "true, false", "string": "text", "object": "a table of numbers"}[about["type"]]


def unknown(
    name: str,
    section: str,
    legal: Iterable[str],
    others: Mapping[str, Iterable[str]] | None = None,
    kind: str = "",
    place: str = "the case file",
) -> str:
    """Sentence about a name that is no key, with the key that was probably meant, or the section that has it.

    Args:
        legal: the keys
        others: keys of other sections
        kind: of a surface
        place: of a key without a section
    """
    full = f"{section}.{name}" if section else name
    full = full if name.isidentifier() and len(full) < 80 else show(full)
    place = (f"[{section}]" if section else place) + (f' of kind "{kind}"' if kind else "")
    valid = {one.lower(): one for one in legal}
    if near := difflib.get_close_matches(name.lower(), valid, n=1, cutoff=0.6):
        return f'{full} is not a key of {place}; did you mean "{valid[near[0]]}"?'
    if home := [other for other, names in (others or {}).items() if name in names]:
        return f"{full} is not a key of {place}; it belongs in {' or '.join(f'[{other}]' for other in home)}"
    return f"{full} is not a key of {place}; legal: {', '.join(valid.values())}"


def _sentence(error: ValidationError, cls: Any) -> str:
    """Key, value and legal values of the first error; of a misspelt key, which is missing too, the misspelling."""
    first: Any = min(error.errors(), key=lambda each: each["type"] not in _UNKNOWN)
    kind, name = first["type"], first["loc"][0]
    fields, section = cls.__pydantic_fields__, cls.section
    if kind == "unexpected_positional_argument":
        return f"{section or cls.__name__} has no more than {len(fields)} values: {', '.join(fields)}"
    if isinstance(name, int):
        name = list(fields)[name]
    if kind == "unexpected_keyword_argument":
        return unknown(str(name), section, fields, kind=getattr(cls, "kind", ""), place=cls.__name__)
    field, full, extra = fields[name], _full(cls, name), fields[name].json_schema_extra or {}
    if kind == "multiple_argument_values":
        return f"{full} is given twice"
    missing = kind == "missing" and len(first["loc"]) == 1
    if not field.description:
        legal_form = f"it must be {extra['legal']}" if "legal" in extra else first["msg"]
        return f"{full} {'is missing' if missing else '= ' + brief(first['input']) + ' is not legal'}: {legal_form}"
    advice = f", legal: {legal(properties(cls)[field.serialization_alias or name])}"
    advice += f"; {extra['hint']}" if extra.get("hint") else ""
    if missing:
        return f"{full} is missing: {field.description}{advice}"
    return f"{full} = {show(first['input'])} {_PROBLEMS.get(kind, 'is out of range')}{advice}"


def _full(cls: Any, name: str) -> str:
    """Section and key of a field; an alias may name both."""
    alias = cls.__pydantic_fields__[name].serialization_alias or name
    return alias if "." in alias or not cls.section else f"{cls.section}.{alias}"


def check_shares(thing: Any, side: float) -> None:
    """Refuse (InputError) a length of a declared object that is far from the side of the patch [length]."""
    for name, info in type(thing).__pydantic_fields__.items():
        low, high = (info.json_schema_extra or {}).get("share") or (0.0, 0.0)
        value = getattr(thing, name) if high else None
        if value is not None and not low * side <= value <= high * side:
            raise InputError(
                f"{_full(type(thing), name)} = {value:g} is {value / side:.2g} of surface.L = {side:g}, legal are "
                f"{low:g} to {high:g}; give all lengths in the same unit (m)"
            )
