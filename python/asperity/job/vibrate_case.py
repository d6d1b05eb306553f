"""What a case computes from its curve and last state: loops about the preload, vibration, slip."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from asperity.case import Case
from asperity.curve import Curve
from asperity.curve.loops import LoopTable
from asperity.dynamics import Dynamics, DynamicsSettings, LoopDamping, run_dynamics
from asperity.dynamics.joint import Numbers
from asperity.dynamics.run import small_vibration
from asperity.errors import AsperityError, AsperityWarning, ConvergenceError, InputError, Interrupted, warn
from asperity.force_law.choice import met
from asperity.force_law.columns import CurveColumns
from asperity.force_law.damping import LOOPS as OF_LOOPS
from asperity.model.problem import Problem
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.force_loops import solve_loops
from asperity.quasistatic.slip_paths import solve_slip
from asperity.runtime.parallel import on_root, on_root_bcast
from asperity.runtime.run_folder import LOOPS
from asperity.slip import JointSlip, SlipSettings
from asperity.slip.joint_slip import slip_of_case


@dataclass
class VibratedCase:
    """What was found after the curve of a case.

    Attributes:
        sections: of summary.json
        dynamics: the vibration, when requested
        numbers: stiffness, frequency and damping of small vibration; None where there is none, or no mass
        failure: why a part is missing
        ends: whether the run ends there, without figures and report
    """

    sections: dict[str, Any] = field(default_factory=dict)
    dynamics: Dynamics | None = None
    numbers: Numbers | None = None
    failure: ConvergenceError | None = None
    ends: bool = False


def vibrate_case(
    case: Case,
    problem: Problem,
    contact: ContactResult,
    folder: Path | None,
    stage: Callable[[str], AbstractContextManager[None]],
    stop: Callable[[], str] | None = None,
) -> VibratedCase:
    """Compute what a case requests in addition to its curve; collective.

    Args:
        contact: with the curve, and the solver at the end of the load path
        folder: receives the files of loops, vibration and slip; None writes nothing
        stage: announces a part by its name, and takes its time
        stop: polled by the loops and the slip; a reason ends them
    """
    found, comm = VibratedCase(), contact.solver.solid.comm
    loops: LoopTable | None = None

    @contextmanager
    def kept(ends: bool = False) -> Iterator[None]:
        """Note an error, on all ranks: what does not need this part follows, and the run has a curve all the same."""
        try:
            yield
        except (ConvergenceError, InputError) as e:
            found.failure = e if isinstance(e, ConvergenceError) else ConvergenceError(f"{e}; the curve is kept")
            found.ends = ends or isinstance(e, Interrupted)

    if (wanted := case.loops) is not None:
        with kept(), stage("loops"):
            preload = _preload(case, contact.curve, "loops", wanted.preload)
            loops = solve_loops(
                problem, contact, preload, wanted.amplitudes, cycles=wanted.cycles, steps=wanted.steps, stop=stop
            )
            found.sections["loops"] = loops.to_dict()
            for text in loops.doubts(float(contact.curve.force.max())):
                warn(text, AsperityWarning)
            if folder is not None:
                on_root(comm, partial(loops.write, folder / LOOPS))
    if case.dynamics is None and case.joint is not None and not found.ends:
        found.numbers = on_root_bcast(comm, partial(_small_vibration, case, contact.curve))
    lacks_loops = case.loops is not None and loops is None
    if case.dynamics is not None and not found.ends and not (lacks_loops and case.dynamics.damping == OF_LOOPS):
        with kept(ends=True):
            with stage("dynamics"):  # the other ranks wait, for a process that ends with an error would end all
                found.dynamics = on_root_bcast(comm, partial(_vibration, case, contact.curve, folder, loops))
            section, numbers = found.dynamics.to_dict(), found.dynamics.numbers
            found.sections["dynamics"] = {name: section[name] for name in ("law", "load", "numbers", "laws", "notes")}
            found.numbers = numbers if math.isfinite(numbers.frequency) else None
    if case.slip is not None and not found.ends:
        with kept(), stage("slip"):
            found.sections["slip"] = _slip(case, problem, contact, folder, found.numbers, stop)
    return found


def _slip(
    case: Case, problem: Problem, contact: ContactResult, folder: Path | None, numbers: Numbers | None,
    stop: Callable[[], str] | None,
) -> dict[str, Any]:  # fmt: skip
    """Section "slip" of summary.json, and its files; the mass of the normal vibration is on the joint; collective."""
    assert case.slip is not None
    preload = _preload(case, contact.curve, "slip", case.slip.preload)
    settings = SlipSettings(**case.slip.model_dump() | {"preload": preload})
    paths = solve_slip(problem, contact, settings, stop) if settings.method == "solid" else ()

    def by_curve() -> JointSlip:
        found = slip_of_case(case.to_dict(), contact.curve, preload, paths)
        if folder is not None:
            found.write(folder)
        return found

    slip = on_root_bcast(contact.solver.solid.comm, by_curve)
    for text in slip.notes:
        warn(text, AsperityWarning)
    mass = None if numbers is None or not math.isfinite(numbers.mass) else numbers.mass
    return slip.to_dict(mass, _settings(case).factor, units=case.units)


def _preload(case: Case, curve: Curve, section: str, preload: float | None) -> float:
    """Normal force on the patch about which a section moves the flat: its own, that of the vibration, or a half.

    Raises:
        RangeError: it exceeds the greatest force of the curve
    """
    top, key, settings = float(curve.force.max()), f"{section}.preload", _settings(case)
    if preload is None and settings.preload is not None:
        preload, key = settings.preload / settings.factor, f"the preload of the {section}"
    preload = 0.5 * top if preload is None else preload
    preload, lowered = met(preload, top, CurveColumns.of(curve).bar_at(top), key)  # as the law of the vibration
    if lowered:
        warn(lowered)
    return preload


def _settings(case: Case) -> DynamicsSettings:
    return DynamicsSettings.of_case(case.to_dict())


def _small_vibration(case: Case, curve: Curve) -> Numbers | None:
    """Numbers of a joint without a vibration analysis; None where the curve does not reach its preload, or no mass."""
    try:
        numbers = small_vibration(curve, _settings(case))
    except AsperityError:
        return None
    return numbers if math.isfinite(numbers.frequency) else None


def _vibration(case: Case, curve: Curve, folder: Path | None, loops: LoopTable | None) -> Dynamics:
    """Vibration on the curve of a case."""
    settings = _settings(case)
    if settings.damping == OF_LOOPS and loops is not None:
        settings = settings.replaced(damping=LoopDamping.of(loops))
    result = run_dynamics(curve, settings, out_dir=folder)
    if result.laws is not None and result.laws.choice.note:
        warn(result.laws.choice.note, AsperityWarning)
    return result
