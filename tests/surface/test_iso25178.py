"""Parameters of ISO 25178 against closed forms, and against another program where it is installed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from asperity.errors import InputError
from asperity.surface import SelfAffine
from asperity.surface.iso25178 import core_and_ends, iso25178

A, N = 2.0, 801
RNG = np.random.default_rng(3)


def test_waves_have_closed_forms() -> None:
    """Ten periods along x of A cos, sampled at the middles of their steps."""
    x = (np.arange(N - 1) + 0.5) / (N - 1)
    z = A * np.cos(20.0 * math.pi * x) * np.ones((N // 2, 1))
    found = iso25178(z, 1.0, 1.0)
    assert found.Sq == pytest.approx(A / math.sqrt(2.0)) and found.Sa == pytest.approx(2.0 * A / math.pi, rel=1e-3)
    assert found.Ssk == pytest.approx(0.0, abs=1e-12) and found.Sku == pytest.approx(1.5)
    assert (found.Sp, found.Sv, found.Sz) == pytest.approx((A, A, 2 * A), rel=1e-3)
    k = 20.0 * math.pi / (N - 1)
    assert found.Sdq == pytest.approx(A * k / math.sqrt(2.0), rel=2e-3)
    assert found.Sdr == pytest.approx(found.Sdq**2 / 2.0, rel=2e-2)  # of small slopes
    assert found.Sal == pytest.approx(math.acos(0.2) / k, rel=2e-2) and math.isnan(found.Str)  # along y it stays


def test_an_abbott_curve_of_uniform_heights_is_its_core() -> None:
    Sk, _, _, *ratios = core_and_ends(np.linspace(0.0, 3.0, 100_001))
    assert Sk == pytest.approx(3.0) and ratios == pytest.approx([0.0, 1.0], abs=1e-3)


def test_gaussian_heights_have_their_known_core() -> None:
    """Sk of a Gaussian: the least-squares line of its middle 40 %."""
    found = iso25178(RNG.normal(size=(1200, 1200)), 1.0, 1.0)
    ratio = np.linspace(0.3, 0.7, 2001)
    from scipy.stats import norm

    slope = np.polyfit(ratio, norm.isf(ratio), 1)[0]
    assert found.Sk == pytest.approx(-slope, rel=5e-3)
    assert found.Smr1 == pytest.approx(norm.sf(-slope / 2), rel=2e-2)
    assert found.Spk == pytest.approx(found.Svk, rel=3e-2)


def test_stretched_surfaces_have_an_aspect_ratio() -> None:
    stretched = SelfAffine(L=1.0, H=0.8, rms_height=0.01, lambda_short=0.02, lambda_roll=0.1, aspect=4.0, seed=1)
    s = np.linspace(0.0, 1.0, 301)
    found = iso25178(stretched.on_product(s, s), s[1], s[1])
    even = iso25178(RNG.normal(size=(200, 200)), 1.0, 1.0)
    assert found.Str < 0.5 < even.Str


def test_equal_heights_have_no_roughness() -> None:
    with pytest.raises(InputError, match="no roughness"):
        iso25178(np.ones((9, 9)), 1.0, 1.0)


def test_surfalize_finds_the_same() -> None:
    surfalize = pytest.importorskip("surfalize")
    s = np.linspace(0.0, 1.0, 200)
    z = SelfAffine(L=1.0, H=0.8, rms_height=0.01, lambda_short=0.05, lambda_roll=0.2, seed=2).on_product(s, s)
    ours, theirs = iso25178(z, s[1], 2 * s[1]), surfalize.Surface(z - z.mean(), s[1], 2 * s[1])
    percent = {"Sdr": 100.0, "Smr1": 100.0, "Smr2": 100.0}
    for name, value in ours.to_dict().items():
        exact = name in ("Sq", "Sa", "Sz", "Sp", "Sv", "Ssk", "Sku", "Sdq", "Sdr")
        assert percent.get(name, 1.0) * value == pytest.approx(getattr(theirs, name)(), rel=1e-9 if exact else 2e-2)  # type: ignore[operator]
