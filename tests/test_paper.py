# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The draft of the paper, the table of the evidence, and links: what they quote exists."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from typing import Any

import pytest

from asperity.verification import NAMES

ROOT = Path(__file__).parent.parent
PAPER, BIB = ROOT / "paper/paper.md", ROOT / "paper/paper.bib"
in_a_clone = pytest.mark.skipif(not (ROOT / ".ci").is_dir(), reason="an unpacked sdist has no .ci")


@pytest.fixture(scope="module")
def evidence() -> Any:
    """benchmarks/evidence.py."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "benchmarks"))
        return runpy.run_path(str(ROOT / "benchmarks/evidence.py"))


def test_what_the_paper_cites_is_in_its_list_and_the_other_way_round() -> None:
    bib = BIB.read_text(encoding="utf-8")
    defined = re.findall(r"^@\w+\{(\w+),", bib, re.MULTILINE)
    assert len(set(defined)) == len(defined) > 5
    assert set(re.findall(r"@(\w+)", PAPER.read_text(encoding="utf-8"))) == set(defined)
    assert len(re.findall(r"^  doi +=", bib, re.MULTILINE)) == len(defined)


def test_the_paper_is_as_long_as_the_journal_asks() -> None:
    text = PAPER.read_text(encoding="utf-8").split("---", 2)[2]
    assert 250 <= len(re.sub(r"^\|.*$", "", text, flags=re.MULTILINE).split()) <= 1000


def test_the_figures_of_the_paper_are_those_of_the_tables(evidence: Any) -> None:
    text = " ".join(PAPER.read_text(encoding="utf-8").split())
    tables = evidence["text"]() + (ROOT / "docs/peers.md").read_text(encoding="utf-8")
    quoted = re.findall(r"\d+ of \d+|\d+\.\d+ %|\d[\d.]* s\b", text)
    assert len(quoted) >= 7
    assert [figure for figure in quoted if figure not in tables] == []


def test_the_table_of_the_evidence_is_that_of_the_stored_tables(evidence: Any) -> None:
    page = evidence["PAGE"].read_text(encoding="utf-8")
    stored = page.split(evidence["BEGIN"])[1].split(evidence["END"])[0]
    assert stored == evidence["text"](), "run benchmarks/evidence.py --write"
    assert set(evidence["CASES"]) == set(NAMES)
    assert {row["case"] for row in evidence["table"]("verification")[1]} <= set(NAMES)


@in_a_clone
def test_links_lead_somewhere(tmp_path: Path) -> None:
    script = runpy.run_path(str(ROOT / ".ci/links"))
    assert [line for page in script["pages"]() for line in script["broken"](page)] == []
    page = tmp_path / "page.md"
    page.write_text(
        "# A *title*, `so`\n[a](#a-title-so) [b](#b) [c](gone.md) [d](page.md#c) ![e](e.png) [f](https://x.org)\n"
    )
    script["broken"].__globals__["ROOT"] = tmp_path
    assert script["broken"](page) == [f"page.md: {name}" for name in ("#b", "gone.md", "page.md#c", "e.png")]
