"""Hard cases: scenes where a contact solver is likely to fail, each run to its end or refused with a reason.

Each scene is run as `asperity run` would, in its own folder, and judged (`scene_outcome`): it ends as expected, passes
the checks of `asperity.quasistatic.balance` at every step, and agrees with its twin (the same problem solved in a
second way). A scene that stops leaves its curve and a checkpoint to continue from.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import pi
from typing import Any

import numpy as np

from asperity.arrays import Floats
from asperity.curve import Curve

Keys = dict[str, Any]  # dotted keys of a case; None removes a key
Map = Callable[[Floats, Floats], Floats]  # heights in units of L over the coordinates of a grid in the same units


@dataclass(frozen=True)
class Twin:
    """The same problem solved in a second way.

    Attributes:
        tolerance: greatest accepted difference of the curves, relative to the greatest force
        keys: changes to the keys of the scene
        map: height map that replaces that of the scene
    """

    tolerance: float
    keys: Keys = field(default_factory=dict)
    map: Map | None = None


@dataclass(frozen=True)
class Scene:
    """A hard case.

    Attributes:
        name: "group/variant"
        keys: those of the case that differ from BASE
        ends: expected end: "done", "refused" (exit code 2), "stopped" or "wrong" (exit code 3; "wrong": the run
            itself reports a violated balance)
        reason: text that the message of a refusal or stop must contain
        depth: delta_max over the height of the summit above the mean plane
        twin: second solution to compare the curve with
        claim: theoretical property of the curve; a sentence of what does not hold
        map: heights of a surface of kind "file"
        fast: whether the scene is in the short suite
    """

    name: str
    keys: Keys = field(default_factory=dict)
    ends: str = "done"
    reason: str = ""
    depth: float | None = None
    twin: Twin | None = None
    claim: Callable[[Curve], str] | None = None
    map: Map | None = None
    fast: bool = False


# --- keys -----------------------------------------------------------------------------------------------------

L = 1e-6
#: The base case: surface and material of cases/single.toml on a coarse mesh.
BASE: Keys = {
    "surface.kind": "weierstrass-mandelbrot", "surface.L": L, "surface.D": 2.4, "surface.G": 1.36e-11,
    "material.E": 200e9, "material.nu": 0.3, "material.yield_strength": 1e9, "material.tangent_modulus": 10e9,
    "mesh.h_contact": 0.12 * L, "mesh.growth": 0.6, "mesh.h_max": 0.4 * L,
    "loading.delta_max": 0.03 * L, "loading.steps": 6, "solver.linear": "cg",  # fails earlier than LU
}  # fmt: skip
PERFECT: Keys = {"material.tangent_modulus": None}
ELASTIC: Keys = {"material.yield_strength": None} | PERFECT
SOFT: Keys = {"material.yield_strength": 2e8}
FINITE: Keys = {"material.kinematics": "finite"}
MOVING: Keys = {"material.hardening": "kinematic"}
UNLOAD: Keys = {"loading.unload": True}
FREE: Keys = {"block.sides": "free"}
EXACT: Keys = {"contact.method": "active-set", "contact.penalty": None, "contact.gamma": None}
FLAT: Keys = {"surface.kind": "flat", "surface.D": None, "surface.G": None}
FILE: Keys = FLAT | {"surface.kind": "file", "surface.path": "map.npy"}
STEEP: Keys = FLAT | {"surface.kind": "self-affine", "surface.H": 0.8, "surface.rms_slope": 0.7, "surface.seed": 1}
STEEP |= {"surface.lambda_short": 0.25 * L, "mesh.h_max": 0.2 * L, "loading.steps": 8, "loading.unload_steps": 4}
STEEP |= UNLOAD | FINITE


def steps(number: int, back: int | None = None, cycles: int | None = None) -> Keys:
    keys = {"loading.steps": number, "loading.unload_steps": back, "loading.cycles": cycles}
    return {name: value for name, value in keys.items() if value} | (UNLOAD if back else {})


def to(delta: float) -> Keys:
    """An approach in units of L."""
    return {"loading.delta_max": delta * L}


def to_force(force: float) -> Keys:
    return {"loading.delta_max": None, "loading.force_max": force}


def size(contact: float | None = None, largest: float | None = None) -> Keys:
    """Sizes of the elements in units of L."""
    keys = {"mesh.h_contact": contact, "mesh.h_max": largest}
    return {name: value * L for name, value in keys.items() if value}


def wave(amplitude: float, dims: int = 2, **more: Any) -> Keys:
    """A sinusoid instead of the rough surface; amplitude in units of L."""
    shape = {"kind": "sinusoid", "amplitude": amplitude * L, "dims": dims}
    return FLAT | {f"surface.{key}": value for key, value in (shape | more).items()}


def sphere(**more: Any) -> Keys:
    """A sphere of radius L instead of the rough surface."""
    return FLAT | {f"surface.{key}": value for key, value in ({"kind": "sphere", "radius": L} | more).items()}


DIRECT = Twin(1e-6, {"solver.linear": "lu"})
PENALTY = Twin(0.05, {"contact.method": "penalty", "contact.penalty": 100.0})


# --- height maps ----------------------------------------------------------------------------------------------


def heights(of: Map) -> Floats:
    """A height map in units of L (33, 33)."""
    t = np.linspace(0.0, 1.0, 33)
    return of(*np.meshgrid(t, t))


def two_peaks(x: Floats, y: Floats) -> Floats:
    """Two equal peaks on a diagonal."""
    one, other = (np.exp(-((x - c) ** 2 + (y - c) ** 2) / 0.02) for c in (0.25, 0.75))
    return 0.05 * (one + other)


def ripple(x: Floats, y: Floats) -> Floats:
    return 0.03 * np.cos(2 * np.pi * (x - 0.4)) * np.cos(2 * np.pi * (y - 0.55))


def noisy(x: Floats, y: Floats) -> Floats:
    """A wave with independent noise at each sample, 1 % of the height of the wave."""
    return ripple(x, y) + 5e-4 * np.random.default_rng(0).standard_normal(x.shape)


def spike(x: Floats, y: Floats) -> Floats:
    """A wave with one sample far above the others."""
    z = ripple(x, y)
    z[20, 9] += 0.1
    return z


# --- theoretical properties of the curve: each returns a sentence of what does not hold -----------------------


def nearly_full(curve: Curve) -> str:
    """More than 95 % of the area is in contact, but not all of it."""
    area = float(curve.area_fraction.max())
    return "" if 0.95 < area < 1.0 + 1e-9 else f"contact area {area:.1%}"


def hertz(curve: Curve) -> str:
    """An elastic sphere of R = L follows Hertz, P = 4/3 E' sqrt(R) delta^1.5, and has no dent after its release."""
    load, E_prime = curve.branch == "load", BASE["material.E"] / (1.0 - BASE["material.nu"] ** 2)
    expected = 4.0 / 3.0 * E_prime * np.sqrt(L) * curve.delta[load] ** 1.5
    error = float(np.max(np.abs(curve.force[load] - expected)) / np.max(expected))
    clean = curve.force[-1] == 0.0 and abs(curve.delta_star[-1]) < 1e-9
    return "" if error < 0.05 and clean else f"Hertz within {error:.1%}, dent {curve.delta_star[-1]:.0e} L"


