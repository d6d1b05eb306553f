"""Parameters of ISO 25178 of public instrument files, beside SurfaceTopography and surfalize, as a Markdown table.

    ./run pip install SurfaceTopography surfalize
    ./run python3 benchmarks/instruments.py [FOLDER]     with the files of SurfaceTopography's repository, of its folder
                                                         test/file_format_examples; default out/instruments

Gaps of each file are filled, and its largest square is levelled by a plane; both programs get these heights. The size
is that of the whole file, by SurfaceTopography's reader too, which counts a pixel more.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import sys
import warnings
from pathlib import Path

import numpy as np

from asperity.surface.iso25178 import iso25178
from asperity.surface.measured import HeightField

FILES = (
    "al3d-1.al3d", "di-1.di", "spot_1-1000nm.ibw", "mi-1.mi", "metropro-1.dat", "nid-1.nid", "opd-1.opd", "plu-1.plu",
    "sur-2.sur", "x3p-2.x3p",
)  # fmt: skip
NAMES = ("Sq", "Sdq", "Sdr", "Sal", "Str", "Sk", "Spk", "Svk")
LAGS = 700  # heights per side, of which there may be more: surfalize interpolates whole rays of the autocorrelation


def row(path: Path) -> list[str]:
    """Name, size and heights, Sq and Sdq over SurfaceTopography, then each parameter over surfalize."""
    other, third = (importlib.import_module(name) for name in ("SurfaceTopography", "surfalize"))
    whole = HeightField.read(path)
    field = (whole.filled() if whole.missing else whole).square().levelled("plane")
    step = -(-max(field.z.shape) // LAGS)
    own = HeightField(field.z[::step, ::step], step * field.dx, step * field.dy)
    ours = iso25178(own.z, own.dx, own.dy).to_dict()
    theirs = third.Surface(own.z - own.z.mean(), own.dx, own.dy)
    percent = {"Sdr": 100.0}
    cells = []
    for name in NAMES:
        their, value = float(getattr(theirs, name)()) / percent.get(name, 1.0), ours[name]
        if value is None or np.isnan(their):
            cells.append("beyond the patch" if value is None and np.isnan(their) else f"{value} against {their:.4g}")
        else:
            cells.append(f"{value:.4g} ({100.0 * (value / their - 1.0):+.1f} %)")
    ny, nx = own.z.shape
    heights = other.Topography(own.z.T - own.z.mean(), (nx * own.dx, ny * own.dy))  # its pixels have a size
    others = heights.rms_height_from_area(), heights.rms_gradient()
    sizes = other.open_topography(str(path)).topography().to_unit("um").physical_sizes
    both = [" x ".join(f"{1e6 * side:.4g}" for side in whole.size), " x ".join(f"{side:.4g}" for side in sizes)]
    over = (f"{100.0 * (float(ours[name] or 0.0) / their - 1.0):+.2f} %"
            for name, their in zip(("Sq", "Sdq"), others, strict=True))  # fmt: skip
    return [path.name, both[0], both[1], f"{own.z.shape[1]} x {own.z.shape[0]}", *over, *cells]


def main(folder: Path) -> None:
    """Print the table."""
    made = (f"{name} {importlib.metadata.version(name)}" for name in ("SurfaceTopography", "surfalize"))
    print(f"Versions: {', '.join(made)}\n")
    header = ["file", "size, µm", "by SurfaceTopography", "heights", "Sq over SurfaceTopography", "Sdq over it"]
    print("| " + " | ".join([*header, *(f"{name} (over surfalize)" for name in NAMES)]) + " |")
    print("|" + "---|" * (len(header) + len(NAMES)))
    for name in FILES:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                print("| " + " | ".join(row(folder / name)) + " |", flush=True)
            except Exception as error:  # one file of one reader
                print(f"{name}: {error}", file=sys.stderr)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else "out/instruments"))
