"""A section of the case file, and the declaration of its keys."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, Strict

Real = Annotated[float, Strict(), Field(allow_inf_nan=False)]
Whole = Annotated[int, Strict()]
Flag = Annotated[bool, Strict()]
Text = Annotated[str, Strict()]

LENGTH, FORCE, STRESS = "length", "force", "force/length^2"


def key(doc: str, default: Any = ..., *, unit: str = "", shown: str = "", hint: str = "", **limits: Any) -> Any:
    """Declare a key: what it is, its default (`shown` when it follows from others), unit, hint."""
    extra: dict[str, Any] = {"unit": unit, "shown": shown, "hint": hint}
    return Field(default, description=doc, json_schema_extra=extra, **limits)


class Section(BaseModel):
    """A table of the case file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def given(self) -> dict[str, Any]:
        """Keys and values, those without a value left out."""
        return self.model_dump(exclude_none=True)
