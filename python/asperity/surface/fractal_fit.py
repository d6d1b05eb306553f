# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The Weierstrass-Mandelbrot equivalent of a measured patch: D and G with their uncertainty.

The spectrum of the patch is summed in bands, one per frequency index of the function, and compared with the spectra
of simulated surfaces after the same levelling and window. The model therefore includes the effects of levelling,
window, finite size and the small number of discrete waves, which would bias a straight line through a periodogram.
The scatter over the random phases gives the uncertainty.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import chdtrc, stdtrit

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.surface import WeierstrassMandelbrot, cut_off_index
from asperity.surface.measured import POWERS, HeightField, Trend

_POINTS = 2**12  # points of a transform at once
D_RANGE = (2.02, 2.98)  # of the search


@dataclass(frozen=True)
class FractalFit:
    """Weierstrass-Mandelbrot equivalent of a patch.

    Attributes:
        D, G: fractal dimension, and fractal roughness (length)
        ci_D, ci_G: confidence intervals of D, and of G (length)
        L: side of the patch (length)
        M, gamma, f_max, ridges: parameters of the equivalent function
        confidence: level of the intervals
        wavelength: middle of each band (bands,) (length)
        variance: height variance of the windowed patch in each band (bands,) (length^2)
        model: mean variance of simulated surfaces with D and G (bands,) (length^2)
        p_value: probability of a misfit at least this large if the patch is a surface of this kind. A value below
            0.01 rejects that; the intervals are then widened by the square root of the reduced chi^2.

    Examples:
        >>> rough = WeierstrassMandelbrot(L=1.0, D=2.5, G=1e-4, seed=1)
        >>> fit = fit_fractal(HeightField(rough.grid(33), 1 / 32, 1 / 32), realisations=30)
        >>> fit.L, fit.surface(seed=3).D == fit.D
        (1.0, True)
    """

    D: float
    G: float
    ci_D: tuple[float, float]
    ci_G: tuple[float, float]
    L: float
    M: int
    gamma: float
    f_max: int
    ridges: Literal["0..M", "1..M"]
    confidence: float
    wavelength: Array
    variance: Array
    model: Array
    p_value: float

    def surface(self, seed: int = 0) -> WeierstrassMandelbrot:
        """Random surface with these parameters."""
        return WeierstrassMandelbrot(
            L=self.L, D=self.D, G=self.G, M=self.M, gamma=self.gamma, f_max=self.f_max, ridges=self.ridges, seed=seed
        )

    def to_dict(self) -> dict[str, Any]:
        """Parameters and intervals for a file."""
        return {
            "D": self.D, "G": self.G, "ci_D": list(self.ci_D), "ci_G": list(self.ci_G), "L": self.L, "M": self.M,
            "gamma": self.gamma, "f_max": self.f_max, "ridges": self.ridges, "confidence": self.confidence,
            "p_value": self.p_value,
        }  # fmt: skip


def fit_fractal(
    patch: HeightField,
    *,
    shortest: float | None = None,
    M: int = 10,
    gamma: float = 1.5,
    ridges: Literal["0..M", "1..M"] = "0..M",
    trend: Trend = "plane",
    confidence: float = 0.95,
    realisations: int = 100,
    seed: int = 0,
) -> FractalFit:
    """Fit D and G of the modified Weierstrass-Mandelbrot function to a square patch.

    >>> from asperity.surface import WeierstrassMandelbrot
    >>> from asperity.surface.fractal_fit import fit_fractal
    >>> from asperity.surface.measured import HeightField
    >>> patch = HeightField(WeierstrassMandelbrot(L=1.0, D=2.5, G=1e-4, seed=1).grid(33), 1 / 32, 1 / 32)
    >>> fit = fit_fractal(patch, realisations=30)
    >>> bool(fit.ci_D[0] < 2.5 < fit.ci_D[1])
    True

    Args:
        patch: square, without gaps; its side is L of the function
        shortest: shortest wavelength to use (length); default four pixels. Give the resolution of the instrument
            if that is coarser.
        M, gamma, ridges: parameters of the function
        trend: subtracted from the patch and from the simulated surfaces
        confidence: level of the intervals, between 0 and 1
        realisations: number of simulated surfaces, at least 30
        seed: seed of their phases

    Raises:
        InputError: the patch is not square, is flat, has gaps, or contains fewer than three bands
    """
    z, L, n = patch.z, patch.size[0], len(patch.z)
    if z.shape != (n, n) or not math.isclose(*patch.size, rel_tol=1e-9):
        raise InputError(f"a fit of D and G needs a square patch, not {z.shape}; cut a window first")
    if patch.missing:
        raise InputError(f"{patch.missing:.2%} of the heights are missing; fill them first")
    if np.ptp(z) == 0:
        raise InputError("the patch is flat: it has no D and G")
    if realisations < 30 or not 0 < confidence < 1:
        raise InputError("a fit needs at least 30 realisations, and a confidence between 0 and 1")
    shortest = 4 * patch.dx if shortest is None else shortest
    if not 2 * patch.dx <= shortest < L:
        raise InputError(f"shortest = {shortest:g} must lie between two pixels, {2 * patch.dx:g}, and the side {L:g}")
    f_max = cut_off_index(L, shortest, gamma)
    spectrum = _Spectrum(n, f_max, gamma, trend)
    if len(spectrum.indices) < 3:
        raise InputError(f"the patch has {len(spectrum.indices)} bands between {shortest:g} and {L:g}, a fit needs 3")
    simulated = _simulate(spectrum, f_max, M, gamma, ridges, realisations, seed)
    return _Fit(spectrum, simulated, spectrum.of(z), L, M, gamma).result(f_max, ridges, confidence)


