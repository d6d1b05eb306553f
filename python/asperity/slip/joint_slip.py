"""Slip of a joint by its curve: paths and loops of each amplitude with their bars, and their files."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.errors import AsperityError
from asperity.model.material import Material
from asperity.model.slip import SlipSettings
from asperity.runtime.display import short_repr
from asperity.runtime.files import write_csv
from asperity.runtime.run_folder import SLIP, SLIP_LOOPS
from asperity.slip.branch import branch_rows, column_of, down_to_zero, measured_ratio, stuck_law
from asperity.slip.law import SlipLaw, SlipPath, path_of_law
from asperity.units import quantity
from asperity.vibration.curve_law import Bars, CurveLaw
from asperity.vibration.law import Law, bar_of
from asperity.vibration.source import Choice, CurveColumns, choose

#: Columns of slip_loops.csv with an error bar.
WITH_ERRORS = ("u", "k_secant", "energy", "eta")
OF_THE_CURVE = "The bars of slip are those of the curve, without the error of the law (docs/how-to/joint.md)"
KINEMATIC = (
    "the hardening is kinematic, at least in part: the solid flows in each loop, and slips more than here, where its "
    "plastic strain is held (docs/how-to/joint.md)"
)


@dataclass(frozen=True, eq=False)
class JointSlip:
    """Slip of a joint about a preload; one entry per amplitude, forces those of the patch.

    Attributes:
        law: by the normal curve
        paths: of the law
        errors: error bars of the columns `WITH_ERRORS`, empty for a curve without bars; those of the curve alone
        notes: what to doubt, one sentence each
    """

    law: SlipLaw
    paths: tuple[SlipPath, ...]
    errors: tuple[Mapping[str, float], ...] = ()
    notes: tuple[str, ...] = ()

    __repr__ = short_repr

    def loops(self) -> list[dict[str, float]]:
        """Columns of slip_loops.csv, one row per amplitude."""
        rows = [path.loop() for path in self.paths]
        for row, errors in zip(rows, self.errors, strict=False):
            row |= {f"error_{name}": errors[name] for name in WITH_ERRORS}
        return rows

    def steps(self) -> Iterator[dict[str, float]]:
        """Rows of slip.csv: one block per amplitude, from rest to the amplitude and around a closed loop."""
        for path in self.paths:
            columns = {name: getattr(path, name).tolist() for name in ("u", "T", "slip_share", "dissipated")}
            for step, values in enumerate(zip(*columns.values(), strict=True)):
                yield {"amplitude": path.amplitude, "step": step} | dict(zip(columns, values, strict=True))

    def vibration(self, mass: float, factor: float = 1.0) -> list[dict[str, float]]:
        """Frequency (1/time), of the secant stiffness, and damping ratio, half of the loss factor, at each amplitude.

        Args:
            mass: that vibrates on the joint (mass)
            factor: nominal area of the joint over that of the patch
        """
        f = (math.sqrt(factor * path.k_secant / mass) / (2.0 * math.pi) for path in self.paths)
        return [{"amplitude": p.amplitude, "f": x, "zeta": 0.5 * p.eta} for p, x in zip(self.paths, f, strict=True)]

    def to_dict(self, mass: float | None = None, factor: float = 1.0, *, units: str = "SI") -> dict[str, Any]:
        """Section "slip" of summary.json.

        Args:
            mass, factor: see `vibration`; without a mass no frequency follows
            units: "SI" shows SI units in its words
        """
        return {
            "friction": self.law.friction, "preload": self.law.preload, "limit": self.law.limit,
            "k_rest": float(self.law.k_tangent(0.0)),
            "loops": [_known(row) for row in self.loops()],
            "vibration": [] if mass is None else self.vibration(mass, factor),
            "in_words": self.lines(mass, factor, units=units), "notes": list(self.notes),
        }  # fmt: skip

    def lines(self, mass: float | None = None, factor: float = 1.0, *, units: str = "SI") -> list[str]:
        """Frequency, or stiffness without a mass, and damping ratio at up to three amplitudes; see `to_dict`."""
        si, found, rows = units == "SI", [], self.vibration(mass or math.nan, factor)
        for i in sorted({0, len(rows) // 2, len(rows) - 1}):
            path, row = self.paths[i], rows[i]
            bars = self.errors[i] if self.errors else dict.fromkeys(WITH_ERRORS, math.nan)
            of_k, of_zeta = bars["k_secant"] / path.k_secant, bars["eta"] / (path.eta or math.nan)
            if mass is None:
                what = f"stiffness {quantity(factor * path.k_secant, 'N/m' if si else '', 5, bar=of_k)}"
            else:
                what = f"frequency {quantity(row['f'], 'Hz' if si else '', 5, bar=0.5 * of_k)}"
            zeta = quantity(row["zeta"], "", 3, bar=of_zeta)
            found.append(f"Slip at {path.amplitude:g} of the friction limit: {what}, damping ratio {zeta}")
        return [*found, OF_THE_CURVE] if self.errors else found

    def write(self, folder: Path) -> None:
        """Write slip.csv and slip_loops.csv."""
        for name, rows in ((SLIP, list(self.steps())), (SLIP_LOOPS, self.loops())):
            write_csv(folder / name, tuple(rows[0]), map(_known, rows))


def _known(row: Mapping[str, float]) -> dict[str, float | None]:
    return {name: value if math.isfinite(value) else None for name, value in row.items()}


def slip_of_curve(
    curve: Any, settings: SlipSettings, material: Material, *, patch: float, height: float, sides: str = "rollers"
) -> JointSlip:
    """Slip of a joint of two like bodies by the curve of one of them under a rigid flat.

    Args:
        curve: a `Curve`, or what else has the columns delta and force
        settings: friction, amplitudes, preload
        material: of the body
        patch: nominal area of the curve (length^2)
        height: of the block (length)
        sides: of the block, "rollers", "free" or "periodic"

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
    rows = branch_rows(columns, choice)
    block = height / (patch * material.block_modulus(sides)), height / (patch * material.lame[1])
    ratio = measured_ratio(curve, columns, rows, block, settings.direction)

    def law_on(law: Law) -> SlipLaw:
        if isinstance(law, CurveLaw):
            law = down_to_zero(law)
        if ratio is None or not isinstance(law, CurveLaw):
            return SlipLaw(law, choice.load, settings.friction, material.nu, block)
        stuck = stuck_law(law, *ratio, block[0], choice.load)
        return SlipLaw(stuck, choice.load, settings.friction, 0.0, (0.0, block[1]))

    law, t = law_on(choice.law), np.array(settings.amplitudes)
    area = _area_of(curve, columns, rows)
    paths = tuple(path_of_law(law, amplitude, steps=settings.steps, area=area) for amplitude in settings.amplitudes)
    # the law passes through its points: only their errors count, not those of a local fit
    of_force, of_k = columns.bar_at(choice.load), columns.bar_at(choice.load, elastic=True)
    errors_of_curve = Bars(choice.load, of_force, stiffness=of_k if of_k > 0.0 else 0.0)
    bars: Array = np.zeros((len(WITH_ERRORS), 0))
    unloaded = not choice.yielded or choice.name == "unload-reload"
    if isinstance(choice.law, CurveLaw) and ratio is not None and unloaded and math.isfinite(of_force):
        with suppress(AsperityError):  # at the end of its bar the curve may not reach the preload
            bars = bar_of(replace(choice.law, bars=errors_of_curve), lambda side: _columns(law_on(side), t))
    errors = tuple({k: float(x) for k, x in zip(WITH_ERRORS, row, strict=True)} for row in bars.T)
    return JointSlip(law, paths, errors, tuple(_doubts(choice, ratio is not None, paths)))


