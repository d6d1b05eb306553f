"""The ledger of a run: each assumption of the model with its value in this run, its limit and a verdict.

A line is computed by a function of its own from the evidence, or is missing where it does not apply. A warning of a run
that says the same takes its number from here.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, inf, pi, sqrt

import numpy as np

from asperity.curve import UNRESOLVED
from asperity.mesh.resolution import ELEMENTS, ONE_MESH, SHARE, unresolved_height
from asperity.model.edges import edge_of_summit
from asperity.output.assumption import Assumption
from asperity.output.evidence import Evidence
from asperity.output.patches import representative
from asperity.reference import (
    first_frequency,
    pull_off,
    range_of_stickiness,
    stickiness,
    tabor_parameter,
)
from asperity.reference.conductance import TABOR
from asperity.units import quantity

#: Strain up to which small-strain theory applies. The engineering strain e and the logarithmic strain ln(1 + e) have a
#: relative difference of e/2 to first order: 5 % here.
SMALL_STRAIN = 0.1
YIELD_STRAIN = 0.02  # yield strength over E of metallic glasses, the greatest of metals; steels have 0.001 to 0.01
FIRST_YIELD = 1.6  # greatest pressure of a spot over the yield strength at first yield (Johnson, 1985, eq. 6.9)
AT_BASE = 0.2  # part of the pressure of the longest wave that arrives at the base
SPOT = 0.1  # contact radius over the height of the block, which stiffens a bonded layer by about as much
SMALL_CONTACT = 1e-6  # radius below which metals are harder [m]
WORKS = (0.05, 0.2, 1.0)  # of adhesion: surfaces in air, in between, clean metals [J/m^2]
WEAK = 0.01  # pull-off over the greatest force
SHORT_RANGE = 0.1  # greatest range of the attraction over the gaps next to contacts, for the stickiness
POINTS = 257  # per side, for slope and curvature
SLOW = 0.1  # frequency over the first one of the block: its stiffness is 0.8 % lower than that of a static block
NEGLIGIBLE = 0.1  # part of the damping ratio that may be left out
LOCKING = 70.0  # excess of the force over h/L: 4.7, 2.9 and 1.6 % at 0.08, 0.04 and 0.02, the greatest of three [%]
TWO_BODIES = 0.7  # force of one block over that of two, the greatest difference of four pairs in CalculiX [%]
ON_EDGE = "summit on edge"  # begins the name of a line


def ledger(evidence: Evidence) -> list[Assumption]:
    """All lines that apply to a run; none for a run without a step."""
    if not len(evidence.curve):
        return []
    found = (line(evidence) for line in LINES)
    return [line for line in found if line is not None and line.value == line.value]


def small_strain(run: Evidence) -> Assumption | None:
    """What small strain changes in the force, or else the greatest strain of a run in small strain."""
    detail, share = "", float(np.nan_to_num(run.curve.strained_fraction).max())
    if np.isfinite(run.curve.strained_fraction).any():
        detail = f"equivalent strain above 5 % in {100 * share:.2g} % of the volume"
    finite = run.problem.material.finite
    advice = 'material.kinematics = "finite", or a smaller load'
    if run.small_strain is not None:
        value, limit = run.small_strain
        if finite:
            return Assumption(
                "finite strain", 0.0, limit, "% of the force", "finite strain has no limit of strain", advice,
                detail=f"small strain would change the force by up to {value:.2g} %; {detail}".rstrip("; "),
            )  # fmt: skip
        return Assumption(
            "small strain", value, limit, "% of the force", "the slope of the spots in contact", advice, detail,
            warns=True,
        )  # fmt: skip
    if finite:
        return None
    plastic = float(np.nan_to_num(run.curve.max_plastic_strain).max())
    value = plastic if run.problem.material.plastic else float(np.nan_to_num(run.curve.max_strain).max())
    what = "plastic strain" if run.problem.material.plastic else "equivalent strain"
    return Assumption(
        f"small strain: greatest {what}", value, SMALL_STRAIN, "", "e and ln(1 + e) differ by 5 % at 0.1", advice,
        detail, warns=True,
    )  # fmt: skip


def elastic(run: Evidence) -> Assumption | None:
    """Pressure of the contact of an elastic solid over its modulus, next to that which no metal carries.

    The greatest pressure of a node is no measure: at an edge of the contact, or a corner of the surface, it grows with
    each finer mesh, and a single node would decide. Force over true contact area is an integral over the contact, and
    converges. A Hertzian spot of this mean pressure has 3/2 of it in its middle: a rough contact has more somewhere.
    """
    material = run.problem.material
    if material.plastic:
        return None
    pressure = 1.5 * float(run.curve.mean_pressure[run.top])
    return Assumption(
        "elastic: 3/2 of the mean contact pressure over E", pressure / material.E, TABOR * YIELD_STRAIN, "",
        "Tabor, The Hardness of Metals (1951); Johnson & Samwer, Phys. Rev. Lett. 95 (2005) 195501",
        "give material.yield_strength, unless the solid is no metal",
        "a spot of this greatest pressure yields where the yield strength is below "
        f"{quantity(pressure / FIRST_YIELD, 'Pa' if run.si else '', 3)}",
        warns=True,
    )  # fmt: skip


def resolution(run: Evidence) -> Assumption | None:
    """Waves too short for the elements; the warning of one mesh comes before the run."""
    surface = run.problem.surface
    if run.h is None:
        return None
    waves = f"{surface.feature_size / run.h:.2g} elements in the shortest wave" if surface.rough else ""
    if run.roughness is not None:
        assert run.tolerance is not None
        return Assumption(
            "resolution: waves left out, part of the bar", run.roughness, run.tolerance, "of the force",
            "half-space with and without them (docs/accuracy.md)", "a higher accuracy.max_dofs, or a cut-off",
            waves,
        )  # fmt: skip
    tolerance = run.tolerance or ONE_MESH
    return Assumption(
        f"resolution: waves shorter than {ELEMENTS:g} elements, rms height over approach",
        unresolved_height(surface, run.h, float(run.curve.delta.max())), SHARE * tolerance, "",
        f"error of the force of {100 * tolerance:.2g} % (docs/accuracy.md)",
        "a smaller mesh.h_contact, or a cut-off", waves, warned=run.tolerance is None,
    )  # fmt: skip


def locking(run: Evidence) -> Assumption | None:
    """Excess of the force where each point of a cell that flows keeps its volume, on one mesh."""
    material = run.problem.material
    if run.h is None or run.tolerance is not None or not material.plastic or material.relaxes:
        return None
    return Assumption(
        "locking: force by a law whose cells keep their volume where they flow",
        LOCKING * run.h / run.problem.surface.L, 100 * ONE_MESH, "% of the force",
        "self-affine surfaces without hardening (docs/extend.md)",
        "accuracy.tolerance, a smaller mesh.h_contact, or a law with yield_strength", warns=True,
    )  # fmt: skip


def instrument(run: Evidence) -> Assumption | None:
    """Waves of a scan that its instrument does not resolve, see `HeightMap.left_out`."""
    left_out = getattr(run.problem.surface, "left_out", None)
    if left_out is None:
        return None
    wavelength, force, area = left_out
    return Assumption(
        "instrument: force by the waves that it does not resolve", 100 * abs(force), 100 * (run.tolerance or ONE_MESH),
        "% of the force", "half-space with and without what the scan shows of them", "a sharper tip or a finer scan",
        f"shorter than {quantity(wavelength, 'm' if run.si else '', 3)}; they would change the force by {force:+.1%} "
        f"and the area by {area:+.1%}",
    )  # fmt: skip


def two_bodies(run: Evidence) -> Assumption | None:
    """Two rough bodies as one, see `asperity.model.two_bodies`."""
    if getattr(run.problem.surface, "about", {}).get("bodies") != 2:
        return None
    return Assumption(
        "two bodies as one: force", TWO_BODIES, 100 * (run.tolerance or ONE_MESH), "% of the force",
        "two rough blocks with slopes of 0.05 in CalculiX (docs/measured.md)", "a larger tolerance, smaller slopes",
    )  # fmt: skip


def facets(run: Evidence) -> Assumption | None:
    """Error of the contact area at the end of the first loading; the run warns of it by `Curve.unresolved`.

    A contact of single nodes has no area: its error is all of it.
    """
    load = run.curve.loading()
    if not len(load):
        return None
    area, error = float(load.area_fraction[-1]), float(load.error_area_fraction[-1])
    return Assumption(
        "resolution: error of the contact area over the area", error / area if area > 0.0 else float(error > 0.0),
        UNRESOLVED, "", "about six facets in contact", "a smaller mesh.h_contact, or accuracy.tolerance", warned=True,
    )  # fmt: skip


def summit_on_edge(run: Evidence) -> Assumption | None:
    """Slope of the surface across an edge that the summit lies on; the case warns of it before the run."""
    edge = None if run.plane else edge_of_summit(run.problem.sides, run.problem.surface)
    if edge is None:
        return None
    source = (
        "a ridge where rollers mirror the surface" if run.problem.sides == "rollers" else "no solid beyond the side"
    )
    return Assumption(
        f"{ON_EDGE}: {edge.name}", edge.value, edge.limit, "", source,
        "another surface.seed, or another window of a map", least=run.problem.sides == "free", warned=True,
    )  # fmt: skip


def bulk_yield(run: Evidence) -> Assumption | None:
    """Greatest mean pressure over that at which the block below the surface yields."""
    problem = run.problem
    if not problem.material.plastic:
        return None
    pressure = float(run.curve.force.max()) / problem.surface.L**2
    limit = problem.material.yield_pressure(problem.sides)
    return Assumption(
        "block: mean pressure over that at which it yields", pressure / limit, 1.0, "",
        "Johnson, Contact Mechanics (1985), eq. 6.1", "a smaller load, or read the curve up to there",
        warns=True,
    )  # fmt: skip


def approach_to_mean_plane(run: Evidence) -> Assumption | None:
    """Greatest approach over the depth of the mean plane below the summit; none for a plane surface.

    A rigid flat reaches the mean plane of a rough solid at full contact, beyond which only the block deforms.
    """
    surface = run.problem.surface
    delta, depth = float(run.curve.delta.max()), surface.maximum()[2] - surface.mean()
    if run.plane:
        return None
    return Assumption(
        "block: approach over the depth of the mean plane", delta / depth, 1.0, "",
        "a rigid flat there has full contact", "a smaller load, or a lower block",
        "beyond it the compression of the whole block is a large part of the curve", warns=True,
    )  # fmt: skip


def block_height(run: Evidence) -> Assumption | None:
    """Whether the clamped base is far from the contact: from the longest wave, or from the single spot of a bump.

    The stress below a pressure wave of wave number q falls as (1 + q z) exp(-q z) (Johnson, 1985, chapter 13);
    mirrored at the sides, the longest wave has q = pi/L, with periodic sides 2 pi/L. A spot of radius a on a bonded
    layer of height h is stiffer by some a/h.
    """
    surface, height = run.problem.surface, run.problem.height
    if run.plane:
        return None
    if surface.rough:
        depth = (2.0 if run.problem.sides == "periodic" else 1.0) * pi * height / surface.L
        return Assumption(
            "block: pressure of the longest wave at the base", (1.0 + depth) * exp(-depth), AT_BASE, "",
            "Johnson, Contact Mechanics (1985), chapter 13", "a greater block.height",
        )  # fmt: skip
    spot = sqrt(float(run.curve.largest_spot.max()) / pi) if np.isfinite(run.curve.largest_spot).any() else float("nan")
    return Assumption(
        "block: contact radius over the height", spot / height, SPOT, "",
        "Dimitriadis et al., Biophys. J. 82 (2002) 2798", "a greater block.height",
    )  # fmt: skip


def sticking(run: Evidence) -> Assumption | None:
    """Stickiness of a rough surface; SI units only."""
    surface = run.problem.surface
    if run.plane or not (run.si and surface.rough):
        return None
    slope = surface.rms_slope()
    xx, _, yy = surface.grid_hessian(POINTS)
    curvature = 0.5 * float(np.sqrt(np.mean((xx + yy) ** 2)))
    values = [stickiness(slope, curvature, w, run.problem.material.reduced_modulus) for w in WORKS]
    known = ", ".join(f"{value:.3g} for {w:g} J/m²" for w, value in zip(WORKS, values, strict=True))
    if (reach := range_of_stickiness(slope, curvature)) > SHORT_RANGE:
        known += f"; rough: the attraction reaches over {reach:.2g} of the gaps next to contacts, above {SHORT_RANGE:g}"
    return Assumption(
        f"adhesion: stickiness for {WORKS[1]:g} J/m²", values[1], 1.0, "",
        "Pastewka & Robbins, PNAS 111 (2014) 3298, eq. 10",
        "the surface sticks: contact without adhesion is not enough", known, least=True,
    )  # fmt: skip


def first_pull_off(run: Evidence) -> Assumption | None:
    """Force that pulls the flat off the first summit, over the greatest force; SI units only."""
    radius = run.summit_radius
    if not run.si or radius == inf:
        return None
    parts = []
    for w in WORKS:
        tabor = tabor_parameter(radius, w, run.problem.material.reduced_modulus)
        parts.append((w, tabor, pull_off(radius, w, tabor)))
    force = float(run.curve.force.max())
    if not force > 0.0:
        return None
    known = ", ".join(f"{F:.2g} N (Tabor {mu:.2g}) for {w:g} J/m²" for w, mu, F in parts)
    return Assumption(
        f"adhesion: pull-off of the first summit over the greatest force, {WORKS[1]:g} J/m²", parts[1][2] / force, WEAK,
        "",
        "Tabor, J. Colloid Interface Sci. 58 (1977) 2; Carpick et al., ibid. 211 (1999) 395",
        "a greater load: adhesion adds to a light one", known,
    )  # fmt: skip


def size_effect(run: Evidence) -> Assumption | None:
    """Radius of contact or summit below which metals are harder than in bulk; of a solid that has yielded, SI only."""
    if not run.si or not np.nan_to_num(run.curve.max_plastic_strain).max() > 0.0:
        return None
    contact, summit = run.contact_radius, run.summit_radius
    return Assumption(
        "size effect: radius of contact and summit", float(np.fmin(contact, summit)), SMALL_CONTACT, "m",
        "Nix & Gao, J. Mech. Phys. Solids 46 (1998) 411; Swadener et al., ibid. 50 (2002) 681",
        "a yield strength measured at this size: metals are harder there than in bulk",
        f"mean contact spot {quantity(contact, 'm', 2)}, summit {quantity(summit, 'm', 2)}", least=True,
    )  # fmt: skip


def slow_vibration(run: Evidence) -> Assumption | None:
    """Frequency of the vibration over the first one of the block, which is without mass in the model.

    The block is a rod, fixed below: at the frequency w its stiffness is that of statics times x cot x = 1 - x^2/3 - ...
    with x = w h/c, and x = pi/2 at its first frequency.
    """
    if run.vibration is None or run.density is None:
        return None
    problem = run.problem
    modulus = problem.material.block_modulus(problem.sides)
    first = first_frequency(modulus, run.density, problem.height)
    value = run.vibration.frequency / first
    return Assumption(
        "inertia: frequency of the vibration over the first of the block", value, SLOW, "",
        "rod, fixed below: stiffness x cot x, x = pi/2 times the value", "a model with the mass of the block",
        f"{run.vibration.frequency:.3g} and {first:.3g} cycles per time",
    )  # fmt: skip


def radiation(run: Evidence) -> Assumption | None:
    """Damping by waves that a vibrating contact would send into a half-space, which the model leaves out."""
    if run.vibration is None or "eta" not in run.radiated:
        return None
    damping = run.vibration.damping
    return Assumption(
        "inertia: damping ratio by radiation", 0.5 * run.radiated["eta"], NEGLIGIBLE * damping, "",
        "Miller & Pursey, Proc. R. Soc. Lond. A 223 (1954) 521", "a damping ratio greater by the value",
        f"the model has {damping:.3g}; a block on a rigid base radiates less than the half-space",
    )  # fmt: skip


#: Lines in their order; a new one is a function of the evidence.
LINES: tuple[Callable[[Evidence], Assumption | None], ...] = (
    small_strain,
    elastic,
    resolution,
    locking,
    instrument,
    two_bodies,
    lambda run: representative(run.patches, int(run.curve.spots[run.top])),
    facets,
    summit_on_edge,
    bulk_yield,
    approach_to_mean_plane,
    block_height,
    sticking,
    first_pull_off,
    size_effect,
    slow_vibration,
    radiation,
)
