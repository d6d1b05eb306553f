# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Finite strain in logarithmic strain space, in UFL: the readable twin of solver/log_strain.hpp.

Miehe, Apel & Lambrecht, Comput. Methods Appl. Mech. Engrg. 191 (2002) 3383: the law of small strain receives the Hencky
strain E = 1/2 ln C, C = F^T F, F = I + grad u, and returns the stress T with the power T : dE/dt per volume before
deformation. Here the logarithm is an integral without eigenvalues,

    ln(1 + A) = int_0^1 A (1 + s A)^-1 ds,

by Gauss' rule (Higham, Functions of Matrices (2008), section 11.5), and UFL differentiates it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

POINTS = 8  # relative error 4e-15 for stretches from 0.8 to 1.25, 2e-8 at 0.5 and 2


def displacement_measure(gradient: Any) -> Any:
    """C - 1 of a displacement gradient, UFL tensors (3, 3)."""
    return gradient + gradient.T + gradient.T * gradient


def logarithmic_strain(A: Any) -> Any:
    """Hencky strain 1/2 ln(1 + A) of A = C - 1, UFL tensors (3, 3)."""
    return 0.5 * sum(weight * A * inverse for weight, inverse in _resolvents(A))


def piola_kirchhoff(A: Any, T: Any) -> Any:
    """Second stress of Piola and Kirchhoff S = 2 dE/dC : T of A = C - 1, UFL tensors (3, 3).

    The derivative of A (1 + s A)^-1 along B is (1 + s A)^-1 B (1 + s A)^-1.
    """
    return sum(weight * inverse * T * inverse for weight, inverse in _resolvents(A))


def _resolvents(A: Any) -> list[tuple[float, Any]]:
    """Weights and (1 + s A)^-1 at the points s of Gauss' rule on [0, 1]."""
    import ufl

    points, weights = np.polynomial.legendre.leggauss(POINTS)
    inverses = [ufl.inv(ufl.Identity(3) + float(0.5 * (1.0 + x)) * A) for x in points]
    return [(float(0.5 * w), inverse) for w, inverse in zip(weights, inverses, strict=True)]
