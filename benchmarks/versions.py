# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Work of the counted scenes in each version of the project, from the counts that its history holds.

    ./run python3 benchmarks/versions.py

needs a clone with its history, and git, which ASPERITY_PACKAGES=git adds to a Debian root.

A row for each stored state of tests/counts.json (tests/test_counts.py) that differs from the one before. Counts do not
depend on the machine; an empty cell was not counted then.
"""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parent.parent
COUNTS, VERSION = "tests/counts.json", "python/asperity/__init__.py"
SCENES = ("elastic", "plastic")
COLUMNS = {
    "load steps": "steps",
    "Newton iterations": "Newton",
    "Krylov iterations": "Krylov",
    "calls of symmetric_product": "products",
    "calls of symmetric_galerkin": "coarse matrices",
}
BEFORE = {"calls of symmetric_galerkin": "calls of galerkin"}  # names of older counts


def git(*arguments: str) -> str:
    """Output of git in this clone."""
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout


def main() -> None:
    """Print the table."""
    print("| version | day | " + " | ".join(f"{scene} {c}" for scene in SCENES for c in COLUMNS.values()) + " |")
    print("|" + "---|" * (2 + len(SCENES) * len(COLUMNS)))
    before: list[str] = []
    for line in git("log", "--reverse", "--format=%H %cs", "--", COUNTS).splitlines():
        commit, day = line.split()
        found = re.search(r'__version__ = "(.*)"', git("show", f"{commit}:{VERSION}"))
        stored = json.loads(git("show", f"{commit}:{COUNTS}"))
        scenes = [stored.get(scene, {}) for scene in SCENES]
        cells = [str(scene.get(name, scene.get(BEFORE.get(name), ""))) for scene in scenes for name in COLUMNS]
        if cells != before:
            print("| " + " | ".join([found[1] if found else "", day, *cells]) + " |")
        before = cells


if __name__ == "__main__":
    main()
