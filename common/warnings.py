"""What a stage warns of, told on the terminal as well as in its log: a user who reads no log decides by it, too."""

import logging
import sys

from tqdm import tqdm


class ToTerminal(logging.Handler):
    """A line to stderr for each of our own warnings, above a progress bar; libraries log under names of their own."""

    def __init__(self, stage: str):
        super().__init__(logging.WARNING)
        self.stage = stage

    def emit(self, record: logging.LogRecord) -> None:
        """Tell a warning; errors end the stage, which tells them itself."""
        if record.name == "root" and record.levelno == logging.WARNING:
            tqdm.write(f"{self.stage}: {' '.join(record.getMessage().split())}", file=sys.stderr)
