"""Hard cases: scenes where a contact solver is likely to fail, each run to its end or refused with a reason.

Every scene is run as `asperity run` would, in a folder of its own, and judged: it ends as it should, passes the
checks of `asperity.quasistatic.balance` at every step, agrees with its twin (the same problem solved in another way) and with
what theory says of it. A scene that stops leaves its curve and a checkpoint to continue from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from asperity.errors import InputError

if TYPE_CHECKING:
    from asperity.stress.outcome import Outcome


def stress(
    names: Iterable[str] = (), fast: bool = False, on_outcome: Callable[[Outcome], None] | None = None
) -> list[Outcome]:
    """Run scenes and judge them, on this process alone.

    Args:
        names: of scenes, patterns like "units*" allowed; all when empty
        fast: only those of the short suite
        on_outcome: called after each scene

    Raises:
        InputError: a name that no scene has
    """
    from asperity.stress.outcome import run_scene
    from asperity.stress.scenes import SCENES

    names = tuple(names)
    for name in names:
        if not any(fnmatchcase(scene.name, name) for scene in SCENES):
            groups = ", ".join(dict.fromkeys(scene.group for scene in SCENES))
            raise InputError(f'no scene is named "{name}"; scenes begin with {groups}: give a name or "GROUP*"')
    out = []
    for scene in SCENES:
        if (not names or any(fnmatchcase(scene.name, name) for name in names)) and (scene.fast or not fast):
            out.append(run_scene(scene))
            if on_outcome is not None:
                on_outcome(out[-1])
    return out
