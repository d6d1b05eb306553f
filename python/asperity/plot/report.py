"""Self-contained HTML page of a run: figures are embedded, nothing is loaded from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
from collections.abc import Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from asperity.curve import COLUMNS, WITH_ERRORS, Curve
from asperity.curve.power_law import with_misfit
from asperity.force_law.laws import WORDS
from asperity.output.assumption import DOUBTFUL
from asperity.output.gap_conductance import gap_conductance
from asperity.output.results import Results
from asperity.output.verdict import doubts, verdict
from asperity.plot import CAPTIONS
from asperity.plot.citations import publications
from asperity.plot.style import DPI
from asperity.plot.turning import growing_spots, turning_surface
from asperity.runtime.files import replace_file
from asperity.runtime.run_folder import FIGURES, REPORT, locking
from asperity.units import plus_minus, quantity
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


@locking
def write_report(folder: str | Path, finished: bool | None = None) -> Path:
    """Write report.html into the folder of a run, from its files; return it.

    It shows the figures that are in the folder. All text from the input is escaped.

    Args:
        folder: of the run
        finished: whether the page reports a finished run; default as in summary.json, which a run updates only after
            it has written its report

    Raises:
        InputError: the folder contains no run
    """
    import tomli_w
    from jinja2 import Environment, PackageLoader, StrictUndefined

    results = Results.read(folder)
    summary = dict(results.summary) | ({} if finished is None else {"finished": finished})
    warnings = [*_missed_tolerance(summary), *summary.pop("warnings", [])]
    summary.pop("dynamics", None)  # as in thresholds.json
    assumptions = [_assumption(record) for record in summary.pop("assumptions", [])]
    page = Environment(
        loader=PackageLoader("asperity"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    ).get_template("report.html.j2")  # fmt: skip
    script = files("asperity").joinpath("templates", "turn.js").read_text(encoding="utf-8")
    text = page.render(
        verdict=[*verdict(results), *doubts(results)],
        script=script,
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        title=results.folder.resolve().name,
        version=__version__,
        exit_reason=str(summary.get("exit_reason", "")),
        warnings=warnings,
        law=_law(results),
        subject=_subject(results),
        outcome=_outcome(results),
        assumptions=assumptions,
        turning=turning_surface(results),
        growing=growing_spots(results),
        figures=[_figure(path) for path in _figures(results.folder / FIGURES)],
        raw=[
            ("Run: counts, times, checks, versions", _json(summary)),
            *([("Vibration: thresholds", _json(results.thresholds))] if results.thresholds else []),
            ("Input: the completed case", tomli_w.dumps(dict(results.case))),
        ],
        laws=_laws(results),
        jumps=_jumps(results),
        columns=COLUMNS,
        rows=[[_text(value) for value in row.values()] for row in results.curve.rows()],
        publications=publications(results.case),
    )
    target = results.folder / REPORT
    replace_file(target, text.encode())
    return target


def _missed_tolerance(summary: Mapping[str, Any]) -> Iterator[str]:
    """Warning if the run has not met its tolerance."""
    if (summary.get("accuracy") or {}).get("met") is False:
        yield f"the tolerance is not met: {summary.get('exit_reason', '')}"


def _assumption(record: Mapping[str, Any]) -> dict[str, str]:
    """Cells of a line of the ledger."""
    unit, sign = record["unit"], "≥" if record["bound"] == "least" else "≤"
    return {
        **{name: record[name] for name in ("name", "verdict", "source", "detail")},
        "value": f"{record['value']:.3g} {unit}".rstrip(),
        "limit": f"{sign} {record['limit']:.3g} {unit}".rstrip(),
        "advice": record["advice"] if record["verdict"] == DOUBTFUL else "",
    }


def _law(results: Results) -> Rows:
    """Parameters of the power law, with the misfit of the fit if known."""
    fit = results.summary.get("fit") or {}
    if not {"k", "n"} <= set(fit):
        return []
    misfit = " (misfit of the fit)" if fit.get("ci") else ""
    law = [(name, f"{text}{misfit}") for name, text in zip(("k", "n"), with_misfit(fit), strict=True)]
    low, high = fit.get("range", (0.0, 0.0))
    law.append(("range of δ*", f"{low:.4g} to {high:.4g}, {fit.get('points', '?')} points"))
    law.append(("least squares", f"{fit.get('norm', '?')} scale, R² = {fit.get('r2', 0):.5f}"))
    return law


def _subject(results: Results) -> Rows:
    """Surface and material of the run."""
    if not {"surface", "material"} <= set(results.case):
        return []
    surface, solid = results.surface, results.case["material"]
    rows = [("surface", results.case["surface"]["kind"])]
    scan = results.summary.get("scan") or {}
    rows += [(f"scan, {name}", str(scan[name])) for name in ("file", "channel") if scan.get(name)]
    rows.append(("side of the patch", quantity(surface.L, results.unit("length"))))
    if surface.rough:
        found = surface.statistics(257)
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
    top = int(curve.force.argmax())
    area = plus_minus(100.0 * float(curve.area_fraction[top]), 100.0 * curve.area_error(top))
    return [
        ("steps", f"{len(curve)}"),
        ("largest force on the patch", quantity(curve.force[top], results.unit("force"), bar=curve.bar("P_star", top))),
        ("at the approach", quantity(curve.delta[top], results.unit("length"))),
        ("contact area", f"{area} % of the nominal"),
        *_known(curve, top, results),
        ("largest pressure", quantity(curve.max_pressure[top], results.unit("stress"))),
        ("largest plastic strain", f"{curve.max_plastic_strain[top]:.3g}"),
        ("yielded volume", f"{100 * curve.plastic_fraction[top]:.3g} %"),
    ]


def _known(curve: Curve, row: int, results: Results) -> Rows:
    """Gap, mean pressure and spots of a row; nothing for a curve without these columns."""
    rows: Rows = []
    if curve.spots[row]:
        rows.append(("contact spots", f"{curve.spots[row]}"))
    for name, words, unit in (("mean_gap", "mean gap", "length"), ("mean_pressure", "mean pressure", "stress")):
        value, bar = getattr(curve, name)[row], curve.bar(name, row) if name in WITH_ERRORS else math.nan
        if value == value:
            rows.append((words, quantity(value, results.unit(unit), bar=bar)))
    unit = results.unit("stiffness")
    area = float(results.case["surface"]["L"]) ** 2 if "surface" in results.case else math.nan
    for name, words in STIFFNESS_WORDS.items():
        value, bar = getattr(curve, name)[row], curve.bar(name, row)
        if value == value:
            scale, name = (1e-6, "Pa/µm") if unit else (1.0, "")
            of_area = quantity(scale * value / area, name, bar=bar) if area == area else ""
            per_area = f", {of_area} of the nominal area" if of_area else ""
            rows.append((words, quantity(value, unit, bar=bar) + per_area))
    if (conductance := curve.conductance[row]) == conductance:
        words, bar = "constriction conductance over conductivity", curve.bar("conductance", row)
        rows.append((words, quantity(conductance, results.unit("length"), bar=bar)))
        _, h, error = (column[row] for column in gap_conductance(results.case, curve))
        if h == h:
            of_area = quantity(h, results.unit("conductance"), bar=error / h)
            rows.append(("conductance of the joint per area", of_area))
    return rows


def _figures(folder: Path) -> list[Path]:
    """Figures of the run in their order."""
    order, found = list(CAPTIONS), [p for p in folder.glob("*") if p.suffix in (".png", ".svg")]
    return sorted(found, key=lambda p: (order.index(p.stem) if p.stem in order else len(order), p.stem))


def _figure(path: Path) -> dict[str, Any]:
    """Caption, size and data of a figure."""
    data = path.read_bytes()
    size = [int.from_bytes(data[i : i + 4]) / DPI for i in (16, 20)]
    if path.suffix == ".svg":
        size = [float(number) / 72.0 for number in re.findall(rb' (?:width|height)="([\d.]+)pt"', data[:2000])[:2]]
    if len(size) < 2:  # a drawing of somebody else
        size = [6.0, 4.0]
    width, height = (110 * inches for inches in size)  # so that text has the size of that on the page
    return {
        "caption": CAPTIONS.get(path.stem, path.stem),
        "width": f"{width:.0f}",
        "height": f"{height:.0f}",
        "wide": width > 700,  # a narrow screen scrolls it
        "kind": "svg+xml" if path.suffix == ".svg" else "png",
        "data": base64.b64encode(data).decode(),
    }


def _json(data: Mapping[str, Any]) -> str:
    return json.dumps(data, indent=2, ensure_ascii=False)


def _laws(results: Results) -> list[tuple[str, ...]]:
    """Laws of the curve at the preload: name, n, kappa, stiffness, frequency, remark; the known ones."""
    rows, units = [], {"k_n": results.unit("stiffness"), "f": results.unit("frequency")}
    laws = results.thresholds.get("laws") or {}
    for row in (row for row in laws.get("table", ()) if row["k_n"] is not None):
        words, other = WORDS[row["law"]]
        bars = {name: row.get(f"{name}_bar") or math.nan for name in ("n", "kappa", "k_n", "f")}
        k_n, f = (
            "–" if row[name] is None else quantity(row[name], units[name], bar=bars[name] / row[name])
            for name in ("k_n", "f")
        )
        remark = "chosen" if row["chosen"] else "" if row["applies"] else other
        rows.append((words, *(plus_minus(row[name], bars[name]) for name in ("n", "kappa")), k_n, f, remark))
    return rows


def _jumps(results: Results) -> list[tuple[str, ...]]:
    """Where slow sweeps jump: law, force, damping ratio, direction, frequency, amplitudes before and after."""
    rows: list[tuple[str, ...]] = []
    hertz, metre = results.unit("frequency"), results.unit("length")
    for jump in results.thresholds.get("jumps") or ():
        f, after = jump["frequency"], jump["x_max_after"]
        rows.append((
            jump["model"], quantity(jump["force"], results.unit("force")), f"{jump['zeta']:g}", jump["sweep"],
            f"{jump['Omega']:.5g} ω_s" if f is None else quantity(f, hertz, 5), quantity(jump["x_max"], metre),
            "–" if after is None else quantity(after, metre),
        ))  # fmt: skip
    return rows


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}" if value == value else "–"
    return str(value)
