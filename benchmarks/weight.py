"""How much there is to read: lines, files, words, pages, tables and constants, as Markdown tables.

    python3 benchmarks/weight.py [FOLDER]     of this clone or another one, for example a worktree of an old commit

Counts the files that git knows. A constant is a number, or a tuple of numbers, that a module assigns to a name in
capitals. Prints, and judges nothing.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections import Counter
from pathlib import Path


def is_number(node: ast.expr) -> bool:
    """Whether an expression is a number or consists of numbers; what is derived from a name is not tuned."""
    if isinstance(node, ast.Tuple | ast.List):
        return bool(node.elts) and all(is_number(each) for each in node.elts)
    parts = [each for each in ast.walk(node) if isinstance(each, ast.Constant | ast.Name | ast.Call | ast.Attribute)]
    return bool(parts) and all(isinstance(p, ast.Constant) and type(p.value) in (int, float) for p in parts)


def constants(text: str) -> int:
    """Number of constants of a module."""
    found = 0
    for node in ast.parse(text).body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None and is_number(node.value):
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            found += ast.unparse(target).strip("()").replace(", ", "").isupper()
    return found


def main(root: Path) -> None:
    """Print the tables."""
    names = subprocess.run(["git", "ls-files"], cwd=root, capture_output=True, text=True, check=True).stdout.split("\n")
    lines, files, tuned = Counter[str](), Counter[str](), Counter[str]()
    words = pages = tables = 0
    for path in (Path(name) for name in names if (root / name).is_file()):
        if path.suffix in (".png", ".svg", ".csv", ".npz", ".json") or not path.parts:
            tables += path.parts[:2] == ("docs", "tables")
            continue
        text = (root / path).read_text(encoding="utf-8", errors="replace")
        depth = 3 if path.parts[0] == "python" and len(path.parts) > 3 else 1
        places = {"/".join(path.parts[:depth]) if len(path.parts) > 1 else "(top)", path.parts[0]}
        count = constants(text) if path.suffix == ".py" else 0
        for place in places:
            lines[place] += text.count("\n")
            files[place] += 1
            tuned[place] += count
        if path.parts[0] == "docs" and path.suffix == ".md":
            pages, words = pages + 1, words + len(text.split())
    print("| part | lines | files | constants |\n|---|---|---|---|")
    for place in sorted(lines):
        if place in ("(top)", "solver", ".ci") or files[place] > 1:
            print(f"| {place} | {lines[place]} | {files[place]} | {tuned[place]} |")
    print(f"\n| pages of docs | words | stored tables |\n|---|---|---|\n| {pages} | {words} | {tables} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).parents[1])
