"""Damping of loops: loss over amplitude, the resonance against its energy balance, two ways to one response."""

from __future__ import annotations

from unittest.mock import Mock

import numpy as np
import pytest

from asperity.errors import InputError
from asperity.vibration.damping import LoopDamping
from asperity.vibration.law import PowerLaw
from asperity.vibration.oscillator import ContactOscillator

LOOPS = LoopDamping((0.05, 0.1, 0.3), (0.0005, 0.002, 0.004))
ZETA = 0.005


def test_a_law_loses_what_the_loop_loses() -> None:
    """The loss factor is over the energy of a spring as stiff as the loop, the damping ratio over that of the law.

    The law is linear, so that the motion is harmonic; the quadrature of a free orbit does not see the kinks.
    """
    loops = LoopDamping((0.1, 0.3), (0.002, 0.004), stiffness=(2.0, 1.5), preload=1.0)
    damping, note = loops.on(1.0, 1.0)
    assert note == ""
    oscillator = ContactOscillator(PowerLaw(1.0), zeta=ZETA, damping=damping)
    for a, zeta, k in zip(loops.deflection, loops.zeta, loops.stiffness, strict=True):
        lost = 2.0 * ZETA * oscillator.free([a]).orbits[0].dissipation
        assert lost == pytest.approx(2.0 * np.pi * a**2 * (ZETA + zeta * k), rel=3e-3)
    assert "loops about a preload of 1, the vibration is about 0.5" in loops.on(1.0, 0.5)[1]
    assert LOOPS.on(3.0, 1.0) == (LOOPS, "")  # of unknown stiffness and preload


def test_a_coefficient_that_is_its_own_answer() -> None:
    """Damping ratios that rise as the amplitude come from a coefficient that does: zeta = 4/(3 pi) times it."""
    loops, z = LoopDamping((0.1, 0.2, 0.4), (0.1, 0.2, 0.4)), np.array([0.05, 0.3])
    np.testing.assert_allclose(loops.coefficient(z), 0.75 * np.pi * z, rtol=1e-5)


def test_resonance() -> None:
    """The response and the energy balance find the same peak, below that without."""
    oscillator = ContactOscillator(PowerLaw(1.5), zeta=ZETA, damping=LOOPS)
    peak = oscillator.response(0.002, (0.97, 1.01)).peak[1]
    assert oscillator.thresholds(0.002).peaks[0]["u_max"] == pytest.approx(peak, rel=1e-3)
    without = ContactOscillator(PowerLaw(1.5), zeta=ZETA, damping="contact").response(0.002, (0.97, 1.01)).peak[1]
    assert peak < 0.85 * without
    assert oscillator.setting(0.002).damping == "loops"


def test_wrong_arguments() -> None:
    for deflection, zeta in (((), ()), ((0.1, 0.1), (0.1, 0.1)), ((0.1,), (0.1, 0.2)), ((0.1,), (-0.1,))):
        with pytest.raises(InputError):
            LoopDamping(deflection, zeta)
    with pytest.raises(InputError, match="micro-slip"):
        ContactOscillator(PowerLaw(1.5), zeta=0.0, damping=LOOPS)
    with pytest.raises(InputError, match=r"loops\.csv"):
        ContactOscillator(PowerLaw(1.5), damping="loops")


def test_the_damping_ratio_of_a_loop_is_half_of_its_loss_factor() -> None:
    """W of a loop over 2 pi k_n a^2, on a law of its stiffness and of twice that: zeta = W/(2 pi k_n a^2)."""
    k, a, lost = 3.0, 0.02, 1.7e-5
    eta = lost / (np.pi * k * a**2)
    one = Mock(deflection=a, eta=eta, k=k, preload=1.0)
    table = Mock(of_amplitudes=lambda: [[one]])
    damping = LoopDamping.of(table)
    assert damping.zeta[0] == pytest.approx(lost / (2.0 * np.pi * k * a**2), rel=1e-12)
    assert damping.on(2.0 * k, 1.0)[0].zeta[0] == pytest.approx(lost / (2.0 * np.pi * 2.0 * k * a**2), rel=1e-12)
