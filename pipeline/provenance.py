"""What a dataset was made from: configuration, sources and package versions, never the time of day."""

import hashlib
import json
import os
import shutil
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

from pipeline.sources import ROOT, source_hash

PACKAGES = ("numpy", "numba", "scipy", "scikit-learn", "xarray", "netCDF4", "obspy")
KERNEL_PACKAGES = ("mpm_core", "seismic")
CACHES_KEPT = 3


def config_hash(slice_: dict) -> str:
    """Hash of a configuration slice, independent of key order and of the folder that its files are in."""

    def without_folder(pairs: list[tuple]) -> dict:
        return {key: Path(value).name if key == "file" and isinstance(value, str) else value for key, value in pairs}

    text = json.dumps(slice_, sort_keys=True)
    if '"file"' in text:  # else as it is: a large mine has hundreds of slices of thousands of excavations
        text = json.dumps(json.loads(text, object_pairs_hook=without_folder), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def provenance(slice_: dict, command: str) -> dict[str, str]:
    """Attributes that every dataset carries: config_hash, source_hash, versions (JSON).

    command: the stage that makes it, as pipeline.sources has it ("mpm_core grid").
    """
    return {
        "config_hash": config_hash(slice_),
        "source_hash": source_hash(command),
        "versions": json.dumps({name: version(name) for name in PACKAGES}),
    }


def _last_use(path: Path) -> float:
    """Time stamp of a cache folder; 0 if another process has removed it meanwhile."""
    return path.stat().st_mtime if path.exists() else 0.0


def _user_cache() -> Path:
    """The user's folder for kernels, where the XDG base directory specification has it."""
    home = os.environ.get("XDG_CACHE_HOME") or Path("~").expanduser() / ".cache"
    return Path(home) / "rockburst-mpm" / "numba"


def _writable(folders: list[Path]) -> Path:
    """The first of these folders that can be made and written to; its time stamp becomes now."""
    for folder in folders:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                os.utime(folder)
            return folder
        except OSError:  # read-only, another user's, no home
            continue
    tried = " nor ".join(str(folder.parent) for folder in folders)
    sys.exit(f"no folder for compiled kernels: neither {tried} can be written to; set NUMBA_CACHE_DIR to one that can")


def use_numba_cache() -> None:
    """Point numba at a cache folder named by the hash of all sources with kernels; call before kernels are defined.

    numba's own index looks at the time stamp of the file that holds a kernel, and so misses an edit of a function
    which that kernel calls in another file. A new hash means a new folder; all but the latest few are removed.
    Only files that mention numba count: constants of kernels belong there too. The folder is in the checkout or, where
    nothing can be written there, in the user's cache.
    """
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    digest = hashlib.sha256()
    for package in KERNEL_PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            source = path.read_bytes()
            if b"numba" in source:
                digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + source)
    folder = _writable([base / digest.hexdigest()[:16] for base in (ROOT / ".numba_cache", _user_cache())])
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    if "numba" in sys.modules:  # it has read its environment already
        sys.modules["numba"].config.CACHE_DIR = str(folder)
    others = sorted((entry for entry in folder.parent.iterdir() if entry != folder), key=_last_use)
    for path in others[: 1 - CACHES_KEPT]:
        shutil.rmtree(path, ignore_errors=True)
