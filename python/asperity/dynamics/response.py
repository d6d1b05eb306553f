"""Frequency response: all periodic orbits under harmonic forcing over a window of frequencies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from asperity.dynamics.continuation import (
    Equations,
    Path,
    Point,
    adapt,
    between,
    correct,
    in_forcing,
    in_omega,
    locate,
    newton_rtol,
    start,
    trace,
)
from asperity.dynamics.free import orbit_coefficients, rough_orbit
from asperity.dynamics.hbm import Balance, resize, tail
from asperity.dynamics.law import Array
from asperity.dynamics.stability import Floquet, extrema, floquet, stack
from asperity.errors import ConvergenceError, InputError

_LEAST = 8  # harmonics per period of the forcing
_CORNER = 0.003  # largest distance of a branch from the chord between neighbours, relative to its extent
_SAME = 1e-4  # two orbits closer than this, relatively, are one


@dataclass(frozen=True)
class Setting:
    """What a forced result was computed for.

    Attributes:
        model: "exact" or "taylor".
        law: description of the law.
        n_loc: local exponent at the operating point.
        zeta, damping: damping ratio and model.
        F_hat: forcing F/(n_loc m g).
        F_over_mg: forcing over the preload, n_loc F_hat (the sigma of the Hertz literature).
    """

    model: str
    law: str
    n_loc: float
    zeta: float
    damping: str
    F_hat: float

    @property
    def F_over_mg(self) -> float:
        """Forcing amplitude over the preload."""
        return self.n_loc * self.F_hat

    def describe(self) -> str:
        """One line for titles and logs."""
        return (
            f"{self.model}: {self.law}, zeta = {self.zeta:g} ({self.damping}), F^ = {self.F_hat:g}, "
            f"F/(m g) = {self.F_over_mg:g}"
        )


@dataclass(frozen=True)
class Event:
    """A special orbit on a branch: "fold", "period doubling" or "grazing" (u_min = -1)."""

    kind: str
    branch: int
    Omega: float
    u_max: float
    u_min: float
    a1: float


@dataclass(frozen=True)
class Branch:
    """Periodic orbits in order along a branch (arrays of shape (points,)).

    Attributes:
        kind: "main", "sub2" (grown from a period doubling) or "detached".
        order: periods of the forcing per period of the orbit.
        Omega: forcing frequency over omega_s.
        u_max, u_min: extreme deflections; contact is lost where u_min < -1.
        a1: amplitude of the harmonic at the forcing frequency.
        stable: linear stability.
        radius: largest modulus of a Floquet multiplier.
        error: truncation estimate, relative to the amplitude.
        det_error: deviation of the monodromy determinant from Liouville's.
        harmonics: harmonics in use at each point.
        coefficients: complex Fourier coefficients (points, K + 1) in the angle Omega tau / order.
        valid: False where the law means nothing physically (a Taylor law with u_min < -1).
        end: why the branch ends.
    """

    kind: str
    order: int
    Omega: Array
    u_max: Array
    u_min: Array
    a1: Array
    stable: Array
    radius: Array
    error: Array
    det_error: Array
    harmonics: Array
    coefficients: Array
    valid: Array
    end: str

    def __len__(self) -> int:
        return self.Omega.size

    @property
    def contact_loss(self) -> Array:
        """Whether the orbit leaves contact (for a Taylor law: passes u = -1)."""
        return self.u_min < -1.0


@dataclass(frozen=True)
class Solution:
    """One periodic orbit at a given frequency; attributes as in `Branch`."""

    branch: int
    kind: str
    order: int
    Omega: float
    u_max: float
    u_min: float
    a1: float
    stable: bool
    error: float
    coefficients: Array


@dataclass(frozen=True)
class FrequencyResponse:
    """Branches, special points and accuracy of a frequency response.

    Attributes:
        setting: law, damping and forcing.
        omega: window of Omega.
        branches: see `Branch`.
        events: see `Event`.
        tolerance: largest truncation estimate on any branch, relative to the amplitude.
        det_error: largest deviation from Liouville's determinant.
        valid: whether every orbit is physical.
        notes: what a reader must know (unphysical parts, ends of branches, table limits).
    """

    setting: Setting
    omega: tuple[float, float]
    branches: tuple[Branch, ...]
    events: tuple[Event, ...]
    tolerance: float
    det_error: float
    valid: bool
    notes: tuple[str, ...]
    balance: Balance = field(repr=False)

    def __getitem__(self, kind: str) -> tuple[Event, ...]:
        """Events of one kind."""
        return tuple(e for e in self.events if e.kind == kind)

    @property
    def peak(self) -> tuple[float, float]:
        """Omega and u_max of the greatest deflection on any branch."""
        best = max(self.branches, key=lambda b: float(b.u_max.max()))
        j = int(best.u_max.argmax())
        return float(best.Omega[j]), float(best.u_max[j])

    def at(self, omega: float) -> tuple[Solution, ...]:
        """All orbits of the branches at exactly this Omega, lowest u_max first.

        Raises:
            InputError: omega lies outside the window.
        """
        if not self.omega[0] <= omega <= self.omega[1]:
            raise InputError(f"Omega = {omega:g} lies outside the computed window {self.omega}")
        found: list[Solution] = []
        for number, branch in enumerate(self.branches):
            balance = replace(self.balance, order=branch.order)
            gap = branch.Omega - omega
            touching = (gap[:-1] < 0) != (gap[1:] < 0)
            touching[:1] |= gap[0] == 0
            touching[-1:] |= gap[-1] == 0
            for i in np.flatnonzero(touching):
                s = gap[i] / (gap[i] - gap[i + 1])
                c = (1 - s) * branch.coefficients[i] + s * branch.coefficients[i + 1]
                x = np.concatenate([c.real, -c.imag[1:]])
                keep = int(max(branch.harmonics[i], branch.harmonics[i + 1]))
                equations = in_omega(balance, self.setting.F_hat)
                try:
                    x, _, t, tp = correct(equations, resize(x, keep), omega, np.zeros(2 * keep + 1), 1.0)
                except ConvergenceError:
                    continue
                point = Point(x, omega, t, tp, tail(x))
                data = _measure(balance, (point,), branch.kind, "")
                found.append(
                    Solution(
                        number,
                        branch.kind,
                        branch.order,
                        omega,
                        float(data.u_max[0]),
                        float(data.u_min[0]),
                        float(data.a1[0]),
                        bool(data.stable[0]),
                        point.error,
                        data.coefficients[0],
                    )
                )
        return tuple(sorted(found, key=lambda solution: solution.u_max))

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows of response.csv, the points of a branch in order."""
        s = self.setting
        for b in self.branches:
            loss = b.contact_loss
            for i in range(len(b)):
                yield {
                    "model": s.model,
                    "F_hat": s.F_hat,
                    "zeta": s.zeta,
                    "Omega": float(b.Omega[i]),
                    "u_max": float(b.u_max[i]),
                    "u_min": float(b.u_min[i]),
                    "a1": float(b.a1[i]),
                    "stable": bool(b.stable[i]),
                    "branch": b.kind,
                    "contact_loss": bool(loss[i]),
                }


