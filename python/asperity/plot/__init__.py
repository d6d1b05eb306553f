"""Figures of a run, drawn from the files in its folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from asperity.output.results import Results
from asperity.plot.contact import contact_area, flow_maps, pressure_maps
from asperity.plot.curves import conductance, force_curve, indentation, leakage, over_time, stiffness
from asperity.plot.fields import surface_map
from asperity.plot.slip import slip
from asperity.plot.style import save, save_in
from asperity.plot.vibration import frequency, motion, receptance, response
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
    "The amplitude F̂ of the excitation is in units of kₙ zₛ for a force, of zₛ for a motion of the base, of ωₛ² zₛ for "
    "an acceleration of the base; the static load is W."
)
# name of a figure -> caption, in the order of a report
CAPTIONS = {
    "surface": "Heights of the surface; the ring marks the first touch.",
    "curve": "(a) Load over approach with the fitted power law. (b) The same on logarithmic axes. (c) Local "
    "exponent of the loading; a power law has a constant one.",
    "indentation": "(a) Force over depth. (b) Hardness, the force over the projected area of contact.",
    "area": "(a) Contact area over load. (b) Distribution of the contact pressure over the nominal area.",
    "pressure": "Contact pressure on the shaded surface at selected approaches, with force and number of spots. "
    "Last: the spot of the greatest pressure, the blue square, with the facets of the mesh.",
    "stiffness": "(a) Stiffness of the contact during loading. (b) Mean gap.",
    "conductance": "Conductance per nominal area over the nominal pressure.",
    "leakage": "(a) Transmissivity of the gap over the load; a dotted line marks the last load with an open channel. "
    "(b) Mean gap and hydraulic aperture.",
    "flow": "Flow of a film along x through the open gap at selected loads, over its mean. Pale: no flow.",
    "time": "(a) Contact area, (b) load and (c) approach over time.",
    "frequency": "Natural frequency over the amplitude of free vibration about the static "
    f"deflection. {_STATIC} Beyond the dot contact is lost (exact law), or the Taylor law pulls although there is "
    "no contact.",
    "response": f"Forced vibration: largest displacement over the excitation frequency. {_STATIC} {_FORCE} Diamonds "
    "joined by a dotted line mark the onset of contact loss.",
    "receptance": "Frequency response function: amplitude at the forcing frequency over the force. A linear contact "
    f"has one curve for all forces; the peak of each force lies on its backbone. {_STATIC} {_FORCE}",
    "motion": "Motion in time from rest, relative to the base where it moves: displacement, and the force above it. "
    f"Shaded: out of contact. {_STATIC} {_FORCE}",
    "slip": "(a) Loops of the tangential force T over the displacement by slip, u less the displacement T/k without "
    "slip; the stiffness k is that at rest. The normal curve of like bodies gives the loops, whose area is the energy "
    "of a cycle. (b) Loss factor, twice the damping ratio. (c) Amplitude of the force over that of the displacement. "
    "The limit of friction is μP.",
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
    possible = figures_of(results)
    return [draw(results, name) for name in CAPTIONS if name in possible]


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
    """Name and function of each figure for which there are data."""
    rows = len(results.curve)

    def heights(results: Results) -> Figure:
        surface = results.surface
        return surface_map(surface.grid(401), surface.L, surface.maximum(), results.unit("length"))

    wanted: dict[str, tuple[bool, Callable[[Results], Figure]]] = {
        "surface": ("surface" in results.case, heights),
        "pressure": (results.snapshots > 0, pressure_maps),
        "indentation": (rows > 0 and "tool" in results.case, indentation),
        "area": (rows > 0, contact_area),
        "curve": (rows > 0, force_curve),
        "stiffness": (bool(np.any(results.curve.k_n_elastic > 0)), stiffness),
        "leakage": (bool(np.any(results.curve.transmissivity_x + results.curve.transmissivity_y > 0)), leakage),
        "flow": (results.snapshots > 0 and bool(np.any(results.curve.transmissivity_x > 0)), flow_maps),
        "time": (bool(np.any(results.curve.time > 0)), over_time),
        "conductance": (bool(np.any(results.gap_conductance()[1] > 0)), conductance),
        "slip": (len(results.slip_loops.get("u", ())) > 0, slip),
        "frequency": (len(results.free.get("u0", ())) > 0, frequency),
        "response": (len(results.response.get("Omega", ())) > 0, response),
        "receptance": (len(results.response.get("a1", ())) > 0 and "F_hat" in results.response, receptance),
        "motion": (len(results.motion.get("tau", ())) > 0, motion),
    }
    return {name: make for name, (possible, make) in wanted.items() if possible}