class _Spectrum:
    """Band powers of windowed, levelled maps of n x n nodes.

    Band f contains the wave numbers within a factor sqrt(gamma) of gamma^f 2 pi/L; bands without a grid point of the
    transform are omitted.
    """

    def __init__(self, n: int, f_max: int, gamma: float, trend: Trend) -> None:
        self.n = n
        s = np.linspace(-1, 1, n)
        basis = np.stack([np.multiply.outer(s**j, s**i).ravel() for i, j in POWERS[trend]], axis=1)
        self._trend = np.linalg.qr(basis)[0]
        self._taper = np.sin(np.pi * np.arange(n) / (n - 1)) ** 2
        self._taper /= np.sqrt(np.mean(self._taper**2))
        along = np.fft.fftfreq(n, 1 / (n - 1))  # cycles per L: nodes 0 and n - 1 are L apart
        across = np.fft.rfftfreq(n, 1 / (n - 1))
        cycles = np.hypot(along[:, None], across)
        band = np.rint(np.log(np.maximum(cycles, 1e-9)) / math.log(gamma)).astype(int)
        twice = np.where((across == 0) | (across == across[-1]) & (n % 2 == 0), 1.0, 2.0) / n**4
        picks = [np.nonzero(band == f) for f in range(f_max + 1)]
        self.indices = np.array([f for f, (rows, _) in enumerate(picks) if rows.size])
        self._picks = [picks[f] for f in self.indices]
        self._weights = [twice[columns] for _, columns in self._picks]

    def of(self, z: Array) -> Array:
        """Power of a map (n, n) in each band, (bands,); their sum is the total power."""
        level = z - (self._trend @ (self._trend.T @ z.ravel())).reshape(z.shape)
        transform = np.fft.rfft2(level * self._taper * self._taper[:, None])
        return np.array([w @ np.abs(transform[p]) ** 2 for p, w in zip(self._picks, self._weights, strict=True)])

    def of_waves(self, kx: Array, ky: Array) -> Array:
        """Band covariances of cos(kx x + ky y), then sin(...), (2 waves, 2 waves, bands); lengths over L.

        A wave is a product of a function of x and one of y, and so are its window and its transform; only the trends
        need two dimensions.
        """
        n, s = self.n, np.linspace(0, 1, self.n)
        x, y = (np.exp(1j * np.multiply.outer(k, s)) for k in (kx, ky))
        # the wave is conj(conj(x) conj(y)): with the transform of its conjugate, cosine and sine are sums of both
        sides = [(np.fft.fft(u * self._taper), np.fft.fft(v * self._taper)) for u, v in ((x, y), (x.conj(), y.conj()))]
        trends = self._trend.T.reshape(-1, n, n)
        shares = np.stack([np.sum((y @ q) * x, axis=1) for q in trends], axis=1)  # (waves, trends)
        window = self._taper * self._taper[:, None]
        transforms = np.stack([np.fft.rfft2(q * window) for q in trends])
        out = np.empty((2 * kx.size, 2 * kx.size, len(self._picks)))
        for band, ((rows, columns), weights) in enumerate(zip(self._picks, self._weights, strict=True)):
            total = np.zeros((2 * kx.size, 2 * kx.size))
            for i in range(0, rows.size, _POINTS):
                r, c, w = rows[i : i + _POINTS], columns[i : i + _POINTS], weights[i : i + _POINTS]
                one, other = (u[:, c] * v[:, r] for u, v in sides)
                t = transforms[:, r, c]
                cosine = (one + other) / 2 - shares.real @ t
                sine = (one - other) / 2j - shares.imag @ t
                both = np.vstack([cosine, sine]) * np.sqrt(w)
                parts = np.hstack([both.real, both.imag])
                total += parts @ parts.T
            out[:, :, band] = total
        return out


