"""Programs that `benchmarks/peers/install` has unpacked, and how they start without being installed."""

from __future__ import annotations

import os
from pathlib import Path

PEERS = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "asperity" / "peers"
LOADER = "ld-linux-x86-64.so.2"


def inside(suite: str, program: str) -> tuple[list[str], dict[str, str]]:
    """Command and environment of a program of an unpacked Debian, run by that one's own loader and libraries."""
    root = PEERS / suite
    places = [root / "usr/lib/x86_64-linux-gnu", root / "lib/x86_64-linux-gnu"]
    # the links in lib64 are absolute, and lead to the loader of the surrounding system
    loader = next((p / LOADER for p in places if (p / LOADER).exists()), Path(LOADER))
    paths = [places[0] / "openblas-pthread", *places]
    command = [str(loader), "--library-path", ":".join(map(str, paths)), str(root / program)]
    return command, {"PYTHONHOME": str(root / "usr"), "PYTHONPATH": str(PEERS / "pypi")}
