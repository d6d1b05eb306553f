"""What mkdocs takes from elsewhere: README as front page, input reference, formulas."""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
MARK = re.compile(r"^<!-- insert (\w+) -->$", re.MULTILINE)
OUTSIDE = re.compile(r"\[(`[^`]+`)\]\((?:\.\./)+(?:benchmarks|python|tests|solver|cases|examples|\.ci)[^)]*\)")
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def readme() -> str:
    """The README, its links seen from the site; files outside docs/ are only named."""
    text = (ROOT / "README.md").read_text(encoding="utf-8").replace("](docs/", "](")
    return re.sub(r"\[([^]]+)\]\((?!https?:)([A-Z]+(?:\.\w+)?)\)", r"`\2`", text)


def keys() -> str:
    """A table for each section of the case file."""
    from asperity.case.case_file import input_reference

    tables: dict[str, list[str]] = {}
    for section, key, default, legal, unit, meaning in input_reference():
        tables.setdefault(section, []).append(f"| `{key}` | {meaning} | {legal} | {default} | {unit} |")
    head = "| key | meaning | legal values | default | unit |\n|---|---|---|---|---|\n"
    return "\n\n".join(f"### {name or 'top of the file'}\n\n{head}" + "\n".join(rows) for name, rows in tables.items())


PARTS = {"readme": readme, "keys": keys}


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace the marks of a page; links to files outside docs/, which a forge follows, become names."""
    return OUTSIDE.sub(r"\1", MARK.sub(lambda mark: PARTS[mark[1]](), markdown))


def on_page_content(content: str, **_: Any) -> str:
    """Turn TeX into MathML, which browsers draw themselves: the site loads nothing from elsewhere."""
    from latex2mathml.converter import convert

    def formula(found: re.Match[str]) -> str:
        return convert(html.unescape(found[2]), display="inline" if found[1] == "span" else "block")

    return FORMULA.sub(formula, content)
