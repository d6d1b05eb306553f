"""Arguments, options and output that the commands share."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import click

from asperity.runtime.progress import world_rank

if TYPE_CHECKING:
    from asperity.case import Case

case_file = click.argument("case_file", metavar="CASE.toml")
run_folder = click.argument("folder", metavar="OUT", type=click.Path(exists=True, file_okay=False))
overrides = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="SECTION.KEY=VALUE",
    help="Replace a key of the case file; an empty value removes it. Repeatable.",
)
ranks = click.option(
    "--ranks", type=click.IntRange(min=1), default=1, show_default=True, help="Ranks that share the work."
)


class _Name(click.ParamType):
    """Name of a file or folder."""

    name = "text"

    def convert(self, value: str, parameter: click.Parameter | None, context: click.Context | None) -> str:
        """The name, unless it is empty."""
        return value if value.strip() else self.fail("the name is empty; leave the option out, or give a name")


def output(metavar: str, help: str) -> Callable[..., Any]:
    """Option -o of a command."""
    return click.option("-o", "--output", metavar=metavar, type=_Name(), help=help)


def _tolerances(context: click.Context, parameter: click.Parameter, texts: tuple[str, ...]) -> dict[str, float] | None:
    pairs = [text.partition("=") for text in texts]
    try:
        return {name.strip(): float(value) for name, _, value in pairs} or None
    except ValueError:
        raise click.BadParameter(f"{' '.join(texts)}: write COLUMN=VALUE, for example P_star=1e-6") from None


tolerances = click.option(
    "--rtol",
    "tolerances",
    multiple=True,
    metavar="COLUMN=VALUE",
    callback=_tolerances,
    help="Compare this column to this relative tolerance; replaces the defaults. Repeatable.",
)


def serial(function: Callable[..., Any]) -> Callable[..., Any]:
    """Run a command on the first rank only."""

    @functools.wraps(function)
    def on_root(*args: Any, **kwargs: Any) -> Any:
        return function(*args, **kwargs) if world_rank() == 0 else 0

    return on_root


def case_and_ranks(function: Callable[[str, Case, int], int | None]) -> Callable[..., Any]:
    """Arguments of a command that reads a case and the number of ranks it would use; on the first rank only."""

    @case_file
    @ranks
    @overrides
    @serial
    @functools.wraps(function)
    def command(case_file: str, ranks: int, overrides: tuple[str, ...]) -> int | None:
        from asperity.case import Case

        return function(case_file, Case.load(case_file, overrides), ranks)

    return command


def say(text: str = "") -> None:
    """Print a line on the first rank."""
    if world_rank() == 0:
        click.echo(text)


def table(title: str, rows: Iterable[tuple[str, ...]], header: tuple[str, ...] = ("", "")) -> None:
    """Print a table; all columns but the first are right-aligned."""
    from rich.console import Console
    from rich.table import Table

    grid = Table(title=title, title_justify="left", show_header=any(header))
    for i, name in enumerate(header):
        grid.add_column(name, justify="right" if i else "left", overflow="fold")
    for row in rows:
        grid.add_row(*row)
    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console.width = 200  # a file or a pipe has no width to fold to
    console.print(grid)
