"""A run directory with made-up numbers of the right shape, for figures and the report."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from asperity.case import Case
from asperity.curve import COLUMNS, Curve
from asperity.mesh.element import FACE_TRIANGLES
from asperity.surface import Surface

CASE = {
    "surface": {"kind": "weierstrass-mandelbrot", "L": 1e-6, "D": 2.4, "G": 1.36e-11},
    "material": {"E": 200e9, "nu": 0.3, "yield_strength": 1e9, "tangent_modulus": 10e9},
    "loading": {"delta_max": 0.03e-6, "steps": 12, "unload": True},
    "dynamics": {},
}
FIT = {
    "k": 0.42, "n": 1.55, "range": [0.005, 0.03], "points": 12, "r2": 0.9987,
    "ci": {"k": [0.40, 0.44], "n": [1.52, 1.58], "confidence": 0.95},
}  # fmt: skip

THRESHOLDS = {
    "n_loc": 1.55, "kappa": -0.047, "load": 1.2e-4, "zeta": 0.01, "damping": "always", "notes": [],
    "exact": {"u_max": 0.83, "peaks": [{"F_hat": 0.01, "Omega": 0.987}]},
}  # fmt: skip


def write_run(folder: Path, **changes: object) -> Path:
    """Write case.toml, curve.csv, summary.json and fields."""
    case = Case.from_dict({**CASE, **changes})
    surface = case.surface
    (folder / "fields").mkdir(parents=True, exist_ok=True)
    (folder / "case.toml").write_text(case.to_toml(), encoding="utf-8")
    rows = curve_rows(plastic=case.material.yield_strength is not None)
    Curve.from_rows([dict(zip(COLUMNS, row, strict=False)) for row in rows]).write(folder / "curve.csv")
    (folder / "summary.json").write_text(json.dumps(summary()), encoding="utf-8")
    (folder / "thresholds.json").write_text(json.dumps(THRESHOLDS), encoding="utf-8")
    write_top(folder, surface, rows)
    return folder


def curve_rows(plastic: bool = True) -> list[list[object]]:
    load = np.linspace(0, 0.03, 13)[1:]
    unload = np.linspace(0.03, 0.022, 7)[1:]
    P = np.concatenate([0.42 * load**1.55, 0.42 * 0.03**1.55 * ((unload - 0.0215) / 0.0085) ** 1.4])
    delta = np.concatenate([load, unload])
    flow = plastic * np.minimum(delta, 0.03) ** 2
    flow[len(load) :] = flow[len(load) - 1]
    branch = ["load"] * len(load) + ["unload"] * len(unload)
    E_prime = 200e9 / 0.91
    return [
        [
            i + 1, branch[i], delta[i] * 1e-6, delta[i], P[i] * E_prime * 1e-12, P[i], 25 * P[i],
            8e9 + 1e10 * P[i], 20 * flow[i], 80 * flow[i], 0.03 * P[i], 0.6 * P[i], 4, 80, 1.5,
        ]
        for i in range(len(delta))
    ]  # fmt: skip


def summary() -> dict[str, object]:
    return {
        "fit": FIT,
        "error_budget": {"mesh": 0.012, "load_step": 0.008, "solver": 1e-8, "penalty": None},
        "dofs": 51234, "steps": 18, "newton": 72, "krylov": 1440, "exit_reason": "done",
        "seconds": {"mesh": 3.2, "assembly": 11.5, "solve": 14.1, "output": 1.0},
        "peak_memory_MiB": 640.0, "ranks": 2, "seed": 0,
        "versions": {"asperity": "0.1.0", "dolfinx": "0.9.0"},
    }  # fmt: skip


def write_top(folder: Path, surface: Surface, rows: list[list[object]], n: int = 90) -> None:
    """Pressure that grows with the depth of overlap."""
    x = np.linspace(0, 1e-6, n + 1)
    z = surface.grid(n + 1).ravel()
    points = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    first = (np.arange(0, n, 2)[:, None] * (n + 1) + np.arange(0, n, 2)).ravel()[:, None]
    right, up = 1, n + 1  # facets of second order: corners, and middles of 01, 12, 20
    nodes_of = np.array([0, 2 * right, 2 * up, right, right + up, up])
    facets = np.concatenate([first + nodes_of, first + 2 * (right + up) - nodes_of])
    triangles = np.concatenate([facets[:, nodes] for nodes in FACE_TRIANGLES])
    steps = [0, 3, 6, 9, 12, 15]
    delta = np.array([0.0] + [rows[i - 1][2] for i in steps[1:]])
    branch = ["load"] * 5 + ["unload"]
    depth = 0.5 * delta[:, None] - (z.max() - z)
    np.savez(
        folder / "fields/top.npz", points=points, triangles=triangles, steps=steps, branch=branch,
        delta=delta, pressure=2e14 * np.sqrt(np.maximum(depth, 0) * 1e-9),
        gap=np.maximum(-depth, 0), touched=depth > 0,
    )  # fmt: skip
