"""What a result was made from: configuration, sources, inputs and package versions, never the time of day.

A result carries `made_from`, a digest of its slice of the configuration, the sources of its stage, the content of the
files that the slice names, and the `made_from` of the results that it was made of. So it identifies all that came
before it. The workflow compares it with its present value (workflow/stage_inputs.py), independently of file times.
"""

import functools
import hashlib
import json
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator
from importlib.metadata import version
from pathlib import Path

import netCDF4

from common.compiling import compile_less
from common.kernel_files import share_kernel_files
from common.sources import ROOT, source_hash

PACKAGES = ("numpy", "numba", "scipy", "scikit-learn", "xarray", "netCDF4", "obspy")
KERNEL_PACKAGES = ("mpm_core", "seismic")
CACHES_KEPT = 3
MADE_FROM = "made_from"
AS_WRITTEN = {"config", "default"}  # keys of the report's slice
COMMENT_BYTES = 200  # Bytes at the end of a page in which its comment is searched.


def config_hash(slice_: dict) -> str:
    """Hash of a configuration slice, independent of key order and of the folder that its files are in."""

    def without_folder(pairs: list[tuple]) -> dict:
        return {key: Path(value).name if key == "file" and isinstance(value, str) else value for key, value in pairs}

    text = json.dumps(slice_, sort_keys=True)
    if '"file"' in text:  # else as it is: a large mine has hundreds of slices of thousands of excavations
        text = json.dumps(json.loads(text, object_pairs_hook=without_folder), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def provenance(slice_: dict, command: str, inputs: Iterable[str | os.PathLike] = ()) -> dict[str, str]:
    """Attributes that every dataset carries: config_hash, source_hash, made_from, versions (JSON).

    command: the stage that makes it, as common.sources has it ("mpm_core grid"); inputs: the results it is made of.
    """
    return {
        "config_hash": config_hash(slice_),
        "source_hash": source_hash(command),
        MADE_FROM: made_from(slice_, command, inputs),
        "versions": json.dumps({name: version(name) for name in PACKAGES}),
    }


def made_from(slice_: dict, command: str, inputs: Iterable[str | os.PathLike] = ()) -> str:
    """Digest of all that a result depends on; arguments as in provenance. Missing inputs count as such."""
    return identity(config_hash(slice_), files_of(slice_), command, inputs)


def identity(config: str, files: Iterable[Path], command: str, inputs: Iterable[str | os.PathLike]) -> str:
    """The same from a slice's config_hash and the files that it names."""
    digest = hashlib.sha256(f"{config} {source_hash(command)}".encode())
    for path in files:
        digest.update(content_of(path).encode())
    for made in sorted(read_made_from(path) or "" for path in inputs):
        digest.update(f" {made}".encode())
    return digest.hexdigest()[:16]


def files_of(slice_) -> Iterator[Path]:
    """Files and folders that a slice names by the key `file`, in the order of the slice's keys.

    Not those of a configuration as it was written (AS_WRITTEN): the report quotes it, and opens none of its files.
    """
    if isinstance(slice_, dict):
        for key in sorted(slice_.keys() - AS_WRITTEN):
            if key == "file" and isinstance(slice_[key], str):
                yield Path(slice_[key])
            else:
                yield from files_of(slice_[key])
    elif isinstance(slice_, list | tuple):
        for entry in slice_:
            yield from files_of(entry)


@functools.cache
def content_of(path: Path) -> str:
    """Digest of a file's bytes, of a folder's names and bytes (hidden ones left out); empty if it cannot be read."""
    try:
        if path.is_dir():
            inside = sorted(entry for entry in path.iterdir() if not entry.name.startswith("."))
            text = "".join(f"{entry.name}\0{content_of(entry)}\0" for entry in inside)
            return hashlib.sha256(text.encode()).hexdigest()
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:  # the stage that reads it says why
        return ""


def read_made_from(path: str | os.PathLike) -> str | None:
    """The `made_from` that a result carries; None if it is missing, cannot be read or carries none.

    A dataset has it as an attribute, a page or QuakeML file in a comment at its end (see comment).
    """
    path = Path(path)
    try:
        if path.suffix == ".nc":
            with netCDF4.Dataset(path) as dataset:
                return str(getattr(dataset, MADE_FROM, "")) or None
        with path.open("rb") as file:
            file.seek(-min(COMMENT_BYTES, path.stat().st_size), os.SEEK_END)
            found = re.search(comment("([0-9a-f]{16})"), file.read().decode(errors="replace"))
    except OSError:
        return None
    return found[1] if found else None


def comment(identity: str) -> str:
    """The last line of a page or QuakeML file: what it was made from."""
    return f"<!-- {MADE_FROM}: {identity} -->\n"


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
            source = path.read_bytes()
            if b"numba" in source:
                digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + source)
    return digest.hexdigest()[:16]


def use_numba_cache() -> None:
    """Point numba at a cache folder named by the hash of all sources with kernels; call before kernels are defined.

    numba's own index compares the time stamp of the file that holds a kernel, and so misses an edit of a function
    which that kernel calls in another file. A new hash means a new folder; all but the latest few are removed. The
    folder is in the checkout or, where nothing can be written there, in the user's cache.
    """
    share_kernel_files()
    compile_less()
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    folder = _writable([base / kernel_hash() for base in (ROOT / ".numba_cache", _user_cache())])
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    if "numba" in sys.modules:  # it has read its environment already
        sys.modules["numba"].config.CACHE_DIR = str(folder)
    others = sorted((entry for entry in folder.parent.iterdir() if entry != folder), key=_last_use)
    for path in others[: 1 - CACHES_KEPT]:
        shutil.rmtree(path, ignore_errors=True)
