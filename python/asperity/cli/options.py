"""Arguments, options and output that the commands share."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import click

from asperity.errors import InputError
from asperity.runtime.progress import world_rank
from asperity.units import LENGTHS, metres

case_file = click.argument("case_file", metavar="CASE.toml", type=click.Path())
run_folder = click.argument("folder", metavar="OUT", type=click.Path(exists=True, file_okay=False))
overrides = click.option(
    "--set", "overrides", multiple=True, metavar="SECTION.KEY=VALUE",
    help="Replace a key of the case file; an empty value removes it. Repeatable.",
)  # fmt: skip


def _ranks(text: str) -> int:
    """A number of ranks, or 0 for "auto"."""
    count = int(text) if text.isdecimal() else 0
    if not count and text != "auto":
        raise click.BadParameter(f"{text} is no number of ranks; give auto, or a number from 1")
    return count


job_ranks = click.option(
    "--ranks", metavar="N|auto", type=_ranks,
    help="Start mpirun with so many ranks, one thread each; auto: as many as there are cores.",
)  # fmt: skip


def start_ranks(ranks: int | None, quiet: bool) -> None:
    """Replace this process by the ranks that are requested, 0 for auto, unless it is one of them."""
    from asperity.runtime import launch

    size = launch.started_ranks()
    if size is None and ranks is not None:
        count = ranks or launch.available_cores()
        if count > 1:
            launch.start(click.get_current_context().find_root().obj, count)
    elif size and ranks and size != ranks and not quiet:
        say(f"--ranks {ranks} starts nothing: this MPI job has {size} ranks already")


as_json = click.option("--json", "as_json", is_flag=True, help="Print JSON.")


def print_json(data: Any) -> None:
    """Print data as JSON, on the first rank; numbers that are not finite become null, because JSON has none."""
    from pydantic_core import to_json

    say(to_json(data, indent=2, inf_nan_mode="null", fallback=lambda value: value.item()).decode())


def _name(text: str) -> str:
    if not text.strip():
        raise click.BadParameter("the name is empty; leave the option out, or give a name")
    return text


def output(metavar: str, help: str) -> Callable[..., Any]:
    """Option -o of a command."""
    return click.option("-o", "--output", metavar=metavar, type=_name, help=help)


def _tolerances(context: click.Context, parameter: click.Parameter, texts: tuple[str, ...]) -> dict[str, float] | None:
    pairs = [text.partition("=") for text in texts]
    try:
        return {name.strip(): float(value) for name, _, value in pairs} or None
    except ValueError:
        raise click.BadParameter(f"{' '.join(texts)}: write COLUMN=VALUE, for example P_star=1e-6") from None


tolerances = click.option(
    "--rtol", "tolerances", multiple=True, metavar="COLUMN=VALUE", callback=_tolerances,
    help="Relative tolerance of this column in place of its own; all others are compared as without. Repeatable.",
)  # fmt: skip


class Length(click.ParamType):
    """A length with its unit, as 31.25um, or two with a comma; a number alone is in metres, refused beside --unit."""

    name = "length"

    def __init__(self, most: int = 1) -> None:
        self.most = most

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not isinstance(value, str):
            return value
        parts, unit = value.split(","), None if ctx is None else ctx.params.get("unit")
        if len(parts) > self.most:
            self.fail(f"{value}: give a length{', or two as 1um,2um' if self.most > 1 else ''}", param, ctx)
        found = []
        for part in parts:
            try:
                length, named = metres(part)
            except ValueError:
                self.fail(f"{part} is no length; write it as 31.25um, or in metres", param, ctx)
            if unit in LENGTHS and unit != "m" and not named:
                self.fail(f"{part} has no unit beside --unit {unit}; write {part}{unit}, or {part}m", param, ctx)
            found.append(length)
        return (found[0], found[-1]) if self.most > 1 else found[0]


@contextmanager
def files_of_run(folder: str) -> Iterator[None]:
    """Refuse (InputError) files of a run that can be read but not used: damaged, edited, of another version."""
    from asperity.runtime.files import UNREADABLE, one_line

    try:
        yield
    except (OSError, MemoryError, SyntaxError):
        raise
    except UNREADABLE as error:
        if os.environ.get("ASPERITY_TRACEBACK"):
            traceback.print_exception(error)
        where = "".join(f" of {note}" for note in getattr(error, "__notes__", ()))
        raise InputError(
            f"the files in {folder} do not fit together{where} ({type(error).__name__}: {one_line(error)}): one is "
            "damaged, or of another version; run the case again with --resume or --force"
        ) from None


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
    width = None if sys.stdout.isatty() else 200  # a file or a pipe has no width to fold to
    Console(highlight=False, markup=False, force_terminal=False, width=width).print(grid)
