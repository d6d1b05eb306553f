"""Thousands of inputs: each runs or is refused with one sentence and exit code 2; never a traceback.

`./run pytest tests/hard/test_fuzz.py -m slow --hypothesis-show-statistics` counts how many of each there were.
"""

from __future__ import annotations

import io
import math
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from element_sample import cubes
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st

from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import AsperityError, CheckError, ConvergenceError, InputError
from asperity.job.run_case import run
from asperity.mesh.block import BlockMesh
from asperity.surface import Flat

ROOT = Path(__file__).parents[2]
TEXTS = tuple(path.read_bytes() for path in sorted((ROOT / "cases").glob("*.toml")))
File = tuple[str, bytes]  # suffix and content


def refused(error: AsperityError) -> None:
    """A refusal is one sentence and exit code 2."""
    text = str(error)
    assert isinstance(error, InputError) and error.exit_code == 2, repr(error)
    assert text and "\n" not in text and text.isprintable() and len(text) < 1000
    event(f"refused ({type(error).__name__})")


def holds(property_: Callable[[Any], None], inputs: st.SearchStrategy[Any], number: int, fixed: bool) -> None:
    """Try a property on a number of inputs without a time limit: always the same, or random ones."""
    settings(
        max_examples=number, derandomize=fixed, deadline=None, suppress_health_check=list(HealthCheck), database=None
    )(given(inputs)(property_))()


def few_and_many(few: int, many: int) -> pytest.MarkDecorator:
    """A few fixed inputs, and as a slow test many different ones each time."""
    slow = pytest.param(many, False, marks=pytest.mark.slow, id="many")
    return pytest.mark.parametrize(("number", "fixed"), [pytest.param(few, True, id="few"), slow])


# --- whole runs ------------------------------------------------------------------------------------------------


@st.composite
def mutated(draw: st.DrawFn, texts: tuple[bytes, ...] = TEXTS) -> bytes:
    """A text with bytes replaced, removed, repeated, or inserted from another text."""
    data = bytearray(draw(st.sampled_from(texts)))
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        length = draw(st.integers(0, 12))
        other = draw(st.sampled_from(texts))
        start = draw(st.integers(0, len(other)))
        put = draw(
            st.sampled_from([other[start : start + length], data[at : at + length] * 2, b""]) | st.binary(max_size=4)
        )
        data[at : at + length] = put
    return bytes(data)


