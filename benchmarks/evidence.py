# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The table of docs/verification.md: what each stored table of measurements shows, with the script that makes it.

    python3 benchmarks/evidence.py            # prints it
    python3 benchmarks/evidence.py --write    # puts it into the page

Nothing is computed but counts and greatest values of docs/tables/*.csv, whose first lines name the commands.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from tables import read

ROOT = Path(__file__).resolve().parent.parent
TABLES, PAGE = ROOT / "docs/tables", ROOT / "docs/verification.md"
BEGIN, END = "<!-- table of benchmarks/evidence.py -->\n\n", "\n<!-- end of the table -->"
HEADER = ("subject", "judged by", "result", "script", "rows")

#: Cases of `asperity verify`: subject, reference, module.
CASES = {
    "patch": ("patch tests", "closed form", "patch"),
    "material": ("plasticity, uniaxial and confined, two cycles", "closed form", "patch"),
    "hertz": ("Hertz", "theory of a layer", "hertz"),
    "stiffness": ("stiffness and conductance of a spot", "closed form", "stiffness"),
    "westergaard": ("wave", "closed form", "waves"),
    "double-sinusoid": ("double wave", "tabulated boundary elements", "waves"),
    "thick-sphere": ("elastic-plastic thick sphere", "Hill", "shell"),
    "flattened-sphere": ("flattened sphere", "solution in the plane of r and z; fits", "flattening"),
    "rough": ("rough surfaces", "boundary elements", "rough"),
    "impact": ("impact of a mass", "closed form; energy along the law", "motion"),
    "vibration": ("free and forced vibration", "closed form", "motion"),
    "rates": ("orders of convergence", "theory", "rates"),
}
#: Tables with a column of steps inside their bars: subject, reference.
BARS = {
    "bars_elastic": ("error bars, elastic", "finer meshes of another grading"),
    "bars_plastic": ("error bars, elastic-plastic", "finer meshes of another grading"),
    "bars_few_steps": ("error bars, few planned steps", "finer meshes of another grading"),
    "bars_light_loads": ("error bars, light loads", "boundary elements"),
    "bars_columns": ("error bars of gap, stiffness, conductance", "finer meshes"),
}
#: Tables of the solid beside a half-space: subject, reference, columns of value, bar in per cent, reference.
BESIDE = {
    "self_affine_area": ("self-affine, area", "half-space, Tamaas", "kappa", "bar of kappa %", "kappa, Tamaas"),
    "self_affine_challenge": (
        "challenge's class, area", "half-space, Tamaas", "kappa", "bar of kappa %", "kappa, Tamaas"
    ),
    "self_affine_interface": ("self-affine, stiffness", "half-space", "k* of the interface", "bar %", "half-space"),
}  # fmt: skip


def link(path: str) -> str:
    """Markdown link to a file of the repository from a page of docs; docs/hooks.py takes it out of the site."""
    return f"[`{path}`](../{path})"


def table(name: str) -> tuple[str, list[dict[str, str]], str]:
    """Script and rows of a stored table, and the link to it."""
    command, _, (header, *rows) = read(TABLES / f"{name}.csv")
    script = next((word for word in command.split() if (ROOT / word).is_file() and word != "./run"), "")
    return script, [dict(zip(header, row, strict=True)) for row in rows], f"[{len(rows)}](tables/{name}.csv)"


def verified() -> Iterator[tuple[str, ...]]:
    """A row for each case of `asperity verify --level full`."""
    _, rows, _ = table("verification")
    for name, (subject, reference, module) in CASES.items():
        own = [row for row in rows if row["case"] == name]
        if not own:
            continue
        inside = sum(row["pass"] == "yes" for row in own)
        worst = max(float(row["error"]) / float(row["bar"]) for row in own)
        script = f"[`asperity verify {name}`](../python/asperity/verification/{module}.py)"
        greatest = 100.0 * max(float(row["error"]) for row in own)
        result = f"{inside} of {len(own)} within the bar, errors up to {greatest:.2g} %, {worst:.2f} of the bar"
        yield subject, reference, result, script, f"[{len(own)}](tables/verification.csv)"


def judged() -> Iterator[tuple[str, ...]]:
    """A row for each table of error bars."""
    for name, (subject, reference) in BARS.items():
        script, rows, count = table(name)
        column = next(c for c in rows[0] if c.startswith("steps inside"))
        barred = [row[column] for row in rows if not any("nan" in cell for cell in row.values())]
        pairs = [re.findall(r"(\d+)(?:/| of )(\d+)", cell)[-1] for cell in barred]
        inside, steps = (sum(int(pair[k]) for pair in pairs) for k in (0, 1))
        without = f", {len(rows) - len(barred)} runs without a bar" if len(barred) < len(rows) else ""
        yield subject, reference, f"{inside} of {steps} values inside{without}", link(script), count


def beside() -> Iterator[tuple[str, ...]]:
    """A row for each table of self-affine surfaces beside half-spaces."""
    for name, (subject, reference, value, bar, other) in BESIDE.items():
        script, rows, count = table(name)
        errors = [100.0 * abs(float(row[value]) / float(row[other]) - 1.0) for row in rows]
        inside = sum(error <= float(row[bar]) for error, row in zip(errors, rows, strict=True))
        result = f"{inside} of {len(rows)} within the bar, differences up to {max(errors):.2g} %"
        yield subject, reference, result, link(script), count


def others() -> Iterator[tuple[str, ...]]:
    """Other programs, the solid in time, hard cases."""
    for name, kind in (("peers_elastic", "elastic"), ("peers_plastic", "elastic-plastic")):
        script, rows, count = table(name)
        best = min(float(row["rms error %"]) for row in rows if row["program"].startswith("CalculiX"))
        yield f"demo surface, {kind}", "CalculiX, its finest mesh", f"{best:g} % rms", link(script), count
    for name in ("transient_free_elastic", "transient_free_plastic"):
        script, rows, count = table(name)
        slow = [abs(float(r["difference"].split()[0])) for r in rows if float(r["omega_s/omega_1"]) <= 0.05]
        kind = name.rpartition("_")[2]
        yield (
            f"frequency of the one-degree model, {kind}", "full solid in time",
            f"{max(slow):.2f} % while the mass is slow", link(script), count,
        )  # fmt: skip
    script, rows, count = table("unloading")
    light, all_ = (max(float(r["difference %"]) for r in rows if float(r["w"]) <= most) for most in (20, 100))
    result = f"force along it within {light:g} % to w = 20, {all_:g} % to w = 100"
    yield "unloading of a flattened sphere", "fit of Etsion, Kligerman and Kadin", result, link(script), count
    script, rows, count = table("vibration_work_precision")
    error = next(row["largest error"] for row in rows if row["setting"].startswith("tol 1e-05"))
    yield "response at the default tolerance", "balance at 1e-9", f"{error} of u_max", link(script), count
    script, rows, count = table("hard_cases")
    passed = sum(row["pass"] == "yes" for row in rows)
    result = f"{passed} of {len(rows)} as expected"
    yield "scenes made to break it", "balances, other solvers, expected refusals", result, link(script), count


def text() -> str:
    """The table in Markdown."""
    lines = [HEADER, ("---",) * len(HEADER), *verified(), *judged(), *beside(), *others()]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def main() -> None:
    """Print the table, or put it into the page."""
    if "--write" not in sys.argv[1:]:
        print(text(), end="")
        return
    page = PAGE.read_text(encoding="utf-8")
    before, after = page.split(BEGIN)[0], page.split(END)[1]
    PAGE.write_text(before + BEGIN + text() + END + after, encoding="utf-8")


if __name__ == "__main__":
    main()
