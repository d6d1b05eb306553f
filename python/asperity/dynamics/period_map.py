"""The period map: where a motion is after a time, with derivatives, extremes and first harmonic; compiled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.dynamics.equation import Equation
from asperity.errors import CompatError

try:
    from asperity import _period_map
except ImportError as error:
    raise CompatError(
        f"the compiled period map cannot be loaded ({error}): install asperity again, or use ./run"
    ) from None

TURN = 2.0 * np.pi
ESCAPE = 1e3  # displacement beyond which motion has left a Taylor well
_FARTHEST = 1e13  # of a flight
_COLUMNS = 27  # of the rows that the compiled map returns


@dataclass(frozen=True)
class Motions:
    """Ends of motions (lanes, ...), NaN where one escapes; derivatives are those by u, v and the parameter.

    Attributes:
        end, by_end: state u, v (lanes, 2), and its derivatives (lanes, 2, 3)
        high, low: largest and smallest displacement, and its derivatives (lanes, 4)
        wave: integrals of u cos s and u sin s over the phase, and their derivatives (lanes, 2, 4)
        damping: integral of g over the time (lanes,)
        error: sum of the local errors (lanes,)
        steps: of the integrator, all lanes, rejected ones and those of motions that escape included
    """

    end: Array
    by_end: Array
    high: Array
    low: Array
    wave: Array
    damping: Array
    error: Array
    steps: float


def motions(
    equation: Equation,
    states: ArrayLike,
    omega: ArrayLike,
    forcing: ArrayLike,
    *,
    grows: ArrayLike = 0.0,
    start: ArrayLike = 0.0,
    length: ArrayLike = TURN,
    rtol: float = 1e-9,
    by_forcing: bool = False,
    derivatives: bool = True,
) -> Motions:
    """Integrate states (lanes, 2) from a phase Omega tau over a length of it; the parameter is Omega, or F^.

    `grows` is the derivative of F^ with respect to Omega.
    """
    y = np.asarray(states, float).reshape(-1, 2)
    lanes = np.empty((len(y), 7))
    lanes[:, :2] = y
    for i, values in enumerate((omega, forcing, grows, start, length)):
        lanes[:, 2 + i] = values
    r = equation.restoring
    out = np.empty((len(y), _COLUMNS))
    limit = _FARTHEST if r.contact else ESCAPE
    numbers = (1.0 / r.n_loc, equation.of_force, equation.zeta, limit, rtol)
    _period_map.period_map(*equation.cells, *numbers, by_forcing, derivatives, lanes, out)
    columns = out[:, 2:8].reshape(-1, 3, 2).transpose(0, 2, 1)
    wave = out[:, 16:24].reshape(-1, 2, 4)
    return Motions(
        out[:, :2], columns, out[:, 8:12], out[:, 12:16], wave, out[:, 24], out[:, 25], float(out[:, 26].sum())
    )
