"""Hard cases that sweep a parameter."""

from __future__ import annotations

from math import pi

from .scene import DIRECT, ELASTIC, PENALTY, L, Scene, Twin, wave


def plane() -> list[Scene]:
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


def slopes() -> list[Scene]:
    """Waves with slopes far beyond what small strains are meant for."""
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


def strengths() -> list[Scene]:
    """Yield strengths from nothing to never reached."""
    return [
        Scene(
            f"strength/{ratio:g}",
            f"sigma_y/E = {ratio:g}, E_t/E = 0.05",
            {"material.yield_strength": ratio * 200e9, "loading.unload": True},
            twin=PENALTY,
        )
        for ratio in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
    ]


def hardening() -> list[Scene]:
    """Perfect plasticity, and hardening from weak to nearly elastic."""
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


def penalties() -> list[Scene]:
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
