"""Exceptions whose messages are written for the user."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager


class InputError(Exception):
    """A user's mistake or a scene that cannot be solved: one line that says where, what, and what to do."""

    def __init__(self, message: str):
        super().__init__(" ".join(message.split()))

    @property
    def lines(self) -> tuple[str, ...]:
        """Its mistakes, one each."""
        return (str(self),)


class InputErrors(InputError):
    """Several mistakes at once, a line each."""

    def __init__(self, lines: Iterable[str]):
        self._lines = tuple(" ".join(line.split()) for line in lines)
        Exception.__init__(self, "\n".join(self._lines))

    def __reduce__(self) -> tuple:
        """From one process to another: made of its lines again, not of their text."""
        return type(self), (self._lines,)

    @property
    def lines(self) -> tuple[str, ...]:
        """Its mistakes, one each."""
        return self._lines


class Mistakes:
    """Gathers mistakes, so that one does not hide the others."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    @contextmanager
    def gather(self) -> Iterator[None]:
        """Keep what is raised within as InputError."""
        try:
            yield
        except InputError as error:
            self.lines += error.lines

    def add(self, line: str) -> None:
        """Keep a mistake."""
        with self.gather():
            raise InputError(line)
