"""Slip of a joint by its curve: loops of each amplitude with their bars, and their files."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.errors import AsperityError
from asperity.model.joint import SlipSettings
from asperity.model.material import Material
from asperity.runtime.display import short_repr
from asperity.runtime.files import write_csv
from asperity.runtime.run_folder import SLIP, SLIP_LOOPS
from asperity.slip.law import SlipLaw
from asperity.units import quantity
from asperity.vibration.curve_law import Bars, CurveLaw
from asperity.vibration.law import Law, bar_of
from asperity.vibration.source import Choice, CurveColumns, choose

RESPONSE = "slip_response.csv"
#: Columns of slip_loops.csv with an error bar.
WITH_ERRORS = ("u", "k_secant", "energy", "eta")
OF_THE_CURVE = "The bars of slip are those of the curve, without the error of the law (docs/how-to/joint.md)"
KINEMATIC = (
    "the hardening is kinematic, at least in part: the solid flows in each loop, and slips more than here, where its "
    "plastic strain is held (docs/how-to/joint.md)"
)


@dataclass(frozen=True, eq=False)
class JointSlip:
    """Slip of a joint about a preload at several amplitudes, forces those of the patch.

    Attributes:
        law: by the normal curve
        settings: amplitudes, and steps of their paths
        bars: those of the columns `WITH_ERRORS` at each amplitude (4, n), by the curve alone; NaN without any
        notes: what to doubt, one sentence each
        area: rising normal forces (n,) and the area of contact at each, in any unit (n,); empty where it is unknown
        mass: that vibrates on the joint (mass); without a mass, None, no frequency follows
        factor: nominal area of the joint over that of the patch
        units: "SI" shows SI units in words
        responses: by harmonic force over the limit of friction: frequency (1/time) and amplitude (length), along the
            curve
    """

    law: SlipLaw
    settings: SlipSettings
    bars: Array
    notes: tuple[str, ...] = ()
    area: tuple[Array, Array] = (np.empty(0), np.empty(0))
    mass: float | None = None
    factor: float = 1.0
    units: str = "SI"
    responses: Mapping[float, tuple[Array, Array]] = field(default_factory=dict)

    __repr__ = short_repr

    def loops(self) -> list[dict[str, float]]:
        """Rows of slip_loops.csv, one for each amplitude."""
        t = np.array(self.settings.amplitudes)
        columns = {"amplitude": t, "T": self.law.limit * t}
        columns |= dict(zip(WITH_ERRORS, _columns(self.law, t), strict=True))
        columns["slip_share"] = self._share(self.law.preload * (1.0 - t))
        if np.isfinite(self.bars).all():
            columns |= {f"error_{name}": bar for name, bar in zip(WITH_ERRORS, self.bars, strict=True)}
        return _rows(columns)

    def steps(self) -> Iterator[dict[str, float]]:
        """Rows of slip.csv: one block per amplitude, from rest to the amplitude and around a closed loop."""
        for amplitude in self.settings.amplitudes:
            path = self.law.path(amplitude, self.settings.steps)
            path["slip_share"] = self._share(path.pop("sticks"))
            for step, row in enumerate(_rows({name: path[name] for name in ("u", "T", "slip_share", "dissipated")})):
                yield {"amplitude": amplitude, "step": step} | row

    def _share(self, sticks: Array) -> Array:
        """Share of the area of contact that slips (n,), by the normal forces whose contact sticks; NaN if unknown."""
        if not self.area[0].size:
            return np.full(sticks.shape, np.nan)
        force, area = (np.append(0.0, column) for column in self.area)
        return np.asarray(1.0 - np.interp(sticks, force, area) / np.interp(self.law.preload, force, area))

    def vibration(self) -> list[dict[str, float]]:
        """Frequency of the secant stiffness (1/time) and damping ratio, half of the loss factor, at each amplitude."""
        if self.mass is None:
            return []
        unit = math.sqrt(self.factor / self.mass) / (2.0 * math.pi)
        return [
            {"amplitude": row["amplitude"], "f": unit * math.sqrt(row["k_secant"]), "zeta": 0.5 * row["eta"]}
            for row in self.loops()
        ]

    def to_dict(self) -> dict[str, Any]:
        """Section "slip" of summary.json; with responses also the mass and the peak of each."""
        peaks = [
            {"force": share, "f": float(f[a.argmax()]), "amplitude": float(a.max())}
            for share, (f, a) in self.responses.items()
        ]
        more = {"mass": self.mass, "peaks": peaks} if peaks else {}
        return more | {
            "friction": self.law.friction, "preload": self.law.preload, "limit": self.law.limit,
            "k_rest": float(self.law.k_tangent(0.0)), "loops": [_known(row) for row in self.loops()],
            "vibration": self.vibration(), "in_words": self.lines(), "notes": list(self.notes),
        }  # fmt: skip

    def lines(self) -> list[str]:
        """Frequency, or stiffness without a mass, and damping ratio at up to three amplitudes."""
        rows, moving, found = self.loops(), self.vibration(), []
        for i in sorted({0, len(rows) // 2, len(rows) - 1}):
            k, eta = rows[i]["k_secant"], rows[i]["eta"]
            of_k, of_eta = (rows[i].get(f"error_{name}", math.nan) for name in ("k_secant", "eta"))
            name, unit, value, bar = "stiffness", "N/m", self.factor * k, of_k / k
            if moving:
                name, unit, value, bar = "frequency", "Hz", moving[i]["f"], 0.5 * bar
            shown = quantity(value, unit if self.units == "SI" else "", 5, bar=bar)
            zeta = quantity(0.5 * eta, "", 3, bar=of_eta / (eta or math.nan))
            at = rows[i]["amplitude"]
            found.append(f"Slip at {at:g} of the friction limit: {name} {shown}, damping ratio {zeta}")
        return [*found, OF_THE_CURVE] if np.isfinite(self.bars).all() else found

    def write(self, folder: str | Path) -> None:
        """Write slip.csv and slip_loops.csv of the patch; with responses slip_response.csv of the joint."""
        folder, limit = Path(folder), self.factor * self.law.limit
        folder.mkdir(parents=True, exist_ok=True)
        responses: list[dict[str, float]] = [
            {"force": share * limit, "frequency": float(x), "amplitude": float(y)}
            for share, (f, a) in self.responses.items()
            for x, y in zip(f, a, strict=True)
        ]
        tables = {SLIP: list(self.steps()), SLIP_LOOPS: self.loops(), RESPONSE: responses}
        for name, rows in tables.items():
            if rows:
                write_csv(folder / name, tuple(rows[0]), rows)


def _rows(columns: Mapping[str, Array]) -> list[dict[str, float]]:
    return [dict(zip(columns, map(float, row), strict=True)) for row in np.transpose(list(columns.values()))]


def _known(row: Mapping[str, float]) -> dict[str, float | None]:
    return {name: value if math.isfinite(value) else None for name, value in row.items()}


def _columns(law: SlipLaw, t: Array) -> Array:
    """Columns `WITH_ERRORS` of a law at amplitudes (n,), (4, n)."""
    return np.stack([law.displacement(t), law.k_secant(t), law.energy(t), law.eta(t)])


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
        Slip at 0.1 of the friction limit: stiffness 73.108 kN/m, damping ratio 0.00142
    """
    columns = CurveColumns.of(curve, block=height / (patch * material.block_modulus(sides)))
    choice, block = choose(columns, "auto", settings.preload, "slip.preload"), height / (patch * material.lame[1])
    ratios = _ratios(columns, choice, block, settings.direction)
    make = partial(_slip_law, choice.load, settings.friction, material.nu, block, ratios)
    law, t, measured = make(choice.law), np.array(settings.amplitudes), ratios[0].size > 0
    bars: Array = np.full((len(WITH_ERRORS), t.size), np.nan)
    if isinstance(choice.law, CurveLaw) and measured and (not choice.yielded or choice.name == "unload-reload"):
        # the law passes through its points: only their errors count, not those of a local fit
        of_force, of_k = (columns.bar_at(choice.load, name) for name in ("P_star", "k_n_elastic"))
        of_curve = replace(choice.law, bars=Bars(choice.load, of_force, stiffness=float(np.nan_to_num(of_k))))
        with suppress(AsperityError):  # at the end of its bar the curve may not reach the preload
            bars = bar_of(of_curve, lambda side: _columns(make(side), t))
    area = _by_force(columns, choice, columns.curve.area_fraction[choice.rows])
    return JointSlip(law, settings, bars, tuple(_doubts(choice, measured, law.energy(t), material)), area)


