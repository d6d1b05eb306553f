"""Frequency response: against the shooting method of asperity 1.0, and work over precision against pyHarm-os.

    ./run python3 benchmarks/dynamics.py decision PYTHON     an interpreter with asperity 1.0
    ./run python3 benchmarks/dynamics.py speed

`decision`: random windows of power laws (n 1 to 3, zeta 0.002 to 0.2) under weak (F^ 0.002 to 0.1) and strong forcing
(F^ 0.1 to 1), curves with kinks, plateaus and stiff ends, and stops up to 300 times as stiff. The response is the same
if at 20 frequencies it has the same orbits, u_max to 1e-4 of the amplitude, of the same stability, and folds, onsets of
contact loss and period doublings at the same frequencies to 1e-4. The table is in docs/tables/response.csv; differences
are printed, "said" where the response notes a limit. Version 1.0 compiles a period map, and finds its main branch with
`subharmonics=False`. Times are CPU seconds on one core.

`speed`: n = 1.5, zeta = 0.01, F^ = 0.05, Omega from 0.5 to 1.3. Times are CPU seconds of a warm run on one core. The
error is that of u_max, relative, against orbits at 1e-8 at the same Omega; points within 1e-3 of a fold are left
out, where the amplitude is singular in Omega. Needs `./run pip install pyHarm-os==1.2.2`.
"""

from __future__ import annotations

import json
import os
import runpy
import subprocess
import sys
import time
import warnings
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

Case = dict[str, Any]
N, ZETA, FORCING, WINDOW = 1.5, 0.01, 0.05, (0.5, 1.3)
FREQUENCIES, SAME = 20, 1e-4