def _simulate(spectrum: _Spectrum, f_max: int, M: int, gamma: float, ridges: str, count: int, seed: int) -> Array:
    """Band covariances of the sums of unit waves of each frequency index, (count, f, f, bands).

    A surface is a weighted sum of these, so its band powers follow for all D and G without another simulation. The
    covariances of single waves are computed once; random phases only combine them.
    """
    mu = np.arange(1 if ridges == "1..M" else 0, M + 1)
    angle, k = np.pi * mu / M, 2 * np.pi * gamma ** np.arange(f_max + 1.0)
    waves = spectrum.of_waves(np.multiply.outer(k, np.cos(angle)).ravel(), np.multiply.outer(k, np.sin(angle)).ravel())
    shape = 2, f_max + 1, mu.size
    waves = waves.reshape(*shape, *shape, -1)
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, (count, f_max + 1, mu.size))
    mixed = np.stack([-np.cos(phase), np.sin(phase)], axis=1)  # -cos(theta + phase), (count, 2, f, mu)
    half = np.einsum("rafm,afmbgnk->rfbgnk", mixed, waves, optimize=True)
    return np.einsum("rfbgnk,rbgn->rfgk", half, mixed, optimize=True)


class _Fit:
    """Gaussian likelihood of the logarithms of the band powers, profiled over the height."""

    def __init__(self, spectrum: _Spectrum, simulated: Array, power: Array, L: float, M: int, gamma: float) -> None:
        self._spectrum, self._simulated, self._power = spectrum, simulated, power
        self._L, self._M, self._gamma = L, M, gamma

    def _at(self, D: float) -> tuple[float, float, float, float, Array]:
        """For D: chi^2, -2 ln likelihood, best ln of the height squared and its weight, mean logs (bands,)."""
        weight = self._gamma ** ((D - 3.0) * np.arange(self._simulated.shape[1]))
        logs = np.log(np.einsum("f,rfgk,g->rk", weight, self._simulated, weight))
        mean = logs.mean(axis=0)
        # the mean over the simulations is uncertain too
        scatter = np.cov(logs.T) * (1 + 1 / len(logs))
        inverse = np.linalg.inv(scatter)
        d = np.log(self._power) - mean
        height = float(inverse.sum(axis=0) @ d / inverse.sum())
        misfit = float((d - height) @ inverse @ (d - height))
        return misfit, misfit + float(np.linalg.slogdet(scatter)[1]), height, float(inverse.sum()), mean

    def _ln_G(self, D: float, height: float) -> float:
        """ln G from the ln of the height squared: amplitude^2 = L^2 (G/L)^(2 D - 4) ln(gamma)/M."""
        bare = height - 2 * math.log(self._L) - math.log(math.log(self._gamma) / self._M)
        return math.log(self._L) + bare / (2 * D - 4)

    def result(self, f_max: int, ridges: Literal["0..M", "1..M"], confidence: float) -> FractalFit:
        """The estimate, with intervals from the likelihood ratio that are widened if the misfit is large."""
        grid = np.linspace(*D_RANGE, 200)
        values = np.array([self._at(D)[1] for D in grid])
        i = int(np.argmin(values))
        bounds = grid[max(i - 1, 0)], grid[min(i + 1, grid.size - 1)]
        D = float(minimize_scalar(lambda D: self._at(D)[1], bounds=bounds, method="bounded").x)
        misfit, least, height, _, mean = self._at(D)
        freedom = mean.size - 2
        # a large misfit widens the intervals, a small one never narrows them
        widening = max(1.0, misfit / freedom)
        allowed = widening * float(stdtrit(len(self._simulated) - 1 - mean.size, (1 + confidence) / 2)) ** 2
        inside = [(x, self._at(x)) for x in np.linspace(*D_RANGE, 1000)]
        inside = [(x, at) for x, at in inside if at[1] - least <= allowed] or [(D, self._at(D))]
        ln_G = []
        for x, (_, value, centre, weight, _) in inside:
            half = math.sqrt(max(allowed - value + least, 0.0) * widening / weight)
            ln_G += [self._ln_G(x, centre - half), self._ln_G(x, centre + half)]
        G = math.exp(self._ln_G(D, height))
        wavelength = self._L / self._gamma ** self._spectrum.indices.astype(float)
        return FractalFit(
            D, G, (inside[0][0], inside[-1][0]), (math.exp(max(min(ln_G), -300.0)), math.exp(min(max(ln_G), 0.0))),
            self._L, self._M, self._gamma, f_max, ridges, confidence, wavelength, self._power,
            np.exp(mean + height), float(chdtrc(freedom, misfit)),
        )  # fmt: skip
