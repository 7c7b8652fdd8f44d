"""The body of every command line: a log of its own, one line to the user, and no orphan processes."""

import ctypes
import logging
import os
import resource
import signal
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

from common.costs import CLOCK, Costs
from common.disk import full_one, no_room
from common.errors import InputError
from common.progress import Progress, log_compilation
from common.result_folders import notes_on
from common.streams import outlast_terminal

PR_SET_PDEATHSIG = 1  # prctl(2): the signal a process gets when its parent ends
PARENT = "PARENT_OF_STAGE"  # environment variable: the process that has started the stage
INTERRUPTED = 130  # what a shell makes of SIGINT


def die_with_parent(parent: int | None = None) -> None:
    """Ask Linux to end this process when its parent does, so that a killed pipeline leaves no stage behind.

    parent: its number, if it is known. If it ended before this call, this process ends now.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if parent is not None and parent != os.getppid():
            os._exit(1)


class ToTerminal(logging.Handler):
    """A line to stderr for each warning of this project, above a progress bar, for users who do not read the log.

    Libraries log under other names.
    """

    def __init__(self, stage: str):
        super().__init__(logging.WARNING)
        self.stage = stage

    def emit(self, record: logging.LogRecord) -> None:
        """Print a warning. Errors end the stage, which prints them itself."""
        if record.name == "root" and record.levelno == logging.WARNING:
            from tqdm import tqdm  # here: few stages warn

            tqdm.write(f"{self.stage}: {' '.join(record.getMessage().split())}", file=sys.stderr)


class LogFile(logging.FileHandler):
    """A log that does not report each line that a full disk refuses; `lost` is the reason."""

    lost: BaseException | None = None

    def handleError(self, record: logging.LogRecord) -> None:
        """Remember why a line is missing."""
        self.lost = sys.exc_info()[1]


def start_log(log: str | os.PathLike | None, progress: Progress) -> LogFile | None:
    """Lines go to the file `log` and to `progress`, warnings to the terminal too; to stderr where there is no file."""
    if log:
        Path(log).parent.mkdir(parents=True, exist_ok=True)
    file = LogFile(log, mode="w") if log else None
    logging.basicConfig(
        level=logging.INFO,
        handlers=[file, progress, ToTerminal(str(progress.name))] if file else [logging.StreamHandler(sys.stderr)],
        format="%(asctime)s %(levelname)s %(message)s",
        force=True,
    )
    return file


def run_stage(name: str, log: str | os.PathLike | None, function: Callable[[], None], does: str = "at work") -> None:
    """Run `function` as stage `name`: tracebacks to `log`, one line to stderr, exit status 1 on error.

    does: what it does, in words (the first line of a docstring), shown if it takes longer than a moment.
    """
    die_with_parent(int(os.environ[PARENT]) if PARENT in os.environ else None)
    outlast_terminal()
    CLOCK.start()
    progress = Progress(name, f"{does.strip().splitlines()[0].rstrip('.')}; log: {log}")
    whose = name + "".join(f" ({note})" for note in notes_on(name))
    file = None
    try:
        file = start_log(log, progress)
        log_compilation()
        with progress if log else nullcontext():
            function()
    except InputError as error:
        if file:  # without one, the line below is all
            logging.exception("stage failed")
        sys.exit("\n".join(f"{whose}: {line}" for line in error.lines))
    except MemoryError:
        logging.exception("out of memory")
        sys.exit(
            f"{whose}: out of memory; larger cells (grid.finest_cell, or grid.coarse_cell) or fewer grid.buffer_cells "
            "need less"
        )
    except KeyboardInterrupt:
        logging.info("ended on the user's request")
        sys.exit(INTERRUPTED)
    except Exception as error:  # a fault of ours: the user gets one line, the log the traceback
        if file or not log:
            logging.exception("stage failed unexpectedly")
        named = getattr(error, "filename", None)
        written = [os.environ.get("NUMBA_CACHE_DIR", "."), Path(log).parent if log else "."]  # besides whole files
        if full := no_room(error, Path(named).parent if named else full_one(written)):
            sys.exit(f"{whose}: {full}")
        sys.exit(f"{whose}: unexpected {type(error).__name__}: {error}; traceback in {log or 'the log above'}")
    peaks = [resource.getrusage(whose).ru_maxrss for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    unit = 1024**2 if sys.platform == "darwin" else 1024  # a peak in MiB: of bytes there, of KiB on Linux
    costs = Costs(*CLOCK.taken(), memory=max(peaks) / unit)
    logging.info("%s", costs.closing_line(name))  # common.costs reads it back: nothing comes after it
    if file:
        cut = f"; its log {log} is cut short: {file.lost}" if file.lost else ""
        spent = f"{costs.seconds:.1f} s ({costs.processor:.1f} s of processor time), {costs.memory:.0f} MiB"
        print(f"{name}: {spent}{cut}", file=sys.stderr)