def keeps_a_loop(curve: Curve) -> str:
    """Plastic flow goes on: the accumulated plastic strain grows in the last cycle, by as much as in the one before."""
    ends = np.flatnonzero((curve.branch[:-1] != "unload") & (curve.branch[1:] == "unload"))
    before, last = np.diff(curve.max_plastic_strain[ends])[-2:]
    grows = last > 1e-3 and abs(last / before - 1.0) < 0.05
    return "" if grows else f"plastic strain grows by {before:g}, then {last:g}"


# --- scenes ---------------------------------------------------------------------------------------------------

#: Slopes far above 0.1, the limit of small-strain theory.
SLOPES = [
    (f"slope-{slope}-{name}", wave(slope / (2 * pi)) | keys | to(0.05) | size(largest=0.15))
    for slope in (1.0, 1.5)
    for name, keys in (("elastic", ELASTIC), ("plastic", {}))
]
#: Fractal parameters D and G, each surface pressed half-way to its mean plane. The steepest ones, with rms slopes
#: beyond 3, bend within one element: smoothing leaves too little of them.
PLANE = [(D, G) for D in (2.05, 2.3, 2.5, 2.95) for G in (1e-13, 1e-11, 1e-10)]
#: Penalty factors from far too soft to far too stiff, and the twin's tolerance: the error of the force against exact
#: contact is inversely proportional to the factor, 2 % at factor 10. A fine mesh makes this error larger than that of
#: the mesh; it is not used with the largest factor, where it would take too long.
FACTORS = [(0.1, 0.6), (1.0, 0.58), (10.0, 0.13), (100.0, None)]
#: Runs with a tolerance, which choose mesh and steps themselves; the twin has a smaller tolerance.
OWN: Keys = {"mesh.h_contact": None, "mesh.growth": None, "mesh.h_max": None, "solver.linear": None}
ROUGH, FIVE = OWN | ELASTIC | {"accuracy.tolerance": 0.03}, steps(5)
QUARTER = OWN | sphere(centre=(0.0, 0.0)) | FIVE
BETTER: Keys = {"accuracy.tolerance": 0.005}

