"""The door of the compiled kernels: shapes, ranges and outputs that they refuse, laws."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import PLASTIC

from asperity import _solver
from asperity.fem.history import History
from asperity.fem.kernels import compiled, law_of
from asperity.mesh import element

KERNELS = [name for name in dir(_solver) if name[0].islower() and callable(getattr(_solver, name))]
NODES = 10

Arguments = dict[str, Any]


def zeros(rows: int, points: int) -> Any:
    """A history that the compiled kernels write into."""
    return compiled(History.zeros(rows, points))


def many(n: int) -> dict[str, Arguments]:
    """Legal arguments of each class and kernel, by name, for n separate tetrahedra that are the reference one."""
    rng = np.random.default_rng(0)
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    tet = np.concatenate([corners, [corners[[i, j]].mean(axis=0) for i, j in element.node_ends()[4:]]])
    x, cells = np.tile(tet, (n, 1)), np.arange(NODES * n, dtype=np.int32).reshape(n, NODES)
    reference, weights = element.quadrature(2)
    gradients = element.shape_gradients(reference)
    points = len(weights)
    indptr = np.arange(0, NODES**2 * n + 1, NODES, dtype=np.int32)
    indices = np.ascontiguousarray(np.repeat(cells, NODES, axis=0).ravel())
    values, u = rng.normal(size=9 * len(indices)), 0.1 * rng.normal(size=x.shape)

    facet_points, facet_weights = element.facet_quadrature(2)
    at_facets = [element.at_facet(k, facet_points) for k in range(4)]
    facet_gradients = np.stack([element.shape_gradients(p) for p in at_facets])
    shape = np.stack([element.shape_functions(p) for p in at_facets])
    quadrature = (n, len(facet_weights))

    upper = indices >= np.repeat(np.arange(NODES * n), NODES)
    upper_width = np.add.reduceat(upper, indptr[:-1], dtype=np.int32)
    upper_indptr = np.concatenate([[0], np.cumsum(upper_width)]).astype(np.int32)
    singles = {name: rng.normal(size=300 * n).astype(np.float32) for name in ("image", "free", "scaling")}
    parents = element.node_ends() + 4 * np.arange(n)[:, None, None]
    coarse = np.ascontiguousarray(np.repeat(np.arange(4 * n, dtype=np.int32).reshape(n, 4), 4, axis=0).ravel())
    graph: Arguments = dict(indptr=indptr, indices=indices)
    upper_graph: Arguments = dict(indptr=upper_indptr, indices=indices[upper])

    out: dict[str, Arguments] = {
        "Cells": dict(x=x, x_dofs=cells, u_dofs=cells, gradients=gradients, weights=weights),
        "History": dict(
            plastic_strain=np.zeros((n, points, 6)), accumulated=np.zeros((n, points)), dilatation=np.zeros((n, points))
        ),
        "BlockPattern": dict(cell_dofs=cells, **graph),
        "HalfPattern": dict(cell_dofs=cells, **upper_graph),
        "Cholesky": dict(starts=indptr, rows=indices, order=np.arange(NODES * n, dtype=np.int32)),
        "Facets": dict(
            x=x, x_dofs=cells, u_dofs=cells, local=np.zeros(n, dtype=np.int32), gradients=facet_gradients,
            shape=shape, normals=element.area_vectors(), weights=facet_weights,
        ),
        "ContactLaw": dict(
            material=law_of(PLASTIC), finite=False, stiffness=np.ones(n), height=np.ones(quadrature), traction=True,
            cells=_solver.Cells(x, cells, cells, gradients, weights),
            linear=np.stack([element.linear_through(reference, p) for p in at_facets]),
        ),
    }  # fmt: skip
    made = {name: getattr(_solver, name)(**arguments) for name, arguments in out.items()}
    at: Arguments = dict(cells=made["Cells"])
    law = law_of(PLASTIC)
    history: Arguments = dict(committed=made["History"])
    trial = zeros(n, points)
    matrix: Arguments = dict(pattern=made["BlockPattern"], values=values.copy())
    half: Arguments = dict(pattern=made["HalfPattern"], values=np.zeros(9 * upper.sum(), dtype=np.float32))
    on: Arguments = dict(facets=made["Facets"])
    held = {name: zeros(*quadrature) for name in ("committed", "trial")}
    below = dict(below=made["History"])
    pressure = np.ones(quadrature)
    stiffness: dict[str, Arguments] = {
        "stiffness_elastic": at | dict(law=law),
        "stiffness_consistent": at | dict(law=law, finite=False, u=u, **history, marked=np.ones(n, dtype=bool)),
    }
    onto: Arguments = dict(
        kept=np.ones_like(u), parents=parents.reshape(-1, 2).astype(np.int32),
        coarse_indptr=np.arange(0, 16 * n + 1, 4, dtype=np.int32), coarse_indices=coarse,
        coarse_kept=np.ones((4 * n, 3)), coarse=np.empty(9 * len(coarse)),
    )  # fmt: skip
    out |= {name: arguments | matrix for name, arguments in stiffness.items()}
    out |= {f"{name} half": arguments | half for name, arguments in stiffness.items()}
    return out | {
        "volumes": at | dict(out=np.empty((n, points))),
        "min_jacobian": at | dict(out=np.empty(n)),
        "residual": at
        | dict(law=law, finite=False, u=u, **history, trial=trial, plastic=np.zeros(n, dtype=bool), b=np.zeros_like(u)),
        "stress": at | dict(law=law, finite=False, conjugate=False, u=u, **history, out=np.empty((n, points, 6))),
        "facet_weights": on | dict(out=np.empty(quadrature)),
        "facet_pressure": on
        | dict(law=made["ContactLaw"], z=0.0, u=u, **held, **below, pressure=pressure),
        "facet_load": on | dict(weights=np.ones(quadrature), pressure=pressure, b=np.zeros(NODES * n)),
        "facet_stiffness": on
        | dict(law=made["ContactLaw"], u=u, committed=held["committed"], **below, pressure=pressure)
        | matrix,
        "product": dict(**graph, values=values, x=u, y=np.empty_like(u)),
        "upper_half": dict(**graph, values=values, out=np.empty(9 * upper.sum(), dtype=np.float32)),
        "symmetric_product": dict(
            **upper_graph, blocks=np.ones(9 * upper.sum() + 1, dtype=np.float32),
            x=np.ones((NODES * n, 4), dtype=np.float32), y=np.empty((NODES * n, 4), dtype=np.float32),
        ),
        "relax": dict(
            **singles, keep=0.5, add=0.5,
            **{name: np.zeros(300 * n, dtype=np.float32) for name in ("residual", "step", "x")},
        ),
        "galerkin": dict(**graph, values=values) | onto,
        "symmetric_galerkin": dict(**upper_graph, blocks=np.ones(9 * upper.sum(), dtype=np.float32)) | onto,
    }  # fmt: skip


SMALL = many(3)


def kernel(name: str) -> Any:
    """The kernel or class of a name above, whose second word tells two uses apart."""
    return getattr(_solver, name.split()[0])


def spoilt(array: Any) -> dict[str, Any]:
    """The array with another shape in several ways."""
    return {
        "an axis more": array[None],
        "a row less": np.ascontiguousarray(array[:-1]),
        "a column less": np.ascontiguousarray(array[..., :-1]),
    }


LEGAL = {  # fewer cells need not have the whole graph; points are known to the facets only
    ("BlockPattern", "cell_dofs", "a row less"),
    ("ContactLaw", "height", "a column less"),
    ("HalfPattern", "cell_dofs", "a row less"),
}
CHANGES = [
    (name, key, how)
    for name, arguments in SMALL.items()
    for key, value in arguments.items()
    if isinstance(value, np.ndarray)
    for how in spoilt(value)
    if (name, key, how) not in LEGAL
]


def test_every_kernel_is_tried() -> None:
    assert set(KERNELS) == {name.split()[0] for name in SMALL if name[0].islower()}
    for name, arguments in SMALL.items():
        kernel(name)(**arguments)


@pytest.mark.parametrize(("name", "key", "how"), CHANGES)
def test_a_wrong_shape_is_refused(name: str, key: str, how: str) -> None:
    """The sentence gives the shape of the array and the expected one."""
    arguments = SMALL[name] | {key: spoilt(SMALL[name][key])[how]}
    with pytest.raises(ValueError, match=r"has shape \(.*\), expected \(|has entries from .*, expected"):
        kernel(name)(**arguments)


def test_the_array_is_named() -> None:
    arguments = SMALL["stress"] | {"u": np.zeros((7, 3))}
    with pytest.raises(ValueError, match=r"^u has shape \(7, 3\), expected \(at least 30, 3\)$"):
        _solver.stress(**arguments)


OTHERS = [
    (name, key)
    for name, arguments in SMALL.items()
    for key, value in arguments.items()
    if isinstance(value, _solver.History | _solver.BlockPattern | _solver.HalfPattern | _solver.ContactLaw)
]


@pytest.mark.parametrize(("name", "key"), OTHERS)
def test_objects_of_other_cells_are_refused(name: str, key: str) -> None:
    other = many(2)[name][key]
    with pytest.raises(ValueError, match=r"expected"):
        kernel(name)(**SMALL[name] | {key: other})


RANGES = [("Cells", "x_dofs"), ("Facets", "x_dofs"), ("Facets", "local"), ("BlockPattern", "cell_dofs")]
RANGES += [("HalfPattern", "cell_dofs"), ("Cholesky", "order")]
NEGATIVE = [("Cells", "u_dofs", -1), ("Facets", "u_dofs", -1)]


@pytest.mark.parametrize(("name", "key", "value"), [(*r, v) for r in RANGES for v in (-1, 30)] + NEGATIVE)
def test_numbers_outside_their_range_are_refused(name: str, key: str, value: int) -> None:
    changed = SMALL[name][key].copy()
    changed.flat[-1] = value
    with pytest.raises(ValueError, match=rf"^{key} has entries from .*{value}"):
        kernel(name)(**SMALL[name] | {key: changed})


def test_a_graph_without_the_nodes_of_a_cell_is_refused() -> None:
    graph = SMALL["BlockPattern"]
    with pytest.raises(ValueError, match="indices has no column 0 in row 0"):
        _solver.BlockPattern(**graph | {"indices": graph["indices"] + 1})
    falling = graph["indptr"].copy()
    falling[[3, 4]] = falling[[4, 3]]
    with pytest.raises(ValueError, match="indptr falls"):
        _solver.BlockPattern(**graph | {"indptr": falling})
    with pytest.raises(ValueError, match="indptr goes from 10 to 300"):
        _solver.product(**SMALL["product"] | {"indptr": graph["indptr"][1:]})


@pytest.mark.parametrize(
    ("name", "key"), [("volumes", "out"), ("residual", "b"), ("stiffness_elastic", "values"), ("relax", "x")]
)
def test_an_output_is_never_a_copy(name: str, key: str) -> None:
    """A kernel would write what it was given in another type to a copy, and nobody would see it."""
    given = SMALL[name][key]
    other = np.float32 if given.dtype == np.float64 else np.float64
    with pytest.raises(TypeError):
        kernel(name)(**SMALL[name] | {key: given.astype(other)})
