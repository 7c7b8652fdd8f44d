"""What a stage took: said in the closing line of its log, and read back from there.

Processor time is the process's own, of all its threads. Wall time scatters by a factor of several on a machine that
does other things too, and who looks from outside now and then (Snakemake's benchmark files) misses a process's end.
"""

import os
import re
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
    """Of a stage. seconds: wall time; processor: user and system time of all threads, s; compiling: what of that went
    into kernels, s, which the next run finds compiled; memory: largest resident, MiB."""

    seconds: float
    processor: float
    compiling: float
    memory: float

    @property
    def running(self) -> float:
        """Processor time that every run takes, s: that of compiling is left out."""
        return self.processor - self.compiling

    def closing_line(self, stage: str) -> str:
        """Last line of a finished stage's log."""
        compiling = f", {self.compiling:.2f} s of it compiling" if self.compiling else ""
        return (
            f"{stage} done in {self.seconds:.2f} s ({self.processor:.2f} s of processor time{compiling}),"
            f" peak memory {self.memory:.0f} MiB"
        )


def cost_of(log: str | os.PathLike) -> Costs | None:
    """What the stage with this log took; None of one that has not finished, or left no log."""
    try:
        lines = Path(log).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return None
    found = CLOSING.search(lines[-1]) if lines else None
    return Costs(**{key: float(value or 0.0) for key, value in found.groupdict().items()}) if found else None


class Compiling:
    """Processor time that this process has spent compiling, s. One kernel compiles others: the outermost counts."""

    def __init__(self):
        self.seconds = 0.0
        self._here = threading.local()  # threads compile one at a time, but others may run meanwhile

    def begin(self) -> None:
        """A kernel is compiled on this thread from now on."""
        self._here.depth = getattr(self._here, "depth", 0) + 1
        if self._here.depth == 1:
            self._here.since = time.thread_time()

    def end(self) -> None:
        """It is compiled."""
        self._here.depth -= 1
        if self._here.depth == 0:
            self.seconds += time.thread_time() - self._here.since


COMPILING = Compiling()  # of this process


class Clock:
    """What the stage at work has taken so far, of which processes that were killed may have done a part."""

    def __init__(self):
        self.start()

    def start(self) -> None:
        """The stage begins."""
        self._since = time.perf_counter(), time.process_time(), COMPILING.seconds
        self._earlier = 0.0, 0.0, 0.0

    def taken(self) -> tuple[float, float, float]:
        """Wall time, processor time and what of that was compiling, s, with those of earlier processes."""
        now = time.perf_counter(), time.process_time(), COMPILING.seconds
        wall, processor, compiling = (
            earlier + until - since for earlier, until, since in zip(self._earlier, now, self._since, strict=True)
        )
        return wall, processor, compiling

    def go_on(self, taken: Iterable[float]) -> None:
        """An earlier process had taken so much up to where this one goes on from."""
        wall, processor, compiling = taken
        self._earlier = float(wall), float(processor), float(compiling)


CLOCK = Clock()  # of this process
