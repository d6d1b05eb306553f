"""`asperity keys`: the reference of the case file."""

from __future__ import annotations

import click

from asperity.cli import options


@click.command()
def command() -> None:
    """List every key of the case file.

    Each with its default, legal values, unit and meaning.
    """
    from asperity.case.keys import input_reference

    options.table("Case file", input_reference(), ("section", "key", "default", "legal", "unit", "meaning"))