def frequency_response(
    balance: Balance,
    setting: Setting,
    omega: tuple[float, float],
    *,
    tol: float = 1e-5,
    subharmonics: bool = True,
    extra: tuple[tuple[int, Array, float], ...] = (),
    max_points: int = 3000,
) -> FrequencyResponse:
    """Trace every branch reached from rest, from the backbone and from given orbits.

    Args:
        balance: the equations (order 1).
        setting: law, damping and forcing of the run.
        omega: lowest and highest Omega.
        tol: truncation error allowed, relative to the amplitude.
        subharmonics: also follow the period-2 branches born at period doublings.
        extra: further orbits (order, coefficients, Omega) whose branches are traced when new ("detached").
        max_points: longest branch.

    Raises:
        ConvergenceError: no orbit can be found at either end of the window.
    """
    forcing = setting.F_hat
    equations = in_omega(balance, forcing)
    low, high = omega
    options: dict[str, Any] = {
        "tol": tol,
        "least": _LEAST,
        "zeta": balance.zeta,
        "max_step": (high - low) / 25.0,
        "max_points": max_points,
        "smooth": not _singular(balance),
    }
    paths: list[tuple[str, int, Path]] = []
    chart = _backbone_chart(balance)
    for edge, direction in ((high, -1.0), (low, 1.0)):
        for x in _edge_orbits(balance, edge, forcing, tol, chart):
            try:
                first = start(equations, x, edge, direction, tol, _LEAST)
                if _known(paths, 1, first.x, edge):
                    continue
                paths.append(("main", 1, trace(equations, first, omega, **options)))
            except ConvergenceError:
                continue
    if not paths:
        raise ConvergenceError(
            f"no periodic orbit found at Omega = {low:g} or {high:g} with F^ = {forcing:g}: widen the window"
        )
    branches: list[Branch] = []
    events: list[Event] = []
    notes: list[str] = []
    doublings: list[Point] = []
    pending = list(paths)
    seeds = list(extra)
    while pending or doublings or seeds:
        if pending:
            kind, order, path = pending.pop(0)
            eqs = in_omega(replace(balance, order=order), forcing)
            branch, found, flips = _finish(replace(balance, order=order), eqs, path, kind, len(branches), tol)
            branches.append(branch)
            events.extend(found)
            if subharmonics and order == 1:
                doublings.extend(flips)
        elif doublings:
            sub = _subharmonic(balance, forcing, doublings.pop(0), omega, options)
            if sub is not None:
                paths.append(("sub2", 2, sub))
                pending.append(paths[-1])
                if sub.end == "period doubling" and doublings:  # it was born there just as well
                    death = sub.points[-1].parameter
                    doublings.remove(min(doublings, key=lambda p: abs(p.parameter - death)))
        else:
            order, x, where = seeds.pop(0)
            loop = _detached(replace(balance, order=order), forcing, order, x, where, omega, options, paths)
            if loop is not None:
                paths.append(("detached", order, loop))
                pending.append(paths[-1])
    branches, events, limits = _within_law(balance, branches, events)
    notes.extend(limits)
    for number, b in enumerate(branches):
        if b.end not in ("window", "closed", "period doubling"):
            notes.append(f"branch {number} ({b.kind}) ends early: {b.end}")
    valid = all(bool(b.valid.all()) for b in branches)
    if not valid:
        notes.append("the Taylor law is unphysical where u_min < -1: contact is lost there")
    return FrequencyResponse(
        setting,
        (low, high),
        tuple(branches),
        tuple(events),
        max(float(b.error.max()) for b in branches),
        max(float(b.det_error.max()) for b in branches),
        valid,
        tuple(notes),
        balance,
    )


