"""Self-contained HTML page of a run: figures are embedded, nothing is loaded from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import math
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

from asperity.curve import COLUMNS
from asperity.curve.power_law import with_misfit
from asperity.output.assumptions import value_and_limit
from asperity.output.results import Raster, Results
from asperity.output.verdict import doubts, jump_rows, verdict
from asperity.plot import CAPTIONS
from asperity.plot.contact import growing_spots, turning_surface
from asperity.plot.style import DPI, PAGE
from asperity.runtime.files import replace_file
from asperity.runtime.run_folder import FIGURES, REPORT
from asperity.units import points, quantity
from asperity.version import __version__

Rows = list[tuple[str, str]]
STIFFNESS_WORDS = {
    "k_n": "slope of the force",
    "k_n_elastic": "elastic normal stiffness",
    "k_t": "tangential stiffness",
    "k_t_x": "tangential stiffness along x",
    "k_n_interface": "elastic normal stiffness without the block",
    "k_t_interface": "tangential stiffness without the block",
}


def write_report(folder: str | Path) -> Path:
    """Write report.html into the folder of a run, from its files; return it.

    It shows the figures that are in the folder. All text from the input is escaped.

    Args:
        folder: of the run

    Raises:
        InputError: the folder contains no run
    """
    import tomli_w
    from jinja2 import Environment, PackageLoader, StrictUndefined

    results = Results.read(folder)
    summary = results.summary
    warnings = list(summary.get("warnings", []))
    if (summary.get("accuracy") or {}).get("met") is False:
        warnings.insert(0, f"the tolerance is not met: {summary.get('exit_reason', '')}")
    assumptions = [
        {name: record[name] for name in ("name", "verdict", "source", "detail", "advice")}
        | {"value": value, "limit": f"{'≥' if record['bound'] == 'least' else '≤'} {limit}"}
        for record in summary.get("assumptions", [])
        for value, limit in [value_and_limit(record)]
    ]
    page = Environment(
        loader=PackageLoader("asperity"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    ).get_template("report.html.j2")  # fmt: skip
    script = files("asperity").joinpath("templates", "turn.js").read_text(encoding="utf-8")
    order = list(CAPTIONS)
    drawn = [path for path in (results.folder / FIGURES).glob("*") if path.suffix in (".png", ".svg")]
    drawn.sort(key=lambda path: (order.index(path.stem) if path.stem in order else len(order), path.stem))
    on_grid = Raster(results.top) if results.snapshots else None
    text = page.render(
        verdict=[*verdict(results), *doubts(results.summary.get("assumptions") or [], named=True)],
        script=script,
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        title=results.folder.resolve().name,
        version=__version__,
        versions=", ".join(f"{name} {version}" for name, version in summary.get("versions", {}).items()),
        exit_reason=str(summary.get("exit_reason", "")),
        warnings=warnings,
        law=_law(results),
        subject=_subject(results),
        outcome=_outcome(results),
        assumptions=assumptions,
        turning=None if on_grid is None else turning_surface(results, on_grid),
        growing=None if on_grid is None else growing_spots(results, on_grid),
        figures=[_figure(path) for path in drawn],
        case=tomli_w.dumps(dict(results.case)),
        jumps=jump_rows(
            results.thresholds.get("jumps") or (), *(results.unit(name) for name in ("force", "frequency", "length"))
        ),
        columns=COLUMNS,
        rows=[list(row.values()) for row in results.curve.rows()],
    )
    target = results.folder / REPORT
    replace_file(target, text.encode())
    return target


def _law(results: Results) -> Rows:
    """Parameters of the power law, with the misfit of the fit if known."""
    fit = results.summary.get("fit") or {}
    if not {"k", "n"} <= set(fit):
        return []
    misfit = " (misfit of the fit)" if fit.get("ci") else ""
    return [(name, f"{text}{misfit}") for name, text in zip(("k", "n"), with_misfit(fit), strict=True)]


def _subject(results: Results) -> Rows:
    """Surface and material of the run."""
    if not {"surface", "material"} <= set(results.case):
        return []
    surface, solid = results.surface, results.case["material"]
    rows = [("surface", results.case["surface"]["kind"])]
    if "tool" in results.case:
        rows.append(("tool", results.case["tool"]["kind"]))
    scan = results.summary.get("scan") or {}
    rows += [(f"scan, {name}", str(scan[name])) for name in ("file", "channel") if scan.get(name)]
    rows.append(("side of the patch", quantity(surface.L, results.unit("length"))))
    if surface.rough:
        found = surface.statistics()
        rows += [("Sq", quantity(found.Sq, results.unit("length"))), ("rms slope", f"{found.rms_slope:.3g}")]
    rows.append(("Young's modulus", quantity(solid["E"], results.unit("stress"))))
    rows.append(("Poisson's ratio", f"{solid['nu']:.4g}"))
    if solid.get("yield_strength") is not None:
        rows.append(("yield strength", quantity(solid["yield_strength"], results.unit("stress"))))
    return rows


def _outcome(results: Results) -> Rows:
    """Main values of the curve, at its largest force."""
    curve = results.curve
    if not len(curve):
        return []
    top = curve.top

    def shown(name: str, unit: str, bar: str = "") -> str:
        """Value of a column with its error bar, empty where it is unknown."""
        value = float(getattr(curve, name)[top])
        of_bar = curve.bar(bar or name, top) if hasattr(curve, f"error_{bar or name}") else math.nan
        return quantity(value, results.unit(unit), bar=of_bar) if math.isfinite(value) else ""

    rows = [
        ("steps", f"{len(curve)}"),
        ("largest force on the patch", shown("force", "force", "P_star")),
        ("at the approach", shown("delta", "length")),
        ("contact area over nominal area", points(float(curve.area_fraction[top]), curve.area_error(top))),
        ("contact spots", f"{curve.spots[top]}" if curve.spots[top] else ""),
        ("mean gap", shown("mean_gap", "length")),
        ("mean pressure", shown("mean_pressure", "stress")),
    ]
    scale, per = (1e-6, "Pa/µm") if results.unit("stiffness") else (1.0, "")
    nominal = float(results.case["surface"]["L"]) ** 2 if "surface" in results.case else math.nan
    for name, words in STIFFNESS_WORDS.items():
        text, of_area = shown(name, "stiffness"), scale * float(getattr(curve, name)[top]) / nominal
        if math.isfinite(of_area):  # the bar is the same
            text += f"; per nominal area {quantity(of_area, per, bar=curve.bar(name, top)).partition(' ±')[0]}"
        rows.append((words, text))
    _, h, error = (float(column[top]) for column in results.gap_conductance())
    of_joint = quantity(h, results.unit("conductance"), bar=error / h) if math.isfinite(h) else ""
    rows += [
        ("constriction conductance over conductivity", shown("conductance", "length")),
        ("conductance of the joint per area", of_joint),
        ("largest pressure", shown("max_pressure", "stress")),
        ("largest plastic strain", f"{curve.max_plastic_strain[top]:.3g}"),
        ("yielded volume", f"{100 * curve.plastic_fraction[top]:.3g} %"),
    ]
    return [row for row in rows if row[1] and not row[1].startswith("nan")]


def _figure(path: Path) -> dict[str, Any]:
    """Caption, width and data of a figure."""
    data = path.read_bytes()
    inches = int.from_bytes(data[16:20]) / DPI
    if path.suffix == ".svg":
        found = re.search(rb' width="([\d.]+)pt"', data[:2000])
        inches = float(found[1]) / 72.0 if found else 6.0  # a drawing of somebody else
    width = PAGE * inches
    return {
        "caption": CAPTIONS.get(path.stem, path.stem),
        "width": f"{width:.0f}",
        "wide": width > 580,  # a narrow screen scrolls it
        "kind": "svg+xml" if path.suffix == ".svg" else "png",
        "data": base64.b64encode(data).decode(),
    }
