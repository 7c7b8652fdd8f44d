"""Which arrays hold the memory of a stage at its peak: what numpy allocates, by the line of code that does."""

import linecache
import threading
import tracemalloc
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from workflow import BASE
from workflow.configuration import load_mine
from workflow.run_mine import run_stages

MINE = BASE / "config" / "mines" / "demo.yaml"
STAGES = ("grid", "elastic", "steps/history")
FRAMES = 6  # Callers that are kept of each allocation: the line in mpm_core that wants the array is among them.
PAUSE = 0.02  # Time between two looks at the memory, s.
MIN_GROWTH = 1.02  # The memory is looked into where it exceeds its former peak by this factor.
MIN_BYTES_PER_CELL = 5.0  # Smaller parts are summed up.


class Peak:
    """The lines that hold the memory at its peak, since it was last forgotten: bytes by (file, line)."""

    def __init__(self) -> None:
        self.lines: Counter[tuple[str, int]] = Counter()
        self.most = 0

    def look(self) -> None:
        """Note who holds the memory if there is more of it than before."""
        size = tracemalloc.get_traced_memory()[0]
        if size < MIN_GROWTH * self.most:
            return
        self.most, self.lines = size, Counter()
        for trace in tracemalloc.take_snapshot().traces:
            self.lines[_wanted_by(trace.traceback)] += trace.size


def _wanted_by(frames: tracemalloc.Traceback) -> tuple[str, int]:
    """File and line of the project that asked for an array: the innermost one of mpm_core, else of all."""
    own = [frame for frame in frames if "mpm_core" in frame.filename]
    frame = own[-1] if own else frames[-1]
    return frame.filename, frame.lineno


@contextmanager
def watched(peak: Peak) -> Iterator[None]:
    """Look at the memory every PAUSE."""
    ended = threading.Event()

    def watch() -> None:
        while not ended.wait(PAUSE):
            peak.look()

    watcher = threading.Thread(target=watch)
    tracemalloc.start(FRAMES)
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        watcher.join()
        tracemalloc.stop()


def rows_of_arrays() -> list[dict]:
    """Rows of the stages of the demo up to its history: stage, file, line of code, bytes per cell at the peak."""
    slices, rows = load_mine(MINE).run_slices(extracted_as=[]), []
    with TemporaryDirectory() as folder:
        for _ in _first_stages(slices, Path(folder)):
            pass  # kernels are compiled, and what is imported on the way is there
        peak = Peak()
        with watched(peak):
            for stage, cells in _first_stages(slices, Path(folder)):
                rows += [{"stage": stage, **row} for row in _lines_of(peak, cells)]
                peak.most, peak.lines = 0, Counter()
    return rows


def _first_stages(slices: dict, folder: Path) -> Iterator[tuple[str, int]]:
    """Compute STAGES; each when it has ended, with its number of cells."""
    for stage, dataset, _ in run_stages(slices, folder / "failed.npz"):
        if stage in STAGES:
            yield stage, dataset.sizes["cell"]
        if stage == STAGES[-1]:
            return


def _lines_of(peak: Peak, cells: int) -> Iterator[dict]:
    rest = 0.0
    for (file, line), size in peak.lines.most_common():
        if size / cells < MIN_BYTES_PER_CELL:
            rest += size / cells
            continue
        path = Path(file)
        named = path.relative_to(BASE).as_posix() if path.is_relative_to(BASE) else path.name
        yield {"file": named, "code": linecache.getline(file, line).strip(), "bytes_per_cell": size / cells}
    yield {"file": "", "code": "all that is smaller", "bytes_per_cell": rest}
