"""Counts of work on small fixed scenes against stored ones: a slow-down shows without a clock.

    ./run python3 tests/test_counts.py      computes the counts again and stores them in tests/counts.json

Three scenes are on the stored mesh, where the counts vary with round-off only; that of the fourth is made by gmsh,
whose versions differ a little. Store the counts again after a change that is meant to alter them, and say why.
"""

from __future__ import annotations

import json
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import asperity.fem.kernels
import asperity.linear.matrix_free
import asperity.linear.multigrid
from asperity import Material, MeshSize, SolverOptions, Surface, solve_contact
from asperity.mesh.block import BlockMesh
from asperity.quasistatic.contact_result import ContactResult

STORED = Path(__file__).parent / "counts.json"
MESH = Path(__file__).parent.parent / "meshes" / "fractal.npz"
ALLOWANCE = 0.1  # more than the stored count, relative; the mesh of another gmsh has a few per cent more cells
SPARE = 2  # and absolute, for small counts

L = 1e-6
ELASTIC, STEEL = Material(200e9, 0.3), Material(200e9, 0.3, 1e9, 10e9)
ITERATIVE = SolverOptions(linear="cg")  # the size of the scenes would choose a factorisation
SCENES: dict[str, tuple[Material, dict[str, Any]]] = {
    "elastic": (ELASTIC, dict(delta_max=0.03 * L, steps=6, options=ITERATIVE)),
    "plastic": (STEEL, dict(delta_max=0.03 * L, steps=6, options=ITERATIVE)),
    "unloading": (STEEL, dict(delta_max=0.02 * L, steps=2, unload_steps=4, options=ITERATIVE)),
    "meshed": (ELASTIC, dict(delta_max=0.03 * L, steps=3, size=MeshSize(0.12 * L))),
}


class Kernels:
    """Replaces the compiled kernels and counts their calls and the cells they linearise again."""

    def __init__(self, kernels: Any) -> None:
        self._kernels, self.calls = kernels, Counter[str]()

    def __getattr__(self, name: str) -> Callable[..., Any]:
        kernel = getattr(self._kernels, name)

        def counted(*arguments: Any) -> Any:
            self.calls[f"calls of {name}"] += 1
            if name == "stiffness_consistent":
                self.calls["cells linearised again"] += int(arguments[5].sum())
            return kernel(*arguments)

        return counted if name[0].islower() else kernel  # classes are capitalised


def work(result: ContactResult, kernels: Kernels) -> dict[str, int]:
    """What a run took, by name."""
    counts, calls = result.counts, result.phases.calls
    return {
        "dofs": result.dofs, "cells": result.cells, "load steps": counts.steps, "cutbacks": counts.cutbacks,
        "Newton iterations": counts.newton, "shortened Newton steps": counts.shortened,
        "Krylov iterations": counts.krylov, "factorisations for rescue": counts.direct,
        "residuals": calls["residual"], "tangents": calls["tangent"], "preconditioners": calls["preconditioner"],
    } | kernels.calls  # fmt: skip


def fractal() -> Surface:
    """The surface of cases/single.toml, for which the stored mesh is made."""
    return Surface.from_spec(kind="weierstrass-mandelbrot", L=L, D=2.4, G=1.36e-11)


def measure(name: str, patch: pytest.MonkeyPatch) -> dict[str, int]:
    """Counts of a scene."""
    material, settings = SCENES[name]
    kernels = Kernels(asperity.fem.kernels._solver)
    for module in (asperity.fem.kernels, asperity.linear.multigrid, asperity.linear.matrix_free):
        patch.setattr(module, "_solver", kernels)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        surface = fractal()
    block = None if "size" in settings else BlockMesh.read(MESH)
    return work(solve_contact(surface, material, block=block, **settings), kernels)


def excess(name: str, found: dict[str, int], stored: dict[str, int]) -> list[str]:
    """A sentence for each count that is above the stored one by more than the allowance."""
    return [
        f"{count} of the {name} scene went up from {stored.get(count, 0)} to {value}, more than {ALLOWANCE:.0%} and "
        f"{SPARE}: fix it, or if it is intended, store it with ./run python3 tests/test_counts.py"
        for count, value in found.items()
        if value > stored.get(count, 0) * (1.0 + ALLOWANCE) + SPARE
    ]


@pytest.mark.parametrize("name", SCENES)
def test_no_count_has_gone_up(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = measure(name, monkeypatch)
    assert excess(name, found, json.loads(STORED.read_text(encoding="utf-8"))[name]) == []


def test_nothing_is_compiled_at_run_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """From surface to curve no form is handed to a compiler, which nodes of a cluster may not have."""
    import dolfinx.jit

    def refuse(*arguments: Any, **options: Any) -> None:
        raise AssertionError("a form was compiled at run time")

    monkeypatch.setattr(dolfinx.jit, "ffcx_jit", refuse)
    for material in (ELASTIC, STEEL):
        result = solve_contact(fractal(), material, delta_max=0.01 * L, steps=1, block=BlockMesh.read(MESH))
        assert result.complete


if __name__ == "__main__":
    counts = {}
    for scene in SCENES:
        with pytest.MonkeyPatch.context() as patched:
            counts[scene] = measure(scene, patched)
    STORED.write_text(json.dumps(counts, indent=2) + "\n", encoding="utf-8")
