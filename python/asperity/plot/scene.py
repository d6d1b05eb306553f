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

    grid, top = results.to_pyvista(), results.top
    stress, pressure = grid.cell_data["von Mises stress"], grid.point_data["pressure"]
    scale, unit = prefix(float(pressure.max()) or float(stress.max()), results.unit("stress"))
    block, factor = _with_relief(grid, top)
    x0, x1, y0, y1, z0, z1 = block.bounds
    upper = block.clip_box((x0 - 1, x1 + 1, y0 - 1, y1 + 1, z0 - 1, z1 - DEPTH * (z1 - z0)), invert=True)
    plotter = pv.Plotter(off_screen=True, shape=(1, 2), window_size=list(SIZE), border=False)
    middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2, z1 - 1.25 * DEPTH * (z1 - z0)])
    away = 2.65 * np.array([0.6, -0.6, 0.65]) * max(x1 - x0, DEPTH * (z1 - z0))

    def show(column: int, mesh: Any, colours: str, values: Any, name: str, highest: float) -> None:
        """Draw a mesh; its colours go from zero to the round number above the highest value."""
        ticks = MaxNLocator(5).tick_values(0.0, scale * highest if highest > 0.0 else 1.0)
        bar = {"title": f"{name} ({unit})\n" if unit else f"{name}\n", "title_font_size": 38, "label_font_size": 34,
               "color": "black", "fmt": "%.3g", "width": 0.6, "height": 0.07, "position_x": 0.2, "position_y": 0.03,
               "n_labels": len(ticks)}  # fmt: skip
        plotter.subplot(0, column)
        plotter.add_mesh(mesh, scalars=scale * values, cmap=colours, ambient=0.2, n_colors=256,
                         clim=(0.0, ticks[-1]), scalar_bar_args=bar)  # fmt: skip
        plotter.set_background("white")
        plotter.camera_position = [tuple(middle + away), tuple(middle), (0, 0, 1)]

    # the mean of the cells around each node; a small region of high stress must not determine the colours
    opened = _open(block, upper).cell_data_to_point_data()
    show(0, opened, "cividis", opened["stress"], "von Mises stress", float(np.quantile(stress, 0.999)))
    # triangles under pressure in the last snapshot
    xyz = np.column_stack([top["points"], -top["gap"][-1]]) / np.ptp(top["points"][:, 0])
    xyz[:, 2] = factor * (xyz[:, 2] - xyz[:, 2].max()) + z1 + ABOVE
    loaded = top["triangles"][(top["pressure"][-1][top["triangles"]] > 0.0).all(axis=1)]
    touched = pv.PolyData.from_regular_faces(xyz, loaded)
    show(1, touched, "inferno_r", top["pressure"][-1], "contact pressure", float(pressure.max()))
    plotter.add_mesh(upper.extract_surface(algorithm="dataset_surface"), color="#B8B8B8", ambient=0.2)
    side = quantity(float(np.ptp(top["points"][:, 0])), results.unit("length"), 3)
    peak = quantity(float(pressure.max()), results.unit("stress"), 3)
    text = f"side {side}, heights {factor:.2g} times enlarged, greatest pressure {peak}"
    plotter.add_text(text, position="upper_right", font_size=16, color="black")
    target = Path(path) if path is not None else results.folder / FIGURES / "scene.png"
    target.parent.mkdir(exist_ok=True)
    with files_into(target.parent) as aside:
        plotter.screenshot(aside / target.name)
    plotter.close()
    return target


def _with_relief(grid: Any, top: Any) -> tuple[Any, float]:
    """Deformed block as linear tetrahedra through all nodes, which can be clipped, its heights enlarged; the factor.

    Below the top the heights are enlarged less, and little in the depth.
    """
    import pyvista as pv
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    cells = grid.cells_dict[VTK_TYPE][:, np.array(LINEAR_TETS)].reshape(-1, 4)
    points = grid.points + grid.point_data["displacement"]
    side = float(np.ptp(top["points"][:, 0]))
    xy, heights = top["points"] / side, -top["gap"][-1] / side
    factor = max(RELIEF / (float(np.ptp(heights)) or RELIEF), 1.0)
    at, below = np.clip(points[:, :2], 0.0, 1.0), heights - heights.max()
    relief = LinearNDInterpolator(xy, below)(at)
    relief = np.where(np.isnan(relief), NearestNDInterpolator(xy, below)(at), relief)
    z = points[:, 2]
    points[:, 2] = z + (factor - 1.0) * relief * np.clip(z / z.max(), 0.0, 1.0) ** 4
    block = pv.UnstructuredGrid({pv.CellType.TETRA: cells}, points)
    block.cell_data["stress"] = np.repeat(grid.cell_data["von Mises stress"], len(LINEAR_TETS))
    return block, factor


def _open(block: Any, upper: Any) -> Any:
    """Upper part of a block without the quarter in front of a highly stressed point: of those inside the foremost."""
    x0, x1, y0, y1, z0, z1 = block.bounds
    sides = np.array([(x0, y0), (x1, y1)])
    low, high = 0.8 * sides + 0.2 * sides[::-1]  # nearer a side shows nothing
    centres, stress = block.cell_centers().points[:, :2], block.cell_data["stress"]
    inside = np.all((centres > low) & (centres < high), axis=1) & (stress > HIGH * np.quantile(stress, 0.999))
    at = np.argmax(np.where(inside, centres @ [1.0, -1.0], -np.inf) if inside.any() else stress)
    x, y = np.clip(centres[at], low, high).tolist()
    return upper.clip_box((x, x1 + 1, y0 - 1, y, z0 - 1, z1 + 1), invert=True)
