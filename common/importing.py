"""Actions run once a module of another package is imported: numba takes a second, and most processes never need it."""

import importlib.util
import sys
from collections.abc import Callable
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import ClassVar

Action = Callable[[ModuleType], None]


class _WhenImported:
    """Import hook for the modules that somebody waits for."""

    waiting: ClassVar[dict[str, list[Action]]] = {}

    @classmethod
    def find_spec(cls, name: str, path=None, target=None) -> ModuleSpec | None:
        """Called before each import."""
        if name not in cls.waiting:
            return None
        actions = cls.waiting.pop(name)
        spec = importlib.util.find_spec(name)
        assert spec is not None  # its package is being imported
        assert spec.loader is not None
        load = spec.loader.exec_module

        def load_and_act(module: ModuleType) -> None:
            load(module)
            for action in actions:
                action(module)

        spec.loader.exec_module = load_and_act  # type: ignore[method-assign]
        return spec


def when_imported(name: str, action: Action) -> None:
    """Call `action` with the module of this name: now if it is imported already, else as soon as it is."""
    if name in sys.modules:
        action(sys.modules[name])
        return
    if _WhenImported not in sys.meta_path:
        sys.meta_path.insert(0, _WhenImported)  # type: ignore[arg-type]
    actions = _WhenImported.waiting.setdefault(name, [])
    if action not in actions:
        actions.append(action)
