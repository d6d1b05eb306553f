"""`asperity run`: the whole job of a case file."""

from __future__ import annotations

import tomllib
import warnings
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from asperity.cli import options
from asperity.errors import InputError
from asperity.runtime.files import is_aside
from asperity.runtime.parallel import on_first_rank
from asperity.runtime.progress import make_progress, world_rank

if TYPE_CHECKING:
    from asperity.case import Case
    from asperity.power_law import PowerLawFit

# what a run writes into its folder, without the checkpoint; case.toml, which shows that there is a run, is removed last
PRODUCTS = (
    "curve.csv", "summary.json", "run.log", "free.csv", "response.csv", "band.csv", "thresholds.json", "report.html",
    "fields/mesh.npz", "fields/top.npz", "fields/contact.vtkhdf", "fields",
    "figures/surface.png", "figures/mesh.png", "figures/curve.png", "figures/area.png", "figures/pressure.png",
    "figures/plasticity.png", "figures/frequency.png", "figures/response.png", "figures/scene.png", "figures",
    "case.toml",
)  # fmt: skip


@click.command()
@options.case_file
@options.output("OUT", "Run directory; default out/<name of the case>.")
@click.option("--resume", is_flag=True, help="Continue the run in OUT from its checkpoint.")
@click.option("--force", is_flag=True, help="Replace the run in OUT.")
@click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
@options.overrides
def command(
    case_file: str,
    output: str | None,
    resume: bool,
    force: bool,
    quiet: bool,
    overrides: tuple[str, ...],
) -> None:
    """Compute the force-deflection law of a case, and what its file asks for beside.

    OUT receives case.toml (the completed input), curve.csv, summary.json and, when asked for,
    dynamics, figures, fields and report.html.
    """
    from asperity.case import Case

    case = Case.load(case_file, overrides)
    folder = Path(output) if output else Path("out") / Path(case_file).stem
    on_first_rank(partial(prepare, case, folder, resume=resume, force=force))
    from asperity import run_case

    progress = make_progress(quiet)
    try:
        result = run_case.run(case, folder, progress=progress, resume=resume)
    finally:
        progress.done()
    if not quiet and world_rank() == 0:
        if result.contact is None:
            options.say(f"{folder} holds the complete run of {len(result.curve)} steps; nothing is left to do")
        _show_fit(result.fit)
        options.say(f"written to {folder}")


def prepare(case: Case, folder: Path, *, resume: bool, force: bool) -> None:
    """Make the run directory after everything that can be refused has been.

    With `force` what an earlier run wrote is removed, and nothing else; its checkpoint is left to the run.

    Raises:
        InputError: the load leaves no gap; or the folder is a file, holds a run (without `resume` or `force`), or
            holds files but no run
    """
    from asperity.case.case_file import check_loading

    if resume and force:
        raise InputError("--resume continues the run in OUT and --force replaces it: give one of them")
    for text in case.warnings() + check_loading(case, case.build_surface()):
        warnings.warn(text, stacklevel=1)
    check_folder(folder, resume=resume, force=force)
    if resume:
        return
    folder.mkdir(parents=True, exist_ok=True)
    for name in PRODUCTS if force else ():
        path = folder / name
        if path.is_dir():
            with suppress(OSError):  # it holds what is somebody else's
                path.rmdir()
        else:
            path.unlink(missing_ok=True)


def check_folder(folder: Path, *, resume: bool, force: bool) -> None:
    """Refuse a folder that holds something this run would write over, see `prepare`."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; give a folder to -o")
    # a killed run may have left what it was writing aside
    if not folder.is_dir() or all(is_aside(path.name) for path in folder.iterdir()):
        return
    if not holds_run(folder):
        raise InputError(f"{folder} is not empty and holds no run; give another folder to -o")
    if not (resume or force):
        raise InputError(
            f"{folder} already holds a run; --resume continues it, --force replaces it, -o takes another folder"
        )


def holds_run(folder: Path) -> bool:
    """Whether a folder holds a run, or the begin of one: a checkpoint, or a case.toml that no hand has written."""
    import tomli_w

    if any((folder / "checkpoint").glob("**/mesh.npz")):
        return True
    try:
        text = (folder / "case.toml").read_text(encoding="utf-8")
        case = tomllib.loads(text)
    except (OSError, ValueError, RecursionError):
        return False
    return {"mesh", "solver", "output"} <= case.keys() and tomli_w.dumps(case) == text


def _show_fit(fit: PowerLawFit | None) -> None:
    if fit is not None:
        options.say(f"P* = {fit.k:.5g} (delta/L)^{fit.n:.4f}, R^2 = {fit.r2:.5f}")
