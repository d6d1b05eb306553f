"""The hard cases."""

from __future__ import annotations

from math import pi

from . import claims, files
from .scene import DIRECT, ELASTIC, FILE, FLAT, PENALTY, Keys, L, Scene, Twin, sphere, wave


def _plane() -> list[Scene]:
    """The plane of fractal parameters, each surface pressed to the same part of its depth.

    The steepest ones have slopes above one and bend within an element: their mesh is refused.
    """
    steep = {(2.05, 1e-13), (2.05, 1e-11), (2.05, 1e-10), (2.2, 1e-11), (2.2, 1e-10), (2.3, 1e-10)}
    return [
        Scene(
            f"plane/D{D}-G{G:.0e}",
            f"D = {D}, G = {G:g} m, half-way to the mean plane",
            {"surface.D": D, "surface.G": G},
            ends="refused" if (D, G) in steep else "done",
            reason="turned inside out" if (D, G) in steep else "",
            depth=0.5,
            twin=DIRECT,
            fast=(D, G) == (2.95, 1e-11),
        )
        for D in (2.05, 2.2, 2.3, 2.5, 2.8, 2.95)
        for G in (1e-13, 1e-11, 1e-10)
    ]


def _slopes() -> list[Scene]:
    return [
        Scene(
            f"slope/{slope}-{material}",
            f"wave with slopes up to {slope}, {material}",
            wave(slope / (2 * pi)) | keys | {"loading.delta_max": 0.05 * L, "mesh.h_max": 0.15 * L},
            twin=DIRECT,
            fast=slope == 1.0 and material == "elastic",
        )
        for slope in (0.5, 1.0, 1.5)
        for material, keys in (("elastic", ELASTIC), ("plastic", {}))
    ]


def _strengths() -> list[Scene]:
    return [
        Scene(
            f"strength/{ratio:g}",
            f"sigma_y/E = {ratio:g}, E_t/E = 0.05",
            {"material.yield_strength": ratio * 200e9, "loading.unload": True},
            twin=PENALTY,
        )
        for ratio in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
    ]


def _hardening() -> list[Scene]:
    perfect = {"material.tangent_modulus": None, "loading.unload": True}
    return [
        Scene("hardening/0", "perfect plasticity", perfect, twin=DIRECT, fast=True),
        Scene("hardening/0-fine", "perfect plasticity, finer mesh", perfect | {"mesh.h_contact": 0.06 * L}),
        Scene(
            "hardening/0-nu0.499",
            "perfect plasticity, nu = 0.499",
            perfect | {"material.nu": 0.499, "loading.delta_max": 0.02 * L},
            twin=DIRECT,
        ),
        Scene(
            "hardening/0-weak",
            "perfect plasticity, sigma_y/E = 1e-4",
            perfect | {"material.yield_strength": 2e7, "loading.delta_max": 0.02 * L},
        ),
        *(
            Scene(
                f"hardening/{ratio}",
                f"E_t/E = {ratio}",
                {"material.tangent_modulus": ratio * 200e9, "loading.unload": True},
                twin=DIRECT,
            )
            for ratio in (0.001, 0.9, 0.99)
        ),
    ]


def _penalties() -> list[Scene]:
    """How far each factor is from exact contact is known: 2 % at 10, in proportion to its inverse.

    To tell that from the error of the mesh needs a finer one than the largest factors allow in seconds.
    """
    exact = {"contact.method": "active-set", "contact.penalty": None}
    fine = {"mesh.h_contact": 0.05 * L, "mesh.growth": 0.25}
    return [
        Scene(
            f"penalty/{factor:g}",
            f"penalty factor {factor:g}",
            {
                "contact.method": "penalty",
                "contact.penalty": factor,
                "loading.delta_max": 0.01 * L,
                "loading.steps": 4,
                "loading.unload": True,
            }
            | (fine if factor < 1e4 else {}),
            ends="stopped" if factor > 1e5 else "done",
            reason="no convergence" if factor > 1e5 else "",
            twin=Twin("exact contact", min(0.6, 0.08 + 0.5 / factor), exact) if factor < 1e4 else None,
        )
        for factor in (0.1, 1.0, 10.0, 100.0, 1e3, 1e4, 1e6)
    ]


