"""`asperity dynamics`: vibration of a mass on a computed, measured or assumed force law."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from asperity.cli import options
from asperity.errors import InputError
from asperity.units import plus_minus, quantity

if TYPE_CHECKING:
    from asperity.vibration import Dynamics, DynamicsSettings, FrequencyResponse

SECTIONS = ("dynamics", "joint", "slip", "units")  # of which --set takes keys
TANGENTIAL = ("dynamics.preload", "dynamics.gravity", "dynamics.forcing", "dynamics.zeta")  # the others do not matter


@click.command()
@click.argument("source", required=False, metavar="[OUT|CURVE.csv]")
@click.option("--power-law", "exponent", type=float, metavar="N", help="P* = k (delta*)^N instead.")
@click.option("--k-fit", type=float, metavar="K", help="k of the power law; else 1.")
@click.option("--direction", type=click.Choice(("normal", "tangential")), default="normal",
              metavar="HOW", help="normal, or tangential: by the slip of OUT.")  # fmt: skip
@options.output("DIR", "Folder for tables, thresholds.json and figures.")
@options.as_json
@options.overrides
def dynamics(
    source: str | None, exponent: float | None, k_fit: float | None, output: str | None, as_json: bool,
    direction: str, overrides: tuple[str, ...],
) -> None:  # fmt: skip
    """Compute the vibration of a mass on a contact.

    The law is that of a run, a table of delta and force, or a power law. --set takes the keys of [dynamics], [joint]
    and [slip] in a case file, as --set dynamics.zeta=0.02 or --set joint.mass=5; the others are those of the case of
    OUT.
    """
    from asperity.case.tables import make, override
    from asperity.model.dynamics import DynamicsSettings, case_beside
    from asperity.vibration import PowerLaw, run_dynamics

    if (source is None) == (exponent is None):
        raise InputError("give either a run directory or curve, or --power-law N")
    if source is not None and k_fit is not None:
        raise InputError("--k-fit is for --power-law: leave it out")
    case = case_beside(source)
    changed = [override(case, text) for text in overrides]
    tangential = direction == "tangential"
    for key in changed:
        section = key.partition(".")[0]
        if section not in SECTIONS:
            raise InputError(f"--set {key}: the vibration takes keys of [dynamics], [joint] and [slip], and units")
        if key == "dynamics.law" and source is None:
            raise InputError(f"--set {key} is for a curve: leave it out")
        if tangential and section == "dynamics" and key not in TANGENTIAL:
            raise InputError(f"--set {key} is for the normal direction: leave it out")
        if not tangential and section == "slip":
            raise InputError(f"--set {key} is for --direction tangential: leave it out")
    for section in SECTIONS[:3]:
        if section in case:
            make(section, case[section])
    settings = DynamicsSettings.of_case(case)
    if tangential:
        if source is None:
            raise InputError("--direction tangential needs the folder of a run with [slip]")
        _tangential(source, case, settings, changed, output, as_json)
        return
    law = PowerLaw(exponent, 1.0 if k_fit is None else k_fit) if exponent is not None else source
    result = run_dynamics(law, settings, out_dir=output)
    if output:
        from asperity.plot import plot_dynamics

        plot_dynamics(output)
    if as_json:
        options.print_json(result.to_dict())
        return
    _show(result)
    if output:
        options.say(f"written to {Path(output)}")


def _tangential(
    source: str, case: dict[str, Any], settings: DynamicsSettings, changed: list[str], output: str | None, as_json: bool
) -> None:
    from asperity.output.results import Results
    from asperity.slip.tangential import tangential_vibration

    curve = Results.read(source).curve
    # those of the case are for the normal direction
    zeta, *more = settings.zeta if "dynamics.zeta" in changed else (0.0,)
    forcing = settings.forcing if "dynamics.forcing" in changed else (0.01,)
    if more or any(isinstance(value, str) for value in forcing):
        raise InputError(
            "--direction tangential takes one dynamics.zeta, and each dynamics.forcing over the friction limit"
        )
    found = tangential_vibration(case, curve, settings, forcing, zeta)
    if output:
        from asperity.plot.style import save_in
        from asperity.plot.vibration import slip_response

        found.write(output)
        save_in(Path(output), "slip_response", slip_response(found))
    if as_json:
        options.print_json(found.to_dict())
        return
    section, si = found.to_dict(), found.units == "SI"
    for line in section["in_words"]:
        options.say(line)
    for peak in section["peaks"]:
        f, a = quantity(peak["f"], "Hz" if si else ""), quantity(peak["amplitude"], "m" if si else "")
        options.say(f"Force of {peak['force']:g} of the friction limit: peak {a} at {f}")
    for note in section["notes"]:
        options.say(f"note: {note}")
    if output:
        options.say(f"written to {Path(output)}")


# attribute of Thresholds -> what it is
_ROWS = {
    "n_loc": "local exponent n",
    "kappa": "backbone curvature kappa",
    "softening": "at small amplitude",
    "u_max": "largest free amplitude in contact",
    "omega_loss": "omega/omega_s there",
    "contact_loss": "F^ at the onset of contact loss",
    "hysteresis": "F^ at the onset of hysteresis",
    "period_doubling": "F^ at the onset of period doubling",
}


def _show(result: Dynamics) -> None:
    from asperity.output.verdict import headline, jump_rows
    from asperity.vibration.response import OTHERS

    first, onsets, units = result.first, result.thresholds, "" if result.settings.units == "other" else "SI"
    about = f"{first.law.describe()}, zeta = {first.zeta:g} ({first.damping})"
    rows = [(text, *(_text(getattr(one, name)) for one in onsets.values())) for name, text in _ROWS.items()]
    if result.numbers.mass == result.numbers.mass:
        omegas = (f"{oscillator.omega_s:.5g}" for oscillator in result.oscillators.values())
        by = "the mass of the joint" if result.gravity is None else f"gravity = {result.gravity:g}"
        rows.insert(0, (f"omega_s{' in rad/s' if units else ''} with {by}", *omegas))
    for responses in zip(*result.responses.values(), strict=True):
        setting = responses[0].equation
        of_load = f", F/W = {setting.n_loc * setting.F_hat:g}"
        name = setting.amplitude + (of_load if setting.excitation == "force" else "")
        if len(result.settings.zeta) > 1:
            name += f", zeta = {setting.zeta:g}"
        rows.append((name, *(_peak(one) for one in responses)))
        if setting.excitation != "force":
            ratios = (max((r["transmissibility"], r["Omega"]) for r in one.rows()) for one in responses)
            rows.append(("  transmissibility", *("at most {:.4g} at {:.4g}".format(*ratio) for ratio in ratios)))
    options.table(about, rows, ("", *onsets))
    if (choice := result.choice) is not None:
        options.say(f"law of the curve at the preload {choice.load:.5g}: {choice.name}, {choice.reason}")
    if jumps := jump_rows(result.jumps(), *(("N", "Hz", "m") if units else ("", "", ""))):
        header = ("law", "force", "zeta", "sweep", "frequency", "amplitude", "after")
        options.table("jumps of slow sweeps", jumps, header)
    for note in result.notes:
        options.say(f"note: {note}")
    for shape, path in result.motions.items():
        top, low = float(path.u.max()), float(path.u.min())
        lost = f"{len(path.flight)} flights" if len(path.flight) else "contact is kept"
        options.say(f"{shape} from rest, {path.tau[-1]:.5g}/omega_s: u from {low:.4g} to {top:.4g}, {lost}")
    numbers = result.numbers.to_dict()
    if numbers.get("k_n_with_block"):
        for line in headline(numbers, None, result.settings.units, first.load):
            options.say(line)
    options.say(OTHERS)
    options.say(result.numbers.sentence(units))


def _peak(one: FrequencyResponse) -> str:
    """Peak of a response with its bars, or the greatest amplitude in the window."""
    if not one.has_peak:
        return f"no peak inside: {one.peak[1]:.4g} at the end {one.peak[0]:.4g}"
    omega_bar, bar = one.bars[0]
    return f"peak {plus_minus(one.peak[1], bar)} at {plus_minus(one.peak[0], omega_bar)}"


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.5g}" if isinstance(value, float) else str(value)
