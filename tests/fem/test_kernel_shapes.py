"""The door of the compiled kernels: shapes, ranges and outputs that they refuse.

The legal arguments are those of small runs, recorded.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from conftest import PLASTIC, here, make_contact_solver
from element_sample import cubes

from asperity import _solver
from asperity.model.settings import Formulation, SolverOptions
from asperity.quasistatic.stiffness import Stiffness
from asperity.surface import Flat

USERS = [
    "fem.kernels", "fem.tangent", "contact.contact_surface", "contact.penalty_nitsche", "linear.matrix_free",
    "linear.multigrid",
]  # fmt: skip
OTHERS = {"J2", "SizeField", "Cholesky"}  # without shapes, or with tests of their own
NAMES = {name for name in dir(_solver) if callable(getattr(_solver, name)) and name[0] != "_"} - OTHERS

Call = tuple[str, tuple[Any, ...], dict[str, Any]]


class Recorder:
    """Stands for the compiled module, and keeps the first call of each name with each type of values."""

    def __init__(self) -> None:
        self.calls: dict[str, Call] = {}

    def __getattr__(self, name: str) -> Any:
        kernel = getattr(_solver, name)

        def call(*arguments: Any, **named: Any) -> Any:
            arguments, named = unwrapped(arguments), {key: unwrapped((value,))[0] for key, value in named.items()}
            kinds = [str(getattr(a, "dtype", "")) for a in arguments]
            self.calls.setdefault(f"{name} {kinds}", (name, arguments, named))
            return kernel(*arguments, **named)

        return call


def unwrapped(arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    """Arrays without the classes of other libraries."""
    return tuple(np.asarray(a) if isinstance(a, np.ndarray) else a for a in arguments)


def recorded(size: int) -> dict[str, Call]:
    """Calls of runs on a cube of `size` cells a side."""
    recorder, block = Recorder(), cubes(size)
    with pytest.MonkeyPatch.context() as patch:
        for module in USERS:
            patch.setattr(importlib.import_module(f"asperity.{module}"), "_solver", recorder)
        for method, linear in (("active-set", "cg"), ("nitsche", "cg"), ("active-set", "lu")):
            solver = make_contact_solver(
                here(), Flat(L=1.0), block, PLASTIC, formulation=Formulation(method), options=SolverOptions(linear)
            )
            solver.probes = (Stiffness(solver.solid),)
            assert solver.step(0.01).converged
    return recorder.calls


@pytest.fixture(scope="module")
def small() -> dict[str, Call]:
    return recorded(1)


def arrays(call: Call) -> Iterator[tuple[int | str, Any]]:
    """Place and value of each array of a call."""
    _, arguments, named = call
    given: dict[int | str, Any] = dict(enumerate(arguments)) | named
    for key, value in given.items():
        if isinstance(value, np.ndarray) and value.size:
            yield key, value


def first(calls: dict[str, Call], name: str) -> Call:
    """The first call of a name."""
    return next(call for call in calls.values() if call[0] == name)


def again(call: Call, key: int | str, value: Any) -> None:
    """Repeat a call with another argument."""
    name, arguments, named = call
    given: dict[int | str, Any] = dict(enumerate(arguments)) | named | {key: value}
    getattr(_solver, name)(*(given[k] for k in range(len(arguments))), **{k: given[k] for k in named})


#: Fewer cells need not have the whole graph: place of the array, and 0 for fewer rows.
LEGAL = {("BlockPattern", 0, 0), ("HalfPattern", 0, 0)}


def test_a_wrong_shape_is_refused(small: dict[str, Call]) -> None:
    """The sentence gives the shape of the array and the expected one; every kernel with an array is tried."""
    assert {name for name, *_ in small.values()} - OTHERS == NAMES
    taken = set()
    for call in small.values():
        for key, value in arrays(call):
            for spoilt in (value[None], np.ascontiguousarray(value[: len(value) // 2])):
                try:
                    again(call, key, spoilt)
                    taken.add((call[0], key, spoilt.ndim - value.ndim))
                except ValueError as error:
                    assert re.search(r"^\w+ has (shape \(.*\)|entries from .*), expected", str(error))
    assert taken == LEGAL


def test_objects_of_other_cells_are_refused(small: dict[str, Call]) -> None:
    other = recorded(2)
    for at, call in small.items():
        for key, value in enumerate(call[1]):
            if isinstance(value, _solver.History | _solver.BlockPattern | _solver.HalfPattern | _solver.ContactLaw):
                with pytest.raises(ValueError, match="expected"):
                    again(call, key, other[at][1][key])


def test_numbers_outside_their_range_are_refused(small: dict[str, Call]) -> None:
    tried = 0
    for call in small.values():
        for key, value in arrays(call):
            place, numbers = (call[0], key), 1 if (call[0], key) == ("Facets", 1) else 2
            if not (call[0][0].isupper() and value.dtype == np.int32 and value.ndim == numbers):
                continue
            points = place in (("Cells", 2), ("Facets", 0))  # whose number nothing tells there
            for wrong in (-1,) if points else (-1, 9999):
                changed = value.copy()
                changed.flat[-1] = wrong
                with pytest.raises(ValueError, match=rf"^\w+ has entries from .*{wrong}\b"):
                    again(call, key, changed)
                tried += 1
    assert tried >= 10


def test_a_graph_without_the_nodes_of_a_cell_is_refused(small: dict[str, Call]) -> None:
    call = first(small, "BlockPattern")
    _, indptr, indices = call[1]
    with pytest.raises(ValueError, match="indices has no column 0 in row 0"):
        again(call, 2, indices + 1)
    falling = indptr.copy()
    falling[[3, 4]] = falling[[4, 3]]
    with pytest.raises(ValueError, match="indptr falls"):
        again(call, 1, falling)
    with pytest.raises(ValueError, match="indptr goes from"):
        again(call, 1, indptr[1:])


@pytest.mark.parametrize("name", ["residual", "relax", "facet_pressure"])
def test_an_output_is_never_a_copy(small: dict[str, Call], name: str) -> None:
    """A kernel would write what it was given in another type to a copy, and nobody would see it."""
    call = first(small, name)
    given = call[1][-1]
    with pytest.raises(TypeError):
        again(call, len(call[1]) - 1, given.astype(np.float32 if given.dtype == np.float64 else np.float64))
