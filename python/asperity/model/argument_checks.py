"""Judgements of arguments, and those of their types: another one is refused with the legal form."""

from __future__ import annotations

from dataclasses import fields
from math import inf
from numbers import Integral, Real
from typing import Any

from asperity.errors import InputError
from asperity.runtime.display import brief

#: Key of a case file and the rest of the sentence why it is refused; None for a legal value.
Judgement = tuple[str, str] | None

#: Declared types that are checked, and what to write.
FORMS = {
    "float": "a number",
    "int": "a whole number",
    "str": "a text in quotes",
    "Surface": 'a surface, for example asp.Surface.from_spec("sphere", L=1e-6, radius=1e-5)',
    "Material": "a material, for example asp.Material(E=200e9, nu=0.3)",
    "MeshSize": "element sizes, for example asp.MeshSize(h_contact=0.04e-6)",
    "Formulation": 'a formulation, for example asp.Formulation("active-set")',
    "SolverOptions": 'options, for example asp.SolverOptions(linear="cg")',
    "AccuracyTarget": "a target, for example asp.AccuracyTarget(0.01)",
    "Schedule": "a load path, for example Schedule(delta_max=0.03e-6)",
}


def refuse(*judgements: Judgement) -> None:
    """Raise what the first judgement says that is a reason to refuse.

    Raises:
        InputError: there is one
    """
    for judgement in judgements:
        if judgement is not None:
            raise InputError(" ".join(judgement))


def check_kind(name: str, value: Any, declared: str) -> None:
    """Refuse a value of another type than declared; types that are not in `FORMS` are not checked.

    Args:
        declared: its annotation, for example "float | None"

    Raises:
        InputError: with the legal form
    """
    kinds = [kind.strip() for kind in declared.split("|")]
    if any(kind not in FORMS and kind != "None" for kind in kinds) or any(_is(value, kind) for kind in kinds):
        return
    legal = " or ".join(FORMS[kind] for kind in kinds if kind != "None")
    raise InputError(f"{name} = {brief(value)} must be {legal}")


def check_kinds(thing: Any, section: str = "", **legal: tuple[float, float] | tuple[str, ...]) -> None:
    """Refuse a dataclass with a field of another type than declared, see `check_kind`, or with an illegal value.

    Args:
        thing: of a dataclass
        section: of a case file that has its fields as keys
        legal: least and greatest value of a field that is not None, or its words
    """
    for field in fields(thing):
        check_kind(f"{section}.{field.name}" if section else field.name, getattr(thing, field.name), str(field.type))
    for name, values in legal.items():
        value, low, high = getattr(thing, name), values[0], values[-1]
        if isinstance(low, str) or isinstance(high, str):
            if value not in values:
                raise InputError(f'{section}.{name} = "{value}" is not one of {", ".join(map(str, values))}')
        elif value is not None and not low <= value <= high:
            bounds = f"lie in [{low:g}, {high:g}]" if high < inf else f"be at least {low:g}"
            raise InputError(f"{section}.{name} = {value!r} must {bounds}")


def _is(value: Any, kind: str) -> bool:
    if kind == "None":
        return value is None
    if kind in ("float", "int"):
        return isinstance(value, Real if kind == "float" else Integral) and not isinstance(value, bool)
    return any(base.__name__ == kind for base in type(value).__mro__)
