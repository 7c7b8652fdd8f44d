"""Files of compiled kernels that several processes may write at the same time, on one machine or on many."""

import hashlib
import importlib.util
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType

CACHING = "numba.core.caching"


class _WithCaching:
    """Import hook: numba is changed as it is imported. It takes a second, and most processes never import it."""

    @staticmethod
    def find_spec(name: str, path=None, target=None) -> ModuleSpec | None:
        """Called before each import."""
        if name != CACHING:
            return None
        sys.meta_path.remove(_WithCaching)  # type: ignore[arg-type]
        spec = importlib.util.find_spec(name)
        assert spec is not None  # numba has it
        assert spec.loader is not None
        load = spec.loader.exec_module

        def load_and_change(module: ModuleType) -> None:
            load(module)
            _change(module)

        spec.loader.exec_module = load_and_change  # type: ignore[method-assign]
        return spec


def name_kernel_files() -> None:
    """Make numba name the file of a compiled kernel by what it was compiled for: types, processor, code.

    Numba takes the first number that the kernel's index leaves free. Processes that compile the kernel at the same time
    for different types, or on machines with different processors, take the same one. The index of one may then name the
    file of the other. With names of their own the index can only lose an entry, and the kernel is compiled again.
    """
    if CACHING in sys.modules:
        _change(sys.modules[CACHING])
    elif _WithCaching not in sys.meta_path:
        sys.meta_path.insert(0, _WithCaching)  # type: ignore[arg-type]


def _change(caching: ModuleType) -> None:
    caching.IndexDataCacheFile.save = _save


def _save(self, key, data) -> None:
    """Write the compiled kernel, then the index that names its file. In place of numba's IndexDataCacheFile.save."""
    name = self._data_name(int(hashlib.sha256(repr(key).encode()).hexdigest()[:16], 16))
    self._save_data(name, data)
    self._save_index(self._load_index() | {key: name})
