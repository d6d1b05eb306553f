"""The files of a finished or partial run, read for figures and the report, and its fields on a regular grid."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.arrays import Array
from asperity.curve import Curve
from asperity.errors import InputError
from asperity.mesh.element import at_inside, shares, triangles_at
from asperity.runtime import run_folder
from asperity.runtime.display import short_repr
from asperity.runtime.files import UNREADABLE, one_line, parse_toml, read_npz, read_text
from asperity.surface import Surface

Columns = Mapping[str, NDArray[Any]]

SI = {"length": "m", "force": "N", "stress": "Pa", "stiffness": "N/m", "conductance": "W/(m²K)", "frequency": "Hz"}
PIXELS = 400  # of a map, along each side
OPEN = 1e-12  # least gap out of contact over the side


@dataclass(frozen=True)
class Results:
    """Contents of the folder of a run; files that the run did not write give empty values.

    Attributes:
        case: completed input, as nested tables
        free, response, motion, slip, slip_loops: columns of the files of these names
        top: arrays of fields/top.npz
        built: the surface of the case if it was passed to `read`, else None

    Examples:
        >>> Path("out").mkdir()
        >>> asp.Curve.from_rows([{"delta": d, "force": d} for d in (1.0, 2.0, 3.0)]).write("out/curve.csv")
        >>> results = Results.read("out")
        >>> [len(part) for part in results.branches("load")], results.snapshots, dict(results.thresholds)
        ([3], 0, {})
    """

    folder: Path
    curve: Curve
    case: Mapping[str, Any] = field(default_factory=dict)
    summary: Mapping[str, Any] = field(default_factory=dict)
    free: Columns = field(default_factory=dict)
    response: Columns = field(default_factory=dict)
    thresholds: Mapping[str, Any] = field(default_factory=dict)
    motion: Columns = field(default_factory=dict)
    slip: Columns = field(default_factory=dict)
    slip_loops: Columns = field(default_factory=dict)
    top: Columns = field(default_factory=dict)
    built: Surface | None = None

    __repr__ = short_repr

    @classmethod
    def read(cls, folder: str | Path, surface: Surface | None = None, *, parts: Iterable[str] = ()) -> Results:
        """Read the folder of a run.

        Args:
            folder: of the run
            surface: of the case, where it exists already: its summit is not searched again
            parts: names of attributes, in place of all; then there need be no curve

        Raises:
            InputError: curve.csv is missing, or a file cannot be read
        """
        folder = Path(folder)
        if not parts and not (folder / run_folder.CURVE).is_file():
            raise InputError(f"{folder} holds no curve.csv; give the folder of a run")
        found: dict[str, Any] = {"curve": Curve.from_rows([])}
        for attribute, (name, reader) in _FILES.items():
            if (folder / name).is_file() and (not parts or attribute in parts):
                try:
                    found[attribute] = reader(folder / name)
                except UNREADABLE as error:
                    raise InputError(f"{folder / name} cannot be read: {one_line(error)}") from None
        return cls(folder=folder, built=surface, **found)

    def unit(self, dimension: str) -> str:
        """SI unit of a quantity, a key of SI; empty for another system of units."""
        return SI[dimension] if self.case.get("units", "SI") == "SI" else ""

    @cached_property
    def surface(self) -> Any:
        """Surface of the case, None without a case file."""
        if self.built is not None:
            return self.built
        return Surface.from_spec(**self.case["surface"]) if "surface" in self.case else None

    @cached_property
    def tool(self) -> Any:
        """Tool of the case; None for the flat."""
        return Surface.from_spec(**self.case["tool"]) if "tool" in self.case else None

    @property
    def snapshots(self) -> int:
        """Number of load steps with stored pressure."""
        return len(self.top.get("pressure", ()))

    def gap_conductance(self) -> tuple[Array, Array, Array]:
        """Conductance of the joint per nominal area, of heat or current, at each step, by the column conductance C.

        A body of the conductivity k1 has k1 C between its base and the spots, without the block. The other body is its
        mirror: the spots are at one potential, and both are in series, h = k1 k2/(k1 + k2) C/A0.

        Returns:
            nominal pressure [force/length^2], conductance per nominal area and its error bar [power/(length^2
            temperature)], each (n,); NaN where the curve has none, or the case no conductivity or surface

        Examples:
            One round spot of the radius a = 0.1 between two bodies of conductivity 50 on an area of 4: 2 k a/A0.

            >>> curve = asp.Curve.from_rows([{"delta": 1.0, "force": 1.0, "conductance": 4 * 0.1}])
            >>> case = {"surface": {"L": 2.0}, "material": {"conductivity": 50.0}}
            >>> Results("out", curve, case).gap_conductance()[1].tolist()
            [2.5]
        """
        patch, material = float(self.case.get("surface", {}).get("L", np.nan)) ** 2, self.case.get("material", {})
        first = float(material.get("conductivity") or np.nan)
        second = float(material.get("conductivity_other") or first)
        factor = first * second / (first + second) / patch
        return self.curve.force / patch, factor * self.curve.conductance, factor * self.curve.error_conductance

    def branches(self, *names: str) -> list[Curve]:
        """Parts of the curve with one of these branches each, in order; each starts at the end of the previous one."""
        return [leg for leg in self.curve.legs() if leg.branch[-1] in names]

    def gap_grid(self, n: int = 512, snapshot: int = -1) -> Array:
        """Gap at the centres of n x n cells of the patch, 0 in contact.

        A solver of Reynolds' equation in another program takes it as it is: the cells in contact are those of the
        contact area of the curve.

        Args:
            n: cells along each side
            snapshot: number of the stored step, negative from the last

        Returns:
            gaps [length], index [iy, ix] (n, n)

        Raises:
            InputError: the run kept no fields, or not so many
        """
        if not -self.snapshots <= snapshot < self.snapshots:
            raise InputError(
                f"there is no step {snapshot} among the {self.snapshots} of {self.folder}: fields need "
                "output.fields = true"
            )
        return Raster(self.top, n=n).gap(snapshot)


def _read_json(path: Path) -> Mapping[str, Any]:
    data = json.loads(read_text(path))
    if not isinstance(data, dict):
        raise ValueError("it is not a JSON object")
    return data


def _read_columns(path: Path) -> Columns:
    """Columns of numbers, NaN where one is missing, or of texts where a value is no number, each (n,)."""
    columns: dict[str, NDArray[Any]] = {}
    names, *rows = csv.reader(read_text(path).splitlines())
    for name, values in zip(names, zip(*rows, strict=True) if rows else [()] * len(names), strict=True):
        try:
            columns[name] = np.array([float(value) if value else np.nan for value in values])
        except ValueError:
            columns[name] = np.array(values, dtype=str)
    return columns


#: Attribute of `Results` -> file in the folder and its reader.
_FILES: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "case": (run_folder.CASE, lambda path: parse_toml(read_text(path))),
    "summary": (run_folder.SUMMARY, _read_json),
    "curve": (run_folder.CURVE, Curve.read),
    "thresholds": (run_folder.THRESHOLDS, _read_json),
    "top": (f"{run_folder.FIELDS}/{run_folder.TOP}", read_npz),
    **{name: (f"{name}.csv", _read_columns) for name in ("free", "response", "motion", "slip", "slip_loops")},
}


class Raster:
    """Values at the nodes of the top, at the middles of n x n equal squares; index [iy, ix].

    Attributes:
        top: arrays of top.npz
        box: lower and upper corner of what the squares cover, by default the patch (2, 2) [length]
        edge_nodes: node on the edge of a facet whose third each square lies in (n, n)
    """

    def __init__(self, top: Any, box: Array | None = None, n: int = PIXELS) -> None:
        points, triangles = top["points"], top["triangles"]
        self.top, self.box = top, np.array([points.min(axis=0), points.max(axis=0)]) if box is None else box
        middles = (np.arange(n) + 0.5) / n
        x, y = (low + middles * (high - low) for low, high in self.box.T)
        found = triangles_at(x, y, points, triangles)
        self._at, self._facets = np.stack(np.meshgrid(x, y), axis=-1), found % (len(triangles) // 4)
        self._nodes = triangles[found]
        self._shares = shares(self._at, *np.moveaxis(points[self._nodes], 2, 0))
        # of four triangles of a facet three begin at a corner, see `element.FACE_TRIANGLES`
        at_corner = (np.arange(3) == 0) & (found < 3 * len(triangles) // 4)[..., None]
        nearest = np.where(at_corner, -np.inf, self._shares).argmax(axis=-1)[..., None]
        self.edge_nodes = np.take_along_axis(self._nodes, nearest, axis=-1)[..., 0]

    def __call__(self, values: Array) -> Array:
        """Values that are linear in the triangles between the nodes."""
        return np.asarray((values[self._nodes] * self._shares).sum(axis=-1))

    def touching(self, i: int) -> NDArray[np.bool_]:
        """Where a snapshot is in contact: the touched thirds of facets, whose patches are the spots that count."""
        return np.asarray(self.top["touched"][i][self.edge_nodes], dtype=bool)

    def pressure(self, i: int) -> Array:
        """Pressure of a snapshot, NaN out of contact."""
        return np.where(self.touching(i), self(self.top["pressure"][i]), np.nan)

    def gap(self, i: int) -> Array:
        """Gap of a snapshot, of second order in the facets, 0 in contact and there alone [length]."""
        corners, edges = facets(self.top)
        inside = shares(self._at, *self.top["points"][corners[:, self._facets]])
        nodes = np.concatenate([corners, edges])[:, self._facets.ravel()].T
        values = at_inside(inside.reshape(-1, 3), self.top["gap"][i][nodes]).reshape(self._facets.shape)
        return np.where(self.touching(i), 0.0, np.maximum(values, OPEN * np.ptp(self.box[:, 0])))


def facets(top: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Corners (3, facets) of the facets of a top, and the nodes on the edges that begin at them."""
    thirds = top["triangles"][: 3 * len(top["triangles"]) // 4].reshape(3, -1, 3)  # see `element.FACE_TRIANGLES`
    return thirds[..., 0], thirds[..., 1]