def cases() -> list[Case]:
    """Windows of power laws, curves with kinks, and stops."""
    found: list[Case] = []
    for group, count, seed, forcing in (("power laws", 200, 11, (0.002, 0.1)), ("strong forcing", 50, 12, (0.1, 1.0))):
        random = np.random.default_rng(seed)
        for _ in range(count):
            n = random.uniform(1.0, 3.0)
            zeta, f = (float(np.exp(random.uniform(*np.log(ends)))) for ends in ((0.002, 0.2), forcing))
            low = random.uniform(0.25, 1.2)
            window = low, low + np.exp(random.uniform(np.log(0.05), 0.0))
            found.append({"group": group, "n": n, "zeta": zeta, "forcing": f, "window": window})
    for seed in range(20):
        random = np.random.default_rng(seed)
        z = np.append(np.sort(random.uniform(0.02, 0.98, random.integers(5, 60))), 1.0)
        n, at = random.uniform(1.0, 3.0), random.uniform(0.3, 0.8)
        added = [
            0.0 * z,
            3.0 * np.maximum(z - at, 0.0),
            -0.8 * np.maximum(z - at, 0.0),
            20.0 * np.maximum(z - 0.9, 0.0) ** 2,
        ]
        F = np.maximum.accumulate(z**n + added[seed % 4]) * (1.0 + 1e-6 * np.arange(z.size))
        k = (n * F / z * np.exp(0.2 * random.normal(size=z.size))).tolist() if seed % 5 == 0 else None
        load = (F[-1], 0.98 * F[-1], F[z.size // 2], F[-1] * random.uniform(0.1, 0.9))[seed % 4]
        zeta, f = np.exp(random.uniform(np.log([0.005, 0.01]), np.log([0.05, 0.4])))
        low = random.uniform(0.35, 1.2)
        case = {"group": "kinks", "z": z.tolist(), "F": F.tolist(), "k": k, "load": load, "zeta": zeta, "forcing": f}
        found.append({**case, "window": (low, low + random.uniform(0.2, 1.0))})
    for seed in range(20):
        random, z = np.random.default_rng(100 + seed), np.linspace(0.02, 2.0, 100)
        ratio, at, n = np.exp(random.uniform(np.log(10), np.log(300))), random.uniform(1.05, 1.6), random.uniform(1, 2)
        soft = 5.0 * np.maximum(z - at, 0.0) - 0.5 * np.maximum(z - 0.6, 0.0) * n * 0.6 ** (n - 1)
        F = z**n + (soft if seed % 2 else ratio * np.maximum(z - at, 0.0))
        F = np.maximum.accumulate(F) * (1.0 + 1e-6 * np.arange(z.size))
        zeta, f = np.exp(random.uniform(np.log([0.005, 0.01]), np.log([0.05, 0.3])))
        low = random.uniform(0.4, 1.1)
        case = {"group": "stops", "z": z.tolist(), "F": F.tolist(), "k": None, "load": np.interp(1.0, z, F)}
        found.append({**case, "zeta": zeta, "forcing": f, "window": (low, low + random.uniform(0.2, 1.0))})
    return [{key: float(x) if isinstance(x, np.floating) else x for key, x in case.items()} for case in found]


def solve(case: Case) -> Case:
    """Orbits, events and CPU seconds of a case, by this version or by version 1.0."""
    try:
        from asperity.vibration import ContactOscillator, CurveLaw, PowerLaw

        more: dict[str, Any] = {}
    except ImportError:  # version 1.0
        from asperity.dynamics import ContactOscillator, PowerLaw  # type: ignore[no-redef,import-untyped]
        from asperity.dynamics import TableLaw as CurveLaw  # type: ignore[no-redef]

        more = {"subharmonics": False}
    warnings.simplefilter("ignore")
    law = PowerLaw(case["n"]) if "n" in case else CurveLaw(np.array(case["z"]), np.array(case["F"]), k=case["k"])
    oscillator = ContactOscillator(law, load=case.get("load"), zeta=case["zeta"])
    low, high = case["window"]
    begin = time.process_time()
    response = oscillator.response(case["forcing"], (low, high), **more)
    seconds = time.process_time() - begin
    margin = 0.01 * (high - low)
    orbits = []
    for omega in np.linspace(low + margin, high - margin, FREQUENCIES):
        orbits.append([
            (s.u_max, s.u_min, bool(s.stable), getattr(s, "kind", "main")) for s in response.at(float(omega))
        ])  # fmt: skip
    events = [(e.kind, float(e.Omega), response.branches[e.branch].kind if more else "main") for e in response.events]
    said = any("extrapolated" not in note for note in response.notes)
    return {"seconds": seconds, "orbits": orbits, "events": events, "said": said}


def differences(old: Case, new: Case) -> list[str]:
    """What differs; orbits and events that version 1.0 counts as detached may belong to the branch here."""
    found = []
    for i, (a, b) in enumerate(zip(old["orbits"], new["orbits"], strict=True)):
        both = sorted(s for s in a if s[3] == "main"), sorted(a)
        near = [x for x in both if len(x) == len(b)]
        if not near:
            found.append(f"{len(b)} orbits for {len(both[0])} at frequency {i}")
            continue
        for s, t in zip(near[0], sorted(b), strict=True):
            if abs(s[0] - t[0]) > SAME * 0.5 * (s[0] - s[1]):
                found.append(f"u_max {t[0]:.6g} for {s[0]:.6g} at frequency {i}")
            if s[2] != t[2]:
                found.append(f"stability at frequency {i}")
    for kind in ("fold", "grazing", "period doubling"):
        own = np.sort([e[1] for e in new["events"] if e[0] == kind])
        known = [
            np.sort([e[1] for e in old["events"] if e[0] == kind and e[2] in kinds])
            for kinds in (("main",), ("main", "detached"))
        ]
        if not any(x.size == own.size and np.all(np.abs(x - own) < SAME) for x in known):
            found.append(f"{kind} at {own.round(5).tolist()} for {known[0].round(5).tolist()}")
    return found


def decision(python: str) -> None:
    """Compare with version 1.0, print the differences and the table."""
    listed = cases()
    run = subprocess.run(
        [python, __file__, "solve"], input=json.dumps(listed), capture_output=True, text=True, check=True
    )
    table: dict[str, list[float]] = defaultdict(lambda: [0, 0, 0, 0.0, 0.0])
    for case, old in zip(listed, json.loads(run.stdout), strict=True):
        try:
            new = solve(case)
            unlike = differences(old, new)
        except Exception as error:
            new, unlike = {"said": True, "seconds": 0.0}, [f"{type(error).__name__}: {error}"]
        row = table[case["group"]]
        row[0] += 1
        row[1] += not unlike
        row[2] += bool(unlike) and new["said"]
        row[3] += old["seconds"]
        row[4] += new["seconds"]
        if unlike:
            about = {k: case.get(k) for k in ("group", "n", "zeta", "forcing", "window")}
            print(f"{about}: {'; '.join(unlike[:4])}{' (said)' if new['said'] else ''}", flush=True)
    print("| windows of | number | same | different and said | shooting [CPU s] | collocation [CPU s] |")
    print("|---|---|---|---|---|---|")
    for group, (*counts, before, after) in table.items():
        print(f"| {group} | {' | '.join(f'{x:.0f}' for x in counts)} | {before:.1f} | {after:.1f} |")


Result = tuple[str, str, float, float, float, int, str]  # method, setting, seconds, two errors, points, stability


def timed(function: Callable[[], Any], repeat: int) -> tuple[float, Any]:
    """Least CPU seconds of `repeat` runs after a first one, and the last result."""
    out = function()
    best = np.inf
    for _ in range(repeat):
        begin = time.process_time()
        out = function()
        best = min(best, time.process_time() - begin)
    return best, out


def errors(reference: Any, omega: np.ndarray, u_max: np.ndarray) -> tuple[float, float]:
    """Largest and median relative error of amplitudes."""
    folds = [e.Omega for e in reference["fold"]]
    found = []
    for w, u in zip(omega, u_max, strict=True):
        if WINDOW[0] <= w <= WINDOW[1] and min(abs(w - f) for f in folds) >= 1e-3:
            found.append(min(abs(s.u_max - u) / s.u_max for s in reference.at(float(w))))
    return float(np.max(found)), float(np.median(found))


def ours(reference: Any, oscillator: Any) -> list[Result]:
    """The response of this package at several tolerances."""
    rows = []
    for tol in (1e-4, 1e-5, 1e-7):
        seconds, r = timed(partial(oscillator.response, FORCING, WINDOW, tol=tol), 5)
        omega, u_max = (np.concatenate([getattr(p, name) for p in r.pieces]) for name in ("Omega", "u_max"))
        rows.append(("asperity", f"tol {tol:.0e}", seconds, *errors(reference, omega, u_max), omega.size, "yes"))
    return rows


def peer(reference: Any) -> list[Result]:
    """pyHarm-os with the contact as a plug-in element, alternating frequency-time with 16 samples a harmonic."""
    example = runpy.run_path(str(Path(__file__).parent.parent / "examples" / "harmonic_balance.py"))

    def spring(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        s = np.maximum(1.0 + u, 0.0)
        return (s**N - 1.0) / N, s ** (N - 1.0)

    rows = []
    for harmonics, step in ((5, 0.1), (10, 0.1), (14, 0.1), (20, 0.1), (40, 0.05)):
        compute = example["pyharm_response"](spring, ZETA, FORCING, WINDOW, harmonics, step)
        seconds, (omega, coefficients) = timed(compute, 5)
        if omega.min() > WINDOW[0] + 1e-3:
            print(f"pyHarm-os with {harmonics} harmonics stops at Omega = {omega[-1]:.3f}")
        error = errors(reference, omega, example["largest"](coefficients))
        rows.append(("pyHarm-os", f"{harmonics} harmonics, step {step:g}", seconds, *error, len(omega), "no"))
    return rows


def speed() -> None:
    """Run all methods and print the table."""
    from asperity.vibration import ContactOscillator, PowerLaw

    oscillator = ContactOscillator(PowerLaw(N), zeta=ZETA)
    reference = oscillator.response(FORCING, WINDOW, tol=1e-8)
    print("| method | setting | CPU s | largest error | median error | points | stability |")
    print("|---|---|---|---|---|---|---|")
    for method, setting, seconds, worst, median, points, stability in [*ours(reference, oscillator), *peer(reference)]:
        print(f"| {method} | {setting} | {seconds:.3f} | {worst:.1e} | {median:.1e} | {points} | {stability} |")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["speed"]:
            speed()
        case ["decision", python]:
            decision(python)
        case ["solve"]:
            json.dump([solve(one) for one in json.load(sys.stdin)], sys.stdout)
        case _:
            sys.exit(__doc__)
