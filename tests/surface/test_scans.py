"""Height maps of instruments, their self-affine equivalent, and two rough bodies replaced by one."""

from __future__ import annotations

import itertools
import math
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, median_filter

from asperity.errors import InputError
from asperity.model.joint import equivalent_block
from asperity.model.material import Material
from asperity.surface import SelfAffine, Surface
from asperity.surface.scans import HeightField
from asperity.surface.spectrum import SelfAffineFit, fit_self_affine, psd

# ---------------------------------------------------------------------------------------- treatment


def test_levelling_removes_its_polynomial_and_nothing_else() -> None:
    y, x = np.mgrid[0:40, 0:60] / 40
    bumps = np.sin(14 * x) * np.cos(11 * y)
    for trend, polynomial in (
        ("mean", 3.0 + 0 * x),
        ("plane", 3.0 + 2 * x - y),
        ("curvature", 3.0 + 2 * x - y + 5 * x**2 - 4 * x * y + y**2),
    ):
        bare = HeightField(bumps, 1, 1).levelled(trend)  # type: ignore[arg-type]
        tilted = HeightField(bumps + polynomial, 1, 1).levelled(trend)  # type: ignore[arg-type]
        np.testing.assert_allclose(tilted.z, bare.z, atol=1e-12)
    with pytest.raises(InputError, match="trend"):
        HeightField(bumps, 1, 1).levelled("cubic")  # type: ignore[arg-type]


def test_gaps_are_filled_harmonically() -> None:
    y, x = np.mgrid[0:30, 0:30] / 1.0
    z = 2 + x - 3 * y + 0.1 * (x**2 - y**2)  # harmonic, also on the grid
    holed = z.copy()
    holed[10:15, 8:17] = holed[20, 3] = np.nan
    filled = HeightField(holed, 1, 1).filled()
    np.testing.assert_allclose(filled.z, z, atol=1e-9)
    holed[:, 2:12] = np.nan
    with pytest.raises(InputError, match="are missing"):
        HeightField(holed, 1, 1).filled()
    with pytest.raises(InputError, match="56% of the heights are missing"):
        HeightField(holed, 1, 1).filled((2.0, 0.0, 19.0))
    np.testing.assert_array_equal(HeightField(holed, 1, 1).filled((18.0, 0.0, 11.0)).z[:12, 18:], z[:12, 18:])
    with pytest.raises(InputError, match="fill them"):
        HeightField(holed, 1, 1).window(0, 0, 10)


def test_the_filter_passes_half_at_the_cutoff() -> None:
    x = np.arange(400) * 0.1
    for wavelength, passed in ((4.0, 0.5), (8.0, 0.5**0.25), (2.0, 0.5**4)):
        z = np.tile(np.cos(2 * np.pi * x / wavelength), (20, 1))
        out = HeightField(z, 0.1, 0.1).filtered(4.0).z
        inner = slice(100, 300)
        gain = (out[10, inner] @ z[10, inner]) / (z[10, inner] @ z[10, inner])
        assert gain == pytest.approx(passed, abs=2e-3)


def test_windows_on_nodes_are_cut_and_others_resampled() -> None:
    y, x = np.mgrid[0:50, 0:60] * 0.2
    z = np.sin(x) + np.cos(0.7 * y)
    whole = HeightField(z, 0.2, 0.2)
    np.testing.assert_array_equal(whole.window(2.0, 1.0, 4.0).z, z[5:26, 10:31])
    part = whole.window(2.05, 1.11, 4.0)
    s = np.linspace(0, 4, 21)
    exact = np.sin(2.05 + s) + np.cos(0.7 * (1.11 + s))[:, None]
    np.testing.assert_allclose(part.z, exact, atol=2e-4)
    assert whole.square().size == pytest.approx((9.8, 9.8))
    with pytest.raises(InputError, match="not inside"):
        whole.window(5.0, 5.0, 9.0)
    with pytest.raises(InputError, match="fewer than 8 heights along y, which are 5 apart"):
        HeightField(z, 0.2, 5.0).square()  # nothing is made up between few rows


def test_a_complete_window_beside_a_gap_lacks_nothing() -> None:
    step = 0.1
    for first in range(3, 40):
        z = np.zeros((8, 60))
        z[:, :first] = np.nan
        assert HeightField(z, step, step).missing_in(first * step, 0.0, 7 * step) == 0.0
        assert HeightField(z, step, step).missing_in((first - 1) * step, 0.0, 7 * step) == 1 / 8


