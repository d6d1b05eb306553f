# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The compiled module: which versions of nanobind it builds with."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[1]
FLAGS = ("-std=c++20", "-fsyntax-only", "-fvisibility=hidden", "-fopenmp-simd", "-Wall", "-Wextra", "-Werror")


@pytest.mark.slow
@pytest.mark.parametrize("version", ["2.4.0", "2.12.0", "3.1.0"])
def test_the_python_interface_compiles(version: str, tmp_path: Path) -> None:
    """With the oldest nanobind that pyproject.toml allows, a later one, and the next generation."""
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(tmp_path)]
    subprocess.run([*install, f"nanobind=={version}"], check=True)
    headers = tmp_path / "nanobind" / "include", Path(sysconfig.get_path("include"))
    done = subprocess.run(
        ["c++", *FLAGS, *(f"-isystem{path}" for path in headers), "solver/module.cpp"],
        cwd=PROJECT, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
