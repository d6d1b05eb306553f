"""The environment that ./run makes: what it holds, and how it is made.

The making is tested with stand-ins for mmdebstrap and bubblewrap, on a copy of the script that takes
the host for another system.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import CLEAN

PROJECT = Path(__file__).parents[1]
PACKAGES = re.findall(r"^[a-z0-9.+-]+", (PROJECT / "packages.txt").read_text(), re.MULTILINE)


def wait_until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end, "nothing happened for 30 s"
        time.sleep(0.02)


# ---------------------------------------------------------------------------------- what it holds


def test_packages_are_named_once_and_installed() -> None:
    assert len(set(PACKAGES)) == len(PACKAGES) > 20
    words = ["dpkg-query", "-W", "-f", "${db:Status-Status} ${Package}\n", *PACKAGES]
    answer = subprocess.run(words, capture_output=True, text=True)
    assert set(answer.stdout.splitlines()) == {f"installed {name}" for name in PACKAGES}


# --------------------------------------------------------------------------------- how it is made

STAND_INS = {
    "dpkg-query": 'while [ "$1" != -- ]; do shift; done; shift; printf "installed %s\\n" "$@"',
    "apt-get": "true",
    "apt-helper": "exit 1",
    "apt-config": "true",
    "unshare": 'while [ "${1#-}" != "$1" ]; do shift; done; exec "$@"',
    "bwrap": """
        while [ "$1" != -- ]; do shift; done; shift
        case $* in
            *" pip "*) ;;
            *" venv "*) for place; do :; done; mkdir -p "$place/bin" ;;
            *) exec "$@" ;;
        esac
    """,
    "mmdebstrap": """
        echo made >>"$CALLS"
        printf '%s\n' "$@" >"$CALLS.arguments"
        echo "I: downloading packages"
        for target; do case $target in trixie | sid) take=1;; *) [ -z "$take" ] || break;; esac; done
        [ ! -e "$FAIL" ] || { echo "E: no such mirror"; exit 1; }
        if [ "$target" = - ]; then tree=$(mktemp -d); else tree=$target; mkdir "$tree"; fi
        mkdir -p "$tree/usr/bin" "$tree/etc" "$tree/var"
        while [ -e "$HOLD" ]; do sleep 0.05; done
        touch "$tree/complete"
        [ "$target" != - ] || tar -C "$tree" -c .
    """,
}


class Clone:
    """A copy of the script on a system that is no Debian, with stand-ins for the tools."""

    def __init__(self, path: Path) -> None:
        self.path = path / "a clone"
        self.cache = path / "cache" / "asperity"
        self.calls, self.hold, self.fail = path / "calls", path / "hold", path / "fail"
        tools = path / "tools"
        for directory in (self.path / "solver", tools):
            directory.mkdir(parents=True)
        for name, body in STAND_INS.items():
            (tools / name).write_text(f"#!/bin/sh\n{body}\n")
            (tools / name).chmod(0o755)
        self.system = path / "os-release"
        self.system.write_text("ID=other\nVERSION_ID=1\n")
        script = (PROJECT / "run").read_text().replace("/etc/os-release", str(self.system))
        (self.path / "run").write_text(script.replace("/usr/lib/apt/apt-helper", "apt-helper"))
        (self.path / "python/asperity").mkdir(parents=True)
        for name in ("packages.txt", "CMakeLists.txt", "pyproject.toml", "python/asperity/version.py"):
            shutil.copy(PROJECT / name, self.path / name)
        self.environment = CLEAN | {
            "PATH": f"{tools}:/usr/bin:/bin",
            "XDG_CACHE_HOME": str(self.cache.parent),
            "CALLS": str(self.calls),
            "HOLD": str(self.hold),
            "FAIL": str(self.fail),
        }
        for name in ("ASPERITY_ENTERED", "ASPERITY_SUITE"):
            self.environment.pop(name, None)

    def start(self, *command: str) -> subprocess.Popen[str]:
        words, pipe = ["bash", str(self.path / "run"), *(command or ("echo", "inside"))], subprocess.PIPE
        return subprocess.Popen(
            words, env=self.environment, cwd=self.path, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, text=True
        )

    def run(self) -> tuple[int, str, str]:
        """Exit code, output and errors of a start."""
        process = self.start()
        output, errors = process.communicate(timeout=60)
        return process.returncode, output, errors

    def roots(self) -> list[Path]:
        return [path for path in self.cache.glob("root-*") if path.is_dir()]

    def made(self) -> int:
        return len(self.calls.read_text().split()) if self.calls.exists() else 0


@pytest.fixture
def clone(tmp_path: Path) -> Clone:
    return Clone(tmp_path)


def test_two_starts_at_once_make_one_root(clone: Clone) -> None:
    clone.hold.touch()
    first = clone.start()
    wait_until(clone.made)
    second = clone.start()
    assert second.stderr is not None
    assert "waiting for another start" in second.stderr.readline()
    clone.hold.unlink()
    assert [p.communicate(timeout=60)[0] for p in (first, second)] == ["inside\n"] * 2
    assert clone.made() == 1


def test_a_killed_start_leaves_neither_lock_nor_root(clone: Clone) -> None:
    clone.hold.touch()
    first = clone.start()
    wait_until(clone.roots)
    first.send_signal(signal.SIGKILL)
    first.communicate(timeout=60)
    assert all(path.suffix in (".new", ".tmp") for path in clone.roots())
    clone.hold.unlink()
    code, output, errors = clone.run()
    assert (code, output) == (0, "inside\n"), errors
    (root,) = clone.roots()
    assert root.suffix == ""


def test_another_suite_has_a_root_of_its_own(clone: Clone) -> None:
    for suite in ("", "trixie", "sid", "sid"):  # each is made once
        clone.environment["ASPERITY_SUITE"] = suite
        _, output, errors = clone.run()
        assert output == "inside\n", errors
    assert clone.made() == len(clone.roots()) == 2
    with open(clone.path / "packages.txt", "a") as packages:
        packages.write("python3-other  # a comment\n")
    clone.run()
    assert clone.made() == len(clone.roots()) == 3
    assert "sid" in Path(f"{clone.calls}.arguments").read_text().splitlines()


@pytest.mark.parametrize(("suite", "own"), [("", False), ("trixie", False), ("sid", True)])
def test_debian_13_serves_as_it_is_unless_another_suite_is_requested(clone: Clone, suite: str, own: bool) -> None:
    clone.system.write_text("ID=debian\nVERSION_ID=13\nVERSION_CODENAME=trixie\n")
    script = clone.path / "run"  # on the host's own packages it stops before a real virtual environment is made
    script.write_text(script.read_text().replace("/usr/bin/python3 -m venv", "a-venv"))
    clone.environment |= {"ASPERITY_SUITE": suite}
    errors = clone.run()[2]
    assert clone.made() == own, errors
    assert own or "making the virtual environment failed" in errors


@pytest.mark.parametrize(("compiles", "installed"), [(True, "--editable {}[solve]"), (False, "asperity[solve]==2.")])
def test_wheels_of_pypi_need_no_root(clone: Clone, compiles: bool, installed: str) -> None:
    """The clone itself where its solver/ can be compiled, else the wheel of its version."""
    tools = clone.path.parent / "tools"
    python = """#!/bin/sh
        case $* in
            *"-m venv"*) mkdir -p "$4/bin"; cp "$0" "$4/bin/python" ;;
            *"-m pip"*) echo "$*" >"$CALLS" ;;
        esac
    """
    (tools / "python3.14").write_text(python)
    (tools / "python3.14").chmod(0o755)
    script = clone.path / "run"
    script.write_text(script.read_text().replace("c++ -std", f"{str(compiles).lower()} -std"))
    clone.environment["ASPERITY_SUITE"] = "pypi"
    for _ in range(2):
        _, output, errors = clone.run()
        assert output == "inside\n", errors
    assert installed.format(clone.path) in clone.calls.read_text()
    assert clone.roots() == []


@pytest.mark.parametrize(
    ("what", "how"),
    [
        *(("cache", how) for how in ("another user", "all may write", "a group may write")),
        ("root", "a link of another"), ("root", "a group may write"), ("python", "another user"),
    ],
)  # fmt: skip
def test_what_others_may_have_written_is_not_entered(clone: Clone, what: str, how: str) -> None:
    """Neither the cache, nor the root or the clone's environment in it."""
    if "another" in how and os.geteuid():
        pytest.skip("only root can give files away")
    assert clone.run()[1] == "inside\n"
    place = clone.cache if what == "cache" else next(p for p in clone.cache.glob(f"{what}-*") if p.is_dir())
    if how == "another user":
        os.chown(place, 12345, 12345)
    elif how == "a link of another":
        place.rename(theirs := clone.path.parent / "theirs")
        os.chown(theirs, 12345, 12345)
        place.symlink_to(theirs)
    else:
        place.chmod(0o777 if how == "all may write" else 0o775)
    code, output, errors = clone.run()
    assert (code, output) == (4, "") and f"{place} belongs to another user, or others" in errors
    assert len(errors.splitlines()) == 2


def test_what_is_made_others_may_not_write_whatever_the_umask(clone: Clone) -> None:
    """The command has the umask of the user."""
    words = ["sh", "-c", 'umask 002; exec bash "$0" sh -c umask', str(clone.path / "run")]
    started = subprocess.run(words, env=clone.environment, capture_output=True, text=True)
    assert int(started.stdout, 8) == 0o002, started.stderr
    for path in (clone.cache, *clone.cache.iterdir()):
        assert not path.stat().st_mode & 0o022


def test_a_failure_says_which_step_and_what_to_do(clone: Clone) -> None:
    clone.fail.touch()
    code, _, errors = clone.run()
    assert code == 4
    assert "making the Debian trixie environment failed" in errors
    assert "E: no such mirror" in errors and "start ./run again" in errors
    assert not clone.roots()
    clone.fail.unlink()
    assert clone.run()[1] == "inside\n"
