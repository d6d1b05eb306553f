"""Figures of a run, drawn from the files in its folder."""

from __future__ import annotations

from collections.abc import Callable
from inspect import getdoc
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity.output.results import Results
from asperity.plot.contact import contact_area, flow_maps, pressure_maps, surface_map
from asperity.plot.curves import conductance, force_curve, indentation, leakage, over_time, stiffness
from asperity.plot.style import save, save_in
from asperity.plot.vibration import frequency, motion, receptance, response, slip
from asperity.runtime.run_folder import FIGURES, refuse_links

__all__ = [
    "CAPTIONS", "conductance", "contact_area", "flow_maps", "force_curve", "frequency", "indentation", "leakage",
    "motion", "over_time", "plot_dynamics", "plot_run", "pressure_maps", "receptance", "response", "save", "slip",
    "stiffness", "surface_map",
]  # fmt: skip


_STATIC = (
    "The displacement u is in units of the static approach zₛ; small vibration has the frequency ωₛ and stiffness kₙ."
)
_FORCE = (
    f"{_STATIC} The amplitude F̂ of the excitation is in units of kₙ zₛ for a force, of zₛ for a motion of the base, of "
    "ωₛ² zₛ for an acceleration of the base; the static load is W."
)


def _surface(run: Results) -> Figure:
    """Heights of the surface; the ring marks the first touch."""
    return surface_map(run.surface, run.unit("length"))


#: Name of a figure -> its function, whether a run has data for it, and the units of its caption; in the order of a
#: report.
KINDS: dict[str, tuple[Callable[[Results], Figure], Callable[[Results], Any], str]] = {
    "surface": (_surface, lambda run: "surface" in run.case, ""),
    "curve": (force_curve, lambda run: len(run.curve), ""),
    "indentation": (indentation, lambda run: len(run.curve) and "tool" in run.case, ""),
    "area": (contact_area, lambda run: len(run.curve), ""),
    "pressure": (pressure_maps, lambda run: run.snapshots, ""),
    "stiffness": (stiffness, lambda run: np.any(run.curve.k_n_elastic > 0), ""),
    "conductance": (conductance, lambda run: np.any(run.gap_conductance()[1] > 0), ""),
    "leakage": (leakage, lambda run: np.any(run.curve.transmissivity_x + run.curve.transmissivity_y > 0), ""),
    "flow": (flow_maps, lambda run: run.snapshots and np.any(run.curve.transmissivity_x > 0), ""),
    "time": (over_time, lambda run: np.any(run.curve.time > 0), ""),
    "frequency": (frequency, lambda run: len(run.free.get("u0", ())), _STATIC),
    "response": (response, lambda run: len(run.response.get("Omega", ())), _FORCE),
    "receptance": (receptance, lambda run: len(run.response.get("a1", ())) and "F_hat" in run.response, _FORCE),
    "motion": (motion, lambda run: len(run.motion.get("tau", ())), _FORCE),
    "slip": (slip, lambda run: len(run.slip_loops.get("u", ())), ""),
}
#: The caption of a figure is the beginning of what its function says.
CAPTIONS = {
    name: " ".join(f"{getdoc(make)}".partition("\n\n")[0].split() + units.split())
    for name, (make, _, units) in KINDS.items()
}


def plot_run(folder: str | Path) -> list[Path]:
    """Draw the figures that the files of a run allow, into its folder figures/, and return the files.

    Those that consist of lines are SVG files, the others PNG files.

    Args:
        folder: of the run

    Raises:
        InputError: the folder contains no run
    """
    results = Results.read(folder)
    refuse_links(results.folder)
    return [draw(results, name) for name in figures_of(results)]


def draw(results: Results, name: str) -> Path:
    """Draw one of the figures that the files of a run allow into its folder figures/, and return the file."""
    target = results.folder / FIGURES
    target.mkdir(exist_ok=True)
    try:
        return save_in(target, name, figures_of(results)[name](results))
    except Exception as error:
        error.add_note(f"the figure {name}")
        raise


def plot_dynamics(folder: str | Path) -> list[Path]:
    """Draw the figures of the tables that `run_dynamics` has left in a folder beside them, and return the files."""
    results = Results.read(folder, parts=("free", "response", "motion", "thresholds"))
    return [save_in(Path(folder), name, make(results)) for name, make in figures_of(results).items()]


def figures_of(results: Results) -> dict[str, Callable[[Results], Figure]]:
    """Name and function of each figure for which there are data, in the order of a report."""
    return {name: make for name, (make, possible, _) in KINDS.items() if possible(results)}
