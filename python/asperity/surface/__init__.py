"""Rough and reference surfaces on the square patch [0, L]^2: heights, derivatives, statistics."""

from __future__ import annotations

from asperity.surface.base import Surface, SurfaceStatistics, SurfaceWarning
from asperity.surface.composite import Composite, composite
from asperity.surface.fractal import WeierstrassMandelbrot, cut_off_index
from asperity.surface.height_map import HeightMap
from asperity.surface.plane_waves import Sinusoid
from asperity.surface.self_affine import SelfAffine
from asperity.surface.shapes import Cone, Flat, Pyramid, Sphere
from asperity.surface.spectrum import Spectrum

__all__ = [
    "Composite",
    "Cone",
    "Flat",
    "HeightMap",
    "Pyramid",
    "SelfAffine",
    "Sinusoid",
    "Spectrum",
    "Sphere",
    "Surface",
    "SurfaceStatistics",
    "SurfaceWarning",
    "WeierstrassMandelbrot",
    "composite",
    "cut_off_index",
]
