"""A computed joint in pyHarm, a harmonic balance program, and its response over ours: contact, then friction.

    pip install "asperity[hbm]"    # pyHarm-os
    python3 examples/harmonic_balance.py

A rough patch is pressed and unloaded, and both programs compute the response of a mass on it: along the normal with
the table of `asperity export --to csv` as an element of ours, and sideways with sliders as Jenkins elements of pyHarm.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import logging
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

import asperity as asp
from asperity.output.export import interface
from asperity.slip import SlipLaw, tangential_response
from asperity.slip.tangential import sliders

CASE: dict[str, Any] = {
    "surface": {
        "kind": "self-affine", "L": 100e-6, "H": 0.8, "rms_slope": 0.06, "lambda_roll": 50e-6, "lambda_short": 25e-6,
        "seed": 1,
    },
    "material": {"E": 200e9, "nu": 0.3, "yield_strength": 1.5e9, "tangent_modulus": 10e9},
    "mesh": {"h_contact": 14e-6},
    "loading": {"delta_max": 0.7e-6, "steps": 16, "unload": True},
    "joint": {"nominal_area": 1e-5, "preload": 250.0},
    "slip": {"friction": 0.3},
}  # fmt: skip
ZETA, FORCING, WINDOW = 0.01, 0.02, (0.85, 1.1)
PUSHED, SIDEWAYS = 0.05, (0.6, 1.1)  # force over that at which all sliders slip, and frequencies over those at rest

# Normalised force and stiffness of displacements u, both of the shape of u.
Spring = Callable[[Any], tuple[Any, Any]]


def pyharm_response(
    spring: Spring, zeta: float, forcing: float, window: tuple[float, float], harmonics: int, step: float
) -> Callable[[], tuple[Any, Any]]:
    """Return a function that computes u'' + 2 zeta u' + f(u) = F^ cos(Omega tau) with pyHarm.

    Args:
        spring: f(u) and its derivative, for arrays.
        zeta, forcing: damping ratio and F^.
        window: lowest and highest Omega; the curve begins at the highest.
        harmonics, step: number of harmonics, with 16 samples each, and longest step along the curve.

    Returns:
        The function, which returns Omega (points,) and coefficients (points, 2 harmonics + 1): the mean, then cosine
        and sine of each harmonic.
    """
    base: Any = importlib.import_module("pyHarm.Elements.NodeToNodeElements.NodeToNodeElement").NodeToNodeElement

    class Contact(base):
        """Contact to ground, by alternating frequency-time."""

        factory_keyword = "Contact"

        def __flag_update__(self) -> None:
            self.flag_nonlinear = True
            self.flag_AFT = True

        def adim(self, lc: float, wc: float) -> None:
            raise NotImplementedError

        def evalResidual(self, xg: Any, om: float) -> Any:
            self.R = spring(xg[self.indices] @ self.D["ft"])[0] @ self.D["tf"]
            return self.R

        def evalJacobian(self, xg: Any, om: float) -> Any:
            self.J = ((self.D["ft"] * spring(xg[self.indices] @ self.D["ft"])[1]) @ self.D["tf"]).T
            self.dJdom = np.zeros(len(self.indices))
            return self.J, self.dJdom

    contact = {"contact": {"type": "Contact", "connect": {"mass": [0]}, "dirs": [0]}}
    return pyharm_orbits(contact, [Contact], zeta, forcing, window, harmonics, step)


def pyharm_orbits(
    connectors: dict[str, Any], plugin: list[Any], zeta: float, forcing: float, window: tuple[float, float],
    harmonics: int, step: float,
) -> Callable[[], tuple[Any, Any]]:  # fmt: skip
    """Return a function that computes the response of a mass 1 on connectors to ground, see `pyharm_response`."""
    pyharm = importlib.import_module("pyHarm")
    logging.disable(logging.CRITICAL)
    one, none = np.eye(1), np.zeros((1, 1))
    frf = {
        "study": "frf", "puls_inf": window[0], "puls_sup": window[1], "puls_start": window[1], "sign_ds": -1,
        "ds0": 0.02, "ds_max": step, "ds_min": 1e-6, "solver": "NewtonRaphson",
        "solver_options": {"tol_residual": 1e-8, "tol_delta_x": 1e-6, "max_iter": 20},
        "predictor": "tangent", "corrector": "arc_length", "verbose": False,
    }  # fmt: skip
    drive = {"type": "CosinusForcing", "connect": {"mass": [0]}, "dirs": [0], "amp": forcing}

    def case() -> dict[str, Any]:
        return {
            "analysis": {"frf": dict(frf)},
            "system": {"type": "Base", "nh": harmonics, "nti": 16 * harmonics, "adim": {"status": False}},
            "substructures": {"mass": {"matrix": {"M": one, "C": 2 * zeta * one, "G": none, "K": none}, "ndofs": 1}},
            "connectors": {name: dict(one) for name, one in connectors.items()} | {"drive": dict(drive)},
            "plugin": plugin,
        }

    def compute() -> tuple[Any, Any]:
        with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # hints of Numba
            maestro = pyharm.Maestro(case())
            maestro.operate()
        x = np.array([s.x for s in maestro.nls["frf"].SolList if s.flag_accepted])
        return x[:, -1], x[:, :-1]

    return compute


def largest(coefficients: Any) -> Any:
    """Return the largest displacement of each orbit, from 4096 samples."""
    theta = np.linspace(0, 2 * np.pi, 4097)
    k = np.arange(1, coefficients.shape[1] // 2 + 1)
    cosines, sines = np.cos(np.outer(k, theta)), np.sin(np.outer(k, theta))
    return (coefficients[:, :1] + coefficients[:, 1::2] @ cosines + coefficients[:, 2::2] @ sines).max(axis=1)


def sideways(law: SlipLaw) -> tuple[float, float]:
    """Return pyHarm's amplitude and frequency at the resonance on sliders over ours, the latter by one harmonic."""
    stiffness, reach = sliders(law, 40)
    # lengths in units of the limit of friction over the stiffness at rest
    rest = float(stiffness.sum())
    k, f = stiffness / rest, stiffness * reach / law.limit
    jenkins = {
        f"slider{i}": {"type": "Jenkins", "connect": {"mass": [0]}, "dirs": [0], "k": k[i], "mu": 1.0, "N0": f[i]}
        for i in range(k.size)
    }
    omega, coefficients = pyharm_orbits(jenkins, [], 0.0, PUSHED, SIDEWAYS, 7, 0.02)()
    theirs = np.hypot(coefficients[:, 1], coefficients[:, 2])
    w, ours = tangential_response(law, mass=rest, force=PUSHED * law.limit)
    ours = ours * rest / law.limit
    found = float(theirs.max() / ours.max()), float(omega[theirs.argmax()] / w[ours.argmax()])
    print(f"sideways: amplitude {found[0]:.4f} and frequency {found[1]:.4f} of ours at the resonance")
    return found


