"""Make the tables and pictures of the documentation again, by the command that each table names.

    ./run python3 benchmarks/evidence.py [NAME]...      all, or the tables of these names and `pictures`
    ./run python3 benchmarks/evidence.py --list         commands, tables
    ./run python3 benchmarks/evidence.py demo RUN       the curve of a finished run of the demo, as a Markdown table

All of them take some hours. A command that cannot be run here (a program of others is missing) leaves its tables as
they are, is named with its last line, and the exit code is 1.
"""

from __future__ import annotations

import csv
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
COLUMNS = ("step", "branch", "delta", "force", "error_P_star", "P_star", "area_fraction", "spots")


def commands() -> dict[str, list[Path]]:
    """Commands of the stored tables, without `./run`, each with its files."""
    found: dict[str, list[Path]] = {}
    for path in sorted((ROOT / "docs/tables").glob("*.csv")):
        with path.open(encoding="utf-8") as file:
            found.setdefault(file.readline().removeprefix("# ./run ").strip(), []).append(path)
    return found


def curve_of(folder: Path) -> str:
    """Curve of a run as a Markdown table: approach (m), force (N) and the error bar of its dimensionless form."""
    with (folder / "curve.csv").open(encoding="utf-8", newline="") as file:
        rows = [[row[name] for name in COLUMNS] for row in csv.DictReader(file)]
    cells = [[f"{float(x):.6g}" if i > 1 else x for i, x in enumerate(row)] for row in rows]
    return "\n".join("| " + " | ".join(row) + " |" for row in [COLUMNS, ["---"] * len(COLUMNS), *cells])


def main(arguments: list[str]) -> int:
    """Run the commands that are named, all by default; return the exit code."""
    if arguments[:1] == ["demo"] and len(arguments) == 2:
        print(curve_of(Path(arguments[1])))
        return 0
    jobs = {
        command: [sys.executable, "benchmarks/tables.py", *map(str, files), "--", *shlex.split(command)]
        for command, files in commands().items()
        if not arguments or arguments == ["--list"] or {path.stem for path in files} & set(arguments)
    }
    if not arguments or {"pictures", "--list"} & set(arguments):
        jobs["python3 benchmarks/pictures.py"] = [sys.executable, "benchmarks/pictures.py"]
    failed = not jobs
    for name, job in jobs.items():
        print(name, flush=True)
        if arguments == ["--list"]:
            continue
        done = subprocess.run(job, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
        if done.returncode:
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            print(f"    not made, exit code {done.returncode}: {last}", flush=True)
            failed = True
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
