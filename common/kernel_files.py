"""Files of compiled kernels that several processes may write at the same time, on one machine or on many."""

import hashlib
from types import ModuleType

from common.importing import when_imported


def name_kernel_files() -> None:
    """Make numba name the file of a compiled kernel by what it was compiled for: types, processor, code.

    Numba takes the first number that the kernel's index leaves free. Processes that compile the kernel at the same time
    for different types, or on machines with different processors, take the same one. The index of one may then name the
    file of the other. With names of their own the index can only lose an entry, and the kernel is compiled again.
    """
    when_imported("numba.core.caching", _change)


def _change(caching: ModuleType) -> None:
    caching.IndexDataCacheFile.save = _save


def _save(self, key, data) -> None:
    """Write the compiled kernel, then the index that names its file. In place of numba's IndexDataCacheFile.save."""
    name = self._data_name(int(hashlib.sha256(repr(key).encode()).hexdigest()[:16], 16))
    self._save_data(name, data)
    self._save_index(self._load_index() | {key: name})
