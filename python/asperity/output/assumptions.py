"""The list of assumptions of a run: each that applies with its value in this run, its limit and a verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from math import inf, nan, pi, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.curve import Curve
from asperity.mesh.resolution import ONE_MESH
from asperity.model.problem import Problem
from asperity.output.indentation import added_by_block, spot_of
from asperity.output.patches import Spread, hurst_without_end
from asperity.reference import LONG_WAVES, pull_off, radiation_loss, stickiness, tabor_parameter
from asperity.surface.base import FLAT
from asperity.surface.shapes import SHARP
from asperity.units import quantity

if TYPE_CHECKING:
    from asperity.vibration.oscillator import Numbers

FINE, DOUBTFUL = "fine", "doubtful"
#: Strain up to which small-strain theory applies. The engineering strain e and the logarithmic strain ln(1 + e) have a
#: relative difference of e/2 to first order: 5 % here.
SMALL_STRAIN = 0.1
TABOR = 2.8  # hardness over yield strength of a perfectly plastic solid (Tabor 1951)
YIELD_STRAIN = 0.02  # yield strength over E of metallic glasses, the greatest of metals; steels have 0.001 to 0.01
MOST_OF_METALS = 0.45  # Poisson's ratio of indium; those of gold and lead are 0.44, of rubber 0.49 and more
FIRST_YIELD = 1.6  # greatest pressure of a spot over the yield strength at first yield (Johnson, 1985, eq. 6.9)
ADDED = 5.0  # part of the approach that the block adds [%]
SMALL_CONTACT = 1e-6  # radius below which metals are harder [m]
WORK = 0.2  # of adhesion: surfaces in air have some 0.05, clean metals 1 [J/m^2]
WEAK = 0.01  # pull-off over the greatest force
POINTS = 257  # per side, for slope and curvature
NEGLIGIBLE = 0.1  # part of the damping ratio that may be left out
LOCKING = 70.0  # excess of the force over h/L, the greatest of three surfaces [%]
LONGER = 1.2  # rms height of a joint over that of its patch beyond which the patch does not stand for it
DIFFERENT = 20.0  # change of the stiffness beyond which a patch does not stand for its joint [%]


@dataclass(frozen=True)
class Assumption:
    """A line of the list.

    Attributes:
        name: of the assumption
        value: in this run [unit]
        limit: that the value must not exceed, or not fall below where `bound` is "least" [unit]
        unit: of both, empty for a ratio
        source: of the limit
        advice: what to do where it is doubtful
        detail: what else is known
        bound: "most" or "least"
        warned: whether a run warns of its doubt, because it violates an assumption of its own model

    Examples:
        >>> line = Assumption("approach over depth", 1.2, 1.0, "", "geometry", "a smaller load")
        >>> line.verdict, describe(line.to_dict())
        ('doubtful', 'approach over depth: 1.2, at most 1; a smaller load')
    """

    name: str
    value: float
    limit: float
    unit: str
    source: str
    advice: str
    detail: str = ""
    bound: str = "most"
    warned: bool = False

    @property
    def verdict(self) -> str:
        """Whether the value is within the limit: "fine" or "doubtful"."""
        sign = 1.0 if self.bound == "most" else -1.0
        within = sign * (self.value - self.limit) <= 1e-9 * abs(self.limit)  # systems of units are rounded
        return FINE if within else DOUBTFUL

    def to_dict(self) -> dict[str, Any]:
        """Record of summary.json."""
        return asdict(self) | {"verdict": self.verdict}


def value_and_limit(record: Mapping[str, Any]) -> tuple[str, str]:
    """Value and limit of a record of summary.json with their unit."""
    value, limit = (
        quantity(number, "m", 3) if record["unit"] == "m" else f"{number:.3g} {record['unit']}".rstrip()
        for number in (record["value"], record["limit"])
    )
    return value, limit


def describe(record: Mapping[str, Any]) -> str:
    """A record of summary.json in one line for the terminal."""
    value, limit = value_and_limit(record)
    return f"{record['name']}: {value}, at {record['bound']} {limit}; {record['advice']}"


@dataclass(frozen=True)
class Evidence:
    """What is known of a run when its assumptions are judged.

    Attributes:
        curve: its curve
        problem: what was solved, with the kinematics of the run
        si: whether lengths are in m and stresses in Pa
        h: size of the elements in the contact of a run on one mesh [length]; None otherwise
        small_strain: greatest change of the force by small strain and its limit [per cent]; None where unknown
        density: of the solid [mass/length^3]; None where unknown
        vibration: stiffness, frequency and damping of the small vibration; None where there is none
        side: of the nominal area of the joint [length]; None takes the side of the patch
        patches: change of the stiffness of a joint by other patches; None without a joint or without others
    """

    curve: Curve
    problem: Problem
    si: bool = False
    h: float | None = None
    small_strain: tuple[float, float] | None = None
    density: float | None = None
    vibration: Numbers | None = None
    side: float | None = None
    patches: Spread | None = None

    def greatest(self, column: str) -> float:
        """Greatest value in a column of the curve, 0 where it is unknown."""
        return float(np.nan_to_num(getattr(self.curve, column)).max())

    @property
    def plane(self) -> bool:
        """Whether the top is a plane, in full contact from the start."""
        surface = self.problem.composite
        return surface.maximum()[2] - surface.mean() <= FLAT * surface.L

    @property
    def contact_radius(self) -> float:
        """Radius of the mean contact spot at the greatest force, taken as a circle [length]; nan where unknown."""
        spots = int(self.curve.spots[self.curve.top])
        area = float(self.curve.area_fraction[self.curve.top]) * self.problem.surface.L**2
        return sqrt(area / (pi * spots)) if spots else nan

    @property
    def summit_radius(self) -> float:
        """Radius of the mean curvature of the summit [length]; inf for a plane or a sharp one."""
        surface = self.problem.composite
        x, y, _ = surface.maximum()
        xx, _, yy = surface.hessian(x, y)
        curvature = -0.5 * float(xx + yy)
        return 1.0 / curvature if 0.0 < curvature * surface.L < 0.5 / SHARP else inf


def assumptions_of(evidence: Evidence) -> list[Assumption]:
    """All lines that apply to a run, by subject; none for a run without a step."""
    if not len(evidence.curve):
        return []
    return [line for subject in SUBJECTS for line in subject(evidence) if line.value == line.value]


def _strain(run: Evidence) -> Iterator[Assumption]:
    """Change of the force by small strain, or else the greatest strain; the pressure of an elastic solid.

    The greatest pressure of a node is no measure: at an edge of the contact, or a corner of the surface, it grows with
    each finer mesh, and a single node would decide. Force over true contact area is an integral over the contact, and
    converges. A Hertzian spot of this mean pressure has 3/2 of it in its middle: a rough contact has more somewhere.
    """
    material = run.problem.material
    detail, advice = "", 'material.kinematics = "finite", or a smaller load'
    if np.isfinite(run.curve.strained_fraction).any():
        detail = f"equivalent strain above 5 % in {100 * run.greatest('strained_fraction'):.2g} % of the volume"
    if run.small_strain is not None and not material.finite:
        value, limit = run.small_strain
        yield Assumption(
            "small strain", value, limit, "% of the force", "the slope of the spots in contact", advice, detail,
            warned=True,
        )  # fmt: skip
    elif not material.finite:
        what = "plastic" if material.flows else "equivalent"
        yield Assumption(
            f"small strain: greatest {what} strain",
            run.greatest("max_plastic_strain" if material.flows else "max_strain"), SMALL_STRAIN, "",
            "e and ln(1 + e) differ by 5 % at 0.1", advice, detail, warned=True,
        )  # fmt: skip
    if not material.plastic and material.law is None and material.nu <= MOST_OF_METALS:
        pressure = 1.5 * float(run.curve.mean_pressure[run.curve.top])
        yield Assumption(
            "elastic: 3/2 of the mean contact pressure over E", pressure / material.E, TABOR * YIELD_STRAIN, "",
            "Tabor, The Hardness of Metals (1951); Johnson & Samwer, Phys. Rev. Lett. 95 (2005) 195501",
            "give material.yield_strength, unless the solid is no metal",
            "a spot of this greatest pressure yields where the yield strength is below "
            f"{quantity(pressure / FIRST_YIELD, 'Pa' if run.si else '', 3)}",
            warned=True,
        )  # fmt: skip


def _locking(run: Evidence) -> Iterator[Assumption]:
    """Cells that keep their volume where they flow, on one mesh."""
    material = run.problem.material
    if run.h is not None and material.flows and not material.relaxes:
        yield Assumption(
            "locking: force by a law whose cells keep their volume where they flow",
            LOCKING * run.h / run.problem.surface.L, 100 * ONE_MESH, "% of the force",
            "self-affine surfaces without hardening (docs/extend.md)",
            "accuracy.tolerance, a smaller mesh.h_contact, or a law with yield_strength", warned=True,
        )  # fmt: skip


def _patch(run: Evidence) -> Iterator[Assumption]:
    """One patch for a joint."""
    problem, length = run.problem, "m" if run.si else ""
    if (found := run.patches) is not None:
        yield Assumption(
            "joint: stiffness by other patches of its roughness", 100 * found.bar, DIFFERENT, "%",
            f"half-space pressed with {found.patches} patches under one plane",
            "a larger surface.L, or the mean of several seeds",
            f"the mean of the patches is {found}; this one has {int(run.curve.spots[run.curve.top])} spot(s) at the "
            "greatest force",
        )  # fmt: skip
    along = (run.side or 0.0) / problem.surface.L  # patches along a side of the joint
    if along > 1.0 and (beyond := hurst_without_end(problem.surface)) is not None:
        H, measured = beyond
        yield Assumption(
            "joint: rms height with the waves longer than the patch, over that of the patch", along**H, LONGER, "",
            "self-affine surface, whose contact stiffness is as the load over the rms height: Persson, Phys. Rev. "
            "Lett. 99 (2007) 125502",
            "a patch so large that its spectrum flattens (surface.lambda_roll of kind self-affine), or a smaller joint",
            f"{along:.3g} patches along each side of the joint; waves from {quantity(problem.surface.L, length, 3)} to "
            f"{quantity(run.side or 0.0, length, 3)} are not on the patch, and if the roughness goes on with "
            f"H = {H:.2g}{'' if measured else ', which is supposed,'} the stiffness is less by about this factor",
        )  # fmt: skip


def _block(run: Evidence) -> Iterator[Assumption]:
    """Yield below the surface."""
    problem = run.problem
    if problem.material.yield_strength is not None:
        pressure = float(run.curve.force.max()) / problem.surface.L**2
        yield Assumption(
            "block: mean pressure over that at which it yields",
            pressure / problem.material.yield_pressure(problem.sides), 1.0, "",
            "Johnson, Contact Mechanics (1985), eq. 6.1", "a smaller load, or read the curve up to there", warned=True,
        )  # fmt: skip


def _added(run: Evidence) -> Iterator[Assumption]:
    """Part of the approach at the greatest force that the block adds to its contact.

    A rough surface is part of a wide one, whose mean planes approach: the block adds its compression. A spot alone has
    the approach on a half-space, and the base and the sides of the block, which mirror the spot, count too.
    """
    problem, surface, top = run.problem, run.problem.composite, run.curve.top
    pressure, delta = float(run.curve.force[top]) / surface.L**2, float(run.curve.delta[top])
    if run.plane or not delta > 0.0:
        return
    added, wide = pressure * problem.height / problem.material.block_modulus(problem.sides), "the surface alone"
    if spot_of(surface) is not None:
        unit = added_by_block(problem, float(run.curve.area_fraction[top]))
        if unit != unit:
            return
        added, wide = surface.L * pressure / problem.material.reduced_modulus * unit, "a half-space"
    length = "m" if run.si else ""
    yield Assumption(
        "block: part of the approach that it adds", 100.0 * abs(added) / delta, ADDED, "%",
        "compression, base and mirrored sides of an elastic layer (docs/theory.md)",
        "take it out of the approach, or choose another block.height",
        f"the approach at the greatest force is {'longer' if added > 0.0 else 'shorter'} than that of {wide} by "
        f"{quantity(abs(added), length, 2)}: {quantity(delta, length, 3)}, not {quantity(delta - added, length, 3)}",
    )  # fmt: skip


def _size(run: Evidence) -> Iterator[Assumption]:
    """Adhesion, of a rough surface or of a smooth summit, and the hardness of small contacts; SI units only."""
    if not run.si:
        return
    surface, modulus = run.problem.composite, run.problem.material.reduced_modulus
    radius, force = run.summit_radius, float(run.curve.force.max())
    if surface.rough and not run.plane:
        slope = surface.rms_slope()
        xx, _, yy = surface.grid_hessian(POINTS)
        curvature = 0.5 * float(np.sqrt(np.mean((xx + yy) ** 2)))
        yield Assumption(
            f"adhesion: stickiness for {WORK:g} J/m²", stickiness(slope, curvature, WORK, modulus), 1.0, "",
            "Pastewka & Robbins, PNAS 111 (2014) 3298, eq. 10",
            "the surface sticks: contact without adhesion is not enough", "it falls as the work of adhesion rises",
            bound="least",
        )  # fmt: skip
    elif radius < inf and force > 0.0:
        tabor = tabor_parameter(radius, WORK, modulus)
        adhesion = pull_off(radius, WORK, tabor)
        yield Assumption(
            f"adhesion: pull-off of the summit over the greatest force, {WORK:g} J/m²", adhesion / force,
            WEAK, "", "Tabor, J. Colloid Interface Sci. 58 (1977) 2; Carpick et al., ibid. 211 (1999) 395",
            "a greater load: adhesion adds to a light one",
            f"{adhesion:.2g} N, Tabor's parameter {tabor:.2g}",
        )  # fmt: skip
    if run.greatest("max_plastic_strain") > 0.0:
        contact = run.contact_radius
        yield Assumption(
            "size effect: radius of contact and summit", float(np.fmin(contact, radius)), SMALL_CONTACT, "m",
            "Nix & Gao, J. Mech. Phys. Solids 46 (1998) 411; Swadener et al., ibid. 50 (2002) 681",
            "a yield strength measured at this size: metals are harder there than in bulk",
            f"mean contact spot {quantity(contact, 'm', 2)}, summit {quantity(radius, 'm', 2)}", bound="least",
        )  # fmt: skip


def _radiation(run: Evidence) -> Iterator[Assumption]:
    """Damping by waves that leave the contact, which the model does not have."""
    if run.vibration is None or run.density is None:
        return
    solid, frequency, damping = run.problem.material, run.vibration.frequency, run.vibration.damping
    wavelength = sqrt(solid.lame[1] / run.density) / frequency
    if (run.side or run.problem.surface.L) <= LONG_WAVES * wavelength:
        omega = 2.0 * pi * frequency
        eta = radiation_loss(run.vibration.stiffness, omega, E=solid.E, nu=solid.nu, density=run.density)
        yield Assumption(
            "inertia: damping ratio by radiation", 0.5 * eta, NEGLIGIBLE * damping, "",
            "Lysmer & Richart, J. Soil Mech. Found. Div. ASCE 92 (1966) 65", "a damping ratio greater by the value",
            f"the model has {damping:.3g}; a block on a rigid base radiates less than the half-space",
        )  # fmt: skip


#: Generators of lines in the order of the list.
SUBJECTS: tuple[Callable[[Evidence], Iterator[Assumption]], ...] = (
    _strain, _locking, _patch, _block, _added, _size, _radiation,
)  # fmt: skip
