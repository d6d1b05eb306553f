"""Results of a vibration analysis and their files."""

from __future__ import annotations

import json
import math
import os
from dataclasses import asdict, dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.runtime import run_folder
from asperity.runtime.display import short_repr
from asperity.runtime.files import replace_file, write_csv
from asperity.vibration.free import FreeVibration, Thresholds
from asperity.vibration.motion import Trajectory
from asperity.vibration.numbers import Numbers
from asperity.vibration.oscillator import ContactOscillator
from asperity.vibration.response import FrequencyResponse
from asperity.vibration.settings import DynamicsSettings
from asperity.vibration.source import Choice


@dataclass(frozen=True)
class Dynamics:
    """Results of `run_dynamics` for one law; the keys of mappings are models ("exact", "taylor").

    Attributes:
        oscillators, free, thresholds: see there
        responses: one per damping ratio and forcing
        bars: of the peak and of each fold of each response of the exact law: frequency over omega_s, and u (1 + folds,
            2), NaN where nothing bounds the law; empty for a law without an error
        numbers: stiffness and frequency, mass, static approach and damping of small vibration, with bars
        motions: short motions from rest, by the course of the force
        notes: limits and assumptions of the results, one sentence each
        gravity: for mass and omega_s (length/time^2), None if unknown or if the joint has a mass
        choice: which law of the curve it is; None for a given `Law`
        settings: what was computed
    """

    oscillators: dict[str, ContactOscillator]
    free: dict[str, FreeVibration]
    responses: dict[str, tuple[FrequencyResponse, ...]]
    thresholds: dict[str, Thresholds]
    numbers: Numbers
    notes: tuple[str, ...]
    bars: tuple[Array, ...] = ()
    motions: dict[str, Trajectory] = field(default_factory=dict)
    gravity: float | None = None
    choice: Choice | None = None
    settings: DynamicsSettings = field(default_factory=DynamicsSettings)

    @property
    def first(self) -> ContactOscillator:
        """Oscillator of the first model."""
        return next(iter(self.oscillators.values()))

    __repr__ = short_repr

    def write(self, out_dir: str | os.PathLike[str]) -> None:
        """Write free.csv, response.csv and thresholds.json into `out_dir`; motion.csv if there is any."""
        path = Path(out_dir)
        path.mkdir(parents=True, exist_ok=True)
        z_s, scale, unit = self.first.restoring.z_s, self.first.restoring.scale, self.numbers.frequency
        results = list(chain(*self.responses.values()))
        tables: dict[str, list[dict[str, Any]]] = {
            run_folder.FREE: [
                row | {"frequency": unit * row["omega_ratio"], "amplitude": z_s * row["u0"]}
                for one in self.free.values()
                for row in one.rows()
            ],
            run_folder.RESPONSE: [
                row
                | {"frequency": unit * row["Omega"], "force": force}
                | {"x_max": z_s * row["u_max"], "x_min": z_s * row["u_min"], "receptance": z_s * row["a1"] / force}
                for one in results
                for row in one.rows()
                for force in [scale * one.setting.forcing(row["Omega"])]
            ],
            run_folder.MOTION: self.moved(),
        }
        for name, rows in tables.items():
            if rows:
                write_csv(path / name, list(rows[0]), map(_cells, rows))
            else:  # of an earlier analysis
                (path / name).unlink(missing_ok=True)
        text = json.dumps(self.to_dict(), indent=2, allow_nan=False)
        replace_file(path / run_folder.THRESHOLDS, f"{text}\n".encode())

    def moved(self) -> list[dict[str, Any]]:
        """Rows of motion.csv."""
        r, second = self.first.restoring, 1.0 / self.first.omega_s
        return [
            {"shape": shape, "tau": tau, "u": u, "v": v, "F_hat": f}
            | {"time": second * tau, "x": r.z_s * u, "force": r.scale * f}
            for shape, path in self.motions.items()
            for tau, u, v, f in zip(path.tau, path.u, path.v, path.force, strict=True)
        ]

    def jumps(self) -> list[dict[str, Any]]:
        """Where slow sweeps leave a stable branch: frequency (1/time), force, amplitudes before and after (length)."""
        r, hertz = self.first.restoring, self.numbers.frequency
        return [
            {
                "model": model, "zeta": one.setting.zeta, "F_hat": one.setting.F_hat,
                "force": r.scale * float(one.setting.forcing(jump.Omega)),
                "sweep": jump.direction, "Omega": jump.Omega,
                "frequency": hertz * jump.Omega if math.isfinite(hertz) else None, "x_max": r.z_s * jump.u_max,
                "x_max_after": None if jump.after is None else r.z_s * jump.after, "note": jump.note,
            }
            for model, responses in self.responses.items() for one in responses for jump in one.jumps
        ]  # fmt: skip

    def peaks(self) -> list[dict[str, Any]]:
        """Peak of each response and its folds, with bars where the law has an error: frequency over omega_s, and u."""
        found = []
        for model, responses in self.responses.items():
            for i, one in enumerate(responses):
                places = [("peak", *one.peak), *(("fold", e.Omega, e.u_max) for e in one["fold"])]
                bars = self.bars[i] if model == "exact" and self.bars else np.full((len(places), 2), np.nan)
                for (kind, omega, u), bar in zip(places, bars, strict=True):
                    known = [float(x) if np.isfinite(x) else None for x in bar]
                    found.append({
                        "model": model, "zeta": one.setting.zeta, "F_hat": one.setting.F_hat, "kind": kind,
                        "Omega": omega, "Omega_bar": known[0], "u_max": u, "u_max_bar": known[1],
                    })  # fmt: skip
        return found

    def to_dict(self) -> dict[str, Any]:
        """Content of thresholds.json."""
        first, numbers, joint = self.first, self.numbers.to_dict(), self.settings.joint
        laws, choice = None, self.choice
        if choice is not None:
            laws = {
                "chosen": choice.name, "reason": choice.reason, "doubt": choice.note, "yielded": choice.yielded,
                "rows": choice.done,
            }  # fmt: skip
        out: dict[str, Any] = {
            "normalisation": "u = (z - z_s)/z_s, Omega = omega/omega_s, F_hat = F/(n_loc W), W = load",
            "law": first.law.describe(),
            "load": first.restoring.load,
            "z_s": first.restoring.z_s,
            "gravity": self.gravity,
            "mass": numbers["m"],
            "omega_s": None if numbers["m"] is None else first.omega_s,
            "n_loc": first.restoring.n_loc,
            "kappa": first.restoring.kappa,
            "zeta": first.zeta,
            "damping": str(first.damping),
            "excitation": self.settings.excitation,
            "notes": list(self.notes),
            "units": self.settings.units,
            "numbers": numbers,
            "joint": None if joint is None else {k: v for k, v in asdict(joint).items() if v is not None},
            "laws": laws,
            "jumps": self.jumps(),
            "peaks": self.peaks(),
        }
        for model, values in self.thresholds.items():
            out[model] = {
                **values.to_dict(),
                "free_tolerance": self.free[model].tolerance,
                "free_valid": all(self.free[model].valid),
                "responses": [r.to_dict() for r in self.responses[model]],
            }
        return out


def _cells(row: dict[str, Any]) -> dict[str, Any]:
    """Cells of a row of a file, without those of NaN; seven digits are more than the rows have."""
    known = {name: value for name, value in row.items() if value == value}
    for name, value in known.items():
        if isinstance(value, bool):
            known[name] = str(value).lower()
        elif isinstance(value, float | np.floating):
            known[name] = float(f"{value:.7g}")
    return known
