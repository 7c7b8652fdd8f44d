"""netCDF files that are complete or absent, have the same bytes for the same content, and show if a byte has changed.

Large arrays of numbers carry netCDF's own checksum (fletcher32), which the library compares when it reads them. All
else (attributes, names, text, times, small arrays) goes into the attribute `checksum`, which is compared on opening.
"""

import hashlib
import json
import os
import zlib
from collections.abc import Collection, Hashable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from xarray.backends import NetCDF4BackendEntrypoint

from common.disk import no_room
from common.errors import InputError

PART_ENDING = ".part"  # Ending of a file that is being written.
MIN_VALUES_COMPRESSED = 4096  # Arrays of fewer values grow when compressed.
# Arrays are stored compressed if a sample of them shrinks to this share of its size or less.
MAX_COMPRESSED_SHARE = 0.7
SAMPLE_VALUES = 1 << 16  # Values of a sample, in runs of VALUES_PER_RUN all over the array.
VALUES_PER_RUN = 1 << 10
MAX_CHUNK_ROWS = 1 << 16  # Chunks of whole rows are read faster than the library's chunks of one component each.
TIME_TYPE = np.dtype("datetime64[ns]")
CHECKSUM = "checksum"  # attribute of a file: digest of what fletcher32 does not cover
SCENE = "scene"  # attribute of a state: what steps have changed up to it, as long as the list of openings
RUN_AGAIN = "delete it and run the same command again"


@contextmanager
def atomic_path(path: str | os.PathLike) -> Iterator[Path]:
    """Give a temporary path next to `path`, unique to the process; rename it to `path` if the body succeeds.

    Raises InputError if the disk has no room for it.
    """
    path = Path(path)
    clear_parts(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}{PART_ENDING}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        os.replace(temporary, path)
    except Exception as error:  # whatever a writer raises on a full disk: netCDF a RuntimeError, numpy an OSError
        if full := no_room(error, path.parent, temporary):
            raise full from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def clear_parts(path: str | os.PathLike) -> None:
    """Remove partial files that killed processes have left next to `path`.

    One process writes a file at a time (Snakemake locks it); what belongs to a process that lives is left alone.
    """
    path = Path(path)
    start = f".{path.name}."
    try:
        names = os.listdir(path.parent)
    except OSError:  # no folder yet; what writes there tells of any other error
        return
    for name in names:
        writer = name.removeprefix(start).removesuffix(PART_ENDING)
        if name == f"{start}{writer}{PART_ENDING}" and writer.isdigit():
            import psutil  # here: there are hardly ever such

            if not psutil.pid_exists(int(writer)):
                path.with_name(name).unlink(missing_ok=True)


def write_dataset(dataset: xr.Dataset, path: str | os.PathLike) -> None:
    """Write `dataset` to netCDF atomically; numbers are compressed without loss, no time stamp is stored."""
    encoding: dict[Hashable, dict[str, Any]] = {}
    # text as text: an empty column of Python objects would be stored as numbers
    text = {name: variable.astype(str) for name, variable in dataset.variables.items() if variable.dtype == object}
    coarse = {name: one for name, one in dataset.variables.items() if one.dtype.kind == "M" and one.dtype != TIME_TYPE}
    times = {name: one.astype(TIME_TYPE) for name, one in coarse.items()}  # as they are read again
    dataset = dataset.assign(text | times)
    dataset = dataset.assign_attrs({CHECKSUM: checksum(dataset)})
    for name, variable in dataset.variables.items():
        for inherited in ("chunksizes", "contiguous", "original_shape", "source"):  # of a file it was read from
            variable.encoding.pop(inherited, None)
        if np.issubdtype(variable.dtype, np.number):
            encoding[name] = {"_FillValue": None}
            if has_fletcher32(variable):
                encoding[name]["fletcher32"] = True
                if is_compressible(variable.values):
                    encoding[name] |= {"zlib": True, "complevel": 1, "shuffle": True}
                encoding[name]["chunksizes"] = (rows_of_chunk(len(variable)), *variable.shape[1:])
    with atomic_path(path) as temporary:
        dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)