def accepts(case: Case) -> bool:
    """Whether a case passes all checks of `asperity run` before its start."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            case.problem()
        except InputError as error:
            refused(error)
            return False
    event("accepted")
    return True


def spread(low: float, high: float) -> st.SearchStrategy[float]:
    """Positive numbers, uniform in their logarithm."""
    return st.floats(math.log(low), math.log(high)).map(math.exp)


L = 1e-6
Strategies = dict[str, st.SearchStrategy[Any]]
FRACTAL: Strategies = {
    "D": st.floats(2.001, 2.999), "G": spread(1e-16, 1e-8), "kind": st.just("weierstrass-mandelbrot")
}  # fmt: skip
FRACTAL_MORE: Strategies = {
    "M": st.integers(1, 40), "gamma": st.floats(1.01, 5.0), "f_max": st.integers(0, 12), "seed": st.integers(0, 10**6)
}  # fmt: skip
WAVE: Strategies = {"amplitude": spread(1e-8 * L, L), "dims": st.integers(1, 2), "kind": st.just("sinusoid")}
SPHERE: Strategies = {"radius": spread(1e-2 * L, 1e4 * L), "kind": st.just("sphere")}
SURFACES: st.SearchStrategy[dict[str, Any]] = st.one_of(
    st.fixed_dictionaries(FRACTAL, optional=FRACTAL_MORE),
    st.fixed_dictionaries(SPHERE),
    st.fixed_dictionaries(WAVE, optional={"wavelength": spread(0.05 * L, 10 * L)}),
    st.just({"kind": "flat"}),
)


@st.composite
def cases(draw: st.DrawFn) -> dict[str, Any]:
    """Tables of legal values over their whole ranges."""
    E = draw(spread(1e5, 1e12))
    solid: dict[str, Any] = {"E": E, "nu": draw(st.floats(-0.9, 0.495))}
    if draw(st.booleans()):
        solid["yield_strength"] = E * draw(spread(1e-6, 0.9))
        if draw(st.booleans()):
            solid["tangent_modulus"] = E * draw(st.floats(0.0, 0.99))
    contact = draw(st.sampled_from([{}, {"method": "penalty"}, {"method": "nitsche"}]))
    driven = {"delta_max": L * draw(spread(1e-7, 0.5))}
    if draw(st.integers(0, 4)) == 0:
        driven = {"force_max": E * L**2 * draw(spread(1e-12, 0.3))}
    wanted = {}
    if draw(st.integers(0, 9)) == 0:
        wanted = {"tolerance": draw(spread(1e-3, 0.9)), "max_dofs": draw(st.integers(1000, 20_000))}
    return {
        "surface": {"L": L, **draw(SURFACES)},
        "accuracy": wanted,
        "material": solid,
        "block": {"height": L * draw(spread(0.05, 2.0)), "sides": draw(st.sampled_from(["rollers", "free"]))},
        "contact": contact,
        "mesh": {"h_contact": 0.4 * L, "h_max": 0.5 * L, "growth": 1.0},
        "loading": driven | {
            "steps": draw(st.integers(1, 2)), "unload": draw(st.booleans()), "cycles": draw(st.integers(1, 2)),
            "integrator": draw(st.sampled_from(["midpoint", "backward-euler"])),
        },
        "solver": {"newton_max": 15}, "output": {"checkpoint": 0},
    }  # fmt: skip


def any_case_runs_or_says_why_not(tables: dict[str, Any]) -> None:
    with tempfile.TemporaryDirectory() as place:
        try:
            case = Case.from_dict(tables)
        except InputError as error:
            return refused(error)
        if not accepts(case):
            return
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                run(case, Path(place) / "out")
            except InputError as error:
                return refused(error)
            except CheckError as error:  # on such a coarse mesh the contact may be too soft, or missing
                assert "raise contact.penalty" in str(error) or "no node is touched" in str(error)
                event("unresolved")
                return
            except ConvergenceError as error:
                assert "\n" not in str(error)
                Curve.read(Path(place) / "out/curve.csv")
                event("stopped")
                return
        event("ran")


@few_and_many(3, 100)
def test_any_case_runs_or_says_why_not(number: int, fixed: bool) -> None:
    holds(any_case_runs_or_says_why_not, cases(), number, fixed)


# --- files: case files, height maps, meshes, curves -----------------------------------------------------------

NUMBERS = st.floats() | st.floats(-1e-7, 1e-7) | st.sampled_from([math.nan, math.inf, 1e308, 5e-324, 0.0])
ARRAYS = st.one_of(
    st.lists(NUMBERS, max_size=40).map(np.array),
    st.tuples(st.integers(0, 12), st.integers(0, 12), st.integers(0, 2**32 - 1)).map(
        lambda s: 1e-8 * np.random.default_rng(s[2]).standard_normal(s[:2])
    ),
    st.tuples(st.integers(4, 9), st.lists(NUMBERS, min_size=1, max_size=4)).map(
        lambda s: np.resize(np.array(s[1]), (s[0], s[0]))
    ),
    st.sampled_from(
        [
            np.array(3.0), np.array("text"), np.array([["a", "b"]] * 4), np.zeros((5, 5), dtype=complex),
            np.zeros((5, 5), dtype=[("a", float)]), np.zeros((6, 6, 3), dtype=np.uint8), np.eye(6, dtype=bool),
            np.array([[None] * 5] * 5, dtype=object),
        ]
    ),
)  # fmt: skip


def saved(write: Callable[..., None], *args: Any, **named: Any) -> bytes:
    buffer = io.BytesIO()
    write(buffer, *args, **named)
    return buffer.getvalue()


CSV = st.lists(st.lists(st.floats() | st.text(max_size=5), max_size=6), max_size=8).map(
    lambda rows: "\n".join(",".join(map(str, row)) for row in rows).encode("utf-8", "surrogatepass")
)
AXES = st.just(np.linspace(0.0, 1e-6, 6)) | ARRAYS
MAPS = st.one_of(
    ARRAYS.map(lambda z: (".npy", saved(np.save, z))),
    ARRAYS.map(lambda z: (".npz", saved(np.savez, z=z))),
    st.tuples(ARRAYS, AXES, AXES).map(lambda a: (".npz", saved(np.savez, z=a[0], x=a[1], y=a[2]))),
    st.tuples(ARRAYS, ARRAYS).map(lambda a: (".npz", saved(np.savez, z=a[0], L=a[1]))),
    st.tuples(st.sampled_from([".npy", ".npz", ".csv", ".txt"]), st.binary(max_size=200)),
    st.tuples(st.just(".npy"), mutated((saved(np.save, np.full((6, 6), 1e-8)),))),
    st.tuples(st.just(".npz"), mutated((saved(np.savez, z=np.full((6, 6), 1e-8), L=1e-6),))),
    CSV.map(lambda text: (".csv", text)),
    CSV.map(lambda text: (".csv", b"x,y,z\n" + text)),
)


BLOCK = cubes(2)


@st.composite
def meshes(draw: st.DrawFn) -> bytes:
    """A mesh with one of its arrays replaced, or with a few of its numbers or rows changed."""
    arrays: dict[str, Any] = dict(vars(BLOCK))
    name = draw(st.sampled_from(sorted(arrays)))
    if draw(st.booleans()):
        arrays[name] = draw(ARRAYS)
        return saved(np.savez, **arrays)
    points, tets = BLOCK.points.copy(), BLOCK.tets.copy()
    for _ in range(draw(st.integers(0, 2))):
        row, other = (draw(st.integers(0, len(tets) - 1)) for _ in range(2))
        change = draw(st.sampled_from(["remove", "repeat", "swap", "rename", "move", "add"]))
        if change == "remove":
            tets = np.delete(tets, row, axis=0)
        elif change == "repeat":
            tets = np.concatenate([tets, tets[row : row + 1]])
        elif change == "swap":
            tets[row] = np.roll(tets[row], draw(st.integers(0, 9)))
        elif change == "rename":
            tets[row, draw(st.integers(0, 9))] = draw(st.integers(-1, len(points)))
        elif change == "move":
            points[draw(st.integers(0, len(points) - 1))] += draw(st.floats(-1.0, 1.0))
        else:
            points = np.concatenate([points, points[other : other + 1]])
    return saved(np.savez, **(arrays | {"points": points, "tets": tets}))


def read_map(path: Path) -> None:
    for side in ({}, {"L": 1e-6}):
        surface = {"kind": "file", "path": path.name, **side}
        tables = {"surface": surface, "material": {"E": 2e11, "nu": 0.3}, "loading": {"delta_max": 1e-8}}
        try:
            case = Case.from_dict(tables, folder=path.parent)
        except InputError as error:
            refused(error)
            continue
        if accepts(case):
            made = case.surface
            assert math.isfinite(made.maximum()[2]) and math.isfinite(made.rms_slope())


def read_mesh(path: Path) -> None:
    block = BlockMesh.read(path)
    block.check(Flat(L=1.0))
    assert 0 <= block.tets.min() and block.tets.max() < len(block.points)
    a, b, c, d = np.moveaxis(block.points[block.tets[:, :4]], 1, 0)
    volume = np.abs(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)).sum() / 6.0
    assert volume >= 1.0 - 1e-9  # the block is filled: overlapping tetrahedra are refused by the solver


#: What reads a file, or raises an InputError, and files.
READERS: dict[str, tuple[Callable[[Path], object], st.SearchStrategy[File]]] = {
    "case": (lambda path: accepts(Case.load(path)), mutated().map(lambda data: (".toml", data))),
    "map": (read_map, MAPS),
    "mesh": (read_mesh, (meshes() | mutated((saved(np.savez, **vars(BLOCK)),))).map(lambda data: (".npz", data))),
}


@few_and_many(60, 3000)
@pytest.mark.parametrize("kind", READERS)
def test_any_file_is_read_or_refused(kind: str, number: int, fixed: bool) -> None:
    read, files = READERS[kind]

    def is_read_or_refused(file: File) -> None:
        with tempfile.TemporaryDirectory() as place, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            path = Path(place) / f"given{file[0]}"
            path.write_bytes(file[1])
            try:
                read(path)
                event("accepted")
            except InputError as error:
                refused(error)

    holds(is_read_or_refused, files, number, fixed)


# --- nothing is unpickled -------------------------------------------------------------------------------------


class Bomb:
    """Unpickling it has a visible side effect."""

    def __init__(self, mark: Path) -> None:
        self._mark = mark

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self._mark,)


@pytest.mark.parametrize("suffix", [".npy", ".npz"])
def test_no_file_is_unpickled(tmp_path: Path, suffix: str) -> None:
    from asperity.quasistatic.checkpoint import Checkpoint
    from asperity.surface.scans import HeightField

    mark, path = tmp_path / "mark", tmp_path / f"evil{suffix}"
    evil = np.array([[Bomb(mark)] * 5] * 5, dtype=object)
    if suffix == ".npy":
        np.save(path, evil, allow_pickle=True)
    else:
        np.savez(path, z=evil, L=1e-6, points=evil, tets=evil, side=1.0, height=1.0, meta=evil)
    folder = tmp_path / "checkpoint"
    folder.mkdir()
    (folder / "state.npz").write_bytes(path.read_bytes())
    from mpi4py import MPI

    for read in (
        lambda: Case.from_dict({"surface": {"kind": "file", "path": str(path), "L": 1e-6}}),
        lambda: BlockMesh.read(path),
        lambda: HeightField.read(path),
        Checkpoint(folder, {}, MPI.COMM_SELF).load,
    ):
        with pytest.raises(InputError) as caught:
            read()
        assert "\n" not in str(caught.value)
    assert not mark.exists()
