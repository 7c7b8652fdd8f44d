"""Warnings of a stage on the terminal as well as in its log, for users who do not read the log."""

import logging
import sys

from tqdm import tqdm


class ToTerminal(logging.Handler):
    """A line to stderr for each warning of this project, above a progress bar; libraries log under other names."""

    def __init__(self, stage: str):
        super().__init__(logging.WARNING)
        self.stage = stage

    def emit(self, record: logging.LogRecord) -> None:
        """Print a warning. Errors end the stage, which prints them itself."""
        if record.name == "root" and record.levelno == logging.WARNING:
            tqdm.write(f"{self.stage}: {' '.join(record.getMessage().split())}", file=sys.stderr)
