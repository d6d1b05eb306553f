"""The ledger of a run: each assumption of the model with its value in this run, its limit and a verdict.

A line is missing where it does not apply. A warning of a run that says the same takes its number from here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import exp, inf, pi, sqrt

import numpy as np

from asperity.mesh.resolution import ELEMENTS, ONE_MESH, SHARE, unresolved_height
from asperity.model.problem import edge_of_summit
from asperity.output.assumption import Assumption, Evidence
from asperity.output.patches import hurst_without_end
from asperity.reference import (
    LONG_WAVES,
    first_frequency,
    pull_off,
    radiation_loss,
    stickiness,
    tabor_parameter,
)
from asperity.reference.conductance import TABOR
from asperity.reference.halfspace import added_to_spot
from asperity.surface.shapes import Sphere
from asperity.units import quantity

ON_EDGE = "summit on edge"  # begins the name of a line
#: Strain up to which small-strain theory applies. The engineering strain e and the logarithmic strain ln(1 + e) have a
#: relative difference of e/2 to first order: 5 % here.
SMALL_STRAIN = 0.1
YIELD_STRAIN = 0.02  # yield strength over E of metallic glasses, the greatest of metals; steels have 0.001 to 0.01
MOST_OF_METALS = 0.45  # Poisson's ratio of indium; those of gold and lead are 0.44, of rubber 0.49 and more
FIRST_YIELD = 1.6  # greatest pressure of a spot over the yield strength at first yield (Johnson, 1985, eq. 6.9)
AT_BASE = 0.2  # part of the pressure of the longest wave that arrives at the base
ADDED = 5.0  # part of the approach that the block adds [%]
SMALL_CONTACT = 1e-6  # radius below which metals are harder [m]
WORK = 0.2  # of adhesion: surfaces in air have some 0.05, clean metals 1 [J/m^2]
WEAK = 0.01  # pull-off over the greatest force
POINTS = 257  # per side, for slope and curvature
SLOW = 0.1  # frequency over the first one of the block: its stiffness is 0.8 % lower than that of a static block
NEGLIGIBLE = 0.1  # part of the damping ratio that may be left out
LOCKING = 70.0  # excess of the force over h/L, the greatest of three surfaces [%]
LONGER = 1.2  # rms height of a joint over that of its patch beyond which the patch does not stand for it
DIFFERENT = 20.0  # change of the stiffness beyond which a patch does not stand for its joint [%]


def ledger(evidence: Evidence) -> list[Assumption]:
    """All lines that apply to a run, by subject; none for a run without a step."""
    if not len(evidence.curve):
        return []
    return [line for subject in SUBJECTS for line in subject(evidence) if line.value == line.value]


def _strain(run: Evidence) -> Iterator[Assumption]:
    """What small strain changes in the force, or else the greatest strain; the pressure of an elastic solid.

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
            warns=True,
        )  # fmt: skip
    elif not material.finite:
        what = "plastic" if material.plastic else "equivalent"
        yield Assumption(
            f"small strain: greatest {what} strain",
            run.greatest("max_plastic_strain" if material.plastic else "max_strain"), SMALL_STRAIN, "",
            "e and ln(1 + e) differ by 5 % at 0.1", advice, detail, warns=True,
        )  # fmt: skip
    if not material.plastic and material.law is None and material.nu <= MOST_OF_METALS:
        pressure = 1.5 * float(run.curve.mean_pressure[run.top])
        yield Assumption(
            "elastic: 3/2 of the mean contact pressure over E", pressure / material.E, TABOR * YIELD_STRAIN, "",
            "Tabor, The Hardness of Metals (1951); Johnson & Samwer, Phys. Rev. Lett. 95 (2005) 195501",
            "give material.yield_strength, unless the solid is no metal",
            "a spot of this greatest pressure yields where the yield strength is below "
            f"{quantity(pressure / FIRST_YIELD, 'Pa' if run.si else '', 3)}",
            warns=True,
        )  # fmt: skip


