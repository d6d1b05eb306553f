"""Hard cases: scenes where a contact solver is likely to fail, each run to its end or refused with a reason.

Each scene is run as `asperity run` would, in its own folder, and judged (`outcome`): it ends as expected, passes the
checks of `asperity.quasistatic.balance` at every step, and agrees with its twin (the same problem solved in a second
way). A scene that stops leaves its curve and a checkpoint to continue from.
"""

from __future__ import annotations

from math import pi

import grids
import mechanics
import scene_definition as given
from scene_definition import DIRECT, ELASTIC, FILE, FLAT, PENALTY, L, Scene, Twin, sphere, wave

SCENES: tuple[Scene, ...] = (
    *grids.plane(),
    *grids.slopes(),
    Scene(
        "slope/coarse",
        "slopes up to 1.5, elements as large as the wave",
        wave(1.5 / (2 * pi)),
        fast=True,
    ),
    Scene(
        "slope/own-size",
        "slopes up to 1.5, without a greatest size of elements",
        wave(1.5 / (2 * pi)) | ELASTIC | {"loading.delta_max": 0.05 * L, "mesh.h_max": None},
        twin=Twin("mesh.h_max = 0.15 L", 0.1, {"mesh.h_max": 0.15 * L}),
    ),
    Scene(
        "full/wave-1d",
        "elastic wave pressed to nearly full contact",
        wave(0.01, 1) | ELASTIC | {"loading.steps": 10},
        depth=3.56,
        claim=given.nearly_full,
        fast=True,
    ),
    Scene(
        "full/wave-2d",
        "elastic egg-box pressed to nearly full contact",
        wave(0.01) | ELASTIC | {"loading.steps": 10},
        depth=4.6,
        claim=given.nearly_full,
    ),
    Scene(
        "full/plastic",
        "soft plastic wave pressed to nearly full contact, and released",
        wave(0.01) | {"material.yield_strength": 2e8, "loading.unload": True},
        depth=2.6,
        claim=given.nearly_full,
    ),
    Scene(
        "full/beyond",
        "elastic wave pressed beyond full contact",
        wave(0.01) | ELASTIC,
        depth=8.0,
        fast=True,
    ),
    Scene(
        "touch/one-point",
        "sphere of R = L touched at one point, lifted off",
        sphere(1.0) | ELASTIC | {"mesh.h_contact": 4e-3 * L, "loading.delta_max": 1e-4 * L, "loading.unload": True},
        claim=given.hertz,
        fast=True,
    ),
    Scene(
        "touch/two-peaks",
        "two equal peaks",
        FILE | {"loading.delta_max": 0.02 * L, "loading.unload": True},
        map=given.two_peaks,
        twin=Twin("turned by 90 degrees", 0.05, map=given.two_peaks_turned),
        fast=True,
    ),
    Scene(
        "light/1e-5-rough",
        "delta = 1e-5 L on the rough surface, elastic-plastic, with unloading",
        {"mesh.h_contact": 4e-3 * L, "loading.delta_max": 1e-5 * L, "loading.steps": 3, "loading.unload": True},
        twin=DIRECT,
    ),
    *grids.hardening(),
    *grids.strengths(),
    Scene("poisson/0.495", "nu = 0.495, elastic", ELASTIC | {"material.nu": 0.495}, twin=PENALTY, fast=True),
    Scene("poisson/0", "nu = 0, elastic-plastic, unloading", {"material.nu": 0.0, "loading.unload": True}, twin=DIRECT),
    Scene(
        "block/thin",
        "height 0.05 L under a shallow rough surface",
        {
            "surface.G": 1e-13,
            "block.height": 0.05 * L,
            "loading.delta_max": 0.004 * L,
            "mesh.h_contact": 0.08 * L,
        },
        twin=DIRECT,
    ),
    Scene(
        "block/too-thin",
        "height 0.05 L under a surface that is deeper",
        {"block.height": 0.05 * L, "surface.D": 2.2, "loading.delta_max": 0.02 * L},
        ends="refused",
        reason="deepest valley",
    ),
    Scene(
        "yield/whole-block",
        "flat block in uniaxial strain far beyond yield, and back",
        FLAT | {"material.yield_strength": 2e8, "loading.delta_max": 0.03 * L, "loading.unload": True},
        fast=True,
    ),
    Scene(
        "yield/free-sides",
        "flat block squeezed between free sides, perfectly plastic",
        FLAT
        | {
            "block.sides": "free",
            "material.yield_strength": 2e8,
            "material.tangent_modulus": None,
            "loading.delta_max": 0.03 * L,
            "loading.unload": True,
        },
        twin=DIRECT,
    ),
    Scene(
        "yield/beyond-mean-plane",
        "the surface of cases/single.toml, to 0.03 L and released: beyond its mean plane, strains of a quarter",
        {"loading.steps": 20, "loading.unload": True},
        twin=DIRECT,
    ),
    Scene(
        "steps/1",
        "one huge step",
        {"loading.steps": 1},
        twin=Twin("200 steps", 0.25, {"loading.steps": 200}),
    ),
    Scene(
        "cycles/50",
        "50 cycles to a force",
        {
            "loading.delta_max": None,
            "loading.force_max": 5e-3,
            "loading.unload": True,
            "loading.cycles": 50,
            "loading.steps": 2,
            "loading.unload_steps": 2,
        },
    ),
    Scene(
        "edge/free-corner",
        "summit in the corner of a block with free sides",
        wave(0.05, centre=(0.0, 0.0)) | {"block.sides": "free", "loading.unload": True},
        twin=PENALTY,
    ),
    *grids.penalties(),
    *grids.tolerances(),
    *mechanics.finite(),
    *mechanics.kinematic(),
    Scene(
        "nitsche/0.75",
        "Nitsche's method, gamma = 0.75",
        {"contact.method": "nitsche", "contact.gamma": 0.75, "loading.unload": True},
        twin=Twin("exact contact", 0.1, {"contact.method": "active-set", "contact.gamma": None}),
    ),
    Scene(
        "nitsche/100",
        "Nitsche's method, gamma = 100",
        {"contact.method": "nitsche", "contact.gamma": 100.0, "loading.unload": True},
        twin=Twin("exact contact", 0.05, {"contact.method": "active-set", "contact.gamma": None}),
    ),
    Scene("mesh/abrupt", "elements grow abruptly", {"mesh.growth": 10.0, "mesh.h_max": L}, twin=DIRECT),
    Scene("solver/loose", "equations solved to 1e-2 only", {"solver.rtol": 1e-2, "loading.unload": True}, fast=True),
    Scene(
        "force/given",
        "half of what the displacement reaches",
        {"loading.delta_max": None, "loading.force_max": 5e-3, "loading.unload": True, "loading.cycles": 2},
        twin=DIRECT,
    ),
    Scene(
        "force/unreachable",
        "five times the limit load of a perfectly plastic block",
        FLAT
        | {
            "block.sides": "free",
            "material.yield_strength": 2e8,
            "material.tangent_modulus": None,
            "loading.delta_max": None,
            "loading.force_max": 1e-3,
        },
        ends="stopped",
        reason="cannot be reached",
    ),
    Scene(
        "file/noise",
        "wave with noise of a hundredth of its height at every sample",
        FILE | {"loading.delta_max": 0.01 * L, "mesh.h_contact": 0.06 * L, "mesh.h_max": 0.2 * L},
        map=given.noisy,
        twin=DIRECT,
    ),
    Scene(
        "file/spike",
        "one sample 0.1 L above the others",
        FILE | {"loading.delta_max": 0.02 * L},
        map=given.spike,
        ends="refused",
        reason="or filter the surface",
    ),
)
