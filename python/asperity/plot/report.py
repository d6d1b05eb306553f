"""One self-contained HTML page of a run: pictures inside, nothing loaded from elsewhere."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import asperity
from asperity.curve import COLUMNS
from asperity.output.results import Results
from asperity.plot import CAPTIONS, plot_run
from asperity.plot.citations import publications
from asperity.plot.style import DPI
from asperity.runtime.files import replace_file
from asperity.units import quantity

Rows = list[tuple[str, str]]


def write_report(folder: str | Path) -> Path:
    """Write report.html into a run directory, from the files there.

    Figures are drawn first where they are missing or older than the curve. All that came from
    the input is escaped.

    Args:
        folder: the run directory.

    Returns:
        The page.

    Raises:
        InputError: the folder holds no run.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    results = Results.read(folder)
    page = Environment(
        loader=PackageLoader("asperity"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    ).get_template("report.html.j2")  # fmt: skip
    text = page.render(
        title=results.folder.resolve().name,
        version=asperity.__version__,
        exit_reason=str(results.summary.get("exit_reason", "")),
        fit=results.summary.get("fit") or {},
        law=_law(results),
        outcome=_outcome(results),
        figures=[_figure(path) for path in _figures(results)],
        tables=_tables("run", results.summary) + _tables("dynamics", results.thresholds),
        inputs=[(name, list(_flat(table))) for name, table in _sections(results.case)],
        columns=COLUMNS,
        rows=[[_text(value) for value in row.values()] for row in results.curve.rows()],
        publications=publications(results.case),
    )
    target = results.folder / "report.html"
    replace_file(target, text.encode())
    return target


def _law(results: Results) -> Rows:
    """The power law in words, with confidence intervals where they are known."""
    fit = results.summary.get("fit") or {}
    if not {"k", "n"} <= set(fit):
        return []
    between = fit.get("ci", {})
    level = f" ({100 * between['confidence']:g} % interval" if "confidence" in between else " ("
    law = []
    for name in ("k", "n"):
        low, high = between.get(name, (None, None))
        interval = f"{level} {low:.4g} to {high:.4g})" if low is not None else ""
        law.append((name, f"{fit[name]:.5g}{interval}"))
    low, high = fit.get("range", (0.0, 0.0))
    law.append(("range of δ*", f"{low:.4g} to {high:.4g}, {fit.get('points', '?')} points"))
    law.append(("least squares", f"{fit.get('norm', '?')} scale, R² = {fit.get('r2', 0):.5f}"))
    return law


def _outcome(results: Results) -> Rows:
    """The curve in a few numbers, at its greatest force."""
    curve = results.curve
    if not len(curve):
        return []
    top = int(curve.force.argmax())
    return [
        ("steps", f"{len(curve)}"),
        ("greatest force", quantity(curve.force[top], results.unit("force"))),
        ("at the deflection", quantity(curve.delta[top], results.unit("length"))),
        ("contact area", f"{100 * curve.area_fraction[top]:.3g} % of the nominal"),
        ("greatest pressure", quantity(curve.max_pressure[top], results.unit("stress"))),
        ("greatest plastic strain", f"{curve.max_plastic_strain[top]:.3g}"),
        ("yielded volume", f"{100 * curve.plastic_fraction[top]:.3g} %"),
    ]


def _figures(results: Results) -> list[Path]:
    """Pictures of the run, drawn now unless they are newer than the curve."""
    folder, curve = results.folder / "figures", results.folder / "curve.csv"
    found = sorted(folder.glob("*.png"))
    if not found or any(path.stat().st_mtime < curve.stat().st_mtime for path in found):
        plot_run(results.folder)
        found = sorted(folder.glob("*.png"))
    order = list(CAPTIONS)
    return sorted(found, key=lambda p: order.index(p.stem) if p.stem in order else len(order))


def _figure(path: Path) -> dict[str, str]:
    picture = path.read_bytes()
    width = int.from_bytes(picture[16:20])  # of the PNG header, in pixels
    return {
        "caption": CAPTIONS.get(path.stem, _words(path.stem)),
        "width": f"{width * 110 / DPI:.0f}",  # so that letters are as large as those of the page
        "data": base64.b64encode(picture).decode(),
    }


def _tables(title: str, data: Mapping[str, Any]) -> list[tuple[str, Rows]]:
    """One table for the plain values of a JSON file, and one for each of its sections."""
    plain = {name: value for name, value in data.items() if not isinstance(value, Mapping)}
    nested = [(n, v) for n, v in data.items() if isinstance(v, Mapping) and n != "fit"]
    tables = [(title, plain), *nested] if plain else nested
    return [(_words(name), [(_words(key), v) for key, v in _flat(t)]) for name, t in tables]


def _words(name: str) -> str:
    return name.replace("_", " ")


def _sections(case: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for name, table in case.items():
        yield name, table if isinstance(table, Mapping) else {name: table}


def _flat(table: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, str]]:
    """Names and values of nested tables and lists of tables, inner names with a dot."""
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{name}.")
        elif isinstance(value, list) and value and all(isinstance(v, Mapping) for v in value):
            for number, item in enumerate(value, start=1):
                yield from _flat(item, f"{above}{name} {number}.")
        else:
            yield f"{above}{name}", _text(value)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or value != value or value == []:
        return "–"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(_text(item) for item in value)
    return str(value)
