"""The order of the packages: a lower one never imports a higher one, not even lazily or for type hints."""

from __future__ import annotations

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "python" / "asperity"

PAGE = (PACKAGE.parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")
LAYERS = PAGE.partition("```text\n")[2].partition("\n```")[0].splitlines()
# Packages and root modules from low to high. Each imports from the rows above it here, not from its own row.
ORDER = [["_solver"], *(row.split() for row in reversed(LAYERS)), ["__main__"]]


def name_of(path: Path) -> str:
    """Dotted name of a module in the package, "" for the package itself."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix("__init__").rstrip(".")


def imports(source: str, modules: set[str]) -> set[str]:
    """Modules of the package that a source imports or names: at its top, in functions, for type hints, as a string."""
    names: list[str] = []
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.ImportFrom(module=str(base), names=found, level=0):
                names += (f"{base}.{alias.name}" for alias in found)
            case ast.ImportFrom():
                raise AssertionError(f"a relative import in line {node.lineno}: write the full name")
            case ast.Import(names=found):
                names += (alias.name for alias in found if alias.name != "asperity")
            case ast.Attribute(value=ast.Name(id="asperity"), attr=name):
                names.append(f"asperity.{name}")
            case ast.Constant(value=str(text)) if text.removeprefix("asperity.") in modules:
                names.append(text)
    inside = (name.removeprefix("asperity.") for name in names if name.startswith("asperity."))
    return {name if name in modules else name.rpartition(".")[0] or name for name in inside}


SOURCES = {name_of(path): path.read_text(encoding="utf-8") for path in sorted(PACKAGE.rglob("*.py"))}
IMPORTS = {name: imports(source, set(SOURCES)) - {name} for name, source in SOURCES.items() if name}


def root(name: str) -> str:
    """Package or root module that a module is in."""
    return name.partition(".")[0]


def test_no_package_imports_a_higher_one() -> None:
    row = {name: i for i, names in enumerate(ORDER) for name in names}
    assert len(row) > 20
    pairs = [(name, other) for name, others in IMPORTS.items() for other in others if root(name) != root(other)]
    assert {root(name) for pair in pairs for name in pair} <= set(row), "give the new ones a place in CONTRIBUTING.md"
    assert {pair for pair in pairs if row[root(pair[0])] <= row[root(pair[1])]} == set()


def test_there_is_no_circle() -> None:
    try:
        TopologicalSorter(IMPORTS).prepare()
    except CycleError as error:
        pytest.fail(" <- ".join(error.args[1]))


def test_every_kind_of_import_is_found() -> None:
    source = """
import asperity
import asperity.fem.solid
from asperity import job
from asperity.curve import Curve
if TYPE_CHECKING:
    from asperity.mesh import block
def lazy():
    from asperity.plot.style import save as keep
    import_module("asperity.adaptive")
    return asperity.Case
"""
    modules = {"fem", "fem.solid", "job", "curve", "mesh", "mesh.block", "plot", "plot.style", "adaptive"}
    assert imports(source, modules) >= {"fem.solid", "job", "curve", "mesh.block", "plot.style", "adaptive", "Case"}
    assert "plot" not in imports("text = 'plot'", {"plot"})
    with pytest.raises(AssertionError, match="relative import in line 1"):
        imports("from . import block", modules)
