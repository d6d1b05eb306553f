"""The command line: `asperity COMMAND ...`.

Exit codes: 0 done; 1 compared curves differ; 2 bad input; 3 not converged, partial curve saved; 4 environment; 70 an
internal error; 130 stopped, 141 the reader of the output has gone. An error is one line on stderr, from one rank.
ASPERITY_TRACEBACK=1 shows where an internal error is.
"""

from __future__ import annotations

import importlib
import io
import os
import sys
import traceback
import warnings
from collections.abc import Sequence

import click

from asperity.errors import AsperityError, AsperityWarning
from asperity.runtime.launch import ensure_home
from asperity.runtime.parallel import INTERNAL, Ranks
from asperity.runtime.progress import tell, world_rank
from asperity.version import __version__

#: Module of each command, which is imported when it is used.
COMMANDS = {
    "run": "run", "check": "check", "init": "init", "import-map": "import_map", "dynamics": "dynamics",
    "report": "results", "export": "results", "compare": "results",
}  # fmt: skip


class _Commands(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and not args[0].startswith("-") and args[0] not in COMMANDS:
            from asperity.runtime.display import nearest

            ctx.fail(f"there is no command {args[0]!r}{nearest(args[0], COMMANDS)}")
        return super().resolve_command(ctx, args)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        command: click.Command = getattr(
            importlib.import_module(f"asperity.cli.{COMMANDS[name]}"), name.replace("-", "_")
        )
        return command


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="asperity")
def group() -> None:
    """From a rough surface to its contact force and to the vibration of a mass on it."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and leave with its exit code, the same on every rank."""
    ensure_home()
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # it was closed
            setattr(sys, name, open(os.devnull, "w"))
    ranks = Ranks()
    # Warnings of this package are shown once, whatever the environment says, and those of others are not for users.
    warnings.simplefilter("ignore")
    warnings.simplefilter("ignore" if world_rank() else "once", AsperityWarning)
    warnings.onceregistry.clear()  # type: ignore[attr-defined]
    warnings.showwarning = lambda message, *_, **__: tell(f"warning: {message}", sys.stderr)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that lacks a character
    sys.exit(ranks.leave(*_outcome(arguments)))


def _outcome(arguments: Sequence[str] | None) -> tuple[int, str]:
    """Exit code and message of a command."""
    try:
        words = sys.argv[1:] if arguments is None else list(arguments)
        if world_rank() and words[:1] != ["run"]:
            return 0, ""  # the others are for the first rank
        for word in words:
            if not word.isascii() and any("\ud800" <= c <= "\udfff" for c in word):  # bytes that Python cannot decode
                return 2, f"{word.encode(errors='replace').decode()}: an argument that is not UTF-8; rename the file"
        return group.main(words, prog_name="asperity", standalone_mode=False, obj=words) or 0, ""
    except click.UsageError as error:
        usage = f" ({error.ctx.command_path} --help shows the usage)" if error.ctx else ""
        return 2, error.format_message() + usage
    except click.ClickException as error:
        return error.exit_code, error.format_message()
    except (click.Abort, KeyboardInterrupt):
        return 130, "stopped"
    except SystemExit as left:  # of click: 1 where the reader of the output has gone, 0 after a completion of the shell
        return 141 if left.code else 0, ""
    except AsperityError as error:
        return error.exit_code, str(error)
    except ModuleNotFoundError as error:
        if (error.name or "asperity").startswith("asperity"):
            return INTERNAL, _internal(error)
        return 4, f"the environment lacks the Python package {error.name}: install asperity[solve] or use ./run"
    except MemoryError:
        return 3, "out of memory; use fewer dofs (larger mesh.h_contact), more ranks, or solver.linear = auto"
    except OSError as error:
        where = f" {error.filename}" if error.filename else ""
        return 4, f"cannot read or write{where}: {error.strerror or error}"
    except Exception as error:
        return INTERNAL, _internal(error)


def _internal(error: Exception) -> str:
    """Message of an error that nobody has foreseen."""
    if os.environ.get("ASPERITY_TRACEBACK"):
        traceback.print_exception(error)
    *_, (frame, line) = traceback.walk_tb(error.__traceback__)
    where = f"{os.path.basename(frame.f_code.co_filename)}:{line}"
    text = "".join(c if c.isprintable() else " " for c in f"{type(error).__name__}: {error}")[:200]
    return f"internal error at {where}, {text}; please report it with the output under ASPERITY_TRACEBACK=1"
