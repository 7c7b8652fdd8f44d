"""The stages of the pipeline. A stage is declared once: a function with the decorator `stage`.

The decorator says which settings of the mine the stage depends on, and which packages hold its code. The rule of the
same name (workflow/rules) says which files it reads and writes, and its cores and memory. To add a stage, write its
function in a module of this folder, and its rule.

Modules of this folder import libraries and the mechanics within their functions: the rules import them all.
"""

import hashlib
import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from common.job import Job

if TYPE_CHECKING:
    from workflow.mine import Mine  # which a job does not need

ROOT = Path(__file__).resolve().parents[2]
MODULES = (
    *("mechanics", "catalogue", "comparison", "requests", "calibration", "baselines", "plans"),
    *("response", "shaking", "export"),
)
IMPORTS = {  # packages that the code of a package uses
    "common": (),
    "mpm_core": ("common",),
    "seismic": ("common",),
    "catalogs": ("common",),
    "calibration": ("catalogs", "common", "seismic"),
    "baselines": ("catalogs", "common", "mpm_core", "response"),
    "plans": ("baselines", "catalogs", "common"),
    "response": ("catalogs", "common", "mpm_core"),
    "export": ("catalogs", "common", "mpm_core"),
    "shaking": ("catalogs", "common"),
}

SettingsOf = Callable[["Mine", Mapping[str, str]], dict]


@dataclass(frozen=True)
class Stage:
    """A stage: run does its work; settings_of gives what it depends on, of a mine and the wildcards of its rule."""

    name: str
    run: Callable[[Job], None]
    settings_of: SettingsOf | None
    packages: tuple[str, ...]
    modules: tuple[str, ...] = ()

    @property
    def about(self) -> str:
        """Text on what the stage does: first line of its docstring, else its name."""
        return (self.run.__doc__ or self.name).strip().splitlines()[0].rstrip(".")

    def source_hash(self) -> str:
        """Hash of the code that the stage runs: its packages, those that these import, and its modules."""
        needed = {*self.packages, *(name for package in self.packages for name in IMPORTS[package])}
        digest = hashlib.sha256(package_hash(*sorted(needed)).encode())
        for module in (self.run.__module__, *self.modules):
            digest.update(b"\0" + (ROOT / f"{module.replace('.', '/')}.py").read_bytes())
        return digest.hexdigest()[:16]


_STAGES: dict[str, Stage] = {}


def stage(
    *packages: str, settings: SettingsOf | None = None, modules: tuple[str, ...] = ()
) -> Callable[[Callable[[Job], None]], Callable[[Job], None]]:
    """Declare a function as the stage of its name.

    packages: those whose code it runs. settings: of a stage whose rule gives none of its own. modules: that
    it runs besides these and its own, by their full names: of `workflow`, or single ones of other packages.
    """

    def declare(run: Callable[[Job], None]) -> Callable[[Job], None]:
        made = Stage(run.__name__, run, settings, packages, modules)
        _STAGES[made.name] = made
        return run

    return declare


@cache
def stages() -> dict[str, Stage]:
    """All stages by name."""
    for module in MODULES:
        importlib.import_module(f"{__name__}.{module}")
    return _STAGES


@cache
def package_hash(*packages: str) -> str:
    """Hash of all files of packages, of folders in them or of single modules, by their paths from the checkout.

    What Python keeps of compiled modules and hidden files are left out. Raises FileNotFoundError where there is no such
    path.
    """
    digest = hashlib.sha256()
    for package in packages:
        for path in sorted((ROOT / package).rglob("*")) or [ROOT / package]:
            parts = path.relative_to(ROOT).parts
            hidden = any(part.startswith(".") for part in parts)
            if not path.is_dir() and "__pycache__" not in parts and not hidden:
                digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]
