"""Make the tables and pictures of the documentation again, by the command that each table names.

    ./run python3 benchmarks/evidence.py [NAME]...      all, or the tables of these names and `pictures`
    ./run python3 benchmarks/evidence.py --list         commands
    ./run python3 benchmarks/evidence.py demo RUN       curve of the demo, run where RUN is not there, as a table

A stored table has the command, the versions and its header in its first lines. It takes the rows of the table with this
header that the command prints; a new one needs no more than these lines. All of them take two hours. What a command
prints is kept in out/evidence. One that fails leaves its tables as they are, is named with its last line, and the exit
code is 1.
"""

from __future__ import annotations

import csv
import shlex
import subprocess
import sys
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).parent.parent
COLUMNS = ("step", "branch", "delta", "force", "error_P_star", "P_star", "area_fraction", "spots")
PICTURES = "python3 benchmarks/pictures.py"
Rows = list[list[str]]


def commands() -> dict[str, list[Path]]:
    """Commands of the stored tables, without `./run`, each with its files; last that of the pictures, with none."""
    found: dict[str, list[Path]] = {}
    for path in sorted((ROOT / "docs/tables").glob("*.csv")):
        with path.open(encoding="utf-8") as file:
            found.setdefault(file.readline().removeprefix("# ./run ").strip(), []).append(path)
    return found | {PICTURES: []}


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


def main(arguments: list[str]) -> int:
    """Run the commands that are named, all by default; return the exit code."""
    if arguments[:1] == ["demo"] and len(arguments) == 2:
        folder = Path(arguments[1])
        if not folder.exists():
            subprocess.run(["asperity", "run", "cases/demo.toml", "-o", folder], stdout=sys.stderr, check=True)
        print(curve_of(folder))
        return 0
    names = set(arguments) - {"--list"}
    chosen = {
        command: files
        for command, files in commands().items()
        if not names or names & ({path.stem for path in files} or {"pictures"})
    }
    kept = ROOT / "out/evidence"
    kept.mkdir(parents=True, exist_ok=True)
    failed = not chosen
    for command, files in chosen.items():
        print(command, flush=True)
        if "--list" in arguments:
            continue
        log = kept / f"{files[0].stem if files else 'pictures'}.txt"
        try:
            with log.open("w", encoding="utf-8") as out:
                subprocess.run(
                    shlex.split(command), cwd=ROOT, stdout=out, stderr=subprocess.PIPE, text=True, check=True
                )
            store(command, files, log.read_text(encoding="utf-8"))
        except subprocess.CalledProcessError as error:
            last = (error.stderr.strip().splitlines() or ["no message"])[-1]
            print(f"    not made, exit code {error.returncode}: {last}", flush=True)
            failed = True
        except (LookupError, OSError) as error:
            print(f"    not made: {error}", flush=True)
            failed = True
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
