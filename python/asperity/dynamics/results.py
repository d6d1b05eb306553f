"""Results of a vibration analysis, and the files free.csv, response.csv, band.csv, thresholds.json."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

from asperity.dynamics.free import FreeVibration
from asperity.dynamics.intervals import BAND_COLUMNS, Band, Uncertainty
from asperity.dynamics.joint import Numbers
from asperity.dynamics.laws import LawTable
from asperity.dynamics.oscillator import ContactOscillator
from asperity.dynamics.response import FrequencyResponse
from asperity.dynamics.settings import DynamicsSettings
from asperity.dynamics.sweep import Sweep
from asperity.dynamics.thresholds import Thresholds
from asperity.runtime.display import short_repr
from asperity.runtime.files import replace_file, write_csv
from asperity.runtime.run_folder import BAND, FREE, RESPONSE, THRESHOLDS

FREE_COLUMNS = ("model", "u0", "omega_ratio", "u_min", "frequency", "amplitude", "a1")
RESPONSE_COLUMNS = (
    "model", "F_hat", "zeta", "Omega", "u_max", "u_min", "a1", "stable", "branch", "contact_loss",
    "frequency", "force", "x_max", "x_min", "receptance", "phase",
)  # fmt: skip


def numbers_of(oscillator: ContactOscillator, bar: float = math.nan, given: bool = False) -> Numbers:
    """Numbers of the small vibration of an oscillator; `bar` and `given` as in `Numbers`."""
    r, frequency = oscillator.restoring, oscillator.omega_s / (2 * math.pi)
    return Numbers(r.scale / r.z_s, oscillator.mass, frequency, r.z_s, oscillator.zeta, bar, given)


@dataclass(frozen=True)
class Dynamics:
    """Results of `run_dynamics` for one law; the keys of mappings are models ("exact", "taylor").

    Attributes:
        oscillators: the oscillators
        free: natural frequency over amplitude
        responses: one per forcing
        sweeps: one per forcing and direction (empty if not requested)
        thresholds: onsets and resonance peaks
        uncertainty: intervals by the error bar, the spread of the laws and the points of the law, or by the misfit of
            the fit of a given law; None if there is none of these
        bands: bands of the exact response by the same, one per forcing, if requested
        notes: limits and assumptions of the results, one sentence each
        gravity: gravitational acceleration for mass and omega_s (length/time^2), None if unknown or if the joint has a
            mass
        laws: all laws of the curve at the preload; None for a given `Law`
        settings: what was computed
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
    laws: LawTable | None = None
    settings: DynamicsSettings = field(default_factory=DynamicsSettings)

    @property
    def first(self) -> ContactOscillator:
        """Oscillator of the first model; both have the same preload, mass and small vibration."""
        return next(iter(self.oscillators.values()))

    @property
    def numbers(self) -> Numbers:
        """Stiffness and frequency with their bar, mass, static approach and damping of small vibration."""
        known, joint = None if self.uncertainty is None else self.uncertainty.k_n, self.settings.joint
        bar = math.nan if known is None else known.half / known.value
        return numbers_of(self.first, bar, joint is not None and joint.frequency is not None)

    __repr__ = short_repr

    def write(self, out_dir: str | os.PathLike[str]) -> None:
        """Write free.csv, response.csv and thresholds.json into `out_dir`; band.csv if there is a band."""
        path = Path(out_dir)
        path.mkdir(parents=True, exist_ok=True)
        z_s, scale, unit = self.first.restoring.z_s, self.first.restoring.scale, self.numbers.frequency
        free = (
            row | {"frequency": unit * row["omega_ratio"], "amplitude": z_s * row["u0"]}
            for one in self.free.values()
            for row in one.rows()
        )
        results: list[FrequencyResponse | Sweep] = [*chain(*self.responses.values()), *chain(*self.sweeps.values())]
        forced = (
            row
            | {"frequency": unit * row["Omega"], "force": scale * row["F_hat"]}
            | {"x_max": z_s * row["u_max"], "x_min": z_s * row["u_min"]}
            | {"receptance": z_s * row["a1"] / (scale * row["F_hat"])}
            for one in results
            for row in one.rows()
        )
        _write(path / FREE, FREE_COLUMNS, free)
        _write(path / RESPONSE, RESPONSE_COLUMNS, forced)
        (path / BAND).unlink(missing_ok=True)  # of an earlier analysis
        if self.bands:
            _write(path / BAND, BAND_COLUMNS, (row for band in self.bands for row in band.rows()))
        text = json.dumps(self.to_dict(), indent=2, allow_nan=False)
        replace_file(path / THRESHOLDS, f"{text}\n".encode())

    def to_dict(self) -> dict[str, Any]:
        """Content of thresholds.json."""
        first, numbers, joint = self.first, self.numbers.to_dict(), self.settings.joint
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
            "uncertainty": self.uncertainty.to_dict() if self.uncertainty else None,
            "notes": list(self.notes),
            "units": self.settings.units,
            "numbers": numbers,
            "joint": None if joint is None else {k: v for k, v in asdict(joint).items() if v is not None},
            "laws": None if self.laws is None else self.laws.to_dict(),
        }
        for model, values in self.thresholds.items():
            out[model] = {
                **values.to_dict(),
                "free_tolerance": self.free[model].tolerance,
                "free_valid": all(self.free[model].valid),
                "responses": [r.to_dict() for r in self.responses[model]],
                "sweeps": [s.to_dict() for s in self.sweeps.get(model, ())],
            }
        return out


def _write(path: Path, names: tuple[str, ...], rows: Iterable[dict[str, Any]]) -> None:
    def cell(value: Any) -> Any:
        if isinstance(value, bool):
            return str(value).lower()
        return None if value != value else value

    write_csv(path, names, ({name: cell(value) for name, value in row.items()} for row in rows))
