"""All kinds of surfaces against closed forms, differences and quadrature; maps against the function they sample."""

from __future__ import annotations

import itertools
import math
import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asperity.errors import InputError
from asperity.runtime.declaration import keys
from asperity.surface import (
    Cone,
    Flat,
    HeightMap,
    SelfAffine,
    Sinusoid,
    Sphere,
    Surface,
    SurfaceWarning,
    WeierstrassMandelbrot,
    composite,
    cut_off_index,
)
from asperity.surface.base import surface_kind, surface_kinds

L = 1e-6
EPS = np.finfo(float).eps


def fractal(**options: object) -> WeierstrassMandelbrot:
    """Return the base surface, D = 2.4, G = 13.6 pm, seed 0, with changes."""
    return WeierstrassMandelbrot(**{"L": L, "D": 2.4, "G": 1.36e-11, **options})  # type: ignore[arg-type]


def affine(**options: object) -> SelfAffine:
    return SelfAffine(**{"L": 2.0, "H": 0.7, "slope": 0.3, "lambda_roll": 0.8, "lambda_short": 0.1, **options})  # type: ignore[arg-type]


def noise(*shape: int) -> np.ndarray:
    return 0.01 * np.random.default_rng(5).normal(size=shape)


SURFACES = {
    "fractal": fractal(),
    "ridges": fractal(ridges="1..M", M=7, gamma=1.7, D=2.6, seed=3),
    "sphere": Sphere(L=1.0, radius=0.7),
    "sphere and cone": Sphere(L=1.0, radius=0.3, centre=(0.3, 0.6)),
    "paraboloid": Sphere(L=1.0, radius=2.0, centre=(0.0, 0.0), shape="paraboloid"),
    "sinusoid": Sinusoid(L=1.0, amplitude=0.01, wavelength=0.4, centre=(0.1, 0.7)),
    "double sinusoid": Sinusoid(L=1.0, amplitude=0.01, wavelength=0.4, dims=2, centre=(0.1, 0.7)),
    "cone": Cone(L=1.0, half_angle=60.0, radius=0.2, centre=(0.4, 0.7)),
    "composite": composite(Sinusoid(L=1.0, amplitude=0.01, wavelength=0.4, dims=2), Sphere(L=1.0, radius=0.7)),
    "self-affine": affine(seed=3),
    "window": affine(seed=3, periodic=False, aspect=2.5),
    "map": HeightMap.of(noise(41, 51), (1.0, 1.0)),
    "map with steps": HeightMap.of(np.where(noise(41, 41) > 0.01, 0.0, 0.01), 1.0),
    "flat": Flat(L=1.0),
}


# ---------------------------------------------------------------------------------------- every kind


@pytest.mark.parametrize("name", SURFACES)
def test_grid_and_points_agree(name):
    surface = SURFACES[name]
    for n in (8, 33):
        x, y = np.meshgrid(*2 * [np.linspace(0, surface.L, n)])
        pairs: list[tuple[np.ndarray, np.ndarray]] = [(surface.grid(n), surface.height(x, y))]
        pairs += zip(surface.grid_gradient(n), surface.gradient(x, y), strict=True)
        pairs += zip(surface.grid_hessian(n), surface.hessian(x, y), strict=True)
        for grid, points in pairs:
            assert grid.shape == points.shape == (n, n)
            np.testing.assert_allclose(grid, points, rtol=1e-9, atol=2e-12 * abs(points).max())


