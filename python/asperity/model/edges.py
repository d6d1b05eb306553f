"""First contact on an edge of the patch, where rollers or free sides spoil it."""

from __future__ import annotations

from dataclasses import dataclass

from asperity.surface import Surface

_FALLS = 0.01  # slope across an edge next to the summit that makes a ridge, over the rms slope
_NEAR_FREE = 0.1  # distance of a summit from a free side that is near, over the shortest wavelength


@dataclass(frozen=True)
class Edge:
    """Where the summit lies with respect to the edges of the patch, and how doubtful that is."""

    name: str  # of the value
    value: float
    limit: float  # greatest value between rollers, smallest one with free sides
    edges: str  # that the summit lies on
    slope: float  # of the surface across them, away from the edge


def edge_of_summit(sides: str, surface: Surface) -> Edge | None:
    """How an edge of the patch affects the first contact; None of a surface in contact along a whole edge.

    Between rollers the value is the slope across the edge that the summit lies on, over the rms slope, 0 inside; with
    free sides the distance of the summit from the nearest one, over the shortest wavelength. A periodic surface has no
    edge.
    """
    if sides == "periodic":
        return None
    if sides == "free":
        x, y, _ = surface.maximum()
        distance = min(x, y, surface.L - x, surface.L - y) / surface.feature_size
        falls = surface.edges_of_summit(_NEAR_FREE * surface.feature_size)
        return Edge("distance from a free side over the shortest wave", distance, _NEAR_FREE,
                    " and ".join(falls), max(falls.values(), default=0.0))  # fmt: skip
    rms = surface.rms_slope()
    if not rms > 0.0:
        return None
    falls = {edge: slope for edge, slope in surface.edges_of_summit().items() if slope > _FALLS * rms}
    slope = max(falls.values(), default=0.0)
    return Edge("slope across an edge over the rms slope", slope / rms, _FALLS, " and ".join(falls), slope)


def doubt_of_edge(sides: str, surface: Surface) -> str:
    """Why an edge of the patch spoils the first contact, in a sentence; empty when none does.

    Rollers mirror the surface: where it falls away from the edge that the summit lies on, a ridge arises, sharper than
    any summit. A surface that is symmetric about the edge has none. A free side has no solid beyond it to carry a
    summit near by. A periodic surface has no edge.
    """
    edge = edge_of_summit(sides, surface)
    if edge is None or not edge.edges:
        return ""
    other = "take another surface.seed, or another window of a map"
    if sides == "free":
        return (
            f"the flat first touches the surface at the free side {edge.edges} of the patch, beyond which no solid "
            f"carries the summit: light loads meet a softer contact than inside; {other}"
        )
    return (
        f"the flat first touches the surface on the edge {edge.edges} of the patch, where it slopes by "
        f"{edge.slope:.2g}: mirrored by the rollers it has a sharp ridge there, and the exponent at light "
        f"loads is that of the ridge; {other}"
    )
