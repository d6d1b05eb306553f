"""`asperity compare`: two curves, with a tolerance per column."""

from __future__ import annotations

from pathlib import Path

import click

from asperity.cli import options
from asperity.errors import InputError


@click.command()
@click.argument("first", metavar="A", type=click.Path(exists=True, path_type=Path))
@click.argument("second", metavar="B", type=click.Path(exists=True, path_type=Path))
@click.option(
    "--rtol",
    "texts",
    multiple=True,
    metavar="COLUMN=VALUE",
    help="Compare this column to this relative tolerance; replaces the defaults. Repeatable.",
)
@options.serial
def command(first: Path, second: Path, texts: tuple[str, ...]) -> int:
    """Compare the curve of run A with the reference B; each a run directory or a curve.csv.

    Exit code 0 when they agree, 1 when not.
    """
    from asperity.curve import Curve, compare_curves

    a, b = (Curve.read(_curve_file(path)) for path in (first, second))
    differences = compare_curves(a, b, dict(map(_tolerance, texts)) if texts else None)
    for difference in differences:
        options.say(str(difference))
    if not differences:
        options.say(f"the curves agree ({len(a)} steps)")
    return 1 if differences else 0


def _curve_file(path: Path) -> Path:
    return path / "curve.csv" if path.is_dir() else path


def _tolerance(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise InputError(f"--rtol {text}: write COLUMN=VALUE, for example P_star=1e-6") from None