def orbit_from_rest(balance: Balance, omega: float, forcing: float, tol: float) -> Array:
    """Coefficients of the orbit reached at fixed Omega by raising the forcing from zero."""
    transfer = 1.0 / complex(1.0 - omega * omega, 2.0 * balance.zeta * omega)
    first = min(forcing, 0.02 / abs(transfer))
    x: Array = np.zeros(2 * _LEAST + 1)
    x[1], x[_LEAST + 1] = first * transfer.real, -first * transfer.imag
    x = balance.correct(x, omega, first)
    if first == forcing:
        return x
    if forcing * abs(transfer) < 0.3:  # nearly linear: Newton's method finds it at once
        direct = balance.correct(x * (forcing / first), omega, forcing)
        if np.linalg.norm(direct - x * (forcing / first)) < 0.2 * np.linalg.norm(direct):
            return direct
    equations = in_forcing(balance, omega)
    point = start(equations, x, first, 1.0, tol, _LEAST)
    path = trace(equations, point, (0.0, forcing), tol=tol, least=_LEAST, zeta=balance.zeta, max_step=0.5 * forcing)
    if path.end != "window" or path.points[-1].parameter < 0.5 * forcing:
        raise ConvergenceError(f"no orbit found from rest at Omega = {omega:g}, F^ = {forcing:g}")
    return path.points[-1].x


