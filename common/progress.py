"""Messages of a running stage on the terminal: what it does, and its progress from time to time."""

import functools
import logging
import sys
import threading
import time
from types import ModuleType

from common.costs import COMPILING
from common.importing import when_imported
from common.kernel_cache import KERNEL_PACKAGES

SECONDS_TO_FIRST_LINE = 1.0  # A stage that ends sooner says only that it has ended.
SECONDS_BETWEEN_LINES = 30.0  # Seconds between two lines on the progress of a stage.


class Progress(logging.Handler):
    """Prints what the stage `name` does, and then the latest line of its log where there is no progress bar.

    It has a thread of its own, since a stage is silent while it reads, compiles or writes.
    """

    def __init__(self, name: str, does: str):
        super().__init__(logging.INFO)
        self.name, self.does, self.latest = name, does, "at work"
        self.started, self.ended = time.perf_counter(), threading.Event()
        self.thread = threading.Thread(target=self._tell, daemon=True)

    def __enter__(self) -> "Progress":
        self.thread.start()
        return self

    def __exit__(self, kind, error, traceback) -> None:
        self.ended.set()
        self.thread.join()

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a line of the log, to be printed later."""
        self.latest = record.getMessage().partition("\n")[0]

    def _tell(self) -> None:
        if not self.ended.wait(SECONDS_TO_FIRST_LINE):
            self._say(self.does)
        while not self.ended.wait(SECONDS_BETWEEN_LINES):
            if not sys.stderr.isatty():
                self._say(f"{self.latest} ({time.perf_counter() - self.started:.0f} s)")

    def _say(self, text: str) -> None:
        from tqdm import tqdm  # here: most stages end before they say anything

        tqdm.write(f"{self.name}: {text}", file=sys.stderr)  # above a bar, if there is one
        sys.stderr.flush()


def log_compilation() -> None:
    """Let the log name each kernel that is compiled, and count the time: a first run spends minutes on it.

    It begins when the stage imports numba. Most stages do not import it, and need not wait for it.
    """
    when_imported("numba.core.dispatcher", _listen)


@functools.cache  # once
def _listen(compiler: ModuleType) -> None:
    from numba.core import event

    class Named(event.Listener):
        def on_start(self, event) -> None:
            COMPILING.begin()
            kernel = event.data["dispatcher"].py_func
            if kernel.__module__.partition(".")[0] in KERNEL_PACKAGES:  # not numba's own
                logging.info("compiling %s, for the first run of this version", kernel.__name__)

        def on_end(self, event) -> None:
            COMPILING.end()

    event.register("numba:compile", Named())
