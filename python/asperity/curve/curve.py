"""The curve of force over approach: its columns and its file."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.arrays import Array
from asperity.curve.slope import fitted_rows, legs, slopes
from asperity.errors import InputError
from asperity.runtime.display import nearest
from asperity.runtime.files import write_csv
from asperity.runtime.text_table import TextTable, lines_of
from asperity.units import FORCES, LENGTHS

if TYPE_CHECKING:
    from asperity.curve.power_law import PowerLawFit


#: Error of the contact area over the area of the facets that its edge crosses, on the whole of them: -0.06 to 0.11 on
#: meshes of 7 elastic surfaces by boundary elements (benchmarks/area.py edge).
EDGE = 0.1
UNRESOLVED = 0.5  # error of the contact area over the area, reached when the contact has fewer than about six facets

BRANCHES = ("load", "hold", "unload", "reload")
_REQUIRED = {"delta": LENGTHS, "force": FORCES}  # columns of every curve, and the units that a file may name


def column(about: str, dimension: str = "", kind: type = float) -> dict[str, Any]:
    """Metadata of a column: what it is, its dimension in terms of length, force and s (seconds), kind of its values."""
    return {"about": about, "dimension": dimension, "kind": kind}


def error_bar(name: str, dimension: str = "") -> dict[str, Any]:
    """Metadata of the error bar of a column, in its unit; known for runs with a tolerance."""
    return column(f"error bar of {name}", dimension)


@dataclass(frozen=True, eq=False)
class Curve:
    """Accepted load steps in order: one read-only array (n,) per column.

    Unknown values are NaN (0 for counts). The columns are the fields below, each with its meaning and dimension.

    Attributes:
        header: free metadata, stored as JSON in the first line of the file

    Raises:
        InputError: columns of different length, unknown branch, infinite or missing approach or force

    Examples:
        >>> curve = asp.Curve.from_rows([{"delta": d, "force": 2 * d, "delta_star": d, "P_star": d} for d in (1, 2, 3)])
        >>> len(curve), curve.force.tolist(), round(curve.fit().n, 6)
        (3, [2.0, 4.0, 6.0], 1.0)
    """

    step: Array = field(metadata=column("number of the step", kind=int))
    branch: Array = field(metadata=column("load, hold, unload or reload", kind=str))
    delta: Array = field(metadata=column("approach of the flat from first contact", "length"))
    delta_star: Array = field(metadata=column("delta/L"))
    force: Array = field(metadata=column("normal force", "force"))
    P_star: Array = field(metadata=column("force/(A_0 E')"))
    area_fraction: Array = field(metadata=column("true over nominal contact area, A/A_0"))
    max_pressure: Array = field(metadata=column("largest contact pressure", "force/length^2"))
    plastic_fraction: Array = field(metadata=column("volume that has yielded over the volume of the block"))
    max_plastic_strain: Array = field(metadata=column("largest accumulated plastic strain"))
    error_P_star: Array = field(metadata=error_bar("P_star"))
    error_area_fraction: Array = field(
        metadata=column("error bar of area_fraction, from the facets that the edge of the contact crosses")
    )
    newton: Array = field(metadata=column("Newton iterations of the step", kind=int))
    krylov: Array = field(metadata=column("Krylov iterations of the step", kind=int))
    seconds: Array = field(metadata=column("wall-clock time of the step", "s"))
    mean_gap: Array = field(
        metadata=column("distance between the flat and the mean plane of the deformed surface", "length")
    )
    mean_pressure: Array = field(
        metadata=column("force over the true contact area; NaN without an area", "force/length^2")
    )
    spots: Array = field(metadata=column("contact spots, connected patches of touched thirds of facets", kind=int))
    largest_spot: Array = field(metadata=column("contact area of the largest one", "length^2"))
    k_n: Array = field(metadata=column("slope dF/d(delta) of the curve, see `slope.slopes`", "force/length"))
    k_n_elastic: Array = field(metadata=column("normal stiffness of unloading and small vibration", "force/length"))
    k_t: Array = field(metadata=column("tangential stiffness without slip, mean of x and y, elastic", "force/length"))
    k_t_x: Array = field(metadata=column("that along x", "force/length"))
    k_n_interface: Array = field(metadata=column("k_n_elastic without the compliance of the block", "force/length"))
    k_t_interface: Array = field(metadata=column("k_t without the compliance of the block", "force/length"))
    conductance: Array = field(metadata=column("constriction conductance over the conductivity", "length"))
    error_mean_gap: Array = field(metadata=error_bar("mean_gap", "length"))
    error_k_n: Array = field(metadata=error_bar("k_n", "force/length"))
    error_k_n_elastic: Array = field(metadata=error_bar("k_n_elastic", "force/length"))
    error_k_t: Array = field(metadata=error_bar("k_t", "force/length"))
    error_k_t_x: Array = field(metadata=error_bar("k_t_x", "force/length"))
    error_k_n_interface: Array = field(metadata=error_bar("k_n_interface", "force/length"))
    error_k_t_interface: Array = field(metadata=error_bar("k_t_interface", "force/length"))
    error_conductance: Array = field(metadata=error_bar("conductance", "length"))
    transmissivity_x: Array = field(
        metadata=column("flow of a film in the gap along x: Q = T/(12 eta) times the pressure difference", "length^3")
    )
    transmissivity_y: Array = field(metadata=column("that along y", "length^3"))
    hydraulic_aperture: Array = field(metadata=column("cube root of the mean of both", "length"))
    error_transmissivity_x: Array = field(metadata=error_bar("transmissivity_x", "length^3"))
    error_transmissivity_y: Array = field(metadata=error_bar("transmissivity_y", "length^3"))
    error_hydraulic_aperture: Array = field(metadata=error_bar("hydraulic_aperture", "length"))
    max_strain: Array = field(
        metadata=column("largest equivalent strain, sqrt(2/3 e:e) of its deviator; logarithmic in finite strain")
    )
    strained_fraction: Array = field(
        metadata=column("volume with an equivalent strain above 5 % over the volume of the block")
    )
    edge_fraction: Array = field(
        metadata=column("area of the facets that the edge of the contact crosses over the nominal area")
    )
    time: Array = field(metadata=column("from the beginning of the load path, for a law with time", "s"))
    header: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in COLUMNS:
            given = np.array(getattr(self, name), ndmin=1)
            with np.errstate(invalid="ignore"):
                values: Array = given.astype(_KINDS[name])
            if _KINDS[name] is int and np.any(values != given):
                raise InputError(f"Curve column {name!r} counts: give whole numbers.")
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        sizes = {name: getattr(self, name).size for name in COLUMNS}
        if len(set(sizes.values())) > 1:
            raise InputError(f"Curve columns must have one length, not {sizes}.")
        odd = set(self.branch.tolist()) - set(BRANCHES)
        if odd:
            raise InputError(f"Unknown branch {odd.pop()!r}; legal: {', '.join(BRANCHES)}.")
        for name in _REQUIRED:
            bad = np.flatnonzero(~np.isfinite(getattr(self, name)))
            if bad.size:
                raise InputError(f"Curve column {name!r} is not finite in step {bad[0] + 1}.")

    @staticmethod
    def from_rows(rows: Sequence[Mapping[str, Any]], header: Mapping[str, Any] | None = None) -> Curve:
        """Build a curve from one mapping per step; keys are column names.

        Args:
            rows: each with at least "delta" and "force"; for others see `from_columns`
            header: metadata

        Raises:
            InputError: a key is unknown, or a required one is missing
        """
        for row in rows:
            _check_names(row)
        names = dict.fromkeys([*_REQUIRED, *(name for row in rows for name in row)])
        unknown = _unknown(len(rows))
        columns = {name: [row.get(name, unknown[name][i]) for i, row in enumerate(rows)] for name in names}
        return Curve.from_columns(columns, header)

    @staticmethod
    def from_columns(columns: Mapping[str, Any], header: Mapping[str, Any] | None = None) -> Curve:
        """Build a curve from columns of one length (n,); names that are not in COLUMNS are left out.

        Args:
            columns: "delta" and "force" at least; "step" defaults to the position, "branch" to "load", "k_n" to the
                slope of the curve, other numbers to NaN, counts to 0
            header: metadata

        Raises:
            InputError: a required column is missing, or columns differ in length, or hold what is not a number
        """
        known = {name: np.asarray(columns[name]) for name in COLUMNS if columns.get(name) is not None}
        _check_names(known)
        if len({values.shape for values in known.values()}) > 1 or known["delta"].ndim != 1:
            sizes = ", ".join(f"{values.size} of {name}" for name, values in known.items())
            raise InputError(f"the columns of a curve need one length, not {sizes}")
        try:
            curve = Curve(**_unknown(known["delta"].size) | known, header=dict(header or {}))
        except ValueError as error:
            raise InputError(f"the curve contains something that is not a number: {error}") from None
        return curve if "k_n" in known else curve.with_force(curve.force)

    def with_bar(self, name: str, values: Array, error: Array) -> Curve:
        """Curve with other values of a column (n,) that has error bars, and these."""
        columns: dict[str, Any] = {name: values, f"error_{name}": error}
        return replace(self, **columns)

    def with_force(self, force: Array) -> Curve:
        """Curve with other forces (n,) and the slopes k_n that belong to them."""
        return replace(self, force=force, k_n=slopes(self.delta, force, self.branch)[0])

    def __len__(self) -> int:
        """Number of steps."""
        return int(self.delta.size)

    def __repr__(self) -> str:
        parts = ", ".join(f"{np.sum(self.branch == name)} {name}" for name in BRANCHES if name in self.branch)
        if not len(self):
            return "Curve(no steps)"
        return f"Curve({parts}; delta up to {self.delta.max():.6g}, force up to {self.force.max():.6g})"

    def rows(self) -> Iterator[dict[str, Any]]:
        """Steps as dictionaries of Python numbers."""
        columns = [getattr(self, name).tolist() for name in COLUMNS]
        for values in zip(*columns, strict=True):
            yield dict(zip(COLUMNS, values, strict=True))

    def where(self, mask: Array) -> Curve:
        """Steps selected by a boolean array (n,) or an index array (m,)."""
        return Curve(**{name: getattr(self, name)[mask] for name in COLUMNS}, header=self.header)

    def loading(self) -> Curve:
        """Steps of branch "load", the first loading."""
        return self.where(self.branch == "load")

    def untouched(self) -> bool:
        """Whether no step of the first loading has a force."""
        return not bool(np.any(self.loading().P_star > 0.0))

    def unresolved(self) -> str:
        """Warning if the mesh is too coarse for the contact at the greatest load, else an empty string."""
        branch = self.loading()
        area, error = branch.area_fraction[-1:], branch.error_area_fraction[-1:]
        if not np.any(error > UNRESOLVED * area):
            return ""
        few = "the contact touches a few facets only" if area[0] < 0.5 else "the facets are too large for its edge"
        return (
            f"{few}: area_fraction = {area[0]:.2g} with an error of {branch.area_error(-1):.2g} at delta/L = "
            f"{branch.delta_star[-1]:.3g}"
        )

    def area_error(self, row: int) -> float:
        """Error bar of the area fraction in a row, no greater than a share of the patch can be wrong."""
        area, error = float(self.area_fraction[row]), float(self.error_area_fraction[row])
        return error if math.isnan(error) else min(error, max(area, 1.0 - area))

    def bar(self, name: str, row: int) -> float:
        """Error bar over the value of a column in a row; NaN where either is unknown, or the value is 0.

        The columns are "P_star" (that of the force too), "area_fraction" and those of WITH_ERRORS.
        """
        value, error = float(getattr(self, name)[row]), float(getattr(self, f"error_{name}")[row])
        return abs(error / value) if value else math.nan

    @property
    def top(self) -> int:
        """Row of the greatest force, the first where a hold keeps the force."""
        return int(np.argmax(self.force >= (1.0 - 1e-5) * np.max(self.force)))

    def legs(self) -> list[Curve]:
        """Loadings and unloadings in order, each after the first with the end of the one before."""
        return [self.where(np.arange(max(start - 1, 0), stop)) for start, stop in legs(self.branch) if stop > start]

    def fit(self) -> PowerLawFit:
        """Power law P* = k (delta*)^n of the planned loading points with delta* > 0 and P* > 0.

        Raises:
            InputError: fewer than three such points, or delta_star and P_star are unknown
        """
        from asperity.curve.power_law import fit_power_law

        load = self.loading()
        rows = fitted_rows(load.delta, load.force)
        delta, force = load.delta_star[rows], load.P_star[rows]
        if np.isnan(delta).any() or np.isnan(force).any():
            raise InputError(
                "the curve has no delta_star and P_star, so no dimensionless power law: asperity.vibration.law_from "
                "fits delta and force"
            )
        return fit_power_law(delta, force)

    def fit_or_none(self) -> PowerLawFit | None:
        """`fit`, or None where it is not possible."""
        try:
            return self.fit()
        except InputError:
            return None

    def write(self, path: str | Path) -> None:
        """Write a CSV file, whole or not at all, that is read back to the same bits; NaNs are empty cells."""
        comment = json.dumps(dict(self.header), sort_keys=True) if self.header else ""
        write_csv(Path(path), COLUMNS, self.rows(), comment)

    @staticmethod
    def read(path: str | Path) -> Curve:
        """Curve of a file, see `read_curve`."""
        return read_curve(path)[0]


def read_curve(path: str | Path) -> tuple[Curve, set[str], str]:
    """Read a computed or measured curve from a text file, or from a folder with curve.csv.

    A line "# {json}" may be the first. The line above the rows names the columns, delta [um] and force [N] for example;
    names that are not in COLUMNS are left out. An empty cell is unknown.

    Returns:
        The curve, approach and force in m and N where the file names their units; names of its columns; how it was
        read, empty or a sentence

    Raises:
        InputError: there is no such file, delta or force is missing, its unit is unknown, or a cell is not a number
            (the message gives its line)
    """
    path = Path(path)
    try:
        columns, header, named = _columns_of(lines_of(path / "curve.csv" if path.is_dir() else path))
        note = "approach and force have the units of the file, here metres and newtons" if named else ""
        return Curve.from_columns(columns, header), set(columns), note
    except (InputError, OSError, ValueError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path} cannot be read as a curve: {reason}") from None


def _columns_of(lines: list[str]) -> tuple[dict[str, Any], dict[str, Any], bool]:
    """Columns and metadata of the lines of a file, and whether it names units."""
    about = lines[0].lstrip("# ") if lines and lines[0].startswith("#") else ""
    try:
        header = json.loads(about) if about.startswith("{") else {}
    except json.JSONDecodeError as error:
        raise ValueError(f"the first line is not JSON, {error}: correct it, or remove it") from None
    if lines[-1:] == [",".join(COLUMNS)]:  # a curve of no steps
        return dict.fromkeys(_REQUIRED, ()), header, False
    table = TextTable.of(lines, 2)
    found, rows = table.columns({name: _REQUIRED.get(name, {}) for name in COLUMNS}), table.rows()
    if not found.keys() >= _REQUIRED.keys():
        names = ", ".join(name for name, _ in table.names)
        raise ValueError(f"a line above its rows must name columns delta and force, and has {names[:60]!r}")
    if max(place for place, _ in found.values()) >= len(rows[0][1]):
        raise ValueError(f"its rows have {len(rows[0][1])} values for {len(table.names)} columns")
    columns: dict[str, Any] = {}
    for name, (place, factor) in found.items():
        cells, unknown = [(cells[place], line) for line, cells in rows], _UNKNOWN[_KINDS[name]]
        if _KINDS[name] is str:
            columns[name] = [cell for cell, _ in cells]
        else:
            columns[name] = [(factor or 1.0) * table.value(*cell) if cell[0] else unknown for cell in cells]
    return columns, header, any(factor for _, factor in found.values())


_TABLE = {each.name: each.metadata for each in fields(Curve) if each.metadata}
_KINDS: dict[str, type] = {name: about["kind"] for name, about in _TABLE.items()}
_UNKNOWN: dict[type, Any] = {float: math.nan, int: 0, str: ""}

#: Names of the columns of curve.csv, in their order, and the dimension of each.
COLUMNS = tuple(_TABLE)
DIMENSIONS: dict[str, str] = {name: about["dimension"] for name, about in _TABLE.items()}
#: Stiffnesses of the contact; the elastic ones are those of `quasistatic.stiffness`, k_n is the slope of the curve.
ELASTIC_STIFFNESSES = ("k_n_elastic", "k_t", "k_t_x", "k_n_interface", "k_t_interface")
STIFFNESSES = ("k_n", *ELASTIC_STIFFNESSES)
#: Columns with error bars in runs with a tolerance, in addition to P_star and area_fraction.
WITH_ERRORS = tuple(name.removeprefix("error_") for name in COLUMNS if name.startswith("error_"))[2:]


def _unknown(n: int) -> dict[str, Any]:
    """Columns of a curve of n steps of which nothing is known."""
    columns: dict[str, Any] = {name: np.full(n, _UNKNOWN[kind]) for name, kind in _KINDS.items()}
    return columns | {"step": np.arange(n), "branch": np.full(n, BRANCHES[0])}


def _check_names(names: Any) -> None:
    for name in names:
        if name not in COLUMNS:
            raise InputError(f"unknown column {name!r}{nearest(name, COLUMNS)}; legal: {', '.join(COLUMNS)}.")
    for name in _REQUIRED:
        if name not in names:
            raise InputError(f"column {name!r} is missing.")