@pytest.mark.parametrize("name", SURFACES)
def test_derivatives_against_central_differences_and_their_bound(name):
    surface = SURFACES[name]
    x, y = np.random.default_rng(4).uniform(0.01, 0.99, size=(2, 200)) * surface.L
    h = 1e-5 * surface.L
    zx = (surface.height(x + h, y) - surface.height(x - h, y)) / (2 * h)
    zy = (surface.height(x, y + h) - surface.height(x, y - h)) / (2 * h)
    for analytic, difference in zip(surface.gradient(x, y), (zx, zy), strict=True):
        np.testing.assert_allclose(analytic, difference, atol=2e-6 * (abs(zx).max() + 1e-30))
    (ax, ay), (bx, by) = surface.gradient(x + h, y), surface.gradient(x - h, y)
    _, up = surface.gradient(x, y + h)
    _, down = surface.gradient(x, y - h)
    numerical = ((ax - bx) / (2 * h), (ay - by) / (2 * h), (up - down) / (2 * h))
    scale = surface.curvature_bound() + 1e-30
    for analytic, difference in zip(surface.hessian(x, y), numerical, strict=True):
        np.testing.assert_allclose(analytic, difference, atol=1e-6 * scale)
    xx, xy, yy = surface.grid_hessian(513)
    assert (abs((xx + yy) / 2) + np.hypot((xx - yy) / 2, xy)).max() <= scale * (1 + 1e-12)


@pytest.mark.parametrize("name", SURFACES)
def test_exact_mean_against_quadrature(name):
    surface, cells = SURFACES[name], 200  # on whose edges the nodes of the maps are
    t, w = np.polynomial.legendre.leggauss(6)
    s = ((np.arange(cells)[:, None] + (t + 1) / 2) * (surface.L / cells)).ravel()
    weight = np.tile(w / 2, cells) / cells
    numerical = weight @ surface.on_product(s, s) @ weight
    assert surface.mean() == pytest.approx(numerical, rel=1e-6, abs=1e-9 * surface.L)


@pytest.mark.parametrize(
    "surface",
    [fractal(seed=seed) for seed in range(4)] + [affine(seed=s, periodic=p) for s in range(3) for p in (True, False)],
)
def test_maximum_is_global_and_not_grid_limited(surface):
    x, y, z = surface.maximum()
    grid = surface.grid(2049)
    assert 0 <= z - grid.max() < 4e-5 * (z - grid.min())
    assert z == pytest.approx(float(surface.height(x, y)), rel=1e-14)
    zx, zy = surface.gradient(x, y)
    for place, slope in ((x, zx), (y, zy)):
        if place in (0.0, surface.L):
            assert slope * (1 if place == surface.L else -1) >= 0
        else:  # phases of waves k are known to eps k L
            assert abs(slope) < max(16 * EPS * surface.curvature_bound() * surface.L, 1e-10 * (surface.L == 2.0))