def main() -> tuple[float, float, float]:
    """Return the largest relative difference of the amplitudes, without the tips of the folds, and of `sideways`."""
    if importlib.util.find_spec("pyHarm") is None:
        raise SystemExit("pyHarm is not installed: pip install 'asperity[hbm]'")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "run"
        asp.run(asp.Case.from_dict(CASE), folder)
        law = interface(folder, "unload-reload").slip
        table = np.genfromtxt(asp.export(folder, "csv", law="unload-reload"), delimiter=",", usecols=(0, 1))[1:]
    assert law is not None
    slips = sideways(law)
    load, area = CASE["joint"]["preload"], CASE["joint"]["nominal_area"]
    force = PchipInterpolator(*np.vstack([(0.0, 0.0), table * (1.0, area)]).T)  # continuous slope
    stiffness_of = force.derivative()
    z = np.geomspace(table[0, 0], table[-1, 0], 300)
    oscillator = asp.ContactOscillator(asp.CurveLaw(z, force(z)), load=load, zeta=ZETA)
    normal = oscillator  # of lengths z_s and forces z_s k_n

    def spring(u: Any) -> tuple[Any, Any]:
        z = np.maximum(normal.z_s * (1.0 + u), 0.0)
        slope = np.where(z > 0.0, stiffness_of(z), 0.0)
        return (force(z) - load) / normal.scale, slope * normal.z_s / normal.scale

    omega, coefficients = pyharm_response(spring, ZETA, FORCING, WINDOW, 40, 0.05)()
    theirs = largest(coefficients)
    ours = oscillator.response(FORCING, WINDOW)
    stiffness = normal.scale / normal.z_s
    print(f"k_n = {stiffness:.4g} N/m at {load:g} N; {len(table)} points exported, {omega.size} orbits of pyHarm")
    folds = [e.Omega for e in ours["fold"]]
    different = [
        min(abs(orbit.u_max / u - 1.0) for orbit in ours.at(float(w)))
        for w, u in zip(omega, theirs, strict=True)
        if WINDOW[0] <= w <= WINDOW[1] and min((abs(w - f) for f in folds), default=1.0) > 2e-3
    ]
    worst = float(np.max(different))
    print(
        f"peak u = {theirs.max():.4f} by pyHarm, {ours.peak[1]:.4f} by asperity; "
        f"difference {np.median(different):.1e} in the median, {worst:.1e} at most"
    )
    return worst, *slips


if __name__ == "__main__":
    main()
