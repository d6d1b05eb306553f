"""Results of a vibration analysis, and the files free.csv, response.csv, band.csv and thresholds.json."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from asperity.dynamics.motion.sweep import Sweep
from asperity.dynamics.orbits.free import FreeVibration
from asperity.dynamics.orbits.response import FrequencyResponse
from asperity.dynamics.orbits.thresholds import Thresholds
from asperity.dynamics.oscillator import ContactOscillator
from asperity.dynamics.uncertainty import BAND_COLUMNS, Band, Uncertainty
from asperity.runtime.display import short_repr
from asperity.runtime.files import replace_file
from asperity.runtime.run_folder import BAND, FREE, RESPONSE, THRESHOLDS

FREE_COLUMNS = ("model", "u0", "omega_ratio", "u_min")
RESPONSE_COLUMNS = ("model", "F_hat", "zeta", "Omega", "u_max", "u_min", "a1", "stable", "branch", "contact_loss")


@dataclass(frozen=True)
class Dynamics:
    """Results of `run_dynamics` for one law; the keys of mappings are models ("exact", "taylor").

    Attributes:
        oscillators: the oscillators.
        free: natural frequency over amplitude.
        responses: one per forcing.
        sweeps: one per forcing and direction (empty if not requested).
        thresholds: onsets and resonance peaks.
        uncertainty: confidence intervals that follow from those of the law, None if the law has none.
        bands: confidence bands of the exact response, one per forcing, if requested and the law has intervals.
        notes: limits and assumptions of the results, one sentence each.
        gravity: gravitational acceleration for mass and omega_s (length/time^2), None if unknown.

    Examples:
        >>> result = asp.run_dynamics(asp.PowerLaw(1.5), models=["exact"], omega=(0.9, 1.1), tol=1e-3, sweeps=False)
        >>> result.write("out")
        >>> sorted(os.listdir("out"))
        ['free.csv', 'response.csv', 'thresholds.json']
    """

    oscillators: dict[str, ContactOscillator]
    free: dict[str, FreeVibration]
    responses: dict[str, tuple[FrequencyResponse, ...]]
    sweeps: dict[str, tuple[Sweep, ...]]
    thresholds: dict[str, Thresholds]
    uncertainty: Uncertainty | None
    bands: tuple[Band, ...]
    notes: tuple[str, ...]
    gravity: float | None = None

    __repr__ = short_repr

    def write(self, out_dir: str | os.PathLike[str]) -> None:
        """Write free.csv, response.csv and thresholds.json, and band.csv if there are bands, into `out_dir`."""
        path = Path(out_dir)
        path.mkdir(parents=True, exist_ok=True)
        _write(path / FREE, FREE_COLUMNS, (row for f in self.free.values() for row in f.rows()))
        results = [r for group in (self.responses, self.sweeps) for many in group.values() for r in many]
        _write(path / RESPONSE, RESPONSE_COLUMNS, (row for r in results for row in r.rows()))
        if self.bands:
            _write(path / BAND, BAND_COLUMNS, (row for band in self.bands for row in band.rows()))
        else:
            (path / BAND).unlink(missing_ok=True)  # of an earlier analysis
        text = json.dumps(self.to_dict(), indent=2, allow_nan=False)
        replace_file(path / THRESHOLDS, f"{text}\n".encode())

    def to_dict(self) -> dict[str, Any]:
        """Return the content of thresholds.json."""
        first = next(iter(self.oscillators.values()))
        out: dict[str, Any] = {
            "normalisation": "u = (z - z_s)/z_s, Omega = omega/omega_s, F_hat = F/(n_loc m g)",
            "law": first.law.describe(),
            "load": first.restoring.load,
            "z_s": first.restoring.z_s,
            "gravity": self.gravity,
            "mass": None if self.gravity is None else first.mass,
            "omega_s": None if self.gravity is None else first.omega_s,
            "n_loc": first.restoring.n_loc,
            "kappa": first.restoring.kappa,
            "zeta": first.zeta,
            "damping": first.damping,
            "uncertainty": self.uncertainty.to_dict() if self.uncertainty else None,
            "notes": list(self.notes),
        }
        for model, values in self.thresholds.items():
            out[model] = {
                **values.to_dict(),
                "free_tolerance": self.free[model].tolerance,
                "free_valid": all(self.free[model].valid),
                "responses": [_summary(r) for r in self.responses[model]],
                "sweeps": [_sweep_summary(s) for s in self.sweeps.get(model, ())],
            }
        return out


def _summary(r: FrequencyResponse) -> dict[str, Any]:
    omega, top = r.peak
    return {
        "F_hat": r.setting.F_hat,
        "F_over_mg": r.setting.F_over_mg,
        "peak": {"Omega": omega, "u_max": top},
        "events": [
            {"kind": e.kind, "branch": r.branches[e.branch].kind, "Omega": e.Omega, "u_max": e.u_max, "u_min": e.u_min}
            for e in r.events
        ],
        "tolerance": r.tolerance,
        "determinant_error": r.det_error,
        "valid": r.valid,
        "notes": list(r.notes),
    }


def _sweep_summary(s: Sweep) -> dict[str, Any]:
    return {
        "F_hat": s.setting.F_hat,
        "direction": s.direction,
        "valid": bool(s.valid.all()),
        "status": {name: s.status.count(name) for name in dict.fromkeys(s.status)},
    }


def _write(path: Path, names: tuple[str, ...], rows: Iterable[dict[str, Any]]) -> None:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow(
            {
                k: repr(v) if isinstance(v, float) else str(v).lower() if isinstance(v, bool) else v
                for k, v in row.items()
            }
        )
    replace_file(path, text.getvalue().encode())
