"""netCDF files that are either whole or absent, with the same bytes for the same content."""

import glob
import os
import zlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil
import xarray as xr

from pipeline.disk import no_room
from pipeline.errors import InputError

PART = ".part"  # ending of a file that is being written
COMPRESS_ABOVE = 4096  # values; smaller arrays grow when compressed
WORTH_IT = 0.7  # compressed over plain size of a sample; stresses and forces shrink to 0.9 only, at 50 MB/s
SAMPLE = 1 << 16  # values of a sample, in runs of RUN all over the array
RUN = 1 << 10
TENSORS = 1 << 16  # of six components in a chunk: a third faster than the library's chunks of one component each


@contextmanager
def atomic_path(path: str | os.PathLike) -> Iterator[Path]:
    """Give a temporary path beside `path`, unique to the process; rename it to `path` if the body succeeds.

    Raises InputError if the disk has no room for it.
    """
    path = Path(path)
    clear_parts(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}{PART}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        os.replace(temporary, path)
    except Exception as error:  # whatever a writer raises on a full disk: netCDF a RuntimeError, numpy an OSError
        if told := no_room(error, path.parent, temporary):
            raise told from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def clear_parts(path: str | os.PathLike) -> None:
    """Remove what processes that were killed as they wrote `path` have left beside it.

    One process writes a file at a time (Snakemake locks it); what belongs to a process that lives is left alone.
    """
    path = Path(path)
    for part in path.parent.glob(f".{glob.escape(path.name)}.*{PART}"):
        writer = part.name.removeprefix(f".{path.name}.").removesuffix(PART)
        if writer.isdigit() and not psutil.pid_exists(int(writer)):
            part.unlink(missing_ok=True)


def write_dataset(dataset: xr.Dataset, path: str | os.PathLike) -> None:
    """Write `dataset` to netCDF atomically; numbers are compressed without loss, no time stamp is stored."""
    encoding = {}
    # text as text: an empty column of Python objects would be stored as numbers
    text = {name: variable.astype(str) for name, variable in dataset.variables.items() if variable.dtype == object}
    dataset = dataset.assign(text)
    for name, variable in dataset.variables.items():
        for inherited in ("chunksizes", "contiguous", "original_shape", "source"):  # of a file it was read from
            variable.encoding.pop(inherited, None)
        if np.issubdtype(variable.dtype, np.number):
            encoding[name] = {"_FillValue": None}
            if variable.size > COMPRESS_ABOVE and is_compressible(variable.values):
                encoding[name] |= {"zlib": True, "complevel": 1, "shuffle": True}
                if variable.shape[1:] == (6,):
                    encoding[name]["chunksizes"] = (min(TENSORS, len(variable)), 6)
    with atomic_path(path) as temporary:
        dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)


def is_compressible(values: np.ndarray) -> bool:
    """Whether a sample of the array shrinks enough, its bytes shuffled as netCDF does it."""
    flat = values.reshape(-1)
    starts = np.arange(0, len(flat), max(RUN, len(flat) // (SAMPLE // RUN)))
    sample = np.concatenate([flat[start : start + RUN] for start in starts])
    shuffled = np.ascontiguousarray(sample.view(np.uint8).reshape(-1, sample.itemsize).T)
    return len(zlib.compress(shuffled, 1)) < WORTH_IT * shuffled.size


def open_dataset(path: str | os.PathLike) -> xr.Dataset:
    """A netCDF file whose values are read when asked for, and not kept; to be closed. Raises as read_dataset."""
    try:
        return xr.open_dataset(path, engine="netcdf4", cache=False)
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"{path}: not a readable dataset ({error}); delete it and run again") from error


def read_dataset(path: str | os.PathLike, names: Collection[str] | None = None) -> xr.Dataset:
    """Read a netCDF file into memory and close it; names: of the only variables to read, as far as there are such.

    Raises InputError for a missing or unreadable file.
    """
    try:
        with open_dataset(path) as dataset:
            others = [] if names is None else [name for name in dataset.variables if name not in names]
            return dataset.drop_vars(others).load()
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"{path}: not a readable dataset ({error}); delete it and run again") from error
