# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The report: self-contained, complete, and safe for any input."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import pytest
from html_page import Page
from made_up_run import write_run

from asperity.errors import InputError
from asperity.plot.citations import publications
from asperity.plot.report import write_report


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_run(tmp_path / "run", n=3)


def vibrate(folder: Path) -> None:
    from asperity.dynamics import run_dynamics

    run_dynamics(folder, out_dir=folder, model=["exact"], omega=(0.9, 0.95), sweeps=False, bands=False)


def test_the_page_contains_law_outcome_input_run_and_citations(folder: Path) -> None:
    page = Page(write_report(folder))
    for part in (
        "0.420 ± 4.8 % (misfit of the fit)", "1.550 ± 0.030 (misfit of the fit)", "R² = 0.99870",
        "403 µN ± 3 %", "30 nm", "yield_strength 1e+09", "error budget", "load step 0.008",
        "dofs 51234",
        "dolfinx 0.9.0", "peak memory MiB 640", "18 accepted steps", "Komvopoulos", "kappa -0.047",
        "peaks 1.Omega 0.987",
    ):  # fmt: skip
        assert part in page.text


def test_nothing_is_loaded_from_elsewhere(folder: Path) -> None:
    page = Page(write_report(folder))
    assert page.tags.count("img") == len(list((folder / "figures").glob("*.png"))) >= 6
    kinds = [link.partition(";base64,")[0] for link in page.links]
    assert set(kinds) == {"data:image/png", "data:image/svg+xml"}
    assert kinds.count("data:image/svg+xml") == len(list((folder / "figures").glob("*.svg"))) >= 3
    assert page.tags.count("script") == 1 and "link" not in page.tags
    assert "default-src 'none'" in (folder / "report.html").read_text(encoding="utf-8")


def test_text_from_the_input_is_escaped(tmp_path: Path) -> None:
    evil = "<script>alert('x')</script>"
    folder = write_run(tmp_path / "<b>run", n=2)
    summary = json.loads((folder / "summary.json").read_text())
    summary |= {"exit_reason": evil, evil: {evil: evil}}
    (folder / "summary.json").write_text(json.dumps(summary))
    page = Page(write_report(folder))
    assert page.tags.count("script") == 1 and "b" not in page.tags
    assert "<b>run" in page.text and evil in page.text


def test_a_partial_run_is_reported(folder: Path) -> None:
    (folder / "summary.json").write_text('{"exit_reason": "no convergence at step 3"}')
    (folder / "case.toml").unlink()
    page = Page(write_report(folder))
    assert "no convergence at step 3" in page.text and "Power law" not in page.text


@pytest.mark.parametrize("met", [True, False])
def test_a_missed_tolerance_is_among_the_warnings(folder: Path, met: bool) -> None:
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    summary |= {"accuracy": {"met": met}, "exit_reason": "max_dofs = 30000 allows no more", "warnings": ["steep"]}
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    text = write_report(folder).read_text(encoding="utf-8")
    box = text.partition('<section class="warnings"')[2].partition("</section>")[0]
    assert "<li>steep</li>" in box
    assert ("<li>the tolerance is not met: max_dofs = 30000 allows no more</li>" in box) == (not met)


@pytest.mark.parametrize(
    ("data", "drawn", "kept"),
    [
        ("curve.csv", ("curve", "area", "response"), ()),
        ("thresholds.json", ("response", "frequency"), ("curve", "area")),
    ],
)
def test_only_figures_older_than_their_data_are_drawn_again(
    folder: Path, data: str, drawn: tuple[str, ...], kept: tuple[str, ...]
) -> None:
    """`asperity dynamics OUT -o OUT` leaves the curve as it is, and has another response."""

    def times() -> dict[str, int]:
        return {path.stem: path.stat().st_mtime_ns for path in (folder / "figures").glob("*.png")}

    vibrate(folder)
    write_report(folder)
    before = times()
    write_report(folder)
    assert times() == before
    later = max(before.values()) + 1
    os.utime(folder / data, ns=(later, later))
    (folder / "figures/surface.png").unlink()
    write_report(folder)
    after = times()
    assert all(after[name] > later for name in (*drawn, "surface"))
    assert all(after[name] == before[name] for name in kept)


def test_a_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"curve\.csv"):
        write_report(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_only_models_and_programs_in_use_are_cited() -> None:
    elastic = {"surface": {"kind": "sphere"}, "material": {}, "contact": {"method": "penalty"}}
    plastic = {**elastic, "material": {"yield_strength": 1.0}, "dynamics": {}}
    assert set(publications(plastic)) > set(publications(elastic))
    assert any("DOLFINx" in text for text in publications({}))


def test_the_laws_of_vibration_stand_side_by_side(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", n=2)
    vibrate(folder)
    page = write_report(folder).read_text(encoding="utf-8")
    assert (
        "Laws of vibration at the preload" in page and "<td>chosen</td>" in page and "not of a vibration</td>" in page
    )
    assert "table 1.law" not in page
    assert re.search(r"<td>[\d.]+ \w?N/m ± [\d.]+ %</td>\n?<td>[\d.]+ \w?Hz ± [\d.]+ %</td>", page)
