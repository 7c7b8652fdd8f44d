"""Independent parts of a stage in processes beside each other, each of them a copy of the stage's own."""

import gc
import multiprocessing
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from common.errors import InputError
from common.stage import die_with_parent

Parts = Mapping[str, Callable[[], Any]]
KILLED = (
    "the system has killed a process of this stage, as it does for lack of memory; run it again, with --cores 1 if it "
    "happens again"
)


def call_all(parts: Parts, processes: int) -> dict[str, Any]:
    """Results of all parts, by name. Parts are called in their order: that which takes longest should come first.

    Raises what the first of those that fail raises. What a part does to objects of the stage stays in its process. With
    one process, and on systems other than Linux, parts are called here, one after the other.
    """
    processes = min(processes, len(parts)) if sys.platform == "linux" else 1
    with _frozen_heap():
        return _in_processes(parts, processes) if processes > 1 else {name: part() for name, part in parts.items()}


@contextmanager
def _frozen_heap() -> Iterator[None]:
    """Spare the garbage collector what is there already, the libraries above all: it would scan that again and again,
    and write to the memory that processes share."""
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def _in_processes(parts: Parts, processes: int) -> dict[str, Any]:
    """Results of all parts, by name, called in several forked processes, which end with this one, whatever ends it.

    Raises InputError if a process is killed, otherwise what the first part that fails raises.
    """
    pool = ProcessPoolExecutor(processes, multiprocessing.get_context("fork"), _begin, (parts,))
    try:
        called = {name: pool.submit(_call, name) for name in parts}
        return {name: part.result() for name, part in called.items()}
    except BaseException as error:  # one has failed, or the user has interrupted the stage: nobody waits for the others
        for child in multiprocessing.active_children():
            child.kill()
        if isinstance(error, BrokenProcessPool):
            raise InputError(KILLED) from error
        raise
    finally:
        pool.shutdown()


_parts: Parts = {}  # of this process


def _begin(parts: Parts) -> None:
    """In a new process, which has inherited the parts: they need not be such as can be sent to it."""
    global _parts
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the stage ends its processes
    die_with_parent()
    _parts = parts


def _call(name: str) -> Any:
    return _parts[name]()