@pytest.mark.parametrize(
    "options",
    [
        {"L_s": L / 2048},
        {"M": 60, "f_max": 11},
        {"gamma": 40.0, "f_max": 2},
        {"D": 2.05, "L_s": L / 2048},
        {"phases": np.pad(np.full((11, 1), np.pi), ((0, 0), (0, 5)), constant_values=0.3)},  # crests that coincide
    ],
)
def test_maximum_of_many_ridges_and_of_short_waves(options):
    surface = fractal(**options)
    summit = surface.maximum()
    assert summit[2] == pytest.approx(float(surface.height(*summit[:2])), rel=1e-12)
    assert summit[2] >= surface.grid(513).max()
    for size in (1e-2 * L, 1e-4 * L, 1e-6 * L, surface.feature_size):
        x, y = (np.clip(c + np.linspace(-size, size, 101), 0, L) for c in summit[:2])
        assert surface.height(x[None, :], y[:, None]).max() <= summit[2] * (1 + 1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_a_summit_on_an_edge_is_found_with_its_slope(seed):
    """Against the heights on a fine grid: does the surface fall away from the edge at its highest node?"""
    surface = fractal(seed=seed)
    z = surface.grid(1025)
    row, column = np.unravel_index(z.argmax(), z.shape)
    inside = 0 < row < 1024 and 0 < column < 1024
    falls = surface.edges_of_summit()
    assert bool(falls) == (not inside) == (seed in (1, 6, 7))
    for edge, slope in falls.items():
        inner = {"x = 0": z[row, 1], "x = L": z[row, 1023], "y = 0": z[1, column], "y = L": z[1023, column]}[edge]
        assert slope == pytest.approx((z.max() - inner) * 1024 / L, rel=0.1)


def test_a_symmetric_surface_has_no_slope_across_its_edge():
    """Spheres in a corner and a crest on an edge, exact and sampled; a tilted plane descends from a corner."""
    corner = Sphere(L=1.0, radius=0.7, centre=(0.0, 0.0))
    assert corner.edges_of_summit() == {"x = 0": 0.0, "y = 0": 0.0}
    assert Sinusoid(L=1.0, amplitude=0.01, centre=(0.0, 0.3)).edges_of_summit() == {"x = 0": 0.0}
    sampled = HeightMap.of(corner.grid(65), 1.0)
    assert len(sampled.edges_of_summit()) == 2 and max(sampled.edges_of_summit().values()) < 1e-3 * sampled.rms_slope()
    s = np.linspace(0, 1, 9)
    tilted = HeightMap.of(0.1 * s[None, :] - 0.05 * s[:, None], 1.0)
    assert tilted.edges_of_summit() == {"x = L": pytest.approx(0.1), "y = 0": pytest.approx(0.05)}


def test_closed_forms_of_maximum_statistics_and_mean():
    assert SURFACES["sphere and cone"].maximum() == (0.3, 0.6, 0.0)
    assert SURFACES["sinusoid"].maximum() == (0.1, 0.7, 0.01)
    for name in ("sphere and cone", "double sinusoid"):
        found = Surface.maximum(SURFACES[name])
        assert found[2] == pytest.approx(SURFACES[name].maximum()[2], abs=1e-15)
    x, y = np.random.default_rng(2).uniform(0, 1, (2, 50))
    k, double = 2 * np.pi / 0.4, SURFACES["double sinusoid"].height(x, y)
    np.testing.assert_allclose(double, 0.01 * np.cos(k * (x - 0.1)) * np.cos(k * (y - 0.7)), atol=1e-15)
    np.testing.assert_allclose(SURFACES["sinusoid"].height(x, y), 0.01 * np.cos(k * (x - 0.1)), atol=1e-15)
    stats = Sinusoid(L=1.0, amplitude=0.01).statistics(513)
    assert stats.Sq == pytest.approx(0.01 / np.sqrt(2), rel=4e-3)
    assert stats.Sz == pytest.approx(0.02, rel=1e-12)
    assert stats.rms_slope == pytest.approx(2 * np.pi * 0.01 / np.sqrt(2), rel=4e-3)
    assert stats.rms_curvature == pytest.approx((2 * np.pi) ** 2 * 0.01 / np.sqrt(8), rel=4e-3)
    for radius in (1e2, 1e5, 1e9):  # the sphere is deeper than the paraboloid by the order L^2/R^2
        spheres = (Sphere(L=1.0, radius=radius, shape=shape) for shape in ("sphere", "paraboloid"))
        means = [one.mean() for one in spheres]
        assert means == pytest.approx([-1.0 / (12.0 * radius)] * 2, rel=1.0 / radius**2 + 1e-12)


EXTREME = st.one_of(st.floats(-330, 310).map(lambda e: 10.0**e if e < 308 else np.inf), st.floats(), st.integers())
USUAL: dict[str, dict[str, Any]] = {
    "weierstrass-mandelbrot": {"D": 2.4, "G": 1e-11}, "sphere": {"radius": L}, "flat": {}, "pyramid": {},
    "self-affine": {"H": 0.8, "rms_slope": 0.1, "lambda_short": 0.1 * L}, "sinusoid": {"amplitude": 1e-8},
    "cone": {"half_angle": 70.0},
}  # fmt: skip


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.sampled_from(sorted(USUAL)), st.data())
def test_any_numbers_give_a_finite_surface_or_a_sentence(kind, data):
    assert USUAL.keys() | {"file"} == surface_kinds().keys()
    spec = {"L": L, **USUAL[kind]}
    for name in data.draw(st.lists(st.sampled_from(sorted(keys(surface_kind(kind)))), max_size=3)):
        spec[name] = data.draw(st.one_of(EXTREME, st.integers(0, 6), st.sampled_from([0.5 * L, (0.0, L), True])))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SurfaceWarning)
        try:
            surface = Surface.from_spec(kind, **spec)
        except InputError as error:
            assert "surface." in str(error) and "\n" not in str(error)
            return
        values = [*surface.maximum(), surface.mean(), *surface.grid(5).ravel()]
    assert np.isfinite(values).all() and values[2] >= max(values[4:]) - 1e-12 * np.ptp(values[4:])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "spheer"}, r'surface.kind = "spheer" is unknown \(did you mean "sphere"\?\)'),
        ({"G": 13.6}, r"surface.G = 13.6 is 1.4e\+07 of surface.L"),
        ({"gamma": 100.0, "f_max": 100}, "surface.f_max = 100 is not legal: .* at most 1 with surface.gamma = 100"),
        ({"M": 999, "f_max": 50, "gamma": 1.1}, "surface.f_max = 50 is not legal: .* at most 1 with surface.M = 999"),
        ({"phases": np.zeros((3, 3))}, r"shape \(M\+1, f_max\+1\) = \(11, 6\)"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        Surface.from_spec(**{"kind": "weierstrass-mandelbrot", "L": L, "D": 2.4, "G": 1e-12} | change)


def test_a_derived_surface_without_a_kind_does_not_replace_its_base():
    class Bowl(Sphere):
        pass

    assert type(Surface.from_spec("sphere", L=1.0, radius=9.0)) is Sphere is not Bowl


# ---------------------------------------------------------------------------------------- the fractal


def equation_1(surface: WeierstrassMandelbrot, x: float, y: float) -> float:
    """Evaluate the defining double sum term by term in polar coordinates."""
    s, total = surface, 0.0
    r, angle = np.hypot(x, y), np.arctan2(y, x)
    for mu in range(0 if s.ridges == "0..M" else 1, s.M + 1):
        for f in range(s.f_max + 1):
            phi = s.phases[mu, f]
            theta = 2 * np.pi * s.gamma**f * r / s.L * np.cos(angle - np.pi * mu / s.M) + phi
            total += s.gamma ** (f * (s.D - 3)) * (np.cos(phi) - np.cos(theta))
    return float(s.L * (s.G / s.L) ** (s.D - 2) * np.sqrt(np.log(s.gamma) / s.M) * total)


@pytest.mark.parametrize("name", ["fractal", "ridges"])
def test_heights_follow_the_definition(name):
    surface = SURFACES[name]
    assert isinstance(surface, WeierstrassMandelbrot)
    for x, y in np.random.default_rng(1).uniform(0, L, size=(5, 2)):
        assert surface.height(x, y) == pytest.approx(equation_1(surface, x, y), rel=1e-9)
    assert abs(surface.height(0.0, 0.0)) < 1e-15 * L


@pytest.mark.parametrize(
    ("ridges", "f_max", "heights"),
    [
        ("0..M", 5, (9.65929359e-08, 8.98139885e-08, 9.92733348e-08)),
        ("0..M", 4, (8.71072304e-08, 7.88098729e-08)),
        ("1..M", 5, (8.61422284e-08, 8.16684468e-08)),
        ("1..M", 4, (7.71353764e-08, 7.19000460e-08)),
    ],
)
def test_heights_with_zero_phases(ridges, f_max, heights):
    surface = fractal(ridges=ridges, f_max=f_max, phases=np.zeros((11, f_max + 1)))
    for point, height in zip([(0.5e-6, 1e-6 / 3), (1e-6, 1e-6), (0.1e-6, 0.7e-6)], heights, strict=False):
        assert surface.height(*point) == pytest.approx(height, rel=1e-9)


def test_nested_phases_do_not_depend_on_f_max_and_M_and_are_independent():
    many = fractal(M=20, f_max=11, seed=2**40 + 7, drawing="nested").phases
    few = fractal(M=3, f_max=2, seed=2**40 + 7, drawing="nested").phases
    np.testing.assert_array_equal(many[:4, :3], few)
    # no column is that of another index or seed
    drawings = itertools.product((0, 1, 2**32), ("nested", "array"))
    columns = np.concatenate([fractal(M=3, f_max=5, seed=seed, drawing=d).phases for seed, d in drawings], axis=1)
    assert len(np.unique(columns)) == columns.size
    phases = np.concatenate([fractal(M=200, f_max=9, seed=s, drawing="nested").phases.ravel() for s in range(5)])
    assert abs(np.exp(1j * phases).mean()) < 4 / np.sqrt(phases.size)


def test_cut_off_and_its_warning():
    assert cut_off_index(1e-6, 150e-9, 1.5) == 4  # ln(1000/150)/ln(1.5) = 4.679
    assert cut_off_index(1.0, 1.5**-7, 1.5) == 7
    assert fractal(L_s=150e-9).f_max == 4
    assert fractal().f_max == 5
    with pytest.warns(SurfaceWarning, match="f_max = 4, but f_max = 5 is given and used"):
        assert fractal(L_s=150e-9, f_max=5).f_max == 5
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fractal(L_s=150e-9, f_max=4)


def test_psd_keeps_the_power_and_finds_the_wave():
    wave = Sinusoid(L=1.0, amplitude=0.3, wavelength=1 / 16)
    ring = wave.psd(256, window="none")
    around = np.rint(np.hypot(*np.mgrid[-128:128, -128:128])).astype(int)
    counts = np.bincount(around.ravel())[1:128]
    assert (ring.density * counts).sum() == pytest.approx(0.3**2 / 2, rel=1e-6)
    for window in ("none", "hann"):
        spectrum = wave.psd(256, window=window)
        assert spectrum.q[np.argmax(spectrum.density)] == pytest.approx(2 * np.pi * 16)


def test_psd_slope_of_the_fractal():
    """C(q) ~ q^(2D-8): the amplitude of index f is A_f ~ k^(D-3), one wave a ring of area ~ k^2."""
    densities = [fractal(seed=s, f_max=11, ridges="1..M").psd(1024) for s in range(4)]
    q = densities[0].q * L / (2 * np.pi)
    mean = np.mean([d.density for d in densities], axis=0)
    edges = 1.5 ** np.arange(2.5, 11)
    bands = [(mean * q)[(q >= a) & (q < b)].sum() for a, b in itertools.pairwise(edges)]
    slope = np.polyfit(np.log(np.sqrt(edges[1:] * edges[:-1])), np.log(bands), 1)[0]
    assert slope == pytest.approx(2 * (2.4 - 3), abs=0.15)


# ---------------------------------------------------------------------------------------- maps


def test_short_waves_of_a_map_are_those_of_the_surface_it_samples():
    surface = fractal(L=1.0, G=1e-6, f_max=8)
    sampled = HeightMap.of(surface.grid(401), 1.0)
    for wavelength in (0.1, 0.05, 0.03):
        assert sampled.short_waves(wavelength, 0.01) == pytest.approx(surface.short_waves(wavelength, 0.01), rel=0.25)
    assert surface.short_waves(0.01, 0.01) < 1e-3 * surface.short_waves(0.05, 0.01) < 1e-3 * surface.statistics(401).Sq


def test_short_waves_are_judged_where_the_flat_touches():
    """The grid of a smooth map and waves of zero height do not count; a rough summit of a smooth map and noise do."""
    s, depth, wavelength = np.linspace(0, 1, 513), 0.02, 0.1
    smooth = Sphere(L=1.0, radius=1.5).grid(513)
    ripple = np.sin(2 * np.pi * 60 * s)
    near = np.exp(-((s - 0.5) ** 2 + (s[:, None] - 0.5) ** 2) / 0.02)
    far = np.exp(-((s - 0.15) ** 2 + (s[:, None] - 0.15) ** 2) / 0.005)
    noise = np.random.default_rng(0).normal(size=smooth.shape)

    def rms(z):
        return HeightMap.of(z, 1.0).short_waves(wavelength, depth)

    assert rms(smooth) < 1e-7 * depth
    assert rms(Sphere(L=1.0, radius=2.0, centre=(0.0, 0.0)).grid(257)) < 1e-6 * depth
    assert rms(Sinusoid(L=1.0, amplitude=0.01, wavelength=0.5, dims=2).grid(257)) < 5e-3 * depth
    assert rms(smooth + 1e-8 * ripple) < 1e-6 * depth
    assert rms(smooth + 1e-4 * ripple) == pytest.approx(1e-4 / np.sqrt(2), rel=0.05)
    assert rms(smooth + 1e-4 * noise) == pytest.approx(1e-4, rel=0.05)
    assert rms(smooth + 1e-4 * ripple * near) > 0.3e-4  # a sixth of the patch
    assert rms(smooth + 1e-4 * ripple * far) < 0.1e-4  # outside the part that the flat touches
    assert rms(0.0 * smooth) == 0.0


@pytest.mark.parametrize("shape", [(40, 40), (33, 52)])
def test_the_summit_of_a_noisy_map_is_the_highest_point_of_its_spline(shape):
    """Between the samples of noise the spline rises far above them; at the edges it has wider cells."""
    for seed in range(4):
        surface = HeightMap.of(0.01 * np.random.default_rng(seed).normal(size=shape), (1.0, 1.0))
        x, y, z = surface.maximum()
        across, along = (np.linspace(0, 1, 40 * (n - 1) + 1) for n in shape[::-1])
        dense = surface.on_product(across, along)
        assert dense.max() <= z * (1 + 1e-14) and z == pytest.approx(dense.max(), rel=1e-3)
        assert surface.height(x, y) == pytest.approx(z, rel=1e-14)


GRATINGS = {
    "sinusoid": lambda x, y: np.cos(2 * np.pi * 12 * x),
    "diagonal": lambda x, y: np.cos(2 * np.pi * (7 * x + 4 * y)),
    "tilted": lambda x, y: np.cos(2 * np.pi * 12 * x) + 1e-3 * y,
    "sheer ridges": lambda x, y: 1.0 * ((9.3 * x) % 1.0 < 0.5),
    "plateaus": lambda x, y: np.clip(8 * np.sin(30 * x), 0, 1) * np.clip(8 * np.sin(30 * y), 0, 1),
    "equal peaks": lambda x, y: np.cos(2 * np.pi * 40 * x) * np.cos(2 * np.pi * 40 * y),
    "rings": lambda x, y: np.cos(2 * np.pi * 9 * np.hypot(x - 0.5, y - 0.5)),
}


@pytest.mark.parametrize("name", GRATINGS)
def test_the_summit_of_ridges_and_equal_peaks_is_found_at_once(monkeypatch, name):
    """Against the spline at ten points per sample; cells along ridges are not followed to the last digit."""
    n = 193
    x = np.linspace(0, 1, n)
    surface, points = HeightMap.of(GRATINGS[name](x, x[:, None]) * np.ones((n, 1)), 1.0), []
    at = HeightMap._at

    def counted(self, x, y, *derivative):
        points.append(np.size(x))
        return at(self, x, y, *derivative)

    monkeypatch.setattr(HeightMap, "_at", counted)
    summit = surface.maximum()
    assert sum(points) < 50 * n**2
    line = np.linspace(0, 1, 10 * (n - 1) + 1)
    dense = surface.on_product(line, line)
    assert dense.max() <= summit[2] + 1e-12
    assert summit[2] - dense.max() < surface.curvature_bound() * (0.1 / (n - 1)) ** 2 / 4
    assert surface.height(*summit[:2]) == pytest.approx(summit[2], abs=1e-14)


@pytest.mark.parametrize("n", [505, 1009])
def test_statistics_of_a_map_are_those_between_its_heights_too(n):
    """Noise against Gauss's rule in each cell; the slope at the heights alone is smaller by a fifth."""
    surface = HeightMap.of(1e-9 * np.random.default_rng(0).normal(size=(n, n)), 1e-6)
    at = 0.5 + 0.5 * np.polynomial.legendre.leggauss(3)[0]
    weight = np.tile(np.array([5.0, 8.0, 5.0]) / 18.0, n - 1) / (n - 1)
    s = ((np.arange(n - 1)[:, None] + at) * (1e-6 / (n - 1))).ravel()

    def rms(*parts: np.ndarray) -> float:
        return math.sqrt(sum(float(weight @ part**2 @ weight) for part in parts))

    z, zx, zy, xx, yy = (surface.on_product(s, s, *d) for d in ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2)))
    found = surface.statistics()
    assert found.Sq == pytest.approx(rms(z), rel=0.01)
    assert found.rms_slope == pytest.approx(rms(zx, zy), rel=0.01)
    assert found.rms_curvature == pytest.approx(rms(xx + yy) / 2.0, rel=0.04)
    assert surface.rms_slope() == found.rms_slope


