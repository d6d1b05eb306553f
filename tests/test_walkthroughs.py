"""What a reader types is legal; that of tutorials and how-to pages is run in order, and prints what is shown."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from asperity.case import Case

ROOT = Path(__file__).parent.parent
ALL = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [p for p in ALL if p.parent.name in ("tutorials", "how-to") or p.stem in ("measured", "stiffness")]
FENCE = re.compile(r'^```(\w+)(?: title="([\w./-]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
ANY = "…"  # for a word that is not compared; alone on a line: lines left out
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")
CLOSE, OF_BARS = 0.05, 0.5  # relative differences of numbers, after a ±: other versions of gmsh make other meshes


Block = tuple[str, str, str]  # language, name of a file, text


def blocks_of(page: Path) -> list[Block]:
    """Fenced blocks of a page in their order."""
    return FENCE.findall(page.read_text(encoding="utf-8"))


def typed(block: Block, place: Path) -> subprocess.CompletedProcess[str] | None:
    """Do in a folder with the cases what a block asks for: write its file, or run it; None where nothing is run."""
    language, title, text = block
    for name in ("cases", "examples"):
        if not (place / name).exists():
            (place / name).symlink_to(ROOT / name)
    if title:
        (place / title).write_text(text, encoding="utf-8")
    if title or language not in ("sh", "python"):
        return None
    command = ["bash", "-e", "-c", text] if language == "sh" else [sys.executable, "-c", text]
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    return subprocess.run(
        command, cwd=place, env=os.environ | {"PATH": path}, capture_output=True, text=True, check=False
    )


def same_word(shown: str, printed: str, close: float = CLOSE) -> bool:
    """Whether a word agrees, its numbers up to a relative difference."""
    if shown == ANY or NUMBER.sub("#", shown) != NUMBER.sub("#", printed):
        return shown == ANY or (shown.endswith(ANY) and printed.startswith(shown[:-1]))
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=True)
    return all(math.isclose(float(a), float(b), rel_tol=close, abs_tol=1e-30) for a, b in pairs)


def same_line(shown: str, printed: str) -> bool:
    """Whether the words of a line appear next to one another in a printed one."""
    words, found = shown.split(), printed.split()
    close = [OF_BARS if before == "±" else CLOSE for before in ["", *words]]
    starts = range(len(found) - len(words) + 1)
    return any(all(map(same_word, words, found[i : i + len(words)], close)) for i in starts)


def test_lines_are_compared() -> None:
    assert same_line("P* = 35.179 …", "[  2 s] P* = 35.2 (delta/L)^2.2")
    assert same_line("0.0177…", "0.01773749")
    assert not same_line("P* = 35.179", "P* = 39.1")
    assert same_line("1.91 ± 1.3 %", "1.89 ± 1.1 %") and not same_line("1.91 ± 1.3 %", "1.91 ± 13 %")
    assert not same_line("written to out/first", "written to out/second")


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("page", ALL, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_what_a_page_types_is_legal(page: Path) -> None:
    """The quick part, with `tests/test_docs.py`: case files and Python, without running them."""
    for language, title, text in blocks_of(page):
        if language == "python":
            compile(text, page.name, "exec")
        elif language == "toml":
            data = tomllib.loads(text)
            made = data.get("surface", {}).get("kind") == "file"  # by a command of the page
            if "surface" in data and not made and (page in PAGES or {"material", "loading"} <= set(data)):
                Case.from_dict(data)
            assert title or page not in PAGES, "a case file has a name"


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_a_page_works_as_typed(page: Path, tmp_path: Path) -> None:
    printed = ""
    for block in blocks_of(page):
        if block[0] == "text" and not block[1]:
            lines = [line for line in block[2].splitlines() if line.strip() not in ("", ANY)]
            assert [line for line in lines if not any(same_line(line, other) for other in printed.splitlines())] == []
        elif (done := typed(block, tmp_path)) is not None:
            printed = done.stdout + done.stderr
            assert done.returncode == 0, f"{block[2]}\n{printed}"
