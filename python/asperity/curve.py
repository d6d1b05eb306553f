"""The force-deflection curve: its record, its file, its power law, and comparison with another."""

from __future__ import annotations

import csv
import difflib
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError
from .storage import replace_file

Array = NDArray[Any]

COLUMNS = (
    "step",
    "branch",
    "delta",
    "delta_star",
    "force",
    "P_star",
    "area_fraction",
    "max_pressure",
    "plastic_fraction",
    "max_plastic_strain",
    "error_P_star",
    "newton",
    "krylov",
    "seconds",
)
BRANCHES = ("load", "unload", "reload")
_COUNTS = ("step", "newton", "krylov")
_REQUIRED = ("delta", "force")

#: Relative tolerances of compare_curves; columns left out are not compared.
TOLERANCES: Mapping[str, float] = {
    "delta": 1e-9,
    "force": 1e-6,
    "P_star": 1e-6,
    "area_fraction": 1e-3,
    "max_pressure": 1e-3,
    "plastic_fraction": 1e-3,
    "max_plastic_strain": 1e-3,
}


@dataclass(frozen=True, eq=False)
class Curve:
    """Accepted load steps in order, one array a column, all read-only and of one length.

    A column that is not known is NaN (0 for counts). `header` is free metadata, stored with the
    file.

    Attributes:
        step: number of the step (int).
        branch: "load", "unload" or "reload" (str).
        delta: approach of the flat from first touch (length).
        delta_star: delta/L.
        force: normal force (force).
        P_star: force/(A_0 E').
        area_fraction: true over nominal contact area.
        max_pressure: largest contact pressure (force/length^2).
        plastic_fraction: share of the volume that has yielded.
        max_plastic_strain: largest accumulated plastic strain.
        error_P_star: error bar of P_star.
        newton: Newton iterations of the step (int).
        krylov: Krylov iterations of the step (int).
        seconds: time of the step (s).
        header: metadata, as JSON in the first line of the file.

    Raises:
        InputError: columns of different length, unknown branch, infinite or missing deflection
            or force.
    """

    step: Array
    branch: Array
    delta: Array
    delta_star: Array
    force: Array
    P_star: Array
    area_fraction: Array
    max_pressure: Array
    plastic_fraction: Array
    max_plastic_strain: Array
    error_P_star: Array
    newton: Array
    krylov: Array
    seconds: Array
    header: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in COLUMNS:
            kind = str if name == "branch" else int if name in _COUNTS else float
            column = np.array(getattr(self, name), dtype=kind, ndmin=1)
            column.flags.writeable = False
            object.__setattr__(self, name, column)
        sizes = {name: getattr(self, name).size for name in COLUMNS}
        if len(set(sizes.values())) > 1:
            raise InputError(f"Curve columns must have one length, not {sizes}.")
        odd = set(self.branch.tolist()) - set(BRANCHES)
        if odd:
            raise InputError(f"Unknown branch {odd.pop()!r}; legal: {', '.join(BRANCHES)}.")
        for name in _REQUIRED:
            bad = np.flatnonzero(~np.isfinite(getattr(self, name)))
            if bad.size:
                raise InputError(f"Curve column {name!r} is not finite in row {bad[0]}.")

    @staticmethod
    def from_rows(rows: Sequence[Mapping[str, Any]], header: Mapping[str, Any] | None = None) -> Curve:
        """Build a curve from one mapping a step; keys are column names.

        Args:
            rows: at least "delta" and "force" each; "step" defaults to the position, "branch" to
                "load", other numbers to NaN, counts to 0.
            header: metadata.

        Raises:
            InputError: a key is unknown or a required one missing.
        """
        for row in rows:
            _check_names(row, "row of a curve")
        defaults: dict[str, Any] = dict.fromkeys(COLUMNS, math.nan)
        defaults |= dict.fromkeys(_COUNTS, 0) | {"branch": "load"}
        full = [{**defaults, "step": i, **row} for i, row in enumerate(rows)]
        columns = {name: np.array([row[name] for row in full]) for name in COLUMNS}
        return Curve(**columns, header=dict(header or {}))

    def __len__(self) -> int:
        """Return the number of steps."""
        return int(self.delta.size)

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the steps as dictionaries of Python numbers."""
        columns = [getattr(self, name).tolist() for name in COLUMNS]
        for values in zip(*columns, strict=True):
            yield dict(zip(COLUMNS, values, strict=True))

    def where(self, mask: Array) -> Curve:
        """Return the steps that a boolean array (or an index array) picks."""
        return Curve(**{name: getattr(self, name)[mask] for name in COLUMNS}, header=self.header)

    def loading(self) -> Curve:
        """Return the first loading, branch "load"."""
        return self.where(self.branch == "load")

    def unloading(self) -> Curve:
        """Return the steps of branch "unload"."""
        return self.where(self.branch == "unload")

    def reloading(self) -> Curve:
        """Return the steps of branch "reload"."""
        return self.where(self.branch == "reload")

    def fit(self, norm: Literal["linear", "log"] = "linear") -> PowerLawFit:
        """Return the power law of the loading branch, points with delta* > 0 and P* > 0 only."""
        loading = self.loading()
        used = loading.where((loading.delta_star > 0) & (loading.P_star > 0))
        return fit_power_law(used.delta_star, used.P_star, norm)

    def write(self, path: str | Path) -> None:
        """Write a CSV file that reads back to the same bits, with the header as a first line.

        The file appears complete or not at all.
        """
        text = io.StringIO()
        if self.header:
            text.write(f"# {json.dumps(dict(self.header), sort_keys=True)}\n")
        table = csv.writer(text, lineterminator="\n")
        table.writerow(COLUMNS)
        table.writerows(row.values() for row in self.rows())
        replace_file(Path(path), text.getvalue().encode())

    @staticmethod
    def read(path: str | Path) -> Curve:
        """Read a CSV file: optional "# {json}" line, column names, one line a step.

        Columns "delta" and "force" are required, the other names of COLUMNS optional.

        Raises:
            InputError: no such file, no or unknown column names, or a value that is not a number
                (with its line).
        """
        path = Path(path)
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"{path}: cannot be read as a curve ({error}).") from error
        header, skip = _read_header(lines, path)
        if len(lines) <= skip:
            raise InputError(f"{path}: no column names; expected {','.join(COLUMNS)}.")
        names = [name.strip() for name in lines[skip].split(",")]
        _check_names(names, str(path))
        rows = []
        for number, values in enumerate(csv.reader(lines[skip + 1 :]), start=skip + 2):
            if len(values) != len(names):
                raise InputError(f"{path}, line {number}: {len(values)} values for {len(names)} columns.")
            pairs = zip(names, values, strict=True)
            rows.append({name: _parse(name, text, path, number) for name, text in pairs})
        return Curve.from_rows(rows, header)


def _check_names(names: Any, where: str) -> None:
    for name in names:
        if name not in COLUMNS:
            close = difflib.get_close_matches(name, COLUMNS, n=1)
            hint = f" (did you mean {close[0]!r}?)" if close else ""
            raise InputError(f"{where}: unknown column {name!r}{hint}; legal: {', '.join(COLUMNS)}.")
    if len(set(names)) < len(names):
        raise InputError(f"{where}: a column occurs twice in {', '.join(names)}.")
    for name in _REQUIRED:
        if name not in names:
            raise InputError(f"{where}: column {name!r} is missing.")


def _read_header(lines: list[str], path: Path) -> tuple[dict[str, Any], int]:
    if not lines or not lines[0].startswith("#"):
        return {}, 0
    try:
        header = json.loads(lines[0][1:])
    except json.JSONDecodeError as error:
        raise InputError(f"{path}, line 1: the header is not JSON ({error}).") from error
    if not isinstance(header, dict):
        raise InputError(f"{path}, line 1: the header must be a JSON object.")
    return header, 1


def _parse(name: str, text: str, path: Path, line: int) -> Any:
    if name == "branch":
        return text.strip()
    try:
        return int(text) if name in _COUNTS else float(text)
    except ValueError as error:
        raise InputError(f"{path}, line {line}: {name} = {text!r} is not a number.") from error


@dataclass(frozen=True)
class PowerLawFit:
    """P* = k (delta*)^n by least squares; meaningless without norm and range.

    Attributes:
        k: dimensionless coefficient.
        n: exponent.
        norm: "linear" (least squares of P*) or "log" (of ln P*).
        range: smallest and largest delta* used.
        points: number of points.
        r2: coefficient of determination, on the scale of the norm.
        ci_k: confidence interval of k (symmetric in ln k, so always positive).
        ci_n: confidence interval of n.
        correlation: of the estimates of ln k and n.
        confidence: level of the intervals.
    """

    k: float
    n: float
    norm: str
    range: tuple[float, float]
    points: int
    r2: float
    ci_k: tuple[float, float]
    ci_n: tuple[float, float]
    correlation: float
    confidence: float

    def __call__(self, delta_star: ArrayLike) -> Array:
        """Return P* at delta*; 0 where delta* is not positive."""
        return self.k * np.maximum(np.asarray(delta_star, dtype=float), 0.0) ** self.n

    def stiffness(self, E_prime: float, L: float) -> float:
        """Return K = k A_0 E'/L^n (force/length^n) of F = K delta^n, with A_0 = L^2."""
        return self.k * L**2 * E_prime / L**self.n

    def to_dict(self) -> dict[str, Any]:
        """Return the section "fit" of summary.json."""
        return {
            "k": self.k,
            "n": self.n,
            "norm": self.norm,
            "range": list(self.range),
            "points": self.points,
            "r2": self.r2,
            "ci": {"k": list(self.ci_k), "n": list(self.ci_n), "confidence": self.confidence},
        }