def test_rectangular_pixels_become_a_square_patch(tmp_path: Path) -> None:
    y, x = np.meshgrid(np.arange(40) * 0.25, np.arange(30) * 0.4, indexing="ij")
    patch = HeightField(np.sin(0.5 * x) * y, 0.4, 0.25).window(1.0, 2.0, 6.0)
    surface = Surface.from_spec(kind="file", path=patch.save(tmp_path / "p.npz"))
    assert surface.L == pytest.approx(6.0)
    assert surface.height(2.0, 3.0) == pytest.approx(math.sin(0.5 * 3.0) * 5.0, abs=1e-3)


def test_parameters_of_iso_25178_have_closed_forms_for_waves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten periods of A cos along x, sampled at the middles of their steps, as lengths and as shares."""
    pytest.importorskip("surfalize")
    A, n, step = 2e-6, 800, 1e-6
    k = 20.0 * math.pi / (n * step)
    field = HeightField(A * np.cos(k * step * (np.arange(n) + 0.5)) * np.ones((n // 2, 1)), step, step)
    found: dict[str, Any] = field.iso25178() or {}
    assert found["Sq"] == pytest.approx(A / math.sqrt(2.0)) and found["Sa"] == pytest.approx(
        2.0 * A / math.pi, rel=1e-3
    )
    assert (found["Ssk"], found["Sku"]) == pytest.approx((0.0, 1.5), abs=1e-9)
    assert found["Sz"] == pytest.approx(2 * A, rel=1e-3) and found["Sdq"] == pytest.approx(k * found["Sq"], rel=2e-3)
    assert found["Sdr"] == pytest.approx(found["Sdq"] ** 2 / 2.0, rel=2e-2)  # of small slopes
    assert found["Sal"] == pytest.approx(math.acos(0.2) / k, rel=2e-2) and found["Str"] is None  # along y it stays
    assert 0.0 <= found["Smr1"] < found["Smr2"] <= 1.0
    monkeypatch.setattr("asperity.surface.scans.LAGS", n // 2)
    assert (field.iso25178() or {})["Sal"] == pytest.approx(found["Sal"], rel=2e-2)
    monkeypatch.setitem(sys.modules, "surfalize", None)
    assert field.iso25178() is None


# ---------------------------------------------------------------------------------------- H and roll-off


def fitted(n: int, **changes: Any) -> SelfAffineFit:
    """Exponent and roll-off of a levelled map of n + 1 heights a side, a window of a self-affine surface."""
    keys = {"L": 1.0, "slope": 0.2, "lambda_short": 0.012, "periodic": False} | changes
    patch = HeightField(SelfAffine(**keys).grid(n + 1), 1 / n, 1 / n).levelled("plane")
    return fit_self_affine(psd(patch.z, 1.0), shortest=4 / n)


@pytest.mark.parametrize("H", [0.3, 0.5, 0.9])
@pytest.mark.parametrize("lambda_roll", [2.0, 0.2, 0.05])
def test_the_spectrum_gives_hurst_exponent_and_roll_off(H: float, lambda_roll: float) -> None:
    """A roll-off at a fifth of the patch, beyond which three rings of waves only are longer, is told from none."""
    fits = [fitted(512, H=H, lambda_roll=lambda_roll, seed=seed) for seed in range(4)]
    off, bars = (np.array([getattr(fit, name) for fit in fits]) for name in ("H", "error_H"))
    assert np.sqrt(np.mean((off - H) ** 2)) < 0.1 and np.all(np.abs(off - H) < bars) and bars.max() < 0.35
    for fit in fits:
        assert 0.012 < fit.lambda_short < 0.018  # the end of the spectrum is seen
        q = 2 * math.pi / np.array([fit.lambda_long, fit.lambda_short])
        assert fit.lambda_roll or fit.density(q)[0] == pytest.approx(fit.C0)
    seen = [fit.lambda_roll for fit in fits if fit.lambda_roll is not None]
    assert len(seen) == 0 if lambda_roll > 1.0 else len(seen) >= 3
    assert seen == pytest.approx([lambda_roll] * len(seen), rel=0.4)


def test_the_bar_of_the_exponent_holds_it_on_small_maps_of_any_roll_off_and_cut_off() -> None:
    """The scatter of the bands alone holds 83 % here: which roll-off it is decides the exponent."""
    inside = []
    for H, lambda_roll, pixels, seed in itertools.product((0.3, 0.6, 0.9), (2.0, 0.4, 0.2), (4.5, 12), range(2)):
        with suppress(InputError):  # known to less than 0.5
            fit = fitted(128, H=H, lambda_roll=lambda_roll, lambda_short=pixels / 128, seed=seed)
            inside.append(abs(fit.H - H) < fit.error_H)
    assert len(inside) >= 24 and np.mean(inside) >= 0.9
    with pytest.raises(InputError, match="too few waves"):  # and not another spectrum
        fitted(32, H=0.6, lambda_roll=2.0, lambda_short=5 / 32, seed=0)


def without_an_exponent() -> dict[str, tuple[np.ndarray, str]]:
    """Grooves, patterns and treated maps, and why they have none; treated, H would be up to 1 off within 0.1 to 0.3."""
    x, y = np.meshgrid(*2 * [np.linspace(0.0, 1.0, 257)])
    phase = (13.3 * x) % 1.0
    z = SelfAffine(L=1.0, H=0.8, slope=0.2, lambda_roll=2.0, lambda_short=4 / 256, periodic=False, seed=3).grid(257)
    step, noise = float(np.ptp(z)) / 16, np.random.default_rng(0).normal(size=z.shape)
    far, bends = "far from a power law", "the spectrum bends"
    return {
        "sine": (np.sin(2 * np.pi * 13.3 * x), far), "saw": (phase, far), "squares": ((phase < 0.5) * 1.0, far),
        "egg box": (np.sin(22 * np.pi * x) * np.sin(22 * np.pi * y), far),
        "turned": (((9 * x + 4 * y) % 1.0 - 0.5) ** 2, far), "steps": (np.rint(20 * (x + 0.3 * y)), far),
        "smoothed": (gaussian_filter(z, 1.0), bends), "median": (median_filter(z, 5), bends),
        "in steps": (step * np.rint(z / step), bends), "noisy": (z + 0.1 * z.std() * noise, bends),
        "nothing": (0.0 * z, "0 bands"),
    }  # fmt: skip


@pytest.mark.parametrize("kind", without_an_exponent())
def test_patterns_and_treated_maps_have_no_hurst_exponent(kind: str) -> None:
    z, why = without_an_exponent()[kind]
    patch = HeightField(z, 1 / 256, 1 / 256).levelled("plane")
    with pytest.raises(InputError, match=why):
        fit_self_affine(psd(patch.z, 257 / 256), shortest=4 / 256)


# ---------------------------------------------------------------------------------------- two bodies


def test_the_equivalent_block_is_as_compliant_as_both() -> None:
    steel, rubber = Material(200e9, 0.3), Material(3e6, 0.45)
    for sides in ("rollers", "free"):
        one, height = equivalent_block(steel, rubber, (1e-3, 2e-3), sides=sides)
        assert 1.0 / one.reduced_modulus == pytest.approx((1.0 - 0.3**2) / 200e9 + (1.0 - 0.45**2) / 3e6)

        def modulus(m: Material, sides: str = sides) -> float:
            lame, mu = m.lame
            return lame + 2 * mu if sides == "rollers" else m.E

        both = 1e-3 / modulus(steel) + 2e-3 / modulus(rubber)
        assert height / modulus(one) == pytest.approx(both)
    with pytest.raises(InputError, match="of the same metal"):
        equivalent_block(Material(1.0, 0.3, 0.01), steel, (1, 1))
    with pytest.raises(InputError, match="law in UFL"):
        equivalent_block(
            steel, Material.of_law("voce", E=1.0, nu=0.3, yield_strength=0.01, saturation=0.01, rate=2.0), (1, 1)
        )
    with pytest.raises(InputError, match="in small strain only"):
        equivalent_block(steel, Material(3e6, 0.45, kinematics="finite"), (1, 1))


def test_two_blocks_of_one_metal_squeezed_whole() -> None:
    """Flat blocks in uniaxial stress beyond yield: the one becomes as much shorter as both."""
    metal = Material(2.0, 0.3, 0.01, 0.1, "kinematic")
    one, height = equivalent_block(metal, metal, (1.0, 3.0))
    assert height == pytest.approx(2.0) and one.hardening == metal.hardening
    for stress in (0.009, 0.02, 0.05):
        yielded = max(stress - 0.01, 0.0)
        both = 4.0 * (stress / metal.E + yielded / metal.plastic_modulus)
        ours = height * (stress / one.E + yielded / one.plastic_modulus)
        assert ours == pytest.approx(both)
        assert one.yield_strength == metal.yield_strength
