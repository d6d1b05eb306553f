"""The draft of the paper: what it cites and quotes exists."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAPER, BIB = ROOT / "paper/paper.md", ROOT / "paper/paper.bib"


def test_what_the_paper_cites_is_in_its_list_and_the_other_way_round() -> None:
    bib = BIB.read_text(encoding="utf-8")
    defined = re.findall(r"^@\w+\{(\w+),", bib, re.MULTILINE)
    assert len(set(defined)) == len(defined) > 5
    assert set(re.findall(r"@(\w+)", PAPER.read_text(encoding="utf-8"))) == set(defined)
    assert len(re.findall(r"^  doi +=", bib, re.MULTILINE)) == len(defined)


def test_the_figures_of_the_paper_are_those_of_the_pages() -> None:
    text = " ".join(PAPER.read_text(encoding="utf-8").split())
    pages = "".join((ROOT / f"docs/{name}.md").read_text(encoding="utf-8") for name in ("verification", "peers"))
    quoted = re.findall(r"\d+ of \d+|\d+\.\d+ %|\d[\d.]* s\b", text)
    assert len(quoted) >= 5
    assert [figure for figure in quoted if figure not in pages] == []
