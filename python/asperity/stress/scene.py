"""What a hard case is: what differs from a small rough block, how it should end, and what it is compared with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from asperity.stress import files
from asperity.stress.claims import Claim

Keys = dict[str, Any]

L = 1e-6
#: The demo's surface and material on a coarse mesh.
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
    "solver.linear": "cg",  # which breaks down before LU does
}
ELASTIC: Keys = {"material.yield_strength": None, "material.tangent_modulus": None}


def wave(amplitude: float, dims: int = 2, **more: Any) -> Keys:
    """A sinusoid in place of the rough surface; amplitude in units of L."""
    shape = {"kind": "sinusoid", "amplitude": amplitude * L, "dims": dims, "D": None, "G": None}
    return {f"surface.{key}": value for key, value in (shape | more).items()}


def sphere(radius: float, **more: Any) -> Keys:
    """A sphere in place of the rough surface; radius in units of L."""
    shape = {"kind": "sphere", "radius": radius * L, "D": None, "G": None}
    return {f"surface.{key}": value for key, value in (shape | more).items()}


FLAT: Keys = {"surface.kind": "flat", "surface.D": None, "surface.G": None}
FILE: Keys = {"surface.kind": "file", "surface.path": "map.npy", "surface.D": None, "surface.G": None}


@dataclass(frozen=True)
class Twin:
    """The same problem solved in another way.

    Attributes:
        about: the other way, in words
        bar: greatest difference of the curves that is no contradiction, relative to the greatest force
        keys: what differs from the scene
        map: height map in place of the scene's
    """

    about: str
    bar: float
    keys: Keys = field(default_factory=dict)
    map: files.Map | None = None


DIRECT = Twin("LU, not CG", 1e-6, {"solver.linear": "lu"})
PENALTY = Twin("penalty", 0.05, {"contact.method": "penalty", "contact.penalty": 100.0})


@dataclass(frozen=True)
class Scene:
    """A hard case.

    Attributes:
        name: "group" or "group/variant"
        about: parameters, in words
        keys: dotted keys of the case that differ from BASE, None to remove one
        ends: "done", "refused" (exit code 2), "stopped" or "wrong", which the run says itself (both exit code 3)
        reason: part of the sentence that a refusal or stop must give
        depth: delta_max as part of the height of the summit above the mean plane
        twin: what the curve is compared with
        claim: what theory says of the curve
        map: heights of a surface of kind "file"
        spoil: makes a bad mesh of the scene's own
        fast: whether it is part of the short suite
    """

    name: str
    about: str
    keys: Keys = field(default_factory=dict)
    ends: str = "done"
    reason: str = ""
    depth: float | None = None
    twin: Twin | None = None
    claim: Claim | None = None
    map: files.Map | None = None
    spoil: Callable[[Any], Any] | None = None
    fast: bool = False

    @property
    def group(self) -> str:
        """First part of the name."""
        return self.name.partition("/")[0]
