"""Tab completion, as docs/install.md sets it up."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

PROGRAM = shutil.which("asperity")
pytestmark = pytest.mark.skipif(PROGRAM is None, reason="asperity is not on the path")


def complete(line: str) -> list[tuple[str, str]]:
    """Kind and text of what a shell offers at the end of a line."""
    words = line.split(" ")
    asked = {"_ASPERITY_COMPLETE": "bash_complete", "COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)}
    assert PROGRAM is not None
    done = subprocess.run([PROGRAM], env=os.environ | asked, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    return [(kind, text) for kind, _, text in (answer.partition(",") for answer in done.stdout.splitlines())]


def test_commands_options_and_choices_are_completed() -> None:
    assert complete("asperity p") == [("plain", "plot")]
    assert ("plain", "--resume") in complete("asperity run case.toml --re")
    formats = {"calculix", "abaqus", "conductance", "csv", "python", "sliders", "sliders-python"}
    assert {text for _, text in complete("asperity export out --to ")} == formats


def test_files_are_left_to_the_shell() -> None:
    assert complete("asperity run ca")[0][0] == "file"
    assert complete("asperity plot o")[0][0] == "dir"


def test_keys_of_the_case_are_completed() -> None:
    assert complete("asperity run case.toml --set mesh.h_") == [("plain", "mesh.h_contact="), ("plain", "mesh.h_max=")]
    assert ("plain", "surface.lambda_short=") in complete("asperity run case.toml --set surface.")


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_the_line_of_the_page_works() -> None:
    """In bash the line defines a function and ties it to the program."""
    page = (Path(__file__).parents[2] / "docs/install.md").read_text(encoding="utf-8")
    found = re.search(r'^ *(eval "\$\(_ASPERITY_COMPLETE=bash_source asperity\)")', page, re.MULTILINE)
    assert found is not None
    done = subprocess.run(
        ["bash", "-c", f"{found[1]}; complete -p asperity"], capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("complete -o nosort -F _asperity_completion asperity")
