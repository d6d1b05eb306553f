"""Run the hard cases and print a table: `./run python3 tests/hard/run.py [OPTIONS] [NAME]...`."""

from __future__ import annotations

import sys
from fnmatch import fnmatchcase
from time import process_time

import click
from scene_definition import BASE, Scene
from scene_outcome import Outcome, run_scene
from scenes import SCENES

from asperity.cli import options

WORDS = ("scene", "parameters", "ends", "reason, comparisons")
FIGURES = (
    "balance", "dissipation", "tension", "penetration", "energy", "steps", "Newton a step", "short", "LU", "cuts",
    "CPU s", "pass",
)  # fmt: skip

CHAIN = ("shortened", "direct", "cutbacks")


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("names", metavar="[NAME]...", nargs=-1)
@click.option("--fast", is_flag=True, help="Only the scenes of the short suite.")
@click.option("--markdown", is_flag=True, help="Print a Markdown table.")
@options.serial
def command(names: tuple[str, ...], fast: bool, markdown: bool) -> None:
    """Run the hard cases: each must end as expected, satisfy its balances, and agree with its comparisons.

    NAME: a scene or a pattern, for example "units*"; all without one. Columns: difference of the force on the flat
    and the reaction of the base over the force; least dissipation of a step (E L^3); suction over pressure;
    penetration over L; violation of the energy bounds of a step. Exit code 0 if all pass, else 3.
    """
    start = process_time()
    outcomes = []
    for scene in select(names, fast):
        outcome = run_scene(scene)
        outcomes.append(outcome)
        words = "; ".join(filter(None, [outcome.ends, outcome.reason, *outcome.notes]))
        faults = f" FAILED: {'; '.join(outcome.faults)}" if outcome.faults else ""
        click.echo(f"[{process_time() - start:5.0f} s] {scene.name}: {words}{faults}", err=True)
    if markdown:
        titles = (*WORDS, *FIGURES)
        for line in (titles, ("---",) * len(titles), *((*_words(o), *_figures(o)) for o in outcomes)):
            options.say("| " + " | ".join(line) + " |")
    else:
        header = (WORDS[0], WORDS[2], *FIGURES)
        options.table("Hard cases", ((o.scene.name, o.ends, *_figures(o)) for o in outcomes), header)
    failed = [o.scene.name for o in outcomes if o.faults]
    if failed:
        click.echo(f"error: {len(failed)} of {len(outcomes)} scenes failed ({', '.join(failed)})", err=True)
        sys.exit(3)


def select(names: tuple[str, ...], fast: bool) -> list[Scene]:
    """Scenes that match one of the names or patterns, all when there is none; only those of the short suite if fast.

    Raises:
        click.BadParameter: no scene matches a name
    """
    for name in names:
        if not any(fnmatchcase(scene.name, name) for scene in SCENES):
            groups = ", ".join(dict.fromkeys(scene.group for scene in SCENES))
            raise click.BadParameter(f'no scene is named "{name}"; scenes begin with {groups}: give a name or "GROUP*"')
    return [
        scene
        for scene in SCENES
        if (scene.fast or not fast) and any(fnmatchcase(scene.name, name) for name in names or ("*",))
    ]


def _words(outcome: Outcome) -> tuple[str, ...]:
    why = "; ".join(filter(None, [outcome.reason, *outcome.notes]))
    return outcome.scene.name, outcome.scene.about, outcome.ends, why


def _figures(outcome: Outcome) -> tuple[str, ...]:
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


if __name__ == "__main__":
    command()
