"""Hard cases of finite strain and of kinematic hardening."""

from __future__ import annotations

from math import pi

from scene_definition import DIRECT, ELASTIC, FLAT, Keys, L, Scene, Twin, keeps_a_loop, wave

FINITE: Keys = {"material.kinematics": "finite"}
MOVING: Keys = {"material.hardening": "kinematic"}
SOFT: Keys = {"material.yield_strength": 2e8}
STEEP: Keys = {
    "surface.kind": "self-affine",
    "surface.H": 0.8,
    "surface.rms_slope": 0.7,
    "surface.lambda_short": 0.25 * L,
    "surface.seed": 1,
    "surface.D": None,
    "surface.G": None,
    "mesh.h_max": 0.2 * L,
}
TWENTY: Keys = {"loading.unload": True, "loading.cycles": 20, "loading.steps": 4, "loading.unload_steps": 4}


def finite() -> list[Scene]:
    """Slopes up to 1.5, the whole block yielding, other contact formulations."""
    return [
        *(
            Scene(
                f"finite/slope-{slope}-{material}",
                f"wave with slopes up to {slope}, {material}, finite strain, released",
                wave(slope / (2 * pi))
                | keys
                | FINITE
                | {"loading.delta_max": 0.05 * L, "loading.unload": True, "mesh.h_max": 0.15 * L},
                twin=DIRECT,
            )
            for slope in (1.0, 1.5)
            for material, keys in (("elastic", ELASTIC), ("plastic", {}))
        ),
        *(
            Scene(
                f"finite/rough-{name}",
                f"self-affine surface of rms slope 0.7, {name}, three quarters of the way to its mean plane, released",
                STEEP | FINITE | keys | {"loading.steps": 8, "loading.unload_steps": 4, "loading.unload": True},
                depth=0.75,
            )
            for name, keys in (("plastic", {}), ("soft", SOFT), ("free", {"block.sides": "free"}))
        ),
        Scene(
            "finite/rough-periodic",
            "the same surface, periodic sides, plastic",
            STEEP
            | FINITE
            | {"block.sides": "periodic", "loading.steps": 8, "loading.unload_steps": 4, "loading.unload": True},
            depth=0.5,
        ),
        Scene(
            "finite/beyond-mean-plane",
            "the surface of cases/single.toml, to 0.055 L until all of it yields, and released",
            SOFT | FINITE | {"loading.delta_max": 0.055 * L, "loading.steps": 20, "loading.unload": True},
        ),
        Scene(
            "finite/whole-block",
            "flat block in uniaxial strain to 45 %, and back",
            FLAT | FINITE | SOFT | {"loading.delta_max": 0.45 * L, "loading.steps": 20, "loading.unload": True},
            fast=True,
        ),
        Scene(
            "finite/free-sides",
            "flat block squeezed between free sides to 45 %, perfectly plastic",
            FLAT
            | FINITE
            | SOFT
            | {
                "block.sides": "free",
                "material.tangent_modulus": None,
                "loading.delta_max": 0.45 * L,
                "loading.steps": 45,
                "loading.unload": True,
            },
            twin=Twin("LU, not CG", 1e-5, {"solver.linear": "lu"}),  # of the indentation left
        ),
        Scene(
            "finite/friction",
            "friction on the surface of cases/single.toml, released",
            FINITE | {"contact.friction": 0.3, "loading.unload": True},
        ),
        Scene(
            "finite/auto",
            "slopes up to 1: auto chooses finite strain",
            wave(1.0 / (2 * pi)) | {"material.kinematics": "auto", "loading.delta_max": 0.05 * L},
            twin=Twin("finite", 1e-9, FINITE),
        ),
    ]


def kinematic() -> list[Scene]:
    """Kinematic hardening under cycles, and at its limits."""
    return [
        Scene("kinematic/cycles-20", "20 cycles", MOVING | TWENTY, claim=keeps_a_loop),
        Scene(
            "kinematic/whole-block",
            "flat block in uniaxial strain far beyond yield, three cycles",
            FLAT | MOVING | SOFT | {"loading.delta_max": 0.03 * L, "loading.unload": True, "loading.cycles": 3},
            fast=True,
        ),
        Scene(
            "kinematic/perfect",
            "without hardening both kinds are the same",
            MOVING | {"material.tangent_modulus": None, "loading.unload": True},
            twin=Twin("isotropic", 1e-12, {"material.hardening": "isotropic"}),
        ),
        Scene(
            "kinematic/elastic",
            "an elastic material has no hardening",
            MOVING | ELASTIC,
            ends="refused",
            reason="needs material.yield_strength",
            fast=True,
        ),
    ]
