"""The notebooks of examples/ run from top to bottom, and their numbers are right; they are stored without outputs."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).parent.parent / "examples"
NAMES = sorted(path.stem for path in FOLDER.glob("*.ipynb"))
KERNEL = "python3"


def execute(name: str, folder: Path) -> Any:
    """The notebook with its outputs, run in a folder."""
    nbformat = pytest.importorskip("nbformat")
    client = pytest.importorskip("nbclient", reason="needs nbclient and ipykernel, of the dependency group check")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    nbformat.validate(notebook)
    client.NotebookClient(notebook, timeout=300, kernel_name=KERNEL, resources={"metadata": {"path": folder}}).execute()
    return notebook


def printed(notebook: Any) -> str:
    """What its cells print and show as text."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    assert not [output for output in outputs if output.get("name") == "stderr"]
    return "\n".join(output.get("text") or output["data"].get("text/plain", "") for output in outputs)


def figures(notebook: Any) -> int:
    """Number of pictures that its cells show."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    return sum("image/png" in output.get("data", {}) for output in outputs)


@pytest.mark.parametrize("name", NAMES)
def test_no_outputs_are_stored(name: str) -> None:
    cells = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]
    assert not [cell for cell in cells if cell.get("outputs") or cell.get("execution_count")]
    assert f"def test_the_notebook_of_a_{name}(" in Path(__file__).read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_notebook_of_a_scan(tmp_path: Path) -> None:
    notebook = execute("scan", tmp_path)
    found = re.search(r"([\d.e-]+) N at 1e-07 m, ([\d.]+)% in contact, (\d+) spots", printed(notebook))
    assert found is not None and figures(notebook) == 3
    # a mesh of half the size has 0.1189 N, 6.62 % and 2 spots
    assert float(found[1]) == pytest.approx(0.1189, rel=0.02) and float(found[2]) == pytest.approx(6.62, rel=0.1)
    assert int(found[3]) == 2


@pytest.mark.slow
def test_the_notebook_of_a_joint(tmp_path: Path) -> None:
    """Frequency and peaks are those of a mesh with elements of 8 µm."""
    notebook = execute("joint", tmp_path)
    text = printed(notebook)
    frequency = re.search(r"f = ([\d.]+) kHz", text)
    lowest = re.search(r"^(-[\d.e-]+) m$", text, re.MULTILINE)  # after the unloading: the depth of the imprint
    assert lowest is not None and 0.3e-6 < -float(lowest[1]) < 0.7e-6
    assert frequency is not None and float(frequency[1]) == pytest.approx(3.8, rel=0.05)
    peaks = re.findall(r"([\d.]+) N: ([\d.e-]+) m at (\d+) Hz", text)
    assert [float(peak) for _, peak, _ in peaks] == pytest.approx([2.98e-8, 1.16e-7], rel=0.1)
    assert figures(notebook) == 2