def slip_of_case(case: Mapping[str, Any], curve: Any, preload: float | None = None) -> JointSlip:
    """Slip of the patch of a run by its curve.

    Args:
        case: nested tables of the completed case, with the section [slip]
        curve: of the run
        preload: instead of that of the section (force)

    Raises:
        AsperityError: see `slip_of_curve`
    """
    solid, block, patch = case["material"], case["block"], float(case["surface"]["L"]) ** 2
    settings = SlipSettings(**case["slip"] | ({} if preload is None else {"preload": preload}))
    material = Material(solid["E"], solid["nu"])  # the contact is elastic where it slips
    found = slip_of_curve(curve, settings, material, patch=patch, height=block["height"], sides=block["sides"])
    if solid.get("hardening", "isotropic") in ("isotropic", 0) or not CurveColumns.of(curve).yielded(found.law.preload):
        return found
    return replace(found, notes=(*found.notes, KINEMATIC))


def _columns(law: SlipLaw, t: Array) -> Array:
    """Columns `WITH_ERRORS` of a law at amplitudes (n,), (4, n)."""
    return np.stack([law.displacement(t), law.k_secant(t), law.energy(t), law.eta(t)])


def _area_of(curve: Any, columns: CurveColumns, rows: Array) -> Callable[[Array], Array] | None:
    """Area of contact over the normal force on the branch of a law, None where the curve has none."""
    area = column_of(curve, "area_fraction", columns.delta.size)
    rows = rows[area[rows] > 0.0]
    if rows.size < 2:
        return None
    x, y = np.log(columns.force[rows]), np.log(area[rows])

    def at(force: Array) -> Array:
        light = np.minimum(np.log(force) - x[0], 0.0)  # below the first row the area is proportional to the force
        return np.asarray(np.exp(np.interp(np.log(force), x, y) + light))

    return at


def _doubts(choice: Choice, measured: bool, paths: tuple[SlipPath, ...]) -> Iterator[str]:
    if choice.note:
        yield choice.note
    elif choice.yielded and choice.name != "unload-reload":
        yield (
            "the contact has yielded, and the curve does not unload through the preload: slip follows from the elastic "
            "stiffness of the loading, which is too low at lighter forces, and has no bars; compute it with "
            "loading.unload = true"
        )
    if not measured:
        yield (
            "the curve has no tangential stiffness (columns k_t and k_t_x): that of an isotropic half-space is taken, "
            "which long spots and steep slopes do not have; compute it with output.stiffness = true"
        )
    if min(path.energy for path in paths) <= 0.0:
        yield (
            "the normal curve is not convex below the preload, so a loop by it would gain energy: take more load steps"
        )
