"""Equation of motion of a mass on a contact, and the compiled map that integrates it.

    u'' + 2 zeta g(u) u' + f(u) = F^ cos(Omega tau)

The displacements are cut into cells, in each of which f and g are smooth: ln F is a cubic in ln(1 + u), or f a cubic
in u (flight, and a Taylor law), and g is linear in u, or in the contact force. The period map tells where a motion is
after a time, with derivatives, extremes and first harmonic.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from math import exp, log

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.errors import CompatError, InputError
from asperity.vibration.damping import Damping, LoopDamping
from asperity.vibration.law import SAMPLING, Law, TaylorLaw
from asperity.runtime.display import short_repr

try:
    from asperity import _period_map
except ImportError as error:
    raise CompatError(
        f"the compiled period map cannot be loaded ({error}): install asperity again, or use ./run"
    ) from None

TURN = 2.0 * np.pi
ESCAPE = 1e3  # displacement beyond which motion has left a Taylor well
_FARTHEST = 1e20  # of a flight
_SMALLEST = 1e-75  # of the static deflection, whose cube must not underflow
_APART = 1e-13  # distance of edges that are one
_CLOSEST = 1e-12  # u + 1 at which a contact of infinite initial stiffness is lost: its force there is a jump


@dataclass(frozen=True)
class Restoring:
    """Normal form of a law about a preload: the restoring force f(u) with f(0) = 0, f'(0) = 1.

    Attributes:
        law: static law
        load: preload W (force)
        z_s: static deflection (length)
        scale: z_s F'(z_s) (force); F^ = F / scale
        n_loc: local exponent, scale / W
        a2, a3: coefficients of f = u + a2 u^2 + a3 u^3 + ...
        kappa: backbone curvature, omega/omega_s = 1 + kappa a^2

    Raises:
        InputError: load or static deflection beyond floating-point range, or stiffness not positive
        RangeError: the law does not reach the load
    """

    law: Law
    load: float
    z_s: float = field(init=False)
    scale: float = field(init=False)
    n_loc: float = field(init=False)
    a2: float = field(init=False)
    a3: float = field(init=False)
    kappa: float = field(init=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        z = self.law.deflection(self.load)
        if not all(_SMALLEST < value < 1.0 / _SMALLEST for value in (z, self.load)):
            raise InputError(
                f"the static deflection is {z:g} under load = {self.load:g}, beyond floating-point range: both must "
                f"lie between {_SMALLEST:g} and {1.0 / _SMALLEST:g}; choose another load or other units"
            )
        p1, p2, p3 = self.law.derivatives(z)
        if not p1 > 0:
            raise InputError(f"the law has stiffness {p1:g} at the operating point; it must be positive")
        values = (z, z * p1, z * p1 / self.load, z * p2 / (2 * p1), z * z * p3 / (6 * p1), self.law.kappa(z))
        for name, value in zip(("z_s", "scale", "n_loc", "a2", "a3", "kappa"), values, strict=True):
            object.__setattr__(self, name, float(value))

    @property
    def contact(self) -> bool:
        """Whether contact is lost at u = -1."""
        return self.law.contact

    @property
    def known_to(self) -> float:
        """Displacement up to which the law is known; motion beyond it is on a continuation."""
        return self.law.known_to / self.z_s - 1.0

    @property
    def model(self) -> str:
        """ "exact" or "taylor"."""
        return "exact" if self.contact else "taylor"

    def f(self, u: ArrayLike) -> Array:
        """Restoring force f(u), same shape as `u`."""
        return (self.law.both(self.z_s * (1.0 + np.asarray(u, float)))[0] - self.load) / self.scale


@dataclass(frozen=True)
class Equation:
    """Restoring force and damping.

    Attributes:
        restoring: normal form of the law
        zeta: damping ratio of small motion
        damping: damping model, see `asperity.vibration.damping`
        rtol: allowed relative error of the force: a table of many points then has fewer cells
    """

    restoring: Restoring
    zeta: float
    damping: Damping = "always"
    rtol: float = SAMPLING

    @cached_property
    def cells(self) -> tuple[Array, Array]:
        """Edges (m,) in u, and cells (m + 1, 8) between them as in solver/period_map.cpp."""
        r, rest = self.restoring, 1.0 / self.restoring.n_loc
        edges: Array = np.empty(0)
        rows: Array = np.zeros((1, 8))
        if r.contact:
            x, law = r.law.cells(r.z_s, self.rtol)
            edges = np.append(_CLOSEST - 1.0 if law[0, 2] < 1.0 else -1.0, np.exp(x) / r.z_s - 1.0)
            rows = np.zeros((x.size + 2, 8))
            rows[0, 2] = -rest
            rows[1:, 0], rows[1:, 1] = 1.0, law[:, 0] - np.log(r.z_s)
            rows[1:, 2:6] = law[:, 1:]
            rows[1:, 2] -= np.log(r.scale)
        elif isinstance(r.law, TaylorLaw):
            rows[0, 2:6] = 0.0, 1.0, r.a2, r.a3
        else:
            raise InputError("a law without contact loss must be a TaylorLaw")
        added: Array = np.empty(0)
        lost = edges[0] if edges.size else -1.0
        if isinstance(self.damping, LoopDamping):
            at = np.array([0.0, *self.damping.deflection]) / r.z_s
            added = np.concatenate([[lost], -at[(at > 0) & (at < 1.0)], at])
        elif self.damping == "contact":
            added = np.array([lost])
        cuts = np.unique(np.concatenate([edges, added]))
        cuts = cuts[np.diff(cuts, prepend=-np.inf) > _APART]
        ends = np.concatenate([cuts[:1] - 2.0, cuts, cuts[-1:] + 2.0]) if cuts.size else np.array([-1.0, 1.0])
        inside = 0.5 * (ends[1:] + ends[:-1])
        rows = rows[np.searchsorted(edges, inside)]
        if self.damping != "hunt-crossley":  # there g is the contact force over the preload
            near = np.minimum(0.25 * np.min(np.diff(cuts), initial=1.0), 1e-3)
            one, two = (_rate(r, self.damping, inside + d) for d in (-near, near))
            rows[:, 7] = (two - one) / (2.0 * near)
            rows[:, 6] = 0.5 * (one + two) - rows[:, 7] * inside
        return cuts, np.ascontiguousarray(rows)

    @cached_property
    def of_force(self) -> float:
        """Damping factor over the contact force, where the damping follows that."""
        return self.restoring.n_loc if self.damping == "hunt-crossley" else 0.0

    def acceleration(self) -> Callable[[float, float], float]:
        """Function for the acceleration without forcing, -f - 2 zeta g v, at a displacement and a speed.

        It is that of solver/period_map.cpp.
        """
        edges, rows = list(map(float, self.cells[0])), [tuple(map(float, row)) for row in self.cells[1]]
        rest, of_force, twice = 1.0 / self.restoring.n_loc, self.of_force, 2.0 * self.zeta

        def acceleration(u: float, v: float) -> float:
            logarithmic, start, a, b, c, d, g0, g1 = rows[bisect_left(edges, u)]
            if logarithmic:
                t = log(1.0 + u) - start
                pull = exp(a + t * (b + t * (c + t * d)))
            else:
                pull = rest + a + u * (b + u * (c + u * d))
            return float(rest - pull - twice * (g0 + g1 * u + of_force * pull) * v)

        return acceleration


def _rate(restoring: Restoring, damping: Damping, u: Array) -> Array:
    """Damping factor g(u) of dampers that do not follow the force, same shape as `u`."""
    touching = np.where(u > -1.0, 1.0, 0.0)
    if isinstance(damping, LoopDamping):
        return touching * (1.0 + damping.coefficient(restoring.z_s * np.abs(u)) / damping.background)
    return np.ones_like(u) if damping == "always" else touching


@dataclass(frozen=True)
class Motions:
    """Ends of motions (lanes, ...), NaN where one escapes; derivatives are those by u, v and Omega.

    Attributes:
        end, by_end: state u, v (lanes, 2), and its derivatives (lanes, 2, 3)
        high, low: largest and smallest displacement, and its derivatives (lanes, 4)
        wave: integrals of u cos s and u sin s over the phase, and their derivatives (lanes, 2, 4)
        damping, loss: integrals of g and of g u'^2 over the time (lanes,)
        lowest: phase of the smallest displacement (lanes,)
        error: sum of the local errors (lanes,)
        steps: of the integrator, all lanes, rejected ones and those of motions that escape included
    """

    end: Array
    by_end: Array
    high: Array
    low: Array
    wave: Array
    damping: Array
    loss: Array
    lowest: Array
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
    derivatives: bool = True,
) -> Motions:
    """Integrate states (lanes, 2) from a phase Omega tau over a length of it.

    `grows` is the derivative of F^ with respect to Omega.
    """
    y = np.asarray(states, float).reshape(-1, 2)
    lanes = np.empty((len(y), 7))
    lanes[:, :2] = y
    for i, values in enumerate((omega, forcing, grows, start, length)):
        lanes[:, 2 + i] = values
    r = equation.restoring
    out = np.empty((len(y), 29))
    limit = _FARTHEST if r.contact else ESCAPE
    numbers = (1.0 / r.n_loc, equation.of_force, equation.zeta, limit, rtol)
    _period_map.period_map(*equation.cells, *numbers, derivatives, lanes, out)
    columns, wave = out[:, 2:8].reshape(-1, 3, 2).transpose(0, 2, 1), out[:, 16:24].reshape(-1, 2, 4)
    damping, loss, lowest, error, steps = out[:, 24:].T
    return Motions(
        out[:, :2], columns, out[:, 8:12], out[:, 12:16], wave, damping, loss, lowest, error, float(steps.sum())
    )  # fmt: skip
