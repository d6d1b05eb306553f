# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Slip of a joint by its curve: paths and loops of each amplitude with their bars, and their files."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.columns import CurveColumns
from asperity.dynamics.law.law import Law
from asperity.dynamics.law.table import TableLaw
from asperity.dynamics.law_of_curve import Choice, choose
from asperity.dynamics.laws import tabulate
from asperity.errors import AsperityError
from asperity.model.material import Material
from asperity.runtime.display import short_repr
from asperity.runtime.files import write_csv
from asperity.runtime.run_folder import SLIP, SLIP_LOOPS
from asperity.slip.law import SlipLaw
from asperity.slip.path import SlipPath, path_of_law
from asperity.slip.settings import SlipSettings
from asperity.units import quantity

#: Columns of slip_loops.csv, and those of them with an error bar.
LOOP_COLUMNS = ("amplitude", "T", "u", "k_secant", "energy", "eta", "slip_share")
WITH_ERRORS = ("u", "k_secant", "energy", "eta")
#: Bars of displacement and energy for slopes, over the mean pressure in contact over E', see docs/slip.md.
STEEP = (4.0, 6.0)
FLOWS = 0.1  # plastic dissipation of a loop over that of friction, above which a loop is not steady


@dataclass(frozen=True, eq=False)
class JointSlip:
    """Slip of a joint about a preload; one entry per amplitude, forces those of the patch.

    Attributes:
        law: by the normal curve
        by_curve: paths of the law
        computed: paths of the solid; empty where only the curve was asked
        errors: error bars of the columns `WITH_ERRORS` of the method chosen, empty for a curve without bars
        notes: what to doubt, one sentence each
    """

    law: SlipLaw
    by_curve: tuple[SlipPath, ...]
    computed: tuple[SlipPath, ...] = ()
    errors: tuple[Mapping[str, float], ...] = ()
    notes: tuple[str, ...] = ()

    __repr__ = short_repr

    @property
    def paths(self) -> tuple[SlipPath, ...]:
        """Paths of the method chosen."""
        return self.computed or self.by_curve

    def loops(self) -> list[dict[str, float]]:
        """Columns of slip_loops.csv, one row per amplitude; those by the curve beside those of a solid."""
        rows = []
        for i, path in enumerate(self.paths):
            row = _loop_of(path)
            if self.errors:
                row |= {f"error_{name}": self.errors[i][name] for name in WITH_ERRORS}
            if self.computed:
                other = _loop_of(self.by_curve[i])
                row |= {f"{name}_curve": other[name] for name in LOOP_COLUMNS[2:]} | {"plastic": path.plastic}
            rows.append(row)
        return rows

    def steps(self) -> Iterator[dict[str, float]]:
        """Rows of slip.csv: one block per amplitude, from rest to the amplitude and around a closed loop."""
        array = self.law.array() if self.computed else None
        for path in self.paths:
            columns: dict[str, Any] = {"u": path.u, "T": path.T}
            if array is not None:
                columns["T_curve"] = array.follow(path.u)
            columns |= {"slip_share": path.slip_share, "dissipated": path.dissipated}
            for step in range(path.u.size):
                values = {name: float(column[step]) for name, column in columns.items()}
                yield {"amplitude": path.amplitude, "step": step} | values

    def vibration(self, mass: float, factor: float = 1.0) -> list[dict[str, float]]:
        """Frequency (1/time) and damping ratio of the tangential vibration at each amplitude.

        The secant stiffness gives the frequency and the loop the damping ratio, half of its loss factor.

        Args:
            mass: that vibrates on the joint (mass)
            factor: nominal area of the joint over that of the patch
        """
        return [
            {
                "amplitude": path.amplitude,
                "f": math.sqrt(factor * path.k_secant / mass) / (2.0 * math.pi),
                "zeta": 0.5 * path.eta,
            }
            for path in self.paths
        ]

    def to_dict(self, mass: float | None = None, factor: float = 1.0, *, units: str = "SI") -> dict[str, Any]:
        """Section "slip" of summary.json.

        Args:
            mass, factor: see `vibration`; without a mass no frequency follows
            units: see `lines`
        """
        return {
            "method": "solid" if self.computed else "curve",
            "friction": self.law.friction,
            "preload": self.law.preload,
            "limit": self.law.limit,
            "k_rest": float(self.law.k_tangent(0.0)),
            "loops": [{k: v if math.isfinite(v) else None for k, v in row.items()} for row in self.loops()],
            "vibration": [] if mass is None else self.vibration(mass, factor),
            "in_words": self.lines(mass, factor, units=units),
            "notes": list(self.notes),
        }

    def lines(self, mass: float | None = None, factor: float = 1.0, *, units: str = "SI") -> list[str]:
        """Frequency, or stiffness without a mass, and damping ratio at up to three amplitudes, in words.

        Args:
            mass, factor: see `vibration`
            units: "SI" shows SI units
        """
        si, found = units == "SI", []
        rows = self.vibration(mass or math.nan, factor)
        for i in sorted({0, len(rows) // 2, len(rows) - 1}):
            path, row = self.paths[i], rows[i]
            bars = {name: math.nan for name in WITH_ERRORS} | dict(self.errors[i] if self.errors else {})
            of_k, of_zeta = bars["k_secant"] / path.k_secant, bars["eta"] / path.eta
            if mass is None:
                what = f"stiffness {quantity(factor * path.k_secant, 'N/m' if si else '', 5, bar=of_k)}"
            else:
                what = f"frequency {quantity(row['f'], 'Hz' if si else '', 5, bar=0.5 * of_k)}"
            zeta = quantity(row["zeta"], "", 3, bar=of_zeta)
            found.append(f"Slip at {path.amplitude:g} of the friction limit: {what}, damping ratio {zeta}")
        return found

    def write(self, folder: Path) -> None:
        """Write slip.csv and slip_loops.csv."""
        for name, rows in ((SLIP, list(self.steps())), (SLIP_LOOPS, self.loops())):
            known = ({k: v if math.isfinite(v) else None for k, v in row.items()} for row in rows)
            write_csv(folder / name, tuple(rows[0]), known)


def slip_of_curve(
    curve: Any,
    settings: SlipSettings,
    material: Material,
    *,
    patch: float,
    height: float,
    sides: str = "rollers",
    computed: tuple[SlipPath, ...] = (),
) -> JointSlip:
    """Slip of a joint of two like bodies by the curve of one of them under a rigid flat.

    Args:
        curve: a `Curve`, or what else has the columns delta and force
        settings: friction, amplitudes, preload
        material: of the body
        patch: nominal area of the curve (length^2)
        height: of the block (length)
        sides: of the block, "rollers", "free" or "periodic"
        computed: paths of the solid at the same preload, see `quasistatic.slip_paths`

    Raises:
        InputError: the curve does not contain what is needed, or is as stiff as the block
        RangeError: the curve does not reach the preload

    Examples:
        >>> from asperity.slip import SlipSettings, slip_of_curve
        >>> z, steel = np.linspace(0.0, 1e-8, 41), asp.Material(E=200e9, nu=0.3)
        >>> slip = slip_of_curve({"delta": z, "force": 2e9 * z**1.5}, SlipSettings(friction=0.3), steel, patch=1e-12,
        ...                      height=1e-6)
        >>> print(slip.lines()[0])
        Slip at 0.1 of the friction limit: stiffness 73.108 kN/m, damping ratio 0.00141
    """
    columns = CurveColumns.of(curve)
    choice = choose(columns, "auto", settings.preload)
    block = height / (patch * material.block_modulus(sides)), height / (patch * material.lame[1])

    def law_on(normal: Law) -> SlipLaw:
        return SlipLaw(_down_to_zero(normal), choice.load, settings.friction, material.nu, block)

    law = law_on(choice.law)
    area = _area_of(curve, columns, choice)
    paths = tuple(path_of_law(law, t, steps=settings.steps, area=area) for t in settings.amplitudes)
    laws = tabulate(columns, choice)
    errors: tuple[Mapping[str, float], ...] = ()
    if math.isfinite(laws.bar):
        pressed = material.reduced_modulus * patch * (math.inf if area is None else area(np.array([law.preload]))[0])
        steep = float(law.preload / pressed)
        errors = _errors(law, laws.members(), law_on, settings.amplitudes, None if computed else steep)
    if computed and errors:  # the mesh of the solid, of which only the curve gives an estimate
        pairs = [(_loop_of(a), _loop_of(b)) for a, b in zip(computed, paths, strict=True)]
        errors = tuple(
            {k: bar + abs(a[k] - b[k]) for k, bar in row.items()} for row, (a, b) in zip(errors, pairs, strict=True)
        )
    return JointSlip(law, paths, computed, errors, tuple(_doubts(choice, paths, computed)))


def slip_of_case(
    case: Mapping[str, Any], curve: Any, preload: float | None = None, computed: tuple[SlipPath, ...] = ()
) -> JointSlip:
    """Slip of the patch of a run by its curve.

    Args:
        case: nested tables of the completed case, with the section [slip]
        curve: of the run
        preload: instead of that of the section (force)
        computed: see `slip_of_curve`, whose errors are raised
    """
    solid, block, patch = case["material"], case["block"], float(case["surface"]["L"]) ** 2
    settings = SlipSettings(**case["slip"] | ({} if preload is None else {"preload": preload}))
    material = Material(solid["E"], solid["nu"])  # the contact is elastic where it slips
    return slip_of_curve(
        curve, settings, material, patch=patch, height=block["height"], sides=block["sides"], computed=computed
    )


def _down_to_zero(law: Law) -> Law:
    """Law whose stiffness does not rise as the force falls to zero, which slips at last.

    Where few facets touch, the first points of a table may have a power below one; below them the force is then
    proportional to the approach.
    """
    if not isinstance(law, TableLaw) or law.slopes[0] * law.z[0] >= law.F[0]:
        return law
    k = np.full(law.z.size, np.nan) if law.k is None else law.k.copy()
    k[0] = law.F[0] / law.z[0]
    return replace(law, k=k, origin=0.0)


def _errors(
    law: SlipLaw,
    members: tuple[Law, ...],
    law_on: Callable[[Law], SlipLaw],
    amplitudes: tuple[float, ...],
    steep: float | None,
) -> tuple[Mapping[str, float], ...]:
    """Bars at each amplitude: what the ends of the bar of the normal curve change, and of the curve the method.

    The law takes the mean of the tangential compliance over all directions. Along the motion that of a wave is 1 to
    1/(1 - nu) times the normal one, so for spots of any shape the compliance of the interface lies within nu/(2 - nu)
    of it. The energy follows from it and from the slip that turns; nu is the bar of it, see docs/slip.md.

    A half-space has no slopes. A spot stands above its surroundings, and what is missing there makes it softer in
    shear in proportion to its slope, which is about the mean pressure in contact over E' (`steep`; None leaves the
    method out).
    """
    try:
        others = [law_on(member) for member in members]
    except AsperityError:  # at the end of its bar the curve does not reach the preload
        return ()
    found = []
    for t in amplitudes:
        values = _numbers(law, t)
        changes = {k: max((abs(_numbers(x, t)[k] - v) for x in others), default=0.0) for k, v in values.items()}
        if steep is not None:
            interface = 1.0 - law.block[1] * law.limit * t / values["u"]
            of_u = (law.nu / (2.0 - law.nu) + STEEP[0] * steep) * interface
            of_energy = law.nu + STEEP[1] * steep
            method = {"u": of_u, "k_secant": of_u, "energy": of_energy, "eta": of_energy + of_u}
            changes = {k: change + method[k] * values[k] for k, change in changes.items()}
        found.append(changes)
    return tuple(found)


def _numbers(law: SlipLaw, t: float) -> dict[str, float]:
    values = law.displacement(t), law.k_secant(t), law.energy(t), law.eta(t)
    return dict(zip(WITH_ERRORS, (float(value) for value in values), strict=True))


def _loop_of(path: SlipPath) -> dict[str, float]:
    values = (path.amplitude, path.force, path.displacement, path.k_secant, path.energy, path.eta, path.share)
    return dict(zip(LOOP_COLUMNS, values, strict=True))


def _area_of(curve: Any, columns: CurveColumns, choice: Choice) -> Callable[[Array], Array] | None:
    """Area of contact over the normal force on the branch of a law, None where the curve has none."""
    given = curve.get("area_fraction") if isinstance(curve, Mapping) else getattr(curve, "area_fraction", None)
    if given is None:
        return None
    area = np.asarray(given, float)
    among = columns.loading
    if choice.name == "unload-reload":
        last = next(leg for leg in columns.unloadings() if columns.branch[leg[-1]] == "unload")
        among = np.isin(np.arange(area.size), last)
    rows = columns.rising(among & (columns.force > 0.0) & (area > 0.0))
    if rows.size < 2:
        return None
    x, y = np.log(columns.force[rows]), np.log(area[rows])

    def at(force: Array) -> Array:
        light = np.minimum(np.log(force) - x[0], 0.0)  # below the first row the area is proportional to the force
        return np.asarray(np.exp(np.interp(np.log(force), x, y) + light))

    return at


def _doubts(choice: Choice, paths: tuple[SlipPath, ...], computed: tuple[SlipPath, ...]) -> Iterator[str]:
    if choice.note:
        yield choice.note
    elif choice.yielded and choice.name != "unload-reload":
        yield (
            "the contact has yielded, and the curve does not unload through the preload: slip follows from the elastic "
            "stiffness of the loading, which is too low at lighter forces; compute it with loading.unload = true"
        )
    if flowing := [f"{path.amplitude:g}" for path in computed if path.plastic > FLOWS * path.energy]:
        yield (
            f"the solid yields on in its first loop of the tangential force {', '.join(flowing)} mu P: u and k_secant "
            "are those of this loop, and its plastic flow (column plastic) is not in energy and eta"
        )
    if min(path.energy for path in paths) <= 0.0:
        yield (
            "the normal curve is not convex below the preload, so a loop by it would gain energy: take more load steps"
        )
