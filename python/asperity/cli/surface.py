"""`asperity surface`: roughness parameters and a picture of a case's surface."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from asperity.cli import options
from asperity.units import quantity


@click.command()
@options.case_file
@options.output("DIR", "Folder for surface.png.")
@options.as_json
@options.overrides
@options.serial
def command(case_file: str, output: str | None, as_json: bool, overrides: tuple[str, ...]) -> None:
    """Show the roughness of a case's surface.

    Its statistics, shortest wavelength and point of first contact; with -o also a picture.
    """
    from asperity.case import Case

    case = Case.load(case_file, overrides)
    surface = case.build_surface()
    metre = "m" if case.units == "SI" else ""
    values = asdict(surface.statistics())
    rows = [(_LABELS[key], _text(values[key], dim, metre)) for key, dim in _DIMENSIONS.items()]
    shortest = ("shortest wavelength", quantity(surface.feature_size, metre))
    spot = ", ".join(quantity(value, metre) for value in surface.maximum())
    if as_json:
        touch = {"shortest_wavelength": surface.feature_size, "first_touch": surface.maximum()}
        options.print_json({"kind": case.surface.kind, "statistics": values} | touch)
    else:
        options.table(f"{case.surface.kind}", [*rows, shortest, ("first touch x, y, z", spot)])
    if output:
        from asperity.plot import save, surface_map

        folder = Path(output)
        folder.mkdir(parents=True, exist_ok=True)
        n = 401
        peak = surface.maximum()
        figure = surface_map(surface.grid(n), surface.L, peak, unit=metre)
        path = save(figure, folder / "surface.png")
        if not as_json:
            options.say(f"written {path}")


# key of SurfaceStatistics -> power of length
_DIMENSIONS = {
    "Sq": 1, "Sa": 1, "Sz": 1, "Sp": 1, "skewness": 0, "kurtosis": 0, "rms_slope": 0,
    "rms_curvature": -1,
}  # fmt: skip
_LABELS = {
    "Sq": "Sq, rms height",
    "Sa": "Sa, mean height deviation",
    "Sz": "Sz, peak to valley",
    "Sp": "Sp, peak above mean",
    "skewness": "skewness",
    "kurtosis": "kurtosis",
    "rms_slope": "rms slope",
    "rms_curvature": "rms curvature",
}


def _text(value: float, dimension: int, metre: str) -> str:
    if dimension == -1:
        return f"{value:.4g} {'1/m' if metre else ''}".rstrip()
    return quantity(value, metre) if dimension else f"{value:.4g}"
