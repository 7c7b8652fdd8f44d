"""Slices of the configuration as a stage reads them."""

import json
import os
from pathlib import Path

from pipeline.errors import InputError


def read_slice(path: str | os.PathLike) -> dict:
    """The slice that a stage is given: a file with one JSON object. Raises InputError for what is none."""
    try:
        values = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"{path}: not readable ({error.strerror}); run the same command again, it is made anew"
        ) from error
    except ValueError as error:
        raise InputError(f"{path}: not JSON ({error}); delete it and run again") from error
    if not isinstance(values, dict):
        raise InputError(f"{path}: not a JSON object; delete it and run again")
    return values
