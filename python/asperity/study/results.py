"""Results of a study: a table with one row per case, and its levels."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import AsperityError, InputError
from asperity.output.assumption import DOUBTFUL
from asperity.output.assumptions import ON_EDGE
from asperity.output.run_files import read_summary
from asperity.power_law import PowerLawFit
from asperity.runtime.display import short_repr
from asperity.runtime.files import read_csv, replace_file, write_csv
from asperity.runtime.run_folder import CASE, CURVE
from asperity.study.definition import ENSEMBLE, Family, Study

Row = Mapping[str, Any]

TABLE, ABOUT = "results.csv", "study.json"
DONE = "done.json"  # exit reason and time of a case
TEXTS = ("case", "families", "exit_reason", "norm", "doubtful")
#: Columns of results.csv after "case", "families" and the keys that vary.
RESULT_COLUMNS = (
    "exit_reason", "summit_on_edge", "delta_star_max", "P_star_max", "k", "n", "n_low", "n_high", "norm", "range_low",
    "range_high", "points", "r2", "n_log", "stiffness", "preload", "slope", "n_loc",
    "n_loc_low", "n_loc_high", "kappa_loc", "kappa", "u_loss", "omega_loss", "drive_loss", "slope_unload", "n_unload",
    "kappa_unload", "omega_loss_unload", "area_fraction", "plastic_fraction", "max_plastic_strain", "block_load",
    "doubtful", "dofs", "cells", "newton", "seconds",
)  # fmt: skip


def summarise_case(case: Case, curve: Curve, summary: Mapping[str, Any]) -> dict[str, Any]:
    """Results of one case; those that cannot be computed from its curve are missing.

    Fits use the planned steps only, see `Curve.planned`.

    Args:
        case: as it was run
        curve: its curve
        summary: contents of its summary.json, or an empty mapping

    Returns:
        k, n, ...: linear-scale power law of the loading branch, with norm, range and interval;
        n_log: exponent of the log-log fit;
        stiffness: K of F = K delta^n [force/length^n];
        preload: half of the greatest P*; slope: dP*/d(delta*) there; n_loc, kappa_loc: local exponent and backbone
        curvature there, from the points of the loading branch, with n_loc without every other of them;
        kappa, u_loss, omega_loss, drive_loss: of the fitted law as a spring: backbone curvature, amplitude and
        frequency at which contact is lost, F^/(2 zeta) at which contact is lost in resonance;
        ..._unload: the same for the unloading branch about the preload;
        block_load: mean pressure over the pressure at which the block itself yields (sigma_y with free sides,
        otherwise sigma_y (1-nu)/(1-2nu));
        doubtful: names of the doubtful assumptions of the run
    """
    load = curve.loading()
    if not len(load):
        return {}
    side, solid = case.surface.L, case.material
    doubts = [line["name"] for line in summary.get("assumptions", []) if line["verdict"] == DOUBTFUL]
    row: dict[str, Any] = {
        "delta_star_max": float(load.delta_star.max()),
        "P_star_max": float(load.P_star.max()),
        "area_fraction": float(load.area_fraction[-1]),
        "plastic_fraction": float(load.plastic_fraction[-1]),
        "max_plastic_strain": float(load.max_plastic_strain[-1]),
        "seconds": sum((summary.get("seconds") or {}).values()) or None,
        "doubtful": "; ".join(doubts) or None,
        "summit_on_edge": int(any(name.startswith(ON_EDGE) for name in doubts)),
        **{name: summary.get(name) for name in ("dofs", "cells", "newton")},
    }
    if solid.yield_strength is not None:
        row["block_load"] = float(load.force[-1]) / (side**2 * solid.solid.yield_pressure(case.block.sides))
    fit = curve.fit_or_none()
    if fit is not None:
        row |= {
            "k": fit.k, "n": fit.n, "n_low": fit.ci_n[0], "n_high": fit.ci_n[1], "norm": fit.norm,
            "range_low": fit.range[0], "range_high": fit.range[1], "points": fit.points, "r2": fit.r2,
            "n_log": curve.fit("log").n, "stiffness": fit.stiffness(solid.E_prime, side),
        }  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # n_loc_low and n_loc_high give the uncertainty of the local slope
            row |= _vibration(curve, fit, solid.E_prime * side**2, side)
    return row


def _vibration(curve: Curve, fit: PowerLawFit, force: float, side: float) -> dict[str, Any]:
    """Results for a mass whose weight is half of the greatest force, with the laws of a curve as its spring."""
    from asperity.dynamics import ContactOscillator, PowerLaw, TableLaw, uncertainty, unload_reload

    preload = 0.5 * float(curve.loading().force.max())
    row: dict[str, Any] = {"preload": preload / force}
    paper = ContactOscillator(PowerLaw.from_fit(fit, side, force), preload).thresholds()
    row |= {"kappa": paper.kappa, "u_loss": paper.u_max, "omega_loss": paper.omega_loss, "drive_loss": paper.drive_loss}
    try:
        oscillator = ContactOscillator(TableLaw.from_curve(curve), preload)
        r, n_loc = oscillator.restoring, uncertainty(oscillator).n_loc
        row |= {
            "n_loc": n_loc.value, "n_loc_low": n_loc.low, "n_loc_high": n_loc.high,
            "kappa_loc": r.kappa, "slope": r.scale / r.z_s * side / force,
        }  # fmt: skip
    except AsperityError:
        pass
    if "unload" not in curve.branch:
        return row
    try:
        law = unload_reload(curve, preload)
        oscillator = ContactOscillator(law, preload)
        row |= {
            "slope_unload": law.derivatives(law.deflection(preload))[0] * side / force,
            "n_unload": oscillator.restoring.n_loc, "kappa_unload": oscillator.restoring.kappa,
        }  # fmt: skip
        row["omega_loss_unload"] = oscillator.thresholds().omega_loss
    except AsperityError:
        pass
    return row


def write_tables(study: Study, folder: Path) -> None:
    """Write results.csv, a row for each case that has ended, in the order of the study, and study.json."""
    rows = []
    for entry in study.entries:
        done = case_state(folder, entry.key)
        if done is None:
            continue
        row = {"case": entry.key, "families": " ".join(entry.families), **{k: entry.value(k) for k in study.keys}}
        row |= {name: done.get(name) for name in ("exit_reason", "seconds")}
        place = case_folder(folder, entry.key)
        if (place / CURVE).is_file():
            row = summarise_case(entry.case, Curve.read(place / CURVE), read_summary(place)) | row
        rows.append(row)
    write_csv(folder / TABLE, ("case", "families", *study.keys, *RESULT_COLUMNS), rows)
    families = [{"name": f.name, "title": f.title, "keys": f.keys} for f in study.families]
    about = {"title": study.title, "families": families, "cases": len(study.entries), "keys": study.keys}
    replace_file(folder / ABOUT, f"{json.dumps(about, indent=2)}\n".encode())


def case_folder(folder: Path, key: str) -> Path:
    """Folder of a case."""
    return folder / "cases" / key


def case_state(folder: Path, key: str) -> dict[str, Any] | None:
    """exit_reason and seconds [s] of a case; None if it has not ended."""
    try:
        state: dict[str, Any] = json.loads((case_folder(folder, key) / DONE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return state


@dataclass(frozen=True)
class StudyLevel:
    """Cases of a family that differ only in the seed.

    Attributes:
        parameters: values of the keys that vary in the family, without the seed
        rows: their rows of the table
    """

    parameters: Mapping[str, Any]
    rows: tuple[Row, ...]

    __repr__ = short_repr

    def column(self, name: str) -> Array:
        """Values of a column for all rows (rows,), NaN where missing."""
        return np.array([math.nan if row.get(name) in (None, "") else float(row[name]) for row in self.rows])


@dataclass(frozen=True)
class StudyResults:
    """Contents of the folder of a study.

    Attributes:
        folder: of the study
        title: of the study
        families: its parts
        rows: the table, numbers as floats, missing values None

    Examples:
        >>> row = {"case": "c0", "families": "study", "exit_reason": "done", "surface.D": 2.4, "n": 1.2}
        >>> results = StudyResults(Path("out"), "Title", (Family("study", "Title", ("surface.D",)),), (row,))
        >>> [level.column("n").tolist() for level in results.levels("study")]
        [[1.2]]
    """

    folder: Path
    title: str
    families: tuple[Family, ...]
    rows: tuple[Row, ...]

    __repr__ = short_repr

    @staticmethod
    def read(folder: str | Path) -> StudyResults:
        """Read the tables of a study.

        Raises:
            InputError: the folder contains no study
        """
        folder = Path(folder)
        try:
            about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
            columns = read_csv(folder / TABLE)
            rows = tuple(
                {key: text if key in TEXTS else _number(text) for key, text in zip(columns, row, strict=True)}
                for row in zip(*columns.values(), strict=True)
            )
        except (OSError, ValueError) as error:
            raise InputError(f"{folder} holds no study: {error}; run asperity study first") from None
        families = tuple(Family(f["name"], f["title"], tuple(f["keys"])) for f in about["families"])
        return StudyResults(folder, about["title"], families, rows)

    def family(self, name: str) -> tuple[Row, ...]:
        """Finished rows of a family.

        Raises:
            InputError: the family does not exist
        """
        if name not in {family.name for family in self.families}:
            raise InputError(f"the study has no family {name!r}; it has {', '.join(f.name for f in self.families)}")
        return tuple(r for r in self.rows if name in str(r["families"]).split() and r["exit_reason"] == "done")

    def levels(self, name: str) -> tuple[StudyLevel, ...]:
        """Finished cases of a family by level, in rising order of the keys, missing values last."""
        keys = next(family.keys for family in self.families if family.name == name)
        rows = self.family(name)
        varied = [k for k in keys if k != ENSEMBLE and len({row[k] for row in rows}) > 1]
        groups: dict[tuple[Any, ...], list[Row]] = {}
        for row in rows:
            groups.setdefault(tuple(row[k] for k in varied), []).append(row)
        ordered = sorted(groups.items(), key=lambda item: [_rank(value) for value in item[0]])
        return tuple(StudyLevel(dict(zip(varied, values, strict=True)), tuple(group)) for values, group in ordered)

    def curve(self, row: Row) -> Curve:
        """Curve of a row."""
        return Curve.read(case_folder(self.folder, str(row["case"])) / CURVE)

    def case(self, row: Row) -> Case:
        """Case of a row, as it was run."""
        return Case.load(case_folder(self.folder, str(row["case"])) / CASE)


def _rank(value: Any) -> tuple[int, float, str]:
    """Sorting key: numbers, then strings, then missing values."""
    if value is None:
        return 2, 0.0, ""
    return (0, value, "") if isinstance(value, float) else (1, 0.0, str(value))


def _number(text: str) -> Any:
    if text == "":
        return None
    try:
        return float(text)
    except ValueError:
        return text
