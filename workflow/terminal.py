"""Messages on the terminal while the pipeline runs: a line for each stage, progress, and Snakemake's errors.

Snakemake's `quiet: all` would hide a locked folder or a missing input too, and without it a failed stage is echoed as a
shell command. Its log file (.snakemake/log) keeps everything. The stage of a job on a cluster writes to a file, so what
ended the job is said here.
"""

import logging
import re
import sys
from pathlib import Path

from snakemake.logging import ColorizingTextHandler
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

from common.disk import NO_ROOM as NO_ROOM_ERRORS
from common.disk import disk_full
from common.streams import Outlasting, outlast_terminal

QUIET_EVENTS = (LogEvent.WORKFLOW_STARTED, LogEvent.JOB_FINISHED, LogEvent.JOB_STARTED, LogEvent.RESOURCES_INFO)
SHOWN = (
    "Nothing to be done",
    "This was a dry-run",
    "Reasons:",
    "Unlocking",
    "Congratulations",
)  # of what Snakemake says of no event
SAID_BEFORE = ("Exiting because a job", "WorkflowError:\nAt least one job did not complete")  # by the stage itself
LOOK_ELSEWHERE = "For further error details"  # of every job on a cluster
NO_ROOM = re.compile(rf"\[Errno (?:{'|'.join(str(number) for number in NO_ROOM_ERRORS)})\] ([^:)\n]*)")


class OneLine(logging.Filter):
    """Filter of Snakemake's minor messages, and of the echo of a failed command whose stage has given the reason.

    The table of jobs comes once: a dry run would show it before and after its list of jobs, which is left out.
    """

    table_is_shown = False
    full = False  # whether the user has been told that the disk is full

    def filter(self, record: logging.LogRecord) -> bool:
        """False for a record that says nothing to the user."""
        event, text = getattr(record, "event", None), str(record.msg)
        if event == LogEvent.RUN_INFO:
            shown, self.table_is_shown = self.table_is_shown, True
            return not shown
        if event == LogEvent.PROGRESS:
            done, total = vars(record)["done"], vars(record)["total"]
            # Snakemake calls them steps, which are the months of a mine
            record.msg = f"{done} of {total} jobs ({done / total:.0%}) done"
            vars(record)["event"] = None
            return True
        if event in QUIET_EVENTS or text.startswith(SAID_BEFORE):
            return False
        if event is None and record.levelno < logging.WARNING:
            return text.startswith(SHOWN)
        if event == LogEvent.JOB_ERROR and (rule_message := vars(record)["rule_msg"]):  # on a cluster
            reason = rule_message.partition(LOOK_ELSEWHERE)[0].splitlines()[0].rstrip(".")
            output = vars(record)["output"][0].split(" (")[0]
            record.msg = f"{output}: {reason}; see {' and '.join(vars(record)['log'])}"
            vars(record)["event"] = None  # Snakemake's filter would drop the record
        elif full := NO_ROOM.search(text):
            said, self.full = self.full, True
            folder = re.search(r"directory (/.*)|: '(/[^'\n]*)'", text)
            record.msg = disk_full(full[1], Path.cwd() if folder is None else folder[1] or Path(folder[2]).parent)
            return not said
        elif event == LogEvent.ERROR and "CalledProcessError" in text:
            if "exit status" in text:  # the stage has said why
                return False
            output = re.search(r"--output (\S+)", text)
            end = text.rstrip().rsplit("' ", 1)[-1]  # "died with <Signals.SIGKILL: 9>."
            record.msg = f"{output[1] if output else 'a stage'}: {end} Was it ended, or is the system out of memory?"
        return True


class LogHandler(LogHandlerBase):
    """The terminal as Snakemake's logger plugin `mine`, which profiles/default registers and selects.

    Snakemake finds plugins among installed packages alone; a workflow that is run from its folder is none.
    """

    writes_to_stream = True
    writes_to_file = False
    has_filter = False  # Snakemake's own, of `quiet`, comes after ours
    has_formatter = False
    needs_rulegraph = False

    def __post_init__(self) -> None:
        """Write as Snakemake itself does, in its colours, to its stream, as long as somebody reads it."""
        outlast_terminal()
        stream = Outlasting(sys.stdout) if self.common_settings.stdout else sys.stderr
        self.text = ColorizingTextHandler(nocolor=self.common_settings.nocolor, stream=stream)
        # Python would print a traceback for each line that a full disk keeps from Snakemake's log file.
        logging.raiseExceptions = False
        self.addFilter(OneLine())

    def setFormatter(self, formatter: logging.Formatter | None) -> None:
        """Pass the formatter to the handler that writes."""
        self.text.setFormatter(formatter)

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record that the filters have let pass."""
        self.text.emit(record)
