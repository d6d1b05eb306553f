"""The compiled module: which versions of nanobind and which compilers it builds with."""

from __future__ import annotations

import shutil
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


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["g++", "clang++", "aarch64-linux-gnu-g++"])
def test_no_compiler_warns(compiler: str, tmp_path: Path) -> None:
    """Of clang and of the compiler for AArch64 where they are: ASPERITY_PACKAGES="clang g++-aarch64-linux-gnu"."""
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    python = Path(sysconfig.get_path("include"))
    nanobind = subprocess.run([sys.executable, "-m", "nanobind", "--include_dir"], capture_output=True, text=True)
    other = tmp_path / "aarch64-linux-gnu" / python.name  # Debian has its pyconfig.h in another package; both are LP64
    other.mkdir(parents=True)
    shutil.copy(python.parent / str(sysconfig.get_config_var("MULTIARCH")) / python.name / "pyconfig.h", other)
    headers = nanobind.stdout.strip(), python, tmp_path
    for source in sorted((PROJECT / "solver").glob("*.cpp")):
        done = subprocess.run(
            [compiler, *FLAGS, "-Wno-psabi", *(f"-isystem{path}" for path in headers), source],
            capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
