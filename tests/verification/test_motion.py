"""References of the rows of motion against textbook values."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import gamma

from asperity.verification.hertz import HERTZ
from asperity.verification.motion import DEEPEST, MASS, impact_time, potential

HERTZ_LAW = np.array([0.25 * float(HERTZ.force(DEEPEST)) / DEEPEST**1.5])  # of a quarter of the sphere


def test_the_impact_of_hertz_lasts_as_in_johnson() -> None:
    """2.94 (greatest approach)/(speed), Johnson (1985), section 11.4; by the gamma function 2.9432."""
    speed = np.sqrt(2.0 * float(potential(HERTZ_LAW, DEEPEST)) / MASS)
    constant = 0.8 * np.sqrt(np.pi) * gamma(0.4) / gamma(0.9)
    assert constant == pytest.approx(2.94, abs=5e-3)
    assert impact_time(HERTZ_LAW) == pytest.approx(constant * DEEPEST / speed, rel=1e-8)


def test_the_greatest_approach_is_that_of_johnson() -> None:
    """(15 m v^2/(16 sqrt(R) E'))^(2/5), Johnson (1985), section 11.4, of the whole sphere and four times the mass."""
    speed = np.sqrt(2.0 * float(potential(HERTZ_LAW, DEEPEST)) / MASS)
    deepest = (15.0 * 4.0 * MASS * speed**2 / (16.0 * np.sqrt(HERTZ.R) * HERTZ.E_prime)) ** 0.4
    assert deepest == pytest.approx(DEEPEST, rel=1e-12)
