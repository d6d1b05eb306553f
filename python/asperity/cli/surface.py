"""Roughness parameters and pictures of a surface, for `asperity check` and `import-map`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asperity.cli import options
from asperity.units import quantity

if TYPE_CHECKING:
    from asperity.surface import Surface


def described(surface: Surface, folder: Path | None, metre: str) -> dict[str, Any]:
    """Statistics, shortest wavelength and first touch of a surface, in a folder its picture and ISO 25178 as well.

    Args:
        folder: receives surface.png
        metre: label of the unit of length
    """
    from asperity.surface.height_files import steps_of
    from asperity.surface.scans import HeightField

    iso = None
    if folder is not None:
        from asperity.plot import save, surface_map

        if surface.rough:
            steps = steps_of(surface.heights, (surface.L, surface.L))
            iso = HeightField(surface.heights, *steps).iso25178()
        folder.mkdir(parents=True, exist_ok=True)
        save(surface_map(surface, metre), folder / "surface.png")
    return {
        "statistics": asdict(surface.statistics()), "iso25178": iso,
        "shortest_wavelength": surface.feature_size, "first_touch": surface.maximum(),
    }  # fmt: skip


def show(title: str, found: dict[str, Any], metre: str, more: Iterable[tuple[str, str]] = ()) -> None:
    """Print what :func:`described` has found under a title, after rows of others."""
    values, touch = found["statistics"], found["first_touch"]
    rows = [*more, *((key, quantity(values[key], metre)) for key in ("Sq", "Sz"))]
    rows.append(("rms slope", f"{values['rms_slope']:.4g}"))
    rows.append(("rms curvature", f"{values['rms_curvature']:.4g} {'1/m' if metre else ''}".rstrip()))
    rows.append(("shortest wavelength", quantity(found["shortest_wavelength"], metre)))
    rows.append(("first touch x, y, z", ", ".join(quantity(value, metre) for value in touch)))
    options.table(title, rows)


def show_iso(iso: dict[str, float | None] | None, metre: str) -> None:
    """Print the parameters of ISO 25178, in per cent where they are ratios of areas."""
    if iso is None:
        options.say("Sa, Ssk, Sal, Sk and the others of ISO 25178: pip install 'asperity[scan]'")
        return
    rows = []
    for name, value in iso.items():
        if value is None:
            text = "beyond the patch"
        elif name in ("Sdr", "Smr1", "Smr2"):
            text = f"{100 * value:.4g} %"
        else:
            text = f"{value:.4g}" if name in ("Ssk", "Sku", "Sdq", "Str") else quantity(value, metre)
        rows.append((name, text))
    options.table("ISO 25178", rows)
