"""Definition of a hard case: its changes to a base case, the end expected of it, and its comparisons."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import bad_inputs

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
    map: bad_inputs.Map | None = None


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
    map: bad_inputs.Map | None = None
    fast: bool = False