def slip_of_case(case: Mapping[str, Any], curve: Any, preload: float | None = None) -> JointSlip:
    """Slip of the patch of a run by its curve.

    Args:
        case: nested tables of the completed case, with the section [slip]
        curve: of the run
        preload: where the section has none (force)

    Raises:
        AsperityError: see `slip_of_curve`
    """
    solid, block, patch = case["material"], case["block"], float(case["surface"]["L"]) ** 2
    settings = SlipSettings(**{"preload": preload} | case["slip"])
    names = ("E", "nu", "yield_strength", "tangent_modulus", "hardening")[: 2 if "law" in solid else None]
    material = Material(**{name: solid[name] for name in names if name in solid})
    return slip_of_curve(curve, settings, material, patch=patch, height=block["height"], sides=block["sides"])


def _ratios(columns: CurveColumns, choice: Choice, block: float, direction: str) -> tuple[Array, Array]:
    """Forces (n,), rising, and tangential over normal compliance of the interface without slip (n,), of a branch.

    Empty without the columns k_n_elastic, k_t and k_t_x. The block has a tangential compliance (length/force), the
    direction is that of the motion, "x" or "y".
    """
    mean, along_x = columns.curve.k_t[choice.rows], columns.curve.k_t_x[choice.rows]
    with np.errstate(divide="ignore", invalid="ignore"):  # rows without contact have no stiffness
        tangential = 1.0 / (along_x if direction == "x" else 2.0 * mean - along_x) - block
        ratio = tangential * columns.curve.k_n_elastic[choice.rows]
    return _by_force(columns, choice, ratio)


