# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Input, curve and summary of a run, written as it proceeds."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import InputError
from asperity.runtime.files import UNREADABLE, remove_asides, replace_file
from asperity.runtime.run_folder import CASE, CURVE, SUMMARY, clear, dropped


class RunFiles:
    """Writes the files of a run; without a folder (and on all ranks but the first) nothing."""

    def __init__(self, case: Case, folder: Path | None) -> None:
        self._case, self._folder = case, folder
        self._whole = False
        self.begun = False  # whether the run has written into the folder
        self._note = ""

    def begin(self) -> None:
        """Make the folder and write the completed input.

        Of a run that continues, a finished one is marked unfinished, and what the case no longer requests is removed.
        """
        if self._folder is not None:
            self._folder.mkdir(parents=True, exist_ok=True)
            remove_asides(self._folder)
            before = self._summary()
            if before.get("finished"):
                self.summary(before | {"finished": False})
            clear(self._folder, dropped(self._earlier_case(), self._case.to_dict()))
            self.begun = True
            self._write_case()

    def withdraw(self) -> None:
        """Remove what a refused run has written; files of other origin stay."""
        if self._folder is not None:
            clear(self._folder)
            (self._folder / CASE).unlink(missing_ok=True)
            if not any(self._folder.iterdir()):
                self._folder.rmdir()

    def note(self, text: str) -> None:
        """Put a choice of the run as a comment above the completed input."""
        self._note = f"# {text}\n"
        if self.begun:
            self._write_case()

    def _write_case(self) -> None:
        assert self._folder is not None
        replace_file(self._folder / CASE, (self._note + self._case.to_toml()).encode())

    def _earlier_case(self) -> dict[str, Any]:
        """Tables of case.toml; nothing where it is absent or damaged."""
        assert self._folder is not None
        try:
            return tomllib.loads((self._folder / CASE).read_text(encoding="utf-8"))
        except UNREADABLE:
            return {}

    def _summary(self) -> dict[str, Any]:
        """Contents of summary.json; nothing where it is absent or damaged."""
        assert self._folder is not None
        try:
            found = json.loads((self._folder / SUMMARY).read_text(encoding="utf-8"))
        except UNREADABLE:
            return {}
        return found if isinstance(found, dict) else {}

    def finished(self) -> tuple[Curve, dict[str, Any]] | None:
        """Curve and summary when the folder holds everything the case requests, else None."""
        assert self._folder is not None
        summary = self._summary()
        if summary.get("finished") is not True or summary.get("case_hash") != self._case.hash():
            return None
        try:
            text = (self._folder / CASE).read_text(encoding="utf-8")
            curve = Curve.read(self._folder / CURVE)
        except (*UNREADABLE, InputError):
            return None
        return (curve, summary) if text.endswith(self._case.to_toml()) else None

    def steps(self, curve: Curve) -> None:
        """Write the curve so far; a killed run keeps it, unless it has had a whole one on a coarser mesh."""
        if not self._whole:
            self._write(curve)

    def curve(self, curve: Curve) -> None:
        """Write a whole curve."""
        self._whole = True
        self._write(curve)

    def _write(self, curve: Curve) -> None:
        if self._folder is not None:
            curve.write(self._folder / CURVE)

    def summary(self, summary: dict[str, Any]) -> None:
        """Write summary.json."""
        if self._folder is not None:
            text = json.dumps(summary, indent=2, default=float)
            replace_file(self._folder / SUMMARY, f"{text}\n".encode())
