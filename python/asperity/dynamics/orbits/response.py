"""Frequency response: all periodic orbits under harmonic forcing over a window of frequencies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from asperity.dynamics.forcing import Setting
from asperity.dynamics.law.law import Array
from asperity.dynamics.orbits.branch import Branch, Event, Solution, measure, within_law
from asperity.dynamics.orbits.branch_switching import detached, known, subharmonic
from asperity.dynamics.orbits.continuation import Path, Point, correct, in_omega, start, trace
from asperity.dynamics.orbits.events import finish
from asperity.dynamics.orbits.harmonic_balance import Balance, resize, tail
from asperity.dynamics.orbits.initial_orbits import LEAST, backbone_chart, edge_orbits
from asperity.errors import ConvergenceError, InputError

_GUESS = 1e-3  # deviation of the determinant from Liouville's


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
                data = measure(balance, (point,), branch.kind, "")
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
        max_points: longest branch, see `continuation.trace`.

    Raises:
        ConvergenceError: no orbit can be found at either end of the window.
    """
    forcing = setting.F_hat
    equations = in_omega(balance, forcing)
    low, high = omega
    options: dict[str, Any] = {
        "tol": tol,
        "least": LEAST,
        "zeta": balance.zeta,
        "max_step": (high - low) / 25.0,
        "max_points": max_points,
        "smooth": not balance.restoring.singular,
    }
    paths: list[tuple[str, int, Path]] = []
    chart = backbone_chart(balance, forcing)
    for edge, direction in ((high, -1.0), (low, 1.0)):
        for x in edge_orbits(balance, edge, forcing, tol, chart):
            try:
                first = start(equations, x, edge, direction, tol, LEAST)
                if known(paths, 1, first.x, edge):
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
            branch, found, flips = finish(replace(balance, order=order), eqs, path, kind, len(branches), tol)
            branches.append(branch)
            events.extend(found)
            if subharmonics and order == 1:
                doublings.extend(flips)
        elif doublings:
            sub = subharmonic(balance, forcing, doublings.pop(0), omega, options)
            if sub is not None:
                paths.append(("sub2", 2, sub))
                pending.append(paths[-1])
                if sub.end == "period doubling" and doublings:  # it was born there just as well
                    death = sub.points[-1].parameter
                    del doublings[min(range(len(doublings)), key=lambda i: abs(doublings[i].parameter - death))]
        else:
            order, x, where = seeds.pop(0)
            loop = detached(replace(balance, order=order), forcing, order, x, where, omega, options, paths)
            if loop is not None:
                paths.append(("detached", order, loop))
                pending.append(paths[-1])
    branches, events, limits = within_law(balance, branches, events)
    notes.extend(limits)
    for number, b in enumerate(branches):
        if b.end not in ("window", "closed", "period doubling"):
            notes.append(f"branch {number} ({b.kind}) ends early: {b.end}")
    guesses = sum(int((b.det_error > _GUESS).sum()) for b in branches)
    if guesses:
        notes.append(
            f"the stability of {guesses} orbits is a guess: their multipliers are known to {_GUESS:g} or worse"
        )
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