def fit_power_law(
    delta_star: ArrayLike,
    P_star: ArrayLike,
    norm: Literal["linear", "log"] = "linear",
    *,
    confidence: float = 0.95,
) -> PowerLawFit:
    """Fit P* = k (delta*)^n.

    The log-log regression is closed form; it also starts the linear-scale least squares (Gauss-
    Newton in ln k and n). Intervals come from the residual variance and Student's t with
    points - 2 degrees of freedom (Seber and Wild, Nonlinear Regression, 1989, section 5.1): they
    assume scatter that is independent from point to point, which the points of one smooth curve
    do not have, so they measure misfit rather than chance.

    Args:
        delta_star: delta/L, positive, at least 3 different values, shape (m,).
        P_star: P/(A_0 E'), positive, shape (m,).
        norm: "linear" or "log".
        confidence: level of the intervals, between 0 and 1.

    Raises:
        InputError: fewer than 3 points, values that are not positive and finite, fewer than 3
            different deflections, or an unknown norm.
    """
    from scipy.optimize import least_squares
    from scipy.stats import t as student

    d, p = _fit_data(delta_star, P_star)
    if norm not in ("linear", "log"):
        raise InputError(f'norm must be "linear" or "log", not {norm!r}.')
    if not 0 < confidence < 1:
        raise InputError(f"confidence must lie between 0 and 1, not {confidence!r}.")
    # scaled by the largest values, so that neither units nor a steep law spoil the conditioning
    x, y = np.log(d / d.max()), p / p.max()
    design = np.stack([np.ones_like(x), x], axis=1)
    solution = np.linalg.lstsq(design, np.log(y), rcond=None)[0]
    if norm == "linear":
        solution = least_squares(
            lambda s: np.exp(design @ s) - y,
            solution,
            jac=lambda s: np.exp(design @ s)[:, None] * design,
            method="lm",
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
        ).x
        model = np.exp(design @ solution)
        jacobian, target = model[:, None] * design, y
    else:
        model, jacobian, target = design @ solution, design, np.log(y)
    rss = float(np.sum((target - model) ** 2))
    tss = float(np.sum((target - target.mean()) ** 2))
    covariance = np.linalg.inv(jacobian.T @ jacobian) * (rss / (d.size - 2))
    # ln k = s_0 + ln(max p) - n ln(max d)
    back = np.array([[1.0, -math.log(d.max())], [0.0, 1.0]])
    covariance = back @ covariance @ back.T
    ln_k, n = back @ solution + [math.log(p.max()), 0.0]
    spread_k, spread_n = np.sqrt(np.diag(covariance)) * student.ppf((1 + confidence) / 2, d.size - 2)
    scale = math.sqrt(covariance[0, 0] * covariance[1, 1])
    return PowerLawFit(
        k=math.exp(ln_k),
        n=float(n),
        norm=norm,
        range=(float(d.min()), float(d.max())),
        points=int(d.size),
        r2=1.0 - rss / tss if tss > 0 else math.nan,
        ci_k=(math.exp(ln_k - spread_k), math.exp(ln_k + spread_k)),
        ci_n=(float(n - spread_n), float(n + spread_n)),
        correlation=float(covariance[0, 1] / scale) if scale > 0 else 0.0,
        confidence=confidence,
    )


