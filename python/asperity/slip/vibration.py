"""Tangential vibration of a mass on sliders: the response by the describing function."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.dynamics.law.checks import positive
from asperity.errors import RangeError
from asperity.slip.jenkins import JenkinsArray

_POINTS = 200  # of each side of the resonance
_FAR = 0.01  # amplitude at which the response begins, over that of the peak


def tangential_response(array: JenkinsArray, mass: float, force: float, *, zeta: float = 0.0) -> tuple[Array, Array]:
    """Angular frequencies and amplitudes of the displacement under a harmonic force, by the first harmonic.

    At each amplitude a below the peak |k(a) + i 2 zeta k_rest - m omega^2| = F/a, k the complex stiffness of the
    sliders, has a solution on either side of the resonance. The force of the damping rises with the amplitude, so there
    is one peak.

    Args:
        array: of the joint
        mass: that vibrates (mass)
        force: amplitude of the force (force)
        zeta: damping ratio in addition to that of slip, as a constant loss factor 2 zeta of the stiffness at rest

    Returns:
        omega (1/time) and amplitude (length), along the curve from low to high frequency, each of shape (n,)

    Raises:
        RangeError: the force makes all of the contact slip, and its resonance has no bound

    Examples:
        >>> from asperity.slip import JenkinsArray
        >>> from asperity.slip.vibration import tangential_response
        >>> omega, a = tangential_response(JenkinsArray([1.0], [1.0]), mass=1.0, force=0.5, zeta=0.1)
        >>> print(f"{a.max():.3f} {omega[a.argmax()]:.3f}")
        1.245 0.928
    """
    positive("mass", mass), positive("force", force)
    extra = 2.0 * positive("zeta", zeta, zero=True) * array.k_rest

    def excess(a: float) -> float:
        return a * (float(array.complex_stiffness(a).imag) + extra) - force

    far = 1e3 * float(np.max(array.f / array.k))
    if excess(far) < 0.0:
        raise RangeError(
            f"force = {force:g} makes all of the contact slip at resonance: the limit is "
            f"{4.0 / np.pi * array.limit:.4g} without other damping"
        )
    peak = float(brentq(excess, 1e-12 * far, far, rtol=1e-13))
    a = peak * np.geomspace(_FAR, 1.0, _POINTS)
    k = array.complex_stiffness(a) + 1j * extra
    width = np.sqrt(np.maximum((force / a) ** 2 - k.imag**2, 0.0))
    squares = np.append(k.real - width, (k.real + width)[-2::-1]) / mass
    known = squares > 0.0
    return np.sqrt(squares[known]), np.append(a, a[-2::-1])[known]
