"""A disk without room is told as such, with its folder: netCDF says "HDF error" only, others a number."""

import errno
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

from common.errors import InputError

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # disk full, quota used up, larger than `ulimit -f` lets a file be
PROBE_BYTES = 1 << 20  # Bytes that the probe writes. A library that has failed has filled the disk to its last block.


def no_room(error: BaseException, folder: str | os.PathLike, half: Path | None = None) -> InputError | None:
    """What to tell the user if `error` came of a lack of room in `folder`, else None.

    half: the file that was being written, about to be removed. A library that hides the system's reason is not asked:
    the system is, whether it would take any more.
    """
    reason = error if isinstance(error, OSError) and error.errno in NO_ROOM else None
    if reason is None and half is not None and half.exists() and not isinstance(error, InputError):
        try:
            with half.open("ab") as file:
                file.write(bytes(PROBE_BYTES))
        except OSError as refusal:
            reason = refusal if refusal.errno in NO_ROOM else None
    return InputError(disk_full(os.strerror(reason.errno or 0), folder)) if reason else None


def full_one(folders: Sequence[str | Path]) -> Path:
    """The first of these folders that takes no more, or the first: an error of a write does not say of which file."""
    for folder in folders:
        try:
            with tempfile.TemporaryFile(dir=Path(folder)) as file:
                file.write(bytes(PROBE_BYTES))
        except OSError as refusal:
            if refusal.errno in NO_ROOM:
                return Path(folder)
    return Path(folders[0])


def disk_full(reason: str, folder: str | os.PathLike) -> str:
    """The line that a user reads; reason: the system's own words."""
    return (
        f"the disk is full: no room in {Path(folder).absolute()} ({reason}); free some and run the same command again, "
        "what is finished stays"
    )