def _resolution(run: Evidence) -> Iterator[Assumption]:
    """Waves too short for the elements; cells that keep their volume where they flow, on one mesh."""
    surface, material = run.problem.surface, run.problem.material
    tolerance = run.tolerance or ONE_MESH
    if run.h is not None:
        waves = f"{surface.feature_size / run.h:.2g} elements in the shortest wave" if surface.rough else ""
        if run.roughness is not None and run.tolerance is not None:
            yield Assumption(
                "resolution: waves left out, part of the bar", run.roughness, run.tolerance, "of the force",
                "half-space with and without them (docs/accuracy.md)", "a higher accuracy.max_dofs, or a cut-off",
                waves,
            )  # fmt: skip
        else:  # the warning of one mesh comes before the run
            yield Assumption(
                f"resolution: waves shorter than {ELEMENTS:g} elements, rms height over approach",
                unresolved_height(surface, run.h, float(run.curve.delta.max())), SHARE * tolerance, "",
                f"error of the force of {100 * tolerance:.2g} % (docs/accuracy.md)",
                "a smaller mesh.h_contact, or a cut-off", waves, warned=run.tolerance is None,
            )  # fmt: skip
        if run.tolerance is None and material.plastic and not material.relaxes:
            yield Assumption(
                "locking: force by a law whose cells keep their volume where they flow",
                LOCKING * run.h / surface.L, 100 * ONE_MESH, "% of the force",
                "self-affine surfaces without hardening (docs/extend.md)",
                "accuracy.tolerance, a smaller mesh.h_contact, or a law with yield_strength", warns=True,
            )  # fmt: skip


