"""Shares of noisy measured curves whose bars hold the stiffness, exponent and curvature of the law behind them.

    python3 benchmarks/measured.py [DRAWS]

Six families with white noise of 0.1 to 5 % of the preload, 20 to 2,000 rows, and contact that begins anywhere; then
other laws, and errors that are not white. A number whose bar is wider than itself is
reported as unresolved and counts as held.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import brentq

from asperity.errors import AsperityError
from asperity.vibration.law import bar_of
from asperity.vibration.source import CurveColumns, choose

Array = np.ndarray[Any, Any]
Law = Callable[[Any], Any]
Rng = np.random.Generator


def power(n: float) -> Law:
    return lambda z: np.maximum(z, 0.0) ** n


def two_spots(rng: Rng) -> Law:
    h, c = rng.uniform(0.1, 0.8), rng.uniform(0.3, 2.0)
    return lambda z: power(1.5)(z) + c * power(1.5)(z - h)


def summits(rng: Rng) -> Law:
    count = int(rng.integers(5, 40))
    h, c = np.append(0.0, 0.8 * rng.beta(2, 2, count - 1)), rng.uniform(0.5, 1.5, count)
    return lambda z: np.sum(c * power(1.5)(np.asarray(z)[..., None] - h), axis=-1)


FAMILIES: dict[str, Callable[[Rng], Law]] = {
    "Hertz": lambda rng: power(1.5),
    "power 1.2": lambda rng: power(1.2),
    "power 2": lambda rng: power(2.0),
    "power 3": lambda rng: power(3.0),
    "two spots": two_spots,
    "a kink: linear, then twice as stiff": lambda rng: (lambda h: lambda z: power(1.0)(z) + power(1.0)(z - h))(
        rng.uniform(0.2, 0.9)
    ),
}
#: Further laws and errors.
UNSEEN: dict[str, Callable[[Rng], Law]] = {
    "exponential": lambda rng: (lambda c: lambda z: np.expm1(c * np.maximum(z, 0.0)))(rng.uniform(0.5, 3.0)),
    "sum of powers": lambda rng: (lambda c, n: lambda z: power(n)(z) + c * power(n + 1)(z))(
        rng.uniform(0.2, 3), rng.uniform(1, 2)
    ),
    "softening": lambda rng: (lambda c, n: lambda z: power(n)(z) / (1 + c * np.maximum(z, 0)))(
        rng.uniform(0.2, 1), rng.uniform(1.3, 2.5)
    ),
    "5 to 40 summits": summits,
    "wavy": lambda rng: (lambda w: lambda z: power(1.5)(z) * (1 + 0.05 * np.sin(w * np.maximum(z, 0))))(
        rng.uniform(3, 12)
    ),
}
ERRORS: dict[str, Callable[[Rng, Array, float], Array]] = {
    "white": lambda rng, F, size: F + size * rng.standard_normal(F.size),
    "share of the force": lambda rng, F, size: F * (1 + size / F.max() * rng.standard_normal(F.size)),
    "slow drift": lambda rng, F, size: F + size * np.cumsum(rng.standard_normal(F.size)) / np.sqrt(F.size),
    "steps of a converter": lambda rng, F, size: np.round(F / (3 * size)) * 3 * size,
    "one row in fifty far off": lambda rng, F, size: (
        F + size * rng.standard_normal(F.size) * np.where(rng.random(F.size) < 0.02, 8, 1)
    ),
}  # fmt: skip


def exact(law: Law, z: float, h: float = 1e-3) -> Array:
    """Stiffness, exponent and kappa by differences of ln F over ln z."""
    ln = [float(np.log(law(np.array(z * np.exp(i * h))))) for i in range(-2, 3)]
    a, b = (ln[3] - ln[1]) / (2 * h), (ln[3] - 2 * ln[2] + ln[1]) / h**2
    c = (ln[4] - 2 * ln[3] + 2 * ln[1] - ln[0]) / (2 * h**3)
    second, third = (a * a - a + b) / a, (a**3 - 3 * a * a + 2 * a + 3 * b * (a - 1) + c) / a
    return np.array([a * float(law(np.array(z))) / z, a, (3 * third - 5 * second**2) / 48])


def draw(make: Callable[[Rng], Law], error: Callable[[Rng, Array, float], Array], seed: int) -> Any:
    """Held or unresolved (3,), relative bar of the stiffness, and resolved (3,); None for a curve that is refused."""
    rng = np.random.default_rng(seed)
    law = make(rng)
    count, noise = (
        int(np.exp(rng.uniform(np.log(20), np.log(2000)))),
        float(np.exp(rng.uniform(np.log(1e-3), np.log(0.05)))),
    )
    begin = rng.uniform(-0.5, 0.0) if rng.random() < 0.7 else 0.0
    d, share = np.linspace(begin, 1.0, count), rng.uniform(0.3, 0.8)
    load = share * float(law(np.array(1.0)))
    force, offset = error(rng, law(d), noise * load), rng.uniform(-3.0, 3.0)
    true = exact(law, brentq(lambda z: float(law(np.array(z))) - load, 1e-9, 1.0))
    try:
        found = choose(CurveColumns.of({"delta": d + offset, "force": force}), "table", load)
    except AsperityError:
        return None
    values = found.law.at_load(found.load)[1:]
    bars = bar_of(found.law, lambda side: side.at_load(found.load))[1:]
    unresolved = bars > np.abs(values)
    return (np.abs(values - true) <= bars) | unresolved, bars[0] / values[0], ~unresolved


def main(draws: int) -> None:
    head = ("family", "k_n held", "n", "kappa", "median bar of k_n", "n resolved", "kappa resolved", "refused")
    print(f"| {' | '.join(head)} |\n{'|---' * len(head)}|")
    cases = [(name, make, "white") for name, make in (FAMILIES | UNSEEN).items()]
    cases += [(f"Hertz, {error}", FAMILIES["Hertz"], error) for error in ERRORS if error != "white"]
    for name, make, error in cases:
        found = [draw(make, ERRORS[error], 5000 + seed) for seed in range(draws)]
        known = [one for one in found if one is not None]
        held, size, resolved = (np.array(column) for column in zip(*known, strict=True))
        shares = " | ".join(f"{100 * share:.0f} %" for share in held.mean(axis=0))
        rest = " | ".join(f"{100 * share:.0f} %" for share in resolved.mean(axis=0)[1:])
        print(f"| {name} | {shares} | {100 * np.median(size):.2g} % | {rest} | {len(found) - len(known)} |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
