"""Three-dimensional picture of the loaded block by PyVista, off screen."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from asperity.errors import CompatError, InputError
from asperity.mesh.element import LINEAR_TETS, VTK_TYPE
from asperity.output.results import Results
from asperity.runtime.files import files_into
from asperity.runtime.run_folder import FIELDS, FIGURES, VTKHDF, locking
from asperity.units import prefix, quantity

SIZE = (2400, 1060)  # pixels
DEPTH = 0.35  # share of the height that is shown
RELIEF = 0.12  # range of the heights as shown [L]
HIGH = 0.8  # stress at which a block may be cut open, over that which a thousandth of it exceeds
FIELD_FILE = f"{FIELDS}/{VTKHDF}"
ABOVE = 1e-4  # of the triangles under pressure above the surface that they lie on [L]


@locking
def scene(folder: str | Path, path: str | Path | None = None) -> Path:
    """Draw the block at its last saved step: stress inside, with a quarter cut away, and contact pressure.

    Args:
        folder: of a run with `output.fields = true`
        path: of the picture; default figures/scene.png in the folder

    Raises:
        InputError: the run contains no fields
        CompatError: PyVista is not installed
    """
    if importlib.util.find_spec("pyvista") is None:
        raise CompatError(
            "a picture in three dimensions needs PyVista: pip install pyvista, here ./run pip install pyvista"
        )
    results = Results.read(folder)
    source = results.folder / FIELD_FILE
    if not source.is_file():
        raise InputError(f"{source} is missing: a picture in three dimensions needs a run with output.fields = true")
    if not os.environ.get("DISPLAY"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import pyvista as pv

    grid = results.to_pyvista()
    stress = np.asarray(grid.cell_data["von Mises stress"])
    pressure = np.asarray(grid.point_data["pressure"])
    scale, unit = prefix(float(pressure.max()) or float(stress.max()), results.unit("stress"))
    block = _linear(grid, stress * scale)
    factor = _stretch(block, results.top)
    # a small region of high stress must not determine the colour scale
    highest = float(np.quantile(stress, 0.999)) * scale
    plotter = pv.Plotter(off_screen=True, shape=(1, 2), window_size=list(SIZE), border=False)
    plotter.subplot(0, 0)
    smooth = _open(block).cell_data_to_point_data()  # the mean of the cells around each node
    plotter.add_mesh(smooth, scalars="stress shown", cmap="cividis", ambient=0.2, n_colors=256,
                     **_scale("von Mises stress", unit, highest))  # fmt: skip
    _view(plotter, block)
    plotter.subplot(0, 1)
    plotter.add_mesh(_cut(block).extract_surface(algorithm="dataset_surface"), color="#B8B8B8", ambient=0.2)
    colours = _scale("contact pressure", unit, float(pressure.max()) * scale)
    plotter.add_mesh(_touched(results.top, block, scale, factor), scalars="pressure shown", cmap="inferno_r",
                     n_colors=256, ambient=0.2, **colours)  # fmt: skip
    _view(plotter, block)
    side = quantity(float(np.ptp(results.top["points"][:, 0])), results.unit("length"), 3)
    peak = quantity(float(pressure.max()), results.unit("stress"), 3)
    plotter.add_text(f"side {side}, heights {factor:.2g} times enlarged, greatest pressure {peak}", "upper_right",
                     font_size=16, color="black")  # fmt: skip
    target = Path(path) if path is not None else results.folder / FIGURES / "scene.png"
    target.parent.mkdir(exist_ok=True)
    with files_into(target.parent) as aside:
        plotter.screenshot(aside / target.name)
    plotter.close()
    return target


def _linear(grid: Any, stress: Any) -> Any:
    """Deformed block as linear tetrahedra through all nodes, which can be clipped."""
    import pyvista as pv

    tets = grid.cells_dict[VTK_TYPE]
    cells = tets[:, np.array(LINEAR_TETS)].reshape(-1, 4)
    block = pv.UnstructuredGrid({pv.CellType.TETRA: cells}, grid.points + grid.point_data["displacement"])
    block.cell_data["stress shown"] = np.repeat(stress, len(LINEAR_TETS))
    return block


def _stretch(block: Any, top: Any) -> float:
    """Enlarge the heights of the deformed top, less so below it, until they can be seen; return the factor."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    side = float(np.ptp(top["points"][:, 0]))
    xy, heights = top["points"] / side, -top["gap"][-1] / side
    factor = max(RELIEF / (float(np.ptp(heights)) or RELIEF), 1.0)
    at = np.clip(block.points[:, :2], 0.0, 1.0)
    relief = LinearNDInterpolator(xy, heights - heights.max())(at)
    lost = np.isnan(relief)
    relief[lost] = NearestNDInterpolator(xy, heights - heights.max())(at[lost])
    z = block.points[:, 2]
    block.points[:, 2] = z + (factor - 1.0) * relief * np.clip(z / z.max(), 0.0, 1.0) ** 4  # little in the depth
    return factor