def _fit_data(delta_star: ArrayLike, P_star: ArrayLike) -> tuple[Array, Array]:
    d, p = (np.asarray(values, dtype=float) for values in (delta_star, P_star))
    if d.ndim != 1 or d.shape != p.shape:
        raise InputError(f"A fit needs two lists of one length, not shapes {d.shape}, {p.shape}.")
    for name, values in (("delta*", d), ("P*", p)):
        bad = np.flatnonzero(~((values > 0) & np.isfinite(values)))
        if bad.size:
            raise InputError(
                f"{name} = {values[bad[0]]:g} at point {bad[0]}: a power law is fitted to "
                "positive, finite values only; leave out points before first touch."
            )
    if np.unique(d).size < 3:
        raise InputError(
            f"{np.unique(d).size} different deflections: a power law needs at least 3; use more load steps."
        )
    return d, p


def interface_deflection(delta: ArrayLike, force: ArrayLike, *, height: float, area: float, modulus: float) -> Array:
    """Return the deflection of the rough interface alone, delta - P h_b/(A_0 M) (length).

    The flat-to-base deflection contains the elastic compression of the block as a whole.

    Args:
        delta: deflection (length).
        force: P (force), same shape.
        height: h_b of the block (length).
        area: A_0 (length^2).
        modulus: M (force/length^2): E (1-nu)/((1+nu)(1-2 nu)) with sides u.n = 0, E with free
            sides.
    """
    return np.asarray(delta, float) - np.asarray(force, float) * height / (area * modulus)


