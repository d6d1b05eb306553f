"""Any change of a legal case gives the case or one sentence with the key, and a script is refused in the same words."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import asperity as asp
from asperity.case import Case
from asperity.case.case_file import input_reference
from asperity.case.tables import GONE, SECTIONS
from asperity.errors import InputError
from asperity.model.problem import Problem
from asperity.runtime.display import show
from asperity.surface import Surface

CASES = sorted((Path(__file__).parents[2] / "cases").glob("*.toml"))
DEMO = CASES[0].parent / "single.toml"
PAIRS = sorted({(section.split()[0] if section else "", key) for section, key, *_ in input_reference()})
NUMBERS = st.one_of(st.integers(), st.floats(), st.sampled_from([10**400, -1e308, 1e-320, 1e-9, 0, 1, 0.3, 1e9]))
VALUES = st.one_of(
    st.none(), st.booleans(), NUMBERS, st.text(max_size=8), st.lists(NUMBERS, max_size=3),
    st.sampled_from([np.int64(3), np.float32(0.3), np.bool_(True), np.array(2.5)]),
    st.sampled_from(["sphere", "flat", "file", "exact", "free", "auto", "j2", "law.py:f", "5 N", "9 kHz"]),
    st.dictionaries(st.text(max_size=3), st.integers(), max_size=2),
)  # fmt: skip


def table_of(data: dict[str, Any], section: str) -> dict[str, Any]:
    """A section of a case, which may be new; the case itself without a name."""
    table: dict[str, Any] = (
        data.setdefault(section, {"friction": 0.3} if section == "slip" else {}) if section else data
    )
    return table


def outcome(data: dict[str, Any], *changed: str) -> Case | str:
    """The case, or the sentence that refuses it, which names a key that was changed."""
    try:
        case = Case.from_dict(data)
    except InputError as error:
        message = str(error)
        assert len(message) < 600 and message.isprintable() and message.startswith("case: ")
        assert any(name in message for name in changed), message
        return message
    assert Case.from_dict(case.to_dict()) == case
    return case


@settings(max_examples=400, deadline=None, derandomize=True)
@given(st.sampled_from(CASES), st.lists(st.tuples(st.sampled_from(PAIRS), VALUES), min_size=1, max_size=4))
def test_any_values_of_keys_give_a_case_or_a_name(path: Path, changes: list[Any]) -> None:
    """Also values of another type, extreme ones, and None, which leaves the key out."""
    data = Case.load(path).to_dict()
    for (section, key), value in changes:
        table_of(data, section)[key] = value
    outcome(data, *(f"{section}.{key}" if section else key for (section, key), _ in changes))


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.sampled_from(["surface", "mesh", "loading", "slip", "nonsense", ""]), st.text(min_size=1, max_size=9), VALUES)
def test_any_extra_key_or_section_is_named(section: str, key: str, value: object) -> None:
    data = Case.load(DEMO).to_dict()
    table_of(data, section)[key] = value
    name = ".".join(filter(None, (section, key)))
    known = (section, key) in PAIRS or key in (*data, "kind") or value is None
    assert known or isinstance(outcome(data, name, show(name), section or name), str)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.sampled_from([pair for pair in PAIRS if pair[0] and len(pair[1]) > 4]), st.integers(0, 3))
def test_a_misspelt_key_is_named_with_the_one_meant(pair: tuple[str, str], at: int) -> None:
    section, key = pair
    data: Any = Case.load(DEMO).to_dict()
    kinds = [m for m in input_reference() if m[0].startswith("surface (") and m[1] == key]
    if section == "surface" and not any("weier" in m[0] for m in kinds):
        return
    wrong = key[: at + 1] + "x" + key[at + 1 :]
    table_of(data, section)[wrong] = 1
    assert f'did you mean "{key}"' in str(outcome(data, f"{section}.{wrong}"))
    del data[section][wrong]
    data[f"{section[:2]}x{section[2:]}"] = data.pop(section)
    assert f'did you mean "{section}"' in str(outcome(data, "x"))


def test_keys_of_version_1_are_refused_with_what_takes_their_place() -> None:
    page = (CASES[0].parents[1] / "docs/migration.md").read_text(encoding="utf-8")
    rows = page.partition("\n## Keys\n")[2].partition("\n## ")[0]
    named = {".".join(pair).strip(".") for pair in PAIRS} | set(SECTIONS)
    gone = set(re.findall(r"^\| `([a-z_.]+)`", rows, re.MULTILINE)) - named
    assert gone == set(GONE)
    for name in gone:
        section, _, key = name.rpartition(".")
        data = Case.load(DEMO).to_dict()
        table_of(data, section)[key] = {} if name == "loops" else 3
        assert f"{name} is a key of version 1: " in str(outcome(data, name))


CLASSES = {name: cls for name, cls in SECTIONS.items() if name != "surface"}


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.sampled_from(CASES), st.sampled_from([p for p in PAIRS if p[0] in CLASSES]), VALUES)
def test_a_script_is_refused_in_the_words_of_a_case(path: Path, pair: tuple[str, str], value: Any) -> None:
    """The class of a section takes what a case takes; the case may refuse more, which needs other sections."""
    (section, key), data = pair, Case.load(path).to_dict()
    if (section, key) == ("material", "law"):
        return  # a file that the case looks for
    table = table_of(data, section)
    table[key] = value
    if value is None:
        del table[key]
    if section == "loading":
        data.pop("joint", None)  # whose preload may be the load of a case
    try:
        CLASSES[section](**table)
    except InputError as error:
        assert str(error) == str(outcome(data, key)).removeprefix("case: ")
        assert key in str(error) or "give exactly one" in str(error)


SOLVED = ("surface", "material", "block", "contact", "mesh", "loading", "solver")
MADE = [pair for pair in PAIRS if pair[0] in SOLVED and pair not in (("material", "law"), ("mesh", "file"))]


def of_script(data: dict[str, Any]) -> Problem:
    """The problem of a case as a script makes it."""
    surface, material, block, contact, mesh, loading, solver = (dict(data.get(name, {})) for name in SOLVED)
    return Problem.of(
        Surface.from_spec(**surface), asp.Material(**material), size=asp.MeshSize(**mesh),
        formulation=asp.Formulation(**contact), options=asp.SolverOptions(**solver), **block, **loading,
    )  # fmt: skip


def verdicts(data: dict[str, Any], key: str) -> list[str]:
    """What a script and a case say of the same tables, "" where they accept them; a refusal names the key."""
    said = []
    for make in (of_script, lambda data: Case.from_dict(data | {"units": "other"}).problem()):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                make(data)
                said.append("")
            except InputError as error:
                said.append(str(error))
                assert key in said[-1] or "give exactly one" in said[-1]
    return said


def solved(path: Path) -> dict[str, Any]:
    """The sections of a case that a script has too."""
    return {name: table for name, table in Case.load(path).to_dict().items() if name in SOLVED}


ELASTIC = [path for path in CASES if path.stem in ("hertz", "sinusoid", "self_affine", "penalty")]


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.sampled_from(ELASTIC), st.sampled_from(MADE), VALUES)
def test_a_script_is_refused_where_a_case_is(path: Path, pair: tuple[str, str], value: Any) -> None:
    data, (section, key) = solved(path), pair
    data[section].pop(key, None)
    if value is not None:
        data[section][key] = value
    said = verdicts(data, key)
    assert bool(said[0]) == bool(said[1]), said


@pytest.mark.parametrize("path", ELASTIC, ids=lambda path: path.stem)
def test_a_quantity_in_another_unit_is_refused_by_both_or_by_none(path: Path) -> None:
    """Metres for micrometres and Pa for MPa, of each number; of sizes and approach always."""
    for section, table in solved(path).items():
        for key, value in table.items():
            for factor in (1e-6, 1e6) if isinstance(value, float) else ():
                data = solved(path)
                data[section][key] = value * factor
                said = verdicts(data, key)
                assert bool(said[0]) == bool(said[1]), (section, key, factor, said)
                assert said[0] or key not in ("height", "h_contact", "h_max", "delta_max"), (section, key, factor)
