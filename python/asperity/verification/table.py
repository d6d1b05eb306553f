"""Rows of the verification table, and their error bars from meshes of three sizes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from asperity.adaptive.extrapolation import steady
from asperity.adaptive.solve_contact import solve_contact
from asperity.arrays import Floats
from asperity.model.settings import MeshSize
from asperity.quasistatic.contact_result import ContactResult
from asperity.surface import Surface

T = TypeVar("T")

RATIO = 2.0**0.5  # of the element sizes of successive meshes
FORCE = 3.0  # greatest order of a force in the element size: the edge of contact limits that of the strains to 3/2
KINK = 2.0  # the same with plasticity, because the strain has a kink at the edge of the plastic zone
LOCAL = 1.0  # of areas, and of stresses and pressures at the edge of contact, where their slope is infinite
REFINEMENTS = (1.0 / RATIO, 1.0, RATIO)  # factors that divide the element sizes of a case, for its three meshes
SAFETY = 1.25  # safety factor of an extrapolated error with an observed order: Roache (1994)


@dataclass(frozen=True)
class Row:
    """One comparison with a reference.

    Attributes:
        case: name of the verification case
        quantity: the compared quantity and its load
        source: origin of the reference
        reference, value: reference and computed value
        mesh: error of the discretisation, relative to the reference, or absolute where that is zero
        theory: error of the reference for this problem (its accuracy, finite slope), likewise
    """

    case: str
    quantity: str
    source: str
    reference: float
    value: float
    mesh: float
    theory: float = 0.0

    @property
    def error(self) -> float:
        """Distance of the value from the reference, relative to it, or absolute where it is zero."""
        return abs(self.reference - self.value) / (abs(self.reference) or 1.0)

    @property
    def bar(self) -> float:
        """Greatest error that is compatible with the reference."""
        return self.mesh + self.theory

    @property
    def passed(self) -> bool:
        """Whether the error is within the bar."""
        return self.error <= self.bar


def sizes(h: float, refinement: float) -> MeshSize:
    """Element sizes of a case, h in the contact at refinement 1 [L], all divided by the same factor.

    Growth and greatest size are divided too; otherwise the error of the elements around the contact would remain.
    """
    return MeshSize(h / refinement, growth=0.6 / refinement, h_max=0.25 / refinement)


def solve_on_one_rank(surface: Surface, *args: Any, **settings: Any) -> ContactResult:
    """Call `solve_contact` on this rank alone."""
    from mpi4py import MPI

    return solve_contact(surface, *args, comm=MPI.COMM_SELF, **settings)


def on_meshes(solve: Callable[[float], T]) -> list[T]:
    """Results of `solve` for the three refinements."""
    return [solve(refinement) for refinement in REFINEMENTS]


def counting_error(result: ContactResult) -> float:
    """Relative error of the contact area in the last state, from the facets cut by its edge."""
    solver = result.solver
    area = solver.contact_surface.area_of(*solver.contact.touched())
    return area.error / area.value


def convergence_bar(values: Sequence[npt.ArrayLike], order: float = FORCE) -> Floats:
    """Error bars (n,) of the last of three values (n,) at n loads, for element sizes that decrease by `RATIO`.

    The grid convergence index (Roache, J. Fluids Eng. 116 (1994) 405) with the observed order, limited to between 1
    and the greatest order of theory. If the differences do not decrease that fast, scatter from mesh to mesh hides the
    order, and order 1 is assumed between the first and the last value. Differences that vanish by chance are replaced
    by the rms over their neighbours.
    """
    first, second, third = (np.atleast_1d(np.asarray(v, dtype=float)) for v in values)
    scale = np.maximum(np.abs(third), np.finfo(float).tiny)
    pairs = (first, second), (second, third), (first, third)
    before, after, both = (scale * steady((a - b) / scale, 1) for a, b in pairs)
    with np.errstate(divide="ignore", invalid="ignore"):
        observed = np.log(before / after) / np.log(RATIO)
        extrapolated = after / (RATIO ** np.minimum(observed, order) - 1.0)
    return SAFETY * np.where(observed >= 1.0, extrapolated, np.maximum(after, both / (RATIO**2 - 1.0)))


def norm_bar(values: Sequence[npt.ArrayLike], order: float) -> Floats:
    """Upper bounds (n,) of the last of three error norms (n,) that decrease at least with `order`.

    A norm scatters with the position of the edge of contact in the elements, so both coarser norms are used.
    """
    first, second, _ = (np.atleast_1d(np.asarray(v, dtype=float)) for v in values)
    return SAFETY * np.maximum(first / RATIO ** (2.0 * order), second / RATIO**order)


def rows_along(
    case: str,
    quantities: Iterable[str],
    source: str,
    values: Sequence[npt.ArrayLike],
    references: npt.ArrayLike,
    theory: npt.ArrayLike = 0.0,
    order: float = FORCE,
    counted: npt.ArrayLike = 0.0,
) -> list[Row]:
    """Rows of a quantity at several loads (n,), computed on three meshes.

    Args:
        case, source: as in `Row`
        quantities: a name for each load
        values: three arrays (n,), the finest mesh last
        references: (n,); zero for the norm of an error
        theory: error of the references, relative to them, (n,) or scalar
        order: greatest order in the element size: FORCE, KINK or LOCAL
        counted: counting error of the finest values, see `counting_error`, (n,) or scalar; a lower limit of the bar,
            because areas on unrelated meshes may agree by chance
    """
    references = np.atleast_1d(np.asarray(references, dtype=float))
    finest = np.atleast_1d(np.asarray(values[-1], dtype=float))
    bars = np.where(references == 0.0, norm_bar(values, order), convergence_bar(values, order))
    bars = np.maximum(bars, np.asarray(counted, dtype=float) * np.abs(finest))
    theory = np.broadcast_to(np.asarray(theory, dtype=float), references.shape)
    out = []
    for name, reference, value, bar, other in zip(quantities, references, finest, bars, theory, strict=True):
        mesh = float(bar / (abs(reference) or 1.0))
        out.append(Row(case, name, source, float(reference), float(value), mesh, float(other)))
    return out
