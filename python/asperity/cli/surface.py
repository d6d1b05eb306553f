"""Roughness parameters and pictures of a surface, for `asperity check` and `import-map`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asperity.cli import options
from asperity.units import quantity

if TYPE_CHECKING:
    from asperity.surface import Surface

Iso = dict[str, float | None] | None


def describe(surface: Surface, kind: str, metre: str, folder: Path | None, show: bool) -> dict[str, Any]:
    """Statistics, shortest wavelength and first touch of a surface, with a folder its pictures and ISO 25178 as well.

    Args:
        kind: of surface, the title of the table
        metre: label of the unit of length
        folder: receives surface.png
        show: print them
    """
    from asperity.surface.scans import HeightField

    values, touch, found = asdict(surface.statistics()), surface.maximum(), None
    if show:
        rows = [(key, quantity(values[key], metre)) for key in ("Sq", "Sz")]
        rows.append(("rms slope", f"{values['rms_slope']:.4g}"))
        rows.append(("rms curvature", f"{values['rms_curvature']:.4g} {'1/m' if metre else ''}".rstrip()))
        rows.append(("shortest wavelength", quantity(surface.feature_size, metre)))
        rows.append(("first touch x, y, z", ", ".join(quantity(value, metre) for value in touch)))
        options.table(kind, rows)
    if folder is not None:
        if surface.rough:
            found = HeightField.of(surface.heights, (surface.L, surface.L)).iso25178()
            if show:
                show_iso(found, metre)
        folder.mkdir(parents=True, exist_ok=True)
        path = draw(folder, surface, metre)
        if show:
            options.say(f"written {path}")
    return {
        "kind": kind, "statistics": values, "iso25178": found,
        "shortest_wavelength": surface.feature_size, "first_touch": touch,
    }  # fmt: skip


def draw(folder: Path, surface: Surface, metre: str) -> Path:
    """Write a picture of a surface, and return its path."""
    from asperity.plot import save, surface_map

    return save(surface_map(surface, metre), folder / "surface.png")


def show_iso(iso: Iso, metre: str) -> None:
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