def _patch(run: Evidence) -> Iterator[Assumption]:
    """One patch for a joint; a summit on an edge."""
    problem, length = run.problem, "m" if run.si else ""
    if (found := run.patches) is not None:
        yield Assumption(
            "joint: stiffness by other patches of its roughness", 100 * found.bar, DIFFERENT, "%",
            f"half-space pressed with {found.patches} patches under one plane",
            "a larger surface.L, or the mean of several seeds",
            f"the mean of the patches is {found}; this one has {int(run.curve.spots[run.top])} spot(s) at the greatest "
            "force",
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
    edge = None if run.plane else edge_of_summit(problem.sides, problem.surface)
    if edge is not None:
        mirrored = problem.sides == "rollers"
        yield Assumption(
            f"{ON_EDGE}: {edge.name}", edge.value, edge.limit, "",
            "a ridge where rollers mirror the surface" if mirrored else "no solid beyond the side",
            "another surface.seed, or another window of a map", least=problem.sides == "free", warned=True,
        )  # fmt: skip


def _block(run: Evidence) -> Iterator[Assumption]:
    """Yield below the surface, approach to the mean plane, and the distance of the clamped base from the contact.

    The stress below a pressure wave of wave number q falls as (1 + q z) exp(-q z) (Johnson, 1985, chapter 13);
    mirrored at the sides, the longest wave has q = pi/L, with periodic sides 2 pi/L. A rigid flat reaches the mean
    plane of a rough solid at full contact.
    """
    problem, surface, height = run.problem, run.problem.surface, run.problem.height
    if problem.material.yield_strength is not None:
        pressure = float(run.curve.force.max()) / surface.L**2
        yield Assumption(
            "block: mean pressure over that at which it yields",
            pressure / problem.material.yield_pressure(problem.sides), 1.0, "",
            "Johnson, Contact Mechanics (1985), eq. 6.1", "a smaller load, or read the curve up to there", warns=True,
        )  # fmt: skip
    if run.plane:
        return
    yield Assumption(
        "block: approach over the depth of the mean plane",
        float(run.curve.delta.max()) / (surface.maximum()[2] - surface.mean()), 1.0, "",
        "a rigid flat there has full contact", "a smaller load, or a lower block",
        "beyond it the compression of the whole block is a large part of the curve", warns=True,
    )  # fmt: skip
    if surface.rough:
        depth = (2.0 if problem.sides == "periodic" else 1.0) * pi * height / surface.L
        yield Assumption(
            "block: pressure of the longest wave at the base", (1.0 + depth) * exp(-depth), AT_BASE, "",
            "Johnson, Contact Mechanics (1985), chapter 13", "a greater block.height",
        )  # fmt: skip


def _added(run: Evidence) -> Iterator[Assumption]:
    """Part of the approach at the greatest force that the block adds to its contact.

    A rough surface is part of a wide one, whose mean planes approach: the block adds its compression. A spot alone has
    the approach on a half-space, and the base and the sides of the block, which mirror the spot, count too.
    """
    problem, surface, top = run.problem, run.problem.surface, run.top
    pressure, delta = float(run.curve.force[top]) / surface.L**2, float(run.curve.delta[top])
    if run.plane or not delta > 0.0:
        return
    added, wide = pressure * problem.height / problem.material.block_modulus(problem.sides), "the surface alone"
    if isinstance(surface, Sphere):
        assert surface.centre is not None
        x, y = (c / surface.L for c in surface.centre)
        whole = 2.0 ** sum(c in (0.0, 1.0) for c in (x, y))  # spots over the part of one on the patch
        radius = sqrt(whole * float(run.curve.area_fraction[top]) / pi)
        if not radius > 0.0:
            return
        height = (problem.height + surface.maximum()[2] - surface.mean()) / surface.L  # below the summit
        unit = added_to_spot(radius, (x, y), height, problem.material.nu, problem.sides)
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
    """Adhesion, of a rough surface and of its first summit, and the hardness of small contacts; SI units only."""
    if not run.si:
        return
    surface, modulus = run.problem.surface, run.problem.material.reduced_modulus
    radius, force = run.summit_radius, float(run.curve.force.max())
    if surface.rough and not run.plane:
        slope = surface.rms_slope()
        xx, _, yy = surface.grid_hessian(POINTS)
        curvature = 0.5 * float(np.sqrt(np.mean((xx + yy) ** 2)))
        yield Assumption(
            f"adhesion: stickiness for {WORK:g} J/m²", stickiness(slope, curvature, WORK, modulus), 1.0, "",
            "Pastewka & Robbins, PNAS 111 (2014) 3298, eq. 10",
            "the surface sticks: contact without adhesion is not enough", "it falls as the work of adhesion rises",
            least=True,
        )  # fmt: skip
    if radius < inf and force > 0.0:
        tabor = tabor_parameter(radius, WORK, modulus)
        adhesion = pull_off(radius, WORK, tabor)
        yield Assumption(
            f"adhesion: pull-off of the first summit over the greatest force, {WORK:g} J/m²", adhesion / force,
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
            f"mean contact spot {quantity(contact, 'm', 2)}, summit {quantity(radius, 'm', 2)}", least=True,
        )  # fmt: skip


def _inertia(run: Evidence) -> Iterator[Assumption]:
    """Frequency of the vibration over the first one of the block, without mass in the model; damping by radiation.

    The block is a rod, fixed below: at the frequency w its stiffness is that of statics times x cot x = 1 - x^2/3 - ...
    with x = w h/c, and x = pi/2 at its first frequency.
    """
    if run.vibration is None or run.density is None:
        return
    problem, solid, frequency = run.problem, run.problem.material, run.vibration.frequency
    first = first_frequency(solid.block_modulus(problem.sides), run.density, problem.height)
    yield Assumption(
        "inertia: frequency of the vibration over the first of the block", frequency / first, SLOW, "",
        "rod, fixed below: stiffness x cot x, x = pi/2 times the value", "a model with the mass of the block",
        f"{frequency:.3g} and {first:.3g} cycles per time",
    )  # fmt: skip
    wavelength = sqrt(solid.lame[1] / run.density) / frequency
    if (run.side or problem.surface.L) <= LONG_WAVES * wavelength:
        omega, damping = 2.0 * pi * frequency, run.vibration.damping
        eta = radiation_loss(run.vibration.stiffness, omega, E=solid.E, nu=solid.nu, density=run.density)
        yield Assumption(
            "inertia: damping ratio by radiation", 0.5 * eta, NEGLIGIBLE * damping, "",
            "Lysmer & Richart, J. Soil Mech. Found. Div. ASCE 92 (1966) 65", "a damping ratio greater by the value",
            f"the model has {damping:.3g}; a block on a rigid base radiates less than the half-space",
        )  # fmt: skip


#: Generators of lines in the order of the ledger.
SUBJECTS: tuple[Callable[[Evidence], Iterator[Assumption]], ...] = (
    _strain, _resolution, _patch, _block, _added, _size, _inertia,
)  # fmt: skip
