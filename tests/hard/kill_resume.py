"""Kill a run at random moments and repeat its command, with --resume, until it is complete, again and again.

After each SIGKILL every file must be whole: the old content or the new one. Each completed run must have the curve of
the run that was never killed: on one rank to the last bit, on several to the tolerance of the equations, to which two
runs that nobody killed agree there. Usage: python3 tests/hard/kill_resume.py [--kills 50] [--seed 0] [--ranks 1]
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from asperity.curve import Curve
from asperity.runtime.files import read_npz

CASE = """
units = "other"
[surface]
kind = "sinusoid"
L = 1.0
amplitude = 0.05
dims = 2
[material]
E = 1.0
nu = 0.3
yield_strength = 0.005
tangent_modulus = 0.05
[mesh]
h_contact = 0.2
h_max = 0.5
[loading]
delta_max = 0.02
steps = 4
unload = true
cycles = 2
[output]
figures = true
"""
COLUMNS = ("delta", "force", "area_fraction", "max_pressure", "plastic_fraction", "max_plastic_strain")


def command(case: Path, out: Path, ranks: int) -> list[str]:
    """The command line of a run: the same for its begin and for every continuation."""
    run = [sys.executable, "-W", "ignore", "-m", "asperity", "run", str(case), "-o", str(out), "-q", "--resume"]
    return run if ranks == 1 else ["mpirun", "--oversubscribe", "--bind-to", "none", "-n", str(ranks), *run]


def run_or_kill(arguments: list[str], out: Path, steps: int = 10**9, seconds: float = 0.0) -> bool:
    """Whether a command ended before it was killed, so many seconds after its curve had so many steps."""
    process = subprocess.Popen(arguments, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    while process.poll() is None and steps_done(out) < steps:
        time.sleep(0.01)
    try:
        _, errors = process.communicate(timeout=seconds if steps < 10**9 else None)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return False
    if process.returncode != 0:
        raise SystemExit(f"a run ended with exit code {process.returncode}: {errors.decode()}")
    return True


def steps_done(out: Path) -> int:
    """Steps in the curve of a run."""
    try:
        return (out / "curve.csv").read_bytes().count(b"\n") - 1
    except FileNotFoundError:
        return 0


def check_files(out: Path) -> int:
    """Read every file of a killed run; the number of steps saved in its checkpoint."""
    readers = {
        ".csv": Curve.read,
        ".json": lambda path: json.loads(path.read_text()),
        ".toml": lambda path: tomllib.loads(path.read_text()),
        ".npz": read_npz,
        ".png": lambda path: path.stat().st_size,
        ".svg": lambda path: ElementTree.parse(path),
        ".log": whole_lines,
    }
    steps = 0
    for path in out.rglob("*"):
        if path.is_file() and not any(part.startswith(".") for part in path.relative_to(out).parts):
            content = readers[path.suffix](path)
            if path.name == "state.npz":
                steps = len(json.loads(content["meta"].tobytes())["rows"])
    return steps


def whole_lines(path: Path) -> None:
    text = path.read_text()
    assert not text or text.endswith("\n"), f"{path} ends within a line"


def difference(one: Curve, two: Curve) -> float:
    """Greatest difference of two curves over the greatest value of its column."""
    if len(one) != len(two):
        return np.inf
    pairs = [(getattr(one, name), getattr(two, name)) for name in COLUMNS]
    return max(float(np.max(np.abs(a - b)) / np.max(np.abs(a))) for a, b in pairs)


def main() -> None:
    """Kill, resume, compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ranks", type=int, default=1)
    options = parser.parse_args()
    random = np.random.default_rng(options.seed)
    with tempfile.TemporaryDirectory(prefix="asperity-") as folder:
        place = Path(folder)
        case = place / "case.toml"
        case.write_text(CASE)
        start = time.monotonic()
        run_or_kill(command(case, place / "straight", options.ranks), place / "straight")
        duration = time.monotonic() - start
        straight = Curve.read(place / "straight" / "curve.csv")
        out = place / "killed"
        killed_at: Counter[int] = Counter()
        completed, unsaved, steps, worst = 0, 0, 0, 0.0
        while sum(killed_at.values()) < options.kills or completed == 0:
            at_end = steps == len(straight) and random.random() < 0.75
            if at_end or sum(killed_at.values()) >= options.kills:
                when: dict[str, Any] = {}
            else:  # a quarter of the kills hit the start, the others come within the next steps or after the last
                next_one = 0 if random.random() < 0.25 else random.integers(steps, min(steps + 6, len(straight)) + 1)
                a_while = 6.0 / len(straight) if next_one else 0.5
                when = {"steps": next_one, "seconds": random.uniform(0.0, a_while * duration)}
            if run_or_kill(command(case, out, options.ranks), out, **when):
                worst = max(worst, difference(straight, Curve.read(out / "curve.csv")))
                shutil.rmtree(out)
                completed, steps = completed + 1, 0
                continue
            saved = check_files(out) if out.exists() else 0
            if saved < steps:
                raise SystemExit(f"a kill lost steps: {steps} were saved, {saved} are left")
            killed_at[saved] += 1
            unsaved += saved == 0
            steps = saved
        print(f"kills             {sum(killed_at.values())}, ranks {options.ranks}, straight run {duration:.1f} s")
        print(f"steps saved then  {' '.join(f'{k}:{n}' for k, n in sorted(killed_at.items()))} of {len(straight)}")
        print(f"runs completed    {completed}, started again without a saved step {unsaved}")
        print(f"half-written files 0, greatest difference of the curves {worst:.1e}")
        sys.exit(worst > (1e-10 if options.ranks == 1 else 1e-8))


if __name__ == "__main__":
    main()
