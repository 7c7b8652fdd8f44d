"""The folder of compiled kernels."""

import functools
import hashlib
import os
import shutil
import sys
import tempfile
from pathlib import Path

from common.compiling import patch_numba
from common.kernel_files import share_kernel_files

ROOT = Path(__file__).resolve().parent.parent
KERNEL_PACKAGES = ("mpm_core", "seismic")
CACHES_KEPT = 3


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


@functools.cache
def kernel_hash() -> str:
    """Hash of all sources with kernels. Only files that mention numba count: constants of kernels belong there too."""
    digest = hashlib.sha256()
    for package in KERNEL_PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            if any(part.startswith(".") for part in path.relative_to(ROOT).parts):
                continue  # an editor's
            source = path.read_bytes()
            if b"numba" in source:
                digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + source)
    return digest.hexdigest()[:16]


def use_numba_cache() -> None:
    """Point numba at a cache folder named by the hash of all sources with kernels; call before kernels are defined.

    numba's own index compares the time stamp of the file that holds a kernel, and so misses an edit of a function
    which that kernel calls in another file. A new hash means a new folder; all but the latest few are removed. The
    folder is in the checkout or, where nothing can be written there, in the user's cache. NUMBA_CACHE_DIR names another
    one, in which variables such as $TMPDIR are those of this process, and in which nothing is removed.
    """
    share_kernel_files()
    patch_numba()
    given = os.path.expandvars(os.environ.get("NUMBA_CACHE_DIR", ""))
    if Path(given).name == kernel_hash():
        return  # the process that started this one has set it
    own = given and "$" not in given
    bases = [Path(given)] if own else [ROOT / ".numba_cache", _user_cache()]
    folder = _writable([base / kernel_hash() for base in bases])
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    if "numba" in sys.modules:  # it has read its environment already
        sys.modules["numba"].config.CACHE_DIR = str(folder)
    if own:
        return
    others = sorted((entry for entry in folder.parent.iterdir() if entry != folder), key=_last_use)
    for path in others[: 1 - CACHES_KEPT]:
        shutil.rmtree(path, ignore_errors=True)
