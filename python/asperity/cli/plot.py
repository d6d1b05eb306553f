"""`asperity plot`: the figures of a run."""

from __future__ import annotations

import click

from asperity.cli import options


@click.command()
@options.run_folder
@click.option("--3d", "solid", is_flag=True, help="Draw figures/scene.png, the block in three dimensions, instead.")
@click.option("--png", "pixels", is_flag=True, help="PNG files also of what consists of lines.")
def command(folder: str, solid: bool, pixels: bool) -> None:
    """Draw the figures of a run.

    From the files of the run in OUT, into OUT/figures: SVG where they consist of lines, otherwise PNG.
    """
    if solid:
        from asperity.plot.scene import scene

        with options.files_of_run(folder):
            options.say(f"written {scene(folder)}")
        return
    from asperity.plot import plot_run

    with options.files_of_run(folder):
        written = plot_run(folder, pixels=pixels)
    for path in written:
        options.say(f"written {path}")
