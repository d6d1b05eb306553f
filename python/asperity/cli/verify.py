"""`asperity verify`: the verification suite, as a table."""

from __future__ import annotations

from dataclasses import asdict
from time import process_time
from typing import TYPE_CHECKING

import click

from asperity.cli import options
from asperity.errors import ConvergenceError
from asperity.verification import NAMES

if TYPE_CHECKING:
    from asperity.verification.table import Row

HEADER = ("case", "quantity", "reference", "its value", "computed", "error", "bar", "pass")


@click.command()
@click.argument("names", metavar="[NAME]...", nargs=-1, type=click.Choice(NAMES))
@click.option("--markdown", is_flag=True, help="Print a Markdown table.")
@options.as_json
@options.serial
def command(names: tuple[str, ...], markdown: bool, as_json: bool) -> int:
    """Compare the solver with reference solutions.

    The references are closed forms, tables and fits of the literature; all cases if no NAME is given. A row passes when
    its error is within its bar, the uncertainty of the meshes and of the reference. Errors and bars are relative. Exit
    code 0 when all rows pass, 3 when not.
    """
    from asperity.verification import verify

    start = process_time()

    def done(name: str, rows: list[Row]) -> None:
        passed = sum(row.passed for row in rows)
        click.echo(f"{name}: {passed} of {len(rows)} within the bar, {process_time() - start:.0f} s so far", err=True)

    rows = verify(names, done)
    if as_json:
        derived = ("error", "bar", "passed")
        options.print_json([asdict(row) | {name: getattr(row, name) for name in derived} for row in rows])
    elif markdown:
        for line in (HEADER, ("---",) * len(HEADER), *map(_texts, rows)):
            options.say("| " + " | ".join(line) + " |")
    else:
        options.table("Verification", map(_texts, rows), HEADER)
    missed = [f"{row.case}: {row.quantity}" for row in rows if not row.passed]
    if missed:
        raise ConvergenceError(f"{len(missed)} of {len(rows)} rows outside their bar ({'; '.join(missed)})")
    return 0


def _texts(row: Row) -> tuple[str, ...]:
    return (
        row.case, row.quantity, row.source, f"{row.reference:.5g}", f"{row.value:.5g}", f"{row.error:.1e}",
        f"{row.bar:.1e}", "yes" if row.passed else "NO",
    )  # fmt: skip
