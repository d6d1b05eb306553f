"""Input of a run: sections and keys, the case file, its validation and messages."""

from __future__ import annotations

from asperity.case.case_file import Case

__all__ = ["Case"]