SCENES: tuple[Scene, ...] = (
    *(
        Scene(
            f"plane/D{D}-G{G:.0e}", {"surface.D": D, "surface.G": G}, depth=0.5, twin=DIRECT,
            ends="refused" if D == 2.05 else "done", reason="too large for the slopes" if D == 2.05 else "",
            fast=(D, G) == (2.95, 1e-11),
        ) for D, G in PLANE
    ),
    *(Scene(f"small/{name}", keys, twin=DIRECT, fast=name == "slope-1.0-elastic") for name, keys in SLOPES),
    *(Scene(f"finite/{name}", keys | FINITE | UNLOAD, twin=DIRECT) for name, keys in SLOPES),
    Scene("slope/elements-as-large-as-the-wave", wave(1.5 / (2 * pi)), fast=True),
    Scene(
        "slope/own-size", wave(1.5 / (2 * pi)) | ELASTIC | to(0.05) | {"mesh.h_max": None},
        twin=Twin(0.1, size(largest=0.15)),
    ),
    Scene("full/wave-1d", wave(0.01, 1) | ELASTIC | steps(10), depth=3.56, claim=nearly_full, fast=True),
    Scene("full/wave-2d", wave(0.01) | ELASTIC | steps(10), depth=4.6, claim=nearly_full),
    Scene("full/plastic", wave(0.01) | SOFT | UNLOAD, depth=2.6, claim=nearly_full),
    Scene("touch/one-point", sphere() | ELASTIC | size(4e-3) | to(1e-4) | UNLOAD, claim=hertz, fast=True),
    Scene(
        "touch/two-equal-peaks", FILE | to(0.02) | UNLOAD, map=two_peaks, fast=True,
        twin=Twin(0.05, map=lambda x, y: two_peaks(x, 1.0 - y)),  # on the other diagonal
    ),
    Scene("light/1e-5-plastic", size(4e-3) | to(1e-5) | steps(3) | UNLOAD, twin=DIRECT),
    Scene("hardening/0", PERFECT | UNLOAD, twin=DIRECT),
    *(
        Scene(f"hardening/{ratio}", {"material.tangent_modulus": ratio * 200e9} | UNLOAD, twin=DIRECT)
        for ratio in (0.001, 0.99)
    ),
    *(
        Scene(f"strength/{ratio:g}", {"material.yield_strength": ratio * 200e9} | UNLOAD, twin=PENALTY)
        for ratio in (1e-6, 1e-4, 1e-2)
    ),
    Scene("poisson/0.495", ELASTIC | {"material.nu": 0.495}, twin=PENALTY, fast=True),
    Scene("poisson/0", {"material.nu": 0.0} | UNLOAD, twin=DIRECT),
    Scene("block/thin", {"surface.G": 1e-13, "block.height": 0.05 * L} | to(0.004) | size(0.08), twin=DIRECT),
    Scene(
        "block/thinner-than-the-valleys", {"block.height": 0.05 * L, "surface.D": 2.2} | to(0.02),
        ends="refused", reason="deepest valley",
    ),
    Scene("yield/free-sides", FLAT | FREE | SOFT | PERFECT | UNLOAD, twin=DIRECT),
    Scene("yield/beyond-mean-plane", steps(20) | UNLOAD, twin=DIRECT),  # strains of a quarter
    Scene("steps/one-huge", steps(1), twin=Twin(0.25, steps(200))),
    Scene("cycles/50-to-a-force", to_force(5e-3) | steps(2, 2, 50)),
    Scene("edge/summit-in-a-free-corner", wave(0.05, centre=(0.0, 0.0)) | FREE | UNLOAD, twin=PENALTY),
    *(
        Scene(
            f"penalty/{factor:g}", {"contact.method": "penalty", "contact.penalty": factor} | to(0.01) | steps(4)
            | UNLOAD | ({"mesh.h_contact": 0.05 * L, "mesh.growth": 0.25} if near else {}),
            ends="wrong" if factor == 0.1 else "done", reason="penetrates the flat" if factor == 0.1 else "",
            twin=Twin(near, EXACT) if near else None,
        ) for factor, near in FACTORS
    ),
    *(
        Scene(
            f"nitsche/{gamma:g}", {"contact.method": "nitsche", "contact.gamma": gamma} | UNLOAD, twin=Twin(near, EXACT)
        ) for gamma, near in ((0.75, 0.1), (100.0, 0.05))
    ),
    Scene("tolerance/rough", ROUGH, twin=Twin(0.035, BETTER)),
    Scene("tolerance/light", ROUGH | FIVE | to(1e-5), twin=Twin(0.035, BETTER)),
    *(
        Scene(f"tolerance/{method}", ROUGH | FIVE | {"contact.method": method}, twin=Twin(0.035, BETTER | EXACT))
        for method in ("penalty", "nitsche")
    ),
    Scene(
        "tolerance/plastic", QUARTER | UNLOAD | {"accuracy.tolerance": 0.05},
        twin=Twin(0.06, {"accuracy.tolerance": 0.01}),
    ),
    Scene(  # approaches and meshes are those of its search
        "tolerance/force", ROUGH | FIVE | to_force(2e-3) | UNLOAD, twin=Twin(0.01, {"solver.linear": "lu"})
    ),
    Scene(
        "tolerance/penalty-too-soft", ROUGH | {"contact.method": "penalty", "contact.penalty": 1.0},
        ends="refused", reason="too soft for accuracy.tolerance", fast=True,
    ),
    Scene(
        "tolerance/max-dofs", ROUGH | FIVE | {"accuracy.tolerance": 1e-4, "accuracy.max_dofs": 12_000},
        ends="stopped", reason="accuracy.max_dofs = 12000 allows no more", fast=True,
    ),
    Scene(  # bars of 4.7 and 1 %
        "tolerance/loose-equations", QUARTER | {"accuracy.tolerance": 0.01, "solver.rtol": 1e-2},
        ends="stopped", reason="is left by the equations", twin=Twin(0.057, {"solver.rtol": 1e-8}),
    ),
    *(
        Scene(f"finite/rough-{name}", STEEP | keys, depth=depth)
        for name, keys, depth in (
            ("plastic", {}, 0.75), ("soft", SOFT, 0.75), ("free", FREE, 0.75),
            ("periodic", {"block.sides": "periodic"}, 0.5),
        )
    ),
    Scene("finite/beyond-mean-plane", SOFT | FINITE | to(0.055) | steps(20) | UNLOAD),  # until all of it yields
    Scene(  # the tolerance is that of the indentation left
        "finite/free-sides", FLAT | FINITE | SOFT | FREE | PERFECT | to(0.45) | steps(45) | UNLOAD,
        twin=Twin(1e-5, {"solver.linear": "lu"}),
    ),
    Scene("finite/friction", FINITE | UNLOAD | {"contact.friction": 0.3}),
    Scene("finite/auto", wave(1.0 / (2 * pi)) | to(0.05) | {"material.kinematics": "auto"}, twin=Twin(1e-9, FINITE)),
    Scene("kinematic/20-cycles", MOVING | steps(4, 4, 20), claim=keeps_a_loop),
    Scene("kinematic/perfect", MOVING | PERFECT | UNLOAD, twin=Twin(1e-12, {"material.hardening": "isotropic"})),
    Scene("kinematic/elastic", MOVING | ELASTIC, ends="refused", reason="needs material.yield_strength", fast=True),
    Scene("mesh/abrupt", {"mesh.growth": 10.0, "mesh.h_max": L}, twin=DIRECT),
    Scene("solver/loose", {"solver.rtol": 1e-2} | UNLOAD, fast=True),
    Scene("force/given", to_force(5e-3) | UNLOAD | {"loading.cycles": 2}, twin=DIRECT),
    Scene(  # five times the limit load of a perfectly plastic block
        "force/unreachable", FLAT | FREE | SOFT | PERFECT | to_force(1e-3), ends="stopped", reason="cannot be reached"
    ),
    Scene("file/noise", FILE | to(0.01) | size(0.06, 0.2), map=noisy, twin=DIRECT),
    Scene("file/spike", FILE | to(0.02), map=spike, ends="refused", reason="or filter the surface"),
)  # fmt: skip
