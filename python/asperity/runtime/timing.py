"""Wall-clock time: per phase of a run, and of a job with its serial part."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field


@dataclass
class Phases:
    """Wall-clock time [s] and number of calls of each named phase; phases must not be nested."""

    seconds: dict[str, float] = field(default_factory=dict)
    calls: dict[str, int] = field(default_factory=dict)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Add the time of a with-block to the phase `name`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
            self.calls[name] = self.calls.get(name, 0) + 1


@dataclass
class Clock:
    """Time of a job, and its serial part: on rank 0 what it worked while others waited, or would have; else 0 [s]."""

    alone: float = 0.0
    began: float = field(default_factory=time.perf_counter)

    @property
    def wall(self) -> float:
        """Time since the job began [s]."""
        return time.perf_counter() - self.began


_clock: ContextVar[Clock | None] = ContextVar("clock", default=None)  # of the job under way


@contextmanager
def clocked() -> Iterator[Clock]:
    """Measure the job in a with-block."""
    clock = Clock()
    token = _clock.set(clock)
    try:
        yield clock
    finally:
        _clock.reset(token)


def count_alone(seconds: float) -> None:
    """Add to the serial part of the job under way."""
    if (clock := _clock.get()) is not None:
        clock.alone += seconds