def _by_force(columns: CurveColumns, choice: Choice, values: Array) -> tuple[Array, Array]:
    """Forces (n,), rising, and positive values at the rows of a branch."""
    force = columns.curve.force[choice.rows]
    known = np.flatnonzero((force > 0.0) & (values > 0.0) & np.isfinite(values))
    known = known[np.argsort(force[known], kind="stable")]
    return force[known], values[known]


def _slip_law(load: float, friction: float, nu: float, block: float, ratios: tuple[Array, Array], law: Law) -> SlipLaw:
    """Law of slip by a normal law, with the ratios of its compliances where they are known, see `_ratios`."""
    if not isinstance(law, CurveLaw):
        return SlipLaw(law, load, friction, nu, block)
    if ratios[0].size:
        law, nu = without_slip(law, *ratios), 0.0
    if law.slopes[0] * law.z[0] < law.F[0]:  # few facets touch; a stiffness that rises as the force falls never slips
        k = np.full(law.z.size, np.nan) if law.k is None else law.k.copy()
        k[0] = law.F[0] / law.z[0]
        law = replace(law, k=k)
    return SlipLaw(law, load, friction, nu, block)


def without_slip(law: CurveLaw, forces: Array, ratios: Array) -> CurveLaw:
    """Normal force over the displacement w with dP/dw = k_t, the tangential stiffness without slip.

    Args:
        law: of the normal force over the approach
        forces, ratios: tangential over normal compliance at forces, both (n,)
    """
    ratio = np.interp(law.F, forces, ratios)
    steps = 0.5 * (ratio[1:] + ratio[:-1]) * np.diff(law.z)
    w = ratio[0] * law.z[0] + np.append(0.0, np.cumsum(steps))
    return CurveLaw(w, law.F, k=law.slopes / ratio, name="contact without slip")


def _doubts(choice: Choice, measured: bool, energy: Array, material: Material) -> Iterator[str]:
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
    if energy.min() <= 0.0:
        yield (
            "the normal curve is not convex below the preload, so a loop by it would gain energy: take more load steps"
        )
    if choice.yielded and material.kinematic_share > 0.0:
        yield KINEMATIC
