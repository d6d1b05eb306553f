"""Damping models: where in the cycle the damper acts.

All are written ``2 zeta g(u) u'`` with ``g(0) = 1``, so zeta is the damping ratio of small motion:

    "always"         g = 1                     a dashpot to ground; limits every resonance
    "contact"        g = 1 in contact, else 0  acts only while the bodies touch
    "hunt-crossley"  g = F_s / W               proportional to the contact force (Hunt & Crossley 1975)
    `LoopDamping`    g = 1 + h(|u|)/zeta       in contact, else 0; h makes each amplitude lose what its loop loses
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from asperity.arrays import Array
from asperity.curve.loops import LoopTable
from asperity.errors import InputError
from asperity.vibration.checks import one_of

_POINTS = 4000  # of the mean over a cycle
_SAME_PRELOAD = 0.01  # relative difference up to which loops are about the preload


@dataclass(frozen=True)
class LoopDamping:
    """Damping ratio over the amplitude, in addition to the damping ratio of small motion.

    A loop loses the same energy at any frequency. The damper is viscous, with a coefficient that rises with the
    distance from the preload; at the frequency of small motion a harmonic motion of each amplitude loses what the loop
    loses. Between the amplitudes the coefficient is linear, below the first it falls to zero, beyond the last it is
    constant. It acts in contact, and so does the damping ratio of small motion beside it.

    Attributes:
        deflection, zeta: rising amplitudes of the approach (length), and damping ratios, half of the loss factors
        stiffness: of the loops (force/length), empty where unknown; the ratios are those of a law as stiff as each
        preload: about which the loops were computed (force), NaN where unknown
        background: damping ratio of small motion, > 0 (that of the oscillator, which sets it)

    Raises:
        InputError: amplitudes that do not rise, or a ratio that is negative

    Examples:
        >>> loops = asp.vibration.LoopDamping((0.1, 0.2), (0.001, 0.002))
        >>> oscillator = asp.ContactOscillator(asp.PowerLaw(1.5), zeta=0.01, damping=loops)
        >>> orbit = oscillator.free([0.2]).orbits[0]
        >>> round(0.01 * orbit.dissipation / (np.pi * (0.5 * (0.2 - orbit.u_min)) ** 2), 4)  # zeta and that of the loop
        0.012
    """

    deflection: tuple[float, ...]
    zeta: tuple[float, ...]
    stiffness: tuple[float, ...] = ()
    preload: float = np.nan
    background: float = np.nan

    def __post_init__(self) -> None:
        z = np.array([0.0, *self.deflection])
        if len(self.deflection) != len(self.zeta) or len(z) < 2 or not np.all(np.diff(z) > 0.0):
            raise InputError("the amplitudes of loops must be positive and rise, with a damping ratio each")
        if not all(0.0 <= value < np.inf for value in self.zeta):
            raise InputError("the damping ratio of a loop is negative or not finite")

    @classmethod
    def of(cls, loops: LoopTable) -> LoopDamping:
        """Take the last loop of each amplitude; raise `InputError` where a larger force moves the flat no further."""
        last = [of_one[-1] for of_one in loops.of_amplitudes()]
        deflection, zeta, k = zip(*((loop.deflection, 0.5 * loop.eta, loop.k) for loop in last), strict=True)
        return cls(deflection, zeta, k, last[0].preload)

    def on(self, stiffness: float, preload: float) -> tuple[LoopDamping, str]:
        """Damping on a law with the stiffness k_n at a preload, and a note on another preload ("" if it is the same).

        A cycle loses pi eta k a^2 with the stiffness k of the loop, and 2 pi zeta k_n a^2 with that of the law.
        """
        note = ""
        if abs(self.preload / preload - 1.0) > _SAME_PRELOAD:
            note = (
                f"the damping is that of loops about a preload of {self.preload:.4g}, the vibration is about "
                f"{preload:.4g}: compute loops about that (loops.preload)"
            )
        if not self.stiffness:
            return self, note
        zeta = tuple(z * k / stiffness for z, k in zip(self.zeta, self.stiffness, strict=True))
        return replace(self, zeta=zeta, stiffness=(stiffness,) * len(zeta)), note

    def __str__(self) -> str:
        return "loops"

    def coefficient(self, z: Array) -> Array:
        """Coefficient of the damper at distances z >= 0 (length), in units of a damping ratio, its shape."""
        return np.interp(z, *self._nodes)

    @cached_property
    def _nodes(self) -> tuple[Array, Array]:
        """Distances and coefficients between which the damper is linear: the least squares of the damping ratios."""
        from scipy.optimize import nnls

        x = np.array([0.0, *self.deflection])
        theta = 0.5 * np.pi * (np.arange(_POINTS) + 0.5) / _POINTS
        weight = 2.0 / _POINTS * np.sin(theta) ** 2  # a damper that is one has the damping ratio one
        hats = np.eye(len(x))[1:]
        means = np.array([[weight @ np.interp(a * np.cos(theta), x, hat) for hat in hats] for a in x[1:]])
        return x, np.append(0.0, nnls(means, np.array(self.zeta))[0])


DAMPING = ("always", "contact", "hunt-crossley")
LOOPS = "loops"  # name of the damping of the loops that a run has computed
Damping = str | LoopDamping


def check_damping(damping: Damping, zeta: float) -> Damping:
    """`damping` for a damping ratio; raise `InputError` unless it is one of `DAMPING` or that of loops."""
    if isinstance(damping, LoopDamping):
        if not zeta > 0.0:
            raise InputError(
                f"zeta = {zeta:g} with the damping of loops is not legal: give what the loops do not contain "
                "(micro-slip, radiation, the clamping), more than 0"
            )
        return replace(damping, background=zeta)
    if damping == LOOPS:
        raise InputError(
            'damping = "loops" needs loops.csv in the folder of the run: compute it with the section [loops]'
        )
    one_of("damping", damping, DAMPING)
    return damping


def only_in_contact(damping: Damping) -> bool:
    """Whether the damping is bounded where the mass flies most of the time: it may not limit a resonance."""
    return damping == "contact" or isinstance(damping, LoopDamping)
