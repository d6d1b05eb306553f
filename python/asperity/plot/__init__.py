"""Figures of a run, from the files in its folder; each function returns a matplotlib Figure."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from asperity.output.results import Results
from asperity.plot.curves import force_curve, plasticity
from asperity.plot.fields import contact_area, mesh_cut, pressure_maps, surface_map
from asperity.plot.style import save
from asperity.plot.vibration import frequency, response

__all__ = [
    "CAPTIONS",
    "contact_area",
    "force_curve",
    "frequency",
    "mesh_cut",
    "plasticity",
    "plot_run",
    "pressure_maps",
    "response",
    "save",
    "surface_map",
]


# name of a picture -> what it shows, in the order of a report
CAPTIONS = {
    "surface": "Heights of the surface; the ring marks the first touch.",
    "mesh": "Vertical section of the mesh through the highest point, and the same at the summit; "
    "colour is the element size.",
    "curve": "Load against deflection with the fitted power law, on linear and logarithmic axes.",
    "area": "(a) Regions in contact at rising deflection. (b) Contact area against load.",
    "pressure": "Contact pressure at chosen deflections; grey is out of contact.",
    "plasticity": "(a) Yielded share of the volume. (b) Greatest equivalent plastic strain.",
    "frequency": "Natural frequency against the amplitude of free vibration about the static "
    "deflection; beyond the dot the motion leaves contact (exact law) or the Taylor expansion "
    "pulls where there is no contact.",
    "response": "Forced vibration: greatest deflection against the frequency of excitation; beyond the "
    "dotted line the motion loses contact.",
}


def plot_run(folder: str | Path) -> list[Path]:
    """Draw every figure that the files of a run allow, into its folder figures/.

    Args:
        folder: the run directory.

    Returns:
        The pictures written.

    Raises:
        InputError: the folder holds no run.
    """
    results = Results.read(folder)
    target = results.folder / "figures"
    target.mkdir(exist_ok=True)
    return [save(draw(results), target / f"{name}.png") for name, draw in _figures(results).items()]


def _figures(results: Results) -> dict[str, Callable[[Results], Figure]]:
    """Name and function of each figure there are data for."""
    rows = len(results.curve)
    plastic = np.any(results.curve.max_plastic_strain > 0)
    wanted: dict[str, tuple[bool, Callable[[Results], Figure]]] = {
        "surface": (results.surface is not None, _surface),
        "mesh": (bool(results.mesh), mesh_cut),
        "pressure": (results.snapshots > 0, pressure_maps),
        "area": (rows > 0, contact_area),
        "curve": (rows > 0, force_curve),
        "plasticity": (bool(plastic), plasticity),
        "frequency": (len(results.free.get("u0", ())) > 0, frequency),
        "response": (len(results.response.get("Omega", ())) > 0, response),
    }
    return {name: draw for name, (possible, draw) in wanted.items() if possible}


def _surface(results: Results) -> Figure:
    surface = results.surface
    return surface_map(surface.grid(401), surface.L, surface.maximum(), results.unit("length"))
