"""What a release consists of: one version, its citation, sdist and wheel; what compiles it."""

from __future__ import annotations

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import zipfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import pytest
from made_up_run import write_run

import asperity

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
in_a_clone = pytest.mark.skipif(not (ROOT / ".ci").is_dir(), reason="an unpacked sdist has no .ci")


def test_the_version_is_in_one_place() -> None:
    assert "version" not in PROJECT and PROJECT["dynamic"] == ["version"]
    assert importlib.metadata.version("asperity") == asperity.__version__
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"\nversion: {asperity.__version__}\n" in citation
    assert PROJECT["authors"][0]["name"] in citation and PROJECT["license"] in citation


def test_the_changelog_begins_with_the_version_and_its_day() -> None:
    text = (ROOT / "CHANGELOG.md").read_text()
    releases = re.findall(r"^## \[(.+?)\](?: - (\d{4}-\d\d-\d\d))?$", text, re.MULTILINE)
    assert releases[0] == ("Unreleased", "")
    citation = (ROOT / "CITATION.cff").read_text()
    if ".dev" in asperity.__version__:  # on the way to a release, which has a day
        assert releases[1][0] < asperity.__version__ and "\ndate-released" not in citation
    else:
        assert releases[1][0] == asperity.__version__ and f"\ndate-released: {releases[1][1]}\n" in citation
    kinds = {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    assert set(re.findall(r"^### (.+)$", text, re.MULTILINE)) <= kinds


def started(environ: Mapping[str, str], folder: Path, *command: str | Path, code: int = 0) -> str:
    """What a command prints, which must end with an exit code."""
    done = subprocess.run(command, cwd=folder, env=environ, capture_output=True, text=True, timeout=1800, check=False)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
@in_a_clone
def test_sdist_and_wheel_are_built_and_work(tmp_path: Path) -> None:
    """The sdist from the clone, the wheel from the sdist, installed where the clone is out of sight."""
    environ = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "ASPERITY_ENTERED")}
    call = partial(started, environ, tmp_path)
    build = f"from scikit_build_core.build import build_sdist; build_sdist({str(tmp_path)!r})"
    started(environ, ROOT, sys.executable, "-c", build)
    (sdist,) = tmp_path.glob("asperity-*.tar.gz")
    with tarfile.open(sdist) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
        archive.extractall(tmp_path, filter="data")
    assert {"solver/cells.cpp", "tests/curves/plastic.csv", "COPYING", "run", "packages.txt", "CITATION.cff"} <= held
    assert not [name for name in held if name.startswith((".ci", "out/", ".git/"))]
    source = tmp_path / sdist.name.removesuffix(".tar.gz")
    offline = ("--no-build-isolation", "--no-deps", "--quiet")
    call(sys.executable, "-m", "pip", "wheel", *offline, "--wheel-dir", tmp_path, source)
    (wheel,) = tmp_path.glob("asperity-*.whl")
    with zipfile.ZipFile(wheel) as package:
        names = set(package.namelist())
    assert {"asperity/py.typed", "asperity/templates/report.html.j2"} <= names
    assert sum(re.fullmatch(r"asperity/_solver.*\.so", name) is not None for name in names) == 1
    call(sys.executable, "-m", "venv", "--system-site-packages", tmp_path / "venv")
    python = tmp_path / "venv/bin/python"
    call(python, "-m", "pip", "install", *offline, "--force-reinstall", wheel)
    where = call(python, "-I", "-c", "import asperity, asperity._solver as s; print(s.__file__)")
    assert str(tmp_path) in where
    assert asperity.__version__ in call(tmp_path / "venv/bin/asperity", "--version")
    call(tmp_path / "venv/bin/asperity", "init", "flat.toml", "--surface", "flat")
    assert "k = 1.225, n = 1 " in call(tmp_path / "venv/bin/asperity", "run", "flat.toml", "-o", "flat")


@pytest.mark.slow
@in_a_clone
@pytest.mark.skipif(shutil.which("clang++") is None, reason="needs clang: ASPERITY_PACKAGES=clang")
def test_the_wheel_works_in_a_bare_environment(tmp_path: Path) -> None:
    """Without the extra what needs no solver; with it a patch test, and a run on two ranks of the MPI of PyPI."""
    kept = ("PIP_", "HTTP", "http", "SSL_", "no_proxy")
    environ = {name: value for name, value in os.environ.items() if name.startswith(kept)}
    environ |= {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "OMP_NUM_THREADS": "1"}

    call = partial(started, environ, tmp_path)
    subprocess.run([ROOT / ".ci/wheel", tmp_path / "dist"], check=True, timeout=1800)
    (wheel,) = (tmp_path / "dist").glob("*.whl")
    assert re.fullmatch(rf"asperity-{asperity.__version__}-cp312-abi3-manylinux_2_34_\w+\.whl", wheel.name)
    call("/usr/bin/python3", "-m", "venv", "bare")
    bin = tmp_path / "bare/bin"
    call(bin / "pip", "install", "--quiet", wheel)
    write_run(tmp_path / "made")
    call(bin / "asperity", "report", "made")
    call(bin / "asperity", "dynamics", "made/curve.csv", "-o", "vibration", "--set", "dynamics.preload=1e-4")
    assert "asperity[solve]" in call(bin / "asperity", "run", ROOT / "cases/quick.toml", "-o", "no", code=4)
    call(bin / "pip", "install", "--quiet", f"{wheel}[solve]")
    call(bin / "asperity", "init", "flat.toml", "--surface", "flat")
    assert "k = 1.225, n = 1 " in call(bin / "asperity", "run", "flat.toml", "-o", "flat")
    call(bin / "asperity", "run", ROOT / "cases/quick.toml", "-o", "quick", "--ranks", "2")
    assert '"ranks": 2' in (tmp_path / "quick/summary.json").read_text()


# --- compilers --------------------------------------------------------------------------------------------------

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
        cwd=ROOT, capture_output=True, text=True,
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
    for source in sorted((ROOT / "solver").glob("*.cpp")):
        done = subprocess.run(
            [compiler, *FLAGS, "-Wno-psabi", *(f"-isystem{path}" for path in headers), source],
            capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
