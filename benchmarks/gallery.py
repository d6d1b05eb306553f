# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The pictures of the documentation:  python3 benchmarks/gallery.py out/gallery

Runs what the pictures show where it is not there yet, and writes docs/pictures/*.png, made small.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

from pictures import shrink

from asperity.case import Case
from asperity.plot import plot_run
from asperity.plot.scene import scene
from asperity.run_case import run

ROOT = Path(__file__).parent.parent
# run -> case, changes, figures
RUNS = {
    "demo": ("demo", [], ("surface", "mesh", "curve")),
    "deep": ("demo", ["loading.delta_max=0.03e-6", "material.kinematics=small"],
             ("pressure", "area", "plasticity", "response", "frequency", "scene")),
    "wavy": ("sinusoid", ["surface.dims=2", "surface.wavelength=0.5e-6", "surface.amplitude=10e-9",
                          "surface.centre=[0.25e-6, 0.25e-6]", "loading.delta_max=10e-9", "mesh.h_contact=0.06e-6",
                          "output.fields=true"], ("pressure",)),
}  # fmt: skip


def main() -> None:
    """Make the runs and the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of the runs")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    pictures = ROOT / "docs/pictures"
    pictures.mkdir(exist_ok=True)
    for name, (case, changes, wanted) in RUNS.items():
        out = arguments.folder / name
        if not (out / "summary.json").is_file():
            run(Case.load(ROOT / f"cases/{case}.toml", changes), out, resume=True)
        plot_run(out)
        if "scene" in wanted:
            scene(out)
        for figure in wanted:
            target = pictures / (f"{name}_{figure}.png" if name == "wavy" else f"{figure}.png")
            shrink(out / f"figures/{figure}.png", target)
            print(f"{target.relative_to(ROOT)}  {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
