"""Definition of a hard case: its changes to a base case, its map, the end expected of it, and its comparisons."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from asperity.arrays import Floats
from asperity.curve import Curve

Keys = dict[str, Any]

L = 1e-6
#: The base case: surface and material of cases/single.toml on a coarse mesh.
BASE: Keys = {
    "surface.kind": "weierstrass-mandelbrot",
    "surface.L": L,
    "surface.D": 2.4,
    "surface.G": 1.36e-11,
    "material.E": 200e9,
    "material.nu": 0.3,
    "material.yield_strength": 1e9,
    "material.tangent_modulus": 10e9,
    "mesh.h_contact": 0.12 * L,
    "mesh.growth": 0.6,
    "mesh.h_max": 0.4 * L,
    "loading.delta_max": 0.03 * L,
    "loading.steps": 6,
    "solver.linear": "cg",  # fails earlier than LU
}
ELASTIC: Keys = {"material.yield_strength": None, "material.tangent_modulus": None}


def wave(amplitude: float, dims: int = 2, **more: Any) -> Keys:
    """A sinusoid instead of the rough surface; amplitude in units of L."""
    shape = {"kind": "sinusoid", "amplitude": amplitude * L, "dims": dims, "D": None, "G": None}
    return {f"surface.{key}": value for key, value in (shape | more).items()}


def sphere(radius: float, **more: Any) -> Keys:
    """A sphere instead of the rough surface; radius in units of L."""
    shape = {"kind": "sphere", "radius": radius * L, "D": None, "G": None}
    return {f"surface.{key}": value for key, value in (shape | more).items()}


FLAT: Keys = {"surface.kind": "flat", "surface.D": None, "surface.G": None}
FILE: Keys = {"surface.kind": "file", "surface.path": "map.npy", "surface.D": None, "surface.G": None}


# --- height maps -----------------------------------------------------------------------------------------------

#: Heights in units of L at the nodes of a regular grid, from their coordinates (n, n) in the same units.
Map = Callable[[Floats, Floats], Floats]
SAMPLES = 33


def heights(of: Map, n: int = SAMPLES) -> Floats:
    """A height map in units of L (n, n)."""
    t = np.linspace(0.0, 1.0, n)
    return of(*np.meshgrid(t, t))


def two_peaks(x: Floats, y: Floats) -> Floats:
    """Two equal peaks on a diagonal."""
    one, other = (np.exp(-((x - c) ** 2 + (y - c) ** 2) / 0.02) for c in (0.25, 0.75))
    return 0.05 * (one + other)


def two_peaks_turned(x: Floats, y: Floats) -> Floats:
    """`two_peaks` with the peaks on the other diagonal."""
    return two_peaks(x, 1.0 - y)


def _wave(x: Floats, y: Floats) -> Floats:
    return 0.03 * np.cos(2 * np.pi * (x - 0.4)) * np.cos(2 * np.pi * (y - 0.55))


def noisy(x: Floats, y: Floats) -> Floats:
    """A wave with independent noise at each sample, 1 % of the height of the wave."""
    return _wave(x, y) + 5e-4 * np.random.default_rng(0).standard_normal(x.shape)


def spike(x: Floats, y: Floats) -> Floats:
    """A wave with one sample far above the others."""
    z = _wave(x, y)
    z[20, 9] += 0.1
    return z


# --- theoretical properties of the curve: each returns a sentence of what does not hold -----------------------


def nearly_full(curve: Curve) -> str:
    """More than 95 % of the area is in contact, but not all of it."""
    area = float(curve.area_fraction.max())
    return "" if 0.95 < area < 1.0 + 1e-9 else f"contact area {area:.1%}"


def hertz(curve: Curve) -> str:
    """An elastic sphere of R = L follows Hertz, P = 4/3 E' sqrt(R) delta^1.5, and has no dent after its release."""
    load, E_prime = curve.branch == "load", BASE["material.E"] / (1.0 - BASE["material.nu"] ** 2)
    expected = 4.0 / 3.0 * E_prime * np.sqrt(L) * curve.delta[load] ** 1.5
    error = float(np.max(np.abs(curve.force[load] - expected)) / np.max(expected))
    clean = curve.force[-1] == 0.0 and abs(curve.delta_star[-1]) < 1e-9
    return "" if error < 0.05 and clean else f"Hertz within {error:.1%}, dent {curve.delta_star[-1]:.0e} L"


def keeps_a_loop(curve: Curve) -> str:
    """Plastic flow goes on: the accumulated plastic strain grows in the last cycle, by as much as in the one before."""
    ends = np.flatnonzero((curve.branch[:-1] != "unload") & (curve.branch[1:] == "unload"))
    before, last = np.diff(curve.max_plastic_strain[ends])[-2:]
    return (
        "" if last > 1e-3 and abs(last / before - 1.0) < 0.05 else f"plastic strain grows by {before:g}, then {last:g}"
    )


# --- scenes and twins ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Twin:
    """The same problem solved in a second way.

    Attributes:
        about: the second way, in words
        tolerance: greatest accepted difference of the curves, relative to the greatest force
        keys: changes to the keys of the scene
        map: height map that replaces that of the scene
    """

    about: str
    tolerance: float
    keys: Keys = field(default_factory=dict)
    map: Map | None = None


DIRECT = Twin("LU, not CG", 1e-6, {"solver.linear": "lu"})
PENALTY = Twin("penalty", 0.05, {"contact.method": "penalty", "contact.penalty": 100.0})


@dataclass(frozen=True)
class Scene:
    """A hard case.

    Attributes:
        name: "group" or "group/variant"
        about: parameters, in words
        keys: dotted keys of the case that differ from BASE; None removes a key
        ends: expected end: "done", "refused" (exit code 2), "stopped" or "wrong" (exit code 3; "wrong": the run
            itself reports a violated balance)
        reason: text that the message of a refusal or stop must contain
        depth: delta_max over the height of the summit above the mean plane
        twin: second solution to compare the curve with
        claim: theoretical property of the curve; a sentence of what does not hold
        map: heights of a surface of kind "file"
        fast: whether the scene is in the short suite
    """

    name: str
    about: str
    keys: Keys = field(default_factory=dict)
    ends: str = "done"
    reason: str = ""
    depth: float | None = None
    twin: Twin | None = None
    claim: Callable[[Curve], str] | None = None
    map: Map | None = None
    fast: bool = False
