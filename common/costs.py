"""Time and memory of a stage: written into the closing line of its log, and read from there.

Processor time is that of all threads of the process, and of the processes that it started. Wall time varies by a factor
of several on a busy machine.
"""

import os
import re
import resource
import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

CLOSING = re.compile(
    r" done in (?P<seconds>[0-9.]+) s \((?P<processor>[0-9.]+) s of processor time"
    r"(?:, (?P<compiling>[0-9.]+) s of it compiling)?\), peak memory (?P<memory>[0-9]+) MiB$"
)


@dataclass(frozen=True)
class Costs:
    """Costs of a stage. seconds: wall time; processor: user and system time, s; compiling: the part of it that compiled
    kernels, s, which the next run reuses; memory: largest resident memory of one process, MiB."""

    seconds: float
    processor: float
    compiling: float
    memory: float

    @property
    def running(self) -> float:
        """Processor time of every run, s: without compiling."""
        return self.processor - self.compiling

    @property
    def next_seconds(self) -> float:
        """Wall time of another run, s: kernels compile in the first one only, and take their share of it."""
        return self.seconds * self.running / self.processor if self.processor else self.seconds

    def closing_line(self, stage: str) -> str:
        """Last line of a finished stage's log."""
        compiling = f", {self.compiling:.2f} s of it compiling" if self.compiling else ""
        return (
            f"{stage} done in {self.seconds:.2f} s ({self.processor:.2f} s of processor time{compiling}),"
            f" peak memory {self.memory:.0f} MiB"
        )


def cost_of(log: str | os.PathLike) -> Costs | None:
    """Costs of the stage with this log; None if it has not finished or has no log."""
    try:
        lines = Path(log).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return None
    found = CLOSING.search(lines[-1]) if lines else None
    return Costs(**{key: float(value or 0.0) for key, value in found.groupdict().items()}) if found else None


def duration_text(seconds: float) -> str:
    """A time in the unit that suits it.

    >>> duration_text(0.2), duration_text(130.0), duration_text(9000.0)
    ('1 s', '2 min', '2.5 h')
    """
    if seconds < 90.0:
        return f"{max(round(seconds), 1)} s"
    return f"{round(seconds / 60)} min" if seconds < 5400.0 else f"{seconds / 3600:.1f} h"


def processor_time() -> float:
    """User and system time so far, s: of all threads of this process, and of those that it started and that ended."""
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + ended.ru_utime + ended.ru_stime


class Compiling:
    """Processor time that this process has spent compiling, s. One kernel compiles others: the outermost counts."""

    def __init__(self):
        self.seconds = 0.0
        self._here = threading.local()  # threads compile one at a time, but others may run meanwhile

    def begin(self) -> None:
        """Note that this thread begins to compile a kernel."""
        self._here.depth = getattr(self._here, "depth", 0) + 1
        if self._here.depth == 1:
            self._here.since = time.thread_time()

    def end(self) -> None:
        """Note that the kernel is compiled."""
        self._here.depth -= 1
        if self._here.depth == 0:
            self.seconds += time.thread_time() - self._here.since


COMPILING = Compiling()  # of this process


def running_time() -> float:
    """Processor time of this process so far, without compiling, s."""
    return processor_time() - COMPILING.seconds


class Clock:
    """Costs of the running stage so far, including those of earlier processes that were killed."""

    def __init__(self):
        self.start()

    def start(self) -> None:
        """The stage begins."""
        self._since = time.perf_counter(), processor_time(), COMPILING.seconds
        self._earlier = 0.0, 0.0, 0.0

    def taken(self) -> tuple[float, float, float]:
        """Wall time, processor time and its compiling part, s, including earlier processes."""
        now = time.perf_counter(), processor_time(), COMPILING.seconds
        wall, processor, compiling = (
            earlier + until - since for earlier, until, since in zip(self._earlier, now, self._since, strict=True)
        )
        return wall, processor, compiling

    def go_on(self, taken: Iterable[float]) -> None:
        """Add the costs of an earlier process, up to the point from which this one continues."""
        wall, processor, compiling = taken
        self._earlier = float(wall), float(processor), float(compiling)


CLOCK = Clock()  # of this process
