"""Run a scene as a user would, and judge the result."""

from __future__ import annotations

import json
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from scenes import BASE, Keys, L, Map, Scene, heights

from asperity.case import Case
from asperity.case.case_file import identity
from asperity.curve import Curve
from asperity.errors import CheckError, ConvergenceError, InputError
from asperity.job.run_case import run
from asperity.quasistatic.checkpoint import Checkpoint
from asperity.runtime.run_folder import CHECKPOINT, CURVE, SUMMARY


@dataclass
class Outcome:
    """Result of a scene and its comparisons.

    Attributes:
        curve: None after a refusal
        ends: "done", "refused" (exit code 2), "stopped" (3), "wrong" (3, a balance is violated), or "crashed" (any
            other error)
        reason: message of the refusal or stop, or the warning that the contact is not resolved
        summary: contents of summary.json; empty after a refusal
        faults: deviations from the expected result; empty when the scene passes
    """

    curve: Curve | None = None
    ends: str = "done"
    reason: str = ""
    summary: Mapping[str, Any] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)


def run_scene(scene: Scene) -> Outcome:
    """Run a scene and its twin in a temporary folder and judge them."""
    with tempfile.TemporaryDirectory(prefix="asperity-") as place, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        one = _run(scene, scene.keys, scene.map, Path(place) / "scene")
        if scene.claim is not None and one.curve is not None and (said := scene.claim(one.curve)):
            one.faults.append(said)
        if scene.twin is not None and one.curve is not None:
            twin = _run(scene, {**scene.keys, **scene.twin.keys}, scene.twin.map or scene.map, Path(place) / "twin")
            holds, text = _compare(scene, one, twin)
            one.faults[:0] = [] if holds else [text]
    if one.ends != scene.ends or scene.reason not in one.reason:
        one.faults.append(f"expected: {scene.ends} {scene.reason}".strip())
    return one


def _run(scene: Scene, keys: Keys, of: Map | None, folder: Path) -> Outcome:
    """Run the case of a scene in a new folder."""
    folder.mkdir()
    if of is not None:
        np.save(folder / "map.npy", L * heights(of))
    out, done = folder / "out", Outcome()
    try:
        case = _case(scene, keys, folder)
        run(case, out, comm=MPI.COMM_SELF)
    except InputError as error:
        return Outcome(ends="refused", reason=str(error).replace(f"{folder}/", ""))
    except ConvergenceError as error:
        done.ends, done.reason = "wrong" if isinstance(error, CheckError) else "stopped", str(error)
    except Exception as error:  # reported as "crashed"; the other scenes run
        return Outcome(ends="crashed", reason=f"{type(error).__name__}: {error}")
    if not (out / CURVE).exists():  # stopped before the first step
        return done
    done.curve = Curve.read(out / CURVE)
    done.summary = json.loads((out / SUMMARY).read_text(encoding="utf-8"))
    done.reason = done.reason or done.summary["unresolved"]
    if case.accuracy.tolerance is None and case.material.kinematics != "auto":  # these have one for each load path
        saved = Checkpoint(out / CHECKPOINT, identity(case), MPI.COMM_SELF).load()
        if saved is None or len(saved.meta["rows"]) != len(done.curve):
            done.faults.append("the checkpoint does not hold the steps of the curve")
    return done


def _case(scene: Scene, keys: Keys, folder: Path) -> Case:
    tables: dict[str, Any] = {}
    for name, value in {**BASE, **keys}.items():
        section, _, key = name.rpartition(".")
        (tables.setdefault(section, {}) if section else tables)[key] = value
    case = Case.from_dict(tables, folder=folder)
    surface = case.surface
    if scene.depth is not None:
        tables["loading"]["delta_max"] = scene.depth * (surface.maximum()[2] - surface.mean())
    return Case.from_dict(tables, folder=folder)


def _compare(scene: Scene, one: Outcome, other: Outcome) -> tuple[bool, str]:
    """Compare two curves at the common approaches of the first loading, and the residual indentations.

    Returns:
        whether the difference is within the tolerance of the twin, and a sentence with the difference
    """
    assert scene.twin is not None and one.curve is not None
    if other.curve is None:
        return False, f"the twin: {other.ends} ({other.reason})"
    a, b = one.curve.loading(), other.curve.loading()
    i, j = np.nonzero(np.isclose(a.delta_star[:, None], b.delta_star, rtol=1e-9, atol=0.0))
    found = [np.max(np.abs(a.P_star[i] - b.P_star[j])) / np.max(b.P_star)] if len(i) else [np.inf]
    if one.curve.branch[-1] == "unload" and other.curve.branch[-1] == "unload":
        found.append(abs(one.curve.delta_star[-1] - other.curve.delta_star[-1]) / np.max(b.delta_star))
    difference = float(max(found))
    return difference <= scene.twin.tolerance, f"the twin differs by {difference:.1e}"