UM_GPA: Keys = {
    "units": "other",
    "surface.L": 1.0,
    "surface.G": 1.36e-5,
    "material.E": 200.0,
    "material.yield_strength": 1.0,
    "material.tangent_modulus": 10.0,
    "mesh.h_contact": 0.12,
    "mesh.h_max": 0.4,
    "loading.delta_max": 0.03,
}

SCENES: tuple[Scene, ...] = (
    *_plane(),
    *_slopes(),
    Scene(
        "slope/coarse",
        "slopes up to 1.5, elements as large as the wave",
        wave(1.5 / (2 * pi)),
        ends="refused",
        reason="turned inside out",
        fast=True,
    ),
    Scene(
        "full/wave-1d",
        "elastic wave pressed to nearly full contact",
        wave(0.01, 1) | ELASTIC | {"loading.steps": 10},
        depth=3.56,
        claim=claims.nearly_full,
        fast=True,
    ),
    Scene(
        "full/wave-2d",
        "elastic egg-box pressed to nearly full contact",
        wave(0.01) | ELASTIC | {"loading.steps": 10},
        depth=4.6,
        claim=claims.nearly_full,
    ),
    Scene(
        "full/plastic",
        "soft plastic wave pressed to nearly full contact, and released",
        wave(0.01) | {"material.yield_strength": 2e8, "loading.unload": True},
        depth=2.6,
        claim=claims.nearly_full,
    ),
    Scene(
        "full/beyond",
        "delta_max beyond full contact",
        {"loading.delta_max": 0.2 * L},
        ends="refused",
        reason="no gap at all",
        fast=True,
    ),
    Scene(
        "touch/one-point",
        "sphere of R = L touched at one point, lifted off",
        sphere(1.0) | ELASTIC | {"mesh.h_contact": 4e-3 * L, "loading.delta_max": 1e-4 * L, "loading.unload": True},
        claim=claims.hertz(0.05),
        fast=True,
    ),
    Scene(
        "touch/two-peaks",
        "two equal peaks",
        FILE | {"loading.delta_max": 0.02 * L, "loading.unload": True},
        map=files.two_peaks,
        twin=Twin("turned by 90 degrees", 0.05, map=files.two_peaks_turned),
        fast=True,
    ),
    Scene(
        "light/1e-5",
        "delta = 1e-5 L on a sphere of R = L",
        sphere(1.0) | ELASTIC | {"mesh.h_contact": 1e-3 * L, "loading.delta_max": 1e-5 * L, "loading.steps": 3},
        claim=claims.hertz(0.05),
    ),
    Scene(
        "light/1e-5-rough",
        "delta = 1e-5 L on the rough surface, elastic-plastic, with unloading",
        {"mesh.h_contact": 4e-3 * L, "loading.delta_max": 1e-5 * L, "loading.steps": 3, "loading.unload": True},
        twin=DIRECT,
    ),
    Scene(
        "light/1e-5-coarse",
        "the same on a mesh far coarser than the contact spot",
        {"loading.delta_max": 1e-5 * L, "loading.steps": 3},
    ),
    *_hardening(),
    *_strengths(),
    Scene("poisson/0.499", "nu = 0.499, elastic", ELASTIC | {"material.nu": 0.499}, twin=PENALTY, fast=True),
    Scene(
        "poisson/0.499-plastic",
        "nu = 0.499, elastic-plastic, unloading",
        {"material.nu": 0.499, "loading.delta_max": 0.02 * L, "loading.unload": True},
        twin=DIRECT,
    ),
    Scene("poisson/0.4999", "nu = 0.4999, elastic", ELASTIC | {"material.nu": 0.4999}, twin=DIRECT),
    Scene("poisson/0", "nu = 0, elastic-plastic, unloading", {"material.nu": 0.0, "loading.unload": True}, twin=DIRECT),
    Scene("poisson/-0.9", "nu = -0.9, elastic", ELASTIC | {"material.nu": -0.9}, twin=DIRECT),
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
    Scene("block/tall", "height 3 L", {"block.height": 3 * L}, twin=DIRECT),
    Scene(
        "yield/whole-block",
        "flat block in uniaxial strain far beyond yield, and back",
        FLAT | {"material.yield_strength": 2e8, "loading.delta_max": 0.03 * L, "loading.unload": True},
        claim=claims.uniaxial_strain,
        fast=True,
    ),
    Scene(
        "yield/whole-perfect",
        "the same, perfectly plastic",
        FLAT
        | {
            "material.yield_strength": 2e8,
            "material.tangent_modulus": None,
            "loading.delta_max": 0.03 * L,
            "loading.unload": True,
        },
        claim=claims.uniaxial_strain,
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
        "yield/rough",
        "rough block, sigma_y/E = 1e-3, pressed until all of it yields",
        {"material.yield_strength": 2e8, "loading.delta_max": 0.055 * L, "loading.unload": True},
        twin=DIRECT,
    ),
    Scene(
        "steps/1",
        "one huge step",
        {"loading.steps": 1},
        twin=Twin("200 steps", 0.25, {"loading.steps": 200}),
    ),
    Scene(
        "steps/1-euler",
        "one huge step by backward Euler",
        {"loading.steps": 1, "loading.integrator": "backward-euler"},
        twin=Twin("200 steps", 0.4, {"loading.steps": 200}),
    ),
    Scene(
        "steps/1-elastic",
        "one huge step, elastic",
        ELASTIC | {"loading.steps": 1},
        twin=Twin("200 steps", 1e-6, {"loading.steps": 200}),
    ),
    Scene(
        "cycles/20",
        "20 cycles of loading and unloading",
        {"loading.unload": True, "loading.cycles": 20, "loading.steps": 4, "loading.unload_steps": 4},
        claim=claims.shakes_down,
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
        claim=claims.shakes_down,
    ),
    Scene(
        "cycles/long-unloading",
        "an unloading in 100 steps",
        {"loading.unload": True, "loading.unload_steps": 100},
        twin=Twin("in 10 steps", 0.05, {"loading.unload_steps": 10}),
    ),
    Scene(
        "cycles/20-perfect",
        "20 cycles, perfectly plastic",
        {
            "loading.unload": True,
            "loading.cycles": 20,
            "loading.steps": 4,
            "loading.unload_steps": 4,
            "material.tangent_modulus": None,
        },
        claim=claims.shakes_down,
    ),
    Scene(
        "cycles/20-elastic",
        "20 cycles, elastic",
        ELASTIC | {"loading.unload": True, "loading.cycles": 20, "loading.steps": 3, "loading.unload_steps": 3},
        claim=claims.closed_loops,
    ),
    Scene(
        "edge/free-corner",
        "summit in the corner of a block with free sides",
        wave(0.05, centre=(0.0, 0.0)) | {"block.sides": "free", "loading.unload": True},
        twin=PENALTY,
    ),
    Scene(
        "edge/free-sphere",
        "elastic-plastic sphere touched in the corner of a block with free sides",
        sphere(0.5, centre=(0.0, 0.0)) | {"block.sides": "free", "loading.delta_max": 0.02 * L, "loading.unload": True},
        twin=DIRECT,
    ),
    Scene(
        "edge/free-rough",
        "rough surface, free sides",
        {"block.sides": "free", "loading.delta_max": 0.05 * L, "loading.unload": True},
        twin=DIRECT,
    ),
    *_penalties(),
    Scene(
        "nitsche/100",
        "Nitsche's method, gamma = 100",
        {"contact.method": "nitsche", "contact.gamma": 100.0, "loading.unload": True},
        twin=Twin("exact contact", 0.05, {"contact.method": "active-set", "contact.gamma": None}),
    ),
    Scene(
        "nitsche/0.1",
        "Nitsche's method, gamma = 0.1",
        {"contact.method": "nitsche", "contact.gamma": 0.1, "loading.unload": True},
        twin=Twin("exact contact", 0.1, {"contact.method": "active-set", "contact.gamma": None}),
    ),
    Scene(
        "nitsche/1e4",
        "Nitsche's method, gamma = 1e4",
        {"contact.method": "nitsche", "contact.gamma": 1e4, "loading.unload": True},
        twin=Twin("exact contact", 0.05, {"contact.method": "active-set", "contact.gamma": None}),
    ),
    Scene(
        "mesh/slivers",
        f"tetrahedra flattened to {files.SLIVER:g} of their height",
        {"loading.unload": True, "mesh.h_max": 0.15 * L},
        spoil=files.with_slivers,
        twin=Twin("without them", 0.05, {"mesh.file": None}),
    ),
    Scene(
        "mesh/slivers-direct",
        "the same, by CG and LU",
        {"mesh.h_max": 0.15 * L},
        spoil=files.with_slivers,
        twin=DIRECT,
    ),
    Scene("mesh/abrupt", "elements grow abruptly", {"mesh.growth": 10.0, "mesh.h_max": L}, twin=DIRECT),
    Scene(
        "mesh/turned",
        "mesh with an element turned inside out",
        spoil=files.with_turned_element,
        ends="refused",
        reason="turned inside out",
        fast=True,
    ),
    Scene(
        "yield/one-step",
        "flat block in full contact from the first of its steps",
        FLAT | {"material.yield_strength": 2e8, "loading.delta_max": 0.03 * L, "loading.steps": 1},
        claim=claims.uniaxial_strain,
    ),
    Scene("units/um-GPa", "SI", {"loading.unload": True}, twin=Twin("in um and GPa", 1e-8, UM_GPA), fast=True),
    Scene(
        "force/given",
        "half of what the displacement reaches",
        {"loading.delta_max": None, "loading.force_max": 5e-3, "loading.unload": True, "loading.cycles": 2},
        twin=DIRECT,
    ),
    Scene(
        "force/light",
        "force of 1e-8 E' L^2",
        {"loading.delta_max": None, "loading.force_max": 2e-9, "mesh.h_contact": 0.1 * L},
        twin=DIRECT,
    ),
    Scene(
        "force/next-to-nothing",
        "force of 1.4e-12 E' L^2, on a sphere",
        sphere(1.0) | {"loading.delta_max": None, "loading.force_max": 3e-13, "mesh.h_contact": 0.1 * L},
        twin=DIRECT,
    ),
    Scene(
        "force/huge",
        "elastic, pressed by its own stiffness",
        ELASTIC | {"loading.delta_max": None, "loading.force_max": 0.2},
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
        map=files.noisy,
        twin=DIRECT,
    ),
    Scene(
        "file/noise-coarse",
        "noise of a tenth, finer than the elements",
        FILE | {"loading.delta_max": 0.02 * L},
        map=files.very_noisy,
        ends="refused",
        reason="turned inside out",
    ),
    Scene("file/step", "terrace with a cliff", FILE | {"loading.delta_max": 0.01 * L}, map=files.terrace, twin=DIRECT),
    Scene(
        "file/spike",
        "one sample 0.1 L above the others",
        FILE | {"loading.delta_max": 0.02 * L},
        map=files.spike,
        ends="refused",
        reason="turned inside out",
    ),
    Scene("file/nan", "a missing height", FILE, map=files.with_nan, ends="refused", reason="not finite", fast=True),
    Scene("file/flat", "constant heights", FILE | {"loading.delta_max": 1e-3 * L}, map=files.constant),
)
