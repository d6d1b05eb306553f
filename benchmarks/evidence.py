"""Make the tables and pictures of the documentation again.

    ./run python3 benchmarks/evidence.py [NAME]...      all, or the tables and pictures of these names
    ./run python3 benchmarks/evidence.py --list         names, those of tables with their commands
    ./run python3 benchmarks/evidence.py demo RUN       curve of the demo, run where RUN is not there, as a table

A stored table has its command, the versions and its header in its first lines. It takes the rows of the table with
this header that the command prints; a new one needs no more than these lines. All of them take two hours. Pictures of a
run are files that the commands of a page make: these are run in out/evidence, as they stand on the page and once; a
figure of cost and error is drawn from stored tables. What a command prints is kept in out/evidence. One that fails
leaves its tables as they are, is named with its last line, and the exit code is 1.
"""

from __future__ import annotations

import csv
import shlex
import shutil
import subprocess
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity.plot import style

ROOT = Path(__file__).parent.parent
KEPT, PICTURES, TABLES = ROOT / "out/evidence", ROOT / "docs/pictures", ROOT / "docs/tables"
sys.path.insert(0, str(ROOT / "tests"))

from test_walkthroughs import blocks_of, typed  # noqa: E402

COLUMNS = ("step", "branch", "delta", "force", "error_P_star", "P_star", "area_fraction", "spots")
# picture -> page, file that its commands make
OF_PAGES = {name: ("tutorials/vibration", f"out/demo/figures/{name}") for name in (
    "curve.svg", "pressure.png", "area.svg", "response.svg",
)} | {
    "tutorial_scan.png": ("measured", "out/scan/surface.png"),
    "tutorial_leakage.png": ("tutorials/leakage", "out/pressed/figures/flow.png"),
    "tangential.svg": ("tutorials/vibration", "out/tangential/slip_response.svg"),
    "creep.svg": ("tutorials/creep", "out/creep/figures/time.svg"),
}  # fmt: skip
NAMES = ("peers", *(Path(name).stem for name in OF_PAGES))
Rows = list[list[str]]


def commands() -> dict[str, list[Path]]:
    """Commands of the stored tables, without `./run`, each with its files."""
    found: dict[str, list[Path]] = {}
    for path in sorted(TABLES.glob("*.csv")):
        with path.open(encoding="utf-8") as file:
            found.setdefault(file.readline().removeprefix("# ./run ").strip(), []).append(path)
    return found


def markdown_tables(text: str) -> Iterator[Rows]:
    """Tables of a text, each as its header and its rows."""
    lines: Rows = []
    for line in [*text.translate(str.maketrans("│┃┡", "|||")).splitlines(), ""]:  # commands draw theirs
        if line.startswith("|"):
            lines.append([cell.strip() for cell in line.strip().strip("|").split(" | ")])
        elif lines:
            yield [lines[0], *lines[2:]]
            lines = []


def versions(printed: str) -> str:
    """Day and versions, with those of other programs that the command prints in a line `Versions: ...`."""
    import dolfinx

    import asperity

    others = [line.partition(":")[2] for line in printed.splitlines() if line.startswith("Versions:")]
    made = f"{datetime.now(UTC):%Y-%m-%d}, asperity {asperity.__version__}, dolfinx {dolfinx.__version__}"
    return ",".join([made, *others])


def store(command: str, files: Sequence[Path], printed: str) -> None:
    """Store the printed tables, each in the file with its header; LookupError where there is not one for each."""
    tables = list(markdown_tables(printed))
    rows_of = {}
    for path in files:
        header = next(csv.reader(path.read_text(encoding="utf-8").splitlines()[2:]))
        own = [rows for rows in tables if rows[0] == header]
        if len(own) != 1:
            raise LookupError(f"{len(own)} tables with the header of {path.name}, 1 is wanted")
        rows_of[path] = own[0]
    for path, rows in rows_of.items():
        with path.open("w", encoding="utf-8", newline="") as file:
            file.write(f"# ./run {command}\n# {versions(printed)}\n")
            csv.writer(file, lineterminator="\n").writerows(rows)


def curve_of(folder: Path) -> str:
    """Curve of a run as a Markdown table: approach (m), force (N) and the error bar of its dimensionless form."""
    with (folder / "curve.csv").open(encoding="utf-8", newline="") as file:
        rows = [[row[name] for name in COLUMNS] for row in csv.DictReader(file)]
    cells = [[f"{float(x):.6g}" if i > 1 else x for i, x in enumerate(row)] for row in rows]
    return "\n".join("| " + " | ".join(row) + " |" for row in [COLUMNS, ["---"] * len(COLUMNS), *cells])


def made_by(page: str, file: str, folder: Path) -> Path:
    """A file that the blocks of a page make; they are run as typed, in order and once, until it is there."""
    place = folder / page
    place.mkdir(parents=True, exist_ok=True)
    for number, block in enumerate(blocks_of(ROOT / f"docs/{page}.md")):
        done = place / f".block_{number}"
        if (place / file).is_file():
            break
        if not done.exists():
            if (process := typed(block, place)) is not None:
                process.check_returncode()
            done.touch()
    return place / file


def table(name: str) -> list[dict[str, str]]:
    """Rows of a stored table."""
    with (TABLES / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def draw_costs(axis: Any, rows: list[dict[str, str]], x: str, y: str, look: Mapping[str, Any]) -> None:
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


def make(name: str) -> None:
    """Make a picture."""
    if name == "peers":
        style.save(peers(), PICTURES / f"{name}.svg")
        return
    file, (page, source) = next((file, made) for file, made in OF_PAGES.items() if Path(file).stem == name)
    shutil.copyfile(made_by(page, source, KEPT / "pages"), PICTURES / file)


def store_printed(command: str, files: Sequence[Path]) -> None:
    """Run the command of some tables and store them."""
    log = KEPT / f"{files[0].stem}.txt"
    with log.open("w", encoding="utf-8") as out:
        subprocess.run(shlex.split(command), cwd=ROOT, stdout=out, stderr=subprocess.PIPE, text=True, check=True)
    store(command, files, log.read_text(encoding="utf-8"))


def main(arguments: list[str]) -> int:
    """Make what is named, all by default; return the exit code."""
    if arguments[:1] == ["demo"] and len(arguments) == 2:
        folder = Path(arguments[1])
        if not folder.exists():
            subprocess.run(["asperity", "run", "cases/demo.toml", "-o", folder], stdout=sys.stderr, check=True)
        print(curve_of(folder))
        return 0
    warnings.simplefilter("ignore")
    names = set(arguments) - {"--list"}
    jobs = [(command, {path.stem for path in files}, files) for command, files in commands().items()]
    jobs += [(f"picture {name}", {name}, []) for name in NAMES]
    chosen = [(title, files) for title, of, files in jobs if not names or names & of]
    KEPT.mkdir(parents=True, exist_ok=True)
    failed = not chosen
    for title, files in chosen:
        print(title, flush=True)
        if "--list" in arguments:
            continue
        try:
            if files:
                store_printed(title, files)
            else:
                make(title.removeprefix("picture "))
        except subprocess.CalledProcessError as error:
            last = ((error.stderr or "").strip().splitlines() or ["no message"])[-1]
            print(f"    not made, exit code {error.returncode}: {last}", flush=True)
            failed = True
        except (LookupError, OSError) as error:
            print(f"    not made: {error}", flush=True)
            failed = True
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
