"""Messages for a full disk that name its folder: netCDF reports only "HDF error", other libraries a number."""

import errno
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

from common.errors import InputError

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # disk full, quota used up, larger than `ulimit -f` lets a file be
PROBE_BYTES = 1 << 20  # Bytes that the probe writes. A library that has failed has filled the disk to its last block.


def no_room(error: BaseException, folder: str | os.PathLike, half: Path | None = None) -> InputError | None:
    """Message for the user if `error` was caused by a full disk at `folder`, else None.

    half: the file that was being written, which is about to be removed. Some libraries hide the system's reason, so
    this function tests whether the system can write any more.
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
    """The first of these folders whose disk is full, or the first one: a write error does not name its file."""
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
