"""Hard cases that vary one or two parameters over a range."""

from __future__ import annotations

from math import pi

from scene_definition import DIRECT, ELASTIC, PENALTY, L, Scene, Twin, sphere, wave


def plane() -> list[Scene]:
    """The plane of fractal parameters D and G, each surface pressed half-way to its mean plane.

    The steepest ones, with rms slopes beyond 3, bend within one element: smoothing leaves too little of them.
    """
    steep = 2.05
    return [
        Scene(
            f"plane/D{D}-G{G:.0e}",
            f"D = {D}, G = {G:g} m, half-way to the mean plane",
            {"surface.D": D, "surface.G": G},
            ends="refused" if steep == D else "done",
            reason="too large for the slopes" if steep == D else "",
            depth=0.5,
            twin=DIRECT,
            fast=(D, G) == (2.95, 1e-11),
        )
        for D in (2.05, 2.3, 2.5, 2.95)
        for G in (1e-13, 1e-11, 1e-10)
    ]


def slopes() -> list[Scene]:
    """Waves with slopes far above 0.1, the limit of small-strain theory."""
    return [
        Scene(
            f"slope/{slope}-{material}",
            f"wave with slopes up to {slope}, {material}",
            wave(slope / (2 * pi)) | keys | {"loading.delta_max": 0.05 * L, "mesh.h_max": 0.15 * L},
            twin=DIRECT,
            fast=slope == 1.0 and material == "elastic",
        )
        for slope in (1.0, 1.5)
        for material, keys in (("elastic", ELASTIC), ("plastic", {}))
    ]


def strengths() -> list[Scene]:
    """Yield strengths from nearly zero to nearly elastic."""
    return [
        Scene(
            f"strength/{ratio:g}",
            f"sigma_y/E = {ratio:g}, E_t/E = 0.05",
            {"material.yield_strength": ratio * 200e9, "loading.unload": True},
            twin=PENALTY,
        )
        for ratio in (1e-6, 1e-4, 1e-2)
    ]


def hardening() -> list[Scene]:
    """Perfect plasticity, and hardening from weak to nearly elastic."""
    perfect = {"material.tangent_modulus": None, "loading.unload": True}
    return [
        Scene("hardening/0", "perfect plasticity", perfect, twin=DIRECT),
        *(
            Scene(
                f"hardening/{ratio}",
                f"E_t/E = {ratio}",
                {"material.tangent_modulus": ratio * 200e9, "loading.unload": True},
                twin=DIRECT,
            )
            for ratio in (0.001, 0.99)
        ),
    ]


def penalties() -> list[Scene]:
    """Penalty factors from far too soft to far too stiff.

    The error of the force against exact contact is inversely proportional to the factor, 2 % at factor 10; at 0.1 the
    run reports a wrong result. The fine mesh makes this error larger than that of the mesh; it is not used with the
    largest factors, where it would take too long.
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
            | (fine if factor < 100.0 else {}),
            ends=ends,
            reason=reason,
            twin=Twin("exact contact", min(0.6, 0.08 + 0.5 / factor), exact) if factor < 100.0 else None,
        )
        for factor, ends, reason in (
            (0.1, "wrong", "penetrates the flat"),
            *((factor, "done", "") for factor in (1.0, 10.0, 100.0)),
        )
    ]


def tolerances() -> list[Scene]:
    """Runs with a tolerance, which choose mesh and steps themselves; the twin has a smaller tolerance."""
    own = {"mesh.h_contact": None, "mesh.growth": None, "mesh.h_max": None, "solver.linear": None}
    better = {"accuracy.tolerance": 0.005}
    plain, quarter = own | ELASTIC | {"accuracy.tolerance": 0.03}, sphere(1.0, centre=(0.0, 0.0))
    five = {"loading.steps": 5}
    return [
        Scene("tolerance/rough", "3 % on the rough surface, elastic", plain, twin=Twin("0.5 %", 0.035, better)),
        Scene(
            "tolerance/plastic",
            "5 % on a quarter of an elastic-plastic sphere, with unloading",
            own | quarter | five | {"accuracy.tolerance": 0.05, "loading.unload": True},
            twin=Twin("1 %", 0.06, {"accuracy.tolerance": 0.01}),
        ),
        Scene(
            "tolerance/force",
            "3 % to a given force",
            plain | five | {"loading.delta_max": None, "loading.force_max": 2e-3, "loading.unload": True},
            twin=Twin("LU, not CG", 0.01, {"solver.linear": "lu"}),  # approaches and meshes are those of its search
        ),
        Scene(
            "tolerance/light",
            "3 %, delta = 1e-5 L",
            plain | five | {"loading.delta_max": 1e-5 * L},
            twin=Twin("0.5 %", 0.035, better),
        ),
        Scene(
            "tolerance/penalty",
            "3 % by a penalty of factor 10",
            plain | five | {"contact.method": "penalty"},
            twin=Twin("0.5 %, exact contact", 0.035, better | {"contact.method": "active-set"}),
        ),
        Scene(
            "tolerance/nitsche",
            "3 % by Nitsche's method",
            plain | five | {"contact.method": "nitsche"},
            twin=Twin("0.5 %, exact contact", 0.035, better | {"contact.method": "active-set"}),
        ),
        Scene(
            "tolerance/soft",
            "3 % by a penalty of factor 1",
            plain | {"contact.method": "penalty", "contact.penalty": 1.0},
            ends="refused",
            reason="too soft for accuracy.tolerance",
            fast=True,
        ),
        Scene(
            "tolerance/max-dofs",
            "0.01 % with 12000 dofs",
            plain | five | {"accuracy.tolerance": 1e-4, "accuracy.max_dofs": 12_000},
            ends="stopped",
            reason="accuracy.max_dofs = 12000 allows no more",
            fast=True,
        ),
        Scene(
            "tolerance/loose-equations-plastic",
            "1 % on a quarter of an elastic-plastic sphere with equations solved to 1e-2",
            own | quarter | five | {"accuracy.tolerance": 0.01, "solver.rtol": 1e-2},
            ends="stopped",
            reason="is left by the equations",
            twin=Twin("equations solved to 1e-8", 0.057, {"solver.rtol": 1e-8}),  # bars of 4.7 and 1 %
        ),
    ]
