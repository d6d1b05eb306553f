"""`asperity keys`: the reference of the case file."""

from __future__ import annotations

import click

from asperity.cli import options

HEADER = ("section", "key", "default", "legal", "unit", "meaning")


@click.command()
@click.option("--markdown", is_flag=True, help="As a Markdown table.")
@options.serial
def command(markdown: bool) -> None:
    """List every key of the case file.

    Each with its default, legal values, unit and meaning.
    """
    from asperity.case.keys import input_reference

    rows = input_reference()
    if not markdown:
        options.table("Case file", rows, HEADER)
        return
    for row in (HEADER, ("---",) * len(HEADER), *rows):
        options.say("| " + " | ".join(row) + " |")
