"""Store the tables that a command prints as CSV files, each with the command and the versions in its first lines.

    ./run python3 benchmarks/tables.py FILE.csv [FILE.csv]... -- COMMAND...

For example `benchmarks/tables.py docs/tables/krylov_tolerance.csv -- python3 benchmarks/linear.py krylov`. The command
must print as many Markdown tables as there are files. They are stored in this order; the name `-` leaves one out.
"""

from __future__ import annotations

import csv
import io
import shlex
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path


def markdown_tables(text: str) -> Iterator[list[list[str]]]:
    """Tables of a text, each as its header and its rows.

    >>> list(markdown_tables("| a | b |\\n|---|---|\\n| 1 | x, y |\\n"))
    [[['a', 'b'], ['1', 'x, y']]]
    """
    lines: list[list[str]] = []
    for line in [*text.splitlines(), ""]:
        if line.startswith("|"):
            lines.append([cell.strip() for cell in line.strip().strip("|").split(" | ")])
        elif lines:
            yield [lines[0], *lines[2:]]
            lines = []


def versions() -> str:
    """Day and versions, as they stand in the second line of a table."""
    import dolfinx

    import asperity

    return f"{datetime.now(UTC):%Y-%m-%d}, asperity {asperity.__version__}, dolfinx {dolfinx.__version__}"


def csv_text(command: str, made: str, table: Iterable[Sequence[str]]) -> str:
    """Text of a CSV file: the command, when it ran with what, header, rows.

    >>> print(csv_text("./run true", "2026-11-20", [("a", "b"), ("1", "x, y")]), end="")
    # ./run true
    # 2026-11-20
    a,b
    1,"x, y"
    """
    out = io.StringIO()
    out.write(f"# {command}\n# {made}\n")
    csv.writer(out, lineterminator="\n").writerows(table)
    return out.getvalue()


def read(path: Path) -> tuple[str, str, list[list[str]]]:
    """Command, versions, and header with rows of a stored table."""
    first, second, *lines = path.read_text(encoding="utf-8").splitlines()
    return first.removeprefix("# "), second.removeprefix("# "), list(csv.reader(lines))


def main(arguments: list[str]) -> int:
    """Run the command, pass on what it prints, and store its tables."""
    if "--" not in arguments:
        print(__doc__, file=sys.stderr)
        return 2
    cut = arguments.index("--")
    files, command = arguments[:cut], arguments[cut + 1 :]
    printed = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            print(line, end="", flush=True)
            printed.append(line)
    tables = list(markdown_tables("".join(printed)))
    if process.returncode or len(tables) != len(files):
        found = f"{len(tables)} tables for {len(files)} files, exit code {process.returncode}"
        print(f"{found}: none stored", file=sys.stderr)
        return process.returncode or 2
    for file, table in zip(files, tables, strict=True):
        if file != "-":
            Path(file).write_text(csv_text(f"./run {shlex.join(command)}", versions(), table), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
