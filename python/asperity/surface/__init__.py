"""Rough and reference surfaces on the square patch [0, L]^2: heights, derivatives, statistics."""

from __future__ import annotations

from asperity.surface.base import Surface, SurfaceStatistics, SurfaceWarning
from asperity.surface.fractal import WeierstrassMandelbrot, cut_off_index
from asperity.surface.height_map import HeightMap
from asperity.surface.self_affine import SelfAffine
from asperity.surface.shapes import Flat, Sinusoid, Sphere
from asperity.surface.spectrum import Spectrum

__all__ = [
    "Flat",
    "HeightMap",
    "SelfAffine",
    "Sinusoid",
    "Spectrum",
    "Sphere",
    "Surface",
    "SurfaceStatistics",
    "SurfaceWarning",
    "WeierstrassMandelbrot",
    "cut_off_index",
]
