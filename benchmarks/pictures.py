"""Make the pictures of the documentation, docs/pictures/*.

    ./run python3 benchmarks/pictures.py [-o out/pictures] [NAME]...

All of them, or those that are named. Pictures of a run are files that the commands of a page make: these are run in
the folder, as they stand on the page and once. Figures of cost and error are drawn from the tables in docs/tables.
"""

from __future__ import annotations

import argparse
import csv
import os
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity.plot import style

ROOT = Path(__file__).parent.parent
PICTURES, TABLES = ROOT / "docs/pictures", ROOT / "docs/tables"
sys.path.insert(0, str(ROOT / "tests"))

from test_walkthroughs import FENCE  # noqa: E402

# picture -> page, file that its commands make
OF_PAGES = {name: ("gallery", f"out/demo/figures/{name}") for name in (
    "curve.svg", "pressure.png", "area.svg", "response.svg",
)} | {
    "tutorial_scan.png": ("tutorials/scan", "out/scan/surface.png"),
    "tangential.svg": ("tutorials/vibration", "out/tangential/slip_response.svg"),
}  # fmt: skip
Rows = list[dict[str, str]]


def made_by(page: str, file: str, folder: Path) -> Path:
    """A file that the blocks of a page make; they are run as typed, in order and once, until it is there."""
    place = folder / page
    place.mkdir(parents=True, exist_ok=True)
    if not (place / "cases").exists():
        (place / "cases").symlink_to(ROOT / "cases")
    paths = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    blocks = FENCE.findall((ROOT / f"docs/{page}.md").read_text(encoding="utf-8"))
    for number, (language, title, text) in enumerate(blocks):
        done = place / f".block_{number}"
        if (place / file).is_file():
            break
        if title:
            (place / title).write_text(text, encoding="utf-8")
        elif language in ("sh", "python") and not done.exists():
            command = ["bash", "-e", "-c", text] if language == "sh" else [sys.executable, "-c", text]
            subprocess.run(command, cwd=place, env=os.environ | {"PATH": paths}, stdout=subprocess.DEVNULL, check=True)
            done.touch()
    return place / file


# --------------------------------------------------------------------------------- figures of the stored tables


def table(name: str) -> Rows:
    """Rows of a table in docs/tables."""
    with (TABLES / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def draw_costs(axis: Any, rows: Rows, x: str, y: str, look: Mapping[str, Any]) -> None:
    """Draw error over cost of some rows, in the order of the cost, the unknown ones left out."""
    known = [row for row in rows if not {row[x], row[y]} & {"", "—"}]
    points = sorted((float(row[x]), float(row[y])) for row in known)
    if points:
        axis.loglog(*np.transpose(points), **{"marker": "o", "lw": 1.3, **look})


@style.styled
def peers() -> Figure:
    """Error against CPU time: a panel a material, asperity black and grey."""
    looks = {
        "asperity": (style.BLACK, "o"), "asperity, by tolerance": (style.GREY, "o"), "CalculiX": (style.VERMILION, "s"),
        "CalculiX, mesh of asperity": (style.BLUE, "^"), "Tamaas (half-space)": (style.GREEN, "d"),
    }  # fmt: skip
    figure, axes = style.figure(style.WIDE, 3.4, "elastic", "plastic")
    for axis, material in zip(axes, ("elastic", "plastic"), strict=True):
        rows = table(f"peers_{material}")
        for name, (colour, marker) in looks.items():
            draw_costs(axis, [row for row in rows if row["program"] == name], "CPU s", "rms error %",
                       {"color": colour, "marker": marker, "mfc": "white", "label": name})  # fmt: skip
        axis.legend(loc="best", fontsize="x-small")
        axis.set_xlabel("CPU time (s)")
        style.logarithmic(axis)
    axes[0].set_ylabel("rms error of the force (%)")
    return figure


DRAWN: dict[str, Callable[[], Figure]] = {"peers": peers}
NAMES = (*DRAWN, *(Path(name).stem for name in OF_PAGES))


def make(name: str, folder: Path) -> Path:
    """Make a picture; return its file."""
    if name in DRAWN:
        return style.save(DRAWN[name](), PICTURES / f"{name}.svg")
    file, (page, source) = next((file, made) for file, made in OF_PAGES.items() if Path(file).stem == name)
    return Path(shutil.copyfile(made_by(page, source, folder), PICTURES / file))


def main() -> None:
    """Make the pictures that are named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "out/pictures", help="folder of the runs")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(NAMES))
    arguments = parser.parse_args()
    if unknown := sorted(set(arguments.names) - set(NAMES)):
        parser.error(f"no picture of the name {unknown[0]}; there are {', '.join(NAMES)}")
    warnings.simplefilter("ignore")
    PICTURES.mkdir(exist_ok=True)
    for name in arguments.names or NAMES:
        path = make(name, arguments.output.absolute())
        print(f"{path.relative_to(ROOT)}  {path.stat().st_size / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    main()
