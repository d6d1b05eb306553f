"""The pictures of the documentation:  python3 benchmarks/gallery.py out/gallery

Runs what the pictures show where it is not there yet, and writes docs/pictures/*.png, made small.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

from PIL import Image

from asperity.case import Case
from asperity.plot import plot_run
from asperity.plot.scene import scene
from asperity.simulation import run

ROOT = Path(__file__).parent.parent
WIDTH, COLOURS = 1200, 128
# run -> case, changes, figures
RUNS = {
    "demo": ("demo", ["mesh.h_contact=0.05e-6"], ("surface", "mesh", "pressure", "area", "plasticity", "response",
                                                  "frequency", "scene")),
    "sphere": ("hertz", ["mesh.h_contact=2e-6", "output.fields=true"], ("pressure",)),
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
            run(Case.load(ROOT / f"cases/{case}.toml", changes), out)
        plot_run(out)
        if "scene" in wanted:
            scene(out)
        for figure in wanted:
            target = pictures / (f"{figure}.png" if name == "demo" else f"{name}_{figure}.png")
            shrink(out / f"figures/{figure}.png", target)
            print(f"{target.relative_to(ROOT)}  {target.stat().st_size / 1000:.0f} kB")


def shrink(source: Path, target: Path) -> None:
    """Copy a picture with fewer pixels and colours."""
    with Image.open(source) as image:
        flat = image.convert("RGB")
        if flat.width > WIDTH:
            flat = flat.resize((WIDTH, round(flat.height * WIDTH / flat.width)), Image.Resampling.LANCZOS)
        flat.quantize(COLOURS, dither=Image.Dither.NONE).save(target, optimize=True)


if __name__ == "__main__":
    main()
