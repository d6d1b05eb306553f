"""Files of the package that three calls run code of: how much there is to read to follow them, docs/architecture.md.

    ./run python3 benchmarks/walks.py

The curve is that of Hertz, the tolerance that of a sphere. What only the imports run is not counted.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from inspect import CO_OPTIMIZED
from pathlib import Path
from types import FrameType

import numpy as np

import asperity as asp
from asperity.dynamics import DynamicsSettings
from asperity.dynamics.run import small_vibration
from asperity.slip import SlipSettings, slip_of_curve

PACKAGE = str(Path(asp.__file__).parent)


def walk(call: Callable[[], object]) -> int:
    """Number of files."""
    files = set()

    def enter(frame: FrameType, *_: object) -> None:
        if frame.f_code.co_flags & CO_OPTIMIZED and frame.f_code.co_filename.startswith(PACKAGE):
            files.add(frame.f_code.co_filename)

    sys.setprofile(enter)
    call()
    sys.setprofile(None)
    return len(files)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    z, steel = np.linspace(0.0, 1e-8, 41), asp.Material(E=200e9, nu=0.3)
    curve = {"delta": z, "force": 2e9 * z**1.5}
    sphere = asp.Surface.from_spec("sphere", L=1.0, radius=10.0, shape="paraboloid")
    slip = SlipSettings(friction=0.3)
    print("| walk | files |\n|---|---|")
    print("| small_vibration |", walk(lambda: small_vibration(curve, DynamicsSettings())), "|")
    print("| slip_of_curve |", walk(lambda: slip_of_curve(curve, slip, steel, patch=1e-12, height=1e-6)), "|")
    print("| solve_contact |", walk(lambda: asp.solve_contact(sphere, steel, tolerance=0.05, delta_max=0.01)), "|")
