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