def _backbone_chart(balance: Balance) -> tuple[Array, Array]:
    """Amplitudes and frequencies of a few free orbits; empty where the backbone gives no starting values."""
    if not balance.restoring.contact or balance.zeta == 0:
        return np.empty(0), np.empty(0)
    grid = np.geomspace(3e-3, 300.0, 6)
    grid = grid[grid < balance.restoring.u_range[1]]
    return grid, np.array([rough_orbit(balance.restoring, u, balance.damping)[0] for u in grid])


def backbone_orbits(balance: Balance, omega: float, forcing: float, chart: tuple[Array, Array]) -> list[Array]:
    """Guesses of the orbits near the backbone at Omega, their phase set by the energy balance."""
    restoring = balance.restoring
    grid, frequency = chart
    guesses = []
    for i in range(len(grid) - 1):
        if (frequency[i] > omega) == (frequency[i + 1] > omega):
            continue
        u0 = float(
            brentq(lambda u: rough_orbit(restoring, u, balance.damping)[0] - omega, grid[i], grid[i + 1], rtol=1e-3)
        )
        need = 2.0 * balance.zeta * rough_orbit(restoring, u0, balance.damping)[1] / forcing
        if need > 1.0:
            continue
        x = orbit_coefficients(restoring, u0, 24)
        k = np.arange(1, 25)
        for psi in (np.arcsin(need), np.pi - np.arcsin(need)):
            y = x.copy()
            y[1:25], y[25:] = x[1:25] * np.cos(k * psi), x[1:25] * np.sin(k * psi)
            guesses.append(y)
    return guesses


