"""The modified two-variable Weierstrass-Mandelbrot surface, as a sum of plane waves."""

from __future__ import annotations

import math
from dataclasses import field
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np

from asperity.arrays import Array
from asperity.runtime.declaration import LENGTH, SCRIPT, Choices, Real, Whole, declared, key
from asperity.surface.base import check
from asperity.surface.plane_waves import PlaneWaves, Waves

_SHORTEST = 1 / 2048  # least wavelength over L, that of `self_affine`: no mesh resolves shorter waves
_MAX_WAVES = 2500  # more would take minutes


def cut_off_index(L: float, L_s: float, gamma: float) -> int:
    """floor(ln(L/L_s)/ln(gamma)), the index of the shortest wave not below L_s.

    Args:
        L: side of the patch (length)
        L_s: cut-off wavelength (length), 0 < L_s <= L
        gamma: ratio of successive wave numbers, > 1

    >>> from asperity.surface import cut_off_index
    >>> cut_off_index(1e-6, 1e-7, 1.5)
    5
    """
    # for a cut-off of exactly L/gamma^f the result must be f despite round-off
    return math.floor(math.log(L / L_s) / math.log(gamma) + 1e-12)


@declared("surface", eq=False, kw_only=True)
class WeierstrassMandelbrot(PlaneWaves):
    """Fractal surface of Yan and Komvopoulos, J. Appl. Phys. 84 (1998) 3617, on [0, L]^2.

    z(x, y) = L (G/L)^(D-2) sqrt(ln gamma / M) sum_mu sum_{f=0..f_max} gamma^(f(D-3))
              {cos phi - cos[2 pi gamma^f (x cos(pi mu/M) + y sin(pi mu/M))/L + phi]}

    with one phase phi per (mu, f). z(0, 0) = 0; the surface is not periodic.

    >>> from asperity.surface import WeierstrassMandelbrot
    >>> surface = WeierstrassMandelbrot(L=1e-6, D=2.4, G=1e-12, L_s=1e-7, seed=1)
    >>> surface.f_max
    5
    >>> float(surface.height(0.0, 0.0))
    0.0

    Attributes:
        f_max: highest frequency index. The shortest wavelength L/gamma^f_max is at least L/2048, and there are at most
            2500 waves, (M+1)(f_max+1).
        L_s: f_max = cut_off_index(L, L_s, gamma)
        drawing: "array" draws default_rng(seed).uniform(0, 2 pi, size=(M+1, f_max+1)): a different f_max gives an
            unrelated surface. "nested" draws each column from a separate stream, default_rng(SeedSequence(seed,
            spawn_key=(f,))).uniform(0, 2 pi, size=M+1): a larger f_max adds waves to the same surface.
        ridges: "0..M" (all M+1 rows of the phases; rows 0 and M are collinear, so the x
            direction has twice the power) or "1..M" (omits row 0 of the same phases)
        phases: explicit phases, shape (M+1, f_max+1), row mu, column f; replaces the seed
    """

    D: Real = key("fractal dimension", gt=2, lt=3, hint="2.4 is a usual value")
    G: Real = key("fractal roughness", LENGTH, share=(0.0, 1.0), hint="1.36e-11 m is a usual value")
    M: Whole = key(
        "ridges run at the angles pi mu/M; M + 1 of them, or M with ridges = 1..M", default=10, ge=1, le=1000
    )
    gamma: Real = key("frequency ratio", default=1.5, gt=1, le=100)
    f_max: Whole = key("highest frequency index", default=None, shown="5, or from L_s", ge=0)
    L_s: Real | None = key("shortest wavelength, sets f_max", LENGTH, default=None, share=(_SHORTEST, 1.0))
    seed: Whole = key("seed of the random phases", default=0, ge=0, lt=2**63)
    drawing: Annotated[str, Choices("array", "nested")] = key(
        "of the phases: all at once, or nested, where a larger f_max adds waves to the same surface", default="array"
    )
    ridges: Annotated[str, Choices("0..M", "1..M")] = key("ridges in the sum", default="0..M")
    phases: Annotated[Any, *SCRIPT] = field(default=None, repr=False)

    kind: ClassVar[str] = "weierstrass-mandelbrot"
    rough: ClassVar[bool] = True
    cutoff_key: ClassVar[str] = "surface.f_max or surface.L_s"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._complete(f_max=5 if self.L_s is None else cut_off_index(self.L, self.L_s, self.gamma))
        for most, by, rule in (
            (cut_off_index(1.0, _SHORTEST, self.gamma), f"surface.gamma = {self.gamma:g}",
             f"wavelengths L/gamma^f of at least {_SHORTEST:g} L"),
            (_MAX_WAVES // (self.M + 1) - 1, f"surface.M = {self.M}",
             f"(M + 1)(f_max + 1) waves of which there are no more than {_MAX_WAVES}"),
        ):  # fmt: skip
            check(self.f_max <= most, "f_max", self.f_max, f"at most {most} with {by}, for {rule}")
        shape, phases = (self.M + 1, self.f_max + 1), self._drawn if self.phases is None else self.phases
        phases = np.array(phases, dtype=float)
        legal = phases.shape == shape and bool(np.isfinite(phases).all())
        check(legal, "phases", phases.shape, f"a finite array of shape (M+1, f_max+1) = {shape}")
        phases.flags.writeable = False
        object.__setattr__(self, "phases", phases)

    @property
    def notes(self) -> tuple[str, ...]:
        if self.L_s is None or self.f_max is None:
            return ()
        expected = cut_off_index(self.L, self.L_s, self.gamma)
        told = f"surface: L_s = {self.L_s:g} gives f_max = {expected}, but f_max = {self.f_max} is given and used."
        return () if self.f_max == expected else (told,)

    @property
    def _drawn(self) -> Array:
        """Phases (M+1, f_max+1) of the seed."""
        if self.drawing == "array":
            return np.random.default_rng(self.seed).uniform(0, 2 * np.pi, size=(self.M + 1, self.f_max + 1))
        streams = (np.random.SeedSequence(self.seed, spawn_key=(f,)) for f in range(self.f_max + 1))
        columns = [np.random.default_rng(stream).uniform(0, 2 * np.pi, size=self.M + 1) for stream in streams]
        return np.stack(columns, axis=1)

    @cached_property
    def waves(self) -> Waves:
        """One wave for each phase."""
        rows = slice(1 if self.ridges == "1..M" else 0, None)
        mu, f = np.indices(self.phases.shape)[:, rows]
        scale = self.L * (self.G / self.L) ** (self.D - 2) * math.sqrt(math.log(self.gamma) / self.M)
        a = -scale * self.gamma ** (f * (self.D - 3.0))
        k = 2 * np.pi * self.gamma ** f.astype(float) / self.L
        angle = np.pi * mu / self.M
        return Waves(a.ravel(), (k * np.cos(angle)).ravel(), (k * np.sin(angle)).ravel(), self.phases[rows].ravel())

    @cached_property
    def datum(self) -> float:
        """Height that makes z(0, 0) = 0 (length)."""
        return -float(self.waves.a @ np.cos(self.waves.phi))

    @property
    def feature_size(self) -> float:
        """The shortest wavelength, L/gamma^f_max (length)."""
        return float(self.L / self.gamma**self.f_max)