@dataclass(frozen=True)
class Difference:
    """One way in which two curves differ.

    Attributes:
        column: name of the column, or "rows" when the steps do not correspond.
        row: where the difference is greatest.
        a: value of the first curve there.
        b: value of the second curve there.
        error: |a - b| over the largest magnitude of the column in the second curve.
        tolerance: of the column.
    """

    column: str
    row: int
    a: Any
    b: Any
    error: float
    tolerance: float

    def __str__(self) -> str:
        """Return one line for a report."""
        if self.column == "rows":
            return f"rows: {self.a} against {self.b}, first at row {self.row}"
        return (
            f"{self.column}: {self.a!r} against {self.b!r} at row {self.row}, relative difference "
            f"{self.error:.3g} > {self.tolerance:g}"
        )


def compare_curves(a: Curve, b: Curve, tolerances: Mapping[str, float] | None = None) -> list[Difference]:
    """Compare a curve with a reference, step by step.

    Args:
        a: the curve.
        b: the reference; errors are relative to the largest magnitude of each of its columns.
        tolerances: by column; default the "tolerances" in the header of `b`, else TOLERANCES.
            Columns left out are not compared.

    Returns:
        One difference a column that exceeds its tolerance, or the first step that has no
        counterpart; empty when the curves agree. NaN agrees with NaN only.

    Raises:
        InputError: a tolerance is negative or its column unknown.
    """
    chosen: Mapping[str, float] = b.header.get("tolerances", TOLERANCES) if tolerances is None else tolerances
    for name, tolerance in chosen.items():
        if name not in COLUMNS or name == "branch":
            raise InputError(f"No tolerance can be set for {name!r}; legal: {', '.join(COLUMNS)}.")
        if not tolerance >= 0:
            raise InputError(f"The tolerance of {name} must be >= 0, not {tolerance!r}.")
    shared = min(len(a), len(b))
    changed = np.flatnonzero(a.branch[:shared] != b.branch[:shared])
    if changed.size:
        row = int(changed[0])
        return [Difference("rows", row, str(a.branch[row]), str(b.branch[row]), math.inf, 0.0)]
    if len(a) != len(b):
        return [Difference("rows", shared, f"{len(a)} steps", f"{len(b)} steps", math.inf, 0.0)]
    differences = []
    for name, tolerance in chosen.items():
        x, y = getattr(a, name).astype(float), getattr(b, name).astype(float)
        scale = np.max(np.abs(y[np.isfinite(y)]), initial=0.0) or 1.0
        error = np.where((x == y) | (np.isnan(x) & np.isnan(y)), 0.0, np.abs(x - y) / scale)
        error = np.where(np.isnan(error), np.inf, error)
        row = int(np.argmax(error)) if error.size else 0
        if error.size and error[row] > tolerance:
            values = getattr(a, name)[row].item(), getattr(b, name)[row].item()
            differences.append(Difference(name, row, *values, float(error[row]), tolerance))
    return differences
