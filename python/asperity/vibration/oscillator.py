"""A mass on a contact: entry point of the vibration analysis, and the numbers of its small vibration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from asperity.errors import InputError, RangeError
from asperity.model.dynamics import EXCITATIONS, FORCING, OMEGA, SHAPES, ZETA, window
from asperity.model.limits import one_of, positive, positives, within
from asperity.runtime.display import short_repr
from asperity.units import plus_minus, quantity
from asperity.vibration.equation import Equation
from asperity.vibration.free import (
    FreeVibration,
    Thresholds,
    contact_limit,
    free_vibration,
    largest_amplitude,
    thresholds,
)  # fmt: skip
from asperity.vibration.law import NOT_RESOLVED, Law, TaylorLaw, bar_of, bend
from asperity.vibration.motion import Trajectory, course, integrate
from asperity.vibration.response import FrequencyResponse, frequency_response

GRAVITY = 9.80665  # m/s^2


@dataclass(frozen=True)
class ContactOscillator(Equation):
    """A rigid mass pressed on a contact by its weight, with damping, under harmonic forcing.

    The displacement is u = (z - z_s)/z_s > 0 in compression, and contact is lost at u = -1; time is in units of
    1/omega_s, forcing is F^ = F/(n_loc W). See `asperity.vibration.equation`. Where the base moves, by b, z is the
    approach, so u is relative to the base; the mass moves by u + b/z_s. Its attributes are those of `Equation`.

    Attributes:
        gravity: gravitational acceleration (length/time^2) in the units of the law; default 9.80665 (SI). None if
            unknown: mass and omega_s are then NaN.

    Examples:
        >>> oscillator = asp.ContactOscillator(asp.PowerLaw(1.5, K=1e9), load=10.0, zeta=0.02)
        >>> print(f"m = {oscillator.mass:.4f} kg, omega_s = {oscillator.omega_s:.1f} rad/s")
        m = 1.0197 kg, omega_s = 1780.2 rad/s
        >>> onset = oscillator.thresholds()
        >>> print(f"{onset.u_max:.4f}", onset.softening, f"{onset.contact_loss:.4f}")
        0.8420 softening 0.0355
        >>> path = oscillator.simulate(0.9, 0.05, u=0.1, periods=2)
        >>> print(f"{path.u.max():.4f}")
        0.1914
    """

    gravity: float | None = field(default=GRAVITY, kw_only=True)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.gravity is not None:
            positive("gravity", self.gravity)
        if self.known_to < -1e-9:
            end = float(self.law.force(self.law.known_to))
            raise RangeError(
                f"load = {self.load:g} lies outside the law, which ends at force {end:g}; lower the load, or compute "
                "the curve further"
            )

    @property
    def mass(self) -> float:
        """Mass W/g (mass); NaN without gravity."""
        return self.load / (np.nan if self.gravity is None else self.gravity)

    @property
    def omega_s(self) -> float:
        """Natural frequency of small motion sqrt(n_loc g/z_s) (rad/time); NaN without gravity."""
        return float(np.sqrt(self.scale / self.z_s / self.mass))

    @property
    def u_max(self) -> float:
        """Largest release amplitude that keeps contact."""
        return contact_limit(self)

    def taylor(self) -> ContactOscillator:
        """Same oscillator with its law truncated after the cubic term."""
        return replace(self, law=TaylorLaw.about(self.law, self.load), load=self.load)

    def free(self, u0: ArrayLike | None = None) -> FreeVibration:
        """Natural frequency over the release displacement u0 > 0, to 1e-12 for smooth laws.

        By default 120 of them up to 1.5 u_max. An orbit that passes the rim of the Taylor well is a `RangeError`.
        """
        if u0 is None:
            top = min(1.5 * self.u_max if np.isfinite(self.u_max) else 1.5, largest_amplitude(self))
            u0 = np.linspace(top / 120, top, 120)
        return free_vibration(self, u0)

    def thresholds(self) -> Thresholds:
        """Onsets of contact loss, hysteresis and period doubling as F^."""
        return thresholds(self)

    def response(
        self, forcing: float, omega: Sequence[float] = (0.5, 1.3), *, excitation: str = "force", tol: float = 1e-5
    ) -> FrequencyResponse:
        """The main branch of periodic orbits in a window of frequencies, stable and unstable, with its bifurcations.

        Args:
            forcing: F^ = F/(n_loc W), 1e-9 to 1e6; of the base see `excitation`
            excitation: "force" on the mass; "base": the base moves by b = forcing z_s cos(omega t), which acts on the
                approach like F^ = forcing Omega^2; "acceleration": its acceleration is forcing z_s omega_s^2 at any
                Omega, which acts like F^ = forcing
            omega: lowest and highest Omega, 0.01 to 100
            tol: allowed error of the orbits, relative to the amplitude

        Raises:
            ConvergenceError: no orbit is found
            InputError: an argument is not legal, or zeta is below 1e-4
        """
        within("zeta of forced motion", self.zeta, ZETA)
        one_of("excitation", excitation, EXCITATIONS)
        equation = replace(self, F_hat=within("forcing", forcing, FORCING), excitation=excitation)
        return frequency_response(equation, window(omega), positive("tol", tol))

    def simulate(
        self,
        omega: float | Sequence[float],
        forcing: float,
        *,
        shape: str = "harmonic",
        u: float = 0.0,
        v: float = 0.0,
        periods: float = 50.0,
        samples: float = 64,
        rtol: float = 1e-10,
    ) -> Trajectory:
        """Motion in time from the state u, v = du/dtau, with each separation and landing located.

        Args:
            omega: Omega (with forcing = 0, or a step: the unit of `periods` only), of a chirp both ends
            forcing: F^, may be 0; for a base that accelerates by b'', b'' over -z_s omega_s^2
            shape: "harmonic", cos(Omega tau); "step", constant; "half-sine", sin(Omega tau) for half a period; "chirp",
                whose frequency changes evenly over the motion
            u, v: initial state
            periods, samples: length in periods of (the first) Omega, and output points in each
            rtol: tolerance of the integrator

        Raises:
            RangeError: the motion escapes from a Taylor well
        """
        one_of("shape", shape, SHAPES)
        ends = [within("omega", value, OMEGA) for value in positives("omega", omega)]
        if len(ends) != (2 if shape == "chirp" else 1):
            raise InputError(f"omega = {ends} is not legal: a chirp has two frequencies, another excitation one")
        f = within("forcing", forcing, FORCING) if forcing != 0 else 0.0
        if not np.isfinite([u, v]).all():
            raise InputError(f"the initial state u = {u}, v = {v} is not legal: it must be finite")
        period = 2.0 * np.pi / ends[0]
        duration = positive("periods", periods) * period
        force, corners = course(shape, f, ends, duration)
        return integrate(
            self, force, (float(u), float(v)), duration, rtol=positive("rtol", rtol),
            samples=positive("samples", samples, zero=True) / period, max_step=min(0.25, np.pi / max(ends) / 8.0),
            corners=corners,
        )  # fmt: skip


@dataclass(frozen=True)
class Numbers:
    """The numbers of a joint's small vibration, in the units of the curve; NaN where unknown.

    Attributes:
        stiffness: k_n at the preload, of the interface alone where the block of the model is known (force/length)
        mass, frequency: what vibrates (mass), and its natural frequency (1/time)
        approach: static approach z_s (length)
        damping: damping ratio
        n, kappa: local exponent and backbone curvature
        bars: of the stiffness over it, of n and of kappa
        block: compliance of the block of the model beside the joint (length/force), 0 where the stiffness contains it
        greatest: force that the contact has met (force)
    """

    stiffness: float
    mass: float
    frequency: float
    approach: float
    damping: float
    n: float = math.nan
    kappa: float = math.nan
    bars: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    block: float = 0.0
    greatest: float = math.nan

    @classmethod
    def of(cls, law: Law, load: float, mass: float, zeta: float, **more: Any) -> Numbers:
        """Numbers of a mass on a law under a load (force)."""
        z, k, n, kappa = map(float, law.at_load(load))
        _, of_k, of_n, of_kappa = map(float, bar_of(law, lambda side: side.at_load(load)))
        frequency = math.sqrt(k / mass) / (2.0 * math.pi)
        return cls(k, mass, frequency, z, zeta, n, kappa, (of_k / k, of_n, of_kappa), **more)

    @property
    def frequency_bar(self) -> float:
        """Error bar of the frequency (1/time), which is a root of the stiffness; NaN if unknown."""
        return 0.5 * self.bars[0] * self.frequency

    @property
    def softening(self) -> str:
        """ "softening", "hardening", "linear", or "curvature not resolved" where the bar of kappa holds 0."""
        bar = self.bars[2] if self.bars[2] > 0.0 else 0.0
        return bend(self.kappa - bar, self.kappa + bar)

    @property
    def with_block(self) -> float:
        """Stiffness of the interface and the block of the model in series (force/length)."""
        return self.stiffness / (1.0 + self.block * self.stiffness)

    def sentence(self, units: str | None) -> str:
        """Them as one line, with SI units if `units` is "SI"."""
        si, bar = units == "SI", self.bars[0]
        parts = [f"k_n = {quantity(self.stiffness, 'N/m' if si else '', 5, bar=bar)}"]
        if math.isfinite(self.mass):
            parts.append(f"m = {self.mass:.5g}{' kg' if si else ''}")
            parts.append(f"f = {quantity(self.frequency, 'Hz' if si else '', 5, bar=0.5 * bar)}")
        else:
            parts.append("m and f unknown (give joint.mass)")
        parts += [f"z_s = {quantity(self.approach, 'm' if si else '')}", f"zeta = {self.damping:.5g}"]
        parts += [resolved("n", self.n, self.bars[1]), resolved("kappa", self.kappa, self.bars[2])]
        return ", ".join(parts)

    def to_dict(self) -> dict[str, Any]:
        """Section "numbers" of thresholds.json, None where unknown; `k_n_bar` is over k_n."""
        values = {
            "k_n": self.stiffness, "m": self.mass, "f": self.frequency, "z_s": self.approach, "zeta": self.damping,
            "n": self.n, "kappa": self.kappa, "k_n_bar": self.bars[0], "f_bar": self.frequency_bar,
            "n_bar": self.bars[1], "kappa_bar": self.bars[2],
            "k_n_with_block": self.with_block if self.block else math.nan, "greatest_load": self.greatest,
        }  # fmt: skip
        known = {name: value if math.isfinite(value) else None for name, value in values.items()}
        return known | {"softening": self.softening}


def resolved(name: str, value: float, bar: float) -> str:
    """A value with its bar, or that it is not resolved where the bar is wider than the value."""
    if not math.isfinite(value):
        return f"{name} unknown"
    if bar > abs(value) > 0.0:
        return NOT_RESOLVED if name == "kappa" else f"{name} unresolved"
    return f"{name} = {plus_minus(value, bar)}"