def is_compressible(values: np.ndarray) -> bool:
    """True if a sample of the array, shuffled by bytes as netCDF does it, shrinks to less than MAX_COMPRESSED_SHARE."""
    flat = values.reshape(-1)
    starts = np.arange(0, len(flat), max(VALUES_PER_RUN, len(flat) // (SAMPLE_VALUES // VALUES_PER_RUN)))
    sample = np.concatenate([flat[start : start + VALUES_PER_RUN] for start in starts])
    shuffled = np.ascontiguousarray(sample.view(np.uint8).reshape(-1, sample.itemsize).T)
    return len(zlib.compress(shuffled.tobytes(), 1)) < MAX_COMPRESSED_SHARE * shuffled.size


def rows_of_chunk(rows: int) -> int:
    """Rows of each chunk: chunks have equal sizes, and the last one has no padding."""
    return -(-rows // -(-rows // MAX_CHUNK_ROWS))


def has_fletcher32(variable: xr.Variable) -> bool:
    """True if the variable is stored with netCDF's own checksum: more than MIN_VALUES_COMPRESSED numbers."""
    return np.issubdtype(variable.dtype, np.number) and variable.size > MIN_VALUES_COMPRESSED


def checksum(dataset: xr.Dataset) -> str:
    """Digest of the attributes, names and types of a dataset, and of all values that fletcher32 does not cover."""
    described = {
        name: [
            list(variable.dims),
            list(variable.shape),
            "text" if variable.dtype.kind in "OU" else variable.dtype.name,
            plain(variable.attrs),
        ]
        for name, variable in dataset.variables.items()
    }
    attributes = plain({name: value for name, value in dataset.attrs.items() if name != CHECKSUM})
    digest = hashlib.sha256(json.dumps([attributes, described], sort_keys=True).encode())
    for name in sorted(described, key=str):
        variable = dataset.variables[name]
        if not has_fletcher32(variable):
            is_text = variable.dtype.kind in "OU"
            values = variable.values
            native = values.astype(values.dtype.newbyteorder("="), copy=False)
            digest.update(json.dumps(values.tolist()).encode() if is_text else np.ascontiguousarray(native).tobytes())
    return digest.hexdigest()[:32]


def plain(attributes: dict) -> dict[str, str | float | list]:
    """Attributes as they are read again: netCDF has no single-element lists, and knows numpy's types only."""
    found = {name: np.ravel(np.asarray(value)).tolist() for name, value in attributes.items()}
    return {name: values[0] if len(values) == 1 else values for name, values in found.items()}


@contextmanager
def open_dataset(path: str | os.PathLike, remedy: str = RUN_AGAIN) -> Iterator[xr.Dataset]:
    """A netCDF file whose values are read on demand, and not kept; closed at the end of the block.

    remedy: what to do with one that cannot be used. Raises InputError for a missing or unreadable file, and for one
    whose bytes are not those that were written, also where a block that reads its values finds that.
    """
    try:
        dataset = xr.open_dataset(path, engine=NetCDF4BackendEntrypoint, cache=False)  # by name it would look for all
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"{path}: not a readable dataset ({error}); {remedy}") from error
    with dataset:
        if not is_as_written(dataset):
            raise InputError(f"{path}: damaged: its content is not what was written; {remedy}")
        dataset.attrs.pop(CHECKSUM, None)
        try:
            yield dataset
        except (OSError, RuntimeError) as error:  # "NetCDF: HDF error"; of this file, or of another in the same block
            if is_readable(dataset):
                raise
            raise InputError(f"{path}: damaged: {error}; {remedy}") from error


def is_as_written(dataset: xr.Dataset) -> bool:
    """True if attributes, text and small arrays match the file's checksum; True for a file without one."""
    try:
        return dataset.attrs.get(CHECKSUM) in (None, checksum(dataset))
    except (OSError, ValueError, RuntimeError):
        return False


def is_readable(dataset: xr.Dataset) -> bool:
    """True if every variable of the dataset can be read."""
    try:
        for variable in dataset.variables.values():
            variable.values  # noqa: B018
    except (OSError, ValueError, RuntimeError):
        return False
    return True


def read_dataset(path: str | os.PathLike, names: Collection[str] | None = None, remedy: str = RUN_AGAIN) -> xr.Dataset:
    """Read a netCDF file into memory and close it; names: of the only variables to read, as far as there are such.

    The attribute SCENE is left out: only the step that follows a state reads it, and those of all steps of a large mine
    would fill the memory. Raises InputError as open_dataset does.
    """
    with open_dataset(path, remedy) as dataset:
        others = [] if names is None else [name for name in dataset.variables if name not in names]
        dataset.attrs.pop(SCENE, None)
        return dataset.drop_vars(others).load()
