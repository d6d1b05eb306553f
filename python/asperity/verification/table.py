"""Rows of the verification table, and their error bars from meshes of three sizes."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from asperity.adaptive.solve_to_tolerance import steady
from asperity.arrays import Floats
from asperity.model.settings import MeshSize
from asperity.quasistatic.solve_contact import ContactResult, solve_contact
from asperity.runtime.files import replace_file
from asperity.surface import Surface

T = TypeVar("T")

RATIO = 2.0**0.5  # between the element sizes of successive meshes
FORCE = 3.0  # greatest order in the element size of a force: the edge of contact halves that of the strains to 3/2
KINK = 2.0  # with plasticity, for the strain has a kink where its zone ends
LOCAL = 1.0  # of areas, and of stresses and pressures next to the edge of contact, where they have no slope
SAFETY = 1.25  # on an extrapolated error with an observed order: Roache (1994)


@dataclass(frozen=True)
class Level:
    """How much is computed.

    Attributes:
        name: "quick" or "full"
        finest: factor by which the finest of the three meshes divides the element sizes of a case
        full: whether the cases take all their loads and variants
    """

    name: str
    finest: float
    full: bool

    @property
    def refinements(self) -> tuple[float, float, float]:
        """Factors of the three meshes, the finest last."""
        return self.finest / RATIO**2, self.finest / RATIO, self.finest


LEVELS = {"quick": Level("quick", RATIO, False), "full": Level("full", 2.0, True)}


@dataclass(frozen=True)
class Row:
    """One comparison with a reference.

    Attributes:
        case: name of the family
        quantity: what is compared, and where
        source: the reference, in words
        reference, value: the two numbers
        mesh: error that the discretisation allows, relative to `scale`
        theory: error that the reference allows for this problem (its own accuracy, finite slope), likewise
        scale: what errors are relative to; None for the reference, or one if that is zero
        at_least: whether only a value below the reference is an error
    """

    case: str
    quantity: str
    source: str
    reference: float
    value: float
    mesh: float
    theory: float = 0.0
    scale: float | None = None
    at_least: bool = False

    @property
    def error(self) -> float:
        """Distance of the value from the reference, relative to the scale."""
        scale = abs(self.reference) or 1.0 if self.scale is None else self.scale
        difference = self.reference - self.value
        return (max(difference, 0.0) if self.at_least else abs(difference)) / scale

    @property
    def bar(self) -> float:
        """The greatest error that is no contradiction."""
        return self.mesh + self.theory

    @property
    def passed(self) -> bool:
        """Whether the error is within the bar."""
        return self.error <= self.bar


COLUMNS = ("case", "quantity", "source", "reference", "value", "error", "bar", "mesh", "theory", "passed")


def write_csv(rows: Iterable[Row], path: Path) -> None:
    """Write a table of all columns at full precision."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    writer.writerows([getattr(row, name) for name in COLUMNS] for row in rows)
    replace_file(path, text.getvalue().encode())


def sizes(h: float, refinement: float, L: float = 1.0) -> MeshSize:
    """Element sizes of a case, all of them divided by a factor.

    Growth and greatest size shrink with the size in the contact: else the error of the elements around it stays.

    Args:
        h: size in the contact at refinement one [length]
        refinement: factor
        L: side of the block [length]
    """
    return MeshSize(h / refinement, growth=0.6 / refinement, h_max=0.25 * L / refinement)


def press(surface: Surface, *args: Any, **settings: Any) -> ContactResult:
    """`solve_contact` on this process alone."""
    from mpi4py import MPI

    return solve_contact(surface, *args, comm=MPI.COMM_SELF, **settings)


def on_meshes(level: Level, solve: Callable[[float], T]) -> list[T]:
    """What `solve` gives at the refinements of a level."""
    return [solve(refinement) for refinement in level.refinements]


def counting_error(result: ContactResult) -> float:
    """Relative error of the area of contact in the last state, see `top.Top.area_of`."""
    area = result.solver.contact.area()
    return area.error / area.value


def convergence_bar(values: Sequence[npt.ArrayLike], order: float = FORCE, ratio: float = RATIO) -> Floats:
    """Error bars of the last of three values at sizes that fall by `ratio`; loads along the first axis.

    The grid convergence index (Roache, J. Fluids Eng. 116 (1994) 405) with the observed order, between one and the
    greatest that theory allows. Where the differences do not fall that fast, scatter from mesh to mesh hides the
    order, and the first one is assumed between the outer two. A difference that happens to vanish is replaced by the
    rms over its neighbours.
    """
    first, second, third = (np.atleast_1d(np.asarray(v, dtype=float)) for v in values)
    scale = np.maximum(np.abs(third), np.finfo(float).tiny)
    pairs = (first, second), (second, third), (first, third)
    before, after, both = (scale * steady((a - b) / scale, 1) for a, b in pairs)
    with np.errstate(divide="ignore", invalid="ignore"):
        observed = np.log(before / after) / np.log(ratio)
        extrapolated = after / (ratio ** np.minimum(observed, order) - 1.0)
    return SAFETY * np.where(observed >= 1.0, extrapolated, np.maximum(after, both / (ratio**2 - 1.0)))


def norm_bar(values: Sequence[npt.ArrayLike], order: float, ratio: float = RATIO) -> Floats:
    """Greatest last one of three error norms at sizes that fall by `ratio`: the norms must fall at least with `order`.

    A norm scatters with where the edge of contact cuts the elements, so the coarser two are both asked.
    """
    first, second, _ = (np.atleast_1d(np.asarray(v, dtype=float)) for v in values)
    return SAFETY * np.maximum(first / ratio ** (2.0 * order), second / ratio**order)


def rows_along(
    case: str,
    quantities: Iterable[str],
    source: str,
    values: Sequence[npt.ArrayLike],
    references: npt.ArrayLike,
    theory: npt.ArrayLike = 0.0,
    scale: float | None = None,
    order: float = FORCE,
    counted: npt.ArrayLike = 0.0,
) -> list[Row]:
    """Rows of a quantity at several loads (n,), computed on three meshes.

    Args:
        case, source, scale: as in `Row`
        quantities: a name for each load
        values: three arrays (n,), the finest mesh last
        references: (n,); zero for the norm of an error
        theory: relative to the references or the scale, (n,) or one for all
        order: greatest order in the element size, FORCE or LOCAL
        counted: error of the finest values from counting facets, see `counting_error`, likewise; the bar is no less,
            for areas on unrelated meshes may agree by chance
    """
    references = np.atleast_1d(np.asarray(references, dtype=float))
    finest = np.atleast_1d(np.asarray(values[-1], dtype=float))
    bars = np.where(references == 0.0, norm_bar(values, order), convergence_bar(values, order))
    bars = np.maximum(bars, np.asarray(counted, dtype=float) * np.abs(finest))
    theory = np.broadcast_to(np.asarray(theory, dtype=float), references.shape)
    out = []
    for name, reference, value, bar, other in zip(quantities, references, finest, bars, theory, strict=True):
        unit = abs(reference) or 1.0 if scale is None else scale
        out.append(Row(case, name, source, float(reference), float(value), float(bar / unit), float(other), scale))
    return out
