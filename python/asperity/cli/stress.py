"""`asperity stress`: the hard cases, as a table."""

from __future__ import annotations

from time import process_time
from typing import TYPE_CHECKING

import click

from asperity.cli import options
from asperity.errors import ConvergenceError

if TYPE_CHECKING:
    from asperity.stress.outcome import Outcome

WORDS = ("scene", "parameters", "ends", "reason, comparisons")
FIGURES = (
    "balance", "dissipation", "tension", "penetration", "energy", "steps", "Newton a step", "short", "LU", "cuts",
    "CPU s", "pass",
)  # fmt: skip

CHAIN = ("shortened", "direct", "cutbacks")


@click.command()
@click.argument("names", metavar="[NAME]...", nargs=-1)
@click.option("--fast", is_flag=True, help="Only the scenes of the short suite.")
@click.option("--markdown", is_flag=True, help="Print a Markdown table.")
@options.serial
def command(names: tuple[str, ...], fast: bool, markdown: bool) -> int:
    """Run the hard cases: each must end as expected, keep its balances, and agree with its comparisons.

    NAME: a scene or a pattern, for example "units*"; all without one. Columns: difference of the force on the flat
    and the reaction of the base over the force; least plastic work of a step (E L^3); suction over pressure;
    penetration over L; by how much a step left the bounds of its energy. Exit code 0 when all pass, 3 when not.
    """
    from asperity.stress import stress

    start = process_time()

    def done(outcome: Outcome) -> None:
        words = "; ".join(filter(None, [outcome.ends, outcome.reason, *outcome.notes]))
        faults = f" FAILED: {'; '.join(outcome.faults)}" if outcome.faults else ""
        click.echo(f"[{process_time() - start:5.0f} s] {outcome.scene.name}: {words}{faults}", err=True)

    outcomes = stress(names, fast=fast, on_outcome=done)
    if markdown:
        titles = (*WORDS, *FIGURES)
        for line in (titles, ("---",) * len(titles), *((*_words(o), *_figures(o)) for o in outcomes)):
            options.say("| " + " | ".join(line) + " |")
    else:
        header = (WORDS[0], WORDS[2], *FIGURES)
        options.table("Hard cases", ((o.scene.name, o.ends, *_figures(o)) for o in outcomes), header)
    failed = [o.scene.name for o in outcomes if o.faults]
    if failed:
        raise ConvergenceError(f"{len(failed)} of {len(outcomes)} scenes failed ({', '.join(failed)})")
    return 0


def _words(outcome: Outcome) -> tuple[str, ...]:
    why = "; ".join(filter(None, [outcome.reason, *outcome.notes]))
    return outcome.scene.name, outcome.scene.about, outcome.ends, why


def _figures(outcome: Outcome) -> tuple[str, ...]:
    from asperity.stress.scene import BASE

    summary = outcome.summary
    ends = f"{outcome.seconds:.1f}", "NO" if outcome.faults else "yes"
    if not summary:
        return (*("-",) * (len(FIGURES) - 2), *ends)
    checks, steps = summary["checks"], summary["steps"]
    kinds = ("force_balance", "least_dissipation", "tension", "penetration", "energy_excess")
    keys = BASE | outcome.scene.keys
    side, modulus = keys["surface.L"], keys["material.E"]
    figures = checks | {
        "penetration": checks["penetration"] / side,
        "least_dissipation": checks["least_dissipation"] / (modulus * side**3),
    }
    counts = f"{steps}", f"{summary['newton'] / max(steps, 1):.1f}", *(str(summary[kind]) for kind in CHAIN)
    return (*(f"{figures[kind]:.0e}" for kind in kinds), *counts, *ends)
