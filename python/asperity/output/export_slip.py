"""Slip of a joint for other programs: an array of sliders per nominal area, as a table or a module with state."""

from __future__ import annotations

from collections.abc import Iterator

from asperity.runtime.display import comment
from asperity.slip import SlipLaw
from asperity.version import __version__

SLIDERS = 20  # of an exported array
_LIGHTEST = 0.02  # force over the limit below which none of them slips

_MODULE = '''"""Tangential force of a joint: sliders in parallel, which remember.

{about}

    from sliders import Sliders
    joint = Sliders(area=1e-4, pressure=1e6)
    force = joint(u)       # trial, at a displacement u
    joint.accept(u)        # the end of a step
"""

import numpy as np

FRICTION = {friction!r}
AREA, PRESSURE = {area!r}, {pressure!r}  # nominal
K = np.array({k})  # stiffness over the nominal area
F = np.array({f})  # force at which a slider slips, over friction times pressure


class Sliders:
    """Jenkins elements in parallel; `area` and `pressure` nominal. The stiffness is that of `PRESSURE`."""

    def __init__(self, area=AREA, pressure=PRESSURE):
        self.k, self.f = area * K, FRICTION * pressure * area * F
        self.at = np.zeros(len(K))  # position of each slider

    def _moved(self, u):
        return np.clip(self.at, u - self.f / self.k, u + self.f / self.k)

    def __call__(self, u):
        """Force at a displacement, monotonic since the last accepted one."""
        return float(self.k @ (u - self._moved(u)))

    def accept(self, u):
        """Keep the slip of a displacement."""
        self.at = self._moved(u)
'''


def sliders_table(law: SlipLaw, patch: float, about: tuple[str, ...]) -> str:
    """Sliders of a law as CSV, stiffness over area and force over mu P.

    Args:
        law: of the patch
        patch: its nominal area [length^2]
        about: further comments
    """
    lines = [f"# {comment(text)}" for text in (*_about(law, patch), *about)]
    return "\n".join([*lines, "k,f", *(f"{k!r},{f!r}" for k, f in _sliders(law, patch))]) + "\n"


def sliders_module(law: SlipLaw, patch: float, area: float, about: tuple[str, ...]) -> str:
    """Python module with the sliders of a law, for a joint of the nominal area [length^2]; see `sliders_table`."""
    k, f = zip(*_sliders(law, patch), strict=True)
    return _MODULE.format(
        about="\n".join(map(comment, (*_about(law, patch), *about))), friction=law.friction, area=area,
        pressure=law.preload / patch, k=list(k), f=list(f),
    )  # fmt: skip


def _sliders(law: SlipLaw, patch: float) -> list[tuple[float, float]]:
    """Stiffness over area and force over mu P of each slider."""
    array = law.array(SLIDERS, _LIGHTEST)
    return [(float(k), float(f)) for k, f in zip(array.k / patch, array.f / law.limit, strict=True)]


def _about(law: SlipLaw, patch: float) -> Iterator[str]:
    yield f"slip of a rough joint by asperity {__version__}, without the block"
    yield f"friction {law.friction:g}, nominal pressure {law.preload / patch:.6g}"
    yield f"stiffness at rest over the nominal area {law.k_tangent(0.0) / patch:.6g}"
