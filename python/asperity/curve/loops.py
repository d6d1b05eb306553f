"""Loops of the force about a preload: what plastic flow dissipates in each, and their file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from asperity.errors import InputError
from asperity.runtime.files import UNREADABLE, read_csv, write_csv

SHAKEN_DOWN = 1e-4  # loss factor below which a contact has shaken down
LEFT_OUT = "micro-slip: its loss is that of [slip], not of these loops"  # of the damping of real joints
SETTLED = 0.02  # relative change of the loss factor from one loop to the next below which it is steady
COLUMNS = (
    "amplitude", "loop", "preload", "delta_low", "delta_high", "deflection", "k", "work", "dissipated", "gained",
    "energy", "imbalance", "eta",
)  # fmt: skip


@dataclass(frozen=True)
class Loop:
    """One loop of the force about a preload: from the preload up, down below it, and back.

    Attributes:
        amplitude: of the force over the preload
        loop: its number; the first begins at the state of the preload
        preload: mean force [force]
        delta_low, delta_high: approach at the least and at the greatest force [length]
        work: of the flat along the loop, trapezoidal rule [force length]
        dissipated: by plastic flow [force length]
        gained: energy of elastic strain and back stress at its end less that at its beginning [force length]

    Examples:
        >>> loop = Loop(0.5, 2, preload=4.0, delta_low=1.0, delta_high=1.5, work=0.1, dissipated=0.1, gained=0.0)
        >>> loop.deflection, loop.k, loop.energy, loop.imbalance, round(loop.eta, 6)
        (0.25, 8.0, 0.25, 0.0, 0.063662)
    """

    amplitude: float
    loop: int
    preload: float
    delta_low: float
    delta_high: float
    work: float
    dissipated: float
    gained: float

    @property
    def deflection(self) -> float:
        """Amplitude of the approach, half of its range [length]."""
        return 0.5 * (self.delta_high - self.delta_low)

    @property
    def k(self) -> float:
        """Stiffness of the loop, the range of the force over that of the approach [force/length]."""
        return self.amplitude * self.preload / self.deflection

    @property
    def energy(self) -> float:
        """Energy of a spring of this stiffness at this amplitude [force length]."""
        return 0.5 * self.amplitude * self.preload * self.deflection

    @property
    def imbalance(self) -> float:
        """Work less dissipated and gained energy, over `energy`: the error of the trapezoidal rule, if nothing else.

        With friction on the flat it contains what that loses, which `eta` does not.
        """
        return (self.work - self.dissipated - self.gained) / self.energy

    @property
    def eta(self) -> float:
        """Loss factor, the dissipated energy over 2 pi `energy`; twice the damping ratio at resonance."""
        return self.dissipated / (2.0 * math.pi * self.energy)

    def scaled(self, force: float, length: float) -> Loop:
        """The loop in other units: forces times `force`, lengths times `length`."""
        low, high = self.delta_low * length, self.delta_high * length
        energies = (x * force * length for x in (self.work, self.dissipated, self.gained))
        return Loop(self.amplitude, self.loop, self.preload * force, low, high, *energies)


@dataclass(frozen=True)
class LoopTable:
    """Loops amplitude by amplitude, each from the state of the preload.

    Attributes:
        loops: in the order of amplitudes and numbers
    """

    loops: tuple[Loop, ...]

    def of_amplitudes(self) -> Iterator[tuple[Loop, ...]]:
        """Loops of each amplitude."""
        for amplitude in sorted({loop.amplitude for loop in self.loops}):
            yield tuple(loop for loop in self.loops if loop.amplitude == amplitude)

    def unsettled(self) -> tuple[float, ...]:
        """Amplitudes of the force whose last two loops still differ, or that have one loop only."""
        found = []
        for loops in self.of_amplitudes():
            before, last = loops[-2].eta if len(loops) > 1 else math.inf, loops[-1].eta
            if abs(last - before) > SETTLED * before and max(before, last) > SHAKEN_DOWN:
                found.append(loops[-1].amplitude)
        return tuple(found)

    def doubts(self, top: float) -> Iterator[str]:
        """Sentences on loops that are not steady, or that load the contact further than its curve.

        Args:
            top: greatest force of the curve [force]
        """
        if unsettled := self.unsettled():
            amplitudes = ", ".join(f"{a:g}" for a in unsettled)
            yield f"the loops of amplitude {amplitudes} are not steady yet: use more loops.cycles"
        beyond = [loop.amplitude for loop in self.loops if loop.preload * (1.0 + loop.amplitude) > top * (1.0 + 1e-6)]
        if beyond:
            yield (
                f"loops from an amplitude of {min(beyond):g} of the preload {self.loops[0].preload:g} on pass the "
                f"greatest force {top:g} of the curve, for which the mesh was made: load the contact further, or lower "
                "loops.amplitudes"
            )

    def sentence(self) -> str:
        """First and last loop of each amplitude, in words."""
        parts = []
        for loops in self.of_amplitudes():
            first, last = loops[0], loops[-1]
            of_last = "shaken down" if last.eta < SHAKEN_DOWN else f"{last.eta:.2g}"
            of_first = "no loss" if first.eta < SHAKEN_DOWN else f"loss factor {first.eta:.2g}"
            parts.append(
                f"force {first.amplitude:g} of the preload: {of_first} in the first loop, {of_last} in loop {last.loop}"
            )
        return "; ".join(parts)

    def to_dict(self) -> dict[str, Any]:
        """Section "loops" of summary.json: the last loop of each amplitude next to the first."""
        table = []
        for loops in self.of_amplitudes():
            first, last = loops[0], loops[-1]
            table.append({
                "amplitude": first.amplitude, "deflection": last.deflection, "k": last.k, "eta_first": first.eta,
                "eta": last.eta, "loops": last.loop,
                "imbalance": max((loop.imbalance for loop in loops), key=abs),
            })  # fmt: skip
        return {
            "preload": self.loops[0].preload,
            "in_words": self.sentence(),
            "not_in_the_model": LEFT_OUT,
            "unsettled": list(self.unsettled()),
            "amplitudes": table,
        }

    def write(self, path: Path) -> None:
        """Write loops.csv."""
        write_csv(path, COLUMNS, ({name: getattr(loop, name) for name in COLUMNS} for loop in self.loops))

    @classmethod
    def read(cls, path: Path) -> LoopTable:
        """Read loops.csv.

        Raises:
            InputError: there is no such file, or it is damaged
        """
        try:
            columns = read_csv(path)
            rows = zip(*columns.values(), strict=True)
            found = [dict(zip(columns, row, strict=True)) for row in rows]
            names = [item.name for item in fields(Loop)][2:]
            table = cls(
                tuple(Loop(float(r["amplitude"]), int(r["loop"]), *(float(r[n]) for n in names)) for r in found)
            )
        except UNREADABLE as error:
            raise InputError(f"the loops cannot be read from {path}: {error}") from None
        if not table.loops:
            raise InputError(f"{path} holds no loop")
        return table

    @classmethod
    def scaled(cls, loops: Iterable[Loop], force: float, length: float) -> LoopTable:
        """A table of loops in other units: forces times `force`, lengths times `length`."""
        return cls(tuple(loop.scaled(force, length) for loop in loops))