def test_a_map_is_the_function_that_it_samples():
    """With spacing 1/40 in x and 1/32 in y."""
    x, y = np.linspace(0, 1, 41), np.linspace(0, 1, 33)
    surface = HeightMap.of(0.1 * np.sin(3 * x[None, :] + 0.3) * np.cos(2 * y[:, None]), (1.0, 1.0))
    px, py = np.random.default_rng(3).uniform(0, 1, size=(2, 300))
    np.testing.assert_allclose(surface.height(px, py), 0.1 * np.sin(3 * px + 0.3) * np.cos(2 * py), atol=1e-6)
    zx, zy = surface.gradient(px, py)
    np.testing.assert_allclose(zx, 0.3 * np.cos(3 * px + 0.3) * np.cos(2 * py), atol=1e-4)
    np.testing.assert_allclose(zy, -0.2 * np.sin(3 * px + 0.3) * np.sin(2 * py), atol=1e-4)
    assert surface.maximum() == pytest.approx(((np.pi / 2 - 0.3) / 3, 0.0, 0.1), abs=1e-4, rel=1e-6)
    integral = (np.cos(0.3) - np.cos(3.3)) / 3 * np.sin(2) / 2 * 0.1
    assert surface.mean() == pytest.approx(integral, rel=1e-6)


def test_a_map_is_periodic_if_its_edges_agree_and_are_smooth() -> None:
    """Samples of a periodic surface are; a map with other edges is not, nor one with equal edges and a ridge there."""
    rough = SelfAffine(L=1.0, H=0.8, slope=0.1, lambda_short=0.05, seed=1).grid(129)
    s = np.linspace(0.0, 1.0, 129)
    assert HeightMap.of(rough, 1.0).periodic
    assert not HeightMap.of(rough[:, :100][:100], 1.0).periodic
    ridge = np.sin(np.pi * s)[:, None] * np.sin(np.pi * s)
    assert not HeightMap.of(ridge, 1.0).periodic
    assert not HeightMap.of(np.cos(2 * np.pi * s)[:, None] + 0.01 * s, 1.0).periodic
    assert HeightMap.of(np.cos(2 * np.pi * s)[:, None] + np.zeros(129), 1.0).periodic