def _edge_orbits(
    balance: Balance, edge: float, forcing: float, tol: float, chart: tuple[Array, Array]
) -> Iterator[Array]:
    """Orbits at an end of the window from which branches enter it."""
    try:
        yield orbit_from_rest(balance, edge, forcing, tol)
    except ConvergenceError:
        pass
    for guess in backbone_orbits(balance, edge, forcing, chart):
        try:
            x = balance.correct(guess, edge, forcing)
        except (ConvergenceError, np.linalg.LinAlgError):
            continue
        if np.linalg.norm(x - resize(guess, x.size // 2)) < 0.5 * np.linalg.norm(guess):
            yield x


def _singular(balance: Balance) -> bool:
    """Whether the stiffness has no bound near contact loss (n < 1)."""
    return balance.restoring.contact and float(balance.restoring.df(np.array([-1.0 + 1e-12]))[0]) > 10.0


def _known(paths: list[tuple[str, int, Path]], order: int, x: Array, omega: float) -> bool:
    """Whether the orbit already stands at an end of one of the paths."""
    for _, other, path in paths:
        if other != order:
            continue
        for p in (path.points[0], path.points[-1]):
            if abs(p.parameter - omega) < 1e-9:
                count = max(p.x.size, x.size) // 2
                a, b = resize(p.x, count), resize(x, count)
                if np.linalg.norm(a - b) < max(_SAME, 10 * p.error) * np.linalg.norm(a):
                    return True
    return False


def _measure(
    balance: Balance, points: Sequence[Point], kind: str, end: str, multipliers: Floquet | None = None
) -> Branch:
    c = stack([p.x for p in points])
    omega = np.array([p.parameter for p in points])
    u_min, u_max = extrema(c)
    f = multipliers or floquet(balance, c, omega)
    valid = np.ones(omega.size, bool) if balance.restoring.contact else u_min >= -1.0
    return Branch(
        kind,
        balance.order,
        omega,
        u_max,
        u_min,
        np.abs(c[:, balance.order]),
        f.stable,
        f.radius,
        np.array([p.error for p in points]),
        f.error,
        np.array([p.x.size // 2 for p in points]),
        c,
        valid,
        end,
    )


def _finish(
    balance: Balance, equations: Equations, path: Path, kind: str, number: int, tol: float
) -> tuple[Branch, list[Event], list[Point]]:
    """Locate the events of a path, insert them and measure every point."""
    points = _refined(equations, path.points, tol)
    rtol = newton_rtol(tol, not _singular(balance))
    multipliers = _multipliers(balance, points)
    if balance.zeta > 0 and balance.order == 1 and _open_tongues(balance, equations, points, multipliers):
        multipliers = _multipliers(balance, points)
    flip = multipliers.flip
    c = stack([p.x for p in points])
    omega = np.array([p.parameter for p in points])
    u_min, _ = extrema(c)
    fold = np.array([p.t_parameter for p in points])

    def graze(p: Point) -> float:
        return float(extrema(stack([p.x]))[0][0]) + 1.0

    def doubling(p: Point) -> float:
        return float(_multipliers(balance, [p]).flip[0])

    tests = [("fold", fold, lambda p: p.t_parameter), ("grazing", u_min + 1.0, graze)]
    if balance.zeta > 0 and balance.order == 1:
        tests.append(("period doubling", flip, doubling))
    inserted: list[tuple[int, float, str, Point]] = []
    for name, values, function in tests:
        for i in np.flatnonzero((values[:-1] > 0) != (values[1:] > 0)):
            try:
                p = locate(equations, points[i], points[i + 1], function, values[i], values[i + 1], rtol=rtol)
                p = adapt(equations, p, p.t, p.t_parameter, tol, p.x.size // 2)
            except ConvergenceError:
                continue
            gap = np.linalg.norm(p.x - resize(points[i].x, p.x.size // 2)) + abs(p.parameter - omega[i])
            inserted.append((int(i), float(gap), name, p))
    inserted.sort(key=lambda item: item[:2])
    if inserted:
        at = [i + 1 for i, *_ in inserted]
        multipliers = multipliers.insert(at, _multipliers(balance, [p for *_, p in inserted]))
    for shift, (i, _, _, p) in enumerate(inserted):
        points.insert(i + 1 + shift, p)
    branch = _measure(balance, points, kind, path.end, multipliers)
    events = []
    for shift, (i, _, name, _) in enumerate(inserted):
        j = i + 1 + shift
        events.append(
            Event(
                name,
                number,
                float(branch.Omega[j]),
                float(branch.u_max[j]),
                float(branch.u_min[j]),
                float(branch.a1[j]),
            )
        )
    return branch, events, [p for _, _, name, p in inserted if name == "period doubling"]


def _refined(equations: Equations, points: tuple[Point, ...], tol: float) -> list[Point]:
    """Add points where straight lines between neighbours would show as corners in a plot."""
    count = 8
    span = abs(max(p.parameter for p in points) - min(p.parameter for p in points)) + 1e-12
    x = np.array([resize(p.x, count) for p in points])
    height = float(np.abs(x).max()) + 1e-12
    t = np.array([resize(p.t, count) for p in points])
    slope = np.column_stack([t / height, [p.t_parameter / span for p in points]])
    gap = np.diff(x, axis=0)
    length = np.sqrt((gap**2).sum(axis=1) + np.diff([p.parameter for p in points]) ** 2)
    # the cubic through both points and tangents leaves the chord, half-way, by (t_a - t_b) h / 8
    sag = np.abs(slope[:-1] - slope[1:]).max(axis=1) * length / 8.0
    out = [points[0]]
    for i, p in enumerate(points[1:]):
        pieces = min(4, int(np.ceil(np.sqrt(sag[i] / _CORNER))))
        for j in range(1, pieces):
            try:
                q = between(equations, points[i], p, j / pieces)
                out.append(adapt(equations, q, q.t, q.t_parameter, tol, q.x.size // 2))
            except ConvergenceError:
                continue
        out.append(p)
    return out


def _multipliers(balance: Balance, points: list[Point]) -> Floquet:
    return floquet(balance, stack([p.x for p in points]), np.array([p.parameter for p in points]))


def _open_tongues(balance: Balance, equations: Equations, points: list[Point], data: Floquet) -> bool:
    """Insert a point inside each period-doubling tongue narrower than a step; True when there is one.

    Multipliers near -1 are -rho exp(+-i psi); psi^2 is smooth along the branch, vanishes where they meet on
    the real axis and is negative in a tongue, so its minimum is found by parabolic interpolation.
    """
    square = _phase_square(data)
    omega = np.array([p.parameter for p in points])
    dips = np.flatnonzero((square[1:-1] < square[:-2]) & (square[1:-1] <= square[2:]) & (square[1:-1] < 2.5)) + 1
    new: list[tuple[int, Point]] = []
    for i in dips:
        around = slice(i - 1, i + 2)
        if (data.flip[around] < 0).any() or not abs(np.sign(np.diff(omega[around])).sum()) == 2:
            continue
        x, y = list(omega[around]), list(square[around])
        for _ in range(5):
            fit = np.polyfit(np.array(x) - x[1], y, 2)
            target = x[1] - 0.5 * fit[1] / fit[0] if fit[0] > 0 else x[1]
            if min(abs(target - value) for value in x) < 1e-6 * abs(omega[i + 1] - omega[i - 1]):
                break
            left = i - 1 if (target < omega[i]) == (omega[i - 1] < omega[i]) else i
            s = (target - omega[left]) / (omega[left + 1] - omega[left])
            if not 0.0 < s < 1.0:
                break
            try:
                p = between(equations, points[left], points[left + 1], float(s))
            except ConvergenceError:
                break
            f = _multipliers(balance, [p])
            if f.flip[0] < 0:
                new.append((left, p))
                break
            x.append(p.parameter)
            y.append(float(_phase_square(f)[0]))
            best = np.argsort(y)[:3]  # keep the three lowest, ordered along the branch
            x, y = [x[j] for j in best], [y[j] for j in best]
            order = np.argsort(x)
            x, y = [x[j] for j in order], [y[j] for j in order]
    for shift, (left, p) in enumerate(new):
        points.insert(left + 1 + shift, p)
    return bool(new)


def _phase_square(data: Floquet) -> Array:
    """psi^2 with multipliers -rho exp(+-i psi); negative where they are real and below zero."""
    h = -data.trace / (2.0 * np.sqrt(data.determinant))
    inside = np.arccos(np.clip(h, -1.0, 1.0)) ** 2
    return np.where(h > 1.0, -(np.arccosh(np.maximum(h, 1.0)) ** 2), inside)


def _subharmonic(
    balance: Balance, forcing: float, flip: Point, window: tuple[float, float], options: dict[str, Any]
) -> Path | None:
    """Follow the period-2 branch born at a period doubling until it dies or leaves the window."""
    double = replace(balance, order=2)
    equations = in_omega(double, forcing)
    count = flip.x.size // 2
    x = np.zeros(4 * count + 1)
    x[0] = flip.x[0]
    x[2 : 2 * count + 1 : 2] = flip.x[1 : count + 1]
    x[2 * count + 2 :: 2] = flip.x[count + 1 :]
    k = np.concatenate([[0], np.arange(1, 2 * count + 1), np.arange(1, 2 * count + 1)])
    odd = np.flatnonzero(k % 2)
    jacobian = equations(x, flip.parameter)[1][np.ix_(odd, odd)]
    null = np.zeros(x.size)
    null[odd] = np.linalg.svd(jacobian)[2][-1]

    def returns(points: list[Point]) -> str | None:
        a, b = points[-2], points[-1]
        m = min(a.x.size, b.x.size) // 2
        j = np.concatenate([np.arange(1, m + 1, 2), m + np.arange(1, m + 1, 2)])
        if len(points) > 3 and resize(a.x, m)[j] @ resize(b.x, m)[j] <= 0:
            points.pop()
            return "period doubling"
        return None

    first = Point(x, flip.parameter, null, 0.0, tail(x))
    path = trace(equations, first, window, stop=returns, **{**options, "least": 2 * _LEAST})
    return path if len(path.points) > 3 else None


def _detached(
    balance: Balance,
    forcing: float,
    order: int,
    x: Array,
    omega: float,
    window: tuple[float, float],
    options: dict[str, Any],
    paths: list[tuple[str, int, Path]],
) -> Path | None:
    """Branch through a given orbit, followed both ways, unless one of the paths already holds it."""
    equations = in_omega(balance, forcing)
    options = {**options, "least": order * _LEAST}
    try:
        first = start(equations, x, omega, 1.0, options["tol"], order * _LEAST)
    except ConvergenceError:
        return None
    for _, other, path in paths:
        if other == order and _on_path(equations, path, first, order):
            return None

    def closed(points: list[Point]) -> str | None:
        if len(points) < 6:
            return None
        a, b, f = points[-2], points[-1], points[0]
        m = f.x.size // 2
        chord = np.append(b.resized(m).x - a.resized(m).x, b.parameter - a.parameter)
        to = np.append(f.x - a.resized(m).x, f.parameter - a.parameter)
        s = float(to @ chord) / float(chord @ chord)
        if 0 <= s <= 1 and np.linalg.norm(to - s * chord) < 0.1 * np.linalg.norm(chord):
            points[-1] = f
            return "closed"
        return None

    forward = trace(equations, first, window, stop=closed, **options)
    if forward.end == "closed":
        return forward
    back = replace(first, t=-first.t, t_parameter=-first.t_parameter)
    backward = trace(equations, back, window, stop=closed, **options)
    turned = tuple(replace(p, t=-p.t, t_parameter=-p.t_parameter) for p in reversed(backward.points[1:]))
    return Path(turned + forward.points, forward.end if backward.end == "window" else backward.end)


def _on_path(equations: Equations, path: Path, point: Point, order: int) -> bool:
    """Whether an orbit, or its copy shifted by whole forcing periods, lies on a path."""
    omega = np.array([p.parameter for p in path.points])
    for i in np.flatnonzero((omega[:-1] <= point.parameter) != (omega[1:] <= point.parameter)):
        s = (point.parameter - omega[i]) / (omega[i + 1] - omega[i])
        try:
            q = between(equations, path.points[i], path.points[i + 1], float(s))
            m = q.x.size // 2
            y, _, _, _ = correct(equations, q.x, point.parameter, np.zeros(q.x.size), 1.0)
        except ConvergenceError:
            continue
        a, b = stack([y])[0], stack([resize(point.x, m)])[0]
        shifts = np.exp(2j * np.pi / order * np.outer(np.arange(order), np.arange(m + 1)))
        if np.abs(a - shifts * b).max(axis=1).min() < 1e-3 * np.abs(a).max():
            return True
    return False


def _within_law(
    balance: Balance, branches: list[Branch], events: list[Event]
) -> tuple[list[Branch], list[Event], list[str]]:
    """Cut the branches where the orbit leaves the range the law is known on."""
    low, high = balance.restoring.u_range
    if np.isinf(low) and np.isinf(high):
        return branches, events, []
    kept: list[Branch] = []
    renumber: dict[int, list[int]] = {}
    notes = []
    for number, b in enumerate(branches):
        inside = (b.u_max <= high) & (b.u_min >= low)
        if inside.all():
            pieces = [slice(0, len(b))]
        else:
            notes.append(
                f"branch {number} ({b.kind}) is cut where it leaves the law (known up to u = "
                f"{high:.6g}); compute the curve further or ask for extrapolate=True"
            )
            edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int)))
            pieces = [slice(int(a), int(e)) for a, e in edges.reshape(-1, 2) if e - a > 1]
        renumber[number] = list(range(len(kept), len(kept) + len(pieces)))
        for piece in pieces:
            arrays = {
                name: getattr(b, name)[piece]
                for name in (
                    "Omega",
                    "u_max",
                    "u_min",
                    "a1",
                    "stable",
                    "radius",
                    "error",
                    "det_error",
                    "harmonics",
                    "coefficients",
                    "valid",
                )
            }
            kept.append(replace(b, **arrays, end=b.end if inside.all() else "range of the law"))
    if not kept:
        balance.restoring.check_range(
            min(float(b.u_min.min()) for b in branches), max(float(b.u_max.max()) for b in branches)
        )
    moved = []
    for e in events:
        if low <= e.u_min and e.u_max <= high:
            for new in renumber[e.branch]:
                if kept[new].Omega.size and np.isclose(kept[new].Omega, e.Omega, rtol=1e-12).any():
                    moved.append(replace(e, branch=new))
    return kept, moved, notes
