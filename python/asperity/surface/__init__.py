"""Rough and reference surfaces on the square patch [0, L]^2: heights, derivatives, statistics."""

from __future__ import annotations

from .base import Surface, SurfaceWarning
from .fractal import WeierstrassMandelbrot, cut_off_index
from .heightmap import HeightMap
from .shapes import Flat, Sinusoid, Sphere
from .statistics import Spectrum, SurfaceStatistics

__all__ = [
    "Flat",
    "HeightMap",
    "Sinusoid",
    "Spectrum",
    "Sphere",
    "Surface",
    "SurfaceStatistics",
    "SurfaceWarning",
    "WeierstrassMandelbrot",
    "cut_off_index",
]
