# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The examples in the docstrings of the package are executed and print what they show."""

from __future__ import annotations

import ast
import doctest
import importlib
import inspect
import pkgutil
import types
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import asperity

OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS

# Packages whose public classes and functions all have an example.
COMPLETE = ("asperity", "asperity.reference", "asperity.study", "asperity.surface")


def docstrings(source: str) -> Iterator[tuple[str, int, str]]:
    """Name, line and text of each docstring with an example, those of attributes and of decorated functions too."""

    def inside(node: ast.AST, name: str) -> Iterator[tuple[str, int, str]]:
        for child in ast.iter_child_nodes(node):
            match child:
                case ast.Expr(value=ast.Constant(value=str(text))) if ">>>" in text:
                    yield name, child.lineno, inspect.cleandoc(text)
                case ast.ClassDef(name=own) | ast.FunctionDef(name=own) | ast.AsyncFunctionDef(name=own):
                    yield from inside(child, f"{name}.{own}".lstrip("."))
                case _:
                    yield from inside(child, name)

    yield from inside(ast.parse(source), "")


def modules() -> Iterator[tuple[str, Path]]:
    """Name and file of each Python module of the package; an import that fails is an error of the test."""
    path = Path(str(asperity.__file__))
    yield asperity.__name__, path
    for found in pkgutil.walk_packages(asperity.__path__, f"{asperity.__name__}.", onerror=_fail):
        relative = Path(*found.name.split(".")[1:])
        file = path.parent / (relative / "__init__.py" if found.ispkg else relative.with_suffix(".py"))
        if file.is_file():  # otherwise compiled
            yield found.name, file


def _fail(name: str) -> None:
    raise ImportError(f"{name} cannot be imported")


def examples() -> Iterator[tuple[str, str, int, str]]:
    """Module, name of the object, line and text of each docstring with an example."""
    for module, file in modules():
        source = file.read_text(encoding="utf-8")
        if ">>>" in source:
            yield from ((module, *found) for found in docstrings(source))


def run(text: str, names: dict[str, object], name: str, file: str = "", line: int = 0) -> list[str]:
    """Execute the examples of a docstring; the failures as text."""
    report: list[str] = []
    test = doctest.DocTestParser().get_doctest(text, dict(names), name, file, line)
    assert test.examples, f"{name}: no example can be read from {text!r}"
    assert not any(doctest.SKIP in example.options for example in test.examples), f"{name}: an example is skipped"
    doctest.DocTestRunner(optionflags=OPTIONS, verbose=False).run(test, out=report.append)
    return report


@pytest.mark.parametrize(
    ("module", "name", "line", "text"), [pytest.param(*e, id=f"{e[0]}.{e[1]}".rstrip(".")) for e in examples()]
)
def test_the_example_prints_what_it_shows(
    module: str, name: str, line: int, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names = {**vars(importlib.import_module(module)), "asp": asperity, "np": np}
    failures = run(text, names, f"{module}.{name}", module, line)
    assert not failures, "".join(failures)


@pytest.mark.parametrize("package", COMPLETE)
def test_every_public_class_and_function_has_an_example(package: str) -> None:
    public = importlib.import_module(package)
    found = {name: getattr(public, name) for name in public.__all__}
    documented = {n: o for n, o in found.items() if inspect.isclass(o) or isinstance(o, types.FunctionType)}
    assert documented
    assert [name for name, thing in documented.items() if ">>> " not in (thing.__doc__ or "")] == []


def test_each_docstring_is_found_and_a_wrong_example_fails() -> None:
    source = '''
"""Module.

>>> 1
1
"""
@decorated
def f():
    """Function.

    >>> 2
    3
    """
class A:
    a = 1
    """Attribute: >>> 4"""
    def g(self):
        """No example."""
if True:
    class B:
        """>>> 5  # doctest: +SKIP"""
'''
    found = [(name, text) for name, _, text in docstrings(source)]
    assert [name for name, _ in found] == ["", "f", "A", "B"]
    assert run(found[0][1], {}, "") == []
    assert "Expected:\n    3\nGot:\n    2" in "".join(run(found[1][1], {}, "f"))
    with pytest.raises(AssertionError, match="no example can be read"):
        run(found[2][1], {}, "A")
    with pytest.raises(AssertionError, match="an example is skipped"):
        run(found[3][1], {}, "B")


def test_every_module_is_looked_at() -> None:
    root = Path(str(asperity.__file__)).parent
    assert {file for _, file in modules()} == set(root.rglob("*.py"))
