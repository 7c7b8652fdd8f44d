"""Files of compiled kernels that several processes may write at the same time, on one machine or on many."""

import fcntl
import functools
import hashlib
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

from common.importing import when_imported

LOCK_FILE = "compiling.lock"
MAX_WAIT = 60.0  # s; longer than a kernel takes. Some file systems keep the locks of a machine that is lost.
SECONDS_BETWEEN_LOOKS = 0.05


def share_kernel_files() -> None:
    """Make numba name the file of a compiled kernel by what it was compiled for (types, processor, code), and wait for
    a kernel that another process compiles.

    Numba takes the first number that the kernel's index leaves free. Processes that compile the kernel at the same time
    for different types, or on machines with different processors, take the same one. The index of one may then name the
    file of the other. With names of their own the index can only lose an entry, and the kernel is compiled again.
    """
    when_imported("numba.core.caching", _name_files)
    when_imported("numba.core.dispatcher", _wait_for_others)


def _name_files(caching: ModuleType) -> None:
    caching.IndexDataCacheFile.save = _save


@functools.cache  # once
def _wait_for_others(dispatcher: ModuleType) -> None:
    """Let one process at a time compile a kernel; the others wait and read the compiled code from its file."""
    compile_or_read = dispatcher.Dispatcher.compile

    def compile_alone(self, sig):
        if isinstance(sig, tuple) and sig in self.overloads:
            return compile_or_read(self, sig)
        with dispatcher.global_compiler_lock, _locked(self, sig):
            return compile_or_read(self, sig)

    dispatcher.Dispatcher.compile = compile_alone


@contextmanager
def _locked(kernel, types) -> Iterator[None]:
    """Hold the lock of a stored kernel for these types: a byte of one file, by number.

    The system frees it if the process dies. Without locks on this file system, or after MAX_WAIT, goes on without it.
    """
    files = getattr(kernel._cache, "_cache_file", None)
    if files is None:
        yield
        return
    number = int(hashlib.sha256(repr((files._index_name, types)).encode()).hexdigest()[:15], 16)
    until, held = time.monotonic() + MAX_WAIT, False
    while not held and time.monotonic() < until:
        try:
            fcntl.lockf(_lock_file(files._cache_path), fcntl.LOCK_EX | fcntl.LOCK_NB, 1, number)
            held = True
        except BlockingIOError:
            time.sleep(SECONDS_BETWEEN_LOOKS)
        except OSError:
            break
    try:
        yield
    finally:
        if held:
            fcntl.lockf(_lock_file(files._cache_path), fcntl.LOCK_UN, 1, number)


@functools.cache
def _lock_file(folder: str) -> int:
    """The file of locks in a folder. It stays open: closing it would free all locks of the process."""
    return os.open(os.path.join(folder, LOCK_FILE), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)


def _save(self, key, data) -> None:
    """Write the compiled kernel, then the index that names its file. In place of numba's IndexDataCacheFile.save."""
    name = self._data_name(int(hashlib.sha256(repr(key).encode()).hexdigest()[:16], 16))
    self._save_data(name, data)
    self._save_index(self._load_index() | {key: name})