def _touched(top: Any, block: Any, scale: float, factor: float) -> Any:
    """Triangles of the top under pressure in the last snapshot, with heights enlarged by a factor."""
    import pyvista as pv

    xyz = np.column_stack([top["points"], -top["gap"][-1]]) / np.ptp(top["points"][:, 0])
    xyz[:, 2] = factor * (xyz[:, 2] - xyz[:, 2].max()) + block.bounds[5] + ABOVE
    pressure, triangles = top["pressure"][-1], top["triangles"]
    out = pv.PolyData.from_regular_faces(xyz, triangles[(pressure[triangles] > 0.0).all(axis=1)])
    out.point_data["pressure shown"] = scale * pressure
    return out


def _cut(block: Any) -> Any:
    """Upper part of the block."""
    x0, x1, y0, y1, z0, z1 = block.bounds
    return block.clip_box((x0 - 1, x1 + 1, y0 - 1, y1 + 1, z0 - 1, z1 - DEPTH * (z1 - z0)), invert=True)


def _open(block: Any) -> Any:
    """Upper part of the block without the quarter in front of a highly stressed point: of those inside the foremost."""
    x0, x1, y0, y1, z0, z1 = block.bounds
    low, high = (
        (1 - s) * np.array([x0, y0]) + s * np.array([x1, y1]) for s in (0.2, 0.8)
    )  # nearer a side shows nothing
    centres, stress = block.cell_centers().points[:, :2], block.cell_data["stress shown"]
    inside = np.all((centres > low) & (centres < high), axis=1) & (stress > HIGH * np.quantile(stress, 0.999))
    at = np.argmax(np.where(inside, centres @ [1.0, -1.0], -np.inf) if inside.any() else stress)
    x, y = np.clip(centres[at], low, high).tolist()
    return _cut(block).clip_box((x, x1 + 1, y0 - 1, y, z0 - 1, z1 + 1), invert=True)


def _scale(name: str, unit: str, highest: float) -> dict[str, Any]:
    """Limits and bar of the colours: from zero to the round number above the highest value, labels at round numbers."""
    ticks = MaxNLocator(5).tick_values(0.0, highest if highest > 0.0 else 1.0)
    bar = {"title": f"{name} ({unit})\n" if unit else f"{name}\n", "title_font_size": 38, "label_font_size": 34,
           "color": "black", "fmt": "%.3g", "width": 0.6, "height": 0.07, "position_x": 0.2, "position_y": 0.03,
           "n_labels": len(ticks)}  # fmt: skip
    return {"clim": (0.0, ticks[-1]), "scalar_bar_args": bar}


def _view(plotter: Any, block: Any) -> None:
    plotter.set_background("white")
    x0, x1, y0, y1, z0, z1 = block.bounds
    middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2, z1 - 1.25 * DEPTH * (z1 - z0)])
    away = 2.65 * np.array([0.6, -0.6, 0.65]) * max(x1 - x0, DEPTH * (z1 - z0))
    plotter.camera_position = [tuple(middle + away), tuple(middle), (0, 0, 1)]
