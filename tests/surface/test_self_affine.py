"""Self-affine surfaces against their definition: sums of waves, the spectrum, nested cut-offs, the summit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from asperity.errors import InputError
from asperity.surface import SelfAffine, Surface
from asperity.surface.spectrum import psd

KEYS: dict[str, Any] = dict(L=2.0, H=0.7, slope=0.3, lambda_roll=0.8, lambda_short=0.1, seed=3)


def make(**changes: Any) -> SelfAffine:
    return SelfAffine(**{name: value for name, value in {**KEYS, **changes}.items() if value is not None})


def waves(surface: SelfAffine) -> tuple[np.ndarray, ...]:
    """Amplitude, wave vector and phase of each wave, from the definition: squares outwards, one phase after another."""
    s = surface
    assert s.lambda_roll is not None
    vectors, most = [], math.ceil(s.period / s.lambda_short * math.sqrt(max(s.aspect, 1 / s.aspect)))
    for k in range(1, most + 1):
        vectors += [(k, j) for j in range(k)]
        vectors += [(m, k) for m in range(k, -k, -1)]
        vectors += [(-k, j) for j in range(k, 0, -1)]
    m, n = np.array(vectors).T
    phi = np.random.default_rng(s.seed).uniform(0, 2 * np.pi, m.size)
    q0 = 2 * np.pi / s.period
    q = q0 * np.sqrt(s.aspect * n**2 + m**2 / s.aspect)
    kept = q <= 2 * np.pi / s.lambda_short * (1 + 1e-12)
    a = np.maximum(q, 2 * np.pi / s.lambda_roll) ** (-1 - s.H)
    kept &= (q >= 2 * np.pi / s.lambda_roll * (1 - 1e-12)) | s.plateau
    kx, ky = q0 * n, q0 * m
    if s.slope is not None:
        a *= s.slope / math.sqrt(np.sum((a**2 * (kx**2 + ky**2))[kept]) / 2)
    return tuple(v[kept] for v in (a, kx, ky, phi))


@pytest.mark.parametrize(
    "changes",
    [{}, {"aspect": 2.5}, {"aspect": 0.4, "periodic": False}, {"lambda_roll": None}, {"plateau": False}, {"L": 3.9}],
)
def test_heights_and_derivatives_are_those_of_the_waves(changes: dict[str, Any]) -> None:
    surface = make(**changes)
    a, kx, ky, phi = waves(surface)
    x, y = np.random.default_rng(1).uniform(0, 2, (2, 40))
    theta = np.multiply.outer(x, kx) + np.multiply.outer(y, ky) + phi
    for found, exact, error in (
        (surface.height(x, y), np.cos(theta) @ a, 5e-6),
        (surface.gradient(x, y)[0], -np.sin(theta) @ (a * kx), 1e-4),
        (surface.gradient(x, y)[1], -np.sin(theta) @ (a * ky), 1e-4),
        (surface.hessian(x, y)[0], -np.cos(theta) @ (a * kx**2), 1.5e-3),
        (surface.hessian(x, y)[1], -np.cos(theta) @ (a * kx * ky), 1.5e-3),
        (surface.hessian(x, y)[2], -np.cos(theta) @ (a * ky**2), 1.5e-3),
    ):
        np.testing.assert_allclose(found, exact, rtol=0, atol=error * np.std(exact))


def test_a_periodic_surface_agrees_at_opposite_edges_and_a_window_does_not() -> None:
    s = np.linspace(0, 2, 20)
    for surface, same in ((make(), True), (make(periodic=False), False)):
        assert surface.periodic is same
        for edges in (
            (surface.height(0, s), surface.height(2, s)),
            (surface.gradient(s, 0)[1], surface.gradient(s, 2)[1]),
        ):
            assert np.allclose(*edges, atol=1e-9) is same
    assert make().mean() == 0.0


@pytest.mark.parametrize("aspect", [1.0, 3.0])
def test_rms_values_are_those_of_the_surface(aspect: float) -> None:
    surface = make(aspect=aspect)
    grid = surface.statistics(401)
    assert surface.rms_slope() == pytest.approx(0.3, rel=1e-12)
    for exact, sampled in zip(surface.exact_rms(), (grid.Sq, grid.rms_slope, grid.rms_curvature), strict=True):
        assert exact == pytest.approx(sampled, rel=0.01)  # the grid has both of the edges
    kept = make(slope=None, rms_height=0.01, aspect=aspect)
    assert kept.exact_rms()[0] < 0.01
    assert kept.with_cutoff(2 / 700).exact_rms()[0] == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize("changes", [{}, {"slope": None, "rms_height": 0.01}, {"aspect": 2.0, "periodic": False}])
def test_a_shorter_cutoff_adds_waves_to_the_same_surface(changes: dict[str, Any]) -> None:
    surface = make(**changes)
    fine = surface.with_cutoff(0.03)
    assert fine.rms_slope() > 1.2 * surface.rms_slope()
    # without its short waves the fine one is the coarse one again
    again = fine.with_cutoff(0.1)
    np.testing.assert_allclose(again.grid(50), surface.grid(50), rtol=0, atol=1e-14)
    x, y = np.random.default_rng(1).uniform(0, 2, (2, 30))
    long, same = (s.smoothed(x, y, 0.12) for s in (surface, fine))
    np.testing.assert_allclose(same, long, rtol=0, atol=5e-3 * np.ptp(long))
    if surface.rms_height is not None:  # and the key of a case is enough
        np.testing.assert_allclose(make(**changes, lambda_short=0.03).grid(50), fine.grid(50), rtol=0, atol=1e-14)


def test_the_spectrum_is_flat_and_then_a_power_law() -> None:
    surface = make(lambda_roll=0.4, lambda_short=0.02, H=0.5)
    spectrum = psd(surface.grid(513)[:-1, :-1], 2.0, window="none")
    q = spectrum.q
    ideal = np.maximum(q, 2 * np.pi / 0.4) ** -3.0
    inside = q < 2 * np.pi / 0.021
    ratio = (spectrum.density / ideal)[inside]
    assert np.ptp(ratio[3:]) / ratio[3:].mean() < 0.1  # rings contain few waves where q is small
    assert np.all(spectrum.density[q > 2 * np.pi / 0.0195] < 1e-12 * spectrum.density[0])
    bare = make(lambda_roll=0.4, lambda_short=0.02, H=0.5, plateau=False)
    density = psd(bare.grid(513)[:-1, :-1], 2.0, window="none").density
    assert np.all(density[q < 2 * np.pi / 0.45] < 1e-12 * density.max())
    beyond = inside & (q > 2 * np.pi / 0.36)
    assert np.ptp((density / ideal)[beyond]) < 0.1 * (density / ideal)[beyond].mean()
    assert bare.rms_slope() == pytest.approx(surface.rms_slope())


def test_short_waves_are_those_below_the_cutoff() -> None:
    surface = make()
    assert surface.short_waves(0.05, 1.0) < 1e-3 * surface.short_waves(10.0, 1.0)
    assert surface.short_waves(10.0, 1.0) == pytest.approx(surface.exact_rms()[0], rel=1e-6)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"H": 1.1}, "surface.H"),
        ({"rms_height": 0.1}, "both given"),
        ({"slope": None}, "both missing"),
        ({"slope": -1.0}, "surface.rms_slope"),
        ({"lambda_short": 0.9}, "lambda_roll"),
        ({"lambda_short": 1e-4}, "at least 0.000977"),
        ({"lambda_short": 0.5, "plateau": False}, "at most half of surface.lambda_roll = 0.8 without a plateau"),
        ({"lambda_roll": 2.1}, "lambda_roll"),
        ({"lambda_roll": 4.1, "periodic": False}, "the period"),
    ],
)
def test_illegal_values_are_named(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        make(**changes)


def test_the_key_of_the_slope_is_rms_slope() -> None:
    """In a case; `rms_slope` is a method of every surface."""
    keys = {name: value for name, value in KEYS.items() if name != "slope"}
    assert Surface.from_spec("self-affine", **keys, rms_slope=0.05).rms_slope() == pytest.approx(0.05)


def test_heights_of_many_waves_are_gaussian_and_seeds_differ() -> None:
    made = [make(lambda_roll=0.2, lambda_short=0.04, seed=seed).grid(257) for seed in range(6)]
    skew, kurtosis = (np.mean([np.mean((z / z.std()) ** k) for z in made]) for k in (3, 4))
    assert abs(skew) < 0.1 and kurtosis == pytest.approx(3, abs=0.15)
    assert len({np.ptp(z) for z in made}) == 6 and np.ptp([z.std() for z in made]) < 0.01 * made[0].std()


def test_anisotropy_stretches_features_along_x() -> None:
    zx, zy = make(aspect=4.0, lambda_short=0.05).grid_gradient(257)
    assert np.std(zy) / np.std(zx) == pytest.approx(4.0, rel=0.1)
    turned = make(aspect=0.25, lambda_short=0.05).grid_gradient(257)
    assert np.std(turned[0]) / np.std(turned[1]) == pytest.approx(4.0, rel=0.1)
