"""The examples in the docstrings of the package are executed and print what they show."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import asperity

OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def modules() -> Iterator[str]:
    """Names of the modules of the package with an example; an import that fails is an error of the test."""
    root = Path(str(asperity.__file__)).parent
    for found in pkgutil.walk_packages(asperity.__path__, "asperity.", onerror=_fail):
        path = root / Path(*found.name.split(".")[1:])
        file = path / "__init__.py" if found.ispkg else path.with_suffix(".py")
        if file.is_file() and ">>>" in file.read_text(encoding="utf-8"):  # otherwise compiled, or without one
            yield found.name


def _fail(name: str) -> None:
    raise ImportError(f"{name} cannot be imported")


@pytest.mark.parametrize("name", modules())
def test_the_examples_print_what_they_show(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = importlib.import_module(name)
    found = doctest.DocTestFinder(exclude_empty=True).find(module, extraglobs={"asp": asperity, "np": np})
    report: list[str] = []
    for example in (test for test in found if test.examples):
        place = tmp_path / example.name
        place.mkdir()
        monkeypatch.chdir(place)
        doctest.DocTestRunner(optionflags=OPTIONS, verbose=False).run(example, out=report.append)
    assert report == []
    text = inspect.getsource(module)
    assert sum(len(test.examples) for test in found) == sum(
        line.lstrip().startswith(">>>") for line in text.splitlines()
    )


def test_what_a_user_calls_first_has_an_example() -> None:
    public = {name: getattr(asperity, name) for name in asperity.__all__}
    called = {n: o for n, o in public.items() if callable(o) and not (inspect.isclass(o) and issubclass(o, Exception))}
    assert len(called) > 20
    assert [name for name, thing in called.items() if ">>> " not in (thing.__doc__ or "")] == []
