"""What a finished or partial run left in its folder, read back for figures and the report."""

from __future__ import annotations

import csv
import json
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.curve import Curve
from asperity.errors import InputError
from asperity.runtime.files import UNREADABLE, one_line, read_npz

Array = NDArray[np.float64]
Columns = Mapping[str, NDArray[Any]]

SI = {"length": "m", "force": "N", "stress": "Pa"}


@dataclass(frozen=True)
class Results:
    """Files of a run directory; whatever the run did not write is empty.

    Attributes:
        folder: the run directory.
        curve: the accepted steps.
        case: completed input, nested tables.
        summary: contents of summary.json.
        free: columns of free.csv.
        response: columns of response.csv.
        thresholds: contents of thresholds.json.
        band: columns of band.csv.
        top: arrays of fields/top.npz.
        mesh: arrays of fields/mesh.npz.
    """

    folder: Path
    curve: Curve
    case: Mapping[str, Any] = field(default_factory=dict)
    summary: Mapping[str, Any] = field(default_factory=dict)
    free: Columns = field(default_factory=dict)
    response: Columns = field(default_factory=dict)
    thresholds: Mapping[str, Any] = field(default_factory=dict)
    band: Columns = field(default_factory=dict)
    top: Columns = field(default_factory=dict)
    mesh: Columns = field(default_factory=dict)

    @classmethod
    def read(cls, folder: str | Path) -> Results:
        """Read a run directory.

        Raises:
            InputError: there is no curve.csv, or a file cannot be understood.
        """
        folder = Path(folder)
        if not (folder / "curve.csv").is_file():
            raise InputError(f"{folder} holds no curve.csv; give the folder of a run")
        readers: dict[str, tuple[str, Callable[[Path], Any]]] = {
            "case": ("case.toml", _read_toml),
            "summary": ("summary.json", _read_json),
            "curve": ("curve.csv", Curve.read),
            "free": ("free.csv", _read_csv),
            "response": ("response.csv", _read_csv),
            "thresholds": ("thresholds.json", _read_json),
            "band": ("band.csv", _read_csv),
            "top": ("fields/top.npz", read_npz),
            "mesh": ("fields/mesh.npz", read_npz),
        }
        found = {}
        for attribute, (name, reader) in readers.items():
            if (folder / name).is_file():
                try:
                    found[attribute] = reader(folder / name)
                except UNREADABLE as error:
                    raise InputError(f"{folder / name} cannot be read: {one_line(error)}") from None
        return cls(folder=folder, **found)

    def unit(self, dimension: str) -> str:
        """SI unit of "length", "force" or "stress"; empty in another system of units."""
        return SI[dimension] if self.case.get("units", "SI") == "SI" else ""

    @cached_property
    def surface(self) -> Any:
        """The surface of the case, None without a case file."""
        from asperity.surface import Surface

        return Surface.from_spec(**self.case["surface"]) if "surface" in self.case else None

    @property
    def snapshots(self) -> int:
        """Number of load levels at which the pressure was kept."""
        return len(self.top.get("pressure", ()))

    def branches(self, *names: str) -> list[Curve]:
        """Pieces of the curve of one branch each, in order; each starts where the one before ended.

        Args:
            names: branches wanted ("load", "unload", "reload").
        """
        branch = self.curve.branch
        starts = [0, *(np.flatnonzero(branch[1:] != branch[:-1]) + 1)]
        stops = [*starts[1:], len(branch)]
        return [
            self.curve.where(np.arange(max(start - 1, 0), stop))
            for start, stop in zip(starts, stops, strict=True)
            if stop > start and branch[start] in names
        ]


def _read_toml(path: Path) -> Mapping[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


def _read_json(path: Path) -> Mapping[str, Any]:
    data = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(data, dict):
        raise ValueError("it holds no table")
    return data


def _read_csv(path: Path) -> Columns:
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(line for line in file if not line.startswith("#"))
    if any(len(row) != len(header) for row in rows):
        raise ValueError("a row has not as many values as the header")
    columns = zip(*rows, strict=True) if rows else [()] * len(header)
    return {name: _column(values) for name, values in zip(header, columns, strict=True)}


def _column(values: tuple[str, ...]) -> NDArray[Any]:
    """Numbers where every value is one or missing, else texts."""
    try:
        return np.array([float(value) if value else np.nan for value in values])
    except ValueError:
        return np.array(values, dtype=str)
