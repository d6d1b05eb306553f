"""The command line: `asperity COMMAND ...`, one module a command, its function named `command`.

The module `import_map` is the command `import-map`.

Exit codes: 0 done; 1 compared curves differ, or an internal error; 2 bad input; 3 not converged,
partial curve saved; 4 environment. An error is one line on stderr, from one rank.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import click

from asperity.errors import AsperityError
from asperity.runtime.parallel import Ranks
from asperity.runtime.progress import world_rank
from asperity.version import __version__


class _Commands(click.Group):
    """The modules of this package with a `command`, imported when they are used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        modules = {module.name.replace("_", "-") for module in pkgutil.iter_modules(__path__)}
        return sorted(modules - {"options"})

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in self.list_commands(ctx):
            return None
        command: click.Command = importlib.import_module(f"asperity.cli.{name.replace('-', '_')}").command
        return command


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="asperity")
def group() -> None:
    """From a rough surface to its contact force and to the vibration of a mass on it."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and leave with its exit code, the same on every rank."""
    ranks = Ranks()
    warnings.showwarning = _show_once()
    sys.exit(ranks.leave(*_outcome(arguments)))


def _outcome(arguments: Sequence[str] | None) -> tuple[int, str]:
    """Exit code and message of a command."""
    try:
        words = sys.argv[1:] if arguments is None else list(arguments)
        return group.main(words, prog_name="asperity", standalone_mode=False, obj=words) or 0, ""
    except click.UsageError as error:
        usage = f" ({error.ctx.command_path} --help shows the usage)" if error.ctx else ""
        return 2, error.format_message() + usage
    except click.ClickException as error:
        return error.exit_code, error.format_message()
    except (click.Abort, KeyboardInterrupt):
        return 130, "stopped"
    except AsperityError as error:
        return error.exit_code, str(error)
    except ModuleNotFoundError as error:
        if (error.name or "asperity").startswith("asperity"):
            raise
        return 4, f"the environment lacks the Python package {error.name}: install asperity[solve] or use ./run"
    except MemoryError:
        return 3, "out of memory; use fewer dofs (larger mesh.h_contact), more ranks, or solver.linear = auto"
    except OSError as error:
        where = f" {error.filename}" if error.filename else ""
        return 4, f"cannot read or write{where}: {error.strerror or error}"


def _show_once() -> Callable[..., None]:
    """Printer of warnings, each once and from the first rank."""
    shown: set[str] = set()

    def show(message: Warning | str, *_: Any) -> None:
        if world_rank() == 0 and str(message) not in shown:
            shown.add(str(message))
            click.echo(f"warning: {message}", err=True)

    return show
