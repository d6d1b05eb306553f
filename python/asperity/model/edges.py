"""First contact on an edge of the patch, where rollers or free sides spoil it."""

from __future__ import annotations

from dataclasses import dataclass

from asperity.surface import Surface

_FALLS = 0.01  # slope across an edge next to the summit that makes a ridge, over the rms slope
_NEAR_FREE = 0.1  # distance of a summit from a free side that is near, over the shortest wavelength


@dataclass(frozen=True)
class Edge:
    """Where the summit lies with respect to the edges of the patch, and why that spoils the first contact."""

    name: str  # of the value
    value: float
    limit: float  # greatest value between rollers, smallest one with free sides
    doubt: str = ""  # a sentence, empty without one


def edge_of_summit(sides: str, surface: Surface) -> Edge | None:
    """How an edge of the patch affects the first contact; None of a surface in contact along a whole edge.

    Between rollers the value is the slope across the edge that the summit lies on, over the rms slope, 0 inside: they
    mirror the surface, and where it falls away from the edge a ridge arises, sharper than any summit. With free sides
    it is the distance of the summit from the nearest one, beyond which no solid carries it, over the shortest
    wavelength. A periodic surface has no edge.
    """
    if sides == "periodic":
        return None
    other = "take another surface.seed, or another window of a map"
    if sides == "free":
        x, y, _ = surface.maximum()
        distance = min(x, y, surface.L - x, surface.L - y) / surface.feature_size
        edges = " and ".join(surface.edges_of_summit(_NEAR_FREE * surface.feature_size))
        doubt = (
            f"the flat first touches the surface at the free side {edges} of the patch, beyond which no solid "
            f"carries the summit: light loads meet a softer contact than inside; {other}"
        )
        name = "distance from a free side over the shortest wave"
        return Edge(name, distance, _NEAR_FREE, doubt if edges else "")
    rms = surface.rms_slope()
    if not rms > 0.0:
        return None
    falls = {edge: slope for edge, slope in surface.edges_of_summit().items() if slope > _FALLS * rms}
    slope = max(falls.values(), default=0.0)
    doubt = (
        f"the flat first touches the surface on the edge {' and '.join(falls)} of the patch, where it slopes by "
        f"{slope:.2g}: mirrored by the rollers it has a sharp ridge there, and the exponent at light loads is that of "
        f"the ridge; {other}"
    )
    return Edge("slope across an edge over the rms slope", slope / rms, _FALLS, doubt if falls else "")
