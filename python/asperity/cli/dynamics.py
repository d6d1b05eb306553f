"""`asperity dynamics`: vibration of a mass on a computed, measured or assumed force law."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from asperity.cli import options
from asperity.errors import InputError
from asperity.units import plus_minus, quantity
from asperity.vibration.checks import LAWS
from asperity.vibration.equation import DAMPING
from asperity.vibration.settings import MODELS, SHAPES, DynamicsSettings

if TYPE_CHECKING:
    from asperity.vibration import Dynamics, Joint


def amount(text: str) -> float | str:
    """A number, or a text with a unit."""
    try:
        return float(text)
    except ValueError:
        return text


@click.command()
@click.argument("source", required=False, metavar="[OUT|CURVE.csv]")
@click.option("--power-law", "exponent", type=float, metavar="N", help="P* = k (delta*)^N instead.")
@click.option("--k-fit", type=float, metavar="K", help="k of the power law; else 1.")
@click.option("--law", type=click.Choice(LAWS),
              metavar="LAW", help=f"{', '.join(LAWS)}.")  # fmt: skip
@click.option("--preload", type=float, metavar="W", help="Static force; else half of the greatest force.")
@click.option("--area", "nominal_area", type=float, metavar="A", help="Nominal area of the joint; else of the patch.")
@click.option("--pressure", type=float, metavar="P", help="Nominal pressure instead of the preload.")
@click.option("--mass", type=float, metavar="M", help="Mass that vibrates; else the preload over gravity.")
@click.option("--gravity", type=float, metavar="G", help="In the units of the curve; else 9.80665 in SI.")
@click.option("--zeta", type=float, multiple=True, metavar="Z", help="Damping ratio; repeatable; else 0.01.")
@click.option("--damping", type=click.Choice(DAMPING), metavar="WHEN", help=f"{', '.join(DAMPING)}.")
@click.option("--forcing", type=amount, multiple=True, metavar="F",
              help="F/(n W), or 3N; of the base 2um or 30m/s2; repeatable.")  # fmt: skip
@click.option(
    "--model",
    type=click.Choice(MODELS),
    multiple=True,
    metavar="MODEL",
    help=f"Restoring force: {', '.join(MODELS)}; else both.",
)
@click.option("--omega", type=amount, nargs=2, metavar="LOW HIGH",
              help="Over omega_s, or 800Hz 1.2kHz; else 0.5 1.3.")  # fmt: skip
@click.option("--direction", type=click.Choice(("normal", "tangential")), default="normal",
              metavar="HOW", help="normal, or tangential: by the slip of OUT.")  # fmt: skip
@click.option("--simulate", type=click.Choice(SHAPES), multiple=True, metavar="SHAPE",
              help=f"A motion from rest: {', '.join(SHAPES)}.")  # fmt: skip
@click.option("--pulse", type=float, metavar="T",
              help="Length of its half-sine; else half a period.")  # fmt: skip
@click.option("--span", type=float, metavar="N", help="Its length in periods; else 20.")
@options.output("DIR", "Folder for tables, thresholds.json and figures.")
@options.as_json
def dynamics(
    source: str | None, exponent: float | None, k_fit: float | None, output: str | None, as_json: bool,
    direction: str, **settings: Any,
) -> None:  # fmt: skip
    """Compute the vibration of a mass on a contact.

    The law is that of a run, a table of delta and force, or a power law. Options that are not given are those of the
    case of OUT.
    """
    from asperity.vibration import Joint, PowerLaw, run_dynamics

    if (source is None) == (exponent is None):
        raise InputError("give either a run directory or curve, or --power-law N")
    if source is not None and k_fit is not None:
        raise InputError("--k-fit is for --power-law: leave it out")
    law = PowerLaw(exponent, 1.0 if k_fit is None else k_fit) if exponent is not None else source
    given = {name: settings.pop(name) for name in ("nominal_area", "pressure", "mass")}
    if settings["preload"] is not None and given["pressure"] is not None:
        raise InputError("--preload and --pressure are both given; give one of them")
    joint = None
    if any(value is not None for value in given.values()):
        joint = (DynamicsSettings.of_source(source).joint or Joint()).replaced(given)
    settings = {name: None if value == () else value for name, value in settings.items()}
    tangential = direction == "tangential"
    if tangential and source is None:
        raise InputError("--direction tangential needs the folder of a run with [slip]")
    alien = {"law"} if source is None else set[str]()
    if tangential:
        alien = set(settings) - {"preload", "gravity", "forcing", "zeta"}
    for name in settings:
        if name in alien and settings[name] is not None:
            raise InputError(f"--{name} is for {'the normal direction' if tangential else 'a curve'}: leave it out")
    if tangential:
        _tangential(str(source), joint, settings | {"pressure": given["pressure"]}, output, as_json)
        return
    result = run_dynamics(law, joint=joint, out_dir=output, **settings)
    if output:
        from asperity.plot import plot_dynamics

        plot_dynamics(result, output)
    if as_json:
        options.print_json(result.to_dict())
        return
    _show(result)
    if output:
        options.say(f"written to {Path(output)}")


def _tangential(source: str, joint: Joint | None, settings: dict[str, Any], output: str | None, as_json: bool) -> None:
    from asperity.output.results import Results
    from asperity.slip.tangential import tangential_vibration

    results = Results.read(source)
    case, preload = dict(results.case), settings["preload"]
    if "slip" in case and (preload, settings["pressure"]) != (None, None):
        case["slip"] = {name: value for name, value in case["slip"].items() if name != "preload"}
    given = DynamicsSettings.of_case(results.case, joint).replaced(preload=preload, gravity=settings["gravity"])
    (zeta, *more), forcing = settings["zeta"] or (0.0,), settings["forcing"] or (0.01,)
    if more or any(isinstance(value, str) for value in forcing):
        raise InputError("--direction tangential takes one --zeta, and each --forcing over the friction limit")
    found = tangential_vibration(case, results.curve, given, forcing, zeta)
    if output:
        from asperity.plot.slip import response
        from asperity.plot.style import save_in

        found.write(output)
        save_in(Path(output), "slip_response", response(found))
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
    from asperity.output.verdict import jump_rows
    from asperity.vibration.response import OTHERS

    first, onsets, units = result.first, result.thresholds, "" if result.settings.units == "other" else "SI"
    about = f"{first.law.describe()}, zeta = {first.zeta:g} ({first.damping})"
    rows = [(text, *(_text(getattr(one, name)) for one in onsets.values())) for name, text in _ROWS.items()]
    if result.numbers.mass == result.numbers.mass:
        omegas = (f"{oscillator.omega_s:.5g}" for oscillator in result.oscillators.values())
        by = "the mass of the joint" if result.gravity is None else f"gravity = {result.gravity:g}"
        rows.insert(0, (f"omega_s{' in rad/s' if units else ''} with {by}", *omegas))
    for responses in zip(*result.responses.values(), strict=True):
        setting = responses[0].setting
        name = setting.amplitude + (f", F/W = {setting.F_over_mg:g}" if setting.excitation == "force" else "")
        if len(result.settings.zeta) > 1:
            name += f", zeta = {setting.zeta:g}"
        rows.append((name, *(_peak(result, one) for one in responses)))
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
        from asperity.vibration.numbers import headline

        for line in headline(numbers, None, result.settings.units, first.restoring.load):
            options.say(line)
    options.say(OTHERS)
    options.say(result.numbers.sentence(units))


def _peak(result: Dynamics, one: Any) -> str:
    """Peak of a response with its bars, or the greatest amplitude in the window."""
    if not one.has_peak:
        return f"no peak inside: {one.peak[1]:.4g} at the end {one.peak[0]:.4g}"
    exact = result.responses.get("exact", ())
    bars = result.bars[exact.index(one)][0] if result.bars and one in exact else (math.nan, math.nan)
    return f"peak {plus_minus(one.peak[1], bars[1])} at {plus_minus(one.peak[0], bars[0])}"


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.5g}" if isinstance(value, float) else str(value)
