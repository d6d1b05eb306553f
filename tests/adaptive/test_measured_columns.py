"""Mean gap and stiffness of runs with a tolerance against a half-space that knows nothing of meshes."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ELASTIC

import asperity as asp
from asperity import reference
from asperity.adaptive.loading import shifted
from asperity.curve import WITH_ERRORS, Curve
from asperity.surface import SelfAffine, Sinusoid


def test_gap_and_stiffness_are_inside_their_bars() -> None:
    surface = SelfAffine(L=1.0, H=0.8, slope=0.03, lambda_roll=0.5, lambda_short=0.25, seed=5)
    depth = 0.004
    found = asp.solve_contact(
        surface, ELASTIC, tolerance=asp.AccuracyTarget(0.05), delta_max=depth, steps=5, stiffness=True, flow=True
    )
    curve = found.curve.loading()
    layer = reference.RoughHalfSpace(256, 1.0, ELASTIC.nu)
    heights, summit = layer.heights(surface), surface.maximum()[2]

    def force(delta: np.ndarray) -> np.ndarray:
        return layer.curve(heights, summit, delta, tolerance=1e-5).P_star

    delta = curve.delta_star
    # the identity of a layer between rollers: the mean plane sinks by the approach, less the compression of the block
    compression = force(delta) * ELASTIC.reduced_modulus / ELASTIC.confined_modulus
    gap = summit - surface.mean() - delta + compression
    assert np.all(np.abs(curve.mean_gap - gap) <= curve.error_mean_gap + 1e-6)
    slope = (force(1.02 * delta) - force(0.98 * delta)) / (0.04 * delta) * ELASTIC.reduced_modulus
    assert np.all(np.abs(curve.k_n - slope) <= curve.error_k_n + 0.02 * slope)
    assert np.all(curve.error_k_n < 0.15 * curve.k_n) and np.all(curve.error_mean_gap < 0.02 * gap)
    for name in WITH_ERRORS:
        bars = getattr(found.curve, f"error_{name}")
        assert np.all(np.isfinite(bars) & (bars > 0.0)), name


def test_columns_that_were_not_computed_have_no_bar() -> None:
    curve = asp.solve_contact(
        Sinusoid(L=1.0, amplitude=0.01), ELASTIC, tolerance=asp.AccuracyTarget(0.2), delta_max=0.005, steps=5
    ).curve
    assert np.isnan(curve.k_n_elastic).all() and np.isnan(curve.error_k_n_elastic).all()
    assert np.isfinite(curve.error_mean_gap).all() and np.isfinite(curve.error_k_n).all()  # these take no solve


def test_on_unloading_the_bar_of_a_stiffness_holds_that_of_the_force() -> None:
    """The force keeps its bar while it vanishes: where it is as small as its bar, nothing is known of the stiffness."""
    P = np.array([1.0, 2.0, 3.0, 2.0, 1.0, 0.05, 0.0])
    rows = [
        {"delta": d, "delta_star": d, "force": p, "P_star": p, "branch": "load" if k < 3 else "unload"}
        for k, (d, p) in enumerate(zip([1.0, 2.0, 3.0, 2.5, 2.2, 2.1, 2.0], P, strict=True))
    ]
    stiffness = P ** (1.0 / 3.0)
    found = shifted(Curve.from_rows(rows), np.full(7, 0.1), stiffness)
    assert np.all(found[:3] == 0.0) and found[5] == pytest.approx(stiffness[5])
    part = found[3:6] / stiffness[3:6]
    assert np.all(np.diff(part) > 0.0) and part[0] == pytest.approx(0.1 / 3.0 / 2.0, rel=0.35)
