"""A wave on a block of half a wavelength, in light and in wide contact."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from asperity import reference
from asperity.mesh.element import BEARING
from asperity.model.material import Material
from asperity.quasistatic.contact_result import ContactResult
from asperity.surface import Sinusoid
from asperity.verification.table import (
    FORCE,
    LOCAL,
    Row,
    counting_error,
    on_meshes,
    rows_along,
    sizes,
    solve_on_one_rank,
)

WAVELENGTH = 2.0  # [L]: crest and valley are planes of symmetry
AMPLITUDE = 1e-4  # [L]: slopes of 4e-4, so that the effect of finite slopes is negligible
HEIGHT = 3.0  # of the block [L]: the waves have decayed to 1e-5 at the base
MATERIAL = Material(1.0, 0.3)
STIFFNESS = reference.block_modulus(MATERIAL.E, MATERIAL.nu) / HEIGHT


def press_wave(delta: float, refinement: float) -> ContactResult:
    """Solve one step to an approach for a quarter of a wave with its crest in the corner; L = E = 1."""
    wave = Sinusoid(L=1.0, amplitude=AMPLITUDE, wavelength=WAVELENGTH, dims=1, centre=(0.0, 0.0))
    h = 0.12 * min(1.0, (delta / AMPLITUDE) ** 0.5)
    return solve_on_one_rank(
        wave, MATERIAL, height=HEIGHT, delta_max=delta, steps=1, snapshots=1, size=sizes(h, refinement)
    )


def westergaard() -> Iterator[Row]:
    """Force, width, gap and pressure of a wave in plane strain; Westergaard (1939), Johnson (1985) 13.2."""
    theory = reference.Westergaard(AMPLITUDE, WAVELENGTH, MATERIAL.reduced_modulus)
    slope = 2.0 * np.pi * AMPLITUDE / WAVELENGTH
    for share in (0.1, 0.5):
        mean = share * theory.full_pressure
        width = float(theory.area_fraction(mean))
        approach = float(theory.approach(mean))
        results = on_meshes(partial(press_wave, approach + mean / STIFFNESS))
        gap, counted = 1.0 - approach / AMPLITUDE, counting_error(results[-1])
        for name, values, expected, order, least in (
            ("force over full contact", [r.curve.force / theory.full_pressure for r in results], share, FORCE, 0.0),
            ("width of contact over wavelength", [r.curve.area_fraction for r in results], width, LOCAL, counted),
            ("mean gap over amplitude", [_mean_gap(r) / AMPLITUDE for r in results], gap, FORCE, 0.0),
            ("rms error of the pressure over p*", [_pressure_error(r, theory, mean) for r in results], 0.0, LOCAL, 0.0),
        ):
            yield from rows_along(
                "westergaard", [f"{name}, p/p* = {share:g}"], "closed form", values, expected, slope, order=order,
                counted=least,
            )  # fmt: skip


def _mean_gap(result: ContactResult) -> float:
    """Mean gap between top and flat, by the rule of the bearing nodes of the facets [L]."""
    top = result.solver.contact_surface
    return float(np.sum(top.area[:, None] / len(BEARING) * result.snapshots[-1].gap[top.nodes[:, BEARING]]))


def _pressure_error(result: ContactResult, theory: reference.Westergaard, mean: float) -> float:
    """Rms difference from the exact pressure over the nodes, relative to that of full contact."""
    it = result.solver
    corners = np.unique(it.contact_surface.nodes[:, :3])
    exact = theory.pressure(it.solid.points[corners, 0], mean)
    difference = result.snapshots[-1].pressure[corners] - exact
    return float(np.sqrt(np.mean(difference**2)) / theory.full_pressure)
