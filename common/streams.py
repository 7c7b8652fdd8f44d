"""Streams to a terminal that may go away while a run goes on: a window that closes, `| head`, a lost connection."""

import errno
import os
import sys
from typing import Any, TextIO


class Outlasting:
    """A stream that drops what is written after its reader is gone. In all else it is the stream itself."""

    def __init__(self, stream: TextIO | None):
        """stream: None where the process was started without it."""
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def isatty(self) -> bool:
        """True if the stream is a terminal."""
        return self._stream is not None and self._stream.isatty()

    def write(self, text: str) -> int:
        """Write text; returns the number of its characters."""
        try:
            if self._stream is not None:
                self._stream.write(text)
        except OSError as error:
            self._drop(error)
        return len(text)

    def flush(self) -> None:
        """Write what is buffered."""
        try:
            if self._stream is not None:
                self._stream.flush()
        except OSError as error:
            self._drop(error)

    def _drop(self, error: OSError) -> None:
        """Lead the file descriptor, which other writers and later processes share, to nowhere; raise an error that has
        another cause than a reader that is gone."""
        assert self._stream is not None
        # BrokenPipeError of a pipe, ConnectionResetError of a socket; EIO of a terminal
        if not isinstance(error, ConnectionError) and error.errno != errno.EIO:
            raise error
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._stream.fileno())
        os.close(nowhere)


def outlast_terminal() -> None:
    """Let this process go on if nobody reads its standard error any more."""
    if not isinstance(sys.stderr, Outlasting):
        sys.stderr = Outlasting(sys.stderr)  # type: ignore[assignment]  # a stream in all that is asked of it
